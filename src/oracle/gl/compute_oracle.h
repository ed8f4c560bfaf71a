// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "oracle/gl/arena.h"
#include "oracle/gl/compute_chain.h"
#include "oracle/gl/device_oracle.h"

namespace bocst::oracle::gl {

/// The oracle in compute shaders (OpenGL 4.3): a chain of dispatches over (triangle, cell) pairs and one read-back a
/// batch. Triangle lists stay on the device; the ids of short ones come back with the answer.
class ComputeOracle : public DeviceOracle {
 public:
  /// @throws OracleError when a shader does not compile or the driver allows less than the chain needs.
  explicit ComputeOracle(const std::shared_ptr<Thread>& thread, ComputeChain::Limits limits = {});
  ~ComputeOracle() override;

  OracleKind kind() const override { return OracleKind::kCompute; }
  std::string name() const override { return "compute"; }
  bool needsHostMesh() const override { return false; }
  bool fetch(const DeviceResource& resource, ExpansionRequest::DeviceList list, std::uint32_t* ids) override;

  Cost lastCost() override;

 private:
  void answer(const std::vector<ExpansionRequest*>& requests, std::vector<Verdict>& verdicts) override;

  std::shared_ptr<Arena> arena_;
  std::unique_ptr<ComputeChain> chain_;
};

}  // namespace bocst::oracle::gl
