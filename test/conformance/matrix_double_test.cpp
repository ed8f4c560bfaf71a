// SPDX-License-Identifier: BSD-3-Clause
#include "conformance/matrix.h"

namespace {

BOCST_TEST_MATRIX(MatrixDouble, double);

}  // namespace
