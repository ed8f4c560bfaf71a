// SPDX-License-Identifier: BSD-3-Clause
// The inner tests of queries: nodes against eight octants, leaves against leaves, triangles against triangles.
#include <benchmark/benchmark.h>
#include <fcl/narrowphase/detail/traversal/collision/intersect.h>

#include "geometry/triangle.h"
#include "meshes.h"
#include "query/collide/tree_steps.h"
#include "query/distance/distance_kernels.h"

namespace bocst::query {
namespace {

constexpr std::size_t kMany = 256;  // as many inputs take turns

// A cell's octants with a box and a slab as those of smooth surfaces are.
CellOctants randomCell(std::mt19937_64& g) {
  CellOctants c;
  c.cell.level = 6;
  for (auto& x : c.cell.at) x = 14 + static_cast<std::uint32_t>(g() % 4);
  for (int o = 0; o < 8; ++o) {
    bounds::NodeBounds b;
    const Eigen::Vector3d n = 127 * test::randomDirection(g);
    for (std::size_t k = 0; k < 3; ++k) {
      b.lo[k] = static_cast<std::uint8_t>(g() % 100);
      b.hi[k] = static_cast<std::uint8_t>(155 + g() % 100);
      b.normal[k] = static_cast<std::int8_t>(std::round(n[static_cast<int>(k)]));
    }
    b.slab_half = 20;
    c.octants.set(o, b);
  }
  return c;
}

struct Cells {
  Cells() : g(1), geometry(placement(g)) {
    for (auto& side : cells) {
      for (CellOctants& c : side) c = randomCell(g);
    }
  }
  static SimilarityTransform placement(std::mt19937_64& g) {
    SimilarityTransform to;
    to.rotation = test::randomRotation(g);
    to.translation = Eigen::Vector3d::Constant(32768) - to.rotation * Eigen::Vector3d::Constant(32768);
    to.ready();
    return to;
  }
  std::mt19937_64 g;
  PairFrames geometry;
  CellOctants cells[2][kMany];
};

// One step of a walk, with the decoding of both sides.
void step(benchmark::State& state) {
  const Cells c;
  std::size_t i = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(overlappingOctants(c.geometry, 0, c.cells[0][i % kMany], c.cells[1][i * 7 % kMany], 3));
    ++i;
  }
}
BENCHMARK(step);

void gapsOfOctants(benchmark::State& state) {
  const Cells c;
  std::vector<Frame> frames[2];
  for (int side = 0; side < 2; ++side) {
    frames[side].resize(kMany);
    for (std::size_t i = 0; i < kMany; ++i) {
      tree::Block block;
      block.shape = 6;
      block.octants = c.cells[side][i].octants;
      fillFrame(c.geometry, side, block, frames[side][i]);
    }
  }
  LaneGaps gaps;
  std::size_t i = 0;
  for (auto _ : state) {
    laneGaps(c.geometry, 0, frames[0][i % kMany], frames[1][i * 7 % kMany], 3, FrameDirection(), gaps);
    benchmark::DoNotOptimize(gaps);
    ++i;
  }
}
BENCHMARK(gapsOfOctants);

// Patches of a bumpy surface that cross, or, `apart` over each other, do not.
struct Leaf {
  Leaf(std::mt19937_64& g, std::size_t count, double apart) {
    std::uniform_real_distribution<double> u(-1, 1);
    pack.count = count;
    const Eigen::Matrix3d turn = apart > 0 ? Eigen::Matrix3d::Identity() : test::randomRotation(g);
    for (std::size_t i = 0; i < count; ++i) {
      const Eigen::Vector3d middle(static_cast<double>(i % 4) - 1.5, static_cast<double>(i / 4) - 2, apart);
      for (int k = 0; k < 3; ++k) {
        const double angle = 2.1 * k;
        const Eigen::Vector3d v =
            turn * Eigen::Vector3d(middle + Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.2 * u(g)));
        for (int c = 0; c < 3; ++c) pack.xyz[3 * k + c][i] = static_cast<float>(v[c]);
        pack.size = std::max(pack.size, static_cast<float>(v.cwiseAbs().maxCoeff()));
      }
    }
  }
  TrianglePack pack;
};

