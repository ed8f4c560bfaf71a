// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>

namespace bocst::render {

enum class Up { kY, kZ };

/// An orthographic camera: what it sees is a cylinder about an axis through `center`.
struct View {
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();  ///< Rows: to the right, upwards, towards the eye.
  Eigen::Vector3d center = Eigen::Vector3d::Zero();    ///< What is in the middle of the picture.
  double radius = 1;                                   ///< From there to the nearer borders.
  double reach = 1;  ///< From the centre towards the eye and away from it; nothing is drawn beyond.

  /// From a point at these angles about the axis that is up, in radians.
  static Eigen::Matrix3d axesFrom(double turn, double tilt, Up up);

  /// To the right, upwards and towards the eye, in units of `radius`.
  Eigen::Vector3d toEye(const Eigen::Vector3d& point) const { return axes * (point - center) / radius; }

  /// In pixels, from the upper left corner.
  Eigen::Vector2d toPixel(const Eigen::Vector3d& point, int width, int height) const;
};

}  // namespace bocst::render
