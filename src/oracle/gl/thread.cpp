// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/gl/thread.h"

#include <bocst/oracle.h>
#include <pthread.h>
#include <signal.h>
#include <unistd.h>

#include <exception>
#include <utility>

#include "log/log.h"

namespace bocst::oracle::gl {

Thread::Thread(const ContextRequest& request) : process_(getpid()) {
  // Signals are the application's: its handlers must not run on our thread.
  sigset_t all, before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  thread_ = std::make_unique<std::thread>([this, request] { loop(request); });
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
  {
    std::unique_lock<std::mutex> lock(mutex_);
    done_.wait(lock, [this] { return started_; });
  }
  if (failure_) {
    thread_->join();
    std::rethrow_exception(failure_);
  }
}

Thread::~Thread() {
  if (isForked()) {
    (void)thread_.release();  // the thread stayed in the parent: there is nothing to join
    return;
  }
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stop_ = true;
  }
  work_.notify_one();
  thread_->join();
}

void Thread::loop(const ContextRequest& request) {
  std::unique_ptr<Context> context;
  std::unique_lock<std::mutex> lock(mutex_, std::defer_lock);
  try {
    context = std::make_unique<Context>(request);
    info_ = context->info();
    context_ = context.get();
    lock.lock();
  } catch (...) {
    lock.lock();
    failure_ = std::current_exception();
  }
  started_ = true;
  done_.notify_all();
  if (failure_) return;
  for (;;) {
    work_.wait(lock, [this] { return stop_ || !jobs_.empty(); });
    if (jobs_.empty()) return;
    Job job = std::move(jobs_.front());
    jobs_.pop_front();
    lock.unlock();
    std::exception_ptr error;
    try {
      if (lost_ && job.done != nullptr) throw OracleError("the GPU context is lost");
      job.work();
    } catch (...) {
      error = std::current_exception();
    }
    job.work = nullptr;  // what it holds goes before anybody is told
    lock.lock();
    if (job.done != nullptr) {
      *job.error = error;
      *job.done = true;
      done_.notify_all();
    }
  }
}

void Thread::run(const std::function<void()>& job) {
  if (isLost()) throw OracleError("the GPU context is lost");
  bool done = false;
  std::exception_ptr error;
  std::unique_lock<std::mutex> lock(mutex_);
  jobs_.push_back({job, &done, &error});
  work_.notify_one();
  done_.wait(lock, [&done] { return done; });
  if (error) std::rethrow_exception(error);
}

void Thread::post(std::function<void()> job) {
  if (isForked()) return;
  const std::lock_guard<std::mutex> lock(mutex_);
  jobs_.push_back({std::move(job), nullptr, nullptr});
  work_.notify_one();
}

bool Thread::isForked() const { return getpid() != process_; }

bool Thread::isLost() const { return lost_.load(std::memory_order_relaxed) || isForked(); }

void Thread::lose(const std::string& why) {
  if (lost_.exchange(true)) return;
  log(LogLevel::kWarning, info_.renderer + " was lost (" + why + "); queries go on on the CPU");
}

void Thread::checkReset() {
  if (!context_->isLost()) return;
  lose("the driver reset its context");
  throw OracleError("the GPU context is lost");
}

}  // namespace bocst::oracle::gl
