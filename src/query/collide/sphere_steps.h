// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>

#include "query/collide/step_state.h"
#include "query/cull/frames.h"
#include "query/sides/side.h"
#include "query/sides/visitor.h"

namespace bocst::query {

/// The pose of one root relative to the other, in float, and the rounding margin that this needs.
///
/// With u = 2^-24, Q0 and Q1 half the roots' sides and t the vector between their middles, no coordinate, distance or
/// radius is larger than M = |t| + sqrt(6) (Q0 + Q1). Cells are integers: in its own frame a centre is off by 2 u M, in
/// the other's, along an axis, by 11 u M: the former turned, rotation 1, products and sums 7, t 1. So a difference is
/// off by 14 u M, of three axes 25 u M; the squared distance by 5 u of it, which is 3 u M of the distance; the square
/// of the limit by u M; the sum of the radii, by 4 u each and u by itself, by 5 u M, and the limit by 2 u M more. All
/// is 36 u M; `rounding_margin` takes 48. To that comes 6 M of the orthogonality error: R^T stands for the inverse of
/// R, and R does not keep lengths.
struct SphereFrames {
  explicit SphereFrames(const SimilarityTransform& one_in_zero);

  SideFrame side[2] = {};
  /// Infinite where floats can't hold the pair: then each test is in doubt.
  float rounding_margin = std::numeric_limits<float>::infinity();
  float tolerance = 0;
};

/// Octants of one block that may meet one node of the other side, still to be walked. Words of one size, see
/// copyWords().
struct SphereGroup {
  StepNode other;         ///< Its child is not read if it is a leaf.
  BlockView own;          ///< For the root, which no block has, `at` is null, and (index, octant) are NodeRef::kRoot.
  std::uint32_t octants;  ///< A bit each.
  /// Of each a number whose lowest three bits are the octant; the least comes first.
  std::uint32_t order[8];
};

/// The depth-first walk over resident pairs of two trees with conservative answers: up to the next leaves whose spheres
/// meet. Eight octants at a time in float; what that leaves in doubt of spheres is decided in double by spheresMeet(),
/// so no verdict depends on the instruction set. Between large nodes the spheres of cells part little, so the boxes and
/// slabs of their surfaces are compared, too.
struct SphereSteps {
  /// Frames in use at once: one for each block of either side, two for the nodes of a pair that was pushed without.
  static constexpr std::size_t kFrames = 2 * lattice::kMaxLevel + 2;
  /// Groups that a walk below one pair can add to the stack: eight for two blocks.
  static constexpr std::size_t kStackRoom = 8 * lattice::kMaxLevel + 8;

  enum Event {
    kDone,      ///< The stack is empty.
    kLeaves,    ///< The spheres of the octants in `mask` of a block, pair[expanded] the first, meet that of the other.
    kDeferred,  ///< `pair` needs a node that is not expanded.
  };

  /// `spheres`, `volumes`: kFrames of them.
  SphereSteps(const TreeSide& a, const TreeSide& b, const SimilarityTransform& b_in_a, SphereFrame* spheres,
              Frame* volumes);

  const TreeSide* side[2];
  const SimilarityTransform& b_in_a;
  const SphereFrames frames;
  const CellTree cells[2];
  const LevelRule level_rule;
  bool nearest_first = true;  ///< A hit ends the walk.
  const Cut* cut = nullptr;   ///< What is left out; octants then come in the order of their ids.
  bool isBeyondCut(tree::NodeRef a, tree::NodeRef b) const {
    return side[cut->cell_side]->firstCellId(cut->cell_side == 0 ? a : b) > cut->last_cell;
  }

  SphereFrame* const spheres;
  std::uint64_t holds[kFrames];  ///< frameName() of what is in a frame.

  /// Volumes about the surface in the octants of each frame, decoded when asked for. Where they are farther apart than
  /// spheres of leaves reach, no leaves below meet. They are asked for octants that are larger than leaves by so many
  /// levels at least: others are as small as the reach.
  static constexpr std::uint32_t kVolumeLevels = 2;
  /// With that reach. None where its floats cannot hold the pair, and with Options::dimension: what the paper's trees
  /// grow depends on spheres alone, so it is the same with every oracle.
  std::optional<PairFrames> volume_geometry;
  Frame* const volumes;
  std::uint64_t volumes_hold[kFrames];  ///< frameName() of what is in a frame of `volumes`.

  SphereGroup* stack = nullptr;  ///< With room for kStackRoom more, below `stack_end`.
  const SphereGroup* stack_end = nullptr;
  std::size_t depth = 0;

  tree::NodeRef pair[2];  ///< Of the event.
  int expanded = 0;
  unsigned mask = 0;
};

/// Goes on to the next event. Chosen at run time for the machine's instruction set.
SphereSteps::Event nextEvent(SphereSteps& steps);

/// What is on the stack no longer needs its frames, so that pairs can be pushed on top of it.
void leaveFrames(SphereSteps& steps);

/// Puts a pair of nodes on the stack, which must be empty or have left its frames.
void pushPair(SphereSteps& steps, tree::NodeRef node_a, tree::NodeRef node_b);

}  // namespace bocst::query
