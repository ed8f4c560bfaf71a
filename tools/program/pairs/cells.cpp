// SPDX-License-Identifier: BSD-3-Clause
#include "pairs/cells.h"

#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "io/text.h"

namespace bocst::program {
namespace {

std::string trimmed(const std::string& text) {
  const std::size_t begin = text.find_first_not_of(" \r");
  if (begin == std::string::npos) return "";
  return text.substr(begin, text.find_last_not_of(" \r") + 1 - begin);
}

}  // namespace

std::vector<std::string> cellsOf(const std::string& line, Blanks blanks) {
  const std::string_view separators = blanks == Blanks::kSeparate ? ",;" : ",;\t";
  const std::string_view gaps = blanks == Blanks::kSeparate ? " \r\t" : "";
  const auto is_in = [](std::string_view some, char c) { return some.find(c) != std::string_view::npos; };
  std::vector<std::string> cells(1);
  bool quoted = false, gap = false;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const char c = line[i];
    const bool is_gap = !quoted && is_in(gaps, c);
    if (!is_gap && std::exchange(gap, false) && c != '#' && !is_in(separators, c)) cells.emplace_back();
    if (is_gap) {
      gap = !trimmed(cells.back()).empty();
      continue;
    }
    if (c == '"' && quoted && line[i + 1] == '"') {
      cells.back() += line[++i];
    } else if (c == '"' && (quoted || trimmed(cells.back()).empty())) {
      quoted = !quoted;
    } else if (c == '#' && !quoted) {
      break;
    } else if (quoted || !is_in(separators, c)) {
      cells.back() += c;
    } else {
      cells.emplace_back();
    }
  }
  if (quoted) throw std::invalid_argument("a quote is not closed");
  for (std::string& cell : cells) cell = trimmed(cell);
  return cells;
}

std::optional<double> numberOf(const std::string& cell) {
  double number = 0;
  return io::toNumber(cell, number) && std::isfinite(number) ? std::optional<double>(number) : std::nullopt;
}

}  // namespace bocst::program
