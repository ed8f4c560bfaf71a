// SPDX-License-Identifier: BSD-3-Clause
// What a first answer is made of: a mesh, its root grid, and expansions.
#include <benchmark/benchmark.h>

#include "meshes.h"
#include "oracle/cpu/cpu_oracle.h"
#include "oracle/cpu/kernels.h"
#include "oracle/surfaces.h"
#include "tree/root_grid.h"

namespace bocst::oracle {
namespace {

using tree::RootGrid;

void perTriangle(benchmark::State& state, std::size_t triangles) {
  state.SetItemsProcessed(static_cast<std::int64_t>(triangles) * state.iterations());
}

// One triangle against eight octants.
void octantMasksOfTriangles(benchmark::State& state) {
  static LocalTriangles triangles;
  std::mt19937_64 g(1);
  std::uniform_real_distribution<float> u(-1, 1);
  for (std::size_t i = 0; i < LocalTriangles::kCapacity; ++i) {
    const float middle[3] = {u(g), u(g), u(g)};
    for (int k = 0; k < 9; ++k) triangles.xyz[k][i] = middle[k % 3] + 0.2f * u(g);
  }
  std::uint8_t masks[LocalTriangles::kCapacity];
  for (auto _ : state) {
    octantMasks(triangles, LocalTriangles::kCapacity, 0, masks);
    benchmark::DoNotOptimize(masks);
  }
  perTriangle(state, LocalTriangles::kCapacity);
}
BENCHMARK(octantMasksOfTriangles);

// An expansion whose list has about as many triangles as asked for.
void expansionOfList(benchmark::State& state) {
  const Surface surface = surfaceOf(test::torus(256));
  ExpansionRequest e = rootOf(surface);
  std::vector<std::uint32_t> ids;
  for (;;) {
    expand(e);
    int fullest = 0;
    for (int o = 1; o < 8; ++o) {
      if (e.listSize(o) > e.listSize(fullest)) fullest = o;
    }
    ids.assign(e.listBegin(fullest), e.listEnd(fullest));
    const lattice::Cell cell = e.cell.octant(fullest);
    e = ExpansionRequest();
    e.surface = &surface;
    e.cell = cell;
    e.ids = ids.data();
    e.count = ids.size();
    if (ids.size() <= static_cast<std::size_t>(state.range(0))) break;
  }
  for (auto _ : state) {
    ExpansionRequest request = e;
    expand(request);
    benchmark::DoNotOptimize(request.grey);
  }
  perTriangle(state, e.count);
}
BENCHMARK(expansionOfList)->RangeMultiplier(4)->Range(32, 32768);

void rootGrid(benchmark::State& state) {
  const Surface surface = surfaceOf(test::torus(static_cast<std::size_t>(state.range(0))));
  for (auto _ : state) benchmark::DoNotOptimize(RootGrid::make(surface, lattice::kMaxLevel));
  perTriangle(state, surface.triangle_count);
}
BENCHMARK(rootGrid)->Arg(64)->Arg(192)->Arg(512)->Unit(benchmark::kMicrosecond);

// Takes over arrays and validates them.
void meshFromIndices(benchmark::State& state) {
  const auto given = test::torus(static_cast<std::size_t>(state.range(0))).mesh();
  for (auto _ : state) {
    state.PauseTiming();
    auto vertices = given->vertices();
    auto triangles = given->triangles();
    state.ResumeTiming();
    benchmark::DoNotOptimize(Mesh::fromIndices(std::move(vertices), std::move(triangles)));
  }
  perTriangle(state, given->triangleCount());
}
BENCHMARK(meshFromIndices)->Arg(64)->Arg(192)->Arg(512)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace bocst::oracle
