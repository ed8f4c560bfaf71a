// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "oracle/oracle.h"

namespace bocst::oracle {

/// The oracle on the calling thread: SIMD separating-axis tests find the candidates, clipped polygons the bounds.
class CpuOracle : public Oracle {
 public:
  OracleKind kind() const override { return OracleKind::kCpu; }
  std::string name() const override { return "cpu"; }
  void submit(std::vector<Expansion>& batch) override;
  void wait(std::vector<Expansion>&) override {}

  /// The processor's instruction set in use.
  static std::string device();
};

}  // namespace bocst::oracle
