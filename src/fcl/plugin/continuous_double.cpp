// SPDX-License-Identifier: BSD-3-Clause
#include "fcl/plugin/registration.h"

namespace {

using Geometry = fcl::CollisionGeometry<double>;
using Motion = fcl::MotionBase<double>;
using Request = fcl::ContinuousCollisionRequest<double>;
using Result = fcl::ContinuousCollisionResult<double>;

template <typename Solver>
double advance(const Geometry* o1, const Motion* motion1, const Geometry* o2, const Motion* motion2,
               const Solver* solver, const Request& request, Result& result) {
  if (bocst::isModel<double>(o1) || bocst::isModel<double>(o2)) {
    return bocst::fcl_adapter::advancementEntry(o1, motion1, o2, motion2, solver, request, result);
  }
  return bocst::fcl_adapter::libfcl::conservativeAdvancement(o1, motion1, o2, motion2, solver, request, result);
}

}  // namespace

template <>
double fcl::continuousCollideConservativeAdvancement<double>(const Geometry* o1, const Motion* motion1,
                                                             const Geometry* o2, const Motion* motion2,
                                                             const Request& request, Result& result) {
  if (request.gjk_solver_type == GST_INDEP) {
    const detail::GJKSolver_indep<double> solver;
    return ::advance(o1, motion1, o2, motion2, &solver, request, result);
  }
  const detail::GJKSolver_libccd<double> solver;
  return ::advance(o1, motion1, o2, motion2, &solver, request, result);
}

// libfcl exports these, too, and reads its own hidden table in them. Code that is compiled without optimisation and
// without <bocst/fcl.h> calls them.
#define BOCST_OWN_ADVANCEMENT(Solver)                                                                     \
  template <>                                                                                             \
  BOCST_EXPORT double fcl::detail::continuousCollideConservativeAdvancement<fcl::detail::Solver<double>>( \
      const Geometry* o1, const Motion* motion1, const Geometry* o2, const Motion* motion2,               \
      const fcl::detail::Solver<double>* solver, const Request& request, Result& result) {                \
    return ::advance(o1, motion1, o2, motion2, solver, request, result);                                  \
  }
BOCST_OWN_ADVANCEMENT(GJKSolver_libccd)
BOCST_OWN_ADVANCEMENT(GJKSolver_indep)
#undef BOCST_OWN_ADVANCEMENT

// libfcl calls these, too, so they answer every pair.
template <>
double fcl::continuousCollide<double>(const CollisionGeometry<double>* o1, const MotionBase<double>* motion1,
                                      const CollisionGeometry<double>* o2, const MotionBase<double>* motion2,
                                      const ContinuousCollisionRequest<double>& request,
                                      ContinuousCollisionResult<double>& result) {
  if (bocst::isModel<double>(o1) || bocst::isModel<double>(o2)) {
    return bocst::fcl_adapter::continuousPair<double>(o1, motion1, o2, motion2, request, result);
  }
  return bocst::fcl_adapter::libfcl::continuousCollide(o1, motion1, o2, motion2, request, result);
}

template <>
double fcl::continuousCollide<double>(const CollisionGeometry<double>* o1, const Transform3<double>& X_W1_begin,
                                      const Transform3<double>& X_W1_end, const CollisionGeometry<double>* o2,
                                      const Transform3<double>& X_W2_begin, const Transform3<double>& X_W2_end,
                                      const ContinuousCollisionRequest<double>& request,
                                      ContinuousCollisionResult<double>& result) {
  if (bocst::isModel<double>(o1) || bocst::isModel<double>(o2)) {
    return bocst::fcl_adapter::continuousPair<double>(o1, X_W1_begin, X_W1_end, o2, X_W2_begin, X_W2_end, request,
                                                      result);
  }
  return bocst::fcl_adapter::libfcl::continuousCollide(o1, X_W1_begin, X_W1_end, o2, X_W2_begin, X_W2_end, request,
                                                       result);
}

template double fcl::continuousCollide<double>(const CollisionObject<double>*, const Transform3<double>&,
                                               const CollisionObject<double>*, const Transform3<double>&,
                                               const ContinuousCollisionRequest<double>&,
                                               ContinuousCollisionResult<double>&);
template double fcl::collide<double>(const ContinuousCollisionObject<double>*, const ContinuousCollisionObject<double>*,
                                     const ContinuousCollisionRequest<double>&, ContinuousCollisionResult<double>&);

namespace {

// The pairs of FCL's own table.
bool fclAdvances(int row, int column) {
  const auto is_shape = [](int type) { return bocst::fcl_adapter::isFclShape(type) && type != fcl::GEOM_ELLIPSOID; };
  if (is_shape(row)) return is_shape(column) || bocst::fcl_adapter::isBvh(column);
  return bocst::fcl_adapter::isBvh(row) && (is_shape(column) || row == column);
}

}  // namespace

// As those of collisions: only code that names FCL's conservative advancement itself reads these tables.
template <>
fcl::detail::ConservativeAdvancementFunctionMatrix<
    fcl::detail::GJKSolver_libccd<double>>::ConservativeAdvancementFunctionMatrix() {
  bocst::fcl_adapter::fillTable(conservative_advancement_matrix,
                                &bocst::fcl_adapter::libfcl::conservativeAdvancement<GJKSolver_libccd<double>>,
                                fclAdvances);
}
template <>
fcl::detail::ConservativeAdvancementFunctionMatrix<
    fcl::detail::GJKSolver_indep<double>>::ConservativeAdvancementFunctionMatrix() {
  bocst::fcl_adapter::fillTable(conservative_advancement_matrix,
                                &bocst::fcl_adapter::libfcl::conservativeAdvancement<GJKSolver_indep<double>>,
                                fclAdvances);
}

BOCST_FCL_TABLE(ConservativeAdvancement, GJKSolver_libccd<double>)
BOCST_FCL_TABLE(ConservativeAdvancement, GJKSolver_indep<double>)

void bocst::fcl_adapter::registerContinuous() {
  using Libccd = fcl::detail::GJKSolver_libccd<double>;
  using Indep = fcl::detail::GJKSolver_indep<double>;
  fillSlots(fcl::getConservativeAdvancementFunctionLookTable<Libccd>().conservative_advancement_matrix,
            &advancementEntry<Libccd>);
  fillSlots(fcl::getConservativeAdvancementFunctionLookTable<Indep>().conservative_advancement_matrix,
            &advancementEntry<Indep>);
}
