// SPDX-License-Identifier: BSD-3-Clause
#pragma once

/// BOCST_ASSERT(condition): what the code around it relies on. Where BOCST_ASSERTIONS is defined (CMake option, or any
/// sanitizer), a condition that does not hold prints itself and aborts; elsewhere nothing is evaluated. Not for what a
/// caller can get wrong: that throws.
#ifdef BOCST_ASSERTIONS
#include <cstdio>
#include <cstdlib>

namespace bocst {
[[noreturn]] inline void assertionFailed(const char* condition, const char* file, int line) {
  std::fprintf(stderr, "%s:%d: assertion failed: %s\n", file, line, condition);
  std::abort();
}
}  // namespace bocst

#define BOCST_ASSERT(condition) ((condition) ? void() : ::bocst::assertionFailed(#condition, __FILE__, __LINE__))
#else
#define BOCST_ASSERT(condition) static_cast<void>(sizeof((condition) ? 1 : 0))
#endif
