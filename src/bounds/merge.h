// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <limits>

#include "bounds/node_bounds.h"

namespace bocst::bounds {

/// The box of a cell from those of its octants, along one axis: bytes of half the size, so two of the octants' make one
/// of the cell's.
struct MergedBox {
  int lo = 2 * kBoxSteps + 1, hi = 0;

  void add(bool upper, std::uint8_t octant_lo, std::uint8_t octant_hi) {
    const int shift = upper ? kBoxSteps : 0;
    lo = std::min(lo, shift + octant_lo);
    hi = std::max(hi, shift + octant_hi);
  }
  std::uint8_t cellLo() const { return static_cast<std::uint8_t>(lo / 2); }
  std::uint8_t cellHi() const { return static_cast<std::uint8_t>((hi + 1) / 2); }
};

/// Cuts the box of a cell down to what holds the boxes of those octants in `mask`.
inline void tightenBox(const OctantBounds& octants, unsigned mask, NodeBounds& cell) {
  for (std::size_t k = 0; k < 3; ++k) {
    MergedBox box;
    for (unsigned left = mask; left != 0; left &= left - 1) {
      const auto o = static_cast<unsigned>(__builtin_ctz(left));
      box.add((o >> k & 1) != 0, octants.lo[k][o], octants.hi[k][o]);
    }
    cell.lo[k] = std::max(cell.lo[k], box.cellLo());
    cell.hi[k] = std::min(cell.hi[k], box.cellHi());
  }
}

/// Gives a cell the slab about the bounds of those octants in `mask`, if it is thinner than what the cell has.
inline void tightenSlab(const OctantBounds& octants, unsigned mask, NodeBounds& cell) {
  double sum[3] = {0, 0, 0};  // of normals, all turned to one side
  for (unsigned left = mask; left != 0; left &= left - 1) {
    const NodeBounds b = octants.get(static_cast<unsigned>(__builtin_ctz(left)));
    const double along = b.normal[0] * sum[0] + b.normal[1] * sum[1] + b.normal[2] * sum[2];
    for (std::size_t k = 0; k < 3; ++k) sum[k] += along < 0 ? -b.normal[k] : b.normal[k];
  }
  std::int8_t n[3];
  if (!encodeNormal(sum[0], sum[1], sum[2], n)) return;
  // In slab units of the octants, from the middle of the cell.
  double least = std::numeric_limits<double>::infinity(), most = -least;
  for (unsigned left = mask; left != 0; left &= left - 1) {
    const auto o = static_cast<unsigned>(__builtin_ctz(left));
    const NodeBounds b = octants.get(o);
    double mm = 0, mn = 0;
    for (std::size_t k = 0; k < 3; ++k) mm += b.normal[k] * b.normal[k], mn += b.normal[k] * n[k];
    // Points of the octant are its box's middle + q with q in the box and m.q in a slab; any a bounds n.q by both.
    const double a = mm > 0 ? mn / mm : 0;
    double middle = a * b.slab_center, extent = std::abs(a) * b.slab_half / 2;
    for (std::size_t k = 0; k < 3; ++k) {
      const double from_octant = (b.lo[k] + b.hi[k]) * (0.5 / kBoxSteps) - 0.5;  // in sides of the octant
      const double from_cell = from_octant + ((o >> k & 1) != 0 ? 0.5 : -0.5);
      middle += n[k] * from_cell - a * b.normal[k] * from_octant;
      extent += (b.hi[k] - b.lo[k]) * (0.5 / kBoxSteps) * std::abs(n[k] - a * b.normal[k]);
    }
    least = std::min(least, middle - extent);
    most = std::max(most, middle + extent);
  }
  constexpr double kMargin = 1e-6;  // far above the rounding
  NodeBounds merged;
  // Units of the cell are twice as long.
  if (!merged.setSlab(n, least / 2 - kMargin, most / 2 + kMargin)) return;
  if (cell.hasSlab() && merged.slab_half >= cell.slab_half) return;
  cell.normal = merged.normal;
  cell.slab_center = merged.slab_center;
  cell.slab_half = merged.slab_half;
}

}  // namespace bocst::bounds
