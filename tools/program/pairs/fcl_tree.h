// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/geometry/bvh/BVH_model.h>

#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "pairs/query_pair.h"

namespace bocst::program {

inline const std::vector<fcl::Vector3d>& verticesFor(const std::vector<Eigen::Vector3d>& vertices, double) {
  return vertices;
}

inline std::vector<fcl::Vector3f> verticesFor(const std::vector<Eigen::Vector3d>& vertices, float) {
  std::vector<fcl::Vector3f> rounded;
  rounded.reserve(vertices.size());
  for (const Eigen::Vector3d& v : vertices) rounded.push_back(v.cast<float>());
  return rounded;
}

/// @throws std::runtime_error for what FCL returns if it refuses a mesh.
inline void checkFclCode(int code) {
  if (code != fcl::BVH_OK) throw std::runtime_error("FCL does not accept the mesh, code " + std::to_string(code));
}

/// Builds FCL's tree of a mesh. @throws std::runtime_error if FCL refuses it.
template <typename BV>
std::unique_ptr<fcl::BVHModel<BV>> buildFclTree(const MeshArrays& mesh) {
  auto model = std::make_unique<fcl::BVHModel<BV>>();
  checkFclCode(model->beginModel(static_cast<int>(mesh.triangles.size()), static_cast<int>(mesh.vertices.size())));
  checkFclCode(model->addSubModel(verticesFor(mesh.vertices, typename BV::S{}), mesh.triangles));
  checkFclCode(model->endModel());
  return model;
}

}  // namespace bocst::program
