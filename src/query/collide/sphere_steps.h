// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>

#include "query/cull/frames.h"
#include "query/sides/side.h"
#include "query/sides/visitor.h"

namespace bocst::query {

/// A node as the walk over spheres knows it.
struct SphereNode {
  tree::NodeRef node;
  tree::ChildRef ref;  ///< Not read of a leaf.
  std::uint32_t level;
};

/// Octants of one block whose spheres meet that of one node of the other side, still to be walked. Words of one size,
/// as in StepGroup.
struct SphereGroup {
  SphereNode other;
  float center[3];         ///< Of the other's sphere, along the axes of the block's side, from the middle of its root.
  float radius;            ///< Of the other's sphere; all in lattice units of side 0.
  const tree::Block* at;   ///< The block, or null where there is none.
  std::uint32_t side;      ///< That of the block.
  std::uint32_t block;     ///< As NodeRef names it, so the root is octant 7 of a block that there is not.
  std::uint32_t level;     ///< Of the octants.
  std::uint32_t octants;   ///< A bit each.
  std::uint32_t other_lane;  ///< 8 * frame + octant: where the other's volume is, or kNone.
  std::uint32_t frame;       ///< Where the block's octants are, or kNone.
  std::uint32_t frames;      ///< So many are in use, by the octants and what is above them.
  /// As in StepGroup: of each octant a float whose lowest three bits are the octant; the least comes first.
  std::uint32_t order[8];
  static constexpr std::uint32_t kNone = 0xffffffff;
};

/// How the roots of two trees lie to each other, in float: what side s sees about the middle of its root.
///
/// With u = 2^-24, Q0 and Q1 half the roots' sides and t the way between their middles, no coordinate, distance or
/// radius is larger than M = |t| + sqrt(6) (Q0 + Q1). Cells are integers, so in its own frame a centre is off by 2 u of
/// it, by the unit. What is off along an axis: the other's centre 4 u M by unit, rotation and products, 3 u M by sums,
/// u M by t; the octants' centres 2 u M and the differences 3 u M. That is 13 u M, of three axes 23 u M. The squared
/// distance is off by 5 u of it, which is 3 u M of the distance, the square of the limit by u M; the radii by 8 u each,
/// the limit 10 u M with its sums. All is 37 u M; `rounding_margin` takes 48. To that comes 6 M of the orthogonality
/// error: R^T for the inverse of R, and lengths that R does not keep.
struct SphereFrames {
  explicit SphereFrames(const SimilarityTransform& one_in_zero);

  struct Side {
    float unit;             ///< A lattice unit, in those of side 0.
    float shift[3];         ///< A point of this side is, in the other's frame, at this ...
    float to_other[3][3];   ///< ... and row j by its coordinates.
  };
  Side side[2] = {};
  /// Infinite where floats can't hold the pair: then each test is in doubt.
  float rounding_margin = std::numeric_limits<float>::infinity();
  float tolerance = 0;
};

/// The depth-first walk over resident pairs of two trees with conservative answers, by the spheres of cells: up to the
/// next pairs of leaves whose spheres meet. Eight octants at a time in float; what that leaves in doubt is decided in
/// double by spheresMeet(), so nothing depends on the instruction set.
struct SphereSteps {
  /// What a walk below one pair can add to the stack: one group for each block of either side.
  static constexpr std::size_t kStackRoom = 2 * lattice::kMaxLevel + 1;

  enum Event {
    kDone,      ///< The stack is empty.
    kLeaves,    ///< The octants in `mask` of the block of which pair[expanded] is one, and the other node: they meet.
    kDeferred,  ///< `pair` needs a node that is not expanded.
  };

  SphereSteps(const TreeSide& a, const TreeSide& b, const SimilarityTransform& b_in_a, Frame* volumes);

  const TreeSide* side[2];
  const SimilarityTransform& b_in_a;
  SphereFrames frames;
  PairFrames geometry;  ///< Of boxes and slabs, whose tolerance is reach() more.
  bool touching_only = false;  ///< Only nodes whose boxes and slabs touch; leaves by their spheres all the same.
  float margins[2][2];
  void setTouchingOnly(bool t) {
    touching_only = t;
    geometry.rounding_margin = margins[t][0];
    geometry.slab_rounding_margin = margins[t][1];
  }
  Frame* volumes;       ///< kVolumes of them.
  static constexpr std::size_t kVolumes = 2 * lattice::kMaxLevel + 3;
  std::uint64_t holds[kVolumes];
  std::uint32_t extent[2][3];  ///< Where the actual regions end.
  std::uint32_t deepest[2];    ///< The level of each side's leaves.
  std::uint32_t last_volumes[2];  ///< From this level on, spheres are as good as boxes.
  int not_smaller;             ///< A node of side 0 is not smaller than one of side 1 so many levels deeper.
  bool nearest_first = true;   ///< A hit ends the walk.

  SphereGroup* stack = nullptr;  ///< With room for kStackRoom more.
  std::size_t depth = 0;

  tree::NodeRef pair[2];  ///< Of the event; of leaves, that of side `expanded` is the block's first octant.
  int expanded = 0;
  unsigned mask = 0;
};

/// The tolerance of boxes and slabs: a leaf's sphere is within its diameter of surface in the leaf.
SimilarityTransform withReach(const TreeSide& a, const TreeSide& b, SimilarityTransform b_in_a);

/// Goes on to the next event. Chosen at run time for the machine's instruction set.
SphereSteps::Event nextEvent(SphereSteps& steps);

/// Puts a pair of nodes on the stack.
void pushPair(SphereSteps& steps, tree::NodeRef node_a, tree::NodeRef node_b);

/// What a step computes, by itself: which octants of the block with number `index` of side `own` meet a node of the
/// other side; `doubtful` tells for how many float was not enough. For tests.
unsigned octantsMeeting(const SphereSteps& steps, int own, std::uint32_t index, tree::NodeRef other,
                        unsigned& doubtful);

}  // namespace bocst::query
