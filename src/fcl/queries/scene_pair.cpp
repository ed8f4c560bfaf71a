// SPDX-License-Identifier: BSD-3-Clause
#include "fcl/queries/scene_pair.h"

#include <algorithm>
#include <limits>

#include "fcl/adapters/convex_shapes.h"
#include "fcl/adapters/pair.h"
#include "fcl/queries/query_scope.h"
#include "query/collide/sphere_walk.h"
#include "query/collide/tree_walk.h"

namespace bocst::fcl_adapter {

template <typename S>
bool hullsApart(const Model<S>& a, const fcl::Transform3<S>& X_WA, const Model<S>& b, const fcl::Transform3<S>& X_WB,
                double gap) {
  const QueryScope scope(treeOf(a), treeOf(b));
  const OrderedPair<S> pair{&a, X_WA, &b, X_WB, false};
  query::SimilarityTransform b_in_a = relate<S>(pair, scope.a(), scope.b()).b_in_a;
  const bool spheres = query::SphereWalk::fits(scope.a(), scope.b());
  if (!spheres && !query::TreeWalk::fits(scope.a(), scope.b(), b_in_a) &&
      !query::TreeWalk::fitsCells(scope.a(), scope.b(), b_in_a)) {
    return false;
  }
  b_in_a.tolerance += (marginOf(&a, &b) + gap) / unitOf(scope.a());
  if (spheres) return query::SphereWalk(scope.a(), scope.b(), b_in_a).areBoxesApart();
  return query::TreeWalk(scope.a(), scope.b(), b_in_a).isNeedless();
}

namespace {

/// Calls f with the body of a bounded shape; does nothing for other geometries.
template <typename S, typename F>
void withBoundedShape(const fcl::CollisionGeometry<S>& g, F&& f) {
  if (!isShape<S>(&g)) return;
  withConvexShape(static_cast<const fcl::ShapeBase<S>&>(g), query::Sphere(), [&](const query::ConvexShape& shape) {
    if (const auto* bounded = dynamic_cast<const query::SupportShape*>(&shape)) f(*bounded);
  });
}

/// How far a body is beyond a half-space, or beyond either side of a plane; negative: they overlap.
template <typename Shape>
double gapTo(const Shape& plane, const Eigen::Isometry3d& X_WP, const query::SupportShape& body,
             const Eigen::Isometry3d& X_WB) {
  const auto [n, height] = equationOf(plane);
  const Eigen::Vector3d normal = X_WP.linear() * n, normal_in_body = X_WB.linear().transpose() * normal;
  // Not the height in the world: both may be far from its origin.
  const double middle = normal.dot(X_WB.translation() - X_WP.translation()) - height;
  const double lowest = middle + normal_in_body.dot(body.support(-normal_in_body)) - body.radius();
  if (plane.getNodeType() == fcl::GEOM_HALFSPACE) return lowest;
  return std::max(lowest, -(middle + normal_in_body.dot(body.support(normal_in_body)) + body.radius()));
}

}  // namespace

template <typename S>
std::optional<double> distanceToPlane(const fcl::CollisionGeometry<S>& a, const fcl::Transform3<S>& X_WA,
                                      const fcl::CollisionGeometry<S>& b, const fcl::Transform3<S>& X_WB) {
  const fcl::NODE_TYPE type = b.getNodeType();
  if (type != fcl::GEOM_PLANE && type != fcl::GEOM_HALFSPACE) {
    if (a.getNodeType() != fcl::GEOM_PLANE && a.getNodeType() != fcl::GEOM_HALFSPACE) return std::nullopt;
    return distanceToPlane<S>(b, X_WB, a, X_WA);
  }
  std::optional<double> distance;
  withBoundedShape<S>(a, [&](const query::SupportShape& body) {
    const Eigen::Isometry3d X = isometryOf<S>(X_WB), Y = isometryOf<S>(X_WA);
    const double gap = type == fcl::GEOM_PLANE ? gapTo(static_cast<const fcl::Plane<S>&>(b), X, body, Y)
                                               : gapTo(static_cast<const fcl::Halfspace<S>&>(b), X, body, Y);
    distance = std::max(gap, 0.0);
  });
  return distance;
}

template <typename S>
std::optional<double> distanceOfShapes(const fcl::CollisionGeometry<S>& a, const fcl::Transform3<S>& X_WA,
                                       const fcl::CollisionGeometry<S>& b, const fcl::Transform3<S>& X_WB) {
  // Not inverse(): the difference first, as both may be far from the origin.
  const Eigen::Isometry3d X = isometryOf<S>(X_WA), Y = isometryOf<S>(X_WB);
  Eigen::Isometry3d X_AB = Eigen::Isometry3d::Identity();
  X_AB.linear() = X.linear().transpose() * Y.linear();
  X_AB.translation() = X.linear().transpose() * (Y.translation() - X.translation());
  const Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  std::optional<double> distance;
  withBoundedShape<S>(a, [&](const query::SupportShape& core_a) {
    withBoundedShape<S>(b, [&](const query::SupportShape& core_b) {
      const query::DifferenceShape difference(core_a, core_b, X_AB);
      distance = std::max(difference.gap({&origin, 1}, std::numeric_limits<double>::infinity()).at_least, 0.0);
    });
  });
  return distance;
}

template <typename S>
std::unique_ptr<Model<S>> modelOfBvh(const fcl::CollisionGeometry<S>& geometry) {
  bvhSideOf<S>("Scene", &geometry);  // throws unless it is a finished mesh
  std::unique_ptr<Model<S>> model;
  withBvh<S>("Scene", &geometry, [&](const auto& bvh) { model = std::make_unique<Model<S>>(bvh); });
  model->threshold_occupied = geometry.threshold_occupied;
  model->cost_density = geometry.cost_density;
  return model;
}

template std::optional<double> distanceOfShapes<float>(const fcl::CollisionGeometry<float>&,
                                                       const fcl::Transform3<float>&,
                                                       const fcl::CollisionGeometry<float>&,
                                                       const fcl::Transform3<float>&);
template std::optional<double> distanceOfShapes<double>(const fcl::CollisionGeometry<double>&,
                                                        const fcl::Transform3<double>&,
                                                        const fcl::CollisionGeometry<double>&,
                                                        const fcl::Transform3<double>&);
template std::optional<double> distanceToPlane<float>(const fcl::CollisionGeometry<float>&,
                                                      const fcl::Transform3<float>&,
                                                      const fcl::CollisionGeometry<float>&,
                                                      const fcl::Transform3<float>&);
template std::optional<double> distanceToPlane<double>(const fcl::CollisionGeometry<double>&,
                                                       const fcl::Transform3<double>&,
                                                       const fcl::CollisionGeometry<double>&,
                                                       const fcl::Transform3<double>&);
template std::unique_ptr<Model<float>> modelOfBvh<float>(const fcl::CollisionGeometry<float>&);
template std::unique_ptr<Model<double>> modelOfBvh<double>(const fcl::CollisionGeometry<double>&);
template bool hullsApart<float>(const Model<float>&, const fcl::Transform3<float>&, const Model<float>&,
                                const fcl::Transform3<float>&, double);
template bool hullsApart<double>(const Model<double>&, const fcl::Transform3<double>&, const Model<double>&,
                                 const fcl::Transform3<double>&, double);

}  // namespace bocst::fcl_adapter
