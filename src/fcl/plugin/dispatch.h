// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace bocst::fcl_adapter {

/// Registers bocst in FCL's tables and, if the check is on (see <bocst/dispatch_check.h>), tests once a process and
/// scalar, on a sentinel pair, that the entry points which code compiled without <bocst/fcl.h> would call reach this
/// library. Thread-safe; cheap from the second call on.
/// @throws std::runtime_error with the remedy when they do not, each time.
template <typename S>
void checkDispatch();

}  // namespace bocst::fcl_adapter
