// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "query/leaf_pairs.h"
#include "query/set_aside.h"
#include "query/tree_steps.h"
#include "query/visitor.h"

namespace bocst::query {

/// The walk of PairWalk for two trees with exact answers, where a query spends its time: the same order, with volumes
/// in float about the roots (see PairFrames) that are decoded once for all that meets them.
class TreeWalk {
 public:
  static bool fits(const TreeSide& a, const TreeSide& b, const Placement& b_in_a) {
    return !a.cells() && !b.cells() && PairFrames::fits(b_in_a.scale);
  }

  TreeWalk(const TreeSide& a, const TreeSide& b, const Placement& b_in_a, Visitor& visitor)
      : a_(a), b_(b), b_in_a_(b_in_a), visitor_(visitor) {}

  /// True when the visitor ended it.
  bool run();

 private:
  struct Scratch;

  bool search(Scratch& s);
  bool stepAll(PairSteps& steps, Scratch& s);
  void meetCoarse(PairSteps& steps, Scratch& s);
  bool testLeaves(const PairSteps& steps, Scratch& s);
  void setAside(const PairSteps& steps, Scratch& s);

  const TreeSide &a_, &b_;
  const Placement& aInB();

  const Placement& b_in_a_;
  Placement a_in_b_;  // once asked for
  bool inverted_ = false;
  Visitor& visitor_;
};

}  // namespace bocst::query
