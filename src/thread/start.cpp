// SPDX-License-Identifier: BSD-3-Clause
#include "thread/start.h"

#include <pthread.h>
#include <signal.h>

#include <utility>

namespace bocst::thread {

std::thread startWithoutSignals(std::function<void()> work) {
  // A new thread has the mask of the thread that starts it.
  struct Mask {
    Mask() {
      sigset_t all;
      sigfillset(&all);
      pthread_sigmask(SIG_SETMASK, &all, &before);
    }
    ~Mask() { pthread_sigmask(SIG_SETMASK, &before, nullptr); }
    sigset_t before;
  };
  const Mask mask;
  return std::thread(std::move(work));
}

}  // namespace bocst::thread
