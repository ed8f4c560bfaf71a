// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/oracle.h"

#include <algorithm>
#include <cstdlib>

#include "oracle/cpu/cpu_oracle.h"

namespace bocst::oracle {
namespace {

constexpr char kNotInThisVersion[] = "OpenGL oracles are not part of this version";

OracleKind kindFromEnvironment() {
  const char* value = std::getenv("BOCST_ORACLE");
  if (value == nullptr || *value == '\0') return OracleKind::kAuto;
  const std::string name(value);
  for (const OracleInfo& info : availableOracles()) {
    if (info.name == name) return info.kind;
  }
  if (name.find_first_not_of("0123456789") == std::string::npos) {
    throw OracleError("BOCST_ORACLE=" + name + ": there is no device " + name + ": " + kNotInThisVersion);
  }
  throw OracleError("BOCST_ORACLE=" + name + ": not one of cpu, occlusion, compute or a device index");
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

std::shared_ptr<Oracle> makeOracle(OracleKind kind) {
  if (kind == OracleKind::kAuto) kind = kindFromEnvironment();
  for (const OracleInfo& info : availableOracles()) {
    if (info.kind == kind && !info.why_not.empty()) throw OracleError("oracle " + info.name + ": " + info.why_not);
  }
  static const std::shared_ptr<Oracle> cpu = std::make_shared<CpuOracle>();
  return cpu;
}

}  // namespace bocst::oracle

namespace bocst {

std::vector<OracleInfo> availableOracles() {
  return {{OracleKind::kCpu, "cpu", oracle::CpuOracle::device(), false, ""},
          {OracleKind::kOcclusion, "occlusion", "", false, oracle::kNotInThisVersion},
          {OracleKind::kCompute, "compute", "", false, oracle::kNotInThisVersion}};
}

}  // namespace bocst
