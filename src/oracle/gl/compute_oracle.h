// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "oracle/cost_model.h"
#include "oracle/gl/arena.h"
#include "oracle/gl/compute_chain.h"
#include "oracle/gl/device_oracle.h"
#include "oracle/gl/pair_walker.h"

namespace bocst::oracle::gl {

/// The oracle in compute shaders (OpenGL 4.3): a chain of dispatches over (triangle, cell) pairs and one read-back a
/// batch. Triangle lists stay on the device; the ids of short ones come back with the answer.
class ComputeOracle : public DeviceOracle {
 public:
  /// @throws OracleError when a shader does not compile or the driver allows less than the chain needs.
  explicit ComputeOracle(const std::shared_ptr<Thread>& thread, const ComputeChain::Limits& limits = {});
  ~ComputeOracle() override;

  OracleKind kind() const override { return OracleKind::kCompute; }
  std::string name() const override { return "compute"; }
  bool needsHostMesh() const override { return false; }
  bool fetch(const DeviceResource& resource, ExpansionRequest::DeviceList list, std::uint32_t* ids) override;

  Cost lastCost() override;

  bool walksPairs(std::size_t pairs) override;
  std::shared_ptr<const DeviceResource> uploadNodes(std::vector<std::uint32_t>& words) override;
  void walkPairs(DeviceWalks& walks) override;
  void pairsTook(std::size_t pairs, double seconds, bool by_host) override { choice_.learn(pairs, seconds, by_host); }

  /// For tests: walk all pairs, also where that takes longer than the host.
  void setWalksAll(bool walks_all) { walks_all_ = walks_all; }
  /// How many pairs were walked.
  std::uint64_t walked() const { return walked_; }

 private:
  // With a value for everything that the caller left open.
  struct Completed {
    ComputeChain::Limits limits;
  };
  ComputeOracle(const Completed& completed, const std::shared_ptr<Thread>& thread);

  bool canWalk();
  PairWalker& walker();
  void answer(const std::vector<ExpansionRequest*>& requests, std::vector<Verdict>& verdicts) override;

  std::shared_ptr<Arena> arena_;
  std::unique_ptr<ComputeChain> chain_;
  const std::size_t walker_bytes_;
  std::unique_ptr<PairWalker> walker_;  // made by the first walk, in the thread of the context
  std::once_flag walks_tested_;
  bool can_walk_ = false;
  PairsChoice choice_;
  std::atomic<bool> walks_all_{false};
  std::atomic<std::uint64_t> walked_{0};
};

}  // namespace bocst::oracle::gl
