// SPDX-License-Identifier: BSD-3-Clause
// Drops branches by age and by budget, and gives their triangles back to their nodes.
#include <algorithm>
#include <mutex>
#include <numeric>

#include "tree/box_tree.h"
#include "tree/tree.h"

namespace bocst::tree {
namespace {

/// Queries drop old branches when these have at least one block in this many.
constexpr std::uint32_t kWorthwhileShare = 64;

}  // namespace

/// What becomes of a block. A stripped one stays without the corners of its leaves, which are most of what it takes:
/// queries that come back pack those of the leaves that they need.
enum class Tree::Fate : std::uint8_t { kDropped, kStripped, kKept };

// True if the block has no child blocks.
bool Tree::isDeepestBlock(const Block& block) {
  for (int o = 0; o < 8; ++o) {
    const bool is_grey = (block.grey >> o & 1) != 0;
    if (is_grey && block.child[o].load(std::memory_order_relaxed).tag() == ChildRef::kBlock) return false;
  }
  return true;
}

bool Tree::hasCorners(const Block& block) const {
  for (int o = 0; o < 8; ++o) {
    if ((block.grey >> o & 1) != 0 && isPacked(block.child[o].load(std::memory_order_relaxed))) return true;
  }
  return false;
}

void Tree::collectTriangles(ChildRef ref, const lattice::Cell& cell, std::vector<std::uint32_t>& ids) const {
  if (ref.tag() == ChildRef::kBlock) {
    const Block& block = nodes_.blocks[ref.index()];
    for (int o = 0; o < 8; ++o) {
      if (block.grey >> o & 1) collectTriangles(block.child[o].load(std::memory_order_relaxed), cell.octant(o), ids);
    }
  } else if (ref.isList()) {
    list(ref).appendTo(ids);
  } else {
    grid_->gather(surface_, cell, ids);
  }
}

// The list of a node whose block goes.
ChildRef Tree::regained(ChildRef block, const lattice::Cell& cell, TriangleLists& lists) const {
  if (grid_ && cell.level <= grid_->level()) return ChildRef();
  const std::uint32_t own = nodes_.records[block.index()].own_list;
  if (own != Block::kNone) {
    const bool is_short = !nodes_.lists.isOnDevice(own) && nodes_.lists[own].count <= kMaxLeafTriangles;
    return ChildRef(is_short ? ChildRef::kShortList : ChildRef::kList, lists.addCopy(nodes_.lists, own));
  }
  std::vector<std::uint32_t> ids;
  collectTriangles(block, cell, ids);
  if (!nodes_.blocks[block.index()].isLoose()) {  // lanes share no triangles, cells do
    std::sort(ids.begin(), ids.end());
    ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  }
  return ChildRef(ids.size() <= kMaxLeafTriangles ? ChildRef::kShortList : ChildRef::kList,
                  lists.add(ids.data(), ids.size()));
}

// The tree is one sphere again.
void Tree::dropTree() {
  NodeCounts gone{};
  countNodes(root_.load(std::memory_order_relaxed), 1, gone);
  pruned_ += std::accumulate(gone.begin(), gone.end(), std::size_t{0});
  is_whole_ = false;
  is_complete_ = false;
  grid_.reset();
  grid_tried_ = false;
  startRent();
  root_.store(ChildRef(), std::memory_order_relaxed);
  nodes_.clear();
  startGeneration();
}

// What names nodes of the old store goes.
void Tree::startGeneration() {
  ++generation_;
  is_stripped_ = false;
  for (std::atomic<std::uint32_t>& leaf : noted_) leaf.store(NodeRef::kRoot, std::memory_order_relaxed);
  noted_count_.store(0, std::memory_order_relaxed);
  dropNodeTable();
  countBytes();
}

// Copies what stays into a fresh store: what goes leaves no holes, and nothing of it is looked at again. In one
// function, as a node is copied whole: its children, list, record and times belong to one move.
void Tree::keepOnly(const std::vector<Fate>& fates) {
  const ChildRef old_root = root_.load(std::memory_order_relaxed);
  if (old_root.tag() != ChildRef::kBlock || fates[old_root.index()] == Fate::kDropped) return dropTree();
  if (nodes_.blocks[old_root.index()].isLoose()) grid_.reset();  // its cells are not those of the tree any more
  struct Move {
    ChildRef from;
    NodeRef to;
    lattice::Cell cell;
    bool is_stripped;
  };
  std::vector<Move> moves{{old_root, NodeRef{}, lattice::Cell{}, false}};
  bool is_any_stripped = false;
  NodeStore kept;
  kept.root_bounds = nodes_.root_bounds;
  ChildRef root;
  NodeCounts gone{};
  while (!moves.empty()) {
    const Move move = moves.back();
    moves.pop_back();
    ChildRef ref = move.from;
    if (ref.tag() == ChildRef::kBlock && fates[ref.index()] == Fate::kDropped) {
      countNodes(ref, move.cell.level, gone);
      ref = regained(move.from, move.cell, kept.lists);
    } else if (move.is_stripped && isPacked(ref)) {
      ref = ChildRef(ref.tag(), kept.lists.addWithoutCorners(nodes_.lists, ref.index()));
    } else if (ref.isList()) {
      ref = ChildRef(ref.tag(), kept.lists.addCopy(nodes_.lists, ref.index()));
    } else if (ref.tag() == ChildRef::kBlock) {
      const Block& from = nodes_.blocks[ref.index()];
      const std::uint32_t own_list = nodes_.records[ref.index()].own_list;
      const std::uint32_t index =
          kept.append(move.to, from.grey, nodes_.last_use[ref.index()].load(std::memory_order_relaxed));
      Block& to = kept.blocks[index];
      to.octants = from.octants;
      to.shape = from.shape;
      std::copy_n(from.at, 3, to.at);
      kept.records[index].own = nodes_.records[ref.index()].own;
      if (own_list != Block::kNone) kept.records[index].own_list = kept.lists.addCopy(nodes_.lists, own_list);
      const bool is_stripped = fates[ref.index()] == Fate::kStripped;
      kept.records[index].is_stripped = is_stripped || nodes_.records[ref.index()].is_stripped;
      is_any_stripped |= kept.records[index].is_stripped;
      for (int o = 0; o < 8; ++o) {
        if (from.grey >> o & 1) {
          moves.push_back({from.child[o].load(std::memory_order_relaxed), NodeRef::octant(index, o),
                           move.cell.octant(o), is_stripped});
        }
      }
      ref = ChildRef(ChildRef::kBlock, index);
    }
    if (move.to.isRoot()) {
      root = ref;
    } else {
      kept.blocks[move.to.block()].child[move.to.octant()].store(ref, std::memory_order_relaxed);
    }
  }
  // There was memory for all of it.
  root_.store(root, std::memory_order_relaxed);
  nodes_.swap(kept);
  const std::size_t count = std::accumulate(gone.begin(), gone.end(), std::size_t{0});
  pruned_ += count;
  is_whole_ = is_whole_ && count == 0 && !is_any_stripped;
  if (count != 0) is_complete_ = false;
  startGeneration();
  is_stripped_ = is_any_stripped;
}

template <typename T>
bool Tree::dropIfOld(OnDemand<T>& structure, std::int64_t now) {
  if (!structure || !isOld(structure.lastUse(), now)) return false;
  structure.drop();
  return true;
}

void Tree::pruneAlone(std::int64_t now, Pruning pruning) {
  const bool budget_only = pruning == Pruning::kBudget;
  const auto is_old = [&](std::uint32_t block) {
    return isOld(nodes_.last_use[block].load(std::memory_order_relaxed), now);
  };
  const ChildRef root = root_.load(std::memory_order_relaxed);
  if (!budget_only && ttl_ > 0 && root.tag() == ChildRef::kBlock) {
    const bool is_used = pruning == Pruning::kAfterRest || (pruning == Pruning::kWorthwhile && !is_old(root.index()));
    // What stays is copied, so for few blocks a query of a large tree would pay much.
    const std::uint32_t least = pruning == Pruning::kAll ? 1 : std::max(1u, nodes_.blocks.size() / kWorthwhileShare);
    std::uint32_t changed = 0;
    std::vector<Fate> fates(nodes_.blocks.size(), Fate::kKept);
    for (std::uint32_t i = 0; i < nodes_.blocks.size(); ++i) {
      if (!is_old(i)) continue;
      const Block& block = nodes_.blocks[i];
      if (is_used && block.isLoose()) {
        if (hasCorners(block)) fates[i] = Fate::kStripped;
      } else if (isDeepestBlock(block)) {
        fates[i] = Fate::kDropped;
      }
      changed += fates[i] != Fate::kKept;
    }
    if (changed >= least) {
      for (std::uint32_t i = 0; i < nodes_.blocks.size(); ++i) {
        const NodeRef parent = nodes_.records[i].parent;
        // The parent's own time starts (3.1).
        if (fates[i] == Fate::kDropped && !parent.isRoot()) {
          nodes_.last_use[parent.block()].store(now, std::memory_order_relaxed);
        }
      }
      keepOnly(fates);
    }
  }
  if (!budget_only) {
    const bool boxes_went = dropIfOld(boxes_, now), interior_went = dropIfOld(interior_, now);
    if (boxes_went || interior_went) countBytes();
    const bool is_at_rest = root_.load(std::memory_order_relaxed).tag() != ChildRef::kBlock && !boxes_ && !interior_;
    if (is_at_rest && isOld(recall_time_, now)) forgetMesh();
  }
  applyBudget();
}

void Tree::applyBudget() {
  const std::size_t budget = options_.memory_budget;
  if (budget == 0 || bytes_ <= budget) return;
  // Lists of dropped branches come back at their parents, so how much must go shows only when it is gone.
  auto count = static_cast<std::size_t>(0.75 * static_cast<double>(budget) / static_cast<double>(bytes_) *
                                        static_cast<double>(nodes_.blocks.size()));
  for (;; count /= 2) {
    // Most recently used first, and with each block all that leads to it.
    std::vector<std::uint32_t> order(nodes_.blocks.size());
    std::iota(order.begin(), order.end(), 0u);
    std::stable_sort(order.begin(), order.end(), [this](std::uint32_t a, std::uint32_t b) {
      return nodes_.last_use[a].load(std::memory_order_relaxed) > nodes_.last_use[b].load(std::memory_order_relaxed);
    });
    std::vector<Fate> fates(nodes_.blocks.size(), Fate::kDropped);
    for (std::size_t k = 0; k < std::min(count, order.size()); ++k) {
      for (std::uint32_t i = order[k]; fates[i] == Fate::kDropped; i = nodes_.records[i].parent.block()) {
        fates[i] = Fate::kKept;
        if (nodes_.records[i].parent.isRoot()) break;
      }
    }
    keepOnly(fates);
    if (bytes_ <= budget || count == 0) return;
  }
}

void Tree::afterQuery(std::int64_t now) {
  const bool refits = nodes_.hasRefits();
  const bool over_budget = options_.memory_budget != 0 && bytes_ > options_.memory_budget;
  std::int64_t due = next_prune_.load(std::memory_order_relaxed);
  bool time_to = isPruneDue(now);
  const bool is_after_rest = time_to && due != 0 && isOld(due, now);  // the first look finds 0
  if (time_to) {
    // A quarter of ttl between looks keeps the cost away from queries; whoever moves the time does the work.
    const std::int64_t step = ttl_ / 4 + 1, next = now > kNeverDue - step ? kNeverDue : now + step;
    time_to = next_prune_.compare_exchange_strong(due, next, std::memory_order_relaxed);
  }
  if (!refits && !over_budget && !time_to) return;
  const std::unique_lock<thread::ShardedLock> alone(query_lock_, std::try_to_lock);
  if (!alone.owns_lock()) return;
  if (refits) nodes_.refit();
  if (time_to) {
    // Once: the next look may drop what no query has used since.
    spared_after_rest_ = is_after_rest && !spared_after_rest_;
    pruneAlone(now, spared_after_rest_ ? Pruning::kAfterRest : Pruning::kWorthwhile);
  } else if (over_budget) {
    pruneAlone(now, Pruning::kBudget);
  }
}

}  // namespace bocst::tree
