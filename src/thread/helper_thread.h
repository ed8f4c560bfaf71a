// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>

namespace bocst::thread {

/// Calls jobs one after the other, in a thread that all models of the process share. It starts with the first job and
/// ends with the process: jobs that wait then are dropped, the one under way is waited for. A child after fork() gets a
/// thread of its own, and none of its parent's jobs. Thread-safe.
///
/// @throws std::system_error if the system can start no more threads, std::bad_alloc.
void runInHelperThread(std::function<void()> job);

}  // namespace bocst::thread
