// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <list>
#include <memory>
#include <mutex>
#include <vector>

#include "oracle/gl/device_mesh.h"
#include "oracle/gl/thread.h"
#include "oracle/oracle.h"
#include "thread/fork.h"

namespace bocst::oracle::gl {

/// What the oracles on a device have in common: batches of threads that wait at the same time are answered together,
/// in the thread of the context; what the device cannot do (no memory, too large a request, context lost, a child
/// after fork()) is answered on the CPU, in the thread that waits.
class DeviceOracle : public Oracle {
 public:
  void submit(std::vector<ExpansionRequest>& batch) final;
  void wait(std::vector<ExpansionRequest>& batch) final;
  std::shared_ptr<const DeviceResource> makeResident(const Surface& surface) final;
  std::shared_ptr<const DeviceResource> store(const std::vector<std::uint32_t>& words) final;
  void recall(const DeviceResource& stored, std::vector<std::uint32_t>& words) final;

  Thread& thread() { return *thread_; }

  /// How many requests the CPU had to answer alone.
  std::uint64_t leftToCpu() const { return left_to_cpu_.load(std::memory_order_relaxed); }

 protected:
  /// What the device answers to one request.
  struct Verdict {
    enum class Kind { kNone, kCandidates, kAnswer } kind = Kind::kNone;
    std::uint8_t candidates = 0xff;  ///< kCandidates: octants that may be grey; the CPU does the rest.
  };

  /// exact: device meshes have their vertices in double, too.
  /// Meshes take at most mesh_bytes of the device together.
  DeviceOracle(std::shared_ptr<Thread> thread, bool exact, std::size_t mesh_bytes)
      : thread_(std::move(thread)), meshes_(thread_, exact, mesh_bytes) {}

  /// Ends what is still going on; derived classes do so before anything else goes.
  void finish();

  /// In the thread of the context; must not throw. Answers as much as it can.
  virtual void answer(const std::vector<ExpansionRequest*>& requests, std::vector<Verdict>& verdicts) = 0;

  /// Reports the first failure of this oracle that is not the loss of its device, which the thread reports itself.
  /// `what`: what the CPU does in its stead.
  void reportFailure(const char* what, const std::exception& why) noexcept;

  const std::shared_ptr<Thread> thread_;

 private:
  struct Ticket {
    std::vector<ExpansionRequest>* batch;
    bool taken = false, done = false;  // done: only the thread that waits still uses it
    std::vector<Verdict> verdicts = {};
  };

  void flush();
  void answerAll();

  DeviceMeshes meshes_;
  std::atomic<std::uint64_t> left_to_cpu_{0};
  std::atomic<bool> reported_{false};
  std::mutex mutex_;  // of what follows
  thread::NeverDestroyed<std::condition_variable> answered_;
  std::list<Ticket> tickets_;
  bool flush_is_due_ = false;
};

}  // namespace bocst::oracle::gl
