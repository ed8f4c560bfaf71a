// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/is_closer_than.h>
#include <fcl/narrowphase/collision_result.h>

#include <stdexcept>

#include "fcl/adapters/bodies.h"
#include "fcl/adapters/models.h"
#include "fcl/adapters/validate.h"
#include "fcl/collide/collide_pair.h"
#include "fcl/queries/distance_pair.h"
#include "thread/of_thread.h"

namespace bocst {
namespace {

/// The square of a larger margin may not fit a double in the frame of the smallest model.
constexpr double kMostAsMargin = 1e70;

}  // namespace

template <typename S>
bool isCloserThan(const fcl::CollisionGeometry<S>* o1, const fcl::Transform3<S>& X_W1,
                  const fcl::CollisionGeometry<S>* o2, const fcl::Transform3<S>& X_W2, S distance) {
  fcl_adapter::checkTolerance("isCloserThan", "distance", static_cast<double>(distance));
  switch (fcl_adapter::kindOf<S>("isCloserThan", o1, o2)) {
    case fcl_adapter::PairKind::kNothing:
      return false;
    case fcl_adapter::PairKind::kModel:
      fcl_adapter::checkPartners<S>("isCloserThan", o1, o2);
      fcl_adapter::checkPose("isCloserThan", "X_W1", X_W1);
      fcl_adapter::checkPose("isCloserThan", "X_W2", X_W2);
      if (!(static_cast<double>(distance) < kMostAsMargin)) {
        if (!o1->isOccupied() || !o2->isOccupied()) return false;
        fcl::DistanceResult<S> result;
        return fcl_adapter::distancePair<S>(o1, X_W1, o2, X_W2, fcl::DistanceRequest<S>(), result) <= distance;
      }
      break;
    case fcl_adapter::PairKind::kForeign:
      throw std::logic_error("bocst::isCloserThan: neither geometry is a bocst::Model");
  }
  fcl::CollisionResult<S>& result = thread::ofThread<fcl::CollisionResult<S>>();
  result.clear();
  return fcl_adapter::collidePair<S>(o1, X_W1, o2, X_W2, {}, fcl::CollisionRequest<S>(), result,
                                     static_cast<double>(distance)) > 0;
}

template bool isCloserThan<float>(const fcl::CollisionGeometry<float>*, const fcl::Transform3<float>&,
                                  const fcl::CollisionGeometry<float>*, const fcl::Transform3<float>&, float);
template bool isCloserThan<double>(const fcl::CollisionGeometry<double>*, const fcl::Transform3<double>&,
                                   const fcl::CollisionGeometry<double>*, const fcl::Transform3<double>&, double);

}  // namespace bocst
