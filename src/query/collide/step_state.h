// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "query/cull/frames.h"
#include "tree/tree.h"

// What the walks over resident pairs of two trees have in common (tree_steps.h, sphere_steps.h).

namespace bocst::query {

/// A node as a walk knows it.
struct StepNode {
  static constexpr std::uint32_t kNoLane = 0xffffffff;

  tree::NodeRef node;
  tree::ChildRef ref;
  std::uint32_t level = 1;
  std::uint32_t lane = kNoLane;  ///< 8 * frame + octant: where its volume is decoded; or kNoLane.
};

/// A block whose octants (or lanes) take part in a walk.
struct BlockView {
  static constexpr std::uint32_t kNoFrame = 0xffffffff;

  const tree::Block* at;  ///< Null: the root, which no block has.
  std::uint32_t index;    ///< As NodeRef names it.
  std::uint32_t level;    ///< Of the octants.
  std::uint32_t frame;    ///< Has the octants, or kNoFrame; frames of lower number are in use, too.
  std::uint32_t side;     ///< Whose tree has the block.
};

/// A block of a side whose octants are in a frame.
inline BlockView viewOf(const tree::Tree& tree, int side, std::uint32_t index, std::uint32_t frame) {
  const tree::Block& block = tree.block(index);
  return {&block, index, static_cast<std::uint32_t>(block.childLevel()), frame, static_cast<std::uint32_t>(side)};
}

/// Octant o of a block in a frame.
inline void setOctant(StepNode& n, const BlockView& b, std::uint32_t o) {
  n.node = tree::NodeRef::octant(b.index, static_cast<int>(o));
  n.ref = b.at->child[o].load(std::memory_order_acquire);
  n.level = b.level;
  n.lane = 8 * b.frame + o;
}

/// Copies word by word: a processor is slow to read a wide word that was just written in parts.
inline void copyWords(const StepNode& from, StepNode& to) {
  to.node = from.node;
  to.ref = from.ref;
  to.level = from.level;
  to.lane = from.lane;
}
inline void copyWords(const BlockView& from, BlockView& to) {
  to.at = from.at;
  to.index = from.index;
  to.level = from.level;
  to.frame = from.frame;
  to.side = from.side;
}

inline CellTree cellTreeOf(const tree::Tree& tree) {
  CellTree cells;
  std::copy_n(tree.surface().lattice.extent().data(), 3, cells.extent);
  cells.deepest = static_cast<std::uint32_t>(tree.deepest());
  return cells;
}

/// Names the block of a side that a frame holds.
constexpr std::uint64_t frameName(std::uint32_t side, std::uint32_t block) { return std::uint64_t{block} << 1 | side; }
constexpr std::uint64_t kEmptyFrame = ~std::uint64_t{0};

/// Puts a pair of nodes on the stack of a walk, and makes room there for what the walk adds to it.
template <typename Steps, typename Group>
void pushWithRoom(Steps& steps, std::vector<Group>& stack, tree::NodeRef a, tree::NodeRef b) {
  if (stack.size() < steps.depth + 1 + Steps::kStackRoom) stack.resize(2 * (steps.depth + Steps::kStackRoom));
  steps.stack = stack.data();
  steps.stack_end = steps.stack + stack.size();
  pushPair(steps, a, b);
}

/// Which of two nodes is larger, by d = level of side 1's node - level of side 0's.
struct LevelRule {
  int not_smaller;  ///< Side 0's node is not smaller than side 1's if d is no less.
  int larger;       ///< It is larger if d is no less.

  /// To be expanded first, if both can be: side 0's node where it is not smaller, else side 1's. `deeper`: the level of
  /// the other node minus that of side x's.
  bool isFirst(int x, int deeper) const { return x == 0 ? deeper >= not_smaller : -deeper < not_smaller; }

  /// `ratio`: a lattice unit of side 1 in those of side 0. The least d for which 2^d is at least the ratio, or more.
  static LevelRule of(double ratio) {
    int exponent = 0;
    const bool is_power = std::frexp(ratio, &exponent) == 0.5;
    return {is_power ? exponent - 1 : exponent, exponent};
  }
};

}  // namespace bocst::query
