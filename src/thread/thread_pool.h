// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "thread/fork.h"

namespace bocst::thread {

/// Threads that wait for work. One query at a time has them; another that comes meanwhile works alone, as does a child
/// after fork().
class ThreadPool {
 public:
  /// `threads` work, the calling one included, or as many as the system can start, but no more than `most`; 0: as many
  /// as the machine runs at once.
  explicit ThreadPool(unsigned threads, std::size_t most = 1024);
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  /// Calls work() here, and beside it on the other threads if they are free; returns when all have returned.
  /// work() throws nothing.
  void run(const std::function<void()>& work);

  /// Shares rows out: work(row) is called for each, in this order, by any thread, until it throws; a thread
  /// whose work says false takes no more rows. Of several exceptions the one of the least row is thrown.
  template <typename Work>
  void share(std::size_t rows, const Work& work) {
    std::atomic<std::size_t> next{0};
    std::exception_ptr failure;
    std::size_t failed = rows;
    std::mutex failing;
    const auto some = [&] {
      for (std::size_t row; (row = next++) < rows;) {
        try {
          if (!work(row)) break;
        } catch (...) {
          next = rows;
          const std::lock_guard<std::mutex> lock(failing);
          if (row < failed) failure = std::current_exception();
          failed = std::min(row, failed);
        }
      }
    };
    if (rows > 1) {
      run(std::ref(some));  // A function of this size would be copied to the heap.
    } else {
      some();
    }
    if (failure) std::rethrow_exception(failure);
  }

  unsigned threads() const { return static_cast<unsigned>(threads_.size()) + 1; }

 private:
  void wait();
  bool isForked() const { return forks_ != forks.load(); }

  std::mutex busy_;  // held by who has the threads
  std::mutex mutex_;
  NeverDestroyed<std::condition_variable> start_, end_;
  const std::function<void()>* work_ = nullptr;
  std::size_t round_ = 0, running_ = 0;
  bool stop_ = false;
  std::vector<std::thread> threads_;
  const unsigned forks_ = forks.load();
};

}  // namespace bocst::thread
