// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "geometry/overlap_kernels.h"
#include "tree/packed_triangles.h"

namespace bocst::query {

/// Fills the pack with packed triangles, 1 to kCapacity, about `center` in lattice units. Beside half a step, a corner
/// is off by 2 u pack.size a coordinate, u = 2^-24: the origin from the centre is rounded, and a sum.
void unpackTriangles(const tree::PackedTriangles& packed, const double* center, TrianglePack& pack);

}  // namespace bocst::query
