// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>

#include "query/volume.h"
#include "tree/tree.h"

namespace bocst::query {

/// The volumes of eight octants as both sides of a pair see them: along the axes of side 0 and along those of side 1,
/// in lattice units of side 0 about the middle of each side's root. Structure of arrays: lane o is octant o.
struct alignas(64) Frame {
  float center[2][3][8];  ///< Middle of the box.
  float half[2][3][8];    ///< Half extents of the box (its own axes) or of what holds it (the other side's).
  float normal[2][3][8];  ///< Of the slab, about unit length; zero: no slab.
  float slab_center[8];   ///< Middle of the slab along normal, from center.
  float slab_half[8];

  static constexpr std::uint64_t kNothing = ~std::uint64_t{0};
  std::uint64_t holds = kNothing;  ///< Which block of which side, in this walk.
};

/// How the frames of two trees lie to each other, in float, and what that loses.
///
/// With u = 2^-24 and M = |t| + sqrt(3) (Q0 + Q1), Q half a root's side, no coordinate is larger than M. A centre is
/// off by 6 u Q in its own frame (bytes to units 4, corner 2) and by 11 u M in the other (that turned, rotation 1, sums
/// 4); an extent by 7 u M. Two centres, two extents and the comparison: 42 u M; `pad` takes 48. Along a normal (length
/// below 1.01, off by 10 u an entry) the way between centres is off by 42 u M, 18 by the normal and 9 by sums; offsets
/// 11; the radius 38 by the normals and 15 by sums: 133 u M; `slab_pad` takes 160. To both comes the defect of the
/// rotation, 4 M of it, and the slack.
struct PairFrames {
  PairFrames(double scale_of_1, const Placement& one_in_zero);

  /// Beyond these, one side's rounding is too coarse for the other's nodes.
  static bool fits(double scale) { return scale >= 0x1p-10 && scale <= 0x1p10; }

  float unit[2];            ///< Lattice units of each side, in those of side 0.
  float to_other[2][3][3];  ///< [own]: row j gives coordinate j in the other frame ...
  float abs_to_other[2][3][3];
  float shift[2][3];  ///< ... after this.
  float pad, slab_pad;
};

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
