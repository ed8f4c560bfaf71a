// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <string>
#include <vector>

namespace bocst::oracle::gl {

/// The shared libraries that OpenGL through EGL needs. Another list than the default is for tests.
struct Libraries {
  std::vector<std::string> egl{"libEGL.so.1"};
  std::vector<std::string> gl{"libOpenGL.so.0", "libGL.so.1"};

  /// Empty when they can be loaded; else what is missing. libepoxy aborts the process if it does not find them, so
  /// nothing of it is called before this was asked.
  std::string whyNot() const;
};

/// Which device, and which OpenGL.
struct ContextRequest {
  static constexpr int kAnyDevice = -1;

  int device = kAnyDevice;  ///< EGL device index; kAnyDevice: the first of devicesInOrder().
  int major = 4, minor = 3;
  /// How long the device may take for what it was told before it counts as lost; 0: 10 s, and 10 minutes for a software
  /// renderer, which no watchdog stops.
  std::chrono::milliseconds wait_limit{0};
  Libraries libraries;
};

/// What runs a context.
struct ContextInfo {
  int device = 0;
  std::string renderer;       ///< GL_RENDERER.
  std::string version;        ///< GL_VERSION, with the driver's own.
  bool hardware = false;      ///< Not a software renderer.
  bool computes = false;      ///< OpenGL 4.3 was asked for and is there.
  bool tells_resets = false;  ///< A reset of the device ends the context, and isLost() says so.
};

/// The indices of the EGL devices: those that EGL does not call software first. @throws OracleError without EGL.
std::vector<int> devicesInOrder(const Libraries& libraries = Libraries());

/// A core-profile context without surface, current in the thread that makes it; that thread must end it, too.
///
/// The EGL display is never terminated: it is one for the whole process, and others may use it.
class Context {
 public:
  /// @throws OracleError that says what is missing.
  explicit Context(const ContextRequest& request);
  ~Context();
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

  const ContextInfo& info() const { return info_; }

  /// True if the driver says that the context was lost (GPU reset, driver update). Then nothing in it is of use.
  bool isLost() const;

 private:
  void* display_ = nullptr;
  void* context_ = nullptr;
  ContextInfo info_;
};

}  // namespace bocst::oracle::gl
