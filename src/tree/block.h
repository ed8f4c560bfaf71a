// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <atomic>
#include <cstdint>

#include "bounds/cell_frame.h"
#include "bounds/loose_frame.h"
#include "lattice/lattice.h"
#include "lattice/limits.h"

namespace bocst::tree {

/// Loose blocks below one another in one tree, at most: a lane has less than half of its block's triangles (see
/// bestSplit() in bulk.cpp).
constexpr std::size_t kMostLooseDepth = 30;

/// A cell as the frame of bounds.
inline bounds::CellFrame frameOf(const lattice::Cell& cell) {
  const auto corner = cell.corner();
  return {{double(corner[0]), double(corner[1]), double(corner[2])}, double(cell.side())};
}

/// A box in lattice units as bytes of a cell; the margin is far above the rounding of Lattice::toLattice().
inline void encodeBox(const Eigen::AlignedBox3d& box, const lattice::Cell& cell, bounds::NodeBounds& b) {
  constexpr double kMargin = 1e-6;
  const bounds::CellFrame frame = frameOf(cell);
  for (int k = 0; k < 3; ++k) {
    frame.encodeBox(static_cast<std::size_t>(k), box.min()[k] - kMargin, box.max()[k] + kMargin, b);
  }
}

/// Says where the triangles or the children of a resident node are: two bits of tag, thirty of index.
class ChildRef {
 public:
  enum Tag : std::uint32_t {
    kImplicit = 0,   ///< Frontier: its triangles follow from the mesh (root) or from the root grid.
    kList = 1,       ///< Frontier: index of a list (triangle_lists.h).
    kBlock = 2,      ///< Expanded: index of the block of its children.
    kShortList = 3,  ///< As kList, but to be tested rather than expanded.
  };

  ChildRef() = default;
  ChildRef(Tag tag, std::uint32_t index) : bits_(tag << 30 | index) {}

  Tag tag() const { return static_cast<Tag>(bits_ >> 30); }
  bool isList() const { return tag() == kList || tag() == kShortList; }
  std::uint32_t index() const { return bits_ & 0x3fffffffu; }
  bool operator==(ChildRef other) const { return bits_ == other.bits_; }

 private:
  std::uint32_t bits_ = 0;
};

/// What a walk reads of an expanded node: its children, published all at once. Two cache lines.
///
/// A block of cells holds the eight octants of one cell, as an oracle answered. A loose block, which BulkBuilder makes
/// for exact answers, holds up to eight lanes that each bound some triangles; it follows no cell.
///
/// | bytes | what |
/// |---|---|
/// | 0..87 | octants: box and slab of each (bounds/node_bounds.h) |
/// | 88 | grey: bit o says octant or lane o is a node |
/// | 89..95 | cell: level, then x, y, z of the expanded node (16 bits each); or kLoose and a LooseFrame (55 bits) |
/// | 96..127 | child: the child reference of each octant |
struct alignas(64) Block {
  static constexpr std::uint32_t kNone = 0xffffffffu;

  bounds::OctantBounds octants;
  std::uint8_t grey = 0;
  std::uint8_t shape = 1;
  std::uint16_t at[3] = {0, 0, 0};
  std::atomic<ChildRef> child[8] = {};

  static constexpr std::uint8_t kLoose = 0x80;
  bool isLoose() const { return (shape & kLoose) != 0; }

  /// Of a block of cells.
  lattice::Cell cell() const { return {shape, {at[0], at[1], at[2]}}; }
  void setCell(const lattice::Cell& cell) {
    shape = static_cast<std::uint8_t>(cell.level);
    for (std::size_t k = 0; k < 3; ++k) at[k] = static_cast<std::uint16_t>(cell.at[k]);
  }

  /// Where the bounds of its octant o count from.
  bounds::CellFrame octantFrame(int o) const {
    const double side = 1 << (lattice::kMaxLevel - shape - 1);
    return {{(2 * at[0] + (o & 1)) * side, (2 * at[1] + (o >> 1 & 1)) * side, (2 * at[2] + (o >> 2 & 1)) * side}, side};
  }

  /// Of a loose block.
  bounds::LooseFrame frame() const {
    return bounds::LooseFrame::unpack((shape & 0x7fu) | std::uint64_t{at[0]} << 7 | std::uint64_t{at[1]} << 23 |
                                      std::uint64_t{at[2]} << 39);
  }
  void setFrame(const bounds::LooseFrame& frame) {
    const std::uint64_t bits = frame.pack();
    shape = static_cast<std::uint8_t>(kLoose | (bits & 0x7f));
    for (std::size_t k = 0; k < 3; ++k) at[k] = static_cast<std::uint16_t>(bits >> (7 + 16 * k));
  }

  /// The box of a loose block's lane, in lattice units.
  Eigen::AlignedBox3d looseBox(int o) const {
    const bounds::LooseFrame f = frame();
    const bounds::NodeBounds b = octants.get(static_cast<std::size_t>(o));
    Eigen::Vector3d lo, hi;
    for (std::size_t k = 0; k < 3; ++k) {
      lo[static_cast<int>(k)] = f.lower(b, k);
      hi[static_cast<int>(k)] = f.upper(b, k);
    }
    return {lo, hi};
  }

  /// The level of the children: that of cells half as large as the expanded cell, or as the frame.
  int childLevel() const {
    return isLoose() ? lattice::kMaxLevel + 1 - bounds::LooseFrame::kLeastExponent - (shape & 15) : shape + 1;
  }
};
static_assert(sizeof(Block) == 128);
static_assert(std::atomic<ChildRef>::is_always_lock_free);

/// A resident node: the root, or an octant of a block.
struct NodeRef {
  static constexpr std::uint32_t kRoot = 0xffffffffu, kMostBlocks = kRoot >> 3;

  std::uint32_t bits = kRoot;

  static NodeRef octant(std::uint32_t block, int o) { return {block << 3 | static_cast<std::uint32_t>(o)}; }
  bool isRoot() const { return bits == kRoot; }
  std::uint32_t block() const { return bits >> 3; }
  int octant() const { return static_cast<int>(bits & 7); }
  bool operator==(NodeRef other) const { return bits == other.bits; }
  bool operator<(NodeRef other) const { return bits < other.bits; }
};

/// What only growth and decay read of a block; the record has the block's number.
struct BlockRecord {
  bounds::NodeBounds own;                 ///< Box and slab of the expanded node itself, as its octants showed it.
  bool is_stripped = false;               ///< Decay took corners of its leaves.
  std::uint32_t own_list = Block::kNone;  ///< Where its list is; only where an oracle keeps its octants'.
  NodeRef parent;                         ///< Which node was expanded.
};

}  // namespace bocst::tree
