// SPDX-License-Identifier: BSD-3-Clause
#include "thread/thread_pool.h"

#include <utility>

#include "thread/start.h"

namespace bocst::thread {

ThreadPool::ThreadPool(unsigned threads, std::size_t most) {
  if (threads == 0) threads = std::max(1u, std::thread::hardware_concurrency());
  const std::size_t all = std::min<std::size_t>(threads, most);
  try {
    if (all > 1) threads_.reserve(all - 1);  // a thread that has started must have its place
    while (threads_.size() + 1 < all) threads_.push_back(startWithoutSignals([this] { wait(); }));
  } catch (const std::exception&) {
    // The system has no more, or no memory for them.
  }
}

ThreadPool::~ThreadPool() {
  if (isForked()) {
    // They stayed in the parent, so they can neither be joined nor be destroyed.
    new std::vector<std::thread>(std::move(threads_));
    return;
  }
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stop_ = true;
  }
  start_->notify_all();
  for (std::thread& t : threads_) t.join();
}

void ThreadPool::run(const std::function<void()>& work) {
  if (isForked()) return work();
  const std::unique_lock<std::mutex> mine(busy_, std::try_to_lock);
  if (!mine.owns_lock() || threads_.empty()) return work();
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    work_ = &work;
    running_ = threads_.size();
    ++round_;
  }
  start_->notify_all();
  work();
  std::unique_lock<std::mutex> lock(mutex_);
  end_->wait(lock, [this] { return running_ == 0; });
}

void ThreadPool::wait() {
  std::size_t round = 0;
  for (;;) {
    const std::function<void()>* work;
    {
      std::unique_lock<std::mutex> lock(mutex_);
      start_->wait(lock, [&] { return stop_ || round_ != round; });
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
    if (last) end_->notify_one();
  }
}

}  // namespace bocst::thread
