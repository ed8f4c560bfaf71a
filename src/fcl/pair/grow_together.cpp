// SPDX-License-Identifier: BSD-3-Clause
#include "fcl/pair/grow_together.h"

#include <algorithm>
#include <chrono>
#include <optional>

#include "fcl/adapters/models.h"
#include "fcl/adapters/pair.h"
#include "fcl/pair/ordered_pair.h"
#include "fcl/pair/query_scope.h"
#include "query/collide/deferred_pairs.h"
#include "query/collide/sphere_walk.h"
#include "thread/of_thread.h"

namespace bocst::fcl_adapter {
namespace {

using Outcome = query::SphereWalk::Outcome;

constexpr std::size_t kFirstBatch = query::DeferredPairs<query::TreeSide, query::TreeSide>::kFirstBatch;

/// Walks whose nodes grow together, and that the host looks at in turn: more of them grow more than they need, as none
/// knows what the others ask for.
constexpr std::size_t kMostTogether = 256;

/// Pairs of nodes that grow at once for one walk.
constexpr std::size_t kMostBatch = std::size_t{1} << 20;

/// A device grows few nodes for a walk at a time. After so many rounds the host grows twice as many each time.
constexpr int kMostDeviceRounds = 16;

struct Walk {
  const query::TreeSide *a, *b;
  query::SimilarityTransform b_in_a;
  std::size_t pair;
  std::size_t batch;  // of pairs of nodes that grow next, if the host looks
  int device_rounds = 0;

  query::SphereWalk spheres() const { return {*a, *b, b_in_a}; }
  oracle::Oracle& oracle() const { return a->tree().oracle(); }
  bool hasOneOracle() const { return &oracle() == &b->tree().oracle(); }
};

/// What a thread keeps between calls, so that those that grow nothing allocate nothing.
struct Scratch {
  std::vector<tree::Tree*> trees;
  std::vector<query::TreeSide> sides;
  std::vector<Walk> walks;
  std::vector<tree::Tree::Growth> growths;
  std::vector<Spheres> found;
  oracle::DeviceWalks device;
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
    for (tree::Tree* tree : s_.trees) tryAtEnd([&] { tree->packNoted(); });
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

/// The walks of a scratch, over what is resident; what they need then grows, until all have their answer.
class Walks {
 public:
  explicit Walks(Scratch& s) : s_(s) {}

  // What some walks need grows while the host looks at others: the first `waiting_` are those that wait for the batch
  // that is under way.
  void run() {
    std::optional<tree::Tree::Batch> batch;
    const auto finish = [&] {
      if (batch) batch->finish();
      batch.reset();
      waiting_ = 0;
    };
    while (!s_.walks.empty()) {
      s_.growths.clear();
      const bool device_walks = !is_refused_ && s_.walks.front().oracle().walksPairs(s_.walks.size());
      if (device_walks || waiting_ == s_.walks.size()) finish();
      const std::size_t next = device_walks && byDevice() ? s_.walks.size() : byHost();
      finish();
      if (s_.growths.empty()) continue;
      batch.emplace(s_.growths);
      waiting_ = next;
    }
  }

 private:
  using Found = oracle::DeviceWalks::Found;
  static constexpr std::uint32_t kNone = ~std::uint32_t{0};

  static double seconds() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
  }

  /// True if the walk has its answer. If not, adds what it needs.
  bool walkResident(Walk& walk) {
    const Outcome outcome = walk.spheres().walkResident(walk.batch, s_.growths);
    walk.batch = std::min(2 * walk.batch, kMostBatch);
    if (outcome == Outcome::kMeet) s_.found[walk.pair] = Spheres::kMeet;
    return outcome != Outcome::kNeedsGrowth;
  }

  /// Looks at some walks that do not wait; those that need growth then come first. Returns how many these are.
  std::size_t byHost() {
    const double begin = seconds();
    oracle::Oracle& oracle = s_.walks.front().oracle();
    const auto first = s_.walks.begin() + static_cast<std::ptrdiff_t>(waiting_);
    const std::size_t count = std::min(kMostTogether, s_.walks.size() - waiting_);
    const auto end = first + static_cast<std::ptrdiff_t>(count);
    const auto need_growth = std::remove_if(first, end, [this](Walk& walk) { return walkResident(walk); });
    const auto left = static_cast<std::size_t>(need_growth - first);
    s_.walks.erase(need_growth, end);
    const auto looked = s_.walks.begin() + static_cast<std::ptrdiff_t>(waiting_);
    std::rotate(s_.walks.begin(), looked, looked + static_cast<std::ptrdiff_t>(left));
    oracle.pairsTook(count, seconds() - begin, true);
    return left;
  }

