// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>

namespace bocst::query {

/// Pairs of triangles in one frame, as structure of arrays: coordinate c of corner k of the first at [3 * k + c], of
/// the second at [9 + 3 * k + c].
struct TrianglePairs {
  static constexpr std::size_t kCapacity = 32;
  alignas(64) double xyz[18][kCapacity];
  std::size_t count = 0;

  template <typename Corners>
  void put(std::size_t i, const Corners& p, const Corners& q) {
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

/// How each of them is parted, see partTriangles().
struct PairTouches {
  alignas(64) double normal[3][TrianglePairs::kCapacity];
  alignas(64) double point[3][TrianglePairs::kCapacity];
  alignas(64) double depth[TrianglePairs::kCapacity];
  std::uint32_t no_point = 0;  ///< Bit i: triangles i cut each other in no segment that has its ends inside of edges.
};

void partPairs(const TrianglePairs& pairs, PairTouches& touches);

}  // namespace bocst::query
