// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/narrowphase/distance_request.h>
#include <fcl/narrowphase/distance_result.h>

namespace bocst::fcl_adapter {

/// Answers fcl::distance for a pair with a Model; as bocst::distance in <bocst/fcl.h>.
template <typename S>
S distancePair(const fcl::CollisionGeometry<S>* o1, const fcl::Transform3<S>& X_W1, const fcl::CollisionGeometry<S>* o2,
               const fcl::Transform3<S>& X_W2, const fcl::DistanceRequest<S>& request, fcl::DistanceResult<S>& result);

}  // namespace bocst::fcl_adapter
