// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "geometry/volume.h"
#include "mesh/interior.h"

namespace bocst::query {

/// True if probes of one of two surfaces prove that it crosses the other. Then they meet. False says nothing.
/// b_in_a: from the lattice of b to that of a.
bool surelyCross(const Interior& a, const Interior& b, const SimilarityTransform& b_in_a);

}  // namespace bocst::query