// Two leaves as the walk meets them, every triangle of both: culling by the other leaf is looked at below.
void pairsOfLeaves(benchmark::State& state) {
  std::mt19937_64 g(2);
  const auto count = static_cast<std::size_t>(state.range(0));
  std::vector<Leaf> leaves;
  for (std::size_t i = 0; i < 32; ++i) leaves.emplace_back(g, count, 0);
  PackRegion region;
  for (int k = 0; k < 3; ++k) region.low[k] = -10, region.high[k] = 10, region.normal[k] = 0;
  static PackPair found[TrianglePack::kCapacity * TrianglePack::kCapacity];
  const std::uint32_t all = ~0u >> (32 - count);
  std::size_t i = 0, pairs = 0;
  for (auto _ : state) {
    pairs += touchingPairs(leaves[i % 32].pack, all, leaves[(i * 7 + 1) % 32].pack, region, 1e-6f, 0, false, found);
    ++i;
  }
  state.counters["found"] = benchmark::Counter(static_cast<double>(pairs), benchmark::Counter::kAvgIterations);
}
BENCHMARK(pairsOfLeaves)->Arg(4)->Arg(16)->Arg(32);

void cullLeaf(benchmark::State& state) {
  std::mt19937_64 g(3);
  const Leaf leaf(g, 24, 0);
  PackRegion region{{-1, -1, -1}, {1, 1, 1}, {0.6f, 0, 0.8f}, -0.1f, 0.1f};
  for (auto _ : state) benchmark::DoNotOptimize(trianglesWithin(leaf.pack, region));
}
BENCHMARK(cullLeaf);

void nearestOfLeaves(benchmark::State& state) {
  std::mt19937_64 g(4);
  const Leaf a(g, 24, 0), b(g, 24, 3);
  static NearPair found[TrianglePack::kCapacity * TrianglePack::kCapacity];
  const float displacement[3] = {0, 0, 1};
  for (auto _ : state) benchmark::DoNotOptimize(nearPairs(a.pack, b.pack, displacement, 5, false, found));
}
BENCHMARK(nearestOfLeaves);

// Pairs of triangles that meet.
struct Meeting {
  Meeting() {
    std::mt19937_64 g(5);
    std::uniform_real_distribution<double> u(-1, 1);
    for (std::size_t i = 0; i < kMany;) {
      for (int k = 0; k < 3; ++k) {
        p[i][k] = Eigen::Vector3d(u(g), u(g), u(g));
        q[i][k] = Eigen::Vector3d(u(g), u(g), u(g));
      }
      i += meet(i);
    }
  }
  bool meet(std::size_t i) const {
    return fcl::detail::Intersect<double>::intersect_Triangle(p[i][0], p[i][1], p[i][2], q[i][0], q[i][1], q[i][2]);
  }
  Corners p[kMany], q[kMany];
};

void trianglesByFcl(benchmark::State& state) {
  const Meeting m;
  std::size_t i = 0;
  for (auto _ : state) benchmark::DoNotOptimize(m.meet(i++ % kMany));
}
BENCHMARK(trianglesByFcl);

// How they are parted, which also says that they meet.
void trianglesParted(benchmark::State& state) {
  const Meeting m;
  TrianglePairs pairs;
  pairs.count = static_cast<std::size_t>(state.range(0));
  for (std::size_t i = 0; i < pairs.count; ++i) pairs.put(i, m.p[i], m.q[i]);
  ContactPoint touches[TrianglePairs::kCapacity];
  for (auto _ : state) benchmark::DoNotOptimize(trianglePenetrations(pairs, 1e-12, touches));
  state.SetItemsProcessed(state.range(0) * state.iterations());
}
BENCHMARK(trianglesParted)->Arg(1)->Arg(32);

void distanceOfTriangles(benchmark::State& state) {
  const Meeting m;
  Eigen::Vector3d on_p, on_q;
  std::size_t i = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(nearestPoints(m.p[i % kMany], m.q[i * 7 % kMany], on_p, on_q));
    ++i;
  }
}
BENCHMARK(distanceOfTriangles);

}  // namespace
}  // namespace bocst::query
