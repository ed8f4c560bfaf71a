// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>

#include "log/assert.h"

namespace bocst::query {

/// Pairs of triangles in one frame, as structure of arrays: coordinate c of corner k of the first at [3 * k + c], of
/// the second at [9 + 3 * k + c].
struct TrianglePairs {
  static constexpr std::size_t kCapacity = 32;
  static_assert(kCapacity <= 32, "results have a bit a pair, see PairPenetrations");
  alignas(64) double xyz[18][kCapacity];
  std::size_t count = 0;

  template <typename Corners>
  void put(std::size_t i, const Corners& p, const Corners& q) {
    BOCST_ASSERT(i < kCapacity);
    for (int k = 0; k < 9; ++k) {
      xyz[k][i] = p[k / 3][k % 3];
      xyz[9 + k][i] = q[k / 3][k % 3];
    }
  }
  template <typename Corners>
  void get(std::size_t i, Corners& p, Corners& q) const {
    for (int k = 0; k < 9; ++k) {
      p[k / 3][k % 3] = xyz[k][i];
      q[k / 3][k % 3] = xyz[9 + k][i];
    }
  }
};

/// Below this sine of the angle between two planes, their line is too uncertain to say where triangles cut each other.
constexpr double kLeastSineOfPlanes = 1e-6;

/// What trianglePenetrations() says of each pair.
struct PairPenetrations {
  alignas(64) double normal[3][TrianglePairs::kCapacity];
  alignas(64) double point[3][TrianglePairs::kCapacity];
  alignas(64) double depth[TrianglePairs::kCapacity];  ///< Negative: a gap along normal. 0 where nothing has an area.
  // A bit a pair:
  std::uint32_t no_point = 0;  ///< The triangles cut each other in no segment that has its ends inside of edges.
  std::uint32_t meet = 0;      ///< They meet, wherever in the tolerance their corners are.
  std::uint32_t apart = 0;     ///< They are apart, likewise.
};

/// The least depth is the distance of the origin from the boundary of the convex set P - Q. Moving corners by less than
/// e moves that boundary by less than 2 e, wherever it is, so triangles whose depth is more meet still. The depth
/// computed is the least but for axes that are mostly rounding: a face with such a normal is narrow, at most 1e-6 of
/// the edges wide or with a normal true to 1e-9, so by way of at most 22 of them there is a face that is not, and is no
/// more than 3e-5 of the edges farther away. `meet` and `apart` ask for 1e-4 of the longest edge, and the tolerance.
void penetrationsOfPairs(const TrianglePairs& pairs, double tolerance, PairPenetrations& contacts);

}  // namespace bocst::query
