// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <cstddef>

#include "bounds/node_bounds.h"
#include "lattice/lattice.h"
#include "oracle/surface.h"
#include "tree/block.h"

namespace bocst::tree {

/// A box in lattice units as bytes of a cell; the margin is far above the rounding of toLattice().
inline void encodeBox(const Eigen::AlignedBox3d& box, const lattice::Cell& cell, bounds::NodeBounds& b) {
  constexpr double kMargin = 1e-6;
  const bounds::CellFrame frame = frameOf(cell);
  for (int k = 0; k < 3; ++k) {
    frame.encodeBox(static_cast<std::size_t>(k), box.min()[k] - kMargin, box.max()[k] + kMargin, b);
  }
}

/// The box of the surface in lattice units.
inline Eigen::AlignedBox3d latticeBounds(const oracle::Surface& surface) {
  const Eigen::AlignedBox3d& b = surface.bounds;
  return {surface.lattice.toLattice(b.min()), surface.lattice.toLattice(b.max())};
}

}  // namespace bocst::tree
