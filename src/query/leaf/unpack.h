// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "geometry/overlap_kernels.h"
#include "tree/packed_triangles.h"

namespace bocst::query {

/// Fills the pack with packed triangles, 1 to kCapacity; `motion` moves their places, counted from
/// PackedTriangles::origin. With B as for moveTriangles(), corners are off by packingError() and 6 u B; where the
/// motion does not turn, by packingError() and 2 u pack.size a coordinate. u = 2^-24.
void unpackTriangles(const tree::PackedTriangles& packed, const PackMotion& motion, TrianglePack& pack);

/// How far a packed corner may be from where it is, in lattice units. A hundredth of a step covers that the middle of a
/// leaf's box lies in the box but for a unit or a byte of the cell.
inline float packingError(const tree::PackedTriangles& packed) {
  return 1.7321f * (tree::PackedTriangles::kError + 0.01f) * packed.step;
}

}  // namespace bocst::query
