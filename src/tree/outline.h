// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>

namespace bocst::tree {

/// An oriented box about a surface, in the mesh's frame and unit. It can be read without a lock, so that a pair that is
/// far apart is known as such before anything is locked. A cache line, and a word.
///
/// Threads: read() from any; set() from one at a time.
class alignas(64) Outline {
 public:
  struct Box {
    float center[3] = {0, 0, 0};
    float axes[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};  ///< axes[c][k]: coordinate c of direction k.
    float half[3] = {0, 0, 0};                             ///< Half the extent along direction k.
    float reach = 0;                                       ///< No point is farther from the frame's origin.
  };

  /// The members of Box where they lie. A copy of them would be slow: what was just written in small parts is.
  class Reader {
   public:
    explicit Reader(const std::atomic<float>* values) : values_(values) {}
    float center(std::size_t k) const { return at(k); }
    float axis(std::size_t c, std::size_t k) const { return at(3 + 3 * c + k); }
    float half(std::size_t k) const { return at(12 + k); }
    float reach() const { return at(15); }

   private:
    float at(std::size_t i) const { return values_[i].load(std::memory_order_acquire); }
    const std::atomic<float>* values_;
  };

  /// About `center`, with the columns of `axes` as directions of length 1. What rounding to float takes away is within
  /// the gap that areFarApart() leaves.
  static Box boxOf(const Eigen::Vector3d& center, const Eigen::Matrix3d& axes, const Eigen::Vector3d& half) {
    Box box;
    for (int k = 0; k < 3; ++k) {
      box.center[k] = static_cast<float>(center[k]);
      for (int c = 0; c < 3; ++c) box.axes[c][k] = static_cast<float>(axes(c, k));
      box.half[k] = static_cast<float>(half[k]);
    }
    box.reach = static_cast<float>(center.norm() + half.norm());
    return box;
  }

  void set(const Box& box) {
    const std::uint32_t version = version_.load(std::memory_order_relaxed);
    version_.store(version + 1, std::memory_order_relaxed);
    std::array<float, kCount> values;
    static_assert(sizeof(Box) == sizeof(values));
    std::memcpy(values.data(), &box, sizeof(box));
    // Who sees one of these sees that the version is odd, or a later one.
    for (std::size_t i = 0; i < kCount; ++i) values_[i].store(values[i], std::memory_order_release);
    version_.store(version + 2, std::memory_order_release);
  }

  /// What f says of the box; false when that was changed meanwhile.
  template <typename F>
  bool read(F&& f) const {
    const std::uint32_t version = version_.load(std::memory_order_acquire);
    const bool answer = f(Reader(values_.data()));
    return answer && version % 2 == 0 && version_.load(std::memory_order_relaxed) == version;
  }

 private:
  static constexpr std::size_t kCount = 16;
  std::array<std::atomic<float>, kCount> values_{};
  std::atomic<std::uint32_t> version_{0};
};

}  // namespace bocst::tree
