// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/options.h>

#include "egl/context.h"

namespace bocst::oracle {

/// Which oracle is asked for, and on which EGL device.
struct OracleSelection {
  OracleKind kind = OracleKind::kAuto;
  int device = gl::ContextRequest::kAnyDevice;
};

/// With kAuto, the environment variable BOCST_ORACLE overrides. @throws OracleError for a value that is not known.
OracleSelection oracleSelectionOf(OracleKind kind);

}  // namespace bocst::oracle
