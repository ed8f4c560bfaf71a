// SPDX-License-Identifier: BSD-3-Clause
#undef BOCST_ASSERTIONS
#include <gtest/gtest.h>

#include "log/assert.h"

namespace bocst {
namespace {

TEST(Assert, WhereOffNothingIsEvaluated) {
  int calls = 0;
  BOCST_ASSERT(++calls == 2);
  EXPECT_EQ(calls, 0);
}

}  // namespace
}  // namespace bocst
