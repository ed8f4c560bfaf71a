// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "geometry/volume.h"
#include "mesh/interior.h"
#include "query/sides/side.h"

namespace bocst::query {

/// True if probes of one of two surfaces prove that it crosses the other. Then they meet. False says nothing.
/// b_in_a: from the lattice of b to that of a.
bool surelyCross(const Interior& a, const Interior& b, const SimilarityTransform& b_in_a);

/// The same; false also where not both sides have an Interior yet.
inline bool surelyCross(const TreeSide& a, const TreeSide& b, const SimilarityTransform& b_in_a) {
  const Interior *of_a = a.tree().interior(a.now()), *of_b = b.tree().interior(b.now());
  return of_a != nullptr && of_b != nullptr && surelyCross(*of_a, *of_b, b_in_a);
}

}  // namespace bocst::query
