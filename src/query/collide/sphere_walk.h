// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "query/collide/sphere_steps.h"

namespace bocst::query {

/// The walk for two trees with conservative answers: finds the pairs of leaves whose spheres meet, see spheresMeet().
/// They follow from the lattices and the pose, so boxes, slabs and the order of the walk may save time and decide
/// nothing.
class SphereWalk {
 public:
  static bool fits(const TreeSide& a, const TreeSide& b) { return a.isConservative() && b.isConservative(); }

  SphereWalk(const TreeSide& a, const TreeSide& b, const SimilarityTransform& b_in_a) : a_(a), b_(b), b_in_a_(b_in_a) {}

  /// Are the two so surely apart that nobody need walk? To be asked first, before anything is made ready for run().
  bool isNeedless() const {
    return !spheresMeet(a_.sphere(a_.root()), placed(b_.sphere(b_.root()), b_in_a_), b_in_a_.tolerance);
  }

  /// The same by the boxes about the surfaces, whose rounding margin hides in which frame they were compared.
  bool areBoxesApart() const;

  /// Unless it is needless. True when the visitor ended it.
  bool run(Visitor& visitor);

 private:
  struct Scratch;

  bool search(SphereSteps& steps, Scratch& s, Visitor& visitor) const;
  bool visitLeaves(const SphereSteps& steps, Visitor& visitor) const;

  const TreeSide &a_, &b_;
  const SimilarityTransform& b_in_a_;
};

}  // namespace bocst::query
