// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "query/collide/pair_walk.h"
#include "query/collide/tree_steps.h"
#include "query/cull/separation.h"
#include "query/leaf/leaf_pairs.h"
#include "query/sides/visitor.h"

namespace bocst::query {

/// The walk of PairWalk for two trees of which one at least has exact answers, where queries spend most of their time.
/// Volumes are in float about the middles of the roots (see PairFrames); a block is decoded once for all nodes that it
/// is tested against.
///
/// Where one side answers with cells, the walk's tolerance holds how far their spheres reach beyond the surface that
/// the volumes bound; spheres against triangles are then tested in double, as in PairWalk.
class TreeWalk {
 public:
  static bool fits(const TreeSide& a, const TreeSide& b, const SimilarityTransform& b_in_a) {
    // A margin that is large beside a model of tiny extent would overflow in float.
    return !a.isConservative() && !b.isConservative() && PairFrames::fits(b_in_a.scale) && b_in_a.tolerance < 1e9;
  }

  /// True if one of the two sides answers with cells, and their scales and distance fit the walk's floats.
  static bool fitsCells(const TreeSide& a, const TreeSide& b, const SimilarityTransform& b_in_a) {
    return a.isConservative() != b.isConservative() && PairFrames::fits(b_in_a.scale) &&
           withSphereReach(a, b, b_in_a).tolerance < 1e9;
  }

  TreeWalk(const TreeSide& a, const TreeSide& b, const SimilarityTransform& b_in_a) : a_(a), b_(b), b_in_a_(b_in_a) {
    if (a.isConservative() || b.isConservative()) wide_ = withSphereReach(a, b, b_in_a);
  }

  /// True if the supports show that the two are apart, so that no walk is needed. Costs little; call it before run().
  /// `known`: what they have shown already, with a wider rounding margin.
  bool isNeedless(Hulls known = Hulls::kUnknown) {
    is_shallow_ = known == Hulls::kShallow;
    if (known == Hulls::kShallow || known == Hulls::kMeet) return false;
    return areSeparate(a_.tree().supports(), b_.tree().supports(), place(), is_shallow_);
  }

  /// True when the visitor ended it.
  bool run(Visitor& visitor) { return run(visitor, kNoLimit).met; }

  /// The same, but gives up after more than so many steps: a pair of leaves is one, and exact tests of triangles are
  /// several.
  WalkEnd run(Visitor& visitor, std::size_t most_steps);

  /// The same of a yes-or-no query, in turns with a walk over BoxSide where it gets long. Volumes in float separate
  /// little between two flat faces with little space between them, where oriented boxes in double separate the faces as
  /// a whole; in other places the float walk is quicker.
  bool runByTurns(Visitor& visitor);

  /// Pairs of leaves come in an order that depends only on the trees and their sizes, as long as these are complete:
  /// not on what is culled, so it is the same on every instruction set. Calls visitor.endLeaves() after each pair.
  WalkEnd runInOrder(Visitor& visitor, std::size_t most_leaf_pairs);

  /// A walk took so many steps, where one over oriented boxes might have been quicker.
  void payForBoxes(std::size_t steps) const;

 private:
  struct Scratch;

  // With the tolerance of the walk.
  const SimilarityTransform& place() const { return wide_ ? *wide_ : b_in_a_; }

  bool search(Scratch& s);
  bool stepAll(PairSteps& steps, Scratch& s);
  void testLargeTriangles(PairSteps& steps, const StepEvent& event, Scratch& s);
  bool testLeaves(const StepEvent& event, Scratch& s);
  bool testCell(const StepEvent& event, Scratch& s);
  const SimilarityTransform& aInB();

  const TreeSide &a_, &b_;
  const SimilarityTransform& b_in_a_;
  std::optional<SimilarityTransform> wide_;  // where a side answers with cells
  SimilarityTransform a_in_b_;               // once asked for
  bool inverted_ = false;
  bool is_shallow_ = false;  // see areSeparate()
  Visitor* visitor_ = nullptr;
  std::size_t steps_, most_steps_;
  bool gave_up_;  // after more than most_steps_
  bool in_order_ = false;
};

}  // namespace bocst::query
