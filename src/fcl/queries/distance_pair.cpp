// SPDX-License-Identifier: BSD-3-Clause
#include "fcl/queries/distance_pair.h"

#include <bocst/model.h>
#include <fcl/narrowphase/collision_request.h>
#include <fcl/narrowphase/collision_result.h>

#include "fcl/adapters/models.h"
#include "fcl/adapters/octree_side.h"
#include "fcl/adapters/pair.h"
#include "fcl/adapters/validate.h"
#include "fcl/queries/collide_pair.h"
#include "fcl/queries/convex_pair.h"
#include "fcl/queries/inside.h"
#include "fcl/queries/query_scope.h"
#include "query/distance/distance_walk.h"

namespace bocst::fcl_adapter {
namespace {

using query::SimilarityTransform;
using query::TreeSide;

/// The caller's question, in the caller's order.
template <typename S>
struct DistanceQuery : OrderedPair<S> {
  const fcl::DistanceRequest<S>& request;
  fcl::DistanceResult<S>& result;
};

/// What may be given up, and what is known already, in units of side A.
template <typename S>
query::DistanceGoal goalOf(const DistanceQuery<S>& q, double unit) {
  query::DistanceGoal goal;
  if (q.result.min_distance < std::numeric_limits<S>::max()) goal.below = q.result.min_distance / unit;
  goal.absolute = q.request.abs_err / unit;
  goal.relative = q.request.rel_err;
  return goal;
}

/// Writes what a walk found in the lattice of side A.
template <typename S>
void report(const DistanceQuery<S>& q, query::Nearest n, const Eigen::Vector3d& origin, double unit) {
  const S distance = static_cast<S>(n.distance * unit);
  if (!(distance < q.result.min_distance)) return;
  const fcl::Transform3<double> X_WA = q.X_WA().template cast<double>();
  for (Eigen::Vector3d* p : {&n.on_a, &n.on_b}) *p = X_WA * Eigen::Vector3d(origin + unit * *p);
  q.inCallersOrder(n.a, n.b);
  q.inCallersOrder(n.on_a, n.on_b);
  q.result.min_distance = distance;
  q.result.o1 = q.o1;
  q.result.o2 = q.o2;
  q.result.b1 = static_cast<std::intptr_t>(n.a);
  q.result.b2 = static_cast<std::intptr_t>(n.b);
  if (q.request.enable_nearest_points) {
    q.result.nearest_points[0] = n.on_a.template cast<S>();
    q.result.nearest_points[1] = n.on_b.template cast<S>();
  }
}

/// Looks for the nearest primitives.
template <typename S, typename B>
void search(const DistanceQuery<S>& q, const TreeSide& a, const B& b, const SimilarityTransform& b_in_a) {
  const lattice::Lattice& lattice = a.tree().surface().lattice;
  query::DistanceWalk<TreeSide, B> walk(a, b, b_in_a);
  report(q, walk.run(goalOf(q, lattice.unit())), lattice.origin(), lattice.unit());
}

/// What is inside a solid is not apart from it. There are no points where they touch; the nearest of the surfaces, if
/// they are known, stay.
template <typename S>
void notApart(const DistanceQuery<S>& q) {
  q.result.min_distance = 0;
  q.result.o1 = q.o1;
  q.result.o2 = q.o2;
}

/// The same between a tree and solid bodies: with_partner(frame, f) makes the side of the bodies and calls f with it.
template <typename S, typename F>
void searchConvex(const DistanceQuery<S>& q, tree::Tree& tree, F&& with_partner) {
  const QueryScope scope(tree);
  const TreeSide& a = scope.a();
  const oracle::Surface& surface = tree.surface();
  const ConvexFrame<S> frame(q.X_WA(), q.X_WB(), surface);
  const SimilarityTransform b_in_a = frame.toLattice(surface.lattice, 0);
  with_partner(frame, [&](const auto& b) {
    search(q, a, b, b_in_a);
    if (q.result.min_distance > 0 && contains(a, frame, b)) notApart(q);
  });
}

template <typename S>
void searchModels(const DistanceQuery<S>& q, tree::Tree& tree_a, tree::Tree& tree_b) {
  const QueryScope scope(tree_a, tree_b);
  const auto [b_in_a, magnitude] = relate<S>(q, scope.a(), scope.b());
  search(q, scope.a(), scope.b(), b_in_a);
  if (q.result.min_distance > 0 && (contains<S>(tree_a, q.X_WA(), tree_b, q.X_WB(), magnitude) ||
                                    contains<S>(tree_b, q.X_WB(), tree_a, q.X_WA(), magnitude))) {
    notApart(q);
  }
}

/// Between a tree and whatever is no model.
/// @throws std::invalid_argument for a partner that is not supported.
template <typename S>
void searchPartner(const DistanceQuery<S>& q, tree::Tree& tree) {
  if (isShape(q.b())) {
    const auto& shape = static_cast<const fcl::ShapeBase<S>&>(*q.b());
    searchConvex(q, tree, [&](const ConvexFrame<S>& frame, auto&& f) {
      withConvexShape(shape, frame.region(), [&](const query::ConvexShape& body) { f(query::ConvexSide(body)); });
    });
#if FCL_HAVE_OCTOMAP
  } else if (q.b()->getNodeType() == fcl::GEOM_OCTREE) {
    searchConvex(q, tree, [&](const ConvexFrame<S>&, auto&& f) {
      const OcTreeSide<S> side(static_cast<const fcl::OcTree<S>&>(*q.b()), q.X_WB(), 1, false);
      if (!side.empty()) f(side);
    });
#endif
  } else {
    withBvh<S>("distance", q.b(), [&](const auto& bvh) {
      const QueryScope scope(tree);
      const BvhSide b("distance", bvh);
      const auto [b_in_a, magnitude] = relate<S>(q, scope.a(), b);
      search(q, scope.a(), b, b_in_a);
      if (q.result.min_distance > 0 && contains(tree, q.X_WA(), bvh, q.X_WB(), magnitude)) notApart(q);
    });
  }
}

/// Surfaces that touch have no negative distance of their own; FCL takes the depth of a contact, and so do we.
template <typename S>
void sign(const DistanceQuery<S>& q) {
  fcl::CollisionRequest<S> request;
  request.enable_contact = true;
  fcl::CollisionResult<S> contacts;
  collidePair<S>(q.o1, q.X_W1, q.o2, q.X_W2, request, contacts, 0);
  if (!contacts.isCollision()) return;
  const fcl::Contact<S>& contact = contacts.getContact(0);
  q.result.min_distance = -contact.penetration_depth;
  q.result.b1 = contact.b1;
  q.result.b2 = contact.b2;
  if (q.request.enable_nearest_points) q.result.nearest_points[0] = q.result.nearest_points[1] = contact.pos;
}

}  // namespace

template <typename S>
S distancePair(const fcl::CollisionGeometry<S>* o1, const fcl::Transform3<S>& X_W1, const fcl::CollisionGeometry<S>* o2,
               const fcl::Transform3<S>& X_W2, const fcl::DistanceRequest<S>& request, fcl::DistanceResult<S>& result) {
  const auto* model1 = asModel<S>(o1);
  const auto* model2 = asModel<S>(o2);
  if (model1 == nullptr && model2 == nullptr) {
    throw std::logic_error("bocst::distance: neither geometry is a bocst::Model");
  }
  checkPose("distance", "tf1", X_W1);
  checkPose("distance", "tf2", X_W2);
  checkRequest(request, result);
  if (request.isSatisfied(result)) return result.min_distance;
  const DistanceQuery<S> q{{o1, X_W1, o2, X_W2, model1 == nullptr}, request, result};
  if (model1 != nullptr && model2 != nullptr) {
    searchModels(q, model1->tree(), model2->tree());
  } else {
    searchPartner(q, (model1 != nullptr ? model1 : model2)->tree());
  }
  if (request.enable_signed_distance && !(result.min_distance > 0)) sign(q);
  return result.min_distance;
}

template float distancePair<float>(const fcl::CollisionGeometry<float>*, const fcl::Transform3<float>&,
                                   const fcl::CollisionGeometry<float>*, const fcl::Transform3<float>&,
                                   const fcl::DistanceRequest<float>&, fcl::DistanceResult<float>&);
template double distancePair<double>(const fcl::CollisionGeometry<double>*, const fcl::Transform3<double>&,
                                     const fcl::CollisionGeometry<double>*, const fcl::Transform3<double>&,
                                     const fcl::DistanceRequest<double>&, fcl::DistanceResult<double>&);

}  // namespace bocst::fcl_adapter
