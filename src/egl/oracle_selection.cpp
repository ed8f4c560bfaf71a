// SPDX-License-Identifier: BSD-3-Clause
#include "egl/oracle_selection.h"

#include <bocst/oracle.h>

#include <cstdlib>
#include <string>

namespace bocst::oracle {

OracleSelection oracleSelectionOf(OracleKind kind) {
  const char* value = kind == OracleKind::kAuto ? std::getenv("BOCST_ORACLE") : nullptr;
  if (value == nullptr || *value == '\0') return {kind};
  const std::string name(value);
  if (name == "cpu") return {OracleKind::kCpu};
  if (name == "occlusion") return {OracleKind::kOcclusion};
  if (name == "compute") return {OracleKind::kCompute};
  if (name.size() < 5 && name.find_first_not_of("0123456789") == std::string::npos) {
    return {OracleKind::kCompute, std::stoi(name)};
  }
  throw OracleError("BOCST_ORACLE=" + name + ": not one of cpu, occlusion, compute or a device index");
}

}  // namespace bocst::oracle
