// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <type_traits>

#include "fcl/adapters/narrow_phase.h"
#include "fcl/adapters/pair.h"
#include "fcl/collide/convex_collector.h"
#include "fcl/collide/inside_contact.h"
#include "fcl/collide/walk_in_order.h"
#include "fcl/pair/convex_frame.h"
#include "fcl/pair/inside.h"
#include "fcl/pair/query_scope.h"
#include "query/collide/pair_walk.h"
#include "query/sides/convex_side.h"
#include "query/sides/turns.h"

namespace bocst::fcl_adapter {

/// A collision query of a model, side A, and the solid bodies of a partner (see ConvexCollector).
/// with_partner(frame, costs, f) makes the partner's side, with what has no contacts but costs or without, and calls f
/// with it.
template <typename S, typename WithPartner>
class ConvexCollision {
 public:
  ConvexCollision(const CollideQuery<S>& q, tree::Tree& tree, const NarrowPhase<S>& narrow_phase,
                  const WithPartner& with_partner)
      : q_(q),
        request_(withoutApproximateCosts(q.request)),
        contacts_{q, request_, q.result, q.margin, q.is_distance},
        tree_(tree),
        narrow_phase_(narrow_phase),
        with_partner_(with_partner),
        scope_(tree),
        a_(scope_.a()),
        frame_(q.X_WA(), q.X_WB(), tree.surface()) {}

  /// Adds contacts and cost sources to the result. As FCL does for meshes: contacts first, and then the costs of the
  /// box about the mesh.
  void run() const {
    const std::size_t before = q_.result.numContacts();
    if (q_.occupied() || request_.enable_cost) {
      with_partner_(frame_, request_.enable_cost, [&](const auto& partner) { collide(partner); });
    }
    if (tree_.solid() != nullptr && q_.mayBeInside(before)) {
      with_partner_(frame_, false, [&](const auto& partner) { addIfInside(partner); });
    }
    if (request_.enable_cost != q_.request.enable_cost) {
      with_partner_(frame_, true,
                    [&](const auto& partner) { collectorOf(partner).addApproximateCosts(partner.root()); });
    }
  }

 private:
  template <typename Partner>
  using Walk = query::PairWalk<query::TreeSide, Partner>;

  static fcl::CollisionRequest<S> withoutApproximateCosts(fcl::CollisionRequest<S> request) {
    request.enable_cost = request.enable_cost && !request.use_approximate_cost;
    return request;
  }

  template <typename Partner>
  ConvexCollector<S, Partner> collectorOf(const Partner& partner) const {
    return {contacts_, partner, frame_, tree_, narrow_phase_, request_.enable_cost, q_.request.enable_cost};
  }

  // What is farther away than can be computed with touches nothing.
  template <typename Partner>
  bool isOutOfSight(const Partner& partner) const {
    const Eigen::AlignedBox3d& bounds = tree_.surface().bounds;
    const double size = bounds.diagonal().norm();
    if (frame_.rounding() < kMostTolerance * size) return false;
    const query::Sphere ball = partner.sphere(partner.root());
    return areOutOfSight(frame_ * bounds.center(), ball.center, size + ball.radius, q_.margin);
  }

  template <typename Partner>
  void collide(const Partner& partner) const {
    if (isOutOfSight(partner)) return;
    ConvexCollector<S, Partner> collector = collectorOf(partner);
    const query::SimilarityTransform b_in_a =
        frame_.toLattice(tree_.surface().lattice, collector.tolerance(a_.isConservative()));
    if (!tryInOrder(partner, b_in_a, collector)) walk(partner, b_in_a, collector);
    collector.finish(a_.isConservative());
  }

  // False where it gave up, or is not for this query.
  template <typename Partner>
  bool tryInOrder(const Partner& partner, const query::SimilarityTransform& b_in_a,
                  ConvexCollector<S, Partner>& collector) const {
    if constexpr (Partner::kHasCubes) {
      const WalkInOrder in_order = prepareWalkInOrder(q_, {&tree_}, false, [&](const CollideQuery<S>& any) {
        ConvexCollector<S, Partner> of_any(any, partner, frame_, tree_, narrow_phase_, false, false);
        Walk<Partner>(a_, partner, b_in_a, of_any).run();
      });
      if (in_order != WalkInOrder::kReady) return in_order == WalkInOrder::kNothingTouches;
      const query::TreeSide whole(tree_, a_.now());  // the root may be another one than a_ has seen
      return walkInOrder(collector, [&] {
        return Walk<Partner>(whole, partner, b_in_a, collector).runInOrder(q_.mostLeafPairs(128));
      });
    }
    return false;
  }

  template <typename Partner>
  void walk(const Partner& partner, const query::SimilarityTransform& b_in_a,
            ConvexCollector<S, Partner>& collector) const {
    const auto walk_blocks = [&](std::size_t most) { return Walk<Partner>(a_, partner, b_in_a, collector).run(most); };
    // Boxes as in TreesCollision.
    if constexpr (std::is_same_v<S, double> && std::is_base_of_v<query::ConvexSide, Partner>) {
      if (query::fitsBoxes(a_) && (collector.endsAtFirst() || query::Turns::arePaid(a_, partner))) {
        constexpr query::Turns::LimitsByKind kLimits = {{128, 1024, 256, 1}, {1024, 1024, 1024, 1}};
        query::walkByTurns(a_, partner, b_in_a, collector, kLimits, walk_blocks);
        return;
      }
    }
    walk_blocks(query::kNoLimit);
  }

  template <typename Partner>
  void addIfInside(const Partner& partner) const {
    if (contains(a_, frame_, partner)) addInside(q_, a_, partner, frame_.toLattice(tree_.surface().lattice, 0));
  }

  const CollideQuery<S>& q_;
  const fcl::CollisionRequest<S> request_;
  const CollideQuery<S> contacts_;  ///< The query without approximate costs.
  tree::Tree& tree_;
  const NarrowPhase<S>& narrow_phase_;
  const WithPartner& with_partner_;
  const QueryScope scope_;
  const query::TreeSide& a_;
  const ConvexFrame<S> frame_;
};

template <typename S, typename WithPartner>
void collideConvex(const CollideQuery<S>& q, tree::Tree& tree, const NarrowPhase<S>& narrow_phase,
                   const WithPartner& with_partner) {
  ConvexCollision<S, WithPartner>(q, tree, narrow_phase, with_partner).run();
}

}  // namespace bocst::fcl_adapter
