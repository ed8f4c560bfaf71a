// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace bocst::program {

/// A name for a message or a table: valid UTF-8 as it is; control characters and bytes that are no UTF-8 become '?',
/// because a file may contain control sequences of terminals.
std::string printable(std::string_view text);

/// A text of a file for a message: printable, in quotes, cut to 60 bytes.
std::string inQuotes(std::string_view text);

/// The number of characters of valid UTF-8.
std::size_t characters(std::string_view text);

}  // namespace bocst::program
