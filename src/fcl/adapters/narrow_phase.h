// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/geometry/shape/shape_base.h>
#include <fcl/narrowphase/collision_request.h>

#include <functional>
#include <variant>

namespace fcl::detail {
template <typename S_>
struct GJKSolver_libccd;
template <typename S_>
struct GJKSolver_indep;
}  // namespace fcl::detail

namespace bocst::fcl_adapter {

/// A solver that the caller brought. Without one, or with a null one, the solver type of the request is used.
template <typename S>
using BroughtSolver =
    std::variant<std::monostate, const fcl::detail::GJKSolver_libccd<S>*, const fcl::detail::GJKSolver_indep<S>*>;

/// FCL's tests of a shape and a triangle, by one of its GJK solvers. Their verdicts only: of FCL's contacts, normals
/// may be in the frame of the shape, depths negative, and neither need part the two.
template <typename S>
class NarrowPhase {
 public:
  virtual ~NarrowPhase() = default;

  /// Corners in the frame of a mesh at X_WM.
  virtual bool fclOverlaps(const fcl::ShapeBase<S>& shape, const fcl::Transform3<S>& X_WS,
                           const fcl::Vector3<S> (&corners)[3], const fcl::Transform3<S>& X_WM) const = 0;

  /// fclOverlaps() may be true of what is apart by this, and by the rounding of positions.
  virtual double tolerance() const = 0;
};

/// Calls f with the caller's solver, or with one made from the request.
template <typename S>
void withNarrowPhase(const BroughtSolver<S>& brought, const fcl::CollisionRequest<S>& request,
                     const std::function<void(const NarrowPhase<S>&)>& f);

}  // namespace bocst::fcl_adapter
