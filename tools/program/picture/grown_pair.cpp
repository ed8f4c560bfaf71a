// SPDX-License-Identifier: BSD-3-Clause
#include "picture/grown_pair.h"

#include <chrono>
#include <filesystem>

namespace bocst::program {

GrownPair::GrownPair(std::string file_a, const Mesh& a, std::string file_b, const Mesh& b,
                     const ModelArguments& arguments, const Pose& X_AB, std::size_t limit)
    : name_a(std::filesystem::path(std::move(file_a)).filename().string()),
      name_b(std::filesystem::path(std::move(file_b)).filename().string()),
      mesh_a(a),
      mesh_b(b),
      model(arguments),
      pose(X_AB) {
  Options options = model.options();
  options.ttl = std::chrono::milliseconds(0);
  pair =
      makeBocstPair(model.scalarKind(), MeshArrays(a, model.scalarKind()), MeshArrays(b, model.scalarKind()), options);
  contacts = pair->touchingPoints(pose.transform(), limit);
}

}  // namespace bocst::program
