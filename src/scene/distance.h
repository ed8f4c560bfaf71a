// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/narrowphase/distance_result.h>
#include <fcl/narrowphase/gjk_solver_type.h>

#include <vector>

#include "scene/state_check.h"

namespace bocst::scene {

/// fcl::distance of a pair, and that to planes, no less than 0; any larger value where it is not less than `below`.
/// points: where not null, the nearest points in the world, if the distance is less than `below`.
/// @throws std::invalid_argument where FCL knows no distance.
template <typename S>
S distanceBelow(const Object<S>& a, const fcl::Transform3<S>& X_WA, const Object<S>& b, const fcl::Transform3<S>& X_WB,
                S below, fcl::GJKSolverType solver = fcl::GST_LIBCCD, fcl::Vector3<S>* points = nullptr);

/// The least fcl::distance of all pairs, no less than 0, and a pair that has it; `at_most` if none is less. X_WM: poses
/// that checkPoses() has checked; one StateCheck a thread.
/// @throws std::invalid_argument where FCL knows no distance.
template <typename S>
S clearance(const World<S>& world, StateCheck<S>& check, const fcl::Transform3<S>* X_WM, S at_most, PairAt& nearest);

/// All pairs whose distance is at most `distance`, which is no less than 0; the nearest first. Otherwise as
/// clearance().
template <typename S>
std::vector<PairDistance<S>> pairsWithin(const World<S>& world, StateCheck<S>& check, const fcl::Transform3<S>* X_WM,
                                         S distance);

}  // namespace bocst::scene
