// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/geometry/collision_geometry.h>
#include <fcl/geometry/shape/box.h>
#include <fcl/geometry/shape/capsule.h>
#include <fcl/geometry/shape/cylinder.h>
#include <fcl/geometry/shape/sphere.h>

#include <memory>
#include <vector>

#include "scene/parts.h"

namespace bocst::program {

/// FCL's geometry of a shape that is no mesh.
template <typename S>
std::shared_ptr<fcl::CollisionGeometry<S>> solidOf(const Shape& shape) {
  const fcl::Vector3<S> size = shape.size.cast<S>();
  switch (shape.kind) {
    case Shape::Kind::kSphere:
      return std::make_shared<fcl::Sphere<S>>(size[0]);
    case Shape::Kind::kCylinder:
      return std::make_shared<fcl::Cylinder<S>>(size[0], size[1]);
    case Shape::Kind::kCapsule:
      return std::make_shared<fcl::Capsule<S>>(size[0], size[1]);
    default:
      return std::make_shared<fcl::Box<S>>(size);
  }
}

/// Poses in the scalar of queries.
template <typename S>
std::vector<fcl::Transform3<S>> cast(const std::vector<Eigen::Isometry3d>& poses) {
  std::vector<fcl::Transform3<S>> result;
  result.reserve(poses.size());
  for (const Eigen::Isometry3d& X : poses) result.push_back(X.cast<S>());
  return result;
}

}  // namespace bocst::program
