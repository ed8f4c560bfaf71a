// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "egl/context.h"
#include "thread/fork.h"

namespace bocst::oracle::gl {

/// The one thread that owns a context and does all work with it, in the order in which it came.
///
/// In a child after fork() there is no such thread: the child's copy counts as lost and touches nothing.
class Thread {
 public:
  /// @throws OracleError as Context does.
  explicit Thread(const ContextRequest& request);
  /// Does what is still in the queue first.
  ~Thread();
  Thread(const Thread&) = delete;
  Thread& operator=(const Thread&) = delete;

  const ContextInfo& info() const { return info_; }

  /// Does the job and waits for it; what it throws arrives here. @throws OracleError when the context is lost.
  void run(const std::function<void()>& job);

  /// Does the job some time, also when the context is lost by then (OpenGL then ignores it). It must not throw. In a
  /// child after fork(), where nobody would do it, it is dropped.
  void post(std::function<void()> job);

  /// True for a child's copy, which must not ask for locks that the parent's thread may have held.
  bool isForked() const;

  /// True if there is no context to work with any more.
  bool isLost() const;

  /// Gives the context up, and reports it once (bocst::setLogger).
  void lose(const std::string& why);

  /// In a job: unless it `holds`, the device answered wrongly: gives the context up, and nobody should ask the device
  /// again. (A driver that leaves out work in silence would make surface vanish.) @throws OracleError then.
  void require(bool holds, const char* what) {
    if (!holds) fail(what);
  }
  bool isDistrusted() const { return distrusted_.load(std::memory_order_relaxed); }

  /// In a job: looks whether the driver has lost the context. @throws OracleError if so.
  void checkReset();

  /// In a job: waits until the device has done all that it was told. @throws OracleError, with the context lost, when
  /// that takes longer than ContextRequest::wait_limit.
  void awaitDevice();

 private:
  [[noreturn]] void fail(const char* what);

  struct Job {
    std::function<void()> work;
    bool* done;  // null: nobody waits
    std::exception_ptr* error;
  };

  void loop(const ContextRequest& request);

  ContextInfo info_;
  const unsigned forks_ = thread::forks.load();
  std::chrono::milliseconds wait_limit_;
  std::atomic<bool> lost_{false}, distrusted_{false};
  std::mutex mutex_;
  thread::NeverDestroyed<std::condition_variable> work_, done_;
  std::deque<Job> jobs_;
  bool stop_ = false, started_ = false;
  std::exception_ptr failure_;
  const Context* context_ = nullptr;
  std::unique_ptr<std::thread> thread_;
};

}  // namespace bocst::oracle::gl