  /// Walks on a device what one oracle takes; false where it takes nothing.
  bool byDevice() {
    // A scratch must not keep tables of models that go.
    struct Clear {
      oracle::DeviceWalks& device;
      ~Clear() { device.trees.clear(); }
    } clear{s_.device};
    oracle::Oracle& oracle = s_.walks.front().oracle();
    const auto is_its = [&](const Walk& walk) { return walk.hasOneOracle() && &walk.oracle() == &oracle; };
    if (!is_its(s_.walks.front())) return false;
    const double begin = seconds();
    s_.device.trees.clear();
    s_.device.pairs.clear();
    trees_.assign(s_.sides.size(), kNone);
    asked_.clear();
    for (std::size_t i = 0; i < s_.walks.size(); ++i) {
      oracle::DeviceWalks::Pair pair;
      if (!is_its(s_.walks[i]) || !s_.walks[i].spheres().describe(pair)) continue;
      pair.tree[0] = numberOf(*s_.walks[i].a);
      pair.tree[1] = numberOf(*s_.walks[i].b);
      if (s_.device.trees[pair.tree[0]].nodes == nullptr || s_.device.trees[pair.tree[1]].nodes == nullptr) continue;
      s_.device.pairs.push_back(pair);
      asked_.push_back(i);
    }
    if (asked_.empty()) return refuse();
    oracle.walkPairs(s_.device);
    const auto undone = std::count(s_.device.found.begin(), s_.device.found.end(), std::uint8_t{Found::kUndone});
    const std::size_t walked = asked_.size() - static_cast<std::size_t>(undone);
    if (walked == 0) return refuse();
    oracle.pairsTook(walked, seconds() - begin, false);
    for (std::size_t k = 0; k < s_.sides.size(); ++k) {
      if (trees_[k] == kNone) continue;
      query::SphereWalk::markUsed(s_.sides[k], s_.device.trees[trees_[k]]);
      query::SphereWalk::addWanted(s_.sides[k], s_.device.trees[trees_[k]], s_.growths);
    }
    take();
    return true;
  }

  /// The device is not asked again in this call.
  bool refuse() {
    is_refused_ = true;
    return false;
  }

  /// The number of a side's tree among those of the device.
  std::uint32_t numberOf(const query::TreeSide& side) {
    std::uint32_t& number = trees_[static_cast<std::size_t>(&side - s_.sides.data())];
    if (number == kNone) {
      number = static_cast<std::uint32_t>(s_.device.trees.size());
      s_.device.trees.push_back(query::SphereWalk::describe(side, side.tree().nodeTable()));
    }
    return number;
  }

  /// Takes what the device found. The host looks at what the device did not decide, at walks that have waited for nodes
  /// often, and, if the device names no node, at all that wait.
  void take() {
    const bool grows = !s_.growths.empty();
    found_.assign(s_.walks.size(), Found::kUndone);
    for (std::size_t k = 0; k < asked_.size(); ++k) found_[asked_[k]] = s_.device.found[k];
    std::size_t looked = 0, left = 0;
    for (std::size_t i = 0; i < s_.walks.size(); ++i) {
      Walk walk = s_.walks[i];
      const unsigned found = found_[i];
      if ((found & Found::kMeet) != 0) s_.found[walk.pair] = Spheres::kMeet;
      if (found == 0 || (found & Found::kMeet) != 0) continue;
      if (grows && (found & Found::kGrows) != 0 && walk.device_rounds < kMostDeviceRounds) {
        ++walk.device_rounds;
      } else if (looked < kMostTogether) {
        ++looked;
        if (walkResident(walk)) continue;
      }
      s_.walks[left++] = walk;
    }
    s_.walks.erase(s_.walks.begin() + static_cast<std::ptrdiff_t>(left), s_.walks.end());
  }

  Scratch& s_;
  std::size_t waiting_ = 0;
  bool is_refused_ = false;           // by a device that has no room, or is lost
  std::vector<std::uint32_t> trees_;  // of each side, its number among the device's
  std::vector<std::size_t> asked_;    // the device's pairs, as numbers of walks
  std::vector<std::uint8_t> found_;   // of each walk
};

}  // namespace

template <typename S>
bool growsTogether(const Model<S>& a, const Model<S>& b) {
  if (a.empty() || b.empty()) return false;
  const tree::Tree &x = treeOf(a), &y = treeOf(b);
  // A small budget would have to be grown again for each pose.
  const bool is_bounded = x.options().memory_budget != 0 || y.options().memory_budget != 0;
  return x.conservative() && y.conservative() && (x.growsSlowly() || y.growsSlowly()) && !is_bounded;
}

template <typename S>
const std::vector<Spheres>& growTogether(const std::vector<PosedPair<S>>& pairs) {
  auto& s = thread::ofThread<Scratch>();
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
    Walk walk{a, b, relate<S>(ordered, *a, *b).b_in_a, k, kFirstBatch};
    walk.b_in_a.tolerance += marginOf(p.a, p.b) / unitOf(*a);
    if (!(walk.b_in_a.tolerance < kMostTolerance)) {
      s.found[k] = Spheres::kUnknown;  // beyond this a query looks at the distance first
    } else if (!walk.spheres().isNeedless()) {
      s.walks.push_back(walk);
    }
  }
  Walks(s).run();
  return s.found;
}

#define BOCST_INSTANTIATE(S)                                     \
  template bool growsTogether(const Model<S>&, const Model<S>&); \
  template const std::vector<Spheres>& growTogether(const std::vector<PosedPair<S>>&);
BOCST_INSTANTIATE(float)
BOCST_INSTANTIATE(double)
#undef BOCST_INSTANTIATE

}  // namespace bocst::fcl_adapter
