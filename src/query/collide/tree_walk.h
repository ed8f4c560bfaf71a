// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "query/collide/deferred_pairs.h"
#include "query/collide/tree_steps.h"
#include "query/cull/separation.h"
#include "query/leaf/leaf_pairs.h"
#include "query/sides/visitor.h"

namespace bocst::query {

/// The walk of PairWalk for two trees with exact answers, where queries spend most of their time. Volumes are in float
/// about the middles of the roots (see PairFrames); a block is decoded once for all nodes that it is tested against.
class TreeWalk {
 public:
  static bool fits(const TreeSide& a, const TreeSide& b, const SimilarityTransform& b_in_a) {
    // A margin that is large beside a model of tiny extent would overflow in float.
    return !a.isConservative() && !b.isConservative() && PairFrames::fits(b_in_a.scale) && b_in_a.tolerance < 1e9;
  }

  TreeWalk(const TreeSide& a, const TreeSide& b, const SimilarityTransform& b_in_a) : a_(a), b_(b), b_in_a_(b_in_a) {}

  /// Are the two surely apart by their supports, so that no walk is needed? Costs little; to be asked before run().
  bool isNeedless() { return areSeparate(a_.tree().supports(), b_.tree().supports(), b_in_a_, is_shallow_); }

  /// True when the visitor ended it. `may_give_up`: a walk that looks for one hit may end without having seen all, see
  /// gaveUp().
  bool run(Visitor& visitor, bool may_give_up = false);

  /// Did the walk end too early to tell? Volumes in float separate too little here, for example two flat faces with
  /// little space between them; a walk over BoxSide takes less time.
  bool gaveUp() const { return gave_up_; }

 private:
  struct Scratch;

  bool search(Scratch& s);
  bool stepAll(PairSteps& steps, Scratch& s);
  void testLargeTriangles(PairSteps& steps, const StepEvent& event, Scratch& s);
  bool testLeaves(const StepEvent& event, Scratch& s);
  const SimilarityTransform& aInB();
  std::size_t mostLeafPairs() const;

  const TreeSide &a_, &b_;
  const SimilarityTransform& b_in_a_;
  SimilarityTransform a_in_b_;  // once asked for
  bool inverted_ = false;
  bool is_shallow_ = false;  // see areSeparate()
  Visitor* visitor_ = nullptr;
  std::size_t leaf_pairs_ = 0, most_leaf_pairs_ = ~std::size_t{0};
  bool gave_up_ = false;
};

}  // namespace bocst::query
