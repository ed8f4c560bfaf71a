// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/node_view.h>

#include <algorithm>
#include <iterator>
#include <string>
#include <vector>

#include "mesh/sphere_fit.h"

namespace bocst::program {

/// The nodes of a tree that ends at this level: together their spheres hold the whole surface.
inline std::vector<NodeView> leavesAt(const std::vector<NodeView>& nodes, int level) {
  std::vector<NodeView> leaves;
  std::copy_if(nodes.begin(), nodes.end(), std::back_inserter(leaves), [level](const NodeView& node) {
    return node.level == level || (node.level < level && node.children.empty());
  });
  return leaves;
}

/// The spheres of nodes.
std::vector<Sphere> spheresOf(const std::vector<NodeView>& nodes);

/// Spheres as a file, in the mesh's frame and length unit, by its ending:
///  .json         a list of {"center": [x, y, z], "radius": r}
///  .ply          vertices with x, y, z and radius, as text
///  .yaml, .yml   collision_spheres of one link, as GPU planners (cuRobo) read them
/// @throws std::invalid_argument for any other ending.
std::string sphereFile(const std::string& file, const std::vector<Sphere>& spheres, const std::string& link);

/// @throws std::invalid_argument for an ending that sphereFile() does not know.
void checkSphereFile(const std::string& file);

}  // namespace bocst::program
