// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <condition_variable>
#include <cstddef>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace bocst::scene {

/// Threads that wait for work. One query at a time has them; another that comes meanwhile works alone.
class Pool {
 public:
  /// `threads` work, the calling one included.
  explicit Pool(unsigned threads);
  ~Pool();
  Pool(const Pool&) = delete;
  Pool& operator=(const Pool&) = delete;

  /// Calls work() here, and beside it on the other threads if they are free; returns when all have returned.
  /// work() throws nothing.
  void run(const std::function<void()>& work);

  unsigned threads() const { return static_cast<unsigned>(threads_.size()) + 1; }

 private:
  void wait();

  std::mutex busy_;  // held by who has the threads
  std::mutex mutex_;
  std::condition_variable start_, end_;
  const std::function<void()>* work_ = nullptr;
  std::size_t round_ = 0, running_ = 0;
  bool stop_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace bocst::scene
