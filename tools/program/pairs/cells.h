// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace bocst::program {

/// Whether blanks and tabs separate cells, several as one does, or only commas, semicolons and single tabs.
enum class Blanks { kKeep, kSeparate };

/// The cells of a line of a table in text (CSV) without blanks at their ends; what follows a # is a comment. In quotes,
/// nothing separates cells, and two quotes are one. An empty line has one empty cell.
/// @throws std::invalid_argument for a quote that is not closed.
std::vector<std::string> cellsOf(const std::string& line, Blanks blanks);

/// The cell as a finite number, if it is one.
std::optional<double> numberOf(const std::string& cell);

}  // namespace bocst::program
