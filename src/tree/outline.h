// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>

namespace bocst::tree {

/// An oriented box about a surface, in the mesh's frame and unit. It can be read without a lock, so that a pair that is
/// far apart is known as such before anything is locked. Two and a half cache lines.
///
/// Threads: read() from any; set() from one at a time.
class alignas(64) Outline {
 public:
  struct Box {
    double center[3] = {0, 0, 0};
    double axis[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};  ///< axis[k]: direction k, of length 1.
    double half[3] = {0, 0, 0};                             ///< Half the extent along each.
    double reach = 0;                                       ///< No point is farther from the frame's origin.
  };

  void set(const Box& box) {
    const std::uint32_t version = version_.load(std::memory_order_relaxed);
    version_.store(version + 1, std::memory_order_relaxed);
    std::array<double, kWords> words;
    static_assert(sizeof(Box) == sizeof(words));
    std::memcpy(words.data(), &box, sizeof(box));
    // Who sees one of these sees that the version is odd, or a later one.
    for (std::size_t i = 0; i < kWords; ++i) words_[i].store(words[i], std::memory_order_release);
    version_.store(version + 2, std::memory_order_release);
  }

  /// Calls f with the box, of which each value is read where it is used, and returns what f does; false when the box
  /// was changed meanwhile.
  template <typename F>
  bool read(F&& f) const {
    const std::uint32_t version = version_.load(std::memory_order_acquire);
    const bool answer = f(Reader{words_.data()});
    return answer && version % 2 == 0 && version_.load(std::memory_order_relaxed) == version;
  }

  /// The members of Box.
  struct Reader {
    const std::atomic<double>* words;
    double at(std::size_t i) const { return words[i].load(std::memory_order_acquire); }
    double center(std::size_t k) const { return at(k); }
    double axis(std::size_t k, std::size_t c) const { return at(3 + 3 * k + c); }
    double half(std::size_t k) const { return at(12 + k); }
    double reach() const { return at(15); }
  };

 private:
  static constexpr std::size_t kWords = 16;
  std::atomic<std::uint32_t> version_{0};
  std::array<std::atomic<double>, kWords> words_{};
};

}  // namespace bocst::tree
