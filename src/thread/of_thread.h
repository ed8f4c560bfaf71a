// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cxxabi.h>

/// Names this library or program to the C++ runtime (Itanium C++ ABI 3.3.5).
extern "C" void* __dso_handle __attribute__((visibility("hidden")));

namespace bocst::thread {

/// The calling thread's T, which lasts until the thread ends: memory that queries use again. Unlike a thread_local
/// object, it may also be asked for by what is destroyed later: thread_local objects that are older, and static objects
/// when the program ends. Then another T is made, which goes with the thread or the process.
template <typename T>
T& ofThread() {
  thread_local T* object = nullptr;
  if (object == nullptr) {
    object = new T();
    abi::__cxa_thread_atexit(
        [](void*) {
          delete object;
          object = nullptr;
        },
        nullptr, &__dso_handle);
  }
  return *object;
}

}  // namespace bocst::thread
