// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/fcl.h>
#include <fcl/geometry/shape/ellipsoid.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "fcl/adapters/bodies.h"
#include "fcl/adapters/models.h"
#include "fcl/adapters/motion.h"
#include "fcl/adapters/pair.h"
#include "fcl/adapters/validate.h"
#include "fcl/collide/collide_pair.h"
#include "fcl/pair/convex_frame.h"
#include "fcl/pair/query_scope.h"
#include "query/ccd/contact_time_walk.h"

namespace bocst::fcl_adapter {
namespace {

using query::ContactGoal;
using query::Motion;
using query::SimilarityTransform;
using query::TreeSide;

/// The caller's question, in the caller's order.
template <typename S>
struct ContinuousQuery : OrderedPair<S, Motion> {
  const fcl::ContinuousCollisionRequest<S>& request;
};

SimilarityTransform inBody(const tree::Tree& tree) {
  SimilarityTransform p;
  p.scale = tree.surface().lattice.unit();
  p.translation = tree.surface().lattice.origin();
  return p;
}

/// How large a body is: half the diagonal of a box about it, and the largest distance of its points from its origin.
struct Size {
  double half_diagonal, reach;
};
Size sizeOf(const TreeSide& side) { return {side.tree().surface().bounds.diagonal().norm() / 2, magnitudeOf(side)}; }
Size sizeOf(const BvhSide& side) { return {side.volume(side.root()).half.norm(), magnitudeOf(side)}; }

/// What counts as a contact.
template <typename S>
ContactGoal goalOf(const ContinuousQuery<S>& q, const Size& size1, const Size& size2, double margin) {
  const double reach = size1.reach + size2.reach;
  double largest = reach;
  for (const Motion* m : {&q.X_W1, &q.X_W2}) {
    const Eigen::Vector3d p = m->at(0).translation();
    largest = std::max(largest, p.norm() + m->fastest(p, reach, 0));
  }
  ContactGoal goal;
  goal.margin = margin;
  // FCL's triangle test in S, and this walk's coordinates in the world; a billionth of the smaller body so that a pair
  // that passes at no distance at all does not take for ever.
  goal.rounding = std::max({1e-9 * std::min(size1.half_diagonal, size2.half_diagonal), 1e-13 * largest,
                            roundingOf<S>(largest), std::numeric_limits<double>::min()});
  goal.time_error = static_cast<double>(q.request.toc_err);
  return goal;
}

/// A ball about the partner's origin, in its frame, that contains the model during the whole motion. Motions keep the
/// distance of the partner's points from that origin, so points of the partner outside the ball touch nothing.
query::Sphere regionOf(const Motion& of_model, const Eigen::AlignedBox3d& bounds, const Motion& of_partner) {
  const Eigen::Vector3d center = of_model.at(0) * bounds.center(), origin = of_partner.at(0).translation();
  // Spheres of cells stick out of the bounds.
  const double radius = 2 * bounds.diagonal().norm();
  return {Eigen::Vector3d::Zero(),
          (center - origin).norm() + radius + of_model.fastest(center, radius, 0) + of_partner.fastest(origin, 0, 0)};
}

/// The distance at which collide() may call spheres touching for the sake of rounding, on all of the way.
template <typename S>
double roundingOfCollide(const ContinuousQuery<S>& q, double sizes) {
  double largest = sizes;
  for (const Motion* m : {&q.X_W1, &q.X_W2}) {
    const Eigen::Vector3d p = m->at(0).translation();
    largest += p.norm() + m->fastest(p, 0, 0);
  }
  return roundingOf<S>(largest);
}

/// The same of bodies, see ConvexFrame and NarrowPhase.
template <typename S>
double toleranceOfCollide(const ContinuousQuery<S>& q, double model_size, double region) {
  return roundingOfCollide(q, region + 2 * model_size) + static_cast<double>(fcl::CollisionRequest<S>().gjk_tolerance);
}

/// The axis about which a shape may be turned without a change, in its frame; zero for other geometries.
template <typename S>
Eigen::Vector3d axisOfRevolution(const fcl::CollisionGeometry<S>& geometry) {
  switch (geometry.getNodeType()) {
    case fcl::GEOM_CAPSULE:
    case fcl::GEOM_CONE:
    case fcl::GEOM_CYLINDER:
      return Eigen::Vector3d::UnitZ();
    case fcl::GEOM_ELLIPSOID: {
      const fcl::Vector3<S>& r = static_cast<const fcl::Ellipsoid<S>&>(geometry).radii;
      for (int k = 0; k < 3; ++k) {
        if (r[(k + 1) % 3] == r[(k + 2) % 3]) return Eigen::Vector3d::Unit(k);
      }
      return Eigen::Vector3d::Zero();
    }
    default:
      return Eigen::Vector3d::Zero();
  }
}

/// The motion of a body of revolution, `reach` from its origin at most, that turns about nearly its own axis, as a
/// wheel does; nothing for other bodies and motions.
template <typename S>
std::optional<query::RevolutionMotion> motionOfWheel(const fcl::CollisionGeometry<S>& geometry, const Motion& motion,
                                                     double reach) {
  constexpr double kNearly = 0.1;
  const auto* const turning = dynamic_cast<const query::AxisMotion*>(&motion);
  const Eigen::Vector3d own_axis = axisOfRevolution(geometry);
  if (turning == nullptr || own_axis.isZero(0) || turning->turn().isZero(0)) return std::nullopt;
  const query::RevolutionMotion wheel(*turning, own_axis);
  return wheel.shareOfTurn(reach) < kNearly ? std::make_optional(wheel) : std::nullopt;
}

/// When a model and a shape or an octree first touch; see timeOfContact().
template <typename S>
double walkConvex(const ContinuousQuery<S>& q, const TreeSide& a, double margin) {
  const oracle::Surface& surface = a.tree().surface();
  const query::Sphere region = regionOf(q.X_WA(), surface.bounds, q.X_WB());
  double time = std::numeric_limits<double>::infinity();
  const auto run = [&](const auto& b) {
    const query::Sphere ball = b.sphere(b.root());
    const Size size{std::min(ball.radius, region.radius), std::min(ball.center.norm() + ball.radius, region.radius)};
    const Size model_size = sizeOf(a);
    ContactGoal goal = goalOf(q, model_size, size, margin);
    // The walk stops between a half of it and all of it.
    goal.rounding = std::max(goal.rounding, 2 * toleranceOfCollide(q, model_size.reach, region.radius));
    const auto wheel = motionOfWheel<S>(*q.b(), q.X_WB(), size.reach);
    const Motion& motion = wheel ? *wheel : q.X_WB();
    query::ContactTimeWalk<TreeSide, std::decay_t<decltype(b)>> walk(a, inBody(a.tree()), q.X_WA(), b,
                                                                     SimilarityTransform(), motion);
    time = walk.run(goal);
  };
  withBodies(*q.b(), poseAt<S>(q.X_WB(), 0), region, run);
  return time;
}

/// When the two first touch, if they do not at the begin; infinite without contact. Nothing when a mesh, that of side A
/// or of side B, is not the one that it is said to be.
template <typename S>
std::optional<double> timeOfContact(const ContinuousQuery<S>& q, const Mesh* mesh_a, const Mesh* mesh_b) {
  const Model<S>*model_a = asModel<S>(q.a()), *model_b = asModel<S>(q.b());
  const double margin = marginOf(model_a, model_b);
  const auto walk = [&](const TreeSide& a, const auto& b, const SimilarityTransform& b_in_body) {
    ContactGoal goal = goalOf(q, sizeOf(a), sizeOf(b), margin);
    if (a.isConservative() || b.isConservative()) {
      // The walk stops between a half of it and all of it; collide() rounds the margin, too.
      goal.rounding = std::max(goal.rounding, 4 * roundingOfCollide(q, 2 * (sizeOf(a).reach + sizeOf(b).reach)));
    }
    return query::findContactTime(a, inBody(a.tree()), q.X_WA(), b, b_in_body, q.X_WB(), goal);
  };
  tree::Tree& tree = treeOf(*model_a);
  if (model_b != nullptr) {
    const QueryScope scope(tree, treeOf(*model_b));
    if (tree.surface().mesh.get() != mesh_a || treeOf(*model_b).surface().mesh.get() != mesh_b) return {};
    return walk(scope.a(), scope.b(), inBody(scope.b().tree()));
  }
  const QueryScope scope(tree);
  if (tree.surface().mesh.get() != mesh_a) return {};
  if (isBodies(q.b())) return walkConvex(q, scope.a(), margin);
  return walk(scope.a(), bvhSideOf<S>("continuousCollide", q.b()), SimilarityTransform());
}

template <typename S>
double firstContact(const ContinuousQuery<S>& q) {
  checkPartners<S>("continuousCollide", q.o1, q.o2);
  const fcl::Transform3<S> X_W1 = poseAt<S>(q.X_W1, 0), X_W2 = poseAt<S>(q.X_W2, 0);
  for (;;) {
    // Held, so that another mesh does not get the address of one of these.
    const auto mesh_a = meshOf(asModel<S>(q.a())), mesh_b = meshOf(asModel<S>(q.b()));
    fcl::CollisionResult<S> begin;
    if (collidePair<S>(q.o1, X_W1, q.o2, X_W2, {}, fcl::CollisionRequest<S>(), begin) > 0) return 0;
    if (!q.o1->isOccupied() || !q.o2->isOccupied()) return std::numeric_limits<double>::infinity();
    // What the begin was asked of must be what moves on.
    const std::optional<double> time = timeOfContact(q, mesh_a.get(), mesh_b.get());
    if (time) return *time;
  }
}

template <typename S>
S answer(const ContinuousQuery<S>& q, fcl::ContinuousCollisionResult<S>& result) {
  // An empty model touches nothing.
  const bool is_empty = kindOf<S>("continuousCollide", q.o1, q.o2) == PairKind::kNothing;
  const double time = is_empty ? std::numeric_limits<double>::infinity() : firstContact(q);
  result.is_collide = time <= 1;
  // Rounded, if at all, to what is earlier.
  result.time_of_contact = result.is_collide ? static_cast<S>(time) : S(1);
  if (static_cast<double>(result.time_of_contact) > time) {
    result.time_of_contact = std::nextafter(result.time_of_contact, S(0));
  }
  result.contact_tf1 = poseAt<S>(q.X_W1, static_cast<double>(result.time_of_contact));
  result.contact_tf2 = poseAt<S>(q.X_W2, static_cast<double>(result.time_of_contact));
  return result.time_of_contact;
}

}  // namespace

template <typename S>
S continuousPair(const fcl::CollisionGeometry<S>* o1, const fcl::MotionBase<S>* motion1,
                 const fcl::CollisionGeometry<S>* o2, const fcl::MotionBase<S>* motion2,
                 const fcl::ContinuousCollisionRequest<S>& request, fcl::ContinuousCollisionResult<S>& result) {
  checkRequest(request);
  const auto m1 = motionOf<S>("motion1", motion1), m2 = motionOf<S>("motion2", motion2);
  return answer(ContinuousQuery<S>{{o1, *m1, o2, *m2, !isModel<S>(o1)}, request}, result);
}

template <typename S>
S continuousPair(const fcl::CollisionGeometry<S>* o1, const fcl::Transform3<S>& X_W1_begin,
                 const fcl::Transform3<S>& X_W1_end, const fcl::CollisionGeometry<S>* o2,
                 const fcl::Transform3<S>& X_W2_begin, const fcl::Transform3<S>& X_W2_end,
                 const fcl::ContinuousCollisionRequest<S>& request, fcl::ContinuousCollisionResult<S>& result) {
  checkRequest(request);
  checkPose("continuousCollide", "tf1_beg", X_W1_begin);
  checkPose("continuousCollide", "tf1_end", X_W1_end);
  checkPose("continuousCollide", "tf2_beg", X_W2_begin);
  checkPose("continuousCollide", "tf2_end", X_W2_end);
  const auto m1 = motionOf<S>(X_W1_begin, X_W1_end, request.ccd_motion_type);
  const auto m2 = motionOf<S>(X_W2_begin, X_W2_end, request.ccd_motion_type);
  return answer(ContinuousQuery<S>{{o1, *m1, o2, *m2, !isModel<S>(o1)}, request}, result);
}

#define BOCST_INSTANTIATE(S)                                                                                        \
  template S continuousPair(const fcl::CollisionGeometry<S>*, const fcl::MotionBase<S>*,                            \
                            const fcl::CollisionGeometry<S>*, const fcl::MotionBase<S>*,                            \
                            const fcl::ContinuousCollisionRequest<S>&, fcl::ContinuousCollisionResult<S>&);         \
  template S continuousPair(const fcl::CollisionGeometry<S>*, const fcl::Transform3<S>&, const fcl::Transform3<S>&, \
                            const fcl::CollisionGeometry<S>*, const fcl::Transform3<S>&, const fcl::Transform3<S>&, \
                            const fcl::ContinuousCollisionRequest<S>&, fcl::ContinuousCollisionResult<S>&);
BOCST_INSTANTIATE(float)
BOCST_INSTANTIATE(double)
#undef BOCST_INSTANTIATE

}  // namespace bocst::fcl_adapter
