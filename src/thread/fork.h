// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <mutex>
#include <new>

// After fork() a child has only the thread that called it. A lock that another thread of the parent held is never given
// back there, and what that thread was changing stays half changed.

namespace bocst::thread {

/// How often this process, or an ancestor of it, was forked from another.
extern std::atomic<unsigned> forks;

/// Held while the first thread of a child that comes to a lock finds out who held it.
std::mutex& forkMutex();

[[noreturn]] void throwForked();

/// A value whose destructor never runs. In a forked child, the destructor of a condition variable would wait for
/// threads that exist only in the parent.
template <typename T>
class NeverDestroyed {
 public:
  NeverDestroyed() { new (&value_) T; }
  ~NeverDestroyed() {}
  NeverDestroyed(const NeverDestroyed&) = delete;
  NeverDestroyed& operator=(const NeverDestroyed&) = delete;
  T* operator->() { return &value_; }

 private:
  union {
    T value_;
  };
};

/// A mutex that in a child refuses to wait for a thread that stayed in the parent.
class ForkAwareMutex {
 public:
  /// @throws std::runtime_error when a thread of the parent held it at the fork.
  void lock() {
    if (!isAdopted()) throwForked();
    mutex_.lock();
  }
  bool try_lock() { return isAdopted() && mutex_.try_lock(); }
  void unlock() { mutex_.unlock(); }

 private:
  bool isAdopted() { return forks_.load() == forks.load(std::memory_order_relaxed) || adopt(); }
  bool adopt();

  std::mutex mutex_;
  std::atomic<unsigned> forks_{forks.load()};
};

}  // namespace bocst::thread
