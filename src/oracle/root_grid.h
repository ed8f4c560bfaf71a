// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "oracle/surface.h"

namespace bocst::oracle {

/// The first levels of a large mesh in one streaming pass: which cells of the levels 2 to level() are grey, and for
/// each of them a list of the triangles that may meet it, gathered when asked for.
///
/// Each triangle is linked into the bucket of the cell of its box's minimum corner; it can reach at most the next cell
/// along each axis (the few that are larger are kept apart). So the candidates of a cell are in the eight buckets on
/// its minimum side. A bucket with a triangle that lies wholly inside is grey; other candidates are decided by the
/// reference test. 4 bytes a triangle.
class RootGrid {
 public:
  /// Null when the mesh is too small or its triangles too large for the pass to pay, or max_level is below 4.
  static std::unique_ptr<RootGrid> make(const Surface& surface, int max_level);

  /// The finest level that is known.
  int level() const { return bits_ + 1; }

  /// Is this cell, of level 2 to level(), grey?
  bool grey(const lattice::Cell& cell) const;

  /// The box of the grey finest cells inside a cell, in lattice units.
  Eigen::AlignedBox3d bounds(const lattice::Cell& cell) const;

  /// Appends the triangles that may meet the cell (a superset), each once, in no order.
  void gather(const Surface& surface, const lattice::Cell& cell, std::vector<std::uint32_t>& ids) const;

  /// Heap bytes.
  std::size_t bytes() const;

 private:
  explicit RootGrid(int bits) : bits_(bits) {}
  bool build(const Surface& surface);
  template <typename F>
  bool anyCandidate(const lattice::Cell& cell, F&& f) const;
  std::size_t index(std::uint32_t x, std::uint32_t y, std::uint32_t z) const {
    return ((std::size_t{z} << bits_) | y) << bits_ | x;
  }

  int bits_;  // 2^bits_ cells along an axis
  std::vector<std::uint32_t> head_, next_, large_;
  std::vector<std::vector<std::uint8_t>> grey_;  // [level - 2], one byte a cell
};

}  // namespace bocst::oracle
