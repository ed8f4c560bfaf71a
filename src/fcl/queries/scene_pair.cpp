// SPDX-License-Identifier: BSD-3-Clause
#include "fcl/queries/scene_pair.h"

#include <algorithm>
#include <limits>
#include <queue>
#include <utility>

#include "fcl/adapters/convex_shapes.h"
#include "fcl/adapters/octree_side.h"
#include "fcl/adapters/pair.h"
#include "fcl/pair/query_scope.h"
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

/// The pose of B in the frame of A.
Eigen::Isometry3d relativePose(const Eigen::Isometry3d& X_WA, const Eigen::Isometry3d& X_WB) {
  // Not inverse(): the difference first, as both may be far from the origin.
  Eigen::Isometry3d X_AB = Eigen::Isometry3d::Identity();
  X_AB.linear() = X_WA.linear().transpose() * X_WB.linear();
  X_AB.translation() = X_WA.linear().transpose() * (X_WB.translation() - X_WA.translation());
  return X_AB;
}

/// Of a half-space, or of a plane, whichever side the body is on, and of a body.
template <typename Shape>
PlaneDistance distanceOf(const Shape& plane, const Eigen::Isometry3d& X_WP, const query::SupportShape& body,
                         const Eigen::Isometry3d& X_WB) {
  const auto [n, height] = equationOf(plane);
  const Eigen::Vector3d normal = X_WP.linear() * n;
  // The gap on the side that the normal points to, and the point of the body that is nearest to the plane there.
  const auto on_side = [&](double sign) {
    const Eigen::Vector3d towards_body = sign * normal, in_body = X_WB.linear().transpose() * towards_body;
    const Eigen::Vector3d arm = X_WB.linear() * (body.support(-in_body) - body.radius() * in_body);
    // Not the height in the world: both may be far from its origin.
    const double middle = towards_body.dot(X_WB.translation() - X_WP.translation()) - sign * height;
    const double gap = middle + towards_body.dot(arm);
    const Eigen::Vector3d point = X_WB.translation() + arm;
    return PlaneDistance{gap, {point - gap * towards_body, point}};
  };
  PlaneDistance result = on_side(1);
  if (plane.getNodeType() == fcl::GEOM_PLANE) {
    const PlaneDistance other = on_side(-1);
    if (other.distance > result.distance) result = other;
  }
  result.distance = std::max(result.distance, 0.0);
  return result;
}

}  // namespace

template <typename S>
std::optional<PlaneDistance> distanceToPlane(const fcl::CollisionGeometry<S>& a, const fcl::Transform3<S>& X_WA,
                                             const fcl::CollisionGeometry<S>& b, const fcl::Transform3<S>& X_WB) {
  const fcl::NODE_TYPE type = a.getNodeType();
  std::optional<PlaneDistance> result;
  if (type != fcl::GEOM_PLANE && type != fcl::GEOM_HALFSPACE) {
    if (b.getNodeType() != fcl::GEOM_PLANE && b.getNodeType() != fcl::GEOM_HALFSPACE) return result;
    result = distanceToPlane<S>(b, X_WB, a, X_WA);
    if (result.has_value()) std::swap(result->nearest_points[0], result->nearest_points[1]);
    return result;
  }
  withBoundedShape<S>(b, [&](const query::SupportShape& body) {
    const Eigen::Isometry3d X = isometryOf<S>(X_WA), Y = isometryOf<S>(X_WB);
    result = type == fcl::GEOM_PLANE ? distanceOf(static_cast<const fcl::Plane<S>&>(a), X, body, Y)
                                     : distanceOf(static_cast<const fcl::Halfspace<S>&>(a), X, body, Y);
  });
  return result;
}

