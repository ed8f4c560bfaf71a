// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <type_traits>

#include "fcl/collide/collide_query.h"
#include "fcl/collide/mesh_collision.h"
#include "fcl/collide/walk_in_order.h"
#include "query/collide/pair_walk.h"
#include "query/collide/sphere_walk.h"
#include "query/collide/tree_walk.h"
#include "query/cull/crossing.h"
#include "query/cull/far_apart.h"
#include "query/sides/box_side.h"
#include "query/sides/turns.h"

namespace bocst::fcl_adapter {

/// A collision query of two models: chooses among the walks, and hands what they find to a MeshCollector. While both
/// trees' query locks are held.
template <typename S>
class TreesCollision : MeshCollision<S, query::TreeSide> {
  using Base = MeshCollision<S, query::TreeSide>;

 public:
  // TreeWalk widens slabs by itself; oriented boxes and spheres need no more than the margin.
  TreesCollision(const CollideQuery<S>& q, const query::TreeSide& a, const query::TreeSide& b)
      : Base(q, a, b, q.margin) {}

  /// What a query wants: contacts, or only whether there is one.
  enum class Wanted { kContacts, kVerdict };

  /// Adds contacts to the result. True where only a verdict is wanted and probes prove contact; then there may be none.
  bool run(Wanted wanted) {
    if (this->isOutOfSight()) return false;
    const std::size_t before = q_.result.numContacts();
    if (walk(wanted)) return true;
    if (q_.mayBeInside(before)) this->addIfInside();
    return false;
  }

 private:
  using Base::a_;
  using Base::b_;
  using Base::collect;
  using Base::isWithinMargin;
  using Base::near_;
  using Base::q_;
  using Base::walkWithinMargin;

  /// Not with float: FCL may see contacts of slivers that oriented boxes separate.
  static constexpr bool kUsesBoxes = std::is_same<S, double>::value;

  // Those that take a verdict return true where probes prove contact.

  bool walk(Wanted wanted) {
    const bool float_trees = query::TreeWalk::fits(a_, b_, near_);
    if (float_trees && !isNeedle(a_.tree()) && !isNeedle(b_.tree())) return walkTrees(wanted);
    if (kUsesBoxes && isNeedle(a_.tree()) && isNeedle(b_.tree()) && boxesFit()) {
      collect([&](MeshCollector<S>& collector) { walkBoxes(collector); });
      return false;
    }
    if (query::SphereWalk::fits(a_, b_)) return walkSpheres(wanted);
    if (query::TreeWalk::fitsCells(a_, b_, near_)) {
      walkCells();
    } else {
      walkInDouble();
    }
    return false;
  }

  /// True if a surface is so long and thin that the float walk's rounding, a part of its length, is as wide as it is.
  /// The walk in double parts what that one cannot; of two such surfaces, along the axes of oriented boxes.
  static bool isNeedle(const tree::Tree& tree) {
    constexpr float kThin = 0x1p-12f;
    return tree.outline().read([](const tree::Outline::Reader& box) {
      const float x = box.half(0), y = box.half(1), z = box.half(2);
      const float most = std::max({x, y, z}), least = std::min({x, y, z}), middle = x + y + z - most - least;
      return middle < kThin * most;
    });
  }

  // Two models with exact answers, in float.
  bool walkTrees(Wanted wanted) {
    query::TreeWalk trees(a_, b_, near_);
    if (trees.isNeedless(q_.hulls)) return false;
    if (kUsesBoxes && boxesApart()) return false;
    if (isProved(wanted)) return true;
    const WalkInOrder in_order = prepareWalkInOrder(
        q_, {&a_.tree(), &b_.tree()}, false,
        [this](const CollideQuery<S>& any) { TreesCollision<S>(any, a_, b_).walk(Wanted::kContacts); });
    if (in_order == WalkInOrder::kNothingTouches) return false;

    const std::size_t before = q_.result.numContacts();
    std::size_t steps = 0;
    collect([&](MeshCollector<S>& collector) {
      if (in_order == WalkInOrder::kReady && tryInOrder(collector)) return;
      if (isWithinMargin(collector)) {
        constexpr std::size_t kMostLeafPairs = 64;
        walkWithinMargin(near_, collector, kMostLeafPairs,
                         [&](std::size_t most) { return trees.run(collector, most); });
      } else if (takesTurns(collector)) {
        trees.runByTurns(collector);
      } else {
        steps = trees.run(collector, query::kNoLimit).steps;
      }
    });
    // A walk for a verdict pays for oriented boxes itself, a walk for contacts where it found none. Within a margin all
    // pairs are near, which boxes do not change.
    const bool has_missed = !q_.endsAtFirst() && q_.result.numContacts() == before;
    if (kUsesBoxes && has_missed && !(near_.margin > 0)) trees.payForBoxes(steps);
    return false;
  }

