// SPDX-License-Identifier: BSD-3-Clause
// How branches go: by age and by budget, and where their triangles are then.
#include <algorithm>
#include <mutex>
#include <numeric>

#include "tree/tree.h"

namespace bocst::tree {

void Tree::collectTriangles(Link link, const lattice::Cell& cell, std::vector<std::uint32_t>& ids) const {
  if (link.tag() == Link::kBlock) {
    const Block& block = blocks_[link.index()];
    for (int o = 0; o < 8; ++o) {
      if (block.grey >> o & 1) collectTriangles(block.child[o].load(std::memory_order_relaxed), cell.octant(o), ids);
    }
  } else if (link.isList()) {
    list(link).appendTo(ids);
  } else {
    grid_->gather(surface_, cell, ids);
  }
}

// The list of a node whose block goes.
Link Tree::regained(Link block, const lattice::Cell& cell, TriangleLists& lists) const {
  if (grid_ != nullptr && cell.level <= grid_->level()) return Link();
  const std::uint32_t own = records_[block.index()].own_list;
  if (own != Block::kNone) {
    const bool is_short = !lists_.isKept(own) && lists_[own].count <= kLeafTriangles;
    return Link(is_short ? Link::kShortList : Link::kList, lists.addCopy(lists_, own));
  }
  std::vector<std::uint32_t> ids;
  collectTriangles(block, cell, ids);
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  return Link(ids.size() <= kLeafTriangles ? Link::kShortList : Link::kList, lists.add(ids.data(), ids.size()));
}

void Tree::dropUnusedShelves() {
  // Which shelves do the lists that stay lie on? Each is known by its first use.
  std::vector<std::uint8_t> used(shelves_.size(), 0);
  const auto mark = [&](std::uint32_t list) {
    if (lists_.isKept(list)) used[lists_.place(list).shelf] = 1;
  };
  for (std::uint32_t i = 0; i < blocks_.size(); ++i) {
    const Block& block = blocks_[i];
    if (records_[i].own_list != Block::kNone) mark(records_[i].own_list);
    for (int o = 0; o < 8; ++o) {
      const Link link = block.child[o].load(std::memory_order_relaxed);
      if ((block.grey >> o & 1) != 0 && link.isList()) mark(link.index());
    }
  }
  for (std::size_t i = 0; i < shelves_.size(); ++i) {
    if (!used[i]) shelves_[i] = nullptr;
  }
}

// Copies what stays into fresh pools: what goes leaves no holes, and nothing of it is looked at again.
void Tree::keepOnly(const std::vector<std::uint8_t>& keep) {
  const Link old_root = root_.load(std::memory_order_relaxed);
  std::size_t before = 0, after = 0;
  for (auto& n : nodes_at_) {
    before += n;
    n = 0;
  }
  nodes_at_[1] = 1;

  struct Move {
    Link from;
    NodeRef to;
    lattice::Cell cell;
  };
  std::vector<Move> moves{{old_root, NodeRef{}, lattice::Cell{}}};
  const bool root_stays = old_root.tag() == Link::kBlock && old_root.index() < keep.size() && keep[old_root.index()];
  if (!root_stays) {
    grid_known_.store(nullptr, std::memory_order_relaxed);
    grid_.reset();
    grid_tried_ = false;
    root_.store(Link(), std::memory_order_relaxed);
    blocks_.clear();
    records_.clear();
    stamps_.clear();
    lists_.clear();
    shelves_.clear();
  } else {
    Pool<Block, 5> blocks;
    Pool<BlockRecord, 5> records;
    Pool<std::atomic<std::int64_t>, 5> stamps;
    TriangleLists lists;
    Link root;
    while (!moves.empty()) {
      const Move move = moves.back();
      moves.pop_back();
      Link link = move.from;
      if (link.tag() == Link::kBlock && !keep[link.index()]) {
        link = regained(move.from, move.cell, lists);
      } else if (link.isList()) {
        link = Link(link.tag(), lists.addCopy(lists_, link.index()));
      } else if (link.tag() == Link::kBlock) {
        const Block& from = blocks_[link.index()];
        const std::uint32_t own_list = records_[link.index()].own_list, index = blocks.append(1);
        records.append(1);
        stamps.append(1);
        Block& to = blocks[index];
        to.octants = from.octants;
        to.grey = from.grey;
        to.level = from.level;
        std::copy_n(from.at, 3, to.at);
        records[index].own = records_[link.index()].own;
        if (own_list != Block::kNone) records[index].own_list = lists.addCopy(lists_, own_list);
        records[index].parent = move.to;
        stamps[index].store(stamps_[link.index()].load(std::memory_order_relaxed), std::memory_order_relaxed);
        nodes_at_[from.level + 1] += __builtin_popcount(from.grey);
        for (int o = 0; o < 8; ++o) {
          if (from.grey >> o & 1) {
            moves.push_back(
                {from.child[o].load(std::memory_order_relaxed), NodeRef::octant(index, o), move.cell.octant(o)});
          }
        }
        link = Link(Link::kBlock, index);
      }
      std::atomic<Link>& place = move.to.isRoot() ? root_ : blocks[move.to.block()].child[move.to.octant()];
      place.store(link, std::memory_order_relaxed);
    }
    blocks_.swap(blocks);
    records_.swap(records);
    stamps_.swap(stamps);
    lists_.swap(lists);
    dropUnusedShelves();
  }
  refits_.clear();  // they name nodes of the old pools
  refits_wait_.store(false, std::memory_order_relaxed);
  for (const auto& n : nodes_at_) after += n;
  if (before > after) pruned_ += before - after;
  countBytes();
}

void Tree::pruneAlone(std::int64_t now, bool budget_only) {
  const std::int64_t ttl = std::chrono::duration_cast<std::chrono::nanoseconds>(options_.ttl).count();
  const auto is_old = [&](std::uint32_t block) { return now - stamps_[block].load(std::memory_order_relaxed) > ttl; };
  const auto some_are_old = [&] {
    std::uint32_t i = blocks_.size();
    while (i > 0 && !is_old(i - 1)) --i;
    return i > 0;
  };
  if (!budget_only && ttl > 0 && root_.load(std::memory_order_relaxed).tag() == Link::kBlock && some_are_old()) {
    // Children come after their parents in the pool, so one backward pass sees every child first.
    std::vector<std::uint8_t> keep(blocks_.size(), 1);
    bool some = false;
    for (std::uint32_t i = blocks_.size(); i-- > 0;) {
      const Block& block = blocks_[i];
      bool deepest = true;
      for (int o = 0; o < 8; ++o) {
        if ((block.grey >> o & 1) == 0) continue;
        const Link child = block.child[o].load(std::memory_order_relaxed);
        if (child.tag() != Link::kBlock) continue;
        deepest = false;
        if (!keep[child.index()]) stamps_[i].store(now, std::memory_order_relaxed);  // its own time starts (3.1)
      }
      if (deepest && is_old(i)) {
        keep[i] = 0;
        some = true;
      }
    }
    if (some) keepOnly(keep);
  }
  applyBudget();
}

void Tree::applyBudget() {
  const std::size_t budget = options_.memory_budget;
  if (budget == 0 || bytes_ <= budget) return;
  // Lists of dropped branches come back at their parents, so how much must go shows only when it is gone.
  auto count = static_cast<std::size_t>(0.75 * static_cast<double>(budget) / static_cast<double>(bytes_) *
                                        static_cast<double>(blocks_.size()));
  for (;; count /= 2) {
    // Most recently used first, and with each block all that leads to it.
    std::vector<std::uint32_t> order(blocks_.size());
    std::iota(order.begin(), order.end(), 0u);
    std::stable_sort(order.begin(), order.end(), [this](std::uint32_t a, std::uint32_t b) {
      return stamps_[a].load(std::memory_order_relaxed) > stamps_[b].load(std::memory_order_relaxed);
    });
    std::vector<std::uint8_t> keep(blocks_.size(), 0);
    for (std::size_t k = 0; k < std::min(count, order.size()); ++k) {
      for (std::uint32_t i = order[k]; !keep[i]; i = records_[i].parent.block()) {
        keep[i] = 1;
        if (records_[i].parent.isRoot()) break;
      }
    }
    keepOnly(keep);
    if (bytes_ <= budget || count == 0) return;
  }
}

void Tree::afterQuery(std::int64_t now) {
  const bool refits = refits_wait_.load(std::memory_order_relaxed);
  const bool over_budget = options_.memory_budget != 0 && bytes_ > options_.memory_budget;
  std::int64_t due = next_prune_.load(std::memory_order_relaxed);
  bool time_to = options_.ttl.count() > 0 && now >= due;
  if (time_to) {
    // A quarter of ttl between looks keeps the cost away from queries; whoever moves the time does the work.
    const std::int64_t step = std::chrono::duration_cast<std::chrono::nanoseconds>(options_.ttl).count() / 4 + 1;
    time_to = next_prune_.compare_exchange_strong(due, now + step, std::memory_order_relaxed);
  }
  if (!refits && !over_budget && !time_to) return;
  const std::unique_lock<Gate> alone(gate_, std::try_to_lock);
  if (!alone.owns_lock()) return;
  if (refits) refit();
  if (over_budget || time_to) pruneAlone(now, !time_to);
}

}  // namespace bocst::tree
