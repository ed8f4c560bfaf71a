// SPDX-License-Identifier: BSD-3-Clause
#include "io/text.h"

#include <locale.h>
#include <stdlib.h>

#include <algorithm>
#include <charconv>
#include <clocale>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <system_error>

#include "mesh/limits.h"

namespace bocst::io {

char lineEnd(std::string_view text) {
  return text.find('\n') == text.npos && text.find('\r') != text.npos ? '\r' : '\n';
}

std::string_view takeLine(std::string_view& text, char end) {
  const std::size_t size = text.find(end);
  std::string_view line = text.substr(0, size);
  text.remove_prefix(size == std::string_view::npos ? text.size() : size + 1);
  if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
  return line;
}

std::string_view takeWord(std::string_view& text) {
  text.remove_prefix(std::min(text.find_first_not_of(kBlanks), text.size()));
  const std::string_view word = text.substr(0, text.find_first_of(kBlanks));
  text.remove_prefix(word.size());
  return word;
}

bool toNumber(std::string_view word, double& number) {
  if (word.size() > 1 && word.front() == '+' && word[1] != '-') word.remove_prefix(1);
  const std::from_chars_result r = std::from_chars(word.data(), word.data() + word.size(), number);
  if (r.ptr != word.data() + word.size()) return false;
  if (r.ec == std::errc::result_out_of_range) {
    // Too large or too small for a double: only strtod says which, and it reads as the locale does.
    static const locale_t c_locale = newlocale(LC_ALL_MASK, "C", nullptr);
    number = strtod_l(std::string(word).c_str(), nullptr, c_locale);
  }
  return r.ec != std::errc::invalid_argument;
}

bool toNumber(std::string_view word, long long& number) {
  if (word.size() > 1 && word.front() == '+' && word[1] != '-') word.remove_prefix(1);
  const std::from_chars_result r = std::from_chars(word.data(), word.data() + word.size(), number);
  return r.ec == std::errc() && r.ptr == word.data() + word.size();
}

void failAt(std::string_view file, const char* at, const std::string& what) {
  auto ends = std::count(file.data(), at, '\n');
  if (ends == 0) ends = std::count(file.data(), at, '\r');
  throw std::runtime_error("line " + std::to_string(1 + ends) + ": " + what);
}

const char* notACoordinate(double number) {
  if (!std::isfinite(number)) return "is no finite number";
  return std::abs(number) <= kMostCoordinate ? nullptr : "is larger than 1e75 in magnitude";
}

double takeCoordinate(std::string_view file, std::string_view& text, const std::string& what) {
  const std::string_view word = takeWord(text);
  double number = 0;
  const char* const fault = toNumber(word, number) ? notACoordinate(number) : "is no finite number";
  if (fault == nullptr) return number;
  failAt(file, word.data(), what + ": " + (word.empty() ? "number missing" : inQuotes(word) + " " + fault));
}

}  // namespace bocst::io
