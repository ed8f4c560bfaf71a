// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "lattice/limits.h"
#include "tree/bulk_kernels.h"

namespace bocst::tree {

/// The corners of a leaf's triangles side by side, as 16-bit steps on a grid of the leaf's own, each place once: what a
/// query would else collect from places all over the mesh.
///
/// A coordinate is origin + step * q in lattice units, origin a whole number and step a power of two, so all of it is
/// exact in float but for q.
class PackedTriangles {
 public:
  static constexpr std::size_t kMostTriangles = kMaxLeafTriangles, kMostPlaces = 3 * kMostTriangles;
  static constexpr double kMost = 65535;  ///< Steps along an axis.
  /// How far a packed corner may be from where it is along an axis, in steps: half a step, a quarter of one by which
  /// float corners are off before, and a hundredth of one in the sums.
  static constexpr float kError = 0.76f;

  /// Packs triangles begin to begin + count - 1, at most kMostTriangles and at least one, of corners that count from
  /// `base`; returns how many words that takes: none where their grid would be too coarse.
  using Words = std::array<std::uint32_t, 192>;
  static std::size_t pack(const CornerRows& corners, std::size_t begin, std::size_t count, const float (&base)[3],
                          Words& words);

  PackedTriangles() = default;
  PackedTriangles(const std::uint32_t* words, std::size_t count);

  /// How many words they take.
  std::size_t words() const { return words(count, places); }

  std::size_t count = 0;   ///< Triangles.
  std::size_t places = 0;  ///< Of corners.
  float origin[3] = {0, 0, 0};
  float step = 0;
  // Whole vectors of eight may be read of both.
  const std::uint16_t* steps = nullptr;   ///< Coordinate c of place p at [c * places + p].
  const std::uint8_t* corners = nullptr;  ///< The place of corner k of triangle i at [k * count + i].

 private:
  // The number of places, the exponent of step, the origin; steps, corners, and room for the last vectors.
  static constexpr std::size_t kHeader = 2;
  static constexpr std::size_t words(std::size_t count, std::size_t places) {
    constexpr std::size_t kLanes = 8;
    const std::size_t steps = 3 * places * sizeof(std::uint16_t), corners = 3 * count;
    const std::size_t rest = std::max((kLanes - 1) * sizeof(std::uint16_t), corners + kLanes - 1);
    return kHeader + (steps + rest + sizeof(std::uint32_t) - 1) / sizeof(std::uint32_t);
  }
};

}  // namespace bocst::tree
