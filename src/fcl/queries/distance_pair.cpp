// SPDX-License-Identifier: BSD-3-Clause
#include "fcl/queries/distance_pair.h"

#include <bocst/model.h>
#include <fcl/narrowphase/collision_request.h>
#include <fcl/narrowphase/collision_result.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <optional>
#include <type_traits>

#include "fcl/adapters/bodies.h"
#include "fcl/adapters/models.h"
#include "fcl/adapters/pair.h"
#include "fcl/adapters/validate.h"
#include "fcl/collide/collide_pair.h"
#include "fcl/pair/convex_frame.h"
#include "fcl/pair/inside.h"
#include "fcl/pair/query_scope.h"
#include "log/assert.h"
#include "query/distance/distance_walk.h"
#include "query/distance/touch.h"

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

/// Writes the nearest primitives, given in the world.
template <typename S>
void report(const DistanceQuery<S>& q, double distance_found, query::Nearest in_world) {
  const S distance = static_cast<S>(distance_found);
  if (!(distance < q.result.min_distance)) return;
  q.inCallersOrder(in_world.a, in_world.b);
  q.inCallersOrder(in_world.on_a, in_world.on_b);
  q.result.min_distance = distance;
  q.result.o1 = q.o1;
  q.result.o2 = q.o2;
  q.result.b1 = static_cast<std::intptr_t>(in_world.a);
  q.result.b2 = static_cast<std::intptr_t>(in_world.b);
  if (q.request.enable_nearest_points) {
    q.result.nearest_points[0] = in_world.on_a.template cast<S>();
    q.result.nearest_points[1] = in_world.on_b.template cast<S>();
  }
}

/// Writes what a walk found in the lattice of side A.
template <typename S>
void report(const DistanceQuery<S>& q, query::Nearest n, const Eigen::Vector3d& origin, double unit) {
  const fcl::Transform3<double> X_WA = q.X_WA().template cast<double>();
  for (Eigen::Vector3d* p : {&n.on_a, &n.on_b}) *p = X_WA * Eigen::Vector3d(origin + unit * *p);
  report(q, n.distance * unit, n);
}

/// A mesh in the world as it looks from far away: a ball about it, and its corners.
struct Distant {
  Eigen::Isometry3d X_WM;
  Eigen::Vector3d center;  ///< Of the ball, in the mesh's frame.
  double radius;
  std::size_t triangles;  ///< 0 where the host has no mesh.
  std::function<Eigen::Vector3d(std::uint32_t, int)> corner;
  /// From this many times its size on, the mesh is what searchFar() takes it for. Spheres of conservative answers are
  /// told apart by the walk, until squares of lengths overflow.
  double far = 0x1p26;

  Distant(const Eigen::Isometry3d& X, const tree::Tree& tree)
      : X_WM(X),
        center(tree.surface().bounds.center()),
        radius(tree.surface().bounds.diagonal().norm() / 2),
        triangles(tree.surface().mesh == nullptr ? 0 : tree.surface().triangle_count),
        corner([mesh = tree.surface().mesh.get()](std::uint32_t t, int k) {
          return mesh->vertex(mesh->indices(t)[static_cast<std::size_t>(k)]);
        }),
        far(tree.conservative() ? 0x1p400 : 0x1p26) {}
  Distant(const Eigen::Isometry3d& X, const BvhSide& side)
      : X_WM(X),
        triangles(side.meshTriangles()),
        corner([&side](std::uint32_t t, int k) { return side.vertex(t, k); }) {
    const query::OrientedVolume box = side.volume(side.root());
    center = box.center;
    radius = box.half.norm();
  }

  /// Half of the way in the world between points of two: the whole may overflow.
  static Eigen::Vector3d halfWay(const Eigen::Isometry3d& X, const Eigen::Vector3d& from, const Eigen::Isometry3d& Y,
                                 const Eigen::Vector3d& to) {
    return (Y.translation() / 2 - X.translation() / 2) + (Y.linear() * (to / 2) - X.linear() * (from / 2));
  }

  /// The triangle that reaches farthest along a direction in the world, and the corner.
  std::uint32_t farthest(const Eigen::Vector3d& direction, Eigen::Vector3d& tip) const {
    const Eigen::Vector3d along = X_WM.linear().transpose() * direction;
    double most = -std::numeric_limits<double>::infinity();
    std::uint32_t farthest = 0;
    for (std::uint32_t t = 0; t < triangles; ++t) {
      for (int k = 0; k < 3; ++k) {
        const Eigen::Vector3d v = corner(t, k);
        const double d = along.dot(v - center);
        if (!(d > most)) continue;
        most = d;
        farthest = t;
        tip = v;
      }
    }
    return farthest;
  }
};

