// SPDX-License-Identifier: BSD-3-Clause
#ifndef BOCST_ASSERTIONS
#define BOCST_ASSERTIONS
#endif
#include "log/assert.h"

#include <gtest/gtest.h>

namespace bocst {
namespace {

TEST(AssertDeathTest, WhereOnItSaysWhatDoesNotHold) {
  int calls = 0;
  BOCST_ASSERT(++calls == 1);
  EXPECT_EQ(calls, 1);
  EXPECT_DEATH(BOCST_ASSERT(2 + 2 == 5), "assert_test.cpp:[0-9]+: assertion failed: 2 \\+ 2 == 5");
}

}  // namespace
}  // namespace bocst
