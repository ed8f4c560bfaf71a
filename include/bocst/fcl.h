// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// FCL's queries for pairs that involve a bocst::Model, under FCL's own names.
//
// The functions in namespace fcl are not templates, so overload resolution prefers them to FCL's templates, also inside
// fcl::DefaultCollisionFunction and similar functions, for any order of includes. Pairs without a bocst::Model are
// forwarded to FCL. Code that was compiled without this header, or that names FCL's template
// (fcl::collide<double>(...)), reaches bocst through the symbols that libbocst exports. This needs libbocst before
// libfcl in the link order; the first Model checks it (see model.h).

#include <bocst/export.h>
#include <bocst/fcl_templates.h>
#include <bocst/model.h>
#include <fcl/narrowphase/collision.h>
#include <fcl/narrowphase/collision_object.h>
#include <fcl/narrowphase/collision_request.h>
#include <fcl/narrowphase/collision_result.h>
#include <fcl/narrowphase/continuous_collision.h>
#include <fcl/narrowphase/continuous_collision_object.h>
#include <fcl/narrowphase/continuous_collision_request.h>
#include <fcl/narrowphase/continuous_collision_result.h>
#include <fcl/narrowphase/distance.h>
#include <fcl/narrowphase/distance_request.h>
#include <fcl/narrowphase/distance_result.h>

#include <stdexcept>
#include <string>
#include <type_traits>

