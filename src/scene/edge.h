// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/narrowphase/continuous_collision_request.h>

#include "scene/state_check.h"

namespace bocst::scene {

/// True if the motion from one state to the other is free. begin, end: one pose for each moving object, which
/// checkPoses() has checked. One StateCheck a thread.
template <typename S>
bool edgeIsFree(const World<S>& world, StateCheck<S>& check, const fcl::Transform3<S>* begin,
                const fcl::Transform3<S>* end, fcl::CCDMotionType motion);

}  // namespace bocst::scene
