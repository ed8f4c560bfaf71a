// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "egl/handles.h"
#include "oracle/gl/device_oracle.h"

namespace bocst::oracle::gl {

class OcclusionQueries;

/// The paper's Algorithm 1 (4.1, 4.2) as an oracle (OpenGL 3.3): an occlusion query asks whether any triangle of the
/// parent's subset is seen in an octant. Many queries are on their way before any result is read. Lists and bounds of
/// the octants that pass are the CPU's work.
///
/// - conservative: a geometry shader tests each triangle for the octant and emits one point; nothing is lost.
/// - sampled: the paper's own form, three axis views of `viewport` pixels a side with an early end. If the surface
///   passes an octant without covering a pixel's centre in any view, the octant is lost: for comparison only.
class OcclusionOracle : public DeviceOracle {
 public:
  enum class Form { kConservative, kSampled };

  /// viewport: pixels a side of the sampled form's views. @throws OracleError when a shader does not compile.
  OcclusionOracle(std::shared_ptr<Thread> thread, Form form, int viewport);
  ~OcclusionOracle() override;

  OracleKind kind() const override { return form_ == Form::kSampled ? OracleKind::kSampled : OracleKind::kOcclusion; }

  /// What the driver gets.
  static std::vector<Program::Stage> sources(Form form);

  /// Which octants the device sees, before the CPU decides the rest; the surfaces must be resident. @throws OracleError
  std::vector<std::uint8_t> candidates(const std::vector<ExpansionRequest*>& requests);

  std::uint64_t queries() const override { return asked_; }

  std::string name() const override { return form_ == Form::kSampled ? "sampled" : "occlusion"; }

 private:
  void answer(const std::vector<ExpansionRequest*>& requests, std::vector<Verdict>& verdicts) override;

  const Form form_;
  std::atomic<std::uint64_t> asked_{0};
  std::unique_ptr<OcclusionQueries> queries_;
};

}  // namespace bocst::oracle::gl
