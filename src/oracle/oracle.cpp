// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/oracle.h"

#include "egl/oracle_selection.h"
#include "oracle/cpu/cpu_oracle.h"
#include "oracle/gl/devices.h"

namespace bocst::oracle {
namespace {

const char* nameOf(OracleKind kind) {
  switch (kind) {
    case OracleKind::kOcclusion:
      return "occlusion";
    case OracleKind::kSampled:
      return "sampled";
    case OracleKind::kCompute:
      return "compute";
    default:
      return "cpu";
  }
}

}  // namespace

std::shared_ptr<Oracle> makeOracle(OracleKind kind, Answer answer, int viewport) {
  static const std::shared_ptr<Oracle> cpu = std::make_shared<CpuOracle>();
  const OracleSelection selection = oracleSelectionOf(kind);
  if (selection.kind == OracleKind::kAuto && answer == Answer::kConservative) {
    const std::shared_ptr<Oracle> hardware = gl::makeOracleWithHardware(cpu);
    return hardware != nullptr ? hardware : cpu;
  }
  if (selection.kind == OracleKind::kAuto || selection.kind == OracleKind::kCpu) return cpu;
  try {
    return gl::makeOracle(selection.kind, selection.device, viewport);
  } catch (const OracleError& e) {
    throw OracleError(std::string("oracle ") + nameOf(selection.kind) + ": " + e.what());
  }
}

}  // namespace bocst::oracle

namespace bocst {

std::vector<OracleInfo> availableOracles() {
  std::vector<OracleInfo> all = {{OracleKind::kCpu, "cpu", oracle::CpuOracle::device(), false, "", ""}};
  for (const oracle::gl::DeviceReport& r : oracle::gl::deviceReports()) {
    all.push_back(
        {OracleKind::kOcclusion, "occlusion", r.description, r.hardware, r.why_no_occlusion, r.occlusion_test});
    all.push_back({OracleKind::kSampled, "sampled", r.description, r.hardware, r.why_no_occlusion, ""});
    all.push_back({OracleKind::kCompute, "compute", r.description, r.hardware, r.why_no_compute, r.compute_test});
  }
  return all;
}

}  // namespace bocst
