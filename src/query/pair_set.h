// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace bocst::query {

/// A set of pairs of ids (a cell or a triangle, and a triangle) that is emptied in constant time, so that one can serve
/// query after query.
class PairSet {
 public:
  void clear() {
    if (++epoch_ == 0) {
      slots_.assign(slots_.size(), Slot());
      epoch_ = 1;
    }
    // The next queries are likely to be like this one, and what is small stays in the processor's cache.
    if (used_ > kLeast && 8 * size_ < used_) used_ /= 2;
    size_ = 0;
  }

  /// False when the pair was there already.
  bool insert(std::uint64_t a, std::uint32_t b) {
    if (2 * (size_ + 1) > used_) grow();
    return place(a, b);
  }

 private:
  static constexpr std::size_t kLeast = 1024;

  struct Slot {
    std::uint64_t a = 0;
    std::uint32_t b = 0;
    std::uint32_t epoch = 0;
  };

  bool place(std::uint64_t a, std::uint32_t b) {
    const std::size_t mask = used_ - 1;
    for (std::size_t i = ((a << 32 ^ a >> 32 ^ b) * 0x9e3779b97f4a7c15ull) >> 20 & mask;; i = (i + 1) & mask) {
      if (slots_[i].epoch != epoch_) {
        slots_[i] = {a, b, epoch_};
        ++size_;
        return true;
      }
      if (slots_[i].a == a && slots_[i].b == b) return false;
    }
  }

  void grow() {
    held_.assign(slots_.begin(), slots_.begin() + static_cast<std::ptrdiff_t>(used_));
    const std::uint32_t epoch = epoch_;
    used_ = std::max(2 * used_, kLeast);
    slots_.resize(std::max(used_, slots_.size()));
    clear();
    for (const Slot& s : held_) {
      if (s.epoch == epoch) place(s.a, s.b);
    }
  }

  std::vector<Slot> slots_, held_;  // held_: while it grows
  std::size_t used_ = 0;            // of slots_, a power of two
  std::size_t size_ = 0;
  std::uint32_t epoch_ = 1;
};

}  // namespace bocst::query
