// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace bocst::fcl_adapter {

/// Registers bocst in FCL's tables and, if the check is on (see <bocst/dispatch_check.h>), asks once a process and
/// scalar the entry points that code compiled without <bocst/fcl.h> would call, on a sentinel pair: do they reach this
/// library? Thread-safe; cheap from the second call on.
/// @throws std::runtime_error with the remedy when they do not, each time.
template <typename S>
void checkDispatch();

}  // namespace bocst::fcl_adapter