namespace bocst {

/// Checks whether two geometries collide at the poses X_W1 and X_W2 (world from geometry). Same interface as
/// fcl::collide: adds contacts to the result until it has request.num_max_contacts, and returns result.numContacts(),
/// the number over all calls with this result (0 if num_max_contacts is 0). Adds nothing if
/// request.isSatisfied(result) is already true.
///
/// **Order.** The default request (one contact, enable_contact false) is a yes-or-no query: it gets the ids of any pair
/// that touches. For other requests, the contacts and their order depend only on meshes, options, poses and request,
/// not on the resident nodes, the clock or the thread. Contacts are sorted by (b1, b2). If there are more than a
/// request asks for, then
/// - a request with costs, or for more than 1024, gets those with the smallest (b1, b2);
/// - of two models, or a model and a BVHModel or an OcTree, a request for up to 256 gets the first that a walk in a
///   fixed order finds, if the models' trees can be complete (below), unless the meshes overlap by little, two models
///   are copies at about the same place, or the walk gets long;
/// - otherwise a request gets those with the smallest position along the mesh, which takes two to ten times as long.
///
/// The first request of the second kind whose geometries touch builds the models' trees (Model::buildTree()), and so
/// does the first one after branches were dropped, for example by prune(). It is for models with exact answers, no
/// memory budget, no build_ahead, the oracle kCpu or kAuto, at most 262 144 triangles, and a mesh that updateVertices()
/// has not changed. distance() with enable_signed_distance makes such a request if the models touch.
///
/// In the frame of the model's mesh (o1's if both are models), with x the longest axis of its bounding box and y and z
/// the two that follow (x, y, z, x, ...), the position of a point is x + 0.31 y + 0.23 z. The position of a contact is
/// - if the two triangles intersect: the smallest position of the segment in which they do;
/// - if they do not clearly intersect: the largest position of each triangle, and of these two the smaller;
/// - with a margin: the largest position of the triangle of that mesh;
/// - with shapes and octrees: the largest position of the triangle, and that of the shape's bounding box (in its own
///   frame) or of the cell, and of these two the smaller;
/// - with conservative answers: the Morton code of the cell.
///
/// **Pairs.** One geometry is a Model; the other is a Model, an fcl::BVHModel<BV> of any BV, one of FCL's shapes (Box,
/// Sphere, Ellipsoid, Capsule, Cone, Cylinder, Convex, Plane, Halfspace, TriangleP) or an OcTree. Contacts keep the
/// caller's order of o1 and o2. As in FCL, only occupied geometries collide (cost_density >= threshold_occupied).
///
/// **Contacts.** Exact answers have one contact for each pair of primitives that intersect. Primitives are triangles,
/// shapes and occupied cells of an octree. Between meshes the set of pairs is the one that FCL reports for
/// BVHModel<OBBRSS>, each pair once. Shapes and cells are solid. A triangle and a shape or cell also make a contact if
/// FCL's own test reports one, which can happen at a distance below its tolerance (gjk_tolerance, and rounding in S).
///
/// **Ids.** b1 belongs to o1, b2 to o2. For a mesh the id is the triangle's index; for a Model with conservative
/// answers the Morton code of the cell at the collision depth (x in the lowest bit of each triple); for an octree FCL's
/// query cell id; for a shape Contact::NONE.
///
/// **Normal, depth, position** are in the world frame; without enable_contact all three are NaN. P1 and P2 are the two
/// primitives as point sets, n is the normal (a unit vector from o1 to o2), and d >= 0 is the penetration_depth:
///     P1 and P2 + d n do not overlap: they touch at most.
/// Between triangles, and between triangles and boxes, spheres, cells, planes and half-spaces, d is the minimum over
/// all directions; with other shapes it may be larger than the minimum. pos is a point in or next to the overlap.
/// All three values describe these two primitives, not the two bodies.
///
/// **Margin** (Options::margin). m is the sum of the margins of both models; other geometries have no margin. A contact
/// is a pair of primitives at a distance <= m. With p1 and p2 the nearest points of P1 and P2:
///     apart:       n = (p2 - p1) / |p2 - p1|,   d = m - |p2 - p1|,   pos = (p1 + p2) / 2
///     overlapping: n and pos as without margin,  d = m + the depth without margin
/// The number of contacts grows with the square of m / (size of a triangle), and so does the time of requests for many
/// contacts: for a clearance of more than some triangles use distance() or isCloserThan().
///
/// **Solids** (Options::solid). If there is no contact between primitives, but one geometry (or a connected component
/// or an occupied cell of it) is inside the other, there is one contact with Contact::NONE as b1 and b2. With p1 and p2
/// the nearest points of the two surfaces:
///     n = (p1 - p2) / |p1 - p2|,   d = |p1 - p2| + m,   pos = (p1 + p2) / 2
/// If o2 moves by |p1 - p2| n, the surfaces touch; to separate the two, o2 must move by at least d. With a BVHModel,
/// such a query takes time linear in the number of its triangles if the bounding spheres overlap. Planes and
/// half-spaces are unbounded, so they are never inside a geometry. If several pairs of points are equally near up to
/// rounding, p1 and p2 are any of them, and earlier queries may change which.
///
/// **Costs.** enable_cost adds the overlaps of the primitives' world-frame boxes, as FCL does. With shapes and octrees,
/// use_approximate_cost adds those of the whole mesh's bounding box instead (unlike FCL, also for occupied cells).
///
/// The verdict does not depend on the argument order, on the resident nodes, or on the GJK solver, except for a
/// triangle and a shape or cell whose distance is below the solver's tolerance.
/// @throws std::invalid_argument for a geometry that is null or not supported (FCL would return 0, "free"), a pose that
/// is not rigid, an invalid tolerance or an unknown solver type. The message names the argument and its value. If
/// neither is a Model, the answer is FCL's own (which is 0 for a TriangleP); a Plane and a Convex are refused. See
/// share/doc/guarantees.md. std::logic_error for a Model between beginModel() and endModel(); std::bad_alloc, which
/// leaves models as valid as they were; std::runtime_error in a child of fork(), see Model; OracleError where a device
/// has lost a released mesh, see Model::releaseMesh().
/// Thread rule: any number of threads may query the same models, each with its own request and result.
template <typename S>
BOCST_EXPORT std::size_t collide(const fcl::CollisionGeometry<S>* o1, const fcl::Transform3<S>& X_W1,
                                 const fcl::CollisionGeometry<S>* o2, const fcl::Transform3<S>& X_W2,
                                 const fcl::CollisionRequest<S>& request, fcl::CollisionResult<S>& result);

/// The same with one of FCL's two solvers as an argument. The solver's tolerance replaces that of the request.
template <typename S, typename Solver>
BOCST_EXPORT std::size_t collide(const fcl::CollisionGeometry<S>* o1, const fcl::Transform3<S>& X_W1,
                                 const fcl::CollisionGeometry<S>* o2, const fcl::Transform3<S>& X_W2,
                                 const Solver* solver, const fcl::CollisionRequest<S>& request,
                                 fcl::CollisionResult<S>& result);

/// Computes the distance between the surfaces of two geometries at the poses X_W1 and X_W2 (world from geometry). Same
/// interface as fcl::distance: lowers result.min_distance, the minimum over all calls with this result, and returns it.
/// Does nothing if request.isSatisfied(result) is already true.
///
/// Pairs are those of collide(); an octree consists of its occupied cells. Geometries that touch are at distance 0, up
/// to rounding (share/doc/rounding.md). A model is a surface: the distance of a geometry completely inside it is that
/// between the surfaces. If the model is solid, it is 0, and the nearest points are not those of a contact. Shapes and
/// cells are solid. Margins have no effect. An octree without occupied cells leaves the result unchanged.
/// - o1, o2, b1, b2, nearest_points: in the caller's order. Ids are as in collide(), but DistanceResult::NONE for
///   shapes. The points (with enable_nearest_points) are on the surfaces or spheres, in the world frame. If several
///   pairs are equally near, the ids and points of one of them are returned; which one is not defined.
/// - Conservative answers: the distance between the spheres at the collision depth. It is never larger than that
///   between the surfaces, and 0 if spheres overlap.
/// - abs_err and rel_err: absolute and relative amount by which the answer may exceed the minimum distance, as in FCL.
/// - enable_signed_distance: surfaces that touch get minus the penetration_depth of the contact that collide() returns
///   when asked for one, with both nearest points at its pos (FCL gives 0 for meshes that touch). This describes two
///   primitives, not two bodies: it depends on the order of the arguments, is seldom the deepest contact, and jumps as
///   the geometries move, so it is no gradient for an optimiser (the largest penetration_depth of all contacts changes
///   less). For a geometry inside a solid it is minus the distance between the surfaces (the depth of collide()'s
///   contact without margin).
/// The error of the answer is below 1e-11 of the geometries' sizes (1e-8 with ellipsoids, cones and cylinders), plus
/// rounding to S. The answer does not depend on the solver, and on the resident nodes only within that error.
/// @throws std::invalid_argument as collide(), if result.min_distance is NaN before the call, and if neither geometry
/// is a Model, for a Plane, a Halfspace, an Ellipsoid with a radius of 0 and an OcTree without cells. Thread rule: as
/// collide().
template <typename S>
BOCST_EXPORT S distance(const fcl::CollisionGeometry<S>* o1, const fcl::Transform3<S>& X_W1,
                        const fcl::CollisionGeometry<S>* o2, const fcl::Transform3<S>& X_W2,
                        const fcl::DistanceRequest<S>& request, fcl::DistanceResult<S>& result);
template <typename S, typename Solver>
BOCST_EXPORT S distance(const fcl::CollisionGeometry<S>* o1, const fcl::Transform3<S>& X_W1,
                        const fcl::CollisionGeometry<S>* o2, const fcl::Transform3<S>& X_W2, const Solver* solver,
                        const fcl::DistanceRequest<S>& request, fcl::DistanceResult<S>& result);

/// True when the geometry is a Model<S>; false for null.
template <typename S>
BOCST_EXPORT bool isModel(const fcl::CollisionGeometry<S>* geometry);

namespace fcl_adapter {
template <typename S>
BOCST_EXPORT S continuousPair(const fcl::CollisionGeometry<S>* o1, const fcl::MotionBase<S>* motion1,
                              const fcl::CollisionGeometry<S>* o2, const fcl::MotionBase<S>* motion2,
                              const fcl::ContinuousCollisionRequest<S>& request,
                              fcl::ContinuousCollisionResult<S>& result);
template <typename S>
BOCST_EXPORT S continuousPair(const fcl::CollisionGeometry<S>* o1, const fcl::Transform3<S>& X_W1_begin,
                              const fcl::Transform3<S>& X_W1_end, const fcl::CollisionGeometry<S>* o2,
                              const fcl::Transform3<S>& X_W2_begin, const fcl::Transform3<S>& X_W2_end,
                              const fcl::ContinuousCollisionRequest<S>& request,
                              fcl::ContinuousCollisionResult<S>& result);

// FCL reads through null pointers.
inline void refuseNull(const void* o1, const void* o2) {
  if (o1 != nullptr && o2 != nullptr) return;
  throw std::invalid_argument(std::string("bocst::continuousCollide: ") + (o1 == nullptr ? "o1" : "o2") +
                              " is a null pointer");
}
}  // namespace fcl_adapter

/// Computes the first time in [0, 1] at which two moving geometries touch. Same interface as fcl::continuousCollide,
/// with two motions or with begin and end poses (world from geometry): sets the result and returns its time_of_contact.
///
/// Pairs are those of collide(); an octree consists of its occupied cells. Planes and half-spaces can move, too.
/// - is_collide: true if the geometries touch at some time, as in collide() (including margin, solid, conservative
///   answers and occupancy). The method is always conservative advancement, for any ccd_solver_type. It never steps
///   over a contact; num_max_iterations and gjk_solver_type have no effect.
/// - time_of_contact: never later than the first contact. It is earlier by at most toc_err, or because the distance
///   is already below the limits that follow. Before this time they do not touch. It is 0 if they touch
///   at the begin, and 1 without contact. toc_err may be 0.
/// - contact_tf1, contact_tf2: the poses at that time; without contact, the end poses.
/// - Geometries that pass each other at a distance below a limit may count as touching. The limit is the largest of
///   1e-9 s, where s is the smaller size (half the diagonal of a geometry's bounding box);
///   1e-13 L, where L is the larger of two lengths: the sum of the largest distances of both geometries' points from
///   their own origins, and the distance of a geometry from the world's origin plus the path of its fastest point;
///   with shapes and cells 2e-6 length units: twice the distance at which collide() can report a contact because of
///   FCL's solvers.
///   With float, up to 2e-5 (conservative answers: 4e-5) of the sum of all lengths is added: coordinates, sizes, and
///   the longest paths of points of both geometries.
/// - Beyond these limits, verdicts do not depend on earlier queries, the order of the arguments or the partner's kind.
///   time_of_contact may differ by toc_err plus the time in which the geometries cross such a distance.
/// Supported motions are FCL's TranslationMotion, InterpMotion, ScrewMotion and SplineMotion. They are not modified. In
/// FCL 0.7, two of them exist only for double. Make an InterpMotion with the constructor that takes two rotations, two
/// translations and a point: the other constructors that take poses leave members unset. With poses, ccd_motion_type
/// selects the motion: CCDM_TRANS keeps the rotation of the begin; CCDM_LINEAR moves the geometry's origin on a line
/// and turns about a fixed axis; CCDM_SCREW turns about one axis and moves along it; CCDM_SPLINE interpolates the
/// origin and the rotation vector linearly.
/// @throws std::invalid_argument as collide(); for a motion that is not supported or whose begin or end pose is not
/// rigid; for an invalid toc_err; and, with float and poses, for a pair without a Model, for which FCL 0.7 has no
/// query. Thread rule: as collide(); threads may share motions while no thread calls their integrate().
template <typename S>
S continuousCollide(const fcl::CollisionGeometry<S>* o1, const fcl::MotionBase<S>* motion1,
                    const fcl::CollisionGeometry<S>* o2, const fcl::MotionBase<S>* motion2,
                    const fcl::ContinuousCollisionRequest<S>& request, fcl::ContinuousCollisionResult<S>& result) {
  if (isModel<S>(o1) || isModel<S>(o2)) {
    return fcl_adapter::continuousPair<S>(o1, motion1, o2, motion2, request, result);
  }
  fcl_adapter::refuseNull(o1, o2);
  return fcl::continuousCollide<S>(o1, motion1, o2, motion2, request, result);
}
template <typename S>
S continuousCollide(const fcl::CollisionGeometry<S>* o1, const fcl::Transform3<S>& X_W1_begin,
                    const fcl::Transform3<S>& X_W1_end, const fcl::CollisionGeometry<S>* o2,
                    const fcl::Transform3<S>& X_W2_begin, const fcl::Transform3<S>& X_W2_end,
                    const fcl::ContinuousCollisionRequest<S>& request, fcl::ContinuousCollisionResult<S>& result) {
  if (isModel<S>(o1) || isModel<S>(o2)) {
    return fcl_adapter::continuousPair<S>(o1, X_W1_begin, X_W1_end, o2, X_W2_begin, X_W2_end, request, result);
  }
  fcl_adapter::refuseNull(o1, o2);
  if constexpr (std::is_same<S, double>::value) {
    return fcl::continuousCollide<S>(o1, X_W1_begin, X_W1_end, o2, X_W2_begin, X_W2_end, request, result);
  } else {
    throw std::invalid_argument("fcl::continuousCollide: FCL 0.7 has no query from poses with float");
  }
}

}  // namespace bocst

