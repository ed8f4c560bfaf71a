// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "query/collide/sphere_steps.h"
#include "query/sides/visitor.h"

namespace bocst::query {

/// The walk of PairWalk for two trees with conservative answers: the same pairs by the same comparisons of spheres,
/// eight octants at a time.
class SphereWalk {
 public:
  static bool fits(const TreeSide& a, const TreeSide& b) { return a.isConservative() && b.isConservative(); }

  SphereWalk(const TreeSide& a, const TreeSide& b, const SimilarityTransform& b_in_a) : a_(a), b_(b), b_in_a_(b_in_a) {}

  /// Are the two so surely apart that nobody need walk? To be asked first, before anything is made ready for run().
  bool isNeedless() const {
    return !spheresMeet(a_.sphere(a_.root()), placed(b_.sphere(b_.root()), b_in_a_), b_in_a_.tolerance);
  }

  /// True when the visitor ended it.
  bool run(Visitor& visitor);

 private:
  struct Scratch;

  // Steps that pairs took because what is nearer to a hit was not expanded: for so many, some of that is.
  static inline const std::size_t kPrice = getenv("PRICE") ? atoi(getenv("PRICE")) : 400;

  bool search(SphereSteps& steps, Scratch& s, Visitor& visitor) const;
  bool visitLeaves(const SphereSteps& steps, Visitor& visitor) const;

  const TreeSide &a_, &b_;
  const SimilarityTransform& b_in_a_;
};

}  // namespace bocst::query
