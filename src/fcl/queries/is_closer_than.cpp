// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/is_closer_than.h>
#include <fcl/narrowphase/collision_result.h>

#include "fcl/adapters/validate.h"
#include "fcl/queries/collide_pair.h"

namespace bocst {

template <typename S>
bool isCloserThan(const fcl::CollisionGeometry<S>* o1, const fcl::Transform3<S>& X_W1,
                  const fcl::CollisionGeometry<S>* o2, const fcl::Transform3<S>& X_W2, S distance) {
  fcl_adapter::checkTolerance("isCloserThan", "distance", static_cast<double>(distance));
  fcl::CollisionResult<S> result;
  return fcl_adapter::collidePair<S>(o1, X_W1, o2, X_W2, {}, fcl::CollisionRequest<S>(), result,
                                     static_cast<double>(distance)) > 0;
}

template bool isCloserThan<float>(const fcl::CollisionGeometry<float>*, const fcl::Transform3<float>&,
                                  const fcl::CollisionGeometry<float>*, const fcl::Transform3<float>&, float);
template bool isCloserThan<double>(const fcl::CollisionGeometry<double>*, const fcl::Transform3<double>&,
                                   const fcl::CollisionGeometry<double>*, const fcl::Transform3<double>&, double);

}  // namespace bocst
