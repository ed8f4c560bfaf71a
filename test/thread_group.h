// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <thread>
#include <vector>

namespace bocst::test {

/// Threads that each call f(number of the thread). join() and the destructor wait until all have returned.
class ThreadGroup {
 public:
  template <typename F>
  ThreadGroup(std::size_t count, const F& f) {
    for (std::size_t i = 0; i < count; ++i) threads_.emplace_back(f, i);
  }
  ~ThreadGroup() { join(); }
  ThreadGroup(const ThreadGroup&) = delete;
  ThreadGroup& operator=(const ThreadGroup&) = delete;

  void join() {
    for (std::thread& t : threads_) t.join();
    threads_.clear();
  }

 private:
  std::vector<std::thread> threads_;
};

}  // namespace bocst::test
