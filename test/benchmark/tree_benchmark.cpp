// SPDX-License-Identifier: BSD-3-Clause
// Growth, and the walks over what has grown.
#include <benchmark/benchmark.h>

#include <shared_mutex>

#include "meshes.h"
#include "query/collide/tree_walk.h"
#include "tree/tree.h"

namespace bocst {
namespace {

std::unique_ptr<tree::Tree> torusTree(std::size_t n) {
  Options options;
  options.oracle = OracleKind::kCpu;
  return std::make_unique<tree::Tree>(test::torus(n).mesh(), options);
}

// Makes one batch of all nodes that can grow below the root, or below what has grown so far.
std::vector<tree::Tree::Growth> frontier(tree::Tree& tree) {
  std::vector<tree::Tree::Growth> batch;
  std::vector<tree::NodeRef> open{tree::NodeRef()};
  const query::TreeSide side(tree);
  while (!open.empty()) {
    const tree::NodeRef node = open.back();
    open.pop_back();
    if (side.state(node) == query::State::kInner) {
      side.children(node, [&](tree::NodeRef child) { open.push_back(child); });
    } else if (side.state(node) == query::State::kGrows) {
      side.grow(node, batch);
    }
  }
  return batch;
}

// Question, oracle and publishing of a node, of a whole level in one batch; what expansionOfList takes for such lists
// is the oracle's part.
void growLevel(benchmark::State& state) {
  std::size_t nodes = 0;
  for (auto _ : state) {
    state.PauseTiming();
    const auto tree = torusTree(128);
    const std::shared_lock<thread::ShardedLock> lock(tree->queryLock());
    for (int level = 1; level < state.range(0); ++level) {
      auto batch = frontier(*tree);
      tree::Tree::grow(batch);
    }
    auto batch = frontier(*tree);
    nodes += batch.size();
    state.ResumeTiming();
    tree::Tree::grow(batch);
  }
  state.SetItemsProcessed(static_cast<std::int64_t>(nodes));
}
BENCHMARK(growLevel)->DenseRange(2, 6)->Unit(benchmark::kMicrosecond);

class Counter : public query::Visitor {
 public:
  explicit Counter(bool first) : first_(first) {}
  bool endsAtFirst() const override { return first_; }
  bool triangles(std::uint32_t, std::uint32_t, bool certain) override {
    ++pairs;
    sure += certain;
    return first_ && certain;
  }
  bool cells(const query::CellLeaf&, const query::CellLeaf&) override { return false; }
  bool cellOfA(const query::CellLeaf&, std::uint32_t, const Eigen::Vector3d&) override { return false; }
  bool cellOfB(std::uint32_t, const query::CellLeaf&, const Eigen::Vector3d&) override { return false; }

  std::size_t pairs = 0, sure = 0;

 private:
  bool first_;
};

// Where torus B lies beside or in A.
query::SimilarityTransform beside(const tree::Tree& tree_a, const tree::Tree& tree_b, double x) {
  query::SimilarityTransform place;
  std::mt19937_64 g(3);
  place.rotation = test::randomRotation(g);
  const lattice::Lattice &la = tree_a.surface().lattice, &lb = tree_b.surface().lattice;
  place.scale = lb.unit() / la.unit();
  place.translation = (place.rotation * lb.origin() + Eigen::Vector3d(x, 0, 0) - la.origin()) / la.unit();
  place.tolerance = 1e-9;
  place.ready();
  return place;
}

// A walk over resident nodes: apart, to the first pair that surely meets, or to the last.
void warmWalk(benchmark::State& state, double x, bool first) {
  const auto tree_a = torusTree(128), tree_b = torusTree(128);
  const query::SimilarityTransform place = beside(*tree_a, *tree_b, x);
  Counter counter(first);
  const std::shared_lock<thread::ShardedLock> lock_a(tree_a->queryLock()), lock_b(tree_b->queryLock());
  const query::TreeSide a(*tree_a), b(*tree_b);
  for (int i = 0; i < 50; ++i) query::TreeWalk(a, b, place).run(counter);
  counter = Counter(first);
  for (auto _ : state) query::TreeWalk(a, b, place).run(counter);
  const auto each = benchmark::Counter::kAvgIterations;
  state.counters["pairs"] = benchmark::Counter(static_cast<double>(counter.pairs), each);
  state.counters["certain"] = benchmark::Counter(static_cast<double>(counter.sure), each);
}
BENCHMARK_CAPTURE(warmWalk, apart, 2.05, true);
BENCHMARK_CAPTURE(warmWalk, first, 0.9, true);
BENCHMARK_CAPTURE(warmWalk, all, 0.9, false)->Unit(benchmark::kMicrosecond);

// A look for a direction between two hulls that are apart, or deep in each other.
void separation(benchmark::State& state, double x) {
  const auto tree_a = torusTree(128), tree_b = torusTree(128);
  const query::SimilarityTransform place = beside(*tree_a, *tree_b, x);
  Counter counter(true);
  const std::shared_lock<thread::ShardedLock> lock_a(tree_a->queryLock()), lock_b(tree_b->queryLock());
  const query::TreeSide a(*tree_a), b(*tree_b);
  bool apart = false;
  for (int i = 0; i < 50 && !apart; ++i) {
    query::TreeWalk walk(a, b, place);
    apart = walk.isNeedless();
    if (!apart) walk.run(counter);
  }
  for (auto _ : state) benchmark::DoNotOptimize(query::TreeWalk(a, b, place).isNeedless());
  state.counters["apart"] = apart;
}
BENCHMARK_CAPTURE(separation, apart, 2.6);
BENCHMARK_CAPTURE(separation, deep, 0.2);

}  // namespace
}  // namespace bocst
