// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/math/geometry.h>
#include <fcl/narrowphase/detail/gjk_solver_indep.h>
#include <fcl/narrowphase/detail/gjk_solver_libccd.h>
#include <fcl/narrowphase/detail/traversal/collision/intersect.h>

#include "fcl/adapters/narrow_phase.h"
#include "fcl/adapters/shapes.h"
#include "fcl/adapters/validate.h"

// FCL's solvers are slow to compile: one scalar a file.

namespace bocst::fcl_adapter {

template <typename S, typename Solver>
class NarrowPhaseOf final : public NarrowPhase<S> {
 public:
  NarrowPhaseOf(const Solver& solver, double tolerance) : solver_(solver), tolerance_(tolerance) {}

  double tolerance() const override { return tolerance_; }

  bool fclOverlaps(const fcl::ShapeBase<S>& shape, const fcl::Transform3<S>& X_WS, const fcl::Vector3<S> (&corners)[3],
                   const fcl::Transform3<S>& X_WM) const override {
    return withShape(shape, [&](const auto& s) { return ask(s, X_WS, corners, X_WM); });
  }

 private:
  template <typename Shape>
  bool ask(const Shape& s, const fcl::Transform3<S>& X_WS, const fcl::Vector3<S> (&c)[3],
           const fcl::Transform3<S>& X_WM) const {
    return solver_.shapeTriangleIntersect(s, X_WS, c[0], c[1], c[2], X_WM, nullptr, nullptr, nullptr);
  }

  // Of two triangles, FCL's test is that of meshes, rounded as there.
  bool ask(const fcl::TriangleP<S>& t, const fcl::Transform3<S>& X_WT, const fcl::Vector3<S> (&c)[3],
           const fcl::Transform3<S>& X_WM) const {
    fcl::Matrix3<S> R_MT;
    fcl::Vector3<S> p_MT;
    fcl::relativeTransform(X_WM.linear(), X_WM.translation(), X_WT.linear(), X_WT.translation(), R_MT, p_MT);
    return fcl::detail::Intersect<S>::intersect_Triangle(c[0], c[1], c[2], t.a, t.b, t.c, R_MT, p_MT);
  }

  const Solver& solver_;
  const double tolerance_;
};

template <typename S>
void withNarrowPhase(const BroughtSolver<S>& brought, const fcl::CollisionRequest<S>& request,
                     const std::function<void(const NarrowPhase<S>&)>& f) {
  using Libccd = fcl::detail::GJKSolver_libccd<S>;
  using Indep = fcl::detail::GJKSolver_indep<S>;
  const bool none = std::holds_alternative<std::monostate>(brought);
  if (none ? request.gjk_solver_type == fcl::GST_INDEP : std::holds_alternative<const Indep*>(brought)) {
    const Indep* given = none ? nullptr : std::get<const Indep*>(brought);
    Indep own;
    if (none) own.gjk_tolerance = own.epa_tolerance = request.gjk_tolerance;
    const Indep& solver = given != nullptr ? *given : own;
    checkTolerance("collide", "solver->gjk_tolerance", static_cast<double>(solver.gjk_tolerance));
    f(NarrowPhaseOf<S, Indep>(solver, static_cast<double>(solver.gjk_tolerance)));
  } else {
    const Libccd* given = none ? nullptr : std::get<const Libccd*>(brought);
    Libccd own;
    if (none) own.collision_tolerance = request.gjk_tolerance;
    const Libccd& solver = given != nullptr ? *given : own;
    checkTolerance("collide", "solver->collision_tolerance", static_cast<double>(solver.collision_tolerance));
    f(NarrowPhaseOf<S, Libccd>(solver, static_cast<double>(solver.collision_tolerance)));
  }
}

}  // namespace bocst::fcl_adapter
