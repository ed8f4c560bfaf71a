// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/model.h>

#include <Eigen/Geometry>

namespace bocst::scene {

/// A box around a geometry G, in its frame.
struct Bounds {
  enum Kind {
    kBox,
    kEverywhere,  ///< It has no bounds: planes and half-spaces.
    kNowhere,     ///< It has nothing to touch: an octree without occupied cells.
  };
  Kind kind = kBox;
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();  ///< Columns: unit vectors.
  Eigen::Vector3d half = Eigen::Vector3d::Zero();      ///< Along them.
  double reach = 0;  ///< It may touch what is so far from the box: margin, tolerance of FCL's solvers.

  // Set by boundsOf().
  double radius = 0;  ///< Of the box, about its center.
  double size = 0;    ///< Of the box, about the frame's origin.
  double width = 0;   ///< The least of its three extents.
};

/// Of a Model, a shape or an OcTree.
template <typename S>
Bounds boundsOf(const fcl::CollisionGeometry<S>& geometry);

}  // namespace bocst::scene
