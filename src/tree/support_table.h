// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <atomic>

#include "lattice/lattice.h"

namespace bocst::tree {

/// How far a surface reaches in any direction, from above: the support function of its convex hull, kept for the
/// directions of a grid on the faces of a cube. As it is convex and scales with the direction, what is interpolated
/// linearly between three of them is never too small.
///
/// Directions have largest entry 1; lengths are lattice units, positions count from the middle of the root's cube.
///
/// Threads: every value is an upper bound by itself, so they are read and lowered without a lock; also beside start(),
/// where Outline::read() tells whether what was read is of one surface.
class SupportTable {
 public:
  static constexpr int kCells = 6;  ///< Along the side of a face.
  static constexpr int kRow = kCells + 1;
  static constexpr int kCount = 6 * kRow * kRow;

  /// Of number (face * kRow + i) * kRow + j, point (i, j) of face 2 * k + (1 if negative): entry k is 1 or -1, those
  /// after it run from -1 to 1 with i and j.
  static Eigen::Vector3d direction(int number);

  /// All that is known is a box, in the lattice's coordinates.
  void start(const Eigen::AlignedBox3d& box, const lattice::Lattice& lattice);

  /// Coordinate k of the middle of that box.
  float center(std::size_t k) const { return center_[k].load(std::memory_order_acquire); }

  /// The lattice in the mesh's frame, rounded to float: its unit, and coordinate k of the middle of the root's cube.
  float unit() const { return unit_.load(std::memory_order_acquire); }
  float middle(std::size_t k) const { return middle_[k].load(std::memory_order_acquire); }

  /// About how far it is from there to the hull's surface, at least; for what only wants a guess.
  float innerRadius() const { return inner_radius_.load(std::memory_order_relaxed); }

  float value(int number) const { return values_[static_cast<std::size_t>(number)].load(std::memory_order_acquire); }

  /// All values, for callers that read several at once. Each value is one word, so no read sees half of a write. Beside
  /// start(), a fence that acquires must follow.
  const float* values() const {
    static_assert(sizeof(std::atomic<float>) == sizeof(float) && std::atomic<float>::is_always_lock_free);
    return reinterpret_cast<const float*>(values_.data());
  }

  /// The surface reaches no farther.
  void lower(int number, double value);

 private:
  std::array<std::atomic<float>, 3> center_{}, middle_{};
  std::atomic<float> unit_{0}, inner_radius_{0};
  std::array<std::atomic<float>, kCount> values_{};
};

}  // namespace bocst::tree
