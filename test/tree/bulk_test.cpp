// SPDX-License-Identifier: BSD-3-Clause
// Bulk building: no triangle is lost, on its own and in a tree.
#include "tree/bulk.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "oracle/surfaces.h"

namespace bocst::tree {
namespace {

using oracle::surfaceOf;
using Random = std::mt19937_64;

double uniform(Random& g, double lo, double hi) { return std::uniform_real_distribution<double>(lo, hi)(g); }

// Boxes of all shapes in the root cube, thin and tiny ones too.
void randomBox(Random& g, double (&lo)[3], double (&hi)[3]) {
  for (int k = 0; k < 3; ++k) {
    const double extent = std::exp2(uniform(g, -12, 16));
    lo[k] = uniform(g, 0, 65536 - extent);
    hi[k] = lo[k] + (g() % 8 == 0 ? 0 : extent);
  }
}

std::vector<std::shared_ptr<const Mesh>> hardMeshes() {
  Random g(4);
  std::vector<std::shared_ptr<const Mesh>> meshes;
  const auto add = [&](std::size_t count, auto&& corner) {
    std::vector<Eigen::Vector3d> v;
    std::vector<fcl::Triangle> t;
    for (std::size_t i = 0; i < count; ++i) {
      for (int k = 0; k < 3; ++k) v.push_back(corner(i));
      t.emplace_back(3 * i, 3 * i + 1, 3 * i + 2);
    }
    meshes.push_back(std::make_shared<const Mesh>(v, t));
  };
  const auto point = [&g](double size) {
    return Eigen::Vector3d(uniform(g, 0, size), uniform(g, 0, size), uniform(g, 0, size));
  };
  add(2000, [&](std::size_t) { return point(1); });  // all over each other
  add(3000,
      [&](std::size_t i) -> Eigen::Vector3d { return Eigen::Vector3d(double(i % 50), double(i / 50), 0) + point(1); });
  add(500, [&](std::size_t) { return Eigen::Vector3d(0, 0, 0); });  // one point
  add(500, [&](std::size_t) -> Eigen::Vector3d {
    return Eigen::Vector3d(uniform(g, 0, 1e4), 0, 0) + point(1e-3);
  });                                                                                           // needles
  add(5000, [&](std::size_t i) -> Eigen::Vector3d { return i < 4 ? point(1) : point(1e-6); });  // a speck
  add(5000, [&](std::size_t) { return Eigen::Vector3d(7, 7, 7); });                             // one point, sorted
  add(41, [&](std::size_t i) -> Eigen::Vector3d {
    return i == 40 ? point(1) : Eigen::Vector3d(static_cast<double>(i) * 1e-45, 0, 0);
  });  // points so close that a scale to part them is infinite in float
  add(120, [&](std::size_t i) -> Eigen::Vector3d {
    const double place = std::exp2(-static_cast<double>(i) / 1.5);
    return Eigen::Vector3d(place, 0, 0) + point(place / 50);
  });  // ever smaller ones: what is dense is best left in one part
  add(33, [&](std::size_t) { return point(1); });
  add(32, [&](std::size_t) { return point(1); });
  add(1, [&](std::size_t) { return point(1); });
  return meshes;
}

// As Tree does.
void buildAll(BulkBuilder& bulk, const oracle::Surface& s) {
  const std::size_t count = s.mesh->triangleCount();
  if (count >= BulkBuilder::kLeastToSort) return bulk.buildAll(s);
  std::vector<std::uint32_t> ids(count);
  std::iota(ids.begin(), ids.end(), 0u);
  bulk.build(s, ids.data(), count,
             {s.lattice.toLattice(s.mesh->bounds().min()), s.lattice.toLattice(s.mesh->bounds().max())});
}

// The triangles below a lane, each with its corners in lattice units.
void below(const BulkBuilder& bulk, std::uint32_t block, std::uint32_t lane, std::vector<std::uint32_t>& ids) {
  const BulkBuilder::Lane& l = bulk.blocks()[block].lane[lane];
  ids.assign(bulk.ids().begin() + l.begin, bulk.ids().begin() + l.begin + l.count);
}

void expectBounds(const BulkBuilder& bulk, const oracle::Surface& s, const Eigen::AlignedBox3d* region) {
  std::vector<std::uint32_t> ids;
  for (std::uint32_t n = 0; n < bulk.blocks().size(); ++n) {
    const BulkBuilder::Block& block = bulk.blocks()[n];
    ASSERT_GE(block.lanes, 2u);
    for (std::uint32_t o = 0; o < block.lanes; ++o) {
      below(bulk, n, o, ids);
      ASSERT_FALSE(ids.empty());
      ASSERT_EQ(block.lane[o].block == BulkBuilder::kNone, ids.size() <= kMaxLeafTriangles);
      const bounds::NodeBounds& b = block.bounds[o];
      for (const std::uint32_t t : ids) {
        for (int k = 0; k < 3; ++k) {
          const Eigen::Vector3d p = s.corner(t, k);
          if (region != nullptr && !region->contains(p)) continue;
          double along = 0;
          for (std::size_t c = 0; c < 3; ++c) {
            const double byte = block.frame.side(c) / 255, x = p[static_cast<int>(c)];
            ASSERT_LE(block.frame.origin[c] + b.lo[c] * byte, x);
            ASSERT_GE(block.frame.origin[c] + b.hi[c] * byte, x);
            along += b.normal[c] / 127.0 * (x - block.frame.middle(b, c));
          }
          const double unit = block.frame.longest() / 512;
          ASSERT_LE(std::abs(along - b.slab_center * 2 * unit), b.slab_half * unit);
        }
      }
    }
  }
}

void expectAllOnce(const oracle::Surface& s) {
  BulkBuilder bulk;
  buildAll(bulk, s);
  std::vector<std::uint32_t> ids = bulk.ids();
  std::sort(ids.begin(), ids.end());
  ASSERT_EQ(ids.size(), s.mesh->triangleCount());
  for (std::uint32_t t = 0; t < ids.size(); ++t) ASSERT_EQ(ids[t], t);
  EXPECT_EQ(bulk.blocks().empty(), ids.size() <= kMaxLeafTriangles);
  expectBounds(bulk, s, nullptr);
}

TEST(Bulk, EveryTriangleIsOnceInALeafAndInAllBoundsAboveIt) {
  for (const std::shared_ptr<const Mesh>& mesh : hardMeshes()) expectAllOnce(surfaceOf(mesh));
}

TEST(Bulk, ManyTrianglesAreSortedAlongAFinerCurve) { expectAllOnce(surfaceOf(test::torus(370).mesh())); }

TEST(Bulk, LanesPartitionTheirBlock) {
  for (const std::shared_ptr<const Mesh>& mesh : hardMeshes()) {
    BulkBuilder bulk;
    buildAll(bulk, surfaceOf(mesh));
    for (const BulkBuilder::Block& block : bulk.blocks()) {
      std::uint32_t all = 0;
      for (std::uint32_t o = 0; o < block.lanes; ++o) all += block.lane[o].count;
      for (std::uint32_t o = 0; o < block.lanes; ++o) {
        const BulkBuilder::Lane& lane = block.lane[o];
        EXPECT_LE(2 * lane.count, all) << "else the tree may be deeper than kMostLooseDepth";
        if (lane.block == BulkBuilder::kNone) continue;
        const BulkBuilder::Block& child = bulk.blocks()[lane.block];
        std::uint32_t count = 0;
        for (std::uint32_t c = 0; c < child.lanes; ++c) {
          count += child.lane[c].count;
          EXPECT_GE(child.lane[c].begin, lane.begin);
          EXPECT_LE(child.lane[c].begin + child.lane[c].count, lane.begin + lane.count);
        }
        EXPECT_EQ(count, lane.count);
      }
    }
  }
}

TEST(Bulk, ARegionKeepsWhatMeetsIt) {
  Random g(5);
  for (const std::shared_ptr<const Mesh>& mesh : hardMeshes()) {
    const oracle::Surface s = surfaceOf(mesh);
    std::vector<std::uint32_t> all(mesh->triangleCount());
    for (std::uint32_t t = 0; t < all.size(); ++t) all[t] = t;
    for (int i = 0; i < 20; ++i) {
      double lo[3], hi[3];
      randomBox(g, lo, hi);
      const Eigen::AlignedBox3d region(Eigen::Vector3d(lo[0], lo[1], lo[2]), Eigen::Vector3d(hi[0], hi[1], hi[2]));
      BulkBuilder bulk;
      bulk.build(s, all.data(), all.size(), region);
      std::vector<std::uint32_t> kept = bulk.ids();
      std::sort(kept.begin(), kept.end());
      EXPECT_EQ(std::adjacent_find(kept.begin(), kept.end()), kept.end());
      for (const std::uint32_t t : all) {
        Eigen::AlignedBox3d box;
        for (int k = 0; k < 3; ++k) box.extend(s.corner(t, k));
        const bool is_kept = std::binary_search(kept.begin(), kept.end(), t);
        if (box.intersects(region)) {
          EXPECT_TRUE(is_kept);
        } else if (is_kept) {
          ASSERT_LT(box.squaredExteriorDistance(region), 0.1) << "in lattice units";
        }
      }
      expectBounds(bulk, s, &region);
    }
  }
}

}  // namespace
}  // namespace bocst::tree
