// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "oracle/oracle.h"

namespace bocst::oracle {

/// Answers one question on the calling thread. Octants that are not among the candidates are white.
void expand(ExpansionRequest& e, std::uint8_t candidates = 0xff);

/// The same for a question that another oracle leaves to the CPU: a list that only that one keeps is looked for in all
/// of the mesh. @throws OracleError when the mesh is not here any more.
void answerOnCpu(ExpansionRequest& e, std::uint8_t candidates = 0xff);

/// The oracle on the calling thread: SIMD separating-axis tests find the candidates, clipped polygons the bounds.
class CpuOracle : public Oracle {
 public:
  OracleKind kind() const override { return OracleKind::kCpu; }
  std::string name() const override { return "cpu"; }
  void submit(std::vector<ExpansionRequest>& batch) override;
  void wait(std::vector<ExpansionRequest>&) override {}

  /// The processor's instruction set in use.
  static std::string device();
};

}  // namespace bocst::oracle
