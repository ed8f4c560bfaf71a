// SPDX-License-Identifier: BSD-3-Clause
#include "log/log.h"

#include <pthread.h>

#include <cstdio>
#include <memory>
#include <mutex>
#include <utility>

namespace bocst {
namespace {

using Logger = std::function<void(LogLevel, const std::string&)>;

struct Registered {
  std::mutex mutex;
  std::shared_ptr<const Logger> logger;
};

// Never destroyed: threads of devices may report while the process ends. Held during a fork(): the child has no other
// thread that could give it back.
Registered& registered() {
  static Registered* const r = [] {
    static auto* const made = new Registered;
    const auto unlock = [] { made->mutex.unlock(); };
    pthread_atfork([] { made->mutex.lock(); }, unlock, unlock);
    return made;
  }();
  return *r;
}

}  // namespace

void setLogger(std::function<void(LogLevel, const std::string&)> logger) {
  std::shared_ptr<const Logger> next = logger ? std::make_shared<const Logger>(std::move(logger)) : nullptr;
  Registered& r = registered();
  // The former logger is destroyed outside of the lock: its destructor is the caller's code.
  const std::lock_guard<std::mutex> lock(r.mutex);
  std::swap(r.logger, next);
}

void log(LogLevel level, const std::string& message) noexcept {
  try {
    std::shared_ptr<const Logger> logger;
    {
      Registered& r = registered();
      const std::lock_guard<std::mutex> lock(r.mutex);
      logger = r.logger;
    }
    if (logger != nullptr) {
      (*logger)(level, message);
    } else {
      std::fprintf(stderr, "bocst: %s\n", message.c_str());
    }
  } catch (...) {
    // A report that cannot be made must not change an answer.
  }
}

}  // namespace bocst
