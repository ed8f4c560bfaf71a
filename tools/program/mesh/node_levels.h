// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/node_view.h>

#include <algorithm>
#include <cstddef>
#include <vector>

namespace bocst::program {

/// The number of nodes of each level, that of the root first.
inline std::vector<std::size_t> nodesPerLevel(const std::vector<NodeView>& nodes) {
  std::vector<std::size_t> counts;
  for (const NodeView& node : nodes) {
    counts.resize(std::max(counts.size(), static_cast<std::size_t>(node.level)));
    ++counts[static_cast<std::size_t>(node.level) - 1];
  }
  return counts;
}

}  // namespace bocst::program
