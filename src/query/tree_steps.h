// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>

#include "query/frames.h"
#include "tree/tree.h"

namespace bocst::query {

/// A pair of nodes, one of each side. Words of one size, written and read one by one: a processor is slow to read a
/// wide word that was just written in parts.
struct StepPair {
  static constexpr std::uint32_t kNoLane = 0xffffffff;

  tree::NodeRef node[2];
  tree::Link link[2];
  std::uint32_t level[2] = {1, 1};
  std::uint32_t lane[2] = {kNoLane, kNoLane};  ///< 8 * frame + octant: where the nodes' volumes are, if they are.
  std::uint32_t frames = 0;  ///< Frames below this one are in use by this pair or those under it on the stack.
};

/// The depth-first walk over resident pairs of two trees, exact answers: up to the next pair of leaves.
struct PairSteps {
  /// Frames alive at once: two to look up a pair that comes without, one more each level of either side.
  static constexpr std::size_t kFrames = 2 + 2 * lattice::kMaxLevel + 1;
  /// What a walk below one pair can add to the stack: seven more for each of its levels.
  static constexpr std::size_t kStackRoom = 7 * (2 * lattice::kMaxLevel + 1) + 1;

  enum Event {
    kDone,    ///< The stack is empty.
    kLeaves,  ///< `pair` is two leaves, to be tested.
    kAside,   ///< `pair` needs a node that is not expanded.
    kCoarse,  ///< `pair` is a leaf and a smaller node, `expanded`, whose octants in `mask` overlap the leaf's volume.
  };

  const tree::Tree* tree[2];
  std::int64_t now;
  PairFrames geometry;
  Frame* frames;    ///< kFrames of them.
  StepPair* stack;  ///< With room for kStackRoom more.
  std::size_t depth = 0;

  StepPair pair{};
  int expanded = 0;
  unsigned mask = 0;
};

/// Goes on to the next event. Chosen at run time for the machine's instruction set.
PairSteps::Event nextEvent(PairSteps& steps);

/// The octants of a cell, wherever they come from.
struct CellOctants {
  lattice::Cell cell;
  oracle::OctantBounds octants;
};

/// What a step computes, by itself: bit o is set unless octant o of a cell of side `own` is surely apart from octant
/// `octant` of a cell of the other side.
std::uint8_t overlappingOctants(const PairFrames& geometry, int own, const CellOctants& cell, const CellOctants& other,
                                int octant);

/// Puts the octants in `mask` of the expanded node of steps.pair on the stack, after kCoarse.
void pushOctants(PairSteps& steps, unsigned mask);

}  // namespace bocst::query
