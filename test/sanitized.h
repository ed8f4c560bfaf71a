// SPDX-License-Identifier: BSD-3-Clause
#pragma once

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

/// How often a test asks: a fifth of `times` under sanitizers, which take ten times as long and look for other faults.
constexpr int repetitions(int times) { return kSanitized ? times / 5 : times; }

}  // namespace bocst::test
