// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/export.h>
#include <bocst/options.h>

#include <stdexcept>
#include <string>
#include <vector>

namespace bocst {

/// An oracle asked for by name that cannot be had; what() says why.
class BOCST_EXPORT OracleError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// One oracle this build knows of.
struct OracleInfo {
  OracleKind kind = OracleKind::kCpu;  ///< What Options::oracle takes.
  std::string name;                    ///< "cpu", "occlusion" or "compute", as BOCST_ORACLE takes it; or "sampled".
  std::string device;                  ///< What it runs on, for people.
  bool hardware = false;               ///< Runs on a GPU.
  std::string why_not;                 ///< Empty when it can be used; else the reason.
  /// What came of asking the device what the CPU knows, as it is asked before it is used: "passed in 20 ms". Empty
  /// where there was none: for the CPU, for "sampled", and where why_not says why not.
  std::string self_test = {};
};

/// What is there, and why not the others. Thread-safe.
BOCST_EXPORT std::vector<OracleInfo> availableOracles();

}  // namespace bocst
