// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// FCL's queries for pairs that involve a bocst::Model, under FCL's own names.
//
// The functions in namespace fcl are not templates, so overload resolution prefers them to FCL's templates, also
// inside fcl::DefaultCollisionFunction and the like, whatever the order of includes. Pairs without a bocst::Model go on
// to FCL. Code that was compiled without this header, or that names FCL's template (fcl::collide<double>(...)),
// reaches bocst through the symbols that libbocst exports; that needs libbocst before libfcl in the link order, which
// the first Model checks (see model.h).

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
#include <type_traits>

namespace bocst {

/// Do the two geometries collide at the poses X_W1 and X_W2 (world from geometry)? As fcl::collide: returns
/// result.numContacts(), which accumulates; has at most request.num_max_contacts; adds nothing when
/// request.isSatisfied(result) already.
///
/// **Order.** Which contacts are reported and in which order depends on meshes, poses and request alone, not on what is
/// resident, the clock, the oracle or the thread. Contacts are sorted by the place of the model's triangle (o1's, where
/// both are models), then by (b1, b2); those of cells by the Morton code of the cell (o1's, where both answer with
/// cells). The place is the largest coordinate of the triangle's corners along the longest axis of its mesh's bounding
/// box, in the mesh's frame. A request for fewer gets the first of these, sooner. The default request (one contact,
/// enable_contact false) asks for yes or no: its ids are those of any pair that touches.
///
/// **Pairs.** One of the two is a Model; its partner is a Model, an fcl::BVHModel<BV> of any BV, one of FCL's shapes
/// (Box, Sphere, Ellipsoid, Capsule, Cone, Cylinder, Convex, Plane, Halfspace, TriangleP) or an OcTree. o1 and o2 keep
/// the caller's order. As in FCL, only occupied geometries collide (cost_density >= threshold_occupied).
///
/// **Contacts.** With exact answers, one for each pair of primitives that meet: triangles, shapes, occupied cells of an
/// octree. Between meshes the set of pairs is the one that FCL reports for BVHModel<OBBRSS>, each pair once. Shapes and
/// cells are solid. A triangle and a shape or cell also make a contact where FCL's own test says so, which may be where
/// they are apart by less than its tolerance (gjk_tolerance, and rounding in S).
///
/// **Ids.** b1 belongs to o1, b2 to o2: the triangle's index; for a Model with conservative answers the Morton code of
/// the cell at its collision depth (x in the lowest bit of each triple); for an octree FCL's query cell id; for a shape
/// Contact::NONE.
///
/// **Normal, depth, position**, with enable_contact (else all three are NaN), in world frame. P1 and P2 are the two
/// primitives as point sets, n the normal, a unit vector from o1 to o2, and d >= 0 the penetration_depth:
///     P1 and P2 + d n do not overlap: they touch at most.
/// Between triangles, and between triangles and boxes, spheres, cells, planes and half-spaces, d is the least of all
/// directions; with other shapes it is seldom larger than that. pos is a point in their overlap or beside it. All three
/// are about these two primitives, not about the two bodies.
///
/// **Margin** (Options::margin; m is the sum of both models', other partners have none). A contact is a pair of
/// primitives at a distance <= m. With p1 and p2 the nearest points of P1 and P2,
///     apart:       n = (p2 - p1) / |p2 - p1|,   d = m - |p2 - p1|,   pos = (p1 + p2) / 2
///     overlapping: n and pos as without margin,  d = m + the depth without margin
///
/// **Solids** (Options::solid). Where no primitives meet but one geometry (a connected component of it, an occupied
/// cell) is inside the other, there is one contact with Contact::NONE for b1 and b2. With p1 and p2 the nearest points
/// of the two surfaces,
///     n = (p1 - p2) / |p1 - p2|,   d = |p1 - p2| + m,   pos = (p1 + p2) / 2
/// so moving o2 by |p1 - p2| n brings the surfaces together; to part them takes at least d. With a BVHModel such a
/// query takes time linear in its triangles where the bounding spheres meet. Planes and half-spaces are unbounded, so
/// they are inside nothing.
///
/// **Costs.** enable_cost adds the overlap of the primitives' world boxes, as FCL does; with shapes and octrees, and
/// use_approximate_cost, that of the box about the whole mesh (unlike FCL, for occupied cells too).
///
/// The verdict does not depend on the argument order, on what is resident, or on the GJK solver, except for a triangle
/// and a shape or cell that are apart by less than the solver's tolerance.
/// @throws std::invalid_argument for a partner that is not supported (FCL would answer 0, "free"), and for a pose that
/// is not rigid, a tolerance or a solver type that does not exist; it names the argument and its value. See
/// share/doc/guarantees.md.
/// Thread rule: any number of threads on the same models, each with its own request and result.
template <typename S>
BOCST_EXPORT std::size_t collide(const fcl::CollisionGeometry<S>* o1, const fcl::Transform3<S>& X_W1,
                                 const fcl::CollisionGeometry<S>* o2, const fcl::Transform3<S>& X_W2,
                                 const fcl::CollisionRequest<S>& request, fcl::CollisionResult<S>& result);

/// The same for callers that bring a solver, one of FCL's two: its tolerance takes the place of the request's.
template <typename S, typename Solver>
BOCST_EXPORT std::size_t collide(const fcl::CollisionGeometry<S>* o1, const fcl::Transform3<S>& X_W1,
                                 const fcl::CollisionGeometry<S>* o2, const fcl::Transform3<S>& X_W2,
                                 const Solver* solver, const fcl::CollisionRequest<S>& request,
                                 fcl::CollisionResult<S>& result);

/// How far are the surfaces of the two geometries from each other, at these poses (world from geometry)? As
/// fcl::distance: lowers result.min_distance, a running minimum that a result brings along, and returns it; does
/// nothing when request.isSatisfied(result) already.
///
/// A pair with a Model: the partners of collide(); of an octree, its occupied cells. What touches is at distance 0; a
/// geometry wholly inside a model is as far as the surfaces are, for models are shells, unless the model is solid: then
/// it is at 0, and the nearest points are not those of a contact. Shapes and cells are solid. A margin does not
/// matter. An octree without occupied cells leaves the result as it is.
/// - o1, o2, b1, b2, nearest_points: the caller's order; ids as in collide(), DistanceResult::NONE for shapes; points
///   on the surfaces (or spheres), world frame, if enable_nearest_points.
/// - with conservative answers, the distance of the spheres of the collision depth: never more than that of the
///   surfaces, 0 where spheres overlap.
/// - abs_err and rel_err allow an answer that is larger than the least distance by so much, as in FCL.
/// - enable_signed_distance: surfaces that touch are at minus the penetration_depth of one contact as collide() gives
///   it, with both points there, as FCL does for meshes; it is about two primitives, not about two solids. What is
///   inside a solid is at minus the depth of the contact that collide() makes of it: the distance of the surfaces.
/// Errors of the answer are below 1e-11 of the sizes, with ellipsoids, cones and cylinders below 1e-8, and rounding of
/// S; it does not depend on the solver, nor on what is resident.
/// @throws std::invalid_argument as collide(), and for a min_distance brought along that is NaN.
/// Thread rule: as collide().
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
/// An empty Model is among the two, so they never touch, which the result then says.
template <typename S>
BOCST_EXPORT bool touchesNothing(const fcl::CollisionGeometry<S>* o1, const fcl::CollisionGeometry<S>* o2,
                                 fcl::ContinuousCollisionResult<S>& result);
}  // namespace fcl_adapter

