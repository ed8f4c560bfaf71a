// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>

#include "oracle/oracle.h"

namespace bocst::tree {

/// The corners of a leaf's triangles side by side, as 16-bit steps on a grid of the leaf's own: what a query would else
/// collect from places all over the mesh. Coordinate c of corner k of triangle i is steps[(3 * k + c) * count + i].
///
/// A coordinate is origin + step * q in lattice units, origin a whole number and step a power of two, so all of it is
/// exact in float but for q, which is off by half a step.
class PackedTriangles {
 public:
  static constexpr std::size_t kRows = 9;

  /// How many words `count` triangles take. Whole vectors of eight are read, so there is some room beyond.
  static std::size_t words(std::size_t count) { return kHeader + (kRows * count + 1) / 2 + kBeyond; }

  /// Writes words(count) words.
  static void pack(const oracle::Surface& surface, const std::uint32_t* ids, std::size_t count, std::uint32_t* words);

  PackedTriangles() = default;
  PackedTriangles(const std::uint32_t* words, std::size_t count);

  std::size_t count = 0;
  float origin[3] = {0, 0, 0};
  float step = 0;
  const std::uint16_t* steps = nullptr;

 private:
  static constexpr std::size_t kHeader = 4, kBeyond = 4;
};

}  // namespace bocst::tree
