// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace bocst::program {

/// " Did you mean NAME?" for the name that is nearest to a mistyped word; empty where none is near.
/// @param most letters that may be wrong; by default one, and one more for each three letters of the word.
std::string suggestion(const std::string& word, const std::vector<std::string>& names);
std::string suggestion(const std::string& word, const std::vector<std::string>& names, std::size_t most);

}  // namespace bocst::program
