// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>

#include <Eigen/Core>
#include <array>
#include <map>
#include <memory>
#include <string>
#include <utility>

namespace bocst::program {

/// Reads each mesh file once.
class MeshStore {
 public:
  /// @param scale of each axis; negative mirrors. @throws std::runtime_error as loadMesh(), and for a scale that is no
  /// number or 0.
  std::shared_ptr<const Mesh> get(const std::string& file, const Eigen::Vector3d& scale);

 private:
  std::map<std::pair<std::string, std::array<double, 3>>, std::shared_ptr<const Mesh>> meshes_;
};

}  // namespace bocst::program
