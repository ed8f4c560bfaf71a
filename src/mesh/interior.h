// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>

#include <cstddef>
#include <cstdint>
#include <vector>

#include "lattice/lattice.h"

namespace bocst {

/// What proves quickly that a surface crosses another one: probes, which are points spread over one connected
/// component of it, and, of a closed surface, a grid that knows where is inside and where outside. If one probe of a
/// surface is inside a closed surface and another outside, a path on the first surface joins them, so the surfaces
/// meet.
///
/// Closed: each edge belongs to an even number of triangles (vertices at the same place are one). A point is inside if
/// a ray from it crosses an odd number of triangles. Edges are counted by the exclusive or of 64-bit hash values, so an
/// open mesh passes for a closed one with a probability of 2^-64. Immutable; 1.5, 9 or 66 kB.
class Interior {
 public:
  static constexpr std::size_t kProbes = 32;

  Interior(const Mesh& mesh, const lattice::Lattice& lattice);

  /// In lattice units from the middle of the root cube, [axis][probe]. All are the same point if the surface has no
  /// area.
  alignas(64) float probes[3][kProbes] = {};

  /// Cells of the grid along an axis, 2^bits; 0 if there is no grid: the surface is not closed, or no cell is wholly
  /// inside.
  int bits = 0;
  /// A position's cell is (x - low) * cells_per_unit, per axis, in lattice units. What is beyond the grid is outside.
  double low[3] = {}, cells_per_unit[3] = {};
  /// Positions off by this many cells at most are inside or outside where the grid says so.
  static constexpr double kAllowed = 1.0 / 16;
  /// Bits of the cells that are wholly inside, and wholly outside; of other cells the surface is near. The cell
  /// (x, y, z) has the number (z << bits | y) << bits | x, its bit is number % 32 of the word number / 32.
  std::vector<std::uint32_t> inside, outside;

  std::size_t bytes() const;
  static std::size_t mostBytesOf(std::size_t triangles);

 private:
  void spreadProbes(const Mesh& mesh, const lattice::Lattice& lattice, const std::vector<std::uint32_t>& welded);
  void fillGrid(const Mesh& mesh, const lattice::Lattice& lattice);
};

}  // namespace bocst
