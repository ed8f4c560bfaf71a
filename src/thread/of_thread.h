// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace bocst::thread {

/// The calling thread's T, which lasts until the thread ends: memory that queries use again. When a program ends, its
/// static objects are destroyed after the thread_local ones of the main thread, and may still ask queries; for these,
/// another T is made that is never freed.
template <typename T>
T& ofThread() {
  thread_local T* object = nullptr;
  thread_local bool is_owned = false;
  struct Owner {
    ~Owner() {
      delete object;
      object = nullptr;
    }
  };
  if (object == nullptr) {
    object = new T();
    // A destroyed thread_local object must not be passed again.
    if (!is_owned) {
      is_owned = true;
      thread_local Owner owner;
      static_cast<void>(owner);
    }
  }
  return *object;
}

}  // namespace bocst::thread
