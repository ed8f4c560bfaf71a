// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <cstdint>
#include <string>
#include <vector>

namespace bocst::test {

/// Runs a test on each instruction set that the dispatch can choose on this machine.
class EveryTarget : public testing::TestWithParam<std::int64_t> {
 public:
  static std::vector<std::int64_t> targets() {
    std::vector<std::int64_t> result;
    for (std::int64_t left = hwy::SupportedTargets() & HWY_TARGETS; left != 0; left &= left - 1)
      result.push_back(left & -left);
    return result;
  }
  static std::string name(const testing::TestParamInfo<std::int64_t>& target) { return hwy::TargetName(target.param); }

 protected:
  void SetUp() override { allow(GetParam()); }
  void TearDown() override { allow(0); }

 private:
  // 0: all of them.
  static void allow(std::int64_t targets) {
    hwy::SetSupportedTargetsForTest(targets);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  }
};

}  // namespace bocst::test
