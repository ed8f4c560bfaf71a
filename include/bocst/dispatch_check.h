// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/export.h>

namespace bocst {

/// Whether a Model that is made from now on checks that FCL's queries of this process reach bocst (see <bocst/fcl.h>);
/// true at first. The environment's BOCST_DISPATCH_CHECK=off turns the check off whatever is said here. Without the
/// check, code that was compiled without <bocst/fcl.h> may be told "free" about models that touch. Thread-safe.
BOCST_EXPORT void setDispatchCheck(bool on);

}  // namespace bocst
