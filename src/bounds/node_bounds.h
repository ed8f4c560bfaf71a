// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>

namespace bocst::bounds {

// The one codec of node bounds: what bounds the surface of a node is eleven bytes, a box AND a slab in a frame. A frame
// is the node's own cell (cell_frame.h) or that of a block (loose_frame.h); both encode and decode one node. merge.h
// makes bounds of a cell from those of its octants; decode-inl.h decodes eight nodes at once; the shaders take the
// constants from here (oracle/gl/layout.h).
//
// | field | says |
// |---|---|
// | lo, hi | the box: lo / 255 to hi / 255 of the frame's side, from its corner, along each axis |
// | normal | the slab's, 127 times a unit vector, rounded; zero: no slab |
// | slab_center, slab_half | abs(normal / 127 . (p - m) - slab_center * unit) <= slab_half * unit / 2, points p |
//
// Of a cell of side s, m is the middle of the cell and the unit s / 127. Of a lane of a loose frame, m is the middle of
// its box and the unit the longest side / 256. All is rounded outwards.
constexpr int kBoxSteps = 255;
constexpr int kNormalLength = 127;
constexpr int kCellSlabSteps = kNormalLength;
constexpr int kLooseSlabSteps = 256;
constexpr int kMostSlabCenter = 127, kMostSlabHalf = 255;

/// Sizes of the entries of a normal add up to no more.
constexpr int kMostNormalNorm1 = 3 * kNormalLength;

/// Steps as a byte: rounded down or up, and cut off at the ends of the frame.
inline std::uint8_t roundedDown(double steps) {
  // What is cut off is not negative, so to truncate is to round down.
  return static_cast<std::uint8_t>(static_cast<int>(std::min(std::max(steps, 0.0), double{kBoxSteps})));
}
inline std::uint8_t roundedUp(double steps) {
  const double within = std::min(std::max(steps, 0.0), double{kBoxSteps});
  const int whole = static_cast<int>(within);
  return static_cast<std::uint8_t>(whole + int{whole < within});
}

/// A direction as bytes; false where it has none. The arguments are within the range of float, so their squares do not
/// underflow in double.
inline bool encodeNormal(double x, double y, double z, std::int8_t* bytes) {
  const double length = std::sqrt(x * x + y * y + z * z);
  if (!(length > 0) || !std::isfinite(length)) return false;
  const double scale = kNormalLength / length;
  bytes[0] = static_cast<std::int8_t>(std::lrint(x * scale));
  bytes[1] = static_cast<std::int8_t>(std::lrint(y * scale));
  bytes[2] = static_cast<std::int8_t>(std::lrint(z * scale));
  return true;
}

/// The bounds of one node; as they are at first, they hold all of the frame.
struct NodeBounds {
  std::array<std::uint8_t, 3> lo{0, 0, 0}, hi{kBoxSteps, kBoxSteps, kBoxSteps};
  std::array<std::int8_t, 3> normal{0, 0, 0};
  std::int8_t slab_center = 0;
  std::uint8_t slab_half = kMostSlabHalf;

  bool operator==(const NodeBounds& b) const {
    return lo == b.lo && hi == b.hi && normal == b.normal && slab_center == b.slab_center && slab_half == b.slab_half;
  }

  bool hasSlab() const { return (normal[0] | normal[1] | normal[2]) != 0; }

  /// The box along one axis: in steps of 1 / kBoxSteps of the side, from the frame's corner.
  void setBox(std::size_t axis, double least, double most) {
    lo[axis] = roundedDown(least);
    hi[axis] = roundedUp(most);
  }

  /// The slab along `n` that holds an interval: how far points reach along n / kNormalLength from where the frame's
  /// slabs count from, in its slab units. False, and nothing is set, where bytes cannot hold it. The sums here are
  /// rounded by less than 2^-44 units.
  bool setSlab(const std::int8_t* n, double least, double most) {
    const double center = std::round((least + most) / 2);
    const double half = std::ceil(2 * std::max(most - center, center - least));
    if (!(std::abs(center) <= kMostSlabCenter) || !(half <= kMostSlabHalf)) return false;
    std::copy_n(n, 3, normal.begin());
    slab_center = static_cast<std::int8_t>(center);
    slab_half = static_cast<std::uint8_t>(half);
    return true;
  }
};
static_assert(sizeof(NodeBounds) == 11);

/// The bounds of eight octants, or of the lanes of a loose block, as structure of arrays.
struct OctantBounds {
  std::uint8_t lo[3][8] = {}, hi[3][8] = {};
  std::int8_t normal[3][8] = {};
  std::int8_t slab_center[8] = {};
  std::uint8_t slab_half[8] = {};

  void set(std::size_t octant, const NodeBounds& b) {
#pragma GCC unroll 3
    for (std::size_t k = 0; k < 3; ++k) {
      lo[k][octant] = b.lo[k];
      hi[k][octant] = b.hi[k];
      normal[k][octant] = b.normal[k];
    }
    slab_center[octant] = b.slab_center;
    slab_half[octant] = b.slab_half;
  }

  /// The same in all octants: whole words, which are read again at once; single bytes would have to be stored first.
  void fill(const NodeBounds& b) {
#pragma GCC unroll 3
    for (std::size_t k = 0; k < 3; ++k) {
      std::memset(lo[k], b.lo[k], 8);
      std::memset(hi[k], b.hi[k], 8);
      std::memset(normal[k], b.normal[k], 8);
    }
    std::memset(slab_center, b.slab_center, 8);
    std::memset(slab_half, b.slab_half, 8);
  }

  NodeBounds get(std::size_t octant) const {
    NodeBounds b;
#pragma GCC unroll 3
    for (std::size_t k = 0; k < 3; ++k) {
      b.lo[k] = lo[k][octant];
      b.hi[k] = hi[k][octant];
      b.normal[k] = normal[k][octant];
    }
    b.slab_center = slab_center[octant];
    b.slab_half = slab_half[octant];
    return b;
  }
};
static_assert(sizeof(OctantBounds) == 8 * sizeof(NodeBounds));

/// Bounds, decoded: box AND slab, in lattice units, axes those of the lattice.
/// Plain numbers: this and what is made of it are the hottest data of a query. Positions are in double: beside a much
/// smaller node, a rounding relative to this one would be large.
struct Volume {
  double center[3];
  float half[3];
  float normal[3];    ///< About unit length; zero: no slab.
  float slab_offset;  ///< Middle of the slab along normal, from center.
  float slab_half;
};

}  // namespace bocst::bounds