/// When do the two geometries first touch, while time goes from 0 to 1? As fcl::continuousCollide, over two motions or
/// from begin to end poses (world from geometry): sets the result and returns its time_of_contact.
///
/// A pair with a Model: the partners of collide(); of an octree, its occupied cells; planes and half-spaces move, too.
/// - is_collide: the geometries touch at some time, as collide() means it (margin, solid, conservative answers and
///   occupancy included). Always by conservative advancement, whatever ccd_solver_type asks for: no contact is stepped
///   over, so num_max_iterations and gjk_solver_type mean nothing.
/// - time_of_contact: never later than the first contact, and at most toc_err earlier; before it they do not touch. 0
///   when they touch at the begin, 1 without contact. toc_err may be 0.
/// - contact_tf1, contact_tf2: the poses at that time; without contact, at the end.
/// - What passes at a distance of less than 1e-9 of the smaller geometry's size (with float: some 1e-5 of the
///   coordinates) is taken to touch; beside shapes and cells, at less than 2e-6 (collide() takes half of it for a
///   touch, where FCL's solvers do).
/// Motions are FCL's own four: TranslationMotion, InterpMotion, ScrewMotion, SplineMotion (in FCL 0.7, two of them
/// exist for double only); they are not written to. From poses, ccd_motion_type says how: CCDM_TRANS keeps the rotation
/// of the begin; CCDM_LINEAR moves the geometry's origin on a line and turns about a fixed axis; CCDM_SCREW turns about
/// and moves along one axis; CCDM_SPLINE moves the origin on a line and takes rotation vectors on a line.
/// @throws std::invalid_argument as collide(), and for a motion that is not supported or has no rigid pose at its begin
/// or end, a toc_err that is no tolerance; and, with float, from poses, for a pair without a Model: FCL 0.7 has no such
/// query. Thread rule: as collide(); motions may be shared while nobody calls their integrate().
template <typename S>
S continuousCollide(const fcl::CollisionGeometry<S>* o1, const fcl::MotionBase<S>* motion1,
                    const fcl::CollisionGeometry<S>* o2, const fcl::MotionBase<S>* motion2,
                    const fcl::ContinuousCollisionRequest<S>& request, fcl::ContinuousCollisionResult<S>& result) {
  if (isModel<S>(o1) || isModel<S>(o2)) {
    if (fcl_adapter::touchesNothing<S>(o1, o2, result)) return result.time_of_contact;
    return fcl_adapter::continuousPair<S>(o1, motion1, o2, motion2, request, result);
  }
  return fcl::continuousCollide<S>(o1, motion1, o2, motion2, request, result);
}
template <typename S>
S continuousCollide(const fcl::CollisionGeometry<S>* o1, const fcl::Transform3<S>& X_W1_begin,
                    const fcl::Transform3<S>& X_W1_end, const fcl::CollisionGeometry<S>* o2,
                    const fcl::Transform3<S>& X_W2_begin, const fcl::Transform3<S>& X_W2_end,
                    const fcl::ContinuousCollisionRequest<S>& request, fcl::ContinuousCollisionResult<S>& result) {
  if (isModel<S>(o1) || isModel<S>(o2)) {
    if (fcl_adapter::touchesNothing<S>(o1, o2, result)) return result.time_of_contact;
    return fcl_adapter::continuousPair<S>(o1, X_W1_begin, X_W1_end, o2, X_W2_begin, X_W2_end, request, result);
  }
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

// Templates, though of nothing, so that a caller pays for FCL's slow code for float only when he calls it. They are
// still more special than FCL's templates, so they win.
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
