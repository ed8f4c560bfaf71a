// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <limits>
#include <vector>

namespace bocst::query {

/// A set of pairs of an id (of a triangle, or with 64 bits a cell) and a triangle, to serve query after query. No more
/// memory is touched than the query before needed, because beside it, a walk wants the processor's cache; and no more
/// is kept than kMostKept slots.
template <typename Id>
class PairSet {
 public:
  void clear() {
    if (size_ == 0) return;
    if (slots_.size() > kMostKept) {
      *this = PairSet();
      return;
    }
    std::fill_n(slots_.begin(), used_, Slot());
    // The next queries are likely to be like this one.
    while (used_ > kLeast && 8 * size_ < used_) used_ /= 2;
    size_ = 0;
  }

  /// False when the pair was there already. No triangle has the largest number.
  bool insert(Id a, std::uint32_t b) {
    if (2 * (size_ + 1) > used_) grow();
    return place({a, b});
  }

 private:
  static constexpr std::size_t kLeast = 1024, kMostKept = std::size_t{1} << 16;
  static constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

  struct Slot {
    Id a = 0;
    std::uint32_t b = kNone;
  };

  bool place(const Slot& pair) {
    const std::size_t mask = used_ - 1;
    for (std::size_t i = first(pair) & mask;; i = (i + 1) & mask) {
      Slot& slot = slots_[i];
      if (slot.b == kNone) {
        slot = pair;
        ++size_;
        return true;
      }
      if (slot.a == pair.a && slot.b == pair.b) return false;
    }
  }

  // Triangles with numbers next to each other are often neighbours, and their pairs come together: to one cache line.
  static std::size_t first(const Slot& pair) {
    const std::uint64_t a = pair.a / 4, b = pair.b / 4;
    // Only the product's upper bits depend on all of both.
    const std::uint64_t key = ((a << 32 ^ a >> 32 ^ b) * 0x9e3779b97f4a7c15ull) >> 32;
    return (key & ~std::uint64_t{7}) | (pair.a % 4 * 4 + pair.b % 4) / 2;
  }

  void grow() {
    const std::size_t more = std::max(2 * used_, kLeast);
    slots_.resize(std::max(more, slots_.size()));
    held_.clear();
    std::copy_if(slots_.begin(), slots_.begin() + static_cast<std::ptrdiff_t>(used_), std::back_inserter(held_),
                 [](const Slot& s) { return s.b != kNone; });
    std::fill_n(slots_.begin(), used_, Slot());
    used_ = more;
    size_ = 0;
    for (const Slot& s : held_) place(s);
  }

  std::vector<Slot> slots_, held_;  // empty from used_ on; held_: while it grows
  std::size_t used_ = 0;            // a power of two
  std::size_t size_ = 0;
};

}  // namespace bocst::query
