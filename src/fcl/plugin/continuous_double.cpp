// SPDX-License-Identifier: BSD-3-Clause
#include "fcl/plugin/registration.h"

// libfcl calls these, too, so they answer every pair.
template <>
double fcl::continuousCollide<double>(const CollisionGeometry<double>* o1, const MotionBase<double>* motion1,
                                      const CollisionGeometry<double>* o2, const MotionBase<double>* motion2,
                                      const ContinuousCollisionRequest<double>& request,
                                      ContinuousCollisionResult<double>& result) {
  if (bocst::isModel<double>(o1) || bocst::isModel<double>(o2)) {
    if (bocst::fcl_adapter::touchesNothing<double>(o1, o2, result)) return result.time_of_contact;
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
    if (bocst::fcl_adapter::touchesNothing<double>(o1, o2, result)) return result.time_of_contact;
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
