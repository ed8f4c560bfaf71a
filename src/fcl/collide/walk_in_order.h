// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <initializer_list>
#include <new>

#include "fcl/collide/collide_query.h"
#include "query/sides/visitor.h"
#include "tree/tree.h"

namespace bocst::fcl_adapter {

/// Few contacts of models that can be complete are those that a walk in order over complete trees finds first, unless
/// surfaces hardly touch. Only what never changes decides this, so that the same query gets the same contacts.
enum class WalkInOrder {
  kNo,  ///< Contacts are chosen by ContactOrder.
  kReady,
  kNothingTouches,
};

/// Builds the trees, if they are not complete and any contact shows that they are needed: ask(query) adds it to the
/// query's result, if there is one. `asks_always`: also where the trees are complete. While the trees' query locks are
/// held.
template <typename S, typename Ask>
WalkInOrder prepareWalkInOrder(const CollideQuery<S>& q, std::initializer_list<tree::Tree*> trees, bool asks_always,
                               Ask&& ask) {
  const auto isBuilt = [](const tree::Tree* tree) { return tree->isBuiltForFew(); };
  const auto isComplete = [](const tree::Tree* tree) { return tree->isComplete(); };
  if (!q.mayTakeInOrder() || !std::all_of(trees.begin(), trees.end(), isBuilt)) return WalkInOrder::kNo;
  if (!asks_always && std::all_of(trees.begin(), trees.end(), isComplete)) return WalkInOrder::kReady;
  const fcl::CollisionRequest<S> any;
  fcl::CollisionResult<S> result;
  ask(CollideQuery<S>{static_cast<const OrderedPair<S>&>(q), any, result, q.margin});
  if (!result.isCollision()) return WalkInOrder::kNothingTouches;
  try {
    for (tree::Tree* const tree : trees) {
      if (!tree->isComplete()) tree->build();
    }
  } catch (const std::bad_alloc&) {
    return WalkInOrder::kNo;
  }
  return WalkInOrder::kReady;
}

/// True if the walk in order, walk(), told the collector all that is asked for, or all there is; else what came is
/// forgotten.
template <typename Collector, typename Walk>
bool walkInOrder(Collector& collector, Walk&& walk) {
  collector.beginInOrder();
  const query::WalkEnd end = walk();
  collector.endInOrder(end.gave_up);
  return !end.gave_up;
}

}  // namespace bocst::fcl_adapter
