// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>

#include "oracle/oracle.h"

namespace bocst::tree {

/// The corners of a leaf's triangles side by side, as 16-bit steps on a grid of the leaf's own: what a query would else
/// collect from places all over the mesh. In groups of eight triangles: coordinate c of corner k of triangle i of group
/// g at steps()[72 * g + 8 * (3 * k + c) + i]; the last triangle fills the last group up.
///
/// A coordinate is origin + step * q in lattice units, origin a whole number and step a power of two, so all of it is
/// exact in float but for q, which is off by half a step.
class PackedTriangles {
 public:
  static constexpr std::size_t kGroup = 8;
  static constexpr std::size_t kGroupSteps = 9 * kGroup;

  /// How many words a list of `count` triangles takes, packed.
  static std::size_t words(std::size_t count) { return kHeader + groups(count) * kGroupSteps / 2; }

  /// Writes words(count) words.
  static void pack(const oracle::Surface& surface, const std::uint32_t* ids, std::size_t count, std::uint32_t* words);

  PackedTriangles() = default;
  PackedTriangles(const std::uint32_t* words, std::size_t count);

  std::size_t count = 0;
  float origin[3] = {0, 0, 0};
  float step = 0;
  const std::uint16_t* steps = nullptr;

 private:
  static constexpr std::size_t kHeader = 4;
  static std::size_t groups(std::size_t count) { return (count + kGroup - 1) / kGroup; }
};

}  // namespace bocst::tree
