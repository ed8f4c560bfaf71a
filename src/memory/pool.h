// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <vector>

namespace bocst::memory {

/// An append-only array whose elements never move, so readers need no lock while one writer appends.
/// Threads: operator[] for indices that were published to the caller by a release/acquire pair, from any thread;
/// append() from one thread at a time; clear() when nobody else looks.
template <typename T, int kChunkBits>
class Pool {
 public:
  static constexpr std::size_t kMost = std::size_t{1} << 30;  ///< a ChildRef has thirty bits.
  static constexpr std::size_t kChunk = std::size_t{1} << kChunkBits;
  /// It grows by the 16th part, but by few enough bytes to keep one append() fast; while it is small, to twice its
  /// size.
  static constexpr std::size_t kShare = 16, kLargestShare = 1 << 16, kSmall = 1 << 12;

  T& operator[](std::uint32_t i) { return chunk(i)[i & (kChunk - 1)]; }
  const T& operator[](std::uint32_t i) const { return chunk(i)[i & (kChunk - 1)]; }

  std::uint32_t size() const { return size_; }

  /// `count` consecutive default-initialised elements, contiguous in memory; returns the index of the first.
  std::uint32_t append(std::size_t count) {
    // Free elements are in the last chunks; a run that does not fit there starts with a new chunk.
    const bool fits = count <= capacity_ - size_;
    if ((fits ? size_ : capacity_) + count > kMost) {
      throw std::length_error("bocst: a tree of more than 2^30 nodes or list entries");
    }
    if (!fits) {
      const std::size_t share =
          std::max(std::min(capacity_ / kShare, kLargestShare / sizeof(T)), std::min(capacity_, kSmall / sizeof(T)));
      size_ = static_cast<std::uint32_t>(capacity_);
      grow((std::max(count, share) + kChunk - 1) / kChunk);
    }
    const std::uint32_t first = size_;
    size_ += static_cast<std::uint32_t>(count);
    return first;
  }

  /// Heap bytes.
  std::size_t bytes() const {
    std::size_t directories = 0;
    for (std::size_t n : directory_sizes_) directories += n * sizeof(T*);
    return capacity_ * sizeof(T) + directories;
  }

  void clear() {
    size_ = 0;
    capacity_ = 0;
    directory_.store(nullptr, std::memory_order_relaxed);
    directories_.clear();
    directory_sizes_.clear();
    chunks_.clear();
  }

  void swap(Pool& other) {
    std::swap(size_, other.size_);
    std::swap(capacity_, other.capacity_);
    T** mine = directory_.load(std::memory_order_relaxed);
    directory_.store(other.directory_.load(std::memory_order_relaxed), std::memory_order_relaxed);
    other.directory_.store(mine, std::memory_order_relaxed);
    directories_.swap(other.directories_);
    directory_sizes_.swap(other.directory_sizes_);
    chunks_.swap(other.chunks_);
  }

 private:
  T* chunk(std::uint32_t i) const { return directory_.load(std::memory_order_acquire)[i >> kChunkBits]; }

  void grow(std::size_t chunks) {
    const std::size_t used = capacity_ >> kChunkBits;
    // Reserve first: an exception after an allocation would lose the chunk.
    chunks_.reserve(chunks_.size() + 1);
    directories_.reserve(directories_.size() + 1);
    directory_sizes_.reserve(directory_sizes_.size() + 1);
    if (directory_sizes_.empty() || used + chunks > directory_sizes_.back()) {
      // The old directory stays: a reader may be looking at it.
      const std::size_t size = std::max<std::size_t>(8, 2 * (used + chunks));
      std::unique_ptr<T*[]> larger(new T*[size]);
      for (std::size_t k = 0; k < used; ++k) larger[k] = directories_.back()[k];
      directories_.push_back(std::move(larger));
      directory_sizes_.push_back(size);
    }
    chunks_.emplace_back(new T[chunks << kChunkBits]);
    for (std::size_t k = 0; k < chunks; ++k) directories_.back()[used + k] = chunks_.back().get() + (k << kChunkBits);
    directory_.store(directories_.back().get(), std::memory_order_release);
    capacity_ += chunks << kChunkBits;
  }

  std::uint32_t size_ = 0;
  std::size_t capacity_ = 0;
  std::atomic<T**> directory_{nullptr};
  std::vector<std::unique_ptr<T*[]>> directories_;
  std::vector<std::size_t> directory_sizes_;
  std::vector<std::unique_ptr<T[]>> chunks_;
};

}  // namespace bocst::memory
