// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/export.h>

#include <functional>
#include <string>

namespace bocst {

/// How serious a message of the library is.
enum class LogLevel {
  kInfo,     ///< Information only.
  kWarning,  ///< Something works differently or more slowly than requested; answers are correct.
  kError,    ///< Something that was requested is not available.
};

/// Sends the library's messages to `logger`: for example, that a GPU was lost or ran out of memory. Exceptions are not
/// messages; and two warnings of FCL (for a pair that it does not know, and for num_max_contacts 0) go to stderr, as
/// they do in FCL. An empty function restores the default, which writes lines "bocst: ..." to stderr.
///
/// Threads: may be called at any time. The library calls the logger from any thread, also from several at once and
/// during queries, so the logger must be thread-safe and must not call the library. Exceptions from it are ignored.
BOCST_EXPORT void setLogger(std::function<void(LogLevel, const std::string&)> logger);

}  // namespace bocst
