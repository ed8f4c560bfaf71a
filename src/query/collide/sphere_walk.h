// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "query/collide/sphere_steps.h"

namespace bocst::query {

/// The walk for two trees with conservative answers: finds the pairs of leaves whose spheres meet, see spheresMeet().
/// Spheres follow from the lattices and the pose alone, so the verdict is the same with every oracle. What run() and
/// walkResident() grow depends on the oracle's boxes, too, unless Options::dimension is set.
class SphereWalk {
 public:
  static bool fits(const TreeSide& a, const TreeSide& b) { return a.isConservative() && b.isConservative(); }

  SphereWalk(const TreeSide& a, const TreeSide& b, const SimilarityTransform& b_in_a) : a_(a), b_(b), b_in_a_(b_in_a) {}

  /// True if the spheres about the roots are apart, so that no walk is needed. Costs little; call it before run().
  bool isNeedless() const {
    return !spheresMeet(a_.sphere(a_.root()), placed(b_.sphere(b_.root()), b_in_a_), b_in_a_.tolerance);
  }

  /// True if the boxes about the surfaces are so far apart that no spheres of leaves meet. It does not matter in whose
  /// frame they are compared: the margin is far larger than the rounding.
  bool areBoxesApart() const;

  /// Unless it is needless. True when the visitor ended it.
  bool run(Visitor& visitor);

  enum class Outcome { kApart, kMeet, kNeedsGrowth };
  /// Says whether the spheres of any leaves meet, from resident nodes; only if isNeedless() is false. Where more must
  /// grow, adds that to `growths`: of at most `batch` pairs, the deepest overlaps first.
  Outcome walkResident(std::size_t batch, std::vector<tree::Tree::Growth>& growths) const;

  /// The same by a device: what it is asked about this pair. False where float cannot hold the pair, or the roots are
  /// leaves, which is the host's.
  bool describe(oracle::DeviceWalks::Pair& pair) const;
  /// What it is asked about the tree of a side, from a table of its nodes.
  static oracle::DeviceWalks::Tree describe(const TreeSide& side, const tree::Tree::NodeTable& table);
  /// Marks the blocks that the device came to.
  static void markUsed(const TreeSide& side, const oracle::DeviceWalks::Tree& tree);
  /// Adds the nodes that the device asks for and that are not resident.
  static void addWanted(const TreeSide& side, const oracle::DeviceWalks::Tree& tree,
                        std::vector<tree::Tree::Growth>& growths);

 private:
  struct Scratch;

  static Scratch& scratchOfThread();
  bool search(SphereSteps& steps, Scratch& s, Visitor& visitor) const;
  bool visitLeaves(const SphereSteps& steps, Visitor& visitor) const;

  const TreeSide &a_, &b_;
  const SimilarityTransform& b_in_a_;
};

}  // namespace bocst::query
