// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>

#include <Eigen/Geometry>
#include <cstddef>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "cli/arguments.h"
#include "pairs/poses.h"
#include "pairs/query_pair.h"

namespace bocst::program {

/// Two meshes with what one query for contacts grew in two fresh models, to be shown.
struct GrownPair {
  /// Looks for at most `limit` contacts.
  GrownPair(std::string file_a, const Mesh& a, std::string file_b, const Mesh& b, const ModelArguments& model,
            const Pose& pose, std::size_t limit);

  std::string name_a, name_b;
  const Mesh& mesh_a;
  const Mesh& mesh_b;
  ModelArguments model;
  Pose pose;  ///< Of B in A's frame.
  std::unique_ptr<BocstPair> pair;
  std::vector<TouchingPoint> contacts;
  std::vector<std::pair<std::string, std::string>> facts;  ///< What else is to be said.
};

}  // namespace bocst::program
