// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

namespace bocst::io {

using CornerTriple = std::array<std::uint32_t, 3>;  ///< Numbers of three corners of one polygon.

/// The sign of the area of the triangle abc, exact for sizes between 1e-140 and 1e140: 1 where it turns left.
int orientation(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c);

/// Cuts a polygon of n >= 3 corners that turns left into n - 2 triangles, in O(n log n). An empty `flat` is a polygon
/// that has no area, which becomes a fan.
std::vector<CornerTriple> cutPolygon(const std::vector<Eigen::Vector2d>& flat, std::size_t n);

}  // namespace bocst::io
