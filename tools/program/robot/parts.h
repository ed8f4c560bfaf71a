// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>

#include <Eigen/Geometry>
#include <memory>
#include <string>
#include <vector>

namespace bocst::program {

/// Larger sizes and coordinates of positions are refused, as those of meshes are: FCL's solvers compute with squares.
constexpr double kMostLength = 1e75;

/// A mesh or a body about the origin of its own frame.
struct Shape {
  enum class Kind { kMesh, kBox, kSphere, kCylinder, kCapsule };

  Kind kind = Kind::kBox;
  /// A box: its edges. Others: the radius, then the length along z, that of a capsule without its caps.
  Eigen::Vector3d size = Eigen::Vector3d::Zero();
  std::shared_ptr<const Mesh> mesh;  ///< Only of kMesh; shared by all shapes of one file and scale.
};

/// A shape of a part.
struct PlacedShape {
  Shape shape;
  Eigen::Isometry3d X_PS = Eigen::Isometry3d::Identity();  ///< In the part's frame.
};

/// What answers name: a link of the robot or an object. Its shapes do not move to each other.
struct Part {
  std::string name;
  std::vector<PlacedShape> shapes;
  bool has_visual = false;  ///< Of a link: there is something to be seen, which is not checked.
};

}  // namespace bocst::program
