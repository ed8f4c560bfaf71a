// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/geometry/collision_geometry.h>

#include <string>

namespace bocst::fcl_room {

/// Registers bocst in FCL's tables and asks, once a process and scalar, the entry points that code compiled without
/// <bocst/fcl.h> would call, on a sentinel pair: do they reach this library? Thread-safe; cheap from the second call
/// on.
/// @throws std::runtime_error with the remedy when they do not, each time, unless BOCST_DISPATCH_CHECK=off.
template <typename S>
void checkDispatch();

/// The C++ name of the geometry's class, for messages.
template <typename S>
std::string typeName(const fcl::CollisionGeometry<S>* geometry);

}  // namespace bocst::fcl_room
