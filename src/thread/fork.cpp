// SPDX-License-Identifier: BSD-3-Clause
#include "thread/fork.h"

#include <pthread.h>

#include <new>
#include <stdexcept>

namespace bocst::thread {

std::atomic<unsigned> forks{0};

std::mutex& forkMutex() {
  // Never destroyed: a child makes it anew in the same place.
  alignas(std::mutex) static unsigned char storage[sizeof(std::mutex)];
  static std::mutex* const mutex = [] {
    auto* const made = new (storage) std::mutex;
    pthread_atfork(nullptr, nullptr, [] {
      forks.fetch_add(1);
      new (storage) std::mutex;
    });
    return made;
  }();
  return *mutex;
}

namespace {
// Before anybody can fork with a model.
[[maybe_unused]] const std::mutex& made_at_start = forkMutex();
}  // namespace

void throwForked() {
  throw std::runtime_error(
      "bocst: another thread was at work in this model or scene when the process was forked, so the child cannot make "
      "this call; create a new one in the child");
}

bool ForkAwareMutex::adopt() {
  const std::lock_guard<std::mutex> lock(forkMutex());
  if (forks_.load() == forks.load()) return true;
  if (!mutex_.try_lock()) return false;
  mutex_.unlock();
  forks_ = forks.load();
  return true;
}

}  // namespace bocst::thread
