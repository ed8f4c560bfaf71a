// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cctype>
#include <cstddef>
#include <filesystem>
#include <string>

namespace bocst::program {

/// The items of a list, as `text` returns each, with `between` between two.
template <typename List, typename F>
std::string joined(const List& list, const std::string& between, F&& text) {
  std::string all;
  bool is_first = true;
  for (const auto& item : list) {
    if (!is_first) all += between;
    is_first = false;
    all += text(item);
  }
  return all;
}
template <typename List>
std::string joined(const List& list, const std::string& between) {
  return joined(list, between, [](const std::string& item) { return item; });
}

/// "1 link", "2 links".
inline std::string counted(std::size_t count, const std::string& what) {
  return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
}

/// The ending of a file's name in lower case, with its dot; empty if there is none.
inline std::string endingOf(const std::string& file) {
  std::string ending = std::filesystem::path(file).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(), [](unsigned char c) { return std::tolower(c); });
  return ending;
}

}  // namespace bocst::program
