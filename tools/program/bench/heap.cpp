// SPDX-License-Identifier: BSD-3-Clause
#include "bench/heap.h"

#include <cstdlib>
#if defined(__GLIBC__) && __GLIBC_PREREQ(2, 33)
#include <malloc.h>
#define BOCST_HAS_MALLINFO2 1
#endif

namespace bocst::program {
namespace {

std::size_t reportedBytes() {
#ifdef BOCST_HAS_MALLINFO2
  const struct mallinfo2 info = ::mallinfo2();
  return info.uordblks + info.hblkhd;
#else
  return 0;
#endif
}

/// Another allocator than the C library's may be in its place, a sanitizer's for one.
bool isReported() {
  constexpr std::size_t kSize = 1 << 20;
  const std::size_t before = reportedBytes();
  void* volatile probe = std::malloc(kSize);
  const std::size_t after = reportedBytes();
  std::free(probe);
  return after >= before + kSize;
}

}  // namespace

std::optional<std::size_t> heapBytes() {
  static const bool reported = isReported();
  if (!reported) return std::nullopt;
  return reportedBytes();
}

}  // namespace bocst::program
