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
/// far apart is known as such before anything is locked. Two cache lines.
///
/// Threads: read() from any; set() from one at a time.
class alignas(64) Outline {
 public:
  /// Columns of four, so that a dot product with all three directions is three steps of SIMD; the rest is 0.
  struct alignas(16) Box {
    float center[4] = {0, 0, 0, 0};
    float axes[3][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}};  ///< axes[c][k]: coordinate c of direction k.
    float half[4] = {0, 0, 0, 0};                                   ///< Half the extent along direction k.
    float reach[4] = {0, 0, 0, 0};  ///< No point is farther from the frame's origin than reach[0].
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
    box.reach[0] = static_cast<float>(center.norm() + half.norm());
    return box;
  }

  void set(const Box& box) {
    const std::uint32_t version = version_.load(std::memory_order_relaxed);
    version_.store(version + 1, std::memory_order_relaxed);
    std::array<std::uint64_t, kWords> words;
    static_assert(sizeof(Box) == sizeof(words));
    std::memcpy(words.data(), &box, sizeof(box));
    // Who sees one of these sees that the version is odd, or a later one.
    for (std::size_t i = 0; i < kWords; ++i) words_[i].store(words[i], std::memory_order_release);
    version_.store(version + 2, std::memory_order_release);
  }

  /// False when it was changed meanwhile.
  bool read(Box& box) const {
    const std::uint32_t version = version_.load(std::memory_order_acquire);
    std::array<std::uint64_t, kWords> words;
    for (std::size_t i = 0; i < kWords; ++i) words[i] = words_[i].load(std::memory_order_acquire);
    std::memcpy(static_cast<void*>(&box), words.data(), sizeof(box));
    return version % 2 == 0 && version_.load(std::memory_order_relaxed) == version;
  }

 private:
  static constexpr std::size_t kWords = 12;
  std::array<std::atomic<std::uint64_t>, kWords> words_{};
  std::atomic<std::uint32_t> version_{0};
};

}  // namespace bocst::tree
