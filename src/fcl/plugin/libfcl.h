// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// FCL's own queries of pairs without a Model. libbocst exports functions of the same names in their place, so these are
// looked up in libfcl itself. In double only: libfcl has no queries in float, which are compiled into this library.

#include <fcl/geometry/collision_geometry.h>
#include <fcl/math/motion/motion_base.h>
#include <fcl/narrowphase/collision_request.h>
#include <fcl/narrowphase/collision_result.h>
#include <fcl/narrowphase/continuous_collision_request.h>
#include <fcl/narrowphase/continuous_collision_result.h>

namespace bocst::fcl_adapter::libfcl {

/// True if code that is loaded now would call libfcl's own fcl::collide<double, Solver>, which does not know Model.
/// This is so where libfcl was loaded globally (RTLD_GLOBAL) and this library was not.
bool isFoundFirst();

// Each of these throws std::runtime_error if this process has no libfcl that exports the function.

/// fcl::collide<double, Solver>, for both of FCL's solvers.
template <typename Solver>
std::size_t collide(const fcl::CollisionGeometry<double>* o1, const fcl::Transform3<double>& X_W1,
                    const fcl::CollisionGeometry<double>* o2, const fcl::Transform3<double>& X_W2, const Solver* solver,
                    const fcl::CollisionRequest<double>& request, fcl::CollisionResult<double>& result);

/// fcl::detail::continuousCollideConservativeAdvancement<Solver>, for both of FCL's solvers.
template <typename Solver>
double conservativeAdvancement(const fcl::CollisionGeometry<double>* o1, const fcl::MotionBase<double>* motion1,
                               const fcl::CollisionGeometry<double>* o2, const fcl::MotionBase<double>* motion2,
                               const Solver* solver, const fcl::ContinuousCollisionRequest<double>& request,
                               fcl::ContinuousCollisionResult<double>& result);

/// fcl::continuousCollide<double> with motions, and with begin and end poses.
double continuousCollide(const fcl::CollisionGeometry<double>* o1, const fcl::MotionBase<double>* motion1,
                         const fcl::CollisionGeometry<double>* o2, const fcl::MotionBase<double>* motion2,
                         const fcl::ContinuousCollisionRequest<double>& request,
                         fcl::ContinuousCollisionResult<double>& result);
double continuousCollide(const fcl::CollisionGeometry<double>* o1, const fcl::Transform3<double>& X_W1_begin,
                         const fcl::Transform3<double>& X_W1_end, const fcl::CollisionGeometry<double>* o2,
                         const fcl::Transform3<double>& X_W2_begin, const fcl::Transform3<double>& X_W2_end,
                         const fcl::ContinuousCollisionRequest<double>& request,
                         fcl::ContinuousCollisionResult<double>& result);

}  // namespace bocst::fcl_adapter::libfcl
