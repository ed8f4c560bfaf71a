// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <thread>

namespace bocst::thread {

/// Starts a thread that takes no signals: handlers of the application run in threads that the application made.
/// @throws std::system_error if the system can start no more threads, std::bad_alloc; the caller's signal mask is then
/// as before, too.
std::thread startWithoutSignals(std::function<void()> work);

}  // namespace bocst::thread
