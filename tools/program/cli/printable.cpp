// SPDX-License-Identifier: BSD-3-Clause
#include "cli/printable.h"

#include <algorithm>
#include <cstdint>

namespace bocst::program {
namespace {

bool continuesCharacter(char c) { return (static_cast<unsigned char>(c) & 0xC0) == 0x80; }

/// The bytes of the printable character that the text begins with; 0 if it begins with something else.
std::size_t printableBytes(std::string_view text) {
  const auto first = static_cast<unsigned char>(text.front());
  if (first < 0x80) return first >= 0x20 && first != 0x7F ? 1 : 0;
  const std::size_t size = first >= 0xF0 ? 4 : first >= 0xE0 ? 3 : 2;
  if (first < 0xC2 || first > 0xF4 || text.size() < size) return 0;
  std::uint32_t code = first & (0x7Fu >> size);
  for (std::size_t i = 1; i < size; ++i) {
    if (!continuesCharacter(text[i])) return 0;
    code = code << 6 | (static_cast<unsigned char>(text[i]) & 0x3Fu);
  }
  constexpr std::uint32_t kLeast[] = {0, 0, 0xA0, 0x800, 0x10000};  // for 2 bytes: above C1 controls
  const bool surrogate = code >= 0xD800 && code <= 0xDFFF;
  return code < kLeast[size] || code > 0x10FFFF || surrogate ? 0 : size;
}

}  // namespace

std::string printable(std::string_view text) {
  std::string shown;
  while (!text.empty()) {
    const std::size_t bytes = printableBytes(text);
    if (bytes > 0) {
      shown += text.substr(0, bytes);
      text.remove_prefix(bytes);
      continue;
    }
    shown += '?';
    // A C1 control is one character of two bytes.
    const bool control = text[0] == '\xC2' && text.size() > 1 && continuesCharacter(text[1]);
    text.remove_prefix(control ? 2 : 1);
  }
  return shown;
}

std::string inQuotes(std::string_view text) {
  constexpr std::size_t kMost = 60;
  if (text.size() <= kMost) return "'" + printable(text) + "'";
  std::size_t end = kMost;
  while (end > kMost - 3 && continuesCharacter(text[end])) --end;  // not within a character
  return "'" + printable(text.substr(0, end)) + "...'";
}

std::size_t characters(std::string_view text) {
  return static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return !continuesCharacter(c); }));
}

}  // namespace bocst::program
