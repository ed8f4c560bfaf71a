// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/export.h>

#include <charconv>
#include <string>
#include <string_view>

namespace bocst::io {

constexpr std::string_view kBlanks = " \t\r\n\v\f";

/// Without what some editors put before a text in UTF-8.
inline std::string_view withoutByteOrderMark(std::string_view text) {
  return text.substr(text.substr(0, 3) == "\xEF\xBB\xBF" ? 3 : 0);
}

/// What ends the lines of `text`: '\n', or '\r' if there is no other (CR LF ends lines, too).
char lineEnd(std::string_view text);

/// Cuts the next line off `text`, without its end.
std::string_view takeLine(std::string_view& text, char end);

/// Cuts the next word off `text`; empty at the end.
std::string_view takeWord(std::string_view& text);

/// The whole word as a number, whatever the locale; NaN and infinities are numbers here.
BOCST_EXPORT bool toNumber(std::string_view word, double& number);
bool toNumber(std::string_view word, long long& number);

template <typename Number>
bool takeNumber(std::string_view& text, Number& number) {
  return toNumber(takeWord(text), number);
}

/// A text for a message: in quotes, cut to 60 bytes, bytes that do not print replaced, because a file may contain
/// control sequences of terminals.
inline std::string inQuotes(std::string_view text) {
  constexpr std::size_t kMost = 60;
  std::string shown(text.substr(0, kMost));
  for (char& c : shown) {
    if (c < ' ' || c > '~') c = '?';
  }
  return "'" + shown + (text.size() > kMost ? "...'" : "'");
}

/// The path that a URI means: "%20" is a blank. What is no byte, or 0, stays as it is.
inline std::string percentDecoded(std::string_view path) {
  std::string result;
  for (std::size_t i = 0; i < path.size(); ++i) {
    const char* const digits = path.data() + i + 1;
    unsigned char byte = 0;
    const bool is_byte =
        path[i] == '%' && i + 2 < path.size() && std::from_chars(digits, digits + 2, byte, 16).ptr == digits + 2;
    result += is_byte && byte != 0 ? static_cast<char>(byte) : path[i];
    if (is_byte && byte != 0) i += 2;
  }
  return result;
}

/// @throws std::runtime_error "line N: what", where N is the line of `file` that `at` points into.
[[noreturn]] void failAt(std::string_view file, const char* at, const std::string& what);

/// Why a number is no coordinate of a mesh, for a message; null if it is one.
const char* notACoordinate(double number);

/// Cuts a coordinate off `text`.
/// @throws std::runtime_error "line N: what: 'word' is no finite number", or "is larger than 1e75 in magnitude".
double takeCoordinate(std::string_view file, std::string_view& text, const std::string& what);

}  // namespace bocst::io
