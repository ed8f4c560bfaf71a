// SPDX-License-Identifier: BSD-3-Clause
#include "tree/node_store.h"

#include <stdexcept>
#include <utility>

#include "bounds/merge.h"

namespace bocst::tree {

std::uint32_t NodeStore::append(NodeRef node, std::uint8_t grey, std::int64_t now) {
  // If one of the three appends throws, the next block uses the elements that were appended.
  const std::uint32_t index = blocks.size();
  if (index >= NodeRef::kMostBlocks) throw std::length_error("bocst: a tree of more than 2^29 blocks");
  if (records.size() == index) records.append(1);
  if (last_use.size() == index) last_use.append(1);
  blocks.append(1);
  blocks[index].grey = grey;
  records[index].parent = node;
  last_use[index].store(now, std::memory_order_relaxed);
  return index;
}

void NodeStore::addRefit(NodeRef node, const bounds::NodeBounds& bounds) {
  refits_.push_back({node, bounds});
  refits_wait_.store(true, std::memory_order_relaxed);
}

void NodeStore::refit() {
  refits_wait_.store(false, std::memory_order_relaxed);
  std::vector<Refit> refits;
  refits.swap(refits_);
  std::vector<std::uint8_t> changed(blocks.size(), 0);
  const auto apply = [&](NodeRef node, const bounds::NodeBounds& bounds) {
    // The root's bounds are those of the mesh: what a walk in order visits must not depend on what has grown.
    if (node.isRoot()) return;
    blocks[node.block()].octants.set(node.octant(), bounds);
    changed[node.block()] = 1;
  };
  for (const Refit& r : refits) apply(r.node, r.bounds);
  // Children come after their parents, so one backward pass reaches the root.
  for (std::uint32_t i = blocks.size(); i-- > 0;) {
    if (!changed[i]) continue;
    BlockRecord& record = records[i];
    const bounds::NodeBounds before = record.own;
    bounds::tightenBox(blocks[i].octants, blocks[i].grey, record.own);
    bounds::tightenSlab(blocks[i].octants, blocks[i].grey, record.own);
    if (!(record.own == before)) apply(record.parent, record.own);
  }
}

void NodeStore::clear() {
  blocks.clear();
  records.clear();
  last_use.clear();
  lists.clear();
  refits_.clear();
  refits_wait_.store(false, std::memory_order_relaxed);
}

void NodeStore::swap(NodeStore& other) {
  blocks.swap(other.blocks);
  records.swap(other.records);
  last_use.swap(other.last_use);
  lists.swap(other.lists);
  std::swap(root_bounds, other.root_bounds);
  refits_.swap(other.refits_);
  const bool wait = refits_wait_.load(std::memory_order_relaxed);
  refits_wait_.store(other.refits_wait_.load(std::memory_order_relaxed), std::memory_order_relaxed);
  other.refits_wait_.store(wait, std::memory_order_relaxed);
}

}  // namespace bocst::tree
