// SPDX-License-Identifier: BSD-3-Clause
#include "conformance/reference.h"

namespace bocst::test {
BOCST_FCL_MODELS(, float)
BOCST_FCL_MODELS(, double)
}  // namespace bocst::test
