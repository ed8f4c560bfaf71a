// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/log.h>

#include <string>

namespace bocst {

/// Gives a message to the logger that is set; see setLogger(). Never throws.
void log(LogLevel level, const std::string& message) noexcept;

}  // namespace bocst
