// SPDX-License-Identifier: BSD-3-Clause
#include "fcl/distance_pair.h"

#include <bocst/model.h>
#include <fcl/narrowphase/collision_request.h>
#include <fcl/narrowphase/collision_result.h>

#include "fcl/collide_pair.h"
#include "fcl/pair.h"
#include "query/distance_walk.h"

namespace bocst::fcl_room {
namespace {

using query::Placement;
using query::TreeSide;

/// The caller's question, in the caller's order.
template <typename S>
struct Question {
  const fcl::CollisionGeometry<S>*o1, *o2;
  const fcl::Transform3<S>&X_W1, &X_W2;
  const fcl::DistanceRequest<S>& request;
  fcl::DistanceResult<S>& result;
};

/// What may be given up, and what is known already, in units of side A.
template <typename S>
query::DistanceGoal goalOf(const Question<S>& q, double unit) {
  query::DistanceGoal goal;
  if (q.result.min_distance < std::numeric_limits<S>::max()) goal.below = q.result.min_distance / unit;
  goal.absolute = q.request.abs_err / unit;
  goal.relative = q.request.rel_err;
  return goal;
}

/// Writes what a walk found; side A is the caller's first geometry, or the second when `swapped`.
template <typename S>
void report(const Question<S>& q, query::Nearest n, bool swapped, const Eigen::Vector3d& origin, double unit) {
  const S distance = static_cast<S>(n.distance * unit);
  if (!(distance < q.result.min_distance)) return;
  const fcl::Transform3<double> X_WA = (swapped ? q.X_W2 : q.X_W1).template cast<double>();
  for (Eigen::Vector3d* p : {&n.on_a, &n.on_b}) *p = X_WA * Eigen::Vector3d(origin + unit * *p);
  if (swapped) {
    std::swap(n.a, n.b);
    std::swap(n.on_a, n.on_b);
  }
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

template <typename S>
void distanceModels(const Question<S>& q, tree::Tree& tree1, tree::Tree& tree2) {
  std::int64_t now;
  {
    const Look look(tree1, &tree2);
    const TreeSide a(tree1), b(tree2);
    now = a.now();
    const oracle::Surface &sa = tree1.surface(), &sb = tree2.surface();
    const double magnitude =
        magnitudeOf(q.X_W1, q.X_W2, magnitudeOf(sa.mesh->bounds()), magnitudeOf(sb.mesh->bounds()));
    const Placement b_in_a = placementOf(q.X_W1, q.X_W2, sa.lattice.origin(), sa.lattice.unit(), sb.lattice.origin(),
                                         sb.lattice.unit(), magnitude);
    query::DistanceWalk<TreeSide, TreeSide> walk(a, b, b_in_a);
    report(q, walk.run(goalOf(q, sa.lattice.unit())), false, sa.lattice.origin(), sa.lattice.unit());
  }
  tree1.afterQuery(now);
  if (&tree2 != &tree1) tree2.afterQuery(now);
}

template <typename BV>
void distanceBvh(const Question<typename BV::S>& q, tree::Tree& tree, const fcl::BVHModel<BV>& bvh, bool swapped) {
  std::int64_t now;
  {
    const Look look(tree, nullptr);
    const TreeSide a(tree);
    const BvhSide<BV> b(bvh);
    now = a.now();
    const oracle::Surface& surface = tree.surface();
    const double magnitude = magnitudeOf(q.X_W1, q.X_W2, magnitudeOf(surface.mesh->bounds()), b.magnitude());
    const Placement b_in_a =
        placementOf(swapped ? q.X_W2 : q.X_W1, swapped ? q.X_W1 : q.X_W2, surface.lattice.origin(),
                    surface.lattice.unit(), Eigen::Vector3d(Eigen::Vector3d::Zero()), 1.0, magnitude);
    query::DistanceWalk<TreeSide, BvhSide<BV>> walk(a, b, b_in_a);
    report(q, walk.run(goalOf(q, surface.lattice.unit())), swapped, surface.lattice.origin(), surface.lattice.unit());
  }
  tree.afterQuery(now);
}

/// Surfaces that touch have no negative distance of their own; FCL takes the depth of a contact, and so do we.
template <typename S>
void sign(const Question<S>& q) {
  fcl::CollisionRequest<S> request;
  request.enable_contact = true;
  fcl::CollisionResult<S> contacts;
  collidePair<S>(q.o1, q.X_W1, q.o2, q.X_W2, request, contacts);
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
  const auto* model1 = dynamic_cast<const Model<S>*>(o1);
  const auto* model2 = dynamic_cast<const Model<S>*>(o2);
  if (model1 == nullptr && model2 == nullptr) {
    throw std::logic_error("bocst::distance: neither geometry is a bocst::Model");
  }
  if (request.isSatisfied(result)) return result.min_distance;
  const Question<S> q{o1, o2, X_W1, X_W2, request, result};
  if (model1 != nullptr && model2 != nullptr) {
    distanceModels(q, model1->tree(), model2->tree());
  } else {
    const bool swapped = model1 == nullptr;
    withBvh<S>("distance", swapped ? o1 : o2,
               [&](const auto& bvh) { distanceBvh(q, (swapped ? model2 : model1)->tree(), bvh, swapped); });
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

}  // namespace bocst::fcl_room
