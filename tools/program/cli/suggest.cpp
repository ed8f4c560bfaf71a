// SPDX-License-Identifier: BSD-3-Clause
#include "cli/suggest.h"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <utility>

#include "cli/printable.h"

namespace bocst::program {
namespace {

/// How many letters must be put in, left out, changed or swapped with their neighbour.
std::size_t editDistance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> before(b.size() + 1), row(b.size() + 1), next(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    next[0] = i;
    for (std::size_t k = 1; k <= b.size(); ++k) {
      next[k] = std::min({row[k] + 1, next[k - 1] + 1, row[k - 1] + (a[i - 1] != b[k - 1])});
      if (i > 1 && k > 1 && a[i - 1] == b[k - 2] && a[i - 2] == b[k - 1])
        next[k] = std::min(next[k], before[k - 2] + 1);
    }
    before = std::exchange(row, next);
  }
  return row.back();
}

}  // namespace

std::string suggestion(const std::string& word, const std::vector<std::string>& names) {
  return suggestion(word, names, word.size() / 3 + 1);  // more than that is another word
}

std::string suggestion(const std::string& word, const std::vector<std::string>& names, std::size_t most) {
  const std::string* best = nullptr;
  std::size_t least = most + 1;
  for (const std::string& name : names) {
    // What was typed so far counts as near.
    const std::size_t distance = word.size() > 1 && name.rfind(word, 0) == 0 ? 1 : editDistance(word, name);
    if (distance >= least) continue;
    least = distance;
    best = &name;
  }
  return best == nullptr ? "" : " Did you mean " + printable(*best) + "?";
}

}  // namespace bocst::program