/// For meshes more than 2^27 times their size apart: the farthest vertices along the line of the centres are the
/// nearest points, up to 2^-54 of the distance. Returns false if they are nearer.
template <typename S>
bool searchFar(const DistanceQuery<S>& q, const Distant& a, const Distant& b) {
  const Eigen::Vector3d half_way = Distant::halfWay(a.X_WM, a.center, b.X_WM, b.center);
  if (!(half_way.cwiseAbs().maxCoeff() > std::max(a.far, b.far) * (a.radius + b.radius)) || a.triangles == 0 ||
      b.triangles == 0) {
    return false;
  }
  const Eigen::Vector3d direction = half_way.stableNormalized();
  query::Nearest n;
  Eigen::Vector3d tip_a, tip_b;
  n.a = a.farthest(direction, tip_a);
  n.b = b.farthest(-direction, tip_b);
  n.on_a = a.X_WM * tip_a;
  n.on_b = b.X_WM * tip_b;
  report(q, 2 * Distant::halfWay(a.X_WM, tip_a, b.X_WM, tip_b).stableNorm(), n);
  return true;
}

/// The same beside a solid body that is so far away that neither's size is more than a rounding of the distance.
template <typename S>
bool searchFar(const DistanceQuery<S>& q, const Distant& a, const query::ConvexSide& b) {
  const query::Sphere ball = b.sphere(b.root());
  const Eigen::Isometry3d X = isometryOf<S>(q.X_WB());
  const Eigen::Vector3d half_way = Distant::halfWay(a.X_WM, a.center, X, ball.center);
  if (!(half_way.cwiseAbs().maxCoeff() > std::max(0x1p53, a.far) * (a.radius + ball.radius)) || a.triangles == 0)
    return false;
  query::Nearest n;
  Eigen::Vector3d tip;
  n.a = a.farthest(half_way.stableNormalized(), tip);
  n.b = b.id(b.root());
  n.on_a = a.X_WM * tip;
  n.on_b = X * ball.center;
  report(q, 2 * Distant::halfWay(a.X_WM, tip, X, ball.center).stableNorm(), n);
  return true;
}

/// Looks for the nearest primitives.
template <typename S, typename B>
void search(const DistanceQuery<S>& q, const TreeSide& a, const B& b, const SimilarityTransform& b_in_a) {
  const lattice::Lattice& lattice = a.tree().surface().lattice;
  const query::DistanceGoal goal = goalOf(q, lattice.unit());
  const query::Nearest nearest = [&] {
    if constexpr (std::is_same<B, TreeSide>::value || std::is_same<B, query::ConvexSide>::value) {
      const std::optional<query::Nearest> touch = query::findTouch(a, b, b_in_a);
      if (touch) return *touch;
    }
    return query::findNearest(a, b, b_in_a, goal);
  }();
  report(q, nearest, lattice.origin(), lattice.unit());
}

/// What is inside a solid is not apart from it. There are no points where they touch: the points are those where the
/// surfaces are nearest. search() looks for these, below q.result.min_distance.
template <typename S, typename Search, typename IsInside>
void searchSolid(const DistanceQuery<S>& q, Search&& search, IsInside&& is_inside) {
  const S before = q.result.min_distance;
  search();
  if (!(q.result.min_distance > 0) || !is_inside()) return;
  if (!(q.result.min_distance < before)) {
    q.result.min_distance = std::numeric_limits<S>::max();
    search();
  }
  q.result.min_distance = 0;
}

/// The same between a tree and solid bodies.
template <typename S>
void searchBodies(const DistanceQuery<S>& q, tree::Tree& tree) {
  const QueryScope scope(tree);
  const TreeSide& a = scope.a();
  const oracle::Surface& surface = tree.surface();
  const ConvexFrame<S> frame(q.X_WA(), q.X_WB(), surface);
  const SimilarityTransform b_in_a = frame.toLattice(surface.lattice, 0);
  withBodies(*q.b(), q.X_WB(), frame.region(), [&](const auto& b) {
    if constexpr (std::is_same<std::decay_t<decltype(b)>, query::ConvexSide>::value) {
      if (searchFar(q, Distant(isometryOf<S>(q.X_WA()), tree), b)) return;
    }
    searchSolid(
        q, [&] { search(q, a, b, b_in_a); }, [&] { return contains(a, frame, b); });
  });
}

