// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <type_traits>

#include "fcl/adapters/bvh_side.h"
#include "fcl/collide/mesh_collision.h"
#include "fcl/collide/walk_in_order.h"
#include "query/collide/pair_walk.h"
#include "query/cull/far_apart.h"
#include "query/sides/box_side.h"
#include "query/sides/turns.h"

namespace bocst::fcl_adapter {

/// A collision query of a model, side A, and a BVHModel, while the tree's query lock is held.
template <typename S>
class BvhCollision : MeshCollision<S, BvhSide> {
  using Base = MeshCollision<S, BvhSide>;

 public:
  BvhCollision(const CollideQuery<S>& q, const query::TreeSide& a, const BvhSide& b)
      : Base(q, a, b, q.cullingMargin(a.isConservative())) {}

  /// Adds contacts to the result.
  void run() const {
    if (this->isOutOfSight()) return;
    const std::size_t before = q_.result.numContacts();
    walk(before);
    if (q_.mayBeInside(before)) this->addIfInside();
  }

 private:
  using Base::a_;
  using Base::b_;
  using Base::near_;
  using Base::q_;

  static constexpr query::Turns::LimitsByKind kLimits = {{256, 1024, 1024, 1}, {1024, 1024, 1024, 1}};

  // Between flat faces and beside slivers, oriented boxes separate what blocks do not, as with two models, see
  // TreesCollision.
  void walk(std::size_t contacts_before) const {
    const bool uses_boxes = std::is_same<S, double>::value && !(q_.margin > 0) && query::BoxSide::fits(a_);
    // Once boxes are built, they soon tell that flat parts are apart.
    const WalkInOrder in_order =
        prepareWalkInOrder(q_, {&a_.tree()}, uses_boxes && query::Turns::arePaid(a_, b_),
                           [this](const CollideQuery<S>& any) { BvhCollision<S>(any, a_, b_).walk(0); });
    if (in_order == WalkInOrder::kNothingTouches) return;

    std::size_t steps = 0;
    this->collect([&](MeshCollector<S>& collector) {
      if (in_order == WalkInOrder::kReady && tryInOrder(collector, steps)) return;
      const auto walk_blocks = [&](std::size_t most) {
        return query::PairWalk<query::TreeSide, BvhSide>(a_, b_, near_, collector).run(most);
      };
      if (!a_.isConservative() && this->isWithinMargin(collector)) {
        this->walkWithinMargin(near_, collector, Base::kMostNodePairs, walk_blocks);
      } else if (uses_boxes && (collector.endsAtFirst() || query::Turns::arePaid(a_, b_))) {
        query::walkByTurns(a_, b_, near_, collector, kLimits, walk_blocks);
      } else {
        steps += walk_blocks(query::kNoLimit).steps;
      }
    });
    // A walk for a verdict pays for boxes itself, a walk for contacts where it found none.
    if (uses_boxes && !q_.endsAtFirst() && q_.result.numContacts() == contacts_before) {
      query::Turns::pay(a_, b_, kLimits.of_verdict, steps);
    }
  }

  // False where it gave up, later than two models do: by position takes longer here.
  bool tryInOrder(MeshCollector<S>& collector, std::size_t& steps) const {
    const query::TreeSide a(a_.tree(), a_.now());  // the root may be another one than a_ has seen
    if (query::outlinesHardlyOverlap(a, b_.volume(b_.root()), near_)) return false;
    return walkInOrder(collector, [&] {
      const query::WalkEnd end =
          query::PairWalk<query::TreeSide, BvhSide>(a, b_, near_, collector).runInOrder(q_.mostLeafPairs(128));
      steps = end.steps;
      return end;
    });
  }
};

}  // namespace bocst::fcl_adapter
