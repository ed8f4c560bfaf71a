// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <new>
#include <type_traits>

#include "fcl/adapters/pair.h"
#include "fcl/queries/collide_query.h"
#include "fcl/queries/inside.h"
#include "fcl/queries/inside_contact.h"
#include "fcl/queries/mesh_collector.h"
#include "fcl/queries/query_scope.h"
#include "query/collide/pair_walk.h"
#include "query/collide/sphere_walk.h"
#include "query/collide/tree_walk.h"
#include "query/cull/crossing.h"
#include "query/cull/far_apart.h"
#include "query/distance/distance_walk.h"
#include "query/sides/box_side.h"

namespace bocst::fcl_adapter {

/// What is within the margin touches: the walk's tolerance, in units of side A, is so much more. Positions may be off
/// by the tolerance before. `culling_margin`: the margin, or what CollideQuery::cullingMargin() has for slabs.
template <typename S>
query::SimilarityTransform withMargin(query::SimilarityTransform b_in_a, const query::TreeSide& a,
                                      const CollideQuery<S>& q, double culling_margin) {
  const double per_unit = 1 / unitOf(a);
  b_in_a.margin = std::max(q.margin * per_unit - b_in_a.tolerance, 0.0);
  b_in_a.tolerance += culling_margin * per_unit;
  return b_in_a;
}

/// True if two meshes, and the spheres of their cells, are apart because their distance exceeds the range of a walk's
/// floats. A walk would overflow, or lose the distance in its tolerance. Most queries compare one number.
template <typename S>
bool isOutOfSight(const CollideQuery<S>& q, const query::SimilarityTransform& b_in_a, double size_a, double size_b) {
  if (b_in_a.tolerance < 1e15) return false;
  const Eigen::Vector3d half_way =
      q.X_W1.translation().template cast<double>() / 2 - q.X_W2.translation().template cast<double>() / 2;
  return half_way.cwiseAbs().maxCoeff() > 8 * (size_a + size_b) + q.margin;
}

/// A yes-or-no walk of a query with a margin, without which side B is at `b_in_a`. Beside a margin that is much larger
/// than nodes and triangles, these separate nothing: so a walk that gets long is ended, and a search for the distance
/// finds what is near enough to be tested. walk_blocks(most_steps) returns a query::WalkEnd.
template <typename S, typename B, typename WalkBlocks>
void walkWithinMargin(const query::TreeSide& a, const B& b, const query::SimilarityTransform& b_in_a,
                      const query::SimilarityTransform& near, MeshCollector<S>& collector, std::size_t most_steps,
                      WalkBlocks&& walk_blocks) {
  if (!walk_blocks(most_steps).gave_up) return;
  // What the search computes is off by less than this; so are the lengths of the tolerance.
  constexpr double kRounding = 1e-12;
  const double tolerance = near.margin + 2 * b_in_a.tolerance;  // of walks it may be larger, because of their slabs
  double half_b = lattice::kMiddle;                             // of the other side, in its own unit
  if constexpr (!std::is_same<B, query::TreeSide>::value) half_b = b.magnitude();
  const double below = tolerance * (1 + kRounding) + kRounding * 2 * (lattice::kMiddle + half_b * near.scale);
  query::findNearest(a, b, b_in_a, {below, 0, 0, &collector});
}
constexpr std::size_t kMostNodePairs = 256;  ///< Steps after which walkWithinMargin() ends a PairWalk.

/// A collision query of two models: chooses among the walks, and hands what they find to a MeshCollector. While both
/// trees' query locks are held.
template <typename S>
class TreesCollision {
 public:
  TreesCollision(const CollideQuery<S>& q, const query::TreeSide& a, const query::TreeSide& b)
      : q_(q),
        a_(a),
        b_(b),
        relative_(relate<S>(q, a, b)),
        // TreeWalk widens slabs by itself; oriented boxes and spheres need no more than the margin.
        near_(withMargin(relative_.b_in_a, a, q, q.margin)) {}

  /// What a query wants: contacts, or only whether there is one.
  enum class Wanted { kContacts, kVerdict };

  /// Adds contacts to the result. True where only a verdict is wanted and probes prove contact; then there may be none.
  bool run(Wanted wanted) {
    tree::Tree &tree_a = a_.tree(), &tree_b = b_.tree();
    const double magnitude = relative_.magnitude;
    if (isOutOfSight(q_, relative_.b_in_a, magnitudeOf(tree_a.surface().bounds),
                     magnitudeOf(tree_b.surface().bounds))) {
      return false;
    }
    const std::size_t before = q_.result.numContacts();
    if (walk(wanted)) return true;
    if (q_.mayBeInside(before) && (contains<S>(tree_a, q_.X_WA(), tree_b, q_.X_WB(), magnitude) ||
                                   contains<S>(tree_b, q_.X_WB(), tree_a, q_.X_WA(), magnitude))) {
      addInside(q_, a_, b_, relative_.b_in_a);
    }
    return false;
  }

