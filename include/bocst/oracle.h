// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/export.h>
#include <bocst/options.h>

#include <stdexcept>
#include <string>
#include <vector>

namespace bocst {

/// Thrown if a requested oracle cannot be used; what() gives the reason.
class BOCST_EXPORT OracleError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// One oracle that this build supports.
struct OracleInfo {
  OracleKind kind = OracleKind::kCpu;  ///< The value for Options::oracle.
  std::string name;                    ///< "cpu", "occlusion" or "compute", as for BOCST_ORACLE; or "sampled".
  std::string device;                  ///< Name of the device, for display.
  bool hardware = false;               ///< True if it runs on a GPU.
  std::string why_not;                 ///< Empty if it can be used; else the reason why not.
  /// Result of the self-tests, which compare the device's answers with the CPU's before the device is used: for example
  /// "passed in 20 ms; walks passed". The second part is for compute only: whether the device may also test many poses
  /// of two trees (collidePoses(), Scene::collisions()). Empty if there was no test: for the CPU, for "sampled", and if
  /// why_not is not empty.
  std::string self_test = {};
};

/// Lists all oracles; for those that cannot be used, the reason. Thread-safe.
BOCST_EXPORT std::vector<OracleInfo> availableOracles();

}  // namespace bocst