/// The same between meshes, of which `mesh_b` is side B's tree or fcl::BVHModel.
template <typename S, typename B, typename MeshB>
void searchMeshes(const DistanceQuery<S>& q, const TreeSide& a, const B& b, MeshB& mesh_b) {
  tree::Tree& tree_a = a.tree();
  const RelativeSides sides = relate<S>(q, a, b);
  if (searchFar(q, Distant(isometryOf<S>(q.X_WA()), tree_a), Distant(isometryOf<S>(q.X_WB()), mesh_b))) return;
  searchSolid(
      q, [&] { search(q, a, b, sides.b_in_a); },
      [&] {
        if (contains<S>(tree_a, q.X_WA(), mesh_b, q.X_WB(), sides.magnitude)) return true;
        if constexpr (std::is_same<B, TreeSide>::value) {
          return contains<S>(mesh_b, q.X_WB(), tree_a, q.X_WA(), sides.magnitude);
        }
        return false;
      });
}

/// @throws std::invalid_argument for a partner that is not supported.
template <typename S>
void searchPair(const DistanceQuery<S>& q) {
  tree::Tree& tree = treeOf(*asModel<S>(q.a()));
  // FCL's managers pass the least distance so far: most of their pairs end here.
  constexpr double kMost = std::numeric_limits<float>::max();
  const double known = std::min(static_cast<double>(q.result.min_distance), kMost);
  if (const Model<S>* other = asModel<S>(q.b())) {
    tree::Tree& tree_b = treeOf(*other);
    query::Hulls hulls;  // of no use to a search
    if (known < kMost && areSurelyRigid(q.X_WA(), q.X_WB()) &&
        areFarApart(tree, q.X_WA(), tree_b, q.X_WB(), known, hulls)) {
      return;
    }
    const QueryScope scope(tree, tree_b);
    searchMeshes(q, scope.a(), scope.b(), tree_b);
  } else if (isBodies<S>(q.b())) {
    searchBodies(q, tree);
  } else {
    const BvhSide b = bvhSideOf<S>("distance", q.b());
    if (known < kMost && areFarApart(tree, q.X_WA(), b, q.X_WB(), known)) return;
    const QueryScope scope(tree);
    searchMeshes(q, scope.a(), b, b);
  }
}

/// Surfaces that touch have no negative distance of their own; FCL takes the depth of a contact, and so do we.
template <typename S>
void sign(const DistanceQuery<S>& q) {
  fcl::CollisionRequest<S> request;
  request.enable_contact = true;
  fcl::CollisionResult<S> contacts;
  collidePair<S>(q.o1, q.X_W1, q.o2, q.X_W2, {}, request, contacts, 0.0);
  if (!contacts.isCollision()) return;
  const fcl::Contact<S>& contact = contacts.getContact(0);
  q.result.min_distance = S(0) - contact.penetration_depth;  // never -0
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
  BOCST_ASSERT(model1 != nullptr || model2 != nullptr);
  checkPose("distance", "tf1", X_W1);
  checkPose("distance", "tf2", X_W2);
  checkRequest(request, result);
  if (request.isSatisfied(result)) return result.min_distance;
  const DistanceQuery<S> q{{o1, X_W1, o2, X_W2, model1 == nullptr}, request, result};
  const bool is_signed = request.enable_signed_distance;
  const fcl::DistanceResult<S> before = result;
  for (;;) {
    // Held, so that another mesh does not get the address of one of these.
    const auto mesh1 = is_signed ? meshOf(model1) : nullptr, mesh2 = is_signed ? meshOf(model2) : nullptr;
    searchPair(q);
    if (!is_signed || result.min_distance > 0) return result.min_distance;
    sign(q);
    // The depth must be that of the surfaces that touch.
    if (meshOf(model1) == mesh1 && meshOf(model2) == mesh2) return result.min_distance;
    result = before;
  }
}

template float distancePair<float>(const fcl::CollisionGeometry<float>*, const fcl::Transform3<float>&,
                                   const fcl::CollisionGeometry<float>*, const fcl::Transform3<float>&,
                                   const fcl::DistanceRequest<float>&, fcl::DistanceResult<float>&);
template double distancePair<double>(const fcl::CollisionGeometry<double>*, const fcl::Transform3<double>&,
                                     const fcl::CollisionGeometry<double>*, const fcl::Transform3<double>&,
                                     const fcl::DistanceRequest<double>&, fcl::DistanceResult<double>&);

}  // namespace bocst::fcl_adapter
