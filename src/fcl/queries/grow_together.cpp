// SPDX-License-Identifier: BSD-3-Clause
#include "fcl/queries/grow_together.h"

#include <utility>

#include "fcl/adapters/models.h"
#include "fcl/adapters/pair.h"
#include "fcl/queries/ordered_pair.h"
#include "fcl/queries/query_scope.h"
#include "query/collide/deferred_pairs.h"
#include "query/collide/sphere_walk.h"

namespace bocst::fcl_adapter {
namespace {

using Outcome = query::SphereWalk::Outcome;

constexpr std::size_t kFirstBatch = query::DeferredPairs<query::TreeSide, query::TreeSide>::kFirstBatch;

struct Walk {
  const query::TreeSide *a, *b;
  query::SimilarityTransform b_in_a;
  std::size_t pair;

  query::SphereWalk spheres() const { return {*a, *b, b_in_a}; }
};

/// What a thread keeps between calls, so that those that grow nothing allocate nothing.
struct Scratch {
  std::vector<tree::Tree*> trees;
  std::vector<query::TreeSide> sides;
  std::vector<Walk> walks;
  std::vector<tree::Tree::Growth> growths;
  std::vector<Spheres> found;
};

/// The session of one call about the trees in a scratch, as QueryScope: takes their query locks shared, in address
/// order, and makes their sides.
class TreesScope {
 public:
  explicit TreesScope(Scratch& s) : s_(s), shard_(thread::ShardedLock::shard()) {
    std::sort(s_.trees.begin(), s_.trees.end(), std::less<tree::Tree*>());
    s_.trees.erase(std::unique(s_.trees.begin(), s_.trees.end()), s_.trees.end());
    s_.sides.clear();
    try {
      for (tree::Tree* tree : s_.trees) {
        s_.sides.emplace_back(*tree);
        tree->queryLock().lock_shared(shard_);
        ++locked_;
      }
    } catch (...) {
      release();
      throw;
    }
  }
  ~TreesScope() {
    release();
    for (const query::TreeSide& side : s_.sides) endQuery(side);
  }
  TreesScope(const TreesScope&) = delete;
  TreesScope& operator=(const TreesScope&) = delete;

  const query::TreeSide& sideOf(const tree::Tree& tree) const {
    return *std::find_if(s_.sides.begin(), s_.sides.end(), [&](const auto& side) { return &side.tree() == &tree; });
  }

 private:
  void release() {
    for (; locked_ > 0; --locked_) s_.trees[locked_ - 1]->queryLock().unlock_shared(shard_);
  }

  Scratch& s_;
  const std::size_t shard_;
  std::size_t locked_ = 0;
};

bool isLess(const tree::Tree::Growth& x, const tree::Tree::Growth& y) {
  return x.tree != y.tree ? std::less<tree::Tree*>()(x.tree, y.tree) : x.node < y.node;
}

void growAll(std::vector<tree::Tree::Growth>& growths) {
  if (growths.empty()) return;
  std::sort(growths.begin(), growths.end(), isLess);
  const auto same = [](const auto& x, const auto& y) { return x.tree == y.tree && x.node == y.node; };
  growths.erase(std::unique(growths.begin(), growths.end(), same), growths.end());
  tree::Tree::grow(growths);
}

}  // namespace

template <typename S>
bool growsTogether(const Model<S>& a, const Model<S>& b) {
  const tree::Tree &x = treeOf(a), &y = treeOf(b);
  // A small budget would have to be grown again for each pose.
  const bool is_bounded = x.options().memory_budget != 0 || y.options().memory_budget != 0;
  return x.conservative() && y.conservative() && (x.growsSlowly() || y.growsSlowly()) && !is_bounded;
}

template <typename S>
const std::vector<Spheres>& growTogether(const std::vector<PosedPair<S>>& pairs) {
  thread_local Scratch s;
  s.found.assign(pairs.size(), Spheres::kApart);
  s.trees.clear();
  for (const PosedPair<S>& p : pairs) {
    for (const Model<S>* model : {p.a, p.b}) {
      if (s.trees.empty() || s.trees.back() != &treeOf(*model)) s.trees.push_back(&treeOf(*model));
    }
  }
  const TreesScope scope(s);
  s.walks.clear();
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    const PosedPair<S>& p = pairs[k];
    const bool turned = walksTurned(treeOf(*p.a), p.X_WA, treeOf(*p.b), p.X_WB);
    const OrderedPair<S> ordered{p.a, p.X_WA, p.b, p.X_WB, turned};
    const query::TreeSide *a = &scope.sideOf(treeOf(*p.a)), *b = &scope.sideOf(treeOf(*p.b));
    ordered.inCallersOrder(a, b);
    Walk walk{a, b, relate<S>(ordered, *a, *b).b_in_a, k};
    walk.b_in_a.tolerance += marginOf(p.a, p.b) / unitOf(*a);
    if (!(walk.b_in_a.tolerance < 1e15)) {
      s.found[k] = Spheres::kUnknown;  // beyond this a query looks at the distance first
    } else if (!walk.spheres().isNeedless()) {
      s.walks.push_back(walk);
    }
  }
  for (std::size_t batch = kFirstBatch; !s.walks.empty(); batch *= 2) {
    s.growths.clear();
    const auto isDone = [&](const Walk& walk) {
      const Outcome outcome = walk.spheres().look(batch, s.growths);
      if (outcome == Outcome::kMeet) s.found[walk.pair] = Spheres::kMeet;
      return outcome != Outcome::kNeedsGrowth;
    };
    s.walks.erase(std::remove_if(s.walks.begin(), s.walks.end(), isDone), s.walks.end());
    growAll(s.growths);
  }
  return s.found;
}

#define BOCST_INSTANTIATE(S)                                     \
  template bool growsTogether(const Model<S>&, const Model<S>&); \
  template const std::vector<Spheres>& growTogether(const std::vector<PosedPair<S>>&);
BOCST_INSTANTIATE(float)
BOCST_INSTANTIATE(double)
#undef BOCST_INSTANTIATE

}  // namespace bocst::fcl_adapter
