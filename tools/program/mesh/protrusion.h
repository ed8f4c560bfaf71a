// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <vector>

#include "mesh/closest_point.h"

namespace bocst::program {

/// A bound from above of the greatest distance from a point on the sphere to the nearest of some triangles: at most
/// half a percent (or a thousandth of the radius, if that is more) above the greatest, up to rounding. Points inside
/// the sphere do not count.
///
/// @param some ids of triangles, at least one.
/// @param enough if the greatest distance is above this, the bound may be coarser.
double protrusionOf(const Eigen::Vector3d& center, double radius, const std::vector<BoundedTriangle>& triangles,
                    const std::vector<std::uint32_t>& some, double enough = std::numeric_limits<double>::infinity());

}  // namespace bocst::program
