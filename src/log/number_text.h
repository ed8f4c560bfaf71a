// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <charconv>
#include <string>

namespace bocst {

/// A number for a message: with as few digits as tell it from all others, in every locale.
inline std::string numberText(double number) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, number).ptr};
}

/// The same of a point, as "(x, y, z)".
inline std::string pointText(const Eigen::Vector3d& v) {
  return "(" + numberText(v.x()) + ", " + numberText(v.y()) + ", " + numberText(v.z()) + ")";
}

}  // namespace bocst
