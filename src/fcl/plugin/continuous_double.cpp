// SPDX-License-Identifier: BSD-3-Clause
#include "fcl/plugin/registration.h"

// In FCL's words, but for models.
template <>
double fcl::continuousCollide<double>(const CollisionGeometry<double>* o1, const MotionBase<double>* motion1,
                                      const CollisionGeometry<double>* o2, const MotionBase<double>* motion2,
                                      const ContinuousCollisionRequest<double>& request,
                                      ContinuousCollisionResult<double>& result) {
  if (bocst::isModel<double>(o1) || bocst::isModel<double>(o2)) {
    if (bocst::fcl_adapter::touchesNothing<double>(o1, o2, result)) return result.time_of_contact;
    return bocst::fcl_adapter::continuousPair<double>(o1, motion1, o2, motion2, request, result);
  }
  switch (request.ccd_solver_type) {
    case CCDC_NAIVE:
      return continuousCollideNaive<double>(o1, motion1, o2, motion2, request, result);
    case CCDC_CONSERVATIVE_ADVANCEMENT:
      return continuousCollideConservativeAdvancement<double>(o1, motion1, o2, motion2, request, result);
    case CCDC_RAY_SHOOTING:
      if (o1->getObjectType() == OT_GEOM && o2->getObjectType() == OT_GEOM && request.ccd_motion_type == CCDM_TRANS) {
        return -1;
      }
      break;
    case CCDC_POLYNOMIAL_SOLVER:
      if (o1->getObjectType() == OT_BVH && o2->getObjectType() == OT_BVH && request.ccd_motion_type == CCDM_TRANS) {
        return continuousCollideBVHPolynomial<double>(o1, static_cast<const TranslationMotion<double>*>(motion1), o2,
                                                      static_cast<const TranslationMotion<double>*>(motion2), request,
                                                      result);
      }
      std::cerr << "Warning! Invalid continuous collision checking\n";
      return -1;
  }
  std::cerr << "Warning! Invalid continuous collision setting\n";
  return -1;
}

template <>
double fcl::continuousCollide<double>(const CollisionGeometry<double>* o1, const Transform3<double>& X_W1_begin,
                                      const Transform3<double>& X_W1_end, const CollisionGeometry<double>* o2,
                                      const Transform3<double>& X_W2_begin, const Transform3<double>& X_W2_end,
                                      const ContinuousCollisionRequest<double>& request,
                                      ContinuousCollisionResult<double>& result) {
  if (bocst::isModel<double>(o1) || bocst::isModel<double>(o2)) {
    if (bocst::fcl_adapter::touchesNothing<double>(o1, o2, result)) return result.time_of_contact;
    return bocst::fcl_adapter::continuousPair<double>(o1, X_W1_begin, X_W1_end, o2, X_W2_begin, X_W2_end, request,
                                                      result);
  }
  const auto motion1 = getMotionBase<double>(X_W1_begin, X_W1_end, request.ccd_motion_type);
  const auto motion2 = getMotionBase<double>(X_W2_begin, X_W2_end, request.ccd_motion_type);
  return continuousCollide<double>(o1, motion1.get(), o2, motion2.get(), request, result);
}

template double fcl::continuousCollide<double>(const CollisionObject<double>*, const Transform3<double>&,
                                               const CollisionObject<double>*, const Transform3<double>&,
                                               const ContinuousCollisionRequest<double>&,
                                               ContinuousCollisionResult<double>&);
template double fcl::collide<double>(const ContinuousCollisionObject<double>*, const ContinuousCollisionObject<double>*,
                                     const ContinuousCollisionRequest<double>&, ContinuousCollisionResult<double>&);

void bocst::fcl_adapter::registerContinuous() {
  using Libccd = fcl::detail::GJKSolver_libccd<double>;
  using Indep = fcl::detail::GJKSolver_indep<double>;
  fillSlots(fcl::getConservativeAdvancementFunctionLookTable<Libccd>().conservative_advancement_matrix,
            &advancementEntry<double, Libccd>);
  fillSlots(fcl::getConservativeAdvancementFunctionLookTable<Indep>().conservative_advancement_matrix,
            &advancementEntry<double, Indep>);
}
