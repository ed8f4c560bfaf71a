// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

#include "tree/tree.h"

namespace bocst::fcl_adapter {

/// How far the spheres of conservative answers reach beyond the surface at most, in model units, of a mesh whose
/// bounding box is at most `extent` long; 0 for exact answers. A sphere is about a cell of the collision depth that the
/// surface meets, so no point of it is farther from the surface than the cell's diagonal. (Cells are decided to less
/// than a lattice unit, which is added.) Reads only what never changes, so no lock is needed.
inline double sphereReach(const tree::Tree& tree, double extent) {
  if (!tree.conservative()) return 0;
  const Options& options = tree.options();
  double units = std::ldexp(1.0, lattice::kBits);  // along the box's longest side, as in Lattice
  if (options.dimension > 0 && options.subdivision == Subdivision::kBono) {
    units = std::ldexp(options.dimension, lattice::kBits - static_cast<int>(std::ceil(std::log2(options.dimension))));
  }
  const int cell_side = 1 << (lattice::kMaxLevel - tree.deepest());
  return std::sqrt(3.0) * (cell_side + 1) / units * extent;
}

}  // namespace bocst::fcl_adapter
