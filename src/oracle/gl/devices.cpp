// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/gl/devices.h"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <iterator>
#include <map>
#include <mutex>
#include <tuple>
#include <utility>

#include "oracle/gl/compute_oracle.h"
#include "oracle/gl/occlusion_oracle.h"
#include "oracle/gl/thread.h"

namespace bocst::oracle::gl {
namespace {

// Loading OpenGL to learn that it is a software device takes long; testing for the device files of a GPU does not. The
// result is kept for the process, since each model asks.
bool mayHaveHardware() {
  const char* const files[] = {"/dev/dri", "/dev/nvidiactl", "/dev/dxg"};
  static const bool may =
      std::any_of(std::begin(files), std::end(files), [](const char* file) { return access(file, F_OK) == 0; });
  return may;
}

/// Contexts and oracles of this process. They are never destroyed: at exit, threads that still use them and drivers
/// that are being unloaded come in any order.
class Registry {
 public:
  static Registry& instance() {
    static std::atomic<Registry*> registry{new Registry};
    Registry* current = registry.load();
    if (current->process_ != getpid()) {
      // A child after fork() starts anew: the parent's lock may be held for ever.
      auto* fresh = new Registry;
      if (registry.compare_exchange_strong(current, fresh)) {
        current = fresh;
      } else {
        delete fresh;
      }
    }
    return *current;
  }

  std::shared_ptr<Oracle> oracle(OracleKind kind, int device, int viewport) {
    const std::lock_guard<std::mutex> lock(mutex_);
    std::shared_ptr<DeviceOracle>& known = oracles_[{kind, device, kind == OracleKind::kSampled ? viewport : 0}];
    if (known != nullptr && !known->thread().isLost()) return known;
    if (kind == OracleKind::kCompute) {
      known = std::make_shared<ComputeOracle>(thread(device, 4));
    } else {
      const auto form =
          kind == OracleKind::kSampled ? OcclusionOracle::Form::kSampled : OcclusionOracle::Form::kConservative;
      known = std::make_shared<OcclusionOracle>(thread(device, 3), form, viewport);
    }
    return known;
  }

  std::shared_ptr<Oracle> onHardware() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (no_hardware_) return nullptr;
      try {
        no_hardware_ = !thread(ContextRequest::kAnyDevice, 4)->info().hardware;
      } catch (const OracleError&) {
        no_hardware_ = true;
      }
      if (no_hardware_) {
        threads_.erase({ContextRequest::kAnyDevice, 4});
        return nullptr;
      }
    }
    return oracle(OracleKind::kCompute, ContextRequest::kAnyDevice, 0);
  }

  const std::vector<DeviceReport>& reports() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (reports_.empty()) {
      const int count = deviceCount();
      for (int device = 0; device < std::max(count, 1); ++device) {
        reports_.push_back(report(count > 0 ? device : ContextRequest::kAnyDevice));
      }
      // As Context chooses: hardware before software.
      std::stable_sort(reports_.begin(), reports_.end(),
                       [](const DeviceReport& a, const DeviceReport& b) { return a.hardware && !b.hardware; });
    }
    return reports_;
  }

 private:
  Registry() : process_(getpid()) {}

  /// A context of at least that OpenGL: 4.3, or 3.3, for which one of 4.3 does, too.
  std::shared_ptr<Thread> thread(int device, int major) {
    for (const int version : {4, 3}) {
      const auto known = threads_.find({device, version});
      if (version >= major && known != threads_.end() && !known->second->isLost()) return known->second;
    }
    const std::shared_ptr<Thread> made = newThread(device, major);
    threads_[{device, made->info().computes ? 4 : 3}] = made;
    return made;
  }

  static std::shared_ptr<Thread> newThread(int device, int major) {
    ContextRequest request;
    request.device = device;
    try {
      return std::make_shared<Thread>(request);
    } catch (const OracleError&) {
      if (major > 3) throw;
    }
    request.major = 3;
    return std::make_shared<Thread>(request);
  }

  static DeviceReport report(int device) {
    DeviceReport r;
    r.device = device;
    const auto attempt = [&](int major) -> std::string {
      try {
        const ContextInfo info = newThread(device, major)->info();  // for a moment: it takes memory of the device
        r.device = info.device;
        r.description = std::to_string(info.device) + ": " + info.renderer + ", OpenGL " + info.version;
        r.hardware = info.hardware;
        return "";
      } catch (const OracleError& e) {
        return e.what();
      }
    };
    r.why_no_compute = attempt(4);
    if (!r.why_no_compute.empty()) r.why_no_occlusion = attempt(3);
    return r;
  }

  const pid_t process_;
  std::mutex mutex_;
  std::map<std::pair<int, int>, std::shared_ptr<Thread>> threads_;
  std::map<std::tuple<OracleKind, int, int>, std::shared_ptr<DeviceOracle>> oracles_;
  std::vector<DeviceReport> reports_;
  bool no_hardware_ = false;
};

}  // namespace

const std::vector<DeviceReport>& deviceReports() { return Registry::instance().reports(); }

std::shared_ptr<Oracle> makeOracleOnHardware() {
  return mayHaveHardware() ? Registry::instance().onHardware() : nullptr;
}

std::shared_ptr<Oracle> makeOracle(OracleKind kind, int device, int viewport) {
  return Registry::instance().oracle(kind, device, viewport);
}

}  // namespace bocst::oracle::gl
