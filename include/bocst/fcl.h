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

/// Do the two geometries at these poses (world from geometry) touch? As fcl::collide: returns result.numContacts(),
/// which accumulates; has at most request.num_max_contacts; adds nothing when request.isSatisfied(result) already.
/// Contacts are those with the least (b1, b2), in this order, whatever is resident, whatever the clock, the oracle and
/// the thread; but a request for one contact ends at any.
///
/// A pair with a Model: partners are another Model, fcl::BVHModel<BV> of any BV, FCL's shapes (Box, Sphere, Ellipsoid,
/// Capsule, Cone, Cylinder, Convex, Plane, Halfspace, TriangleP) and OcTree. With exact answers there is one contact
/// for each pair of primitives that touch: triangles, shapes, occupied cells of an octree. Between meshes the set of
/// pairs is the one that FCL reports for BVHModel<OBBRSS>; FCL may list a pair more than once, we do not. Shapes and
/// cells are solid; to a triangle they touch when the two meet, or when FCL's own test says so, which may be where they
/// are apart by less than its tolerance (gjk_tolerance, and rounding in S).
/// - o1, o2: the caller's order, whatever the geometries are.
/// - b1, b2: triangle ids; on the side of a Model with conservative answers, the Morton code of the cell at its
///   collision depth (x in the lowest bit of each triple); Contact::NONE for shapes; for octrees the query cell id of
///   FCL, whole.
/// - with enable_contact: normal is a unit vector from o1 to o2 in world frame, penetration_depth >= 0 the length of a
///   translation of o2's primitive along normal that ends the contact of these two primitives, pos a point in or beside
///   their overlap. The translation is the shortest between triangles, and between triangles and boxes, balls, cells,
///   planes and half-spaces; with other shapes seldom longer. It is about two primitives, not about two solids.
/// - with a margin (Options::margin, the sum of both models'; other partners have none of their own), a contact is a
///   pair of primitives no farther apart than that; penetration_depth is the margin minus their distance (plus the
///   depth above, when they meet), normal the way between their nearest points, and pos the middle of it.
/// - solid (Options::solid): where no primitives touch but one geometry (a connected piece of it, an occupied cell) is
///   inside the other, there is one contact, with Contact::NONE for b1 and b2; penetration_depth is the distance of the
///   surfaces (plus the margin), which is what it takes at least to part them, normal the way for o2 (that brings the
///   surfaces together there), pos between the nearest points. Beside a BVHModel, a query whose bounding balls meet
///   takes time linear in its triangles for that. Planes and half-spaces have no end, so they are inside nothing.
/// - without enable_contact: normal, pos and penetration_depth are NaN.
/// - enable_cost adds the overlap of the primitives' world boxes, as FCL does; with shapes and octrees, and
///   use_approximate_cost, that of the box about the whole mesh (unlike FCL, for occupied cells too).
/// Collisions are reported between occupied geometries only (cost_density >= threshold_occupied), as in FCL.
///
/// The verdict does not depend on the argument order, nor on what is resident, nor on the GJK solver, but for a
/// triangle and a shape or a cell that are apart by less than the solver's tolerance.
/// @throws std::invalid_argument for a partner that is not supported (FCL would answer 0, "free"), and for what is no
/// rigid pose, no tolerance and no solver type; it names the argument and its value. See share/doc/guarantees.md.
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
