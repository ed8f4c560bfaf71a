// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// FCL's function tables, and FCL's code that reads them, as part of this library.
//
// libfcl hides its tables, but it calls its exported weak symbol fcl::collide<S, Solver> through the dynamic linker.
// This library exports the same symbol: in double a function of its own, in float FCL's over its own tables, in which
// bocst is registered. Where libbocst precedes libfcl, everybody's collide ends there, libfcl's own included. FCL's
// distance<S, Solver> is not exported by libfcl, so here the public distance and continuousCollide take libfcl's place.
// Pairs without a model go back to libfcl's own functions (libfcl.h), but distances and all queries in float, which are
// compiled here.

#include <bocst/export.h>
#include <fcl/geometry/collision_geometry.h>
#include <fcl/math/motion/motion_base.h>
#include <fcl/narrowphase/collision_request.h>
#include <fcl/narrowphase/collision_result.h>
#include <fcl/narrowphase/continuous_collision_request.h>
#include <fcl/narrowphase/continuous_collision_result.h>

namespace fcl {

namespace detail {
template <typename S>
struct GJKSolver_libccd;
template <typename S>
struct GJKSolver_indep;
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

// In double this is ours, without a table: most of a planner's queries are far misses, for which FCL's way to its table
// takes as long as the answer. It must be declared before FCL's header is read.
template <typename S, typename Solver>
std::size_t collide(const CollisionGeometry<S>*, const Transform3<S>&, const CollisionGeometry<S>*,
                    const Transform3<S>&, const Solver*, const CollisionRequest<S>&, CollisionResult<S>&);
#define BOCST_OWN_COLLIDE(Solver)                                                                    \
  template <>                                                                                        \
  BOCST_EXPORT std::size_t collide<double, detail::Solver<double>>(                                  \
      const CollisionGeometry<double>*, const Transform3<double>&, const CollisionGeometry<double>*, \
      const Transform3<double>&, const detail::Solver<double>*, const CollisionRequest<double>&,     \
      CollisionResult<double>&);
BOCST_OWN_COLLIDE(GJKSolver_libccd)
BOCST_OWN_COLLIDE(GJKSolver_indep)
#undef BOCST_OWN_COLLIDE

// FCL's own would call a function that libfcl exports, too, and that reads libfcl's hidden table.
template <typename S>
S continuousCollideConservativeAdvancement(const CollisionGeometry<S>*, const MotionBase<S>*,
                                           const CollisionGeometry<S>*, const MotionBase<S>*,
                                           const ContinuousCollisionRequest<S>&, ContinuousCollisionResult<S>&);
template <>
BOCST_EXPORT double continuousCollideConservativeAdvancement<double>(
    const CollisionGeometry<double>*, const MotionBase<double>*, const CollisionGeometry<double>*,
    const MotionBase<double>*, const ContinuousCollisionRequest<double>&, ContinuousCollisionResult<double>&);

// Three of its four solvers do not look into any table. So both functions are ours, for double (float is in no libfcl);
// they must be declared before FCL says that they are libfcl's.
template <typename S>
S continuousCollide(const CollisionGeometry<S>*, const MotionBase<S>*, const CollisionGeometry<S>*,
                    const MotionBase<S>*, const ContinuousCollisionRequest<S>&, ContinuousCollisionResult<S>&);
template <>
BOCST_EXPORT double continuousCollide<double>(const CollisionGeometry<double>*, const MotionBase<double>*,
                                              const CollisionGeometry<double>*, const MotionBase<double>*,
                                              const ContinuousCollisionRequest<double>&,
                                              ContinuousCollisionResult<double>&);
template <typename S>
S continuousCollide(const CollisionGeometry<S>*, const Transform3<S>&, const Transform3<S>&,
                    const CollisionGeometry<S>*, const Transform3<S>&, const Transform3<S>&,
                    const ContinuousCollisionRequest<S>&, ContinuousCollisionResult<S>&);
template <>
BOCST_EXPORT double continuousCollide<double>(const CollisionGeometry<double>*, const Transform3<double>&,
                                              const Transform3<double>&, const CollisionGeometry<double>*,
                                              const Transform3<double>&, const Transform3<double>&,
                                              const ContinuousCollisionRequest<double>&,
                                              ContinuousCollisionResult<double>&);

}  // namespace fcl

#include <bocst/fcl_templates.h>
#include <fcl/narrowphase/collision.h>
#include <fcl/narrowphase/continuous_collision.h>
#include <fcl/narrowphase/distance.h>

// FCL declares its solvers in double without a visibility. With -fvisibility=hidden, Clang then hides their tables,
// too, unless an instance says otherwise.
#define BOCST_FCL_TABLE(Query, Solver)                                           \
  template BOCST_EXPORT fcl::detail::Query##FunctionMatrix<fcl::detail::Solver>& \
      fcl::get##Query##FunctionLookTable<fcl::detail::Solver>();
