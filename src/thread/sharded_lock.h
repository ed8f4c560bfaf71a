// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <mutex>

#include "thread/fork.h"

namespace bocst::thread {

/// Readers pass together; a writer gets in between them, and is not starved by readers that keep coming.
/// A thread that needs several query locks takes them in address order, and gives back itself what it took.
///
/// Readers count themselves on cache lines of their own, so that threads that only read do not slow each other down.
/// Either a reader sees that somebody writes, or the writer sees the reader: that takes sequential consistency.
///
/// In a child after fork() the threads that stayed in the parent are not waited for: what cannot be had without them
/// throws std::runtime_error.
class ShardedLock {
 public:
  /// The index of this thread's counter. A caller that takes several query locks reads it once and passes it on.
  static std::size_t shard() {
    static std::atomic<std::size_t> threads{0};
    thread_local const std::size_t number = threads.fetch_add(1, std::memory_order_relaxed);
    return number % kShards;
  }

  void lock_shared() { lock_shared(shard()); }
  void unlock_shared() { unlock_shared(shard()); }
  void lock_shared(std::size_t shard) {
    if (isForked() && !adopt()) throwForked();
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
    if ((isForked() && !adopt()) || readers_stayed_) throwForked();
    turnstile_.lock();
    writing_.store(true);
    std::unique_lock<std::mutex> lock(leaving_);
    left_->wait(lock, [this] { return isEmpty(); });
  }
  bool try_lock() {
    if ((isForked() && !adopt()) || readers_stayed_) return false;
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
    left_->notify_all();
  }

  bool isForked() const { return forks_.load() != forks.load(std::memory_order_relaxed); }

  // False when a thread that stayed in the parent was writing, or about to. Readers that stayed there do not count any
  // more; but what they may have left half grown is never to be changed.
  bool adopt() {
    const std::lock_guard<std::mutex> lock(forkMutex());
    if (!isForked()) return true;
    if (writing_ || !turnstile_.try_lock()) return false;
    turnstile_.unlock();
    if (!leaving_.try_lock()) return false;
    leaving_.unlock();
    readers_stayed_ = readers_stayed_ || !isEmpty();
    for (Shard& shard : shards_) shard.readers = 0;
    forks_ = forks.load();
    return true;
  }

  bool isEmpty() const {
    for (const Shard& shard : shards_) {
      if (shard.readers.load() != 0) return false;
    }
    return true;
  }

  std::array<Shard, kShards> shards_;
  std::atomic<bool> writing_{false};
  std::atomic<unsigned> forks_{forks.load()};
  std::atomic<bool> readers_stayed_{false};  // in the parent, at a fork
  std::mutex turnstile_;                     // held while somebody writes
  std::mutex leaving_;                       // between the last reader that leaves and a writer that waits
  NeverDestroyed<std::condition_variable> left_;
};

}  // namespace bocst::thread
