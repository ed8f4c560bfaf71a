// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

namespace bocst::program {

/// " Did you mean NAME?" for the name that is nearest to a mistyped word; empty where none is near.
std::string suggestion(const std::string& word, const std::vector<std::string>& names);

}  // namespace bocst::program
