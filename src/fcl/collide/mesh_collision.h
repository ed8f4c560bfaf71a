// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <type_traits>

#include "fcl/adapters/pair.h"
#include "fcl/collide/collide_query.h"
#include "fcl/collide/inside_contact.h"
#include "fcl/collide/mesh_collector.h"
#include "fcl/collide/triangles.h"
#include "fcl/pair/inside.h"
#include "fcl/pair/query_scope.h"
#include "query/distance/distance_walk.h"
#include "query/sides/visitor.h"

namespace bocst::fcl_adapter {

/// What collision queries of two meshes have in common. Side A is a model, side B a model (TreeSide) or a BVHModel
/// (BvhSide). While the query locks of all trees are held.
template <typename S, typename B>
class MeshCollision {
 protected:
  /// `culling_margin`: the query's margin, or what CollideQuery::cullingMargin() has for slabs.
  MeshCollision(const CollideQuery<S>& q, const query::TreeSide& a, const B& b, double culling_margin)
      : q_(q), a_(a), b_(b), relative_(relate<S>(q, a, b)), near_(withMargin(culling_margin)) {}

  /// What is within the margin touches: the walk's tolerance, in units of side A, is so much more. Positions may be off
  /// by the tolerance before.
  query::SimilarityTransform withMargin(double culling_margin) const {
    const double per_unit = 1 / unitOf(a_);
    query::SimilarityTransform near = relative_.b_in_a;
    near.margin = std::max(q_.margin * per_unit - near.tolerance, 0.0);
    near.tolerance += culling_margin * per_unit;
    return near;
  }

  /// True if the two meshes, and the spheres of their cells, are apart because their distance exceeds the range of a
  /// walk's floats. A walk would overflow, or lose the distance in its tolerance. Most queries compare one number.
  bool isOutOfSight() const {
    return relative_.b_in_a.tolerance >= kMostTolerance &&
           areOutOfSight(q_.X_W1.translation().template cast<double>(), q_.X_W2.translation().template cast<double>(),
                         magnitudeOf(a_) + magnitudeOf(b_), q_.margin);
  }

  /// Adds the contact of one mesh inside the other, if that is solid. For surfaces that do not meet.
  void addIfInside() const {
    if (isInside()) addInside(q_, a_, b_, relative_.b_in_a);
  }

  /// Calls f(collector), and hands what was collected to the query's result.
  template <typename F>
  void collect(F&& f) const {
    const Triangles<S> of_a(a_), of_b(b_);
    const double tolerance = relative_.b_in_a.tolerance + q_.margin / unitOf(a_);
    MeshCollector<S> collector(q_, a_.tree(), of_a, of_b, relative_.magnitude, tolerance);
    f(collector);
    collector.finish();
  }

  /// True if the margin exceeds rounding, so that the distance of two triangles alone decides whether they touch, and
  /// one pair will do.
  bool isWithinMargin(const MeshCollector<S>& collector) const { return near_.margin > 0 && collector.endsAtFirst(); }

  /// A yes-or-no walk within the margin, which `near` has. Beside a margin that is much larger than nodes and
  /// triangles, these separate nothing: so a walk that gets long is ended, and a search for the distance finds what is
  /// near enough to be tested. walk_blocks(most_steps) returns a query::WalkEnd.
  template <typename WalkBlocks>
  void walkWithinMargin(const query::SimilarityTransform& near, MeshCollector<S>& collector, std::size_t most_steps,
                        WalkBlocks&& walk_blocks) const {
    if (!walk_blocks(most_steps).gave_up) return;
    // What the search computes is off by less than this; so are the lengths of the tolerance.
    constexpr double kRounding = 1e-12;
    const query::SimilarityTransform& b_in_a = relative_.b_in_a;
    const double tolerance = near.margin + 2 * b_in_a.tolerance;  // of walks it may be larger, because of their slabs
    const double half_b = kTwoModels ? lattice::kMiddle : magnitudeOf(b_) / unitOf(b_);
    const double below = tolerance * (1 + kRounding) + kRounding * 2 * (lattice::kMiddle + half_b * near.scale);
    query::findNearest(a_, b_, b_in_a, {below, 0, 0, &collector});
  }
  static constexpr std::size_t kMostNodePairs = 256;  ///< Steps after which it ends a PairWalk.

  static constexpr bool kTwoModels = std::is_same<B, query::TreeSide>::value;

  const CollideQuery<S>& q_;
  const query::TreeSide& a_;
  const B& b_;
  const RelativeSides relative_;
  const query::SimilarityTransform near_;  ///< Where side B is, with the margin.

 private:
  bool isInside() const {
    const double magnitude = relative_.magnitude;
    if constexpr (kTwoModels) {
      return contains<S>(a_.tree(), q_.X_WA(), b_.tree(), q_.X_WB(), magnitude) ||
             contains<S>(b_.tree(), q_.X_WB(), a_.tree(), q_.X_WA(), magnitude);
    } else {
      return contains<S>(a_.tree(), q_.X_WA(), b_, q_.X_WB(), magnitude);
    }
  }
};

}  // namespace bocst::fcl_adapter