 private:
  /// Not with float: FCL may see contacts of slivers that oriented boxes separate.
  static constexpr bool kUsesBoxes = std::is_same<S, double>::value;

  // Those that take a verdict return true where probes prove contact.

  bool walk(Wanted wanted) {
    const bool float_trees = query::TreeWalk::fits(a_, b_, near_);
    if (float_trees && !isNeedle(a_.tree()) && !isNeedle(b_.tree())) return walkTrees(wanted);
    if (kUsesBoxes && isNeedle(a_.tree()) && isNeedle(b_.tree()) && boxesFit()) {
      collect(q_, [&](MeshCollector<S>& collector) { walkBoxes(collector); });
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
    collect(q_, [&](MeshCollector<S>& collector) {
      if (in_order == WalkInOrder::kReady && walkInOrder(collector)) return;
      if (isWithinMargin(collector)) {
        constexpr std::size_t kMostLeafPairs = 64;
        walkWithinMargin(a_, b_, relative_.b_in_a, near_, collector, kMostLeafPairs,
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
  bool walkInOrder(MeshCollector<S>& collector) const {
    // The trees may have other roots than those that the query's sides have seen.
    const query::TreeSide a(a_.tree(), a_.now()), b(b_.tree(), b_.now());
    query::TreeWalk walk(a, b, near_);
    if (walk.isNeedless()) return true;
    // What lies flat on something else, or at the place of its copy, has many pairs of leaves in doubt, and few that
    // touch.
    if (query::outlinesHardlyOverlap(a, b, near_) || query::outlinesCoincide(a, b, near_)) return false;
    collector.beginInOrder();
    const query::WalkEnd end = walk.runInOrder(collector, q_.mostLeafPairs(32));
    collector.endInOrder(end.gave_up);
    return !end.gave_up;
  }

  // Two models with conservative answers.
  bool walkSpheres(Wanted wanted) {
    query::SphereWalk spheres(a_, b_, near_);
    if (spheres.isNeedless()) return false;
    if (isProved(wanted)) return true;
    collect(q_, [&](MeshCollector<S>& collector) { spheres.run(collector); });
    return false;
  }

  // One with conservative answers beside one with exact ones, in float.
  void walkCells() {
    query::TreeWalk trees(a_, b_, near_);
    if (!trees.isNeedless()) collect(q_, [&](MeshCollector<S>& collector) { trees.run(collector); });
  }

  // What float cannot hold.
  void walkInDouble() {
    const bool spheres = a_.isConservative() || b_.isConservative();
    const query::SimilarityTransform wide = withMargin(relative_.b_in_a, a_, q_, q_.cullingMargin(spheres));
    collect(q_, [&](MeshCollector<S>& collector) {
      const auto walk_blocks = [&](std::size_t most) {
        return query::PairWalk<query::TreeSide, query::TreeSide>(a_, b_, wide, collector).run(most);
      };
      // Of a mesh that is much larger than its details, these share a unit of the lattice, and blocks part nothing.
      constexpr query::Turns::Limits kLimits = {64, 1024, 1024, 1};
      if (!spheres && isWithinMargin(collector)) {
        walkWithinMargin(a_, b_, relative_.b_in_a, wide, collector, kMostNodePairs, walk_blocks);
      } else if (spheres || !kUsesBoxes || !boxesFit()) {
        walk_blocks(query::kNoLimit);
      } else if (takesTurns(collector)) {
        query::walkByTurns(a_, b_, near_, collector, kLimits, walk_blocks);
      } else {
        const query::Turns turns(a_, b_, tree::Tree::Search::kYesOrNo, kLimits);
        turns.tookOverBlocks(walk_blocks(query::kNoLimit).steps, false);
      }
    });
  }

  // Calls f(collector), and hands what was collected to the query's result.
  template <typename F>
  void collect(const CollideQuery<S>& q, F&& f) const {
    const tree::Tree &tree_a = a_.tree(), &tree_b = b_.tree();
    const Triangles<S> t1(q.swapped ? tree_b : tree_a), t2(q.swapped ? tree_a : tree_b);
    MeshCollector<S> collector(q, tree_a, t1, t2, relative_.magnitude);
    collector.setFrame(tree_a.surface().lattice, relative_.b_in_a.tolerance + q.margin / unitOf(a_));
    f(collector);
    collector.finish();
  }

  bool isProved(Wanted wanted) const {
    if (wanted != Wanted::kVerdict) return false;
    const Interior *of_a = a_.tree().interior(a_.now()), *of_b = b_.tree().interior(b_.now());
    return of_a != nullptr && of_b != nullptr && query::surelyCross(*of_a, *of_b, relative_.b_in_a);
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

  /// True if the margin exceeds rounding, so that the distance of two triangles alone decides whether they touch, and
  /// one pair will do.
  bool isWithinMargin(const MeshCollector<S>& collector) const { return near_.margin > 0 && collector.endsAtFirst(); }

  const CollideQuery<S>& q_;
  const query::TreeSide &a_, &b_;
  const RelativeSides relative_;
  const query::SimilarityTransform near_;
};

}  // namespace bocst::fcl_adapter
