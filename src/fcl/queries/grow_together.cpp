// SPDX-License-Identifier: BSD-3-Clause
#include "fcl/queries/grow_together.h"

#include <shared_mutex>
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

/// The session of one call about several trees, as QueryScope.
class TreesScope {
 public:
  explicit TreesScope(std::vector<tree::Tree*> trees) {
    std::sort(trees.begin(), trees.end(), std::less<tree::Tree*>());
    trees.erase(std::unique(trees.begin(), trees.end()), trees.end());
    for (tree::Tree* tree : trees) {
      locks_.emplace_back(tree->queryLock());
      sides_.emplace_back(*tree);
    }
  }
  ~TreesScope() {
    locks_.clear();
    for (const query::TreeSide& side : sides_) endQuery(side);
  }
  TreesScope(const TreesScope&) = delete;
  TreesScope& operator=(const TreesScope&) = delete;

  const query::TreeSide& sideOf(const tree::Tree& tree) const {
    return *std::find_if(sides_.begin(), sides_.end(), [&](const auto& side) { return &side.tree() == &tree; });
  }

 private:
  std::vector<std::shared_lock<thread::ShardedLock>> locks_;
  std::vector<query::TreeSide> sides_;
};

struct Walk {
  const query::TreeSide *a, *b;
  query::SimilarityTransform b_in_a;
  std::size_t pair;

  query::SphereWalk spheres() const { return {*a, *b, b_in_a}; }
};

bool isLess(const tree::Tree::Growth& x, const tree::Tree::Growth& y) {
  return x.tree != y.tree ? std::less<tree::Tree*>()(x.tree, y.tree) : x.node < y.node;
}

void growAll(std::vector<tree::Tree::Growth>& growths) {
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
std::vector<Spheres> growTogether(const std::vector<PosedPair<S>>& pairs) {
  std::vector<Spheres> found(pairs.size(), Spheres::kApart);
  std::vector<tree::Tree*> trees;
  for (const PosedPair<S>& p : pairs) {
    trees.push_back(&treeOf(*p.a));
    trees.push_back(&treeOf(*p.b));
  }
  const TreesScope scope(std::move(trees));
  std::vector<Walk> walks;
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    const PosedPair<S>& p = pairs[k];
    const bool turned = walksTurned(treeOf(*p.a), p.X_WA, treeOf(*p.b), p.X_WB);
    const OrderedPair<S> ordered{p.a, p.X_WA, p.b, p.X_WB, turned};
    const query::TreeSide *a = &scope.sideOf(treeOf(*p.a)), *b = &scope.sideOf(treeOf(*p.b));
    ordered.inCallersOrder(a, b);
    Walk walk{a, b, relate<S>(ordered, *a, *b).b_in_a, k};
    walk.b_in_a.tolerance += marginOf(p.a, p.b) / unitOf(*a);
    if (!(walk.b_in_a.tolerance < 1e15)) {
      found[k] = Spheres::kUnknown;  // beyond this a query looks at the distance first
    } else if (!walk.spheres().isNeedless()) {
      walks.push_back(walk);
    }
  }
  std::vector<tree::Tree::Growth> growths;
  for (std::size_t batch = kFirstBatch; !walks.empty(); batch *= 2) {
    growths.clear();
    const auto isDone = [&](const Walk& walk) {
      const Outcome outcome = walk.spheres().look(batch, growths);
      if (outcome == Outcome::kMeet) found[walk.pair] = Spheres::kMeet;
      return outcome != Outcome::kNeedsGrowth;
    };
    walks.erase(std::remove_if(walks.begin(), walks.end(), isDone), walks.end());
    growAll(growths);
  }
  return found;
}

#define BOCST_INSTANTIATE(S)                                     \
  template bool growsTogether(const Model<S>&, const Model<S>&); \
  template std::vector<Spheres> growTogether(const std::vector<PosedPair<S>>&);
BOCST_INSTANTIATE(float)
BOCST_INSTANTIATE(double)
#undef BOCST_INSTANTIATE

}  // namespace bocst::fcl_adapter
