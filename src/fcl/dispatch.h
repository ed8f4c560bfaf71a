// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace bocst::fcl_room {

/// Asks, once a process and scalar, the entry point that code compiled without <bocst/fcl.h> would call, on a sentinel
/// pair: does it reach this library?
/// @throws std::runtime_error with the remedy when it does not, each time, unless BOCST_DISPATCH_CHECK=off.
template <typename S>
void checkDispatch();

}  // namespace bocst::fcl_room
