// SPDX-License-Identifier: BSD-3-Clause
#include "scene/pool.h"

namespace bocst::scene {

Pool::Pool(unsigned threads) {
  if (threads == 0) threads = std::max(1u, std::thread::hardware_concurrency());
  for (unsigned i = 1; i < threads; ++i) threads_.emplace_back([this] { wait(); });
}

Pool::~Pool() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stop_ = true;
  }
  start_.notify_all();
  for (std::thread& t : threads_) t.join();
}

void Pool::run(const std::function<void()>& work) {
  const std::unique_lock<std::mutex> mine(busy_, std::try_to_lock);
  if (!mine.owns_lock() || threads_.empty()) return work();
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    work_ = &work;
    running_ = threads_.size();
    ++round_;
  }
  start_.notify_all();
  work();
  std::unique_lock<std::mutex> lock(mutex_);
  end_.wait(lock, [this] { return running_ == 0; });
}

void Pool::wait() {
  std::size_t round = 0;
  for (;;) {
    const std::function<void()>* work;
    {
      std::unique_lock<std::mutex> lock(mutex_);
      start_.wait(lock, [&] { return stop_ || round_ != round; });
      if (stop_) return;
      round = round_;
      work = work_;
    }
    (*work)();
    bool last;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      last = --running_ == 0;
    }
    if (last) end_.notify_one();
  }
}

}  // namespace bocst::scene