namespace fcl {

// FCL's public signatures, each once for every scalar (and solver).
#define BOCST_FCL_SOLVER_OVERLOADS(S, Solver)                                                                          \
  inline std::size_t collide(const CollisionGeometry<S>* o1, const Transform3<S>& tf1, const CollisionGeometry<S>* o2, \
                             const Transform3<S>& tf2, const Solver* solver, const CollisionRequest<S>& request,       \
                             CollisionResult<S>& result) {                                                             \
    return bocst::collide<S, Solver>(o1, tf1, o2, tf2, solver, request, result);                                       \
  }                                                                                                                    \
  inline std::size_t collide(const CollisionObject<S>* o1, const CollisionObject<S>* o2, const Solver* solver,         \
                             const CollisionRequest<S>& request, CollisionResult<S>& result) {                         \
    return bocst::collide<S, Solver>(o1->collisionGeometry().get(), o1->getTransform(), o2->collisionGeometry().get(), \
                                     o2->getTransform(), solver, request, result);                                     \
  }                                                                                                                    \
  inline S distance(const CollisionGeometry<S>* o1, const Transform3<S>& tf1, const CollisionGeometry<S>* o2,          \
                    const Transform3<S>& tf2, const Solver* solver, const DistanceRequest<S>& request,                 \
                    DistanceResult<S>& result) {                                                                       \
    return bocst::distance<S, Solver>(o1, tf1, o2, tf2, solver, request, result);                                      \
  }                                                                                                                    \
  inline S distance(const CollisionObject<S>* o1, const CollisionObject<S>* o2, const Solver* solver,                  \
                    const DistanceRequest<S>& request, DistanceResult<S>& result) {                                    \
    return bocst::distance<S, Solver>(o1->collisionGeometry().get(), o1->getTransform(),                               \
                                      o2->collisionGeometry().get(), o2->getTransform(), solver, request, result);     \
  }

#define BOCST_FCL_OVERLOADS(S)                                                                                         \
  BOCST_FCL_SOLVER_OVERLOADS(S, detail::GJKSolver_libccd<S>)                                                           \
  BOCST_FCL_SOLVER_OVERLOADS(S, detail::GJKSolver_indep<S>)                                                            \
  inline std::size_t collide(const CollisionGeometry<S>* o1, const Transform3<S>& tf1, const CollisionGeometry<S>* o2, \
                             const Transform3<S>& tf2, const CollisionRequest<S>& request,                             \
                             CollisionResult<S>& result) {                                                             \
    return bocst::collide<S>(o1, tf1, o2, tf2, request, result);                                                       \
  }                                                                                                                    \
  inline std::size_t collide(const CollisionObject<S>* o1, const CollisionObject<S>* o2,                               \
                             const CollisionRequest<S>& request, CollisionResult<S>& result) {                         \
    return bocst::collide<S>(o1->collisionGeometry().get(), o1->getTransform(), o2->collisionGeometry().get(),         \
                             o2->getTransform(), request, result);                                                     \
  }                                                                                                                    \
  inline S distance(const CollisionGeometry<S>* o1, const Transform3<S>& tf1, const CollisionGeometry<S>* o2,          \
                    const Transform3<S>& tf2, const DistanceRequest<S>& request, DistanceResult<S>& result) {          \
    return bocst::distance<S>(o1, tf1, o2, tf2, request, result);                                                      \
  }                                                                                                                    \
  inline S distance(const CollisionObject<S>* o1, const CollisionObject<S>* o2, const DistanceRequest<S>& request,     \
                    DistanceResult<S>& result) {                                                                       \
    return bocst::distance<S>(o1->collisionGeometry().get(), o1->getTransform(), o2->collisionGeometry().get(),        \
                              o2->getTransform(), request, result);                                                    \
  }

// Templates with an unused parameter: so FCL's slow code for float is instantiated only where it is called. They are
// still more specialized than FCL's templates, so overload resolution prefers them.
#define BOCST_FCL_CONTINUOUS_OVERLOADS(S)                                                                             \
  template <int = 0>                                                                                                  \
  S continuousCollide(const CollisionGeometry<S>* o1, const MotionBase<S>* motion1, const CollisionGeometry<S>* o2,   \
                      const MotionBase<S>* motion2, const ContinuousCollisionRequest<S>& request,                     \
                      ContinuousCollisionResult<S>& result) {                                                         \
    return bocst::continuousCollide<S>(o1, motion1, o2, motion2, request, result);                                    \
  }                                                                                                                   \
  template <int = 0>                                                                                                  \
  S continuousCollide(const CollisionGeometry<S>* o1, const Transform3<S>& tf1_beg, const Transform3<S>& tf1_end,     \
                      const CollisionGeometry<S>* o2, const Transform3<S>& tf2_beg, const Transform3<S>& tf2_end,     \
                      const ContinuousCollisionRequest<S>& request, ContinuousCollisionResult<S>& result) {           \
    return bocst::continuousCollide<S>(o1, tf1_beg, tf1_end, o2, tf2_beg, tf2_end, request, result);                  \
  }                                                                                                                   \
  template <int = 0>                                                                                                  \
  S continuousCollide(const CollisionObject<S>* o1, const Transform3<S>& tf1_end, const CollisionObject<S>* o2,       \
                      const Transform3<S>& tf2_end, const ContinuousCollisionRequest<S>& request,                     \
                      ContinuousCollisionResult<S>& result) {                                                         \
    return bocst::continuousCollide<S>(o1->collisionGeometry().get(), o1->getTransform(), tf1_end,                    \
                                       o2->collisionGeometry().get(), o2->getTransform(), tf2_end, request, result);  \
  }                                                                                                                   \
  template <int = 0>                                                                                                  \
  S collide(const ContinuousCollisionObject<S>* o1, const ContinuousCollisionObject<S>* o2,                           \
            const ContinuousCollisionRequest<S>& request, ContinuousCollisionResult<S>& result) {                     \
    return bocst::continuousCollide<S>(o1->collisionGeometry().get(), o1->getMotion(), o2->collisionGeometry().get(), \
                                       o2->getMotion(), request, result);                                             \
  }

BOCST_FCL_OVERLOADS(float)
BOCST_FCL_OVERLOADS(double)
BOCST_FCL_CONTINUOUS_OVERLOADS(float)
BOCST_FCL_CONTINUOUS_OVERLOADS(double)
#undef BOCST_FCL_CONTINUOUS_OVERLOADS
#undef BOCST_FCL_OVERLOADS
#undef BOCST_FCL_SOLVER_OVERLOADS

}  // namespace fcl
