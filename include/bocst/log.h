// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/export.h>

#include <functional>
#include <string>

namespace bocst {

/// How serious a message of the library is.
enum class LogLevel {
  kInfo,     ///< For the curious.
  kWarning,  ///< Something works otherwise or more slowly than was asked for; answers are as they should be.
  kError,    ///< Something that was asked for is missing.
};

/// Sends what the library has to report, outside of exceptions, to `logger`: a GPU that was lost or that ran out of
/// memory, for example. An empty function restores the default, which writes lines "bocst: ..." to stderr.
///
/// Threads: may be called at any time. The logger is called from any thread, also from several at once and inside of
/// queries, so it must be thread-safe and must not call back into the library. What it throws is ignored.
BOCST_EXPORT void setLogger(std::function<void(LogLevel, const std::string&)> logger);

}  // namespace bocst
