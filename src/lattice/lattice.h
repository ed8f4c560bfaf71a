// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/export.h>
#include <bocst/options.h>

#include <Eigen/Geometry>
#include <array>
#include <cstdint>

namespace bocst::lattice {

/// The root cube has 2^kBits lattice units a side; the cells of level kMaxLevel are single units.
constexpr int kBits = 16;
constexpr int kMaxLevel = kBits + 1;
constexpr int kMiddle = 1 << (kBits - 1);  ///< Of the root cube, along each axis.

/// A cube of the lattice; level 1 is the root, as the paper counts. Its side is 2^(kBits + 1 - level) units and its
/// minimum corner is that side times (x, y, z).
struct Cell {
  int level = 1;
  std::array<std::uint32_t, 3> at{};

  std::uint32_t side() const { return 1u << (kMaxLevel - level); }
  std::array<std::uint32_t, 3> corner() const { return {at[0] * side(), at[1] * side(), at[2] * side()}; }
  /// Octant o in 0..7: bit 0 is the upper half along x, bit 1 along y, bit 2 along z.
  Cell octant(int o) const {
    return {level + 1, {at[0] * 2 + (o & 1), at[1] * 2 + (o >> 1 & 1), at[2] * 2 + (o >> 2 & 1)}};
  }
  /// x in the lowest bit of each triple: a name of the cell among those of its level.
  std::uint64_t morton() const;
};

/// Where a mesh lies on its lattice, and how cells are divided. Cells are integers; a lattice coordinate is
/// (v - origin) / unit, computed as toLattice() does and nowhere else.
///
/// O (paper 4.2): the root cube is centred on the bounds and its side is their largest extent.
/// B (4.3): the lower corner of the cube is that of the bounds, the largest extent is d_t units of a cube whose side is
/// the smallest power of two >= d_t (scaled by a power of two to 2^kBits); so the lower side of each split is the
/// largest exact power of two. A cell's actual region is its part inside the bounds, rounded up to units.
class BOCST_EXPORT Lattice {
 public:
  /// dimension is the paper's d_t, 0 (finest) or 1 to 2^kBits.
  Lattice(const Eigen::AlignedBox3d& bounds, Subdivision subdivision, double dimension);

  const Eigen::Vector3d& origin() const { return origin_; }
  double unit() const { return unit_; }
  double inverseUnit() const { return inverse_unit_; }

  Eigen::Vector3d toLattice(const Eigen::Vector3d& v) const { return (v - origin_) * inverse_unit_; }

  /// The actual regions end here, in units, on each axis.
  const std::array<std::uint32_t, 3>& extent() const { return extent_; }

  /// True if the cell has an actual region.
  bool exists(const Cell& cell) const;

  /// The actual region, in lattice units.
  Eigen::AlignedBox3d region(const Cell& cell) const;

  /// Centre (lattice units) and half extents of the actual region.
  void region(const Cell& cell, Eigen::Vector3d& center, Eigen::Vector3d& half) const;

  bool operator==(const Lattice& other) const {
    return origin_ == other.origin_ && unit_ == other.unit_ && extent_ == other.extent_;
  }

  /// The paper's n for level 1: 2^n is the side of the root cube in units of d_t.
  int rootExponent() const { return root_exponent_; }

 private:
  Eigen::Vector3d origin_;
  double unit_ = 1;
  double inverse_unit_ = 1;
  std::array<std::uint32_t, 3> extent_{};
  int root_exponent_ = kBits;
};

/// The paper's level rule (5.3): true if the collision depth is one more for this d_t.
bool oneLevelMore(double dimension);

}  // namespace bocst::lattice
