// SPDX-License-Identifier: BSD-3-Clause
#include "lattice/lattice.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace bocst::lattice {
namespace {

const Eigen::AlignedBox3d kBounds(Eigen::Vector3d(-1, 0, 2), Eigen::Vector3d(3, 1, 4));

TEST(Lattice, OctreeRootIsTheCentredCube) {
  const Lattice lattice(kBounds, Subdivision::kOctree, 0);
  EXPECT_TRUE(lattice.origin().isApprox(Eigen::Vector3d(-1, -1.5, 1)));
  EXPECT_NEAR(lattice.unit() * (1 << kBits), 4, 1e-13);
  for (const std::uint32_t e : lattice.extent()) EXPECT_EQ(e, 1u << kBits);
}

TEST(Lattice, BonoRootIsTheSmallestPowerOfTwo) {
  // d_t = 514 lies in a cube of 1024: the mesh takes a little more than its lower half.
  const Lattice lattice(kBounds, Subdivision::kBono, 514);
  EXPECT_EQ(lattice.origin(), kBounds.min());
  EXPECT_EQ(lattice.rootExponent(), 10);
  EXPECT_NEAR(lattice.unit() * (1 << kBits), 4.0 * 1024 / 514, 1e-12);
  const std::uint32_t unit = 1u << (kBits - 10);  // one unit of d_t
  EXPECT_EQ(lattice.extent()[0], 514 * unit);
  EXPECT_EQ(lattice.extent()[1], 129 * unit);  // 128.5 rounded up
  EXPECT_EQ(lattice.extent()[2], 257 * unit);
}

TEST(Lattice, LowerSideOfASplitIsTheLargestPowerOfTwo) {
  const Lattice lattice(kBounds, Subdivision::kBono, 514);
  const Eigen::AlignedBox3d lower = lattice.region(Cell{}.octant(0)), upper = lattice.region(Cell{}.octant(1));
  const double unit = 1 << (kBits - 10);
  EXPECT_EQ(lower.sizes().x(), 512 * unit);
  EXPECT_EQ(upper.sizes().x(), 2 * unit);
  EXPECT_FALSE(lattice.exists(Cell{}.octant(2)));  // 129 units need no upper half along y
}

TEST(Lattice, RegionsOfOctantsTileTheRegionOfTheCell) {
  for (const double dimension : {0.0, 514.0, 768.0, 1023.0, 1024.0}) {
    for (const Subdivision s : {Subdivision::kOctree, Subdivision::kBono}) {
      const Lattice lattice(kBounds, s, dimension);
      std::vector<Cell> cells{Cell{}};
      for (int level = 1; level < 5; ++level) {
        std::vector<Cell> next;
        for (const Cell& cell : cells) {
          double volume = 0;
          for (int o = 0; o < 8; ++o) {
            if (!lattice.exists(cell.octant(o))) continue;
            next.push_back(cell.octant(o));
            volume += lattice.region(next.back()).volume();
            EXPECT_GT(lattice.region(next.back()).volume(), 0);  // closed cells that only touch the mesh's are none
            EXPECT_TRUE(lattice.region(cell).contains(lattice.region(next.back())));
          }
          EXPECT_EQ(volume, lattice.region(cell).volume());
        }
        cells.swap(next);
      }
    }
  }
}

TEST(Lattice, RoundingAddsNoUnit) {
  std::mt19937_64 g(3);
  std::uniform_real_distribution<double> u(0.01, 100);
  for (int i = 0; i < 20000; ++i) {
    const std::uint32_t dimension = 3 + static_cast<std::uint32_t>(g() % 1000);
    const double side = u(g);
    Eigen::Vector3d sizes(side, 0, 0);
    std::uint32_t whole[3] = {dimension, 0, 0};
    for (int k = 1; k < 3; ++k) {
      whole[k] = 1 + static_cast<std::uint32_t>(g() % dimension);
      sizes[k] = side * whole[k] / dimension;
    }
    const Lattice lattice({Eigen::Vector3d::Zero(), sizes}, Subdivision::kBono, dimension);
    const std::uint32_t unit = 1u << (kBits - lattice.rootExponent());
    for (std::size_t k = 0; k < 3; ++k)
      ASSERT_EQ(lattice.extent()[k], whole[k] * unit) << whole[k] << " of " << dimension;
  }
}

TEST(Lattice, EveryCornerOfAnyBoundsIsInside) {
  std::mt19937_64 g(4);
  std::uniform_real_distribution<double> u(-1, 1);
  for (int i = 0; i < 3000; ++i) {
    const double far = std::pow(10.0, i % 12);
    const Eigen::Vector3d corner = far * Eigen::Vector3d(u(g), u(g), u(g));
    const Eigen::AlignedBox3d bounds(corner, corner + Eigen::Vector3d(2 + u(g), 2 + u(g), 2 + u(g)));
    for (const Subdivision s : {Subdivision::kOctree, Subdivision::kBono}) {
      const Lattice lattice(bounds, s, 0);
      const Eigen::AlignedBox3d root = lattice.region(Cell{});
      ASSERT_LT((root.min() - lattice.toLattice(bounds.min())).maxCoeff(), 1e-10) << "about " << far << " away";
      ASSERT_LT((lattice.toLattice(bounds.max()) - root.max()).maxCoeff(), 1e-10) << "about " << far << " away";
    }
  }
}

TEST(Lattice, EveryCornerOfTheBoundsIsInside) {
  for (const double far : {0.0, 1e1, 1e3, 1e6}) {
    const Eigen::AlignedBox3d moved(kBounds.min() + Eigen::Vector3d(far, far / 3, -far / 7),
                                    kBounds.max() + Eigen::Vector3d(far, far / 3, -far / 7));
    for (const Subdivision s : {Subdivision::kOctree, Subdivision::kBono}) {
      const Lattice lattice(moved, s, 0);
      const Eigen::AlignedBox3d root = lattice.region(Cell{});
      EXPECT_LT((root.min() - lattice.toLattice(moved.min())).maxCoeff(), 1e-10);
      EXPECT_LT((lattice.toLattice(moved.max()) - root.max()).maxCoeff(), 1e-10);
    }
  }
  for (const double scale : {1e-6, 1.0, 1e6}) {
    for (const double dimension : {0.0, 1.0, 2.0, 514.0, 65536.0}) {
      for (const Subdivision s : {Subdivision::kOctree, Subdivision::kBono}) {
        const Eigen::AlignedBox3d b(kBounds.min() * scale, kBounds.max() * scale);
        const Lattice lattice(b, s, dimension);
        const Eigen::AlignedBox3d root = lattice.region(Cell{});
        const Eigen::Vector3d lo = lattice.toLattice(b.min()), hi = lattice.toLattice(b.max());
        EXPECT_LT((root.min() - lo).maxCoeff(), 1e-10);
        EXPECT_LT((hi - root.max()).maxCoeff(), 1e-10);
      }
    }
  }
}

TEST(Lattice, APointHasACell) {
  const Eigen::Vector3d p(1e3, 0, -5);
  const Lattice lattice(Eigen::AlignedBox3d(p, p), Subdivision::kBono, 0);
  EXPECT_GT(lattice.unit(), 0);
  EXPECT_TRUE(lattice.exists(Cell{}));
  EXPECT_TRUE(lattice.toLattice(p).isZero());
}

// Coordinates of any partner in its frame, and their squares, are finite; its own are not rounded away.
TEST(Lattice, OfTheLeastSize) {
  for (const double size : {0.0, 1e-300, 1e-150, 1e-72}) {
    for (const Subdivision subdivision : {Subdivision::kOctree, Subdivision::kBono}) {
      const Eigen::Vector3d lo(-size, size / 3, 0), hi(size, size / 2, size / 7);
      const Lattice lattice(Eigen::AlignedBox3d(lo, hi), subdivision, 0);
      const double far = lattice.toLattice(Eigen::Vector3d(1e75, -1e75, 1e75)).squaredNorm();
      EXPECT_TRUE(std::isfinite(far)) << size;
      const Eigen::Vector3d way = (lattice.toLattice(hi) - lattice.toLattice(lo)) * lattice.unit();
      EXPECT_LE((way - (hi - lo)).cwiseAbs().maxCoeff(), 1e-10 * size) << size;
      const Eigen::AlignedBox3d root = lattice.region(Cell{});
      EXPECT_TRUE(root.contains(lattice.toLattice(lo)) && root.contains(lattice.toLattice(hi))) << size;
    }
  }
}

TEST(Lattice, MortonNamesEachCellOfALevelOnce) {
  std::vector<bool> seen(512, false);
  for (std::uint32_t x = 0; x < 8; ++x) {
    for (std::uint32_t y = 0; y < 8; ++y) {
      for (std::uint32_t z = 0; z < 8; ++z) {
        const std::uint64_t m = Cell{4, {x, y, z}}.morton();
        ASSERT_LT(m, 512u);
        EXPECT_FALSE(seen[m]);
        seen[m] = true;
      }
    }
  }
  EXPECT_EQ((Cell{17, {1, 0, 0}}.morton()), 1u);
  EXPECT_EQ((Cell{17, {0, 1, 0}}.morton()), 2u);
  EXPECT_EQ((Cell{17, {0, 0, 65535}}.morton()), 0x924924924924ull);
}

TEST(Lattice, LevelRuleOfThePaper) {
  EXPECT_FALSE(oneLevelMore(0));
  EXPECT_FALSE(oneLevelMore(513));
  EXPECT_TRUE(oneLevelMore(514));
  EXPECT_TRUE(oneLevelMore(767));
  EXPECT_FALSE(oneLevelMore(768));
  EXPECT_FALSE(oneLevelMore(1023));
  EXPECT_FALSE(oneLevelMore(1024));
}

}  // namespace
}  // namespace bocst::lattice
