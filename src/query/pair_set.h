// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace bocst::query {

/// A set of pairs of ids (a cell or a triangle, and a triangle) that is emptied in constant time, so that one can serve
/// query after query.
class PairSet {
 public:
  void clear() {
    size_ = 0;
    if (++epoch_ == 0) {
      slots_.assign(slots_.size(), Slot());
      epoch_ = 1;
    }
  }

  /// False when the pair was there already.
  bool insert(std::uint64_t a, std::uint32_t b) {
    if (2 * (size_ + 1) > slots_.size()) grow();
    return place(a, b);
  }

 private:
  struct Slot {
    std::uint64_t a = 0;
    std::uint32_t b = 0;
    std::uint32_t epoch = 0;
  };

  bool place(std::uint64_t a, std::uint32_t b) {
    const std::size_t mask = slots_.size() - 1;
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
    std::vector<Slot> old(slots_.empty() ? 1024 : 2 * slots_.size());
    old.swap(slots_);
    size_ = 0;
    for (const Slot& s : old) {
      if (s.epoch == epoch_) place(s.a, s.b);
    }
  }

  std::vector<Slot> slots_;
  std::size_t size_ = 0;
  std::uint32_t epoch_ = 1;
};

}  // namespace bocst::query
