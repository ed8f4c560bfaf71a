// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/export.h>

namespace bocst {

/// Turns a check on or off: each Model constructed from now on checks that FCL's queries in this process reach bocst
/// (see <bocst/fcl.h>). The check is on by default. The environment variable BOCST_DISPATCH_CHECK=off turns it off in
/// any case. Without the check, code compiled without <bocst/fcl.h> may get "free" for models that touch. Thread-safe.
BOCST_EXPORT void setDispatchCheck(bool on);

}  // namespace bocst
