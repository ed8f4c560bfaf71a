// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/geometry/collision_geometry.h>
#include <fcl/geometry/shape/box.h>
#include <fcl/geometry/shape/capsule.h>
#include <fcl/geometry/shape/cylinder.h>
#include <fcl/geometry/shape/sphere.h>

#include <Eigen/Geometry>
#include <cstddef>
#include <memory>
#include <type_traits>
#include <vector>

#include "robot/parts.h"

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

/// Poses in the scalar of queries. Keeps a reference to those of double.
template <typename S>
class ScenePoses {
 public:
  ScenePoses(const std::vector<Eigen::Isometry3d>& poses, std::size_t moving) : moving_(moving), given_(poses) {
    if constexpr (!std::is_same_v<S, double>) {
      own_.reserve(poses.size());
      for (const Eigen::Isometry3d& X : poses) own_.push_back(X.cast<S>());
    }
  }

  std::size_t states() const { return given_.size() / moving_; }

  /// X_WB of each moving body.
  const fcl::Transform3<S>* state(std::size_t k) const {
    if constexpr (std::is_same_v<S, double>) {
      return given_.data() + k * moving_;
    } else {
      return own_.data() + k * moving_;
    }
  }

 private:
  std::size_t moving_;
  const std::vector<Eigen::Isometry3d>& given_;
  std::vector<fcl::Transform3<S>> own_;
};

}  // namespace bocst::program
