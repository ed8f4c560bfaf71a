// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <mutex>

namespace bocst::tree {

/// Readers pass together; a writer gets in between them, and is not starved by readers that keep coming.
/// A thread that needs several query locks takes them in address order, and gives back itself what it took.
///
/// Readers count themselves on cache lines of their own, so that threads that only read do not slow each other down.
/// Either a reader sees that somebody writes, or the writer sees the reader: that takes sequential consistency.
class ShardedLock {
 public:
  /// Where this thread counts itself; to be told to who takes several query locks.
  static std::size_t shard() {
    static std::atomic<std::size_t> threads{0};
    thread_local const std::size_t number = threads.fetch_add(1, std::memory_order_relaxed);
    return number % kShards;
  }

  void lock_shared() { lock_shared(shard()); }
  void unlock_shared() { unlock_shared(shard()); }
  void lock_shared(std::size_t shard) {
    std::atomic<int>& readers = shards_[shard].readers;
    readers.fetch_add(1);
    while (writing_.load()) {
      leave(readers);
      { const std::lock_guard<std::mutex> wait(turnstile_); }
      readers.fetch_add(1);
    }
  }
  void unlock_shared(std::size_t shard) { leave(shards_[shard].readers); }

  void lock() {
    turnstile_.lock();
    writing_.store(true);
    std::unique_lock<std::mutex> lock(leaving_);
    left_.wait(lock, [this] { return isEmpty(); });
  }
  bool try_lock() {
    if (!isEmpty() || !turnstile_.try_lock()) return false;
    writing_.store(true);
    if (isEmpty()) return true;
    unlock();
    return false;
  }
  void unlock() {
    writing_.store(false);
    turnstile_.unlock();
  }

 private:
  static constexpr std::size_t kShards = 8;

  struct alignas(64) Shard {
    std::atomic<int> readers{0};
  };

  void leave(std::atomic<int>& readers) {
    readers.fetch_sub(1);
    if (!writing_.load()) return;
    const std::lock_guard<std::mutex> lock(leaving_);
    left_.notify_all();
  }

  bool isEmpty() const {
    for (const Shard& shard : shards_) {
      if (shard.readers.load() != 0) return false;
    }
    return true;
  }

  std::array<Shard, kShards> shards_;
  std::atomic<bool> writing_{false};
  std::mutex turnstile_;  // held while somebody writes
  std::mutex leaving_;    // between the last reader that leaves and a writer that waits
  std::condition_variable left_;
};

}  // namespace bocst::tree
