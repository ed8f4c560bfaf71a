// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "oracle/oracle.h"

namespace bocst::oracle {

/// The first levels of a large mesh in one streaming pass: which cells of the levels 2 to level() may be grey, and for
/// each of the finest a list of the triangles that may meet it, gathered when asked for.
///
/// Each triangle is linked into the bucket of the cell of its box's minimum corner; it can reach at most the next cell
/// along each axis (the few that are larger are kept apart). So the candidates of a cell are in the eight buckets on
/// its minimum side. A bucket with a triangle that lies wholly inside is grey; what else a triangle's box meets is
/// decided by the reference test when somebody asks. 4 bytes a triangle.
class RootGrid {
 public:
  /// Null when the mesh is too small or its triangles too large for the pass to pay, or max_level is below 4.
  static std::unique_ptr<RootGrid> make(const Surface& surface, int max_level);

  /// The finest level that is known.
  int level() const { return bits_ + 1; }

  /// Is this cell, of level 2 to level(), grey? Remembers the answer, so one thread at a time.
  bool grey(const Surface& surface, const lattice::Cell& cell);

  /// A box of the surface inside a cell, in lattice units: that of its finest cells which are not known to be white.
  Eigen::AlignedBox3d bounds(const lattice::Cell& cell) const;

  /// Appends the triangles that may meet a cell of the finest level (a superset), each once, in no order.
  void gather(const Surface& surface, const lattice::Cell& cell, std::vector<std::uint32_t>& ids) const;

  /// Box and slab of the surface in a cell of the finest level, without expanding it: of whole triangles, so not as
  /// tight as an oracle's, and never without a slab.
  CellBounds look(const Surface& surface, const lattice::Cell& cell) const;

  /// Heap bytes.
  std::size_t bytes() const;

 private:
  enum State : std::uint8_t { kWhite, kUnknown, kGrey };

  explicit RootGrid(int bits) : bits_(bits) {}
  bool build(const Surface& surface);
  void markCells(const Surface& surface);
  template <typename F>
  bool anyCandidate(const Surface& surface, const lattice::Cell& cell, F&& f) const;
  State& state(const lattice::Cell& cell) {
    const int b = cell.level - 1;
    return states_[static_cast<std::size_t>(b - 1)][index(b, cell.at[0], cell.at[1], cell.at[2])];
  }
  static std::size_t index(int bits, std::size_t x, std::size_t y, std::size_t z) {
    return (z << bits | y) << bits | x;
  }

  int bits_;  // 2^bits_ cells along an axis
  std::vector<std::uint32_t> head_, next_, large_;
  std::vector<std::uint8_t> reaches_;       // bit p: a triangle of the bucket extends to the next cell on the axes of p
  std::vector<std::vector<State>> states_;  // [level - 2], one byte a cell
};

}  // namespace bocst::oracle
