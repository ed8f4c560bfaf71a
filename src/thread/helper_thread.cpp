// SPDX-License-Identifier: BSD-3-Clause
#include "thread/helper_thread.h"

#include <pthread.h>

#include <condition_variable>
#include <list>
#include <mutex>
#include <new>
#include <thread>

#include "thread/start.h"

namespace bocst::thread {
namespace {

class HelperThread {
 public:
  void add(std::function<void()> job) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (!thread_.joinable()) thread_ = startWithoutSignals([this] { work(); });
      jobs_.push_back(std::move(job));
    }
    wake_.notify_one();
  }

  void stop() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (!thread_.joinable()) return;
      stopped_ = true;
      jobs_.clear();
    }
    wake_.notify_one();
    thread_.join();
  }

 private:
  void work() {
    for (;;) {
      std::function<void()> job;
      {
        std::unique_lock<std::mutex> lock(mutex_);
        wake_.wait(lock, [this] { return stopped_ || !jobs_.empty(); });
        if (stopped_) return;
        job = std::move(jobs_.front());
        jobs_.pop_front();
      }
      job();
    }
  }

  std::mutex mutex_;
  std::condition_variable wake_;
  std::list<std::function<void()>> jobs_;
  bool stopped_ = false;
  std::thread thread_;
};

HelperThread& helperThread() {
  // Never destroyed: a child makes it anew in the same place.
  alignas(HelperThread) static unsigned char storage[sizeof(HelperThread)];
  static HelperThread* const helper = [] {
    auto* const made = new (storage) HelperThread;
    pthread_atfork(nullptr, nullptr, [] { new (storage) HelperThread; });
    return made;
  }();
  return *helper;
}

struct StopAtExit {
  ~StopAtExit() { helperThread().stop(); }
};

}  // namespace

void runInHelperThread(std::function<void()> job) {
  HelperThread& helper = helperThread();
  static const StopAtExit stop_at_exit;
  helper.add(std::move(job));
}

}  // namespace bocst::thread
