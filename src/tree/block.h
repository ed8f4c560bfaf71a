// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstdint>

#include "oracle/oracle.h"

namespace bocst::tree {

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

/// What a walk reads of an expanded node: its eight octants, published all at once. Two cache lines.
///
/// | bytes | what |
/// |---|---|
/// | 0..87 | octants: box and slab of each (oracle.h, OctantBounds) |
/// | 88 | grey: bit o says octant o is a node |
/// | 89..95 | cell: level, then x, y, z of the expanded node (16 bits each) |
/// | 96..127 | child: the child reference of each octant |
struct alignas(64) Block {
  static constexpr std::uint32_t kNone = 0xffffffffu;

  oracle::OctantBounds octants;
  std::uint8_t grey = 0;
  std::uint8_t level = 1;
  std::uint16_t at[3] = {0, 0, 0};
  std::atomic<ChildRef> child[8] = {};

  lattice::Cell cell() const { return {level, {at[0], at[1], at[2]}}; }
};
static_assert(sizeof(Block) == 128);
static_assert(sizeof(oracle::CellBounds) == 11);
static_assert(std::atomic<ChildRef>::is_always_lock_free);

/// A resident node: the root, or an octant of a block.
struct NodeRef {
  static constexpr std::uint32_t kRoot = 0xffffffffu;

  std::uint32_t bits = kRoot;

  static NodeRef octant(std::uint32_t block, int o) { return {block << 3 | static_cast<std::uint32_t>(o)}; }
  bool isRoot() const { return bits == kRoot; }
  std::uint32_t block() const { return bits >> 3; }
  int octant() const { return static_cast<int>(bits & 7); }
  bool operator==(NodeRef other) const { return bits == other.bits; }
  bool operator<(NodeRef other) const { return bits < other.bits; }
};

/// What growth and decay know of a block beside; its number is the block's.
struct BlockRecord {
  oracle::CellBounds own;                 ///< Box and slab of the expanded node itself, as its octants showed it.
  std::uint8_t came = 0;                  ///< Bit o: a query came to octant o, a leaf that is not packed yet.
  std::uint32_t own_list = Block::kNone;  ///< Where its list is; only where an oracle keeps its octants'.
  NodeRef parent;                         ///< Which node was expanded.
};

}  // namespace bocst::tree
