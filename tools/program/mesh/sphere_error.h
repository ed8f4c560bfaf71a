// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>
#include <bocst/node_view.h>

#include <cstddef>
#include <vector>

namespace bocst::program {

/// The paper's error (5.2) over the nodes of one level, as if they were the leaves of a tree that ends there.
struct LevelError {
  std::size_t nodes = 0;
  double min = 0;
  double average = 0;
  double max = 0;
};

/// Error_i = max over s on sphere_i of dist(s, O_i) / diam(sphere_root), where O_i is the surface inside sphere_i:
/// about how far from the surface a conservative answer can be (points inside the sphere, which can be farther, do not
/// count). This is the reading of 5.2 in which "the maximum error is equal to 1.0 when the root sphere is tangent to
/// the object surface" holds: all of O_i at one point of the sphere leaves the opposite point a diameter away. (The
/// distance from O_i to the sphere would be 0 there, and never above 0.5.) dist is exact; s runs over 64 directions,
/// the best is refined by pattern search to about a hundredth, so the result may be a little below the maximum.
///
/// @param nodes a whole tree as Model::visit() gives it, parents before children.
/// @return levels from 1 on.
std::vector<LevelError> errorByLevel(const Mesh& mesh, const std::vector<NodeView>& nodes);

}  // namespace bocst::program
