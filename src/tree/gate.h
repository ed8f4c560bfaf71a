// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <mutex>
#include <shared_mutex>

namespace bocst::tree {

/// Readers pass together; a writer gets in between them, and is not starved by readers that keep coming.
/// A thread that needs several gates takes them in address order.
class Gate {
 public:
  void lock_shared() {
    if (writers_.load(std::memory_order_acquire) != 0) {
      const std::lock_guard<std::mutex> wait(turnstile_);
    }
    gate_.lock_shared();
  }
  void unlock_shared() { gate_.unlock_shared(); }

  void lock() {
    writers_.fetch_add(1, std::memory_order_acq_rel);
    turnstile_.lock();
    gate_.lock();
  }
  bool try_lock() {
    if (!turnstile_.try_lock()) return false;
    if (!gate_.try_lock()) {
      turnstile_.unlock();
      return false;
    }
    writers_.fetch_add(1, std::memory_order_acq_rel);
    return true;
  }
  void unlock() {
    writers_.fetch_sub(1, std::memory_order_acq_rel);
    gate_.unlock();
    turnstile_.unlock();
  }

 private:
  std::atomic<int> writers_{0};
  std::mutex turnstile_;
  std::shared_mutex gate_;
};

}  // namespace bocst::tree
