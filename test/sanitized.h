// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdlib>

namespace bocst::test {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kSanitized = true;
#else
constexpr bool kSanitized = false;
#endif

#ifdef __SANITIZE_THREAD__
constexpr bool kThreadSanitized = true;
#else
constexpr bool kThreadSanitized = false;
#endif

/// How often a test asks: a fifth of `times` under sanitizers, which take ten times as long and look for other faults,
/// and where the tests run once more with another oracle or driver, which draws in software.
inline int repetitions(int times) {
  const bool once_more = std::getenv("BOCST_ORACLE") != nullptr || std::getenv("GALLIUM_DRIVER") != nullptr;
  return kSanitized || once_more ? times / 5 : times;
}

}  // namespace bocst::test