  // False where it gave up.
  bool tryInOrder(MeshCollector<S>& collector) const {
    // The trees may have other roots than those that the query's sides have seen.
    const query::TreeSide a(a_.tree(), a_.now()), b(b_.tree(), b_.now());
    query::TreeWalk walk(a, b, near_);
    if (walk.isNeedless()) return true;
    // What lies flat on something else, or at the place of its copy, has many pairs of leaves in doubt, and few that
    // touch.
    if (query::outlinesHardlyOverlap(a, b, near_) || query::outlinesCoincide(a, b, near_)) return false;
    return walkInOrder(collector, [&] { return walk.runInOrder(collector, q_.mostLeafPairs(32)); });
  }

  // Two models with conservative answers.
  bool walkSpheres(Wanted wanted) {
    query::SphereWalk spheres(a_, b_, near_);
    if (spheres.isNeedless()) return false;
    if (isProved(wanted)) return true;
    collect([&](MeshCollector<S>& collector) { spheres.run(collector); });
    return false;
  }

  // One with conservative answers beside one with exact ones, in float.
  void walkCells() {
    query::TreeWalk trees(a_, b_, near_);
    if (!trees.isNeedless()) collect([&](MeshCollector<S>& collector) { trees.run(collector); });
  }

  // What float cannot hold.
  void walkInDouble() {
    const bool spheres = a_.isConservative() || b_.isConservative();
    const query::SimilarityTransform wide = this->withMargin(q_.cullingMargin(spheres));
    collect([&](MeshCollector<S>& collector) {
      const auto walk_blocks = [&](std::size_t most) {
        return query::PairWalk<query::TreeSide, query::TreeSide>(a_, b_, wide, collector).run(most);
      };
      // Of a mesh that is much larger than its details, these share a unit of the lattice, and blocks part nothing.
      constexpr query::Turns::Limits kLimits = {64, 1024, 1024, 1};
      if (!spheres && isWithinMargin(collector)) {
        walkWithinMargin(wide, collector, Base::kMostNodePairs, walk_blocks);
      } else if (spheres || !kUsesBoxes || !boxesFit()) {
        walk_blocks(query::kNoLimit);
      } else if (takesTurns(collector)) {
        query::walkByTurns(a_, b_, near_, collector, {kLimits, kLimits}, walk_blocks);
      } else {
        const query::Turns turns(a_, b_, tree::Tree::Search::kYesOrNo, kLimits);
        turns.tookOverBlocks(walk_blocks(query::kNoLimit).steps, false);
      }
    });
  }

  bool isProved(Wanted wanted) const {
    return wanted == Wanted::kVerdict && query::surelyCross(a_, b_, this->relative_.b_in_a);
  }

  // Oriented boxes.

  // True if the boxes about both surfaces are apart.
  bool boxesApart() const {
    return query::mayBeApart(a_.tree().outline(), q_.X_WA().matrix().data(), b_.tree().outline(),
                             q_.X_WB().matrix().data()) &&
           (query::outlinesApart(a_, b_, near_) || query::knownBoxesApart(a_, b_, near_));
  }

  bool boxesFit() const { return query::BoxSide::fits(a_) && query::BoxSide::fits(b_); }
  void walkBoxes(MeshCollector<S>& collector) const {
    const query::BoxSide boxes_a(a_), boxes_b(b_);
    query::PairWalk<query::BoxSide, query::BoxSide>(boxes_a, boxes_b, near_, collector).run();
  }

  // A walk for contacts may be long because there are many, so it does not build the boxes.
  bool takesTurns(const MeshCollector<S>& collector) const {
    return kUsesBoxes && (collector.endsAtFirst() || (boxesFit() && query::Turns::arePaid(a_, b_)));
  }
};

}  // namespace bocst::fcl_adapter
