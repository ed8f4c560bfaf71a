// SPDX-License-Identifier: BSD-3-Clause
#include "heap.h"

#include <cstdlib>
#if defined(__GLIBC__) && __GLIBC_PREREQ(2, 33)
#include <malloc.h>
#define BOCST_HAS_MALLINFO2 1
#endif

namespace bocst::program {

std::optional<std::size_t> heapBytes() {
#ifdef BOCST_HAS_MALLINFO2
  const struct mallinfo2 info = ::mallinfo2();
  return info.uordblks + info.hblkhd;
#else
  return std::nullopt;
#endif
}

}  // namespace bocst::program
