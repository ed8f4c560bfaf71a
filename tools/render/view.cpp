// SPDX-License-Identifier: BSD-3-Clause
#include "render/view.h"

#include <algorithm>
#include <cmath>

namespace bocst::render {

Eigen::Matrix3d View::axesFrom(double turn, double tilt, Up up) {
  Eigen::Matrix3d axes;
  axes.row(0) << -std::sin(turn), std::cos(turn), 0;
  axes.row(2) << std::cos(tilt) * std::cos(turn), std::cos(tilt) * std::sin(turn), std::sin(tilt);
  axes.row(1) = axes.row(2).cross(axes.row(0));
  if (up == Up::kZ) return axes;
  Eigen::Matrix3d stand_up;  // y becomes z
  stand_up << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  return axes * stand_up;
}

Eigen::Vector2d View::toPixel(const Eigen::Vector3d& point, int width, int height) const {
  const Eigen::Vector3d eye = toEye(point) * std::min(width, height) / 2;
  return {width / 2.0 + eye.x(), height / 2.0 - eye.y()};
}

}  // namespace bocst::render
