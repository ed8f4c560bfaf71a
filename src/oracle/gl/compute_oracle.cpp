// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/gl/compute_oracle.h"

#include "log/log.h"
#include "oracle/gl/self_test.h"

namespace bocst::oracle::gl {
namespace {

ComputeChain::Limits complete(ComputeChain::Limits limits, Thread& thread) {
  if (limits.bytes == 0) {
    GLint64 bytes = 0;
    thread.run([&] { glGetInteger64v(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &bytes); });
    limits.bytes = static_cast<std::size_t>(bytes);
  }
  // A GPU has more lanes than that; those of a software renderer are never idle.
  if (!limits.few_pairs) limits.few_pairs = thread.info().hardware ? 4096 : 0;
  return limits;
}

}  // namespace

ComputeOracle::ComputeOracle(const std::shared_ptr<Thread>& thread, const ComputeChain::Limits& limits)
    : ComputeOracle(Completed{complete(limits, *thread)}, thread) {}

ComputeOracle::ComputeOracle(const Completed& completed, const std::shared_ptr<Thread>& thread)
    : DeviceOracle(thread, true, completed.limits.bytes),
      walker_bytes_(completed.limits.bytes),
      choice_(thread->info().hardware) {
  const ComputeChain::Limits& limits = completed.limits;
  thread_->run([&] {
    arena_ = std::make_shared<Arena>(thread_, limits.bytes);
    chain_ = std::make_unique<ComputeChain>(limits, *arena_);
  });
}

ComputeOracle::~ComputeOracle() {
  finish();
  thread_->post([chain = chain_.release(), walker = walker_.release()] {
    delete chain;
    delete walker;
  });
}

void ComputeOracle::answer(const std::vector<ExpansionRequest*>& requests, std::vector<Verdict>& verdicts) {
  std::vector<std::size_t> order;
  std::vector<ExpansionRequest*> asked;
  for (std::size_t i = 0; i < requests.size(); ++i) {
    const ExpansionRequest& e = *requests[i];
    if (meshOf(e) == nullptr || !chain_->fits(e)) continue;
    order.push_back(i);
    asked.push_back(requests[i]);
  }
  for (std::size_t first = 0; first < asked.size();) {
    const std::size_t count = chain_->part(asked, first);
    try {
      chain_->answer({asked.begin() + static_cast<std::ptrdiff_t>(first),
                      asked.begin() + static_cast<std::ptrdiff_t>(first + count)},
                     *thread_);
      for (std::size_t i = first; i < first + count; ++i) verdicts[order[i]].kind = Verdict::Kind::kAnswer;
    } catch (const std::exception& e) {
      // No memory, or no context any more: what has no answer yet is the CPU's.
      if (thread_->isLost()) return;
      reportFailure("a batch", e);
    }
    first += count;
  }
}

bool ComputeOracle::fetch(const DeviceResource&, ExpansionRequest::DeviceList list, std::uint32_t* ids) {
  try {
    thread_->run([&] { arena_->read(list.begin, list.count, ids); });
    return true;
  } catch (const std::exception& e) {
    reportFailure("a triangle list that only the device has", e);
    return false;
  }
}

bool ComputeOracle::walksPairs(std::size_t pairs) {
  return !thread_->isLost() && (walks_all_ || choice_.takesDevice(pairs)) && canWalk();
}

// Tested when a walk is first asked for, as most programs ask for none.
bool ComputeOracle::canWalk() {
  std::call_once(walks_tested_, [this] {
    std::string wrong;
    try {
      wrong = selfTestOfWalks(*this);
    } catch (const OracleError& e) {
      wrong = e.what();
    }
    can_walk_ = wrong.empty();
    if (!can_walk_ && !thread_->isLost()) {
      log(LogLevel::kWarning, "oracle compute: walks over pairs of trees are left to the CPU (" + wrong + ")");
    }
  });
  return can_walk_;
}

PairWalker& ComputeOracle::walker() {
  if (walker_ == nullptr) walker_ = std::make_unique<PairWalker>(*arena_, walker_bytes_);
  return *walker_;
}

std::shared_ptr<const DeviceResource> ComputeOracle::uploadNodes(std::vector<std::uint32_t>& words) {
  std::shared_ptr<const DeviceResource> nodes;
  try {
    thread_->run([&] { nodes = walker().upload(words); });
  } catch (const std::exception& e) {
    reportFailure("a table of nodes", e);
  }
  return nodes;
}

void ComputeOracle::walkPairs(DeviceWalks& walks) {
  try {
    thread_->run([&] { walker().walk(walks, *thread_); });
    walked_ += walks.pairs.size();
  } catch (const std::exception& e) {
    reportFailure("a walk over pairs", e);
    Oracle::walkPairs(walks);
  }
}

Oracle::Cost ComputeOracle::lastCost() {
  Cost cost;
  thread_->run([&] { cost = chain_->cost(); });
  return cost;
}

}  // namespace bocst::oracle::gl
