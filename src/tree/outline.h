// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "simd/float4.h"

namespace bocst::tree {

/// An oriented box about all that a query may meet of a model, in the mesh's frame and unit: its surface or, with
/// conservative answers, the spheres about it. It can be read without a lock, so that a pair that is far apart is known
/// as such before anything is locked. A cache line, and a word.
///
/// Threads: read() from any; set() from one at a time.
class alignas(64) Outline {
 public:
  struct Box {
    struct Axis {
      float direction[3];
      float half;  ///< Half the box's extent along it.
    };
    Axis axes[3] = {{{1, 0, 0}, 0}, {{0, 1, 0}, 0}, {{0, 0, 1}, 0}};
    float center[3] = {0, 0, 0};
    float radius = 0;  ///< No point is farther from the frame's origin.
  };

  /// The members of Box where they lie, four floats at once. A copy of them would be slow: what was just written in
  /// small parts is.
  class Reader {
   public:
    explicit Reader(const std::atomic<std::uint64_t>* words) : words_(words) {}
    simd::Float4 axis(std::size_t k) const { return at(2 * k); }  ///< The direction, and half the extent along it.
    simd::Float4 center() const { return at(6); }                 ///< And the radius.
    float half(std::size_t k) const { return axis(k)[3]; }

   private:
    __attribute__((always_inline)) simd::Float4 at(std::size_t i) const {
      using Words = std::uint64_t __attribute__((vector_size(16)));
      return reinterpret_cast<simd::Float4>(
          Words{words_[i].load(std::memory_order_acquire), words_[i + 1].load(std::memory_order_acquire)});
    }
    const std::atomic<std::uint64_t>* words_;
  };

  /// About `center`, with the columns of `axes` as directions of length 1. What rounding to float takes away is within
  /// the gap that areFarApart() leaves.
  static Box boxOf(const Eigen::Vector3d& center, const Eigen::Matrix3d& axes, const Eigen::Vector3d& half) {
    Box box;
    for (int k = 0; k < 3; ++k) {
      box.center[k] = static_cast<float>(center[k]);
      for (int c = 0; c < 3; ++c) box.axes[k].direction[c] = static_cast<float>(axes(c, k));
      box.axes[k].half = static_cast<float>(half[k]);
    }
    box.radius = static_cast<float>(center.norm() + half.norm());
    return box;
  }

  void set(const Box& box) {
    set(box, [] {});
  }
  /// The same, while f changes what else read() answers for, by stores that release.
  template <typename F>
  void set(const Box& box, F&& f) {
    const std::uint32_t version = version_.load(std::memory_order_relaxed);
    version_.store(version + 1, std::memory_order_relaxed);
    f();
    std::array<std::uint64_t, kWords> words;
    static_assert(sizeof(Box) == sizeof(words));
    std::memcpy(words.data(), &box, sizeof(box));
    // A reader that sees one of these words also sees the odd version or a later one.
    for (std::size_t i = 0; i < kWords; ++i) words_[i].store(words[i], std::memory_order_release);
    version_.store(version + 2, std::memory_order_release);
  }

  /// What f says of the box; false when that was changed meanwhile. Other data that set() changes must be read by
  /// loads that acquire.
  template <typename F>
  bool read(F&& f) const {
    const std::uint32_t version = version_.load(std::memory_order_acquire);
    const bool answer = f(Reader(words_.data()));
    return answer && version % 2 == 0 && version_.load(std::memory_order_relaxed) == version;
  }

 private:
  static constexpr std::size_t kWords = 8;
  std::array<std::atomic<std::uint64_t>, kWords> words_{};
  std::atomic<std::uint32_t> version_{0};
};

}  // namespace bocst::tree