namespace {

#if FCL_HAVE_OCTOMAP
/// The distance of a body and the occupied cells of an octree O, no more than it; infinite without such cells.
template <typename S>
double distanceToCells(const query::SupportShape& body, const OcTreeSide<S>& octree, const Eigen::Isometry3d& X_OB) {
  using Node = typename OcTreeSide<S>::Node;
  struct Cube {
    double distance;
    Node node;
    bool is_measured;  // else the distance is that of the boxes along the octree's axes, which is less
    bool operator<(const Cube& other) const { return distance > other.distance; }
  };
  const Eigen::Vector3d origin = Eigen::Vector3d::Zero(), middle = X_OB * body.box().center,
                        extents = (X_OB.linear() * body.box().axes).cwiseAbs() * body.box().half;
  const Eigen::Isometry3d X_BO = X_OB.inverse(Eigen::Isometry);
  std::priority_queue<Cube> cubes;
  const auto push = [&](const Node& node) {
    if (octree.state(node) == query::State::kLeaf && !octree.occupied(node)) return;
    Eigen::Vector3d center;
    const double half = octree.octantsOf(node, center);
    const Eigen::Vector3d gaps = (center - middle).cwiseAbs() - extents - Eigen::Vector3d::Constant(half);
    cubes.push({gaps.cwiseMax(0).norm(), node, false});
  };
  if (!octree.empty()) push(octree.root());
  while (!cubes.empty()) {
    const Cube least = cubes.top();
    if (least.is_measured) return least.distance;
    cubes.pop();
    if (octree.state(least.node) != query::State::kLeaf) {
      octree.children(least.node, push);
      continue;
    }
    Eigen::Vector3d center;
    const query::BoxShape cell(Eigen::Vector3d::Constant(octree.octantsOf(least.node, center)));
    Eigen::Isometry3d X_BC = X_BO;
    X_BC.translation() = X_BO * center;
    const query::DifferenceShape difference(body, cell, X_BC);
    const double gap = difference.gap({&origin, 1}, std::numeric_limits<double>::infinity()).at_least;
    cubes.push({std::max(gap, 0.0), least.node, true});
  }
  return std::numeric_limits<double>::infinity();
}
#endif

}  // namespace

template <typename S>
std::optional<double> distanceOfShapes(const fcl::CollisionGeometry<S>& a, const fcl::Transform3<S>& X_WA,
                                       const fcl::CollisionGeometry<S>& b, const fcl::Transform3<S>& X_WB) {
#if FCL_HAVE_OCTOMAP
  if (a.getNodeType() == fcl::GEOM_OCTREE) {
    std::optional<double> result;
    withBoundedShape<S>(b, [&](const query::SupportShape& body) {
      const OcTreeSide<S> octree(static_cast<const fcl::OcTree<S>&>(a), X_WA, S(1), false);
      result = distanceToCells(body, octree, relativePose(isometryOf<S>(X_WA), isometryOf<S>(X_WB)));
    });
    return result;
  }
  if (b.getNodeType() == fcl::GEOM_OCTREE) return distanceOfShapes<S>(b, X_WB, a, X_WA);
#endif
  const Eigen::Isometry3d X_AB = relativePose(isometryOf<S>(X_WA), isometryOf<S>(X_WB));
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
void improvePoints(const fcl::CollisionGeometry<S>& a, const fcl::Transform3<S>& X_WA,
                   const fcl::CollisionGeometry<S>& b, const fcl::Transform3<S>& X_WB, double distance,
                   fcl::Vector3<S>* points) {
  constexpr double kEnough = 1e-6;
  constexpr int kMostSteps = 1000;
  const Eigen::Isometry3d X = isometryOf<S>(X_WA), Y = isometryOf<S>(X_WB);
  const double enough = (1 + kEnough) * distance + kEnough * (X.translation() - Y.translation()).norm();
  Eigen::Vector3d on_a = points[0].template cast<double>(), on_b = points[1].template cast<double>();
  if (!((on_a - on_b).norm() > enough)) return;
  // Projections on two convex bodies in turn end where these are nearest.
  const auto nearest = [](const query::SupportShape& body, const Eigen::Isometry3d& X_W, const Eigen::Vector3d& point) {
    const Eigen::Vector3d own = X_W.linear().transpose() * (point - X_W.translation());
    const query::SeparationResult gap = body.gap({&own, 1}, std::numeric_limits<double>::infinity());
    return Eigen::Vector3d(X_W * gap.on_body);
  };
  withBoundedShape<S>(a, [&](const query::SupportShape& body_a) {
    withBoundedShape<S>(b, [&](const query::SupportShape& body_b) {
      for (int i = 0; i < kMostSteps && (on_a - on_b).norm() > enough; ++i) {
        on_b = nearest(body_b, Y, on_a);
        on_a = nearest(body_a, X, on_b);
      }
    });
  });
  points[0] = on_a.template cast<S>();
  points[1] = on_b.template cast<S>();
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
template void improvePoints<float>(const fcl::CollisionGeometry<float>&, const fcl::Transform3<float>&,
                                   const fcl::CollisionGeometry<float>&, const fcl::Transform3<float>&, double,
                                   fcl::Vector3<float>*);
template void improvePoints<double>(const fcl::CollisionGeometry<double>&, const fcl::Transform3<double>&,
                                    const fcl::CollisionGeometry<double>&, const fcl::Transform3<double>&, double,
                                    fcl::Vector3<double>*);
template std::optional<PlaneDistance> distanceToPlane<float>(const fcl::CollisionGeometry<float>&,
                                                             const fcl::Transform3<float>&,
                                                             const fcl::CollisionGeometry<float>&,
                                                             const fcl::Transform3<float>&);
template std::optional<PlaneDistance> distanceToPlane<double>(const fcl::CollisionGeometry<double>&,
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
