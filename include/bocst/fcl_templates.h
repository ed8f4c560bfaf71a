// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// Declares that libbocst contains these instances of FCL's templates. In them, bocst is registered in FCL's tables. So
// code that includes <bocst/fcl.h> but names FCL's templates, as in fcl::collide<S>(...), makes no copies of its own.
// With -fvisibility=hidden, such copies would have tables without bocst.

#include <bocst/export.h>
#include <fcl/narrowphase/collision.h>
#include <fcl/narrowphase/continuous_collision.h>
#include <fcl/narrowphase/distance.h>

#define BOCST_FCL_COLLIDE_OBJECTS(prefix, S, Solver)                                                 \
  prefix template BOCST_EXPORT std::size_t fcl::collide<S, fcl::detail::Solver<S>>(                  \
      const fcl::CollisionObject<S>*, const fcl::CollisionObject<S>*, const fcl::detail::Solver<S>*, \
      const fcl::CollisionRequest<S>&, fcl::CollisionResult<S>&);
#define BOCST_FCL_COLLIDE_SOLVER(prefix, S, Solver)                                                  \
  prefix template BOCST_EXPORT std::size_t fcl::collide<S, fcl::detail::Solver<S>>(                  \
      const fcl::CollisionGeometry<S>*, const fcl::Transform3<S>&, const fcl::CollisionGeometry<S>*, \
      const fcl::Transform3<S>&, const fcl::detail::Solver<S>*, const fcl::CollisionRequest<S>&,     \
      fcl::CollisionResult<S>&);                                                                     \
  BOCST_FCL_COLLIDE_OBJECTS(prefix, S, Solver)
#define BOCST_FCL_COLLIDE(prefix, S)                                                                 \
  prefix template BOCST_EXPORT std::size_t fcl::collide<S>(                                          \
      const fcl::CollisionGeometry<S>*, const fcl::Transform3<S>&, const fcl::CollisionGeometry<S>*, \
      const fcl::Transform3<S>&, const fcl::CollisionRequest<S>&, fcl::CollisionResult<S>&);         \
  prefix template BOCST_EXPORT std::size_t fcl::collide<S>(const fcl::CollisionObject<S>*,           \
                                                           const fcl::CollisionObject<S>*,           \
                                                           const fcl::CollisionRequest<S>&, fcl::CollisionResult<S>&);
#define BOCST_FCL_DISTANCE_SOLVER(prefix, S, Solver)                                                 \
  prefix template BOCST_EXPORT S fcl::distance<fcl::detail::Solver<S>>(                              \
      const fcl::CollisionGeometry<S>*, const fcl::Transform3<S>&, const fcl::CollisionGeometry<S>*, \
      const fcl::Transform3<S>&, const fcl::detail::Solver<S>*, const fcl::DistanceRequest<S>&,      \
      fcl::DistanceResult<S>&);                                                                      \
  prefix template BOCST_EXPORT S fcl::distance<fcl::detail::Solver<S>>(                              \
      const fcl::CollisionObject<S>*, const fcl::CollisionObject<S>*, const fcl::detail::Solver<S>*, \
      const fcl::DistanceRequest<S>&, fcl::DistanceResult<S>&);
#define BOCST_FCL_DISTANCE(prefix, S)                                                                             \
  prefix template BOCST_EXPORT S fcl::distance<S>(const fcl::CollisionGeometry<S>*, const fcl::Transform3<S>&,    \
                                                  const fcl::CollisionGeometry<S>*, const fcl::Transform3<S>&,    \
                                                  const fcl::DistanceRequest<S>&, fcl::DistanceResult<S>&);       \
  prefix template BOCST_EXPORT S fcl::distance<S>(const fcl::CollisionObject<S>*, const fcl::CollisionObject<S>*, \
                                                  const fcl::DistanceRequest<S>&, fcl::DistanceResult<S>&);
#define BOCST_FCL_ADVANCEMENT(prefix, S)                                                             \
  prefix template BOCST_EXPORT S fcl::continuousCollideConservativeAdvancement<S>(                   \
      const fcl::CollisionGeometry<S>*, const fcl::MotionBase<S>*, const fcl::CollisionGeometry<S>*, \
      const fcl::MotionBase<S>*, const fcl::ContinuousCollisionRequest<S>&, fcl::ContinuousCollisionResult<S>&);

BOCST_FCL_COLLIDE_SOLVER(extern, float, GJKSolver_libccd)
BOCST_FCL_COLLIDE_SOLVER(extern, float, GJKSolver_indep)
BOCST_FCL_COLLIDE_SOLVER(extern, double, GJKSolver_libccd)
BOCST_FCL_COLLIDE_SOLVER(extern, double, GJKSolver_indep)
BOCST_FCL_COLLIDE(extern, float)
BOCST_FCL_DISTANCE_SOLVER(extern, float, GJKSolver_libccd)
BOCST_FCL_DISTANCE_SOLVER(extern, float, GJKSolver_indep)
BOCST_FCL_DISTANCE_SOLVER(extern, double, GJKSolver_libccd)
BOCST_FCL_DISTANCE_SOLVER(extern, double, GJKSolver_indep)
BOCST_FCL_DISTANCE(extern, float)
BOCST_FCL_ADVANCEMENT(extern, double)
