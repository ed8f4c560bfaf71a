// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/oracle.h"

#include <cstdlib>

#include "oracle/cpu/cpu_oracle.h"
#include "oracle/gl/context.h"
#include "oracle/gl/devices.h"

namespace bocst::oracle {
namespace {

/// What was asked for, after BOCST_ORACLE had its say.
struct Wish {
  OracleKind kind;
  int device = gl::ContextRequest::kAnyDevice;
};

Wish fromEnvironment() {
  const char* value = std::getenv("BOCST_ORACLE");
  if (value == nullptr || *value == '\0') return {OracleKind::kAuto};
  const std::string name(value);
  if (name == "cpu") return {OracleKind::kCpu};
  if (name == "occlusion") return {OracleKind::kOcclusion};
  if (name == "compute") return {OracleKind::kCompute};
  if (name.size() < 5 && name.find_first_not_of("0123456789") == std::string::npos) {
    return {OracleKind::kCompute, std::stoi(name)};
  }
  throw OracleError("BOCST_ORACLE=" + name + ": not one of cpu, occlusion, compute or a device index");
}

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

void OctantBounds::set(int octant, const CellBounds& b) {
  for (int k = 0; k < 3; ++k) {
    lo[k][octant] = b.lo[k];
    hi[k][octant] = b.hi[k];
    normal[k][octant] = b.normal[k];
  }
  slab_center[octant] = b.slab_center;
  slab_half[octant] = b.slab_half;
}

CellBounds OctantBounds::get(int octant) const {
  CellBounds b;
  for (int k = 0; k < 3; ++k) {
    b.lo[k] = lo[k][octant];
    b.hi[k] = hi[k][octant];
    b.normal[k] = normal[k][octant];
  }
  b.slab_center = slab_center[octant];
  b.slab_half = slab_half[octant];
  return b;
}

std::shared_ptr<Oracle> makeOracle(OracleKind kind, int viewport) {
  static const std::shared_ptr<Oracle> cpu = std::make_shared<CpuOracle>();
  Wish wish{kind};
  if (kind == OracleKind::kAuto) wish = fromEnvironment();
  if (wish.kind == OracleKind::kAuto) {
    const std::shared_ptr<Oracle> hardware = gl::makeOracleOnHardware();
    return hardware != nullptr ? hardware : cpu;
  }
  if (wish.kind == OracleKind::kCpu) return cpu;
  try {
    return gl::makeOracle(wish.kind, wish.device, viewport);
  } catch (const OracleError& e) {
    throw OracleError(std::string("oracle ") + nameOf(wish.kind) + ": " + e.what());
  }
}

}  // namespace bocst::oracle

namespace bocst {

std::vector<OracleInfo> availableOracles() {
  std::vector<OracleInfo> all = {{OracleKind::kCpu, "cpu", oracle::CpuOracle::device(), false, ""}};
  for (const oracle::gl::DeviceReport& r : oracle::gl::deviceReports()) {
    all.push_back({OracleKind::kOcclusion, "occlusion", r.description, r.hardware, r.why_no_occlusion});
    all.push_back({OracleKind::kSampled, "sampled", r.description, r.hardware, r.why_no_occlusion});
    all.push_back({OracleKind::kCompute, "compute", r.description, r.hardware, r.why_no_compute});
  }
  return all;
}

}  // namespace bocst
