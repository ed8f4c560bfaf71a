// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <charconv>
#include <cstddef>
#include <cstdlib>
#include <string>
#include <string_view>
#include <system_error>

namespace bocst::io {

constexpr std::string_view kBlanks = " \t\r\n\v\f";

/// Cuts the next line off `text`, without its end.
inline std::string_view takeLine(std::string_view& text) {
  const std::size_t end = text.find('\n');
  std::string_view line = text.substr(0, end);
  text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
  return line;
}

/// Cuts the next word off `text`; empty at the end.
inline std::string_view takeWord(std::string_view& text) {
  const std::size_t begin = text.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos) {
    text = {};
    return {};
  }
  text.remove_prefix(begin);
  const std::string_view word = text.substr(0, text.find_first_of(kBlanks));
  text.remove_prefix(word.size());
  return word;
}

/// The whole word as a number, whatever the locale; NaN and infinities are numbers here, the mesh refuses them by name.
inline bool toNumber(std::string_view word, double& number) {
  if (!word.empty() && word.front() == '+') word.remove_prefix(1);
  const std::from_chars_result r = std::from_chars(word.data(), word.data() + word.size(), number);
  if (r.ptr != word.data() + word.size() || word.empty()) return false;
  // Too large or too small for a double: only strtod says which.
  if (r.ec == std::errc::result_out_of_range) number = std::strtod(std::string(word).c_str(), nullptr);
  return r.ec != std::errc::invalid_argument;
}

inline bool toNumber(std::string_view word, long long& number) {
  if (!word.empty() && word.front() == '+') word.remove_prefix(1);
  const std::from_chars_result r = std::from_chars(word.data(), word.data() + word.size(), number);
  return r.ec == std::errc() && r.ptr == word.data() + word.size();
}

template <typename Number>
bool takeNumber(std::string_view& text, Number& number) {
  return toNumber(takeWord(text), number);
}

}  // namespace bocst::io
