// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "oracle/surface.h"
#include "tree/root_grid_kernels.h"

namespace bocst::tree {

/// The first levels of a large mesh in one streaming pass: which cells of the levels 2 to level() may be grey, and for
/// each of the finest a list of the triangles that may meet it, gathered when asked for.
///
/// Each triangle is linked into a list of the cell of its box's minimum corner; it can reach at most the next cell
/// along each axis (the few that are larger are kept apart), and for each choice of axes there is a list of its own. So
/// the candidates of a cell are in its own lists and in some of the seven cells on its minimum side. A cell with a
/// triangle that lies wholly inside is grey; what else a triangle's box meets is decided by the reference test when
/// somebody asks. 2 bytes a triangle.
class RootGrid {
 public:
  /// Null when the mesh is too small or its triangles too large for the pass to pay, or max_level is below 4.
  static std::unique_ptr<RootGrid> make(const oracle::Surface& surface, int max_level);

  /// The finest level that is known.
  int level() const { return bits_ + 1; }

  /// True if this cell, of level 2 to level(), is grey. Remembers the answer, so one thread at a time.
  bool grey(const oracle::Surface& surface, const lattice::Cell& cell);

  /// A box of the surface inside a grey cell, in lattice units: that of its finest cells which are not known to be
  /// empty.
  Eigen::AlignedBox3d bounds(const lattice::Cell& cell) const;

  /// Appends the triangles that may meet a cell of the finest level (a superset), each once, in no order.
  void gather(const oracle::Surface& surface, const lattice::Cell& cell, std::vector<std::uint32_t>& ids) const;

  /// Heap bytes.
  std::size_t bytes() const;

 private:
  /// One bit for each cell of a level, along x in one word: the cell (x, y, z) of 2^b cells a side is bit x of word
  /// (4^b - 4) / 3 + (z 2^b + y), b from 1.
  using Bits = std::vector<std::uint32_t>;

  explicit RootGrid(int bits) : bits_(bits) {}
  bool build(const oracle::Surface& surface);
  void link(std::uint32_t begin, std::uint32_t end, const GridSpan* spans, std::uint32_t* heads);
  void keepLists(const std::uint32_t* heads, std::uint8_t* bits);
  void markCells();
  void dropMissingCells(const oracle::Surface& surface);
  void markCoarseCells();
  std::uint32_t farNext(std::uint32_t triangle) const;
  bool decide(const oracle::Surface& surface, const lattice::Cell& cell);
  template <typename F>
  bool anyCandidate(const oracle::Surface& surface, const lattice::Cell& cell, F&& f) const;
  std::size_t row(unsigned axes, std::size_t y, std::size_t z) const { return (axes << bits_ | z) << bits_ | y; }
  static std::size_t word(int b, std::size_t y, std::size_t z) {
    return ((std::size_t{1} << 2 * b) - 4) / 3 + (z << b | y);
  }

  int bits_;  // 2^bits_ cells along an axis
  // Lists of triangles, from the last to the first; kept are those that are not empty, ordered by axes, z, y, x.
  struct Row {
    std::uint32_t lists;  // bit x: the cell x of the row has one
    std::uint32_t first;
  };
  std::vector<Row> rows_;  // [axes][z][y]
  std::vector<std::uint32_t> head_;
  // [triangle]: how many triangles back the next of its list is; 0 for the last, kFar for what far_ has.
  static constexpr std::uint32_t kFar = 0xffff;
  std::unique_ptr<std::uint16_t[]> back_;
  struct Far {
    std::uint32_t triangle, next;
  };
  std::vector<Far> far_;  // ordered by triangle
  std::size_t triangle_count_ = 0;
  std::vector<std::uint32_t> large_;
  Bits may_be_grey_, is_grey_;  // the first without the second is to be decided
};

}  // namespace bocst::tree
