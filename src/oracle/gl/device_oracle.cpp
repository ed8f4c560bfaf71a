// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/gl/device_oracle.h"

#include <algorithm>
#include <new>
#include <string>

#include "log/log.h"
#include "oracle/cpu/cpu_oracle.h"

namespace bocst::oracle::gl {

void DeviceOracle::submit(std::vector<ExpansionRequest>& batch) {
  if (batch.empty() || thread_->isLost()) return;
  const std::lock_guard<std::mutex> lock(mutex_);
  tickets_.push_back({&batch});
  if (flush_is_due_) return;
  try {
    thread_->post([this] { flush(); });
    flush_is_due_ = true;
  } catch (...) {
    tickets_.pop_back();  // nobody would come to answer it
    throw;
  }
}

void DeviceOracle::flush() {
  try {
    answerAll();
  } catch (const std::exception& e) {
    reportFailure("a batch", e);  // no memory
  }
  // Whatever went wrong: wake all threads that wait. Requests without a verdict go to the CPU.
  const std::lock_guard<std::mutex> lock(mutex_);
  for (Ticket& t : tickets_) t.done = t.done || t.taken;
  answered_->notify_all();
}

void DeviceOracle::answerAll() {
  std::vector<Ticket*> taken;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    flush_is_due_ = false;
    for (Ticket& t : tickets_) t.taken = true;
    for (Ticket& t : tickets_) {
      if (!t.done) taken.push_back(&t);
    }
  }
  std::vector<ExpansionRequest*> requests;
  for (const Ticket* t : taken) {
    for (ExpansionRequest& e : *t->batch) requests.push_back(&e);
  }
  std::vector<Verdict> verdicts(requests.size());
  if (!thread_->isLost()) answer(requests, verdicts);
  const std::lock_guard<std::mutex> lock(mutex_);
  auto next = verdicts.begin();
  for (Ticket* t : taken) {
    const auto end = next + static_cast<std::ptrdiff_t>(t->batch->size());
    t->verdicts.assign(next, end);
    next = end;
  }
}

void DeviceOracle::wait(std::vector<ExpansionRequest>& batch) {
  std::vector<Verdict> verdicts;
  if (!thread_->isForked()) {
    std::unique_lock<std::mutex> lock(mutex_);
    const auto ticket =
        std::find_if(tickets_.begin(), tickets_.end(), [&](const Ticket& t) { return t.batch == &batch; });
    if (ticket != tickets_.end()) {
      answered_->wait(lock, [&] { return ticket->done; });
      verdicts = std::move(ticket->verdicts);
      tickets_.erase(ticket);
    }
  }
  verdicts.resize(batch.size());
  for (std::size_t i = 0; i < batch.size(); ++i) {
    if (verdicts[i].kind == Verdict::Kind::kAnswer) continue;
    if (verdicts[i].kind == Verdict::Kind::kNone) ++left_to_cpu_;
    answerOnCpu(batch[i], verdicts[i].candidates);
  }
}

std::shared_ptr<const DeviceResource> DeviceOracle::makeResident(const Surface& surface) {
  try {
    return meshes_.makeResident(surface);
  } catch (const std::exception& e) {
    reportFailure("a mesh", e);
    return nullptr;
  }
}

std::shared_ptr<const DeviceResource> DeviceOracle::store(const std::vector<std::uint32_t>& words) {
  try {
    return meshes_.store(words);
  } catch (const std::exception& e) {
    reportFailure("a mesh", e);
    return nullptr;
  }
}

void DeviceOracle::recall(const DeviceResource& stored, std::vector<std::uint32_t>& words) {
  try {
    meshes_.recall(stored, words);
  } catch (const OracleError& e) {
    throw OracleError(std::string("the GPU that had the only copy of a mesh lost it: ") + e.what());
  }
}

void DeviceOracle::reportFailure(const char* what, const std::exception& why) noexcept {
  if (thread_->isLost() || reported_.exchange(true)) return;
  try {
    log(LogLevel::kWarning, "oracle " + name() + ": " + what + " is left to the CPU (" + why.what() +
                                "); further failures of this device are not reported");
  } catch (const std::bad_alloc&) {
    // The answer matters more than the report.
  }
}

void DeviceOracle::finish() {
  try {
    if (!thread_->isLost()) thread_->run([] {});  // a flush may still be on its way out of this object
  } catch (const OracleError&) {
    // Lost meanwhile: who waited was told at the end of the flush, and destructors must not throw.
  }
}

}  // namespace bocst::oracle::gl
