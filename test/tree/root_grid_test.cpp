// SPDX-License-Identifier: BSD-3-Clause
// The grid of the first levels: its kernels one value at a time on every instruction set, its cells against the padded
// double reference, its lists against all triangles.
#include "tree/root_grid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "every_target.h"
#include "oracle/surfaces.h"

namespace bocst::tree {
namespace {

using lattice::Cell;
using oracle::centerOf;
using oracle::referenceGrey;
using oracle::Surface;
using oracle::surfaceOf;
using oracle::triangleMeetsCube;

class RootGridKernels : public test::EveryTarget {};
INSTANTIATE_TEST_SUITE_P(All, RootGridKernels, testing::ValuesIn(test::EveryTarget::targets()),
                         test::EveryTarget::name);

// The quantised vertices and the grid's spans of random triangles, one by one.
TEST_P(RootGridKernels, GridSpans) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> coordinate(-1, 11);
  constexpr std::size_t kVertices = 203;
  std::vector<double> points(3 * kVertices);
  for (double& x : points) x = coordinate(random);
  const double origin[3] = {0.5, 1, -0.25}, scale = 3000;
  std::vector<std::int16_t> vertices(3 * kVertices + 1);
  quantise(points.data(), kVertices, origin, scale, 32766, vertices.data());
  for (std::size_t i = 0; i < points.size(); ++i) {
    ASSERT_EQ(vertices[i], static_cast<int>(std::clamp((points[i] - origin[i % 3]) * scale, 1.0, 32766.0)));
  }
  std::uniform_int_distribution<std::uint32_t> index(0, kVertices - 1), step(0, 4);
  for (std::size_t count = 0; count < 40; ++count) {
    std::vector<std::uint32_t> indices(3 * count);
    // Some triangles lie in one cell or two, most do not.
    for (std::size_t i = 0; i < indices.size(); ++i) {
      indices[i] = i % 3 == 0 || step(random) != 0 ? index(random) : indices[i - 1];
    }
    for (int bits = 1; bits <= 5; ++bits) {
      std::vector<GridSpan> spans(count + 8);
      gridSpans(vertices.data(), indices.data(), count, bits, spans.data());
      for (std::size_t t = 0; t < count; ++t) {
        std::uint32_t expected = 0;
        for (int k = 0; k < 3; ++k) {
          const auto at = [&](std::size_t corner) {
            return int{vertices[3 * indices[3 * t + corner] + static_cast<std::size_t>(k)]};
          };
          const int lo = (std::min({at(0), at(1), at(2)}) - 1) >> (15 - bits),
                    hi = (std::max({at(0), at(1), at(2)}) + 1) >> (15 - bits);
          expected |= static_cast<std::uint32_t>(lo << k * bits | (hi - lo == 1) << (3 * bits + k) |
                                                 (hi - lo > 1) << (3 * bits + 6 + k));
        }
        ASSERT_EQ(static_cast<std::uint32_t>(spans[t]), expected) << "bits " << bits;
      }
    }
  }
}

TEST_P(RootGridKernels, BitsOfOthers) {
  std::mt19937 random(7);
  std::uniform_int_distribution<std::uint32_t> of_three(0, 2);
  for (std::size_t count = 0; count <= 64; count += 8) {
    std::vector<std::uint32_t> values(count);
    for (std::uint32_t& value : values) value = of_three(random) - 1;
    for (const std::uint32_t value : {0u, 1u, 0xffffffffu}) {
      std::vector<std::uint8_t> bits(count / 8, 0xa5);
      bitsOfOthers(values.data(), count, value, bits.data());
      for (std::size_t i = 0; i < count; ++i) {
        ASSERT_EQ((bits[i / 8] >> i % 8 & 1) != 0, values[i] != value) << "value " << i;
      }
    }
  }
}

TEST_P(RootGridKernels, StepsBack) {
  std::mt19937 random(8);
  for (const std::uint32_t span : {3u, 0xfffeu, 0x10002u, 0x7fffffffu}) {
    for (std::size_t count = 1; count <= 40; ++count) {
      const std::size_t whole = (count + 7) / 8 * 8;
      const auto first = static_cast<std::uint32_t>(random() % 0x40000000u);
      std::vector<std::uint32_t> from(whole, first);
      for (std::size_t i = 0; i < count; ++i) {
        const auto at = static_cast<std::uint32_t>(first + i);
        from[i] = random() % 4 == 0 ? 0x80000000u : at - static_cast<std::uint32_t>(random()) % std::min(span, at + 1);
      }
      std::vector<std::uint16_t> back(whole, 7);
      bool any_far = false;
      const bool said_far = stepsBack(from.data(), first, count, back.data());
      for (std::size_t i = 0; i < count; ++i) {
        const std::int64_t steps = std::int64_t{first} + static_cast<std::int64_t>(i) - std::int64_t{from[i]};
        ASSERT_EQ(back[i], std::clamp<std::int64_t>(steps, 0, 65535)) << "value " << i;
        any_far |= back[i] == 65535;
      }
      ASSERT_EQ(said_far, any_far);
    }
  }
}

// Every triangle that touches the cell is gathered, and none twice.
void gathersAllOnce(const RootGrid& grid, const Surface& surface, const Cell& cell) {
  std::vector<std::uint32_t> ids;
  grid.gather(surface, cell, ids);
  std::sort(ids.begin(), ids.end());
  ASSERT_EQ(std::adjacent_find(ids.begin(), ids.end()), ids.end());
  for (std::uint32_t t = 0; t < surface.mesh->triangleCount(); ++t) {
    const auto c = surface.corners(t);
    if (triangleMeetsCube(c.data(), centerOf(cell), cell.side() / 2.0)) {
      ASSERT_TRUE(std::binary_search(ids.begin(), ids.end(), t));
    }
  }
}

TEST(RootGrid, KnowsTheSameGreyCellsAsExpansions) {
  for (const Subdivision s : {Subdivision::kOctree, Subdivision::kBono}) {
    for (const double d : {0.0, 514.0, 900.0}) {
      const Surface surface = surfaceOf(test::torus(60), s, d);
      const auto grid = RootGrid::make(surface, lattice::kMaxLevel);
      ASSERT_NE(grid, nullptr);
      const std::uint32_t side = 1u << (grid->level() - 1);
      std::size_t grey = 0;
      for (std::uint32_t z = 0; z < side; ++z) {
        for (std::uint32_t y = 0; y < side; ++y) {
          for (std::uint32_t x = 0; x < side; ++x) {
            const Cell cell{grid->level(), {x, y, z}};
            ASSERT_EQ(grid->grey(surface, cell), referenceGrey(surface, cell));
            if (!grid->grey(surface, cell)) continue;
            ++grey;
            ASSERT_NO_FATAL_FAILURE(gathersAllOnce(*grid, surface, cell));
          }
        }
      }
      EXPECT_GT(grey, 20u);
    }
  }
}

TEST(RootGrid, KnowsFineMeshesWithSomeLargeTriangles) {
  // Finer grids, an odd number of triangles, a few that span many cells, vertices out of order.
  for (const std::size_t n : {75u, 390u}) {
    test::Raw raw = test::torus(n);
    raw.add(test::box({-0.9, -0.9, -0.3}, {0.9, 0.9, 0.3}));
    raw.triangles.pop_back();
    std::mt19937 random(3);
    std::shuffle(raw.triangles.begin(), raw.triangles.end(), random);
    const Surface surface = surfaceOf(raw);
    const auto grid = RootGrid::make(surface, lattice::kMaxLevel);
    ASSERT_NE(grid, nullptr);
    EXPECT_EQ(grid->level(), n == 75u ? 5 : 6);
    const std::uint32_t side = 1u << (grid->level() - 1);
    std::uniform_int_distribution<std::uint32_t> at(0, side - 1);
    std::size_t grey = 0;
    for (int i = 0; i < 60; ++i) {
      const Cell cell{grid->level(), {at(random), at(random), at(random) % (side / 2)}};
      ASSERT_EQ(grid->grey(surface, cell), referenceGrey(surface, cell));
      if (!grid->grey(surface, cell)) continue;
      ++grey;
      ASSERT_NO_FATAL_FAILURE(gathersAllOnce(*grid, surface, cell));
      const Eigen::AlignedBox3d box = grid->bounds(cell);
      EXPECT_EQ(box.min(), centerOf(cell) - Eigen::Vector3d::Constant(cell.side() / 2.0));
      EXPECT_EQ(box.max(), centerOf(cell) + Eigen::Vector3d::Constant(cell.side() / 2.0));
      Cell parent{cell.level - 1, {cell.at[0] / 2, cell.at[1] / 2, cell.at[2] / 2}};
      for (; parent.level >= 2; --parent.level, parent.at = {parent.at[0] / 2, parent.at[1] / 2, parent.at[2] / 2}) {
        EXPECT_TRUE(grid->grey(surface, parent));
        EXPECT_TRUE(grid->bounds(parent).contains(box));
      }
    }
    EXPECT_GT(grey, 3u);
  }
}

// Triangles whose boxes end on faces of cells, or beside them by less than the grid's step, above a fine mesh.
TEST(RootGrid, KnowsWhatTouchesFacesOfCells) {
  std::mt19937_64 g(15);
  for (int round = 0; round < 6; ++round) {
    test::Raw raw = test::torus(50);
    raw.scale(1000).move({2000, 2000, 2000});
    // The bounds are that of cells: half as many along two axes as along the third.
    Eigen::Vector3d most(32768, 32768, 32768);
    most[round % 3] = 65536;
    raw.addTriangle({0, 0, 0}, {0, 0, 0}, {0, 0, 0});
    raw.addTriangle(most, most, most);
    const double side = 8192;
    const auto cornerOfCell = [&] {
      Eigen::Vector3d p;
      for (int k = 0; k < 3; ++k) p[k] = static_cast<double>(g() % (k == round % 3 ? 9 : 5)) * side;
      return p;
    };
    for (int i = 0; i < 2; ++i) raw.addTriangle(cornerOfCell(), cornerOfCell(), cornerOfCell());
    for (int i = 0; i < 12; ++i) {
      Eigen::Vector3d p = cornerOfCell().cwiseMax(side).cwiseMin(most - Eigen::Vector3d::Constant(side));
      const double off = g() % 2 != 0 ? 0.5 : -0.5;
      for (int k = 0; k < 3; ++k) p[k] += g() % 2 != 0 ? side / 2 : off;
      raw.addTriangle(p, p + Eigen::Vector3d(off, 0, off), p + Eigen::Vector3d(0, off, off));
    }
    const Surface surface = surfaceOf(raw);
    ASSERT_EQ(surface.lattice.unit(), 1);
    const auto grid = RootGrid::make(surface, lattice::kMaxLevel);
    ASSERT_NE(grid, nullptr);
    ASSERT_EQ(grid->level(), 4);
    for (std::uint32_t at = 0; at < 512; ++at) {
      const Cell cell{4, {at % 8, at / 8 % 8, at / 64}};
      const bool grey = grid->grey(surface, cell);
      ASSERT_EQ(grey, referenceGrey(surface, cell)) << "cell " << cell.at[0] << " " << cell.at[1] << " " << cell.at[2];
      if (!grey) continue;
      ASSERT_NO_FATAL_FAILURE(gathersAllOnce(*grid, surface, cell));
    }
  }
}

TEST(RootGrid, FollowsListsOverAnyDistance) {
  // Three triangles in a cell of their own, so far apart in the mesh that steps back just fit, or just do not.
  const test::Raw torus = test::torus(260);
  for (const std::size_t gap : {1u, 65533u, 65534u, 65535u, 65536u, 65537u}) {
    for (const std::size_t first : {0u, 255u, 256u}) {
      test::Raw raw = torus;
      const std::size_t v = raw.vertices.size();
      for (const Eigen::Vector3d& p :
           {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0, 1e-3, 0), Eigen::Vector3d(1e-3, 0, 0)}) {
        raw.vertices.push_back(p - Eigen::Vector3d::Constant(3));
      }
      std::vector<std::uint32_t> expected;
      for (std::size_t t = first; t < raw.triangles.size() && expected.size() < 3; t += gap) {
        raw.triangles[t] = fcl::Triangle(v, v + 1, v + 2);
        expected.push_back(static_cast<std::uint32_t>(t));
      }
      ASSERT_GE(expected.size(), 3u);
      const Surface surface = surfaceOf(raw);
      const auto grid = RootGrid::make(surface, lattice::kMaxLevel);
      ASSERT_NE(grid, nullptr);
      std::vector<std::uint32_t> ids;
      grid->gather(surface, Cell{grid->level(), {0, 0, 0}}, ids);
      std::sort(ids.begin(), ids.end());
      EXPECT_EQ(ids, expected) << "gap " << gap << " first " << first;
    }
  }
}

TEST(RootGrid, LargeTrianglesAreLeftToExpansions) {
  test::Raw raw = test::soup(3000, 1);
  for (auto& t : raw.triangles) {
    raw.vertices[t[0]].setZero();
    raw.vertices[t[1]].setOnes();
  }
  raw.add(test::torus(40));
  EXPECT_EQ(RootGrid::make(surfaceOf(raw), lattice::kMaxLevel), nullptr);
}

}  // namespace
}  // namespace bocst::tree
