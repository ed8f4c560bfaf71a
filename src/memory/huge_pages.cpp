// SPDX-License-Identifier: BSD-3-Clause
#include "memory/huge_pages.h"

#include <sys/mman.h>

#include <cstdint>
#include <new>

namespace bocst::memory {
namespace {

constexpr std::size_t kHugePage = std::size_t{1} << 21;

constexpr std::size_t roundedUp(std::size_t bytes) { return (bytes + kHugePage - 1) / kHugePage * kHugePage; }

}  // namespace

void adviseHugePages([[maybe_unused]] void* begin, [[maybe_unused]] std::size_t bytes) {
#ifdef MADV_HUGEPAGE
  const auto address = reinterpret_cast<std::uintptr_t>(begin);
  const std::uintptr_t first = roundedUp(address), end = (address + bytes) / kHugePage * kHugePage;
  // Only a hint: if the kernel refuses it, small pages are used.
  if (first < end) madvise(reinterpret_cast<void*>(first), end - first, MADV_HUGEPAGE);
#endif
}

HugePages::HugePages(std::size_t bytes) : memory_(::operator new(roundedUp(bytes), std::align_val_t(kHugePage))) {
  adviseHugePages(memory_.get(), roundedUp(bytes));
}

void HugePages::Delete::operator()(void* memory) const { ::operator delete(memory, std::align_val_t(kHugePage)); }

}  // namespace bocst::memory
