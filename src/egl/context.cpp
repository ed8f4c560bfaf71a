// SPDX-License-Identifier: BSD-3-Clause
#include "egl/context.h"

#include <bocst/oracle.h>
#include <dlfcn.h>
#include <epoxy/egl.h>
#include <epoxy/gl.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <iterator>
#include <numeric>

namespace bocst::oracle::gl {
namespace {

bool canLoad(const std::vector<std::string>& names) {
  return std::any_of(names.begin(), names.end(),
                     [](const std::string& name) { return dlopen(name.c_str(), RTLD_NOW | RTLD_LOCAL) != nullptr; });
}

bool has(const char* extensions, const std::string& name) {
  const std::string all = std::string(" ") + (extensions != nullptr ? extensions : "") + " ";
  return all.find(" " + name + " ") != std::string::npos;
}

std::string eglError() {
  const EGLint code = eglGetError();
  switch (code) {
    case EGL_NOT_INITIALIZED:
      return "EGL_NOT_INITIALIZED: no driver for this device";
    case EGL_BAD_MATCH:
      return "EGL_BAD_MATCH: the driver has no such version";
    case EGL_BAD_ALLOC:
      return "EGL_BAD_ALLOC";
    case EGL_BAD_ATTRIBUTE:
      return "EGL_BAD_ATTRIBUTE";
    default:
      return "EGL error " + std::to_string(code);
  }
}

struct Device {
  EGLDeviceEXT handle;
  bool software;
};

/// @throws OracleError
std::vector<Device> devices(const Libraries& libraries) {
  // Drivers keep threads of their own, which a child does not have: it would wait for them for ever.
  static const pid_t first = getpid();
  if (getpid() != first) throw OracleError("OpenGL was in use before fork(), so the child cannot use it");
  const std::string missing = libraries.whyNot();
  if (!missing.empty()) throw OracleError(missing);
  const char* client = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
  const bool enumerates = has(client, "EGL_EXT_device_base") ||
                          (has(client, "EGL_EXT_device_enumeration") && has(client, "EGL_EXT_device_query"));
  // Without any vendor's driver these are missing, and libepoxy would abort on the functions.
  if (!has(client, "EGL_EXT_platform_base") || !has(client, "EGL_EXT_platform_device") || !enumerates) {
    throw OracleError("EGL has no driver that offers devices (EGL_EXT_platform_device)");
  }
  EGLint count = 0;
  std::vector<Device> found;
  if (!eglQueryDevicesEXT(0, nullptr, &count) || count == 0) return found;
  std::vector<EGLDeviceEXT> handles(static_cast<std::size_t>(count));
  if (!eglQueryDevicesEXT(count, handles.data(), &count)) return found;
  handles.resize(static_cast<std::size_t>(count));
  for (const EGLDeviceEXT handle : handles) {
    found.push_back({handle, has(eglQueryDeviceStringEXT(handle, EGL_EXTENSIONS), "EGL_MESA_device_software")});
  }
  return found;
}

std::string string(GLenum name) {
  const GLubyte* text = glGetString(name);
  return text != nullptr ? reinterpret_cast<const char*>(text) : "";
}

// Layered drivers name what is below them in brackets: "zink Vulkan 1.3(llvmpipe (LLVM 15.0.6, 256 bits))".
bool isSoftware(std::string renderer) {
  std::transform(renderer.begin(), renderer.end(), renderer.begin(), [](unsigned char c) { return std::tolower(c); });
  const char* const names[] = {"llvmpipe", "lavapipe", "softpipe", "swrast", "swiftshader", "software", "swr"};
  return std::any_of(std::begin(names), std::end(names),
                     [&](const char* name) { return renderer.find(name) != std::string::npos; });
}

// Desktop OpenGL's attributes of robust contexts (EGL_KHR_create_context); those of EGL_EXT_create_context_robustness
// are OpenGL ES's.
constexpr EGLint kRobust[] = {EGL_CONTEXT_FLAGS_KHR, EGL_CONTEXT_OPENGL_ROBUST_ACCESS_BIT_KHR,
                              EGL_CONTEXT_OPENGL_RESET_NOTIFICATION_STRATEGY_KHR, EGL_LOSE_CONTEXT_ON_RESET_KHR};

EGLContext createContext(EGLDisplay display, const ContextRequest& request, bool robust) {
  std::vector<EGLint> attributes = {EGL_CONTEXT_MAJOR_VERSION_KHR,       request.major,
                                    EGL_CONTEXT_MINOR_VERSION_KHR,       request.minor,
                                    EGL_CONTEXT_OPENGL_PROFILE_MASK_KHR, EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT_KHR};
  if (robust) attributes.insert(attributes.end(), std::begin(kRobust), std::end(kRobust));
  attributes.push_back(EGL_NONE);
  return eglCreateContext(display, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, attributes.data());
}

}  // namespace

std::string Libraries::whyNot() const {
  if (!canLoad(egl)) return egl.front() + " cannot be loaded: EGL is not installed";
  if (!canLoad(gl)) return gl.front() + " cannot be loaded: OpenGL is not installed";
  return "";
}

std::vector<int> devicesInOrder(const Libraries& libraries) {
  const std::vector<Device> all = devices(libraries);
  std::vector<int> order(all.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_partition(order.begin(), order.end(), [&](int i) { return !all[static_cast<std::size_t>(i)].software; });
  return order;
}

Context::Context(const ContextRequest& request) {
  const std::vector<Device> all = devices(request.libraries);
  if (all.empty()) throw OracleError("EGL knows no device");
  const auto index = static_cast<std::size_t>(
      request.device == ContextRequest::kAnyDevice ? devicesInOrder(request.libraries).front() : request.device);
  if (index >= all.size()) {
    throw OracleError("there is no device " + std::to_string(request.device) + ": EGL knows " +
                      std::to_string(all.size()));
  }
  const std::string where = "device " + std::to_string(index) + ": ";
  EGLDisplay display = eglGetPlatformDisplayEXT(EGL_PLATFORM_DEVICE_EXT, all[index].handle, nullptr);
  if (display == EGL_NO_DISPLAY || !eglInitialize(display, nullptr, nullptr)) throw OracleError(where + eglError());
  const char* extensions = eglQueryString(display, EGL_EXTENSIONS);
  for (const char* needed : {"EGL_KHR_surfaceless_context", "EGL_KHR_no_config_context", "EGL_KHR_create_context"}) {
    if (!has(extensions, needed)) throw OracleError(where + "its driver lacks " + needed);
  }
  if (!eglBindAPI(EGL_OPENGL_API)) throw OracleError(where + "its driver has no desktop OpenGL");
  EGLContext context = createContext(display, request, true);
  if (context == EGL_NO_CONTEXT) context = createContext(display, request, false);
  if (context == EGL_NO_CONTEXT) {
    throw OracleError(where + "no OpenGL " + std::to_string(request.major) + "." + std::to_string(request.minor) +
                      " (" + eglError() + ")");
  }
  if (!eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context)) {
    const std::string why = eglError();
    eglDestroyContext(display, context);
    throw OracleError(where + "its context cannot be used (" + why + ")");
  }
  display_ = display;
  context_ = context;
  info_.device = static_cast<int>(index);
  info_.renderer = string(GL_RENDERER);
  info_.version = string(GL_VERSION);
  info_.computes = request.major >= 4;
  info_.hardware = !all[index].software && !isSoftware(info_.renderer);
  if (epoxy_gl_version() >= 45 || epoxy_has_gl_extension("GL_KHR_robustness")) {
    GLint strategy = GL_NO_RESET_NOTIFICATION;
    glGetIntegerv(GL_RESET_NOTIFICATION_STRATEGY, &strategy);
    info_.tells_resets = strategy == GL_LOSE_CONTEXT_ON_RESET;
  }
}

Context::~Context() {
  eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
  eglDestroyContext(display_, context_);
  eglReleaseThread();
}

bool Context::isLost() const {
  if (!info_.tells_resets) return false;
  return (epoxy_gl_version() >= 45 ? glGetGraphicsResetStatus() : glGetGraphicsResetStatusKHR()) != GL_NO_ERROR;
}

}  // namespace bocst::oracle::gl
