// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/gl/devices.h"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <iterator>
#include <map>
#include <mutex>
#include <tuple>
#include <utility>

#include "log/log.h"
#include "oracle/auto_oracle.h"
#include "oracle/gl/compute_oracle.h"
#include "oracle/gl/occlusion_oracle.h"
#include "oracle/gl/self_test.h"
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
    if (current->forks_ != thread::forks.load()) {
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
    if (device != ContextRequest::kAnyDevice) return on(kind, device, viewport);
    const std::vector<int> devices = devicesInOrder();
    if (devices.empty()) throw OracleError("EGL knows no device");
    std::string why_not;
    for (const int candidate : devices) {
      try {
        return on(kind, candidate, viewport);
      } catch (const OracleError& e) {
        why_not += (why_not.empty() ? "" : "; ") + std::string(e.what());
      }
    }
    throw OracleError(why_not);
  }

  std::shared_ptr<Oracle> withHardware(const std::shared_ptr<Oracle>& host) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (no_hardware_) return nullptr;
    try {
      for (const int device : devicesInOrder()) {
        const std::shared_ptr<Oracle> known = tryHardware(device);
        if (known == nullptr) continue;
        if (auto_ == nullptr || auto_->device() != known) auto_ = std::make_shared<AutoOracle>(host, known);
        return auto_;
      }
    } catch (const OracleError&) {
      // No EGL.
    }
    no_hardware_ = true;
    return nullptr;
  }

  const std::vector<DeviceReport>& reports() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (reports_.empty()) {
      std::vector<int> devices;
      try {
        devices = devicesInOrder();
      } catch (const OracleError&) {
        // The report of no device says why.
      }
      if (devices.empty()) devices.push_back(ContextRequest::kAnyDevice);
      for (const int device : devices) reports_.push_back(report(device));
      // What turned out to be software comes last.
      std::stable_sort(reports_.begin(), reports_.end(),
                       [](const DeviceReport& a, const DeviceReport& b) { return a.hardware && !b.hardware; });
    }
    return reports_;
  }

 private:
  using Key = std::tuple<OracleKind, int, int>;  // kind, device, viewport

  Registry() = default;

  /// On one device, which has passed its test.
  std::shared_ptr<DeviceOracle> on(OracleKind kind, int device, int viewport) {
    const Key key{kind, device, kind == OracleKind::kSampled ? viewport : 0};
    std::shared_ptr<DeviceOracle>& known = oracles_[key];
    if (known != nullptr && known->thread().isDistrusted()) refused_[key] = "the device answered wrongly before";
    const auto refused = refused_.find(key);
    if (refused != refused_.end()) throw OracleError(refused->second);
    if (known != nullptr && !known->thread().isLost()) return known;
    known = nullptr;
    const Tested tested = makeTested(kind, thread(device, kind == OracleKind::kCompute ? 4 : 3), viewport);
    if (!tested.why_not.empty()) {
      refused_[key] = tested.why_not;
      throw OracleError(tested.why_not);
    }
    return known = tested.oracle;
  }

  /// Null for a device that is no hardware, or that is refused, which is reported.
  std::shared_ptr<Oracle> tryHardware(int device) {
    try {
      const std::shared_ptr<Thread> its_thread = thread(device, 4);
      if (its_thread->info().hardware) return on(OracleKind::kCompute, device, 0);
      threads_.erase({device, its_thread->info().computes ? 4 : 3});
    } catch (const OracleError& e) {
      log(LogLevel::kWarning, std::string("a device is not used: ") + e.what());
    }
    return nullptr;
  }

  struct Tested {
    std::shared_ptr<DeviceOracle> oracle;
    std::string why_not;  // empty: it passed
    double milliseconds = 0;
  };

  /// @throws OracleError where there is not even an oracle to test.
  static Tested makeTested(OracleKind kind, const std::shared_ptr<Thread>& thread, int viewport) {
    Tested tested;
    std::string wrong;
    const auto test = [&](auto& oracle) {
      const auto begin = std::chrono::steady_clock::now();
      wrong = selfTest(oracle);
      tested.milliseconds = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
    };
    try {
      if (kind == OracleKind::kCompute) {
        const auto oracle = std::make_shared<ComputeOracle>(thread);
        tested.oracle = oracle;
        test(*oracle);
      } else {
        // The sampled form loses surface by its nature.
        const bool is_sampled = kind == OracleKind::kSampled;
        const auto form = is_sampled ? OcclusionOracle::Form::kSampled : OcclusionOracle::Form::kConservative;
        const auto oracle = std::make_shared<OcclusionOracle>(thread, form, viewport);
        tested.oracle = oracle;
        if (!is_sampled) test(*oracle);
      }
    } catch (const OracleError& e) {
      if (tested.oracle == nullptr) throw;
      wrong = e.what();
    }
    if (!wrong.empty()) {
      tested.why_not = "device " + std::to_string(thread->info().device) + ", " + thread->info().renderer +
                       ", failed its self-test: " + wrong;
    }
    return tested;
  }

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
    const auto attempt = [&](OracleKind kind, int major, std::string& self_test) -> std::string {
      try {
        const std::shared_ptr<Thread> its_thread = newThread(device, major);  // for a moment: it takes memory
        const ContextInfo& info = its_thread->info();
        r.description = std::to_string(info.device) + ": " + info.renderer + ", OpenGL " + info.version;
        r.hardware = info.hardware;
        const Tested tested = makeTested(kind, its_thread, PaperOptions{}.viewport);
        if (!tested.why_not.empty()) return tested.why_not;
        self_test = "passed in " + std::to_string(std::lround(tested.milliseconds)) + " ms";
        if (const auto compute = std::dynamic_pointer_cast<ComputeOracle>(tested.oracle)) {
          const std::string wrong = selfTestOfWalks(*compute);
          self_test += wrong.empty() ? "; walks passed" : "; walks failed: " + wrong;
        }
        return "";
      } catch (const OracleError& e) {
        return e.what();
      }
    };
    r.why_no_compute = attempt(OracleKind::kCompute, 4, r.compute_test);
    r.why_no_occlusion = attempt(OracleKind::kOcclusion, 3, r.occlusion_test);
    return r;
  }

  const unsigned forks_ = thread::forks.load();
  std::mutex mutex_;
  std::map<std::pair<int, int>, std::shared_ptr<Thread>> threads_;
  std::map<Key, std::shared_ptr<DeviceOracle>> oracles_;
  std::map<Key, std::string> refused_;  // and why
  std::shared_ptr<AutoOracle> auto_;    // with the device that was found last
  std::vector<DeviceReport> reports_;
  bool no_hardware_ = false;
};

}  // namespace

const std::vector<DeviceReport>& deviceReports() { return Registry::instance().reports(); }

std::shared_ptr<Oracle> makeOracleWithHardware(const std::shared_ptr<Oracle>& host) {
  return mayHaveHardware() ? Registry::instance().withHardware(host) : nullptr;
}

std::shared_ptr<Oracle> makeOracle(OracleKind kind, int device, int viewport) {
  return Registry::instance().oracle(kind, device, viewport);
}

}  // namespace bocst::oracle::gl
