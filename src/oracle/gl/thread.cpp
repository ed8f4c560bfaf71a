// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/gl/thread.h"

#include <bocst/oracle.h>
#include <epoxy/gl.h>

#include <algorithm>
#include <exception>
#include <string>
#include <system_error>
#include <utility>

#include "log/log.h"
#include "thread/start.h"

namespace bocst::oracle::gl {

Thread::Thread(const ContextRequest& request) : wait_limit_(request.wait_limit) {
  try {
    thread_ = std::make_unique<std::thread>(thread::startWithoutSignals([this, request] { loop(request); }));
  } catch (const std::system_error& e) {
    throw OracleError(std::string("bocst: no thread for OpenGL: ") + e.what());
  }
  {
    std::unique_lock<std::mutex> lock(mutex_);
    done_->wait(lock, [this] { return started_; });
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
  work_->notify_one();
  thread_->join();
}

void Thread::loop(const ContextRequest& request) {
  std::unique_ptr<Context> context;
  std::unique_lock<std::mutex> lock(mutex_, std::defer_lock);
  try {
    context = std::make_unique<Context>(request);
    info_ = context->info();
    if (wait_limit_.count() == 0) wait_limit_ = info_.hardware ? std::chrono::seconds(10) : std::chrono::minutes(10);
    context_ = context.get();
    lock.lock();
  } catch (...) {
    lock.lock();
    failure_ = std::current_exception();
  }
  started_ = true;
  done_->notify_all();
  if (failure_) return;
  for (;;) {
    work_->wait(lock, [this] { return stop_ || !jobs_.empty(); });
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
      done_->notify_all();
    }
  }
}

void Thread::run(const std::function<void()>& job) {
  if (isLost()) throw OracleError("the GPU context is lost");
  bool done = false;
  std::exception_ptr error;
  std::unique_lock<std::mutex> lock(mutex_);
  jobs_.push_back({job, &done, &error});
  work_->notify_one();
  done_->wait(lock, [&done] { return done; });
  if (error) std::rethrow_exception(error);
}

void Thread::post(std::function<void()> job) {
  if (isForked()) return;
  const std::lock_guard<std::mutex> lock(mutex_);
  jobs_.push_back({std::move(job), nullptr, nullptr});
  work_->notify_one();
}

bool Thread::isForked() const { return forks_ != thread::forks.load(); }

bool Thread::isLost() const { return lost_.load(std::memory_order_relaxed) || isForked(); }

void Thread::lose(const std::string& why) {
  if (lost_.exchange(true)) return;
  log(LogLevel::kWarning, info_.renderer + " was lost (" + why + "); queries go on on the CPU");
}

void Thread::fail(const char* what) {
  distrusted_ = true;
  lose(std::string("it answered wrongly: ") + what);
  throw OracleError("the GPU context is lost");
}

void Thread::awaitDevice() {
  const auto begin = std::chrono::steady_clock::now();
  const GLsync fence = glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0);
  if (fence == nullptr) throw OracleError("the driver makes no fence");
  // In slices, as drivers may have a limit of their own.
  constexpr GLuint64 kSlice = 500'000'000;
  GLenum state = GL_TIMEOUT_EXPIRED;
  while (state == GL_TIMEOUT_EXPIRED) {
    const std::chrono::nanoseconds left = begin + wait_limit_ - std::chrono::steady_clock::now();
    if (left.count() <= 0) break;
    state = glClientWaitSync(fence, GL_SYNC_FLUSH_COMMANDS_BIT, std::min(kSlice, static_cast<GLuint64>(left.count())));
  }
  glDeleteSync(fence);
  checkReset();
  if (state == GL_ALREADY_SIGNALED || state == GL_CONDITION_SATISFIED) return;
  lose(state == GL_TIMEOUT_EXPIRED ? "it gave no answer for " + std::to_string(wait_limit_.count()) + " ms"
                                   : "the driver cannot wait for it");
  throw OracleError("the GPU context is lost");
}

void Thread::checkReset() {
  if (!context_->isLost()) return;
  lose("the driver reset its context");
  throw OracleError("the GPU context is lost");
}

}  // namespace bocst::oracle::gl
