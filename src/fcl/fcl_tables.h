// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// FCL's function tables, and FCL's code that reads them, as part of this library.
//
// libfcl hides its tables, but it calls its exported weak symbol fcl::collide<S, Solver> through the dynamic linker.
// This library exports the same symbol, compiled over its own tables, in which bocst is registered. Where libbocst
// precedes libfcl, everybody's collide ends there, libfcl's own included. FCL's distance<S, Solver> is not
// exported by libfcl, so here the public distance and continuousCollide take libfcl's place.

#include <bocst/export.h>
#include <fcl/geometry/collision_geometry.h>
#include <fcl/math/motion/motion_base.h>
#include <fcl/narrowphase/continuous_collision_request.h>
#include <fcl/narrowphase/continuous_collision_result.h>

namespace fcl {

namespace detail {
template <typename Solver>
struct CollisionFunctionMatrix;
template <typename Solver>
struct DistanceFunctionMatrix;
template <typename Solver>
struct ConservativeAdvancementFunctionMatrix;
}  // namespace detail

// FCL does not say so, but an executable that instantiates FCL's code itself must share these tables with us.
template <typename Solver>
__attribute__((visibility("default"))) detail::CollisionFunctionMatrix<Solver>& getCollisionFunctionLookTable();
template <typename Solver>
__attribute__((visibility("default"))) detail::DistanceFunctionMatrix<Solver>& getDistanceFunctionLookTable();
template <typename Solver>
__attribute__((visibility("default"))) detail::ConservativeAdvancementFunctionMatrix<Solver>&
getConservativeAdvancementFunctionLookTable();

// Two of its four solvers answer -1 for a geometry they do not know, before they look into any table. So the whole
// function is ours, for double (float is in no libfcl); it must be declared before FCL says that it is libfcl's.
template <typename S>
S continuousCollide(const CollisionGeometry<S>*, const MotionBase<S>*, const CollisionGeometry<S>*,
                    const MotionBase<S>*, const ContinuousCollisionRequest<S>&, ContinuousCollisionResult<S>&);
template <>
BOCST_EXPORT double continuousCollide<double>(const CollisionGeometry<double>*, const MotionBase<double>*,
                                              const CollisionGeometry<double>*, const MotionBase<double>*,
                                              const ContinuousCollisionRequest<double>&,
                                              ContinuousCollisionResult<double>&);

}  // namespace fcl

#include <fcl/narrowphase/collision.h>
#include <fcl/narrowphase/continuous_collision.h>
#include <fcl/narrowphase/distance.h>

// Each is compiled once, in the .cpp file beside this that is named after it: they are slow to compile.
#define BOCST_FCL_COLLIDE_SOLVER(prefix, S, Solver)                                                  \
  prefix template std::size_t fcl::collide<S, fcl::detail::Solver<S>>(                               \
      const fcl::CollisionGeometry<S>*, const fcl::Transform3<S>&, const fcl::CollisionGeometry<S>*, \
      const fcl::Transform3<S>&, const fcl::detail::Solver<S>*, const fcl::CollisionRequest<S>&,     \
      fcl::CollisionResult<S>&);                                                                     \
  prefix template std::size_t fcl::collide<S, fcl::detail::Solver<S>>(                               \
      const fcl::CollisionObject<S>*, const fcl::CollisionObject<S>*, const fcl::detail::Solver<S>*, \
      const fcl::CollisionRequest<S>&, fcl::CollisionResult<S>&);
#define BOCST_FCL_COLLIDE(prefix, S)                                                                          \
  prefix template std::size_t fcl::collide<S>(const fcl::CollisionGeometry<S>*, const fcl::Transform3<S>&,    \
                                              const fcl::CollisionGeometry<S>*, const fcl::Transform3<S>&,    \
                                              const fcl::CollisionRequest<S>&, fcl::CollisionResult<S>&);     \
  prefix template std::size_t fcl::collide<S>(const fcl::CollisionObject<S>*, const fcl::CollisionObject<S>*, \
                                              const fcl::CollisionRequest<S>&, fcl::CollisionResult<S>&);
#define BOCST_FCL_DISTANCE(prefix, S)                                                                \
  prefix template S fcl::distance<S>(const fcl::CollisionGeometry<S>*, const fcl::Transform3<S>&,    \
                                     const fcl::CollisionGeometry<S>*, const fcl::Transform3<S>&,    \
                                     const fcl::DistanceRequest<S>&, fcl::DistanceResult<S>&);       \
  prefix template S fcl::distance<S>(const fcl::CollisionObject<S>*, const fcl::CollisionObject<S>*, \
                                     const fcl::DistanceRequest<S>&, fcl::DistanceResult<S>&);
#define BOCST_FCL_DISTANCE_SOLVER(prefix, S, Solver)                                                                   \
  prefix template S fcl::distance<fcl::detail::Solver<S>>(const fcl::CollisionGeometry<S>*, const fcl::Transform3<S>&, \
                                                          const fcl::CollisionGeometry<S>*, const fcl::Transform3<S>&, \
                                                          const fcl::detail::Solver<S>*,                               \
                                                          const fcl::DistanceRequest<S>&, fcl::DistanceResult<S>&);    \
  prefix template S fcl::distance<fcl::detail::Solver<S>>(                                                             \
      const fcl::CollisionObject<S>*, const fcl::CollisionObject<S>*, const fcl::detail::Solver<S>*,                   \
      const fcl::DistanceRequest<S>&, fcl::DistanceResult<S>&);
#define BOCST_FCL_EXTERN(S)                              \
  BOCST_FCL_COLLIDE_SOLVER(extern, S, GJKSolver_libccd)  \
  BOCST_FCL_COLLIDE_SOLVER(extern, S, GJKSolver_indep)   \
  BOCST_FCL_COLLIDE(extern, S)                           \
  BOCST_FCL_DISTANCE_SOLVER(extern, S, GJKSolver_libccd) \
  BOCST_FCL_DISTANCE_SOLVER(extern, S, GJKSolver_indep)  \
  BOCST_FCL_DISTANCE(extern, S)
BOCST_FCL_EXTERN(float)
BOCST_FCL_EXTERN(double)
#undef BOCST_FCL_EXTERN
