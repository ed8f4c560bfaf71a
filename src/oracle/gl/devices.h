// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "oracle/oracle.h"

namespace bocst::oracle::gl {

/// What each EGL device offers, the one that is taken by default first. One entry without a device that says why not if
/// there is none. Each is tested (self_test.h). Asked once a process.
struct DeviceReport {
  std::string description;  ///< Index, renderer and version, for people.
  bool hardware = false;
  std::string why_no_compute, why_no_occlusion;  ///< Empty when it can be used.
  std::string compute_test, occlusion_test;      ///< What the self-test said of it then.
};
const std::vector<DeviceReport>& deviceReports();

/// What kAuto takes: the host's oracle beside compute on the first hardware GPU that passes its self-test; null
/// without. The first call takes what the driver, the test and the first measurements need, if there is a GPU.
std::shared_ptr<Oracle> makeOracleWithHardware(const std::shared_ptr<Oracle>& host);

/// The oracle of this kind on a device, shared by all who ask as long as its context is not lost; without a device, on
/// the first that passes its self-test. @throws OracleError that says why it cannot be had.
std::shared_ptr<Oracle> makeOracle(OracleKind kind, int device, int viewport);

}  // namespace bocst::oracle::gl
