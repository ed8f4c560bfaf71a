// SPDX-License-Identifier: BSD-3-Clause
#undef BOCST_ASSERTIONS
#include "log/assert.h"

#include <gtest/gtest.h>

namespace bocst {
namespace {

TEST(Assert, WhereOffNothingIsEvaluated) {
  int calls = 0;
  BOCST_ASSERT(++calls == 2);
  EXPECT_EQ(calls, 0);
}

}  // namespace
}  // namespace bocst
