// SPDX-License-Identifier: BSD-3-Clause
#include "picture/picture_scene.h"

#include <algorithm>

#include "picture/page.h"

namespace bocst::program {

double radiusToSee(double radius, const Eigen::Vector3d& center) {
  constexpr double kResolved = 1e-12, kSmallest = 1e-290;
  return std::max({radius, kResolved * center.cwiseAbs().maxCoeff(), kSmallest});
}

render::Volumes volumesOf(const std::vector<NodeView>& nodes, const Mesh& mesh, const Options& options,
                          render::Volumes::Shape shape) {
  render::Volumes volumes;
  volumes.shape = shape;
  volumes.color = kVolumeColors[0];
  volumes.opacity = 0.5f;
  volumes.all.reserve(nodes.size());
  for (const NodeView& node : nodes) {
    volumes.all.push_back({node.center, halfRegion(node, mesh, options.subdivision, options.dimension), node.radius});
  }
  return volumes;
}

std::string nameOf(Subdivision subdivision) { return subdivision == Subdivision::kOctree ? "O-BOCST" : "B-BOCST"; }

}  // namespace bocst::program
