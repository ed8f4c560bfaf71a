// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <mutex>

namespace bocst::tree {

/// Readers pass together; a writer gets in between them, and is not starved by readers that keep coming.
/// A thread that needs several gates takes them in address order, and gives back itself what it took.
///
/// Readers count themselves on cache lines of their own, so that threads that only read do not slow each other down.
/// Either a reader sees that somebody writes, or the writer sees the reader: that takes sequential consistency.
class Gate {
 public:
  /// Where this thread counts itself; to be told to who takes several gates.
  static std::size_t seat() {
    static std::atomic<std::size_t> threads{0};
    thread_local const std::size_t number = threads.fetch_add(1, std::memory_order_relaxed);
    return number % kSeats;
  }

  void lock_shared() { lock_shared(seat()); }
  void unlock_shared() { unlock_shared(seat()); }
  void lock_shared(std::size_t seat) {
    std::atomic<int>& readers = seats_[seat].readers;
    readers.fetch_add(1);
    while (writing_.load()) {
      leave(readers);
      { const std::lock_guard<std::mutex> wait(turnstile_); }
      readers.fetch_add(1);
    }
  }
  void unlock_shared(std::size_t seat) { leave(seats_[seat].readers); }

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
  static constexpr std::size_t kSeats = 8;

  struct alignas(64) Seat {
    std::atomic<int> readers{0};
  };

  void leave(std::atomic<int>& readers) {
    readers.fetch_sub(1);
    if (!writing_.load()) return;
    const std::lock_guard<std::mutex> lock(leaving_);
    left_.notify_all();
  }

  bool isEmpty() const {
    for (const Seat& seat : seats_) {
      if (seat.readers.load() != 0) return false;
    }
    return true;
  }

  std::array<Seat, kSeats> seats_;
  std::atomic<bool> writing_{false};
  std::mutex turnstile_;  // held while somebody writes
  std::mutex leaving_;    // between the last reader that leaves and a writer that waits
  std::condition_variable left_;
};

}  // namespace bocst::tree
