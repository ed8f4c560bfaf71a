// SPDX-License-Identifier: BSD-3-Clause
// Applies tighter bounds that growth found, up to the root.
#include "bounds/merge.h"
#include "tree/tree.h"

namespace bocst::tree {
void Tree::refit() {
  refits_wait_.store(false, std::memory_order_relaxed);
  std::vector<Refit> refits;
  refits.swap(refits_);
  std::vector<std::uint8_t> changed(blocks_.size(), 0);
  const auto apply = [&](NodeRef node, const bounds::NodeBounds& bounds) {
    if (node.isRoot()) {
      root_bounds_ = bounds;
    } else {
      blocks_[node.block()].octants.set(node.octant(), bounds);
      changed[node.block()] = 1;
    }
  };
  for (const Refit& r : refits) apply(r.node, r.bounds);
  // Children come after their parents in the pool, so one backward pass reaches the root.
  for (std::uint32_t i = blocks_.size(); i-- > 0;) {
    if (!changed[i]) continue;
    BlockRecord& record = records_[i];
    const bounds::NodeBounds before = record.own;
    bounds::tightenBox(blocks_[i].octants, blocks_[i].grey, record.own);
    bounds::tightenSlab(blocks_[i].octants, blocks_[i].grey, record.own);
    if (!(record.own == before)) apply(record.parent, record.own);
  }
}

}  // namespace bocst::tree
