// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bounds/node_bounds.h"

namespace bocst::bounds {

/// A cube as the frame of node bounds.
struct CellFrame {
  double corner[3];
  double side;  ///< A power of two.

  double middle(std::size_t k) const { return corner[k] + side / 2; }

  /// The box along one axis. What `least` and `most` are off by is the caller's to add.
  void encodeBox(std::size_t k, double least, double most, NodeBounds& b) const {
    const double steps = kBoxSteps / side;
    b.setBox(k, (least - corner[k]) * steps, (most - corner[k]) * steps);
  }

  /// The slab along `n`: n . (p - middle) is `least` to `most` for the points p.
  void encodeSlab(const std::int8_t* n, double least, double most, NodeBounds& b) const {
    static_assert(kCellSlabSteps == kNormalLength, "a slab unit along n / kNormalLength is the side along n");
    b.setSlab(n, least / side, most / side);
  }

  Volume decode(const NodeBounds& b) const {
    constexpr double kPerLength = 1.0 / kNormalLength;
    const double half_step = side * (0.5 / kBoxSteps);
    Volume v;
    double off_middle = 0;  // the box's middle from the cell's, along the normal as bytes
#pragma GCC unroll 3
    for (std::size_t k = 0; k < 3; ++k) {
      const double from_corner = (b.lo[k] + b.hi[k]) * half_step;
      v.center[k] = corner[k] + from_corner;
      v.half[k] = static_cast<float>((b.hi[k] - b.lo[k]) * half_step);
      v.normal[k] = static_cast<float>(b.normal[k] * kPerLength);
      off_middle += b.normal[k] * (from_corner - side / 2);
    }
    v.slab_offset = static_cast<float>((b.slab_center * side - off_middle) * kPerLength);
    v.slab_half = static_cast<float>(b.slab_half * (side * kPerLength / 2));
    return v;
  }
};

}  // namespace bocst::bounds
