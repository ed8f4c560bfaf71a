// SPDX-License-Identifier: BSD-3-Clause
#include "lattice/lattice.h"

#include <algorithm>
#include <cmath>

namespace bocst::lattice {
namespace {

constexpr double kSide = 1 << kBits;

// No cube is smaller: coordinates of up to 1e75 are less than 2e151 of its units, so their squares are finite.
constexpr double kLeastSide = 0x1p-236;

std::uint64_t spread(std::uint64_t v) {
  v &= 0x1fffff;
  v = (v | v << 32) & 0x1f00000000ffffull;
  v = (v | v << 16) & 0x1f0000ff0000ffull;
  v = (v | v << 8) & 0x100f00f00f00f00full;
  v = (v | v << 4) & 0x10c30c30c30c30c3ull;
  v = (v | v << 2) & 0x1249249249249249ull;
  return v;
}

}  // namespace

std::uint64_t Cell::morton() const { return spread(at[0]) | spread(at[1]) << 1 | spread(at[2]) << 2; }

Lattice::Lattice(const Eigen::AlignedBox3d& bounds, Subdivision subdivision, double dimension) {
  const Eigen::Vector3d sizes = bounds.sizes();
  double largest = sizes.maxCoeff();
  // A mesh that is one point still needs a cube: one that its coordinates can tell from the point.
  const double magnitude = std::max(bounds.min().cwiseAbs().maxCoeff(), bounds.max().cwiseAbs().maxCoeff());
  largest = std::max(largest, magnitude * 1e-13);
  const bool vanishes = largest < kLeastSide;
  if (vanishes) largest = kLeastSide;

  double units = kSide;  // the largest extent in lattice units
  if (dimension > 0) {
    root_exponent_ = static_cast<int>(std::ceil(std::log2(dimension)));
    if (subdivision == Subdivision::kBono) units = std::ldexp(dimension, kBits - root_exponent_);
  }
  // The centre of a mesh far from its origin is rounded: a cube this much larger still holds every vertex.
  if (subdivision == Subdivision::kOctree) largest += magnitude * 0x1p-49;
  unit_ = largest / units;
  inverse_unit_ = units / largest;
  if (subdivision == Subdivision::kOctree) {
    // In the middle of a cube that is much larger, differences would be rounded away.
    origin_ = vanishes ? bounds.min() : Eigen::Vector3d(bounds.center() - Eigen::Vector3d::Constant(largest / 2));
    extent_.fill(1u << kBits);
    return;
  }
  origin_ = bounds.min();
  for (int k = 0; k < 3; ++k) {
    // Up to whole units of d_t; a rounding error above a whole number must not add one.
    const double scale = dimension > 0 ? std::ldexp(1.0, kBits - root_exponent_) : 1.0;
    const double whole = std::ceil(sizes[k] * inverse_unit_ / scale * (1 - 1e-15)) * scale;
    extent_[k] = static_cast<std::uint32_t>(std::clamp(whole, std::max(scale, 1.0), kSide));
  }
}

bool Lattice::exists(const Cell& cell) const {
  const auto corner = cell.corner();
  return corner[0] < extent_[0] && corner[1] < extent_[1] && corner[2] < extent_[2];
}

Eigen::AlignedBox3d Lattice::region(const Cell& cell) const {
  const auto corner = cell.corner();
  Eigen::AlignedBox3d box;
  for (int k = 0; k < 3; ++k) {
    box.min()[k] = corner[k];
    box.max()[k] = std::min(corner[k] + cell.side(), extent_[k]);
  }
  return box;
}

void Lattice::region(const Cell& cell, Eigen::Vector3d& center, Eigen::Vector3d& half) const {
  const Eigen::AlignedBox3d box = region(cell);
  center = (box.min() + box.max()) / 2;
  half = (box.max() - box.min()) / 2;
}

bool oneLevelMore(double dimension) {
  if (dimension < 1) return false;
  const double power = std::ldexp(1.0, std::ilogb(dimension));
  return power + 2 <= dimension && dimension < power * 1.5;
}

}  // namespace bocst::lattice
