// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "lattice/lattice.h"

namespace bocst::oracle {

/// In lattice units.
inline Eigen::Vector3d centerOf(const lattice::Cell& cell) {
  const auto at = cell.corner();
  return Eigen::Vector3d(at[0], at[1], at[2]).array() + cell.side() / 2.0;
}

/// True if the closed triangle meets the closed cube. A separating-axis test in double over the 13 axes. Rounding never
/// separates what touches: the half side is kBoxRoundingMargin longer on box and edge axes, and the plane axis has a
/// margin of kPlaneRoundingMargin times the sum of its products' sizes (reference.cpp). Both are twice what the
/// first-order bound of the operations needs (6.5 and 11 units of 2^-53, plus 2 for the rounding of toLattice).
///
/// This is bocst's definition of grey: every oracle decides by it whatever its own arithmetic leaves in doubt, so grey
/// sets are the same for all oracles and instruction sets.
/// Corners and centre in lattice units, within the root cube [0, 2^16]^3; half is half the cube's side.
bool triangleMeetsCube(const Eigen::Vector3d corners[3], const Eigen::Vector3d& center, double half);

}  // namespace bocst::oracle
