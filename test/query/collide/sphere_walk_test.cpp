// SPDX-License-Identifier: BSD-3-Clause
// Conservative answers of two models: the walk finds exactly the cells whose spheres meet in double, on every
// instruction set, whatever is resident.
#include "query/collide/sphere_walk.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "every_target.h"
#include "meshes.h"
#include "query/collide/cell_tree.h"

namespace bocst::query {
namespace {

class SphereWalks : public test::EveryTarget {};

using CellPairs = std::vector<std::pair<std::uint64_t, std::uint64_t>>;

class Cells : public Visitor {
 public:
  explicit Cells(bool ends_at_first) : ends_at_first_(ends_at_first) {}

  bool endsAtFirst() const override { return ends_at_first_; }
  bool cells(const CellLeaf& a, const CellLeaf& b) override {
    pairs.emplace_back(a.id, b.id);
    spheres.emplace_back(a.sphere, b.sphere);
    return ends_at_first_;
  }
  bool triangles(std::uint32_t, std::uint32_t, bool) override { return fail(); }
  bool cellOfA(const CellLeaf&, std::uint32_t, const Eigen::Vector3d&) override { return fail(); }
  bool cellOfB(std::uint32_t, const CellLeaf&, const Eigen::Vector3d&) override { return fail(); }

  CellPairs pairs;
  std::vector<std::pair<Sphere, Sphere>> spheres;

 private:
  static bool fail() {
    ADD_FAILURE() << "no triangles were asked for";
    return true;
  }
  const bool ends_at_first_;
};

using Model = test::CellTree;

// By the definition.
CellPairs meetingCells(const Model& a, const Model& b, const SimilarityTransform& b_in_a) {
  std::vector<Sphere> seen;
  for (const CellLeaf& leaf : b.leaves) seen.push_back(placed(leaf.sphere, b_in_a));
  CellPairs pairs;
  for (const CellLeaf& leaf : a.leaves) {
    for (std::size_t i = 0; i < seen.size(); ++i) {
      if (spheresMeet(leaf.sphere, seen[i], b_in_a.tolerance)) pairs.emplace_back(leaf.id, b.leaves[i].id);
    }
  }
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

Cells walk(tree::Tree& tree_a, tree::Tree& tree_b, const SimilarityTransform& b_in_a, bool ends_at_first) {
  const TreeSide a(tree_a), b(tree_b);
  Cells cells(ends_at_first);
  SphereWalk spheres(a, b, b_in_a);
  if (spheres.isNeedless()) return cells;
  const bool ended = spheres.run(cells);
  EXPECT_EQ(ended, ends_at_first && !cells.pairs.empty());
  return cells;
}

struct Counts {
  std::size_t hits = 0, misses = 0, pairs = 0, boxes_apart = 0;
};

void compare(const Model& a, const Model& b, tree::Tree& lazy_a, tree::Tree& lazy_b, const SimilarityTransform& b_in_a,
             Counts& counts) {
  const CellPairs expected = meetingCells(a, b, b_in_a);
  counts.pairs += expected.size();
  ++(expected.empty() ? counts.misses : counts.hits);
  if (SphereWalk(TreeSide(*a.whole), TreeSide(*b.whole), b_in_a).areBoxesApart()) {
    ASSERT_TRUE(expected.empty());
    ++counts.boxes_apart;
  }
  const auto checkFirst = [&](const Cells& first, const char* trees) {
    ASSERT_EQ(first.pairs.empty(), expected.empty()) << trees;
    if (expected.empty()) return;
    ASSERT_TRUE(std::binary_search(expected.begin(), expected.end(), first.pairs[0])) << trees;
  };
  checkFirst(walk(lazy_a, lazy_b, b_in_a, true), "as queries left them");
  checkFirst(walk(*a.fresh(), *b.fresh(), b_in_a, true), "fresh");
  checkFirst(walk(*a.whole, *b.whole, b_in_a, true), "whole");
  if (!expected.empty()) {
    const TreeSide side_a(*a.whole), side_b(*b.whole);
    ASSERT_FALSE(SphereWalk(side_a, side_b, b_in_a).areBoxesApart());
  }
  for (tree::Tree* tree : {&lazy_a, a.whole.get()}) {
    Cells all = walk(*tree, tree == &lazy_a ? lazy_b : *b.whole, b_in_a, false);
    for (const auto& [sphere_a, sphere_b] : all.spheres) {
      ASSERT_TRUE(spheresMeet(sphere_a, sphere_b, b_in_a.tolerance));
    }
    std::sort(all.pairs.begin(), all.pairs.end());
    ASSERT_EQ(all.pairs, expected) << (tree == &lazy_a ? "as queries left them" : "whole");
  }
}

// Places b so that two leaves are apart by `gap` times the sum of their radii: 0 is just touching. `outermost`: no
// others are nearer to each other along the way between those two.
SimilarityTransform touching(const Model& a, const Model& b, double scale, double gap, bool outermost,
                             std::mt19937_64& g) {
  SimilarityTransform b_in_a;
  b_in_a.rotation = test::randomRotation(g);
  b_in_a.scale = scale;
  b_in_a.orthogonality_error = 1e-15;
  b_in_a.ready();
  const Eigen::Vector3d direction = test::randomDirection(g);
  const auto pick = [&](const Model& model, const Eigen::Vector3d& along) {
    if (!outermost) return model.leaves[g() % model.leaves.size()].sphere;
    const auto reach = [&along](const CellLeaf& leaf) { return along.dot(leaf.sphere.center) + leaf.sphere.radius; };
    return std::max_element(model.leaves.begin(), model.leaves.end(),
                            [&](const CellLeaf& x, const CellLeaf& y) { return reach(x) < reach(y); })
        ->sphere;
  };
  const Sphere of_a = pick(a, direction), of_b = pick(b, -(b_in_a.rotation.transpose() * direction));
  const double distance = (of_a.radius + scale * of_b.radius) * (1 + gap);
  b_in_a.translation = of_a.center + distance * direction - b_in_a * of_b.center;
  return b_in_a;
}

// Some needles that do not follow the axes: few cells, down to any depth.
test::Raw needles(std::mt19937_64& g, int count) {
  std::uniform_real_distribution<double> unit(-1, 1);
  test::Raw raw;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d from(unit(g), unit(g), unit(g)), to(unit(g), 0.3 * unit(g), 0.1 * unit(g));
    raw.vertices.insert(raw.vertices.end(), {from, to, (from + to) / 2 + Eigen::Vector3d(1e-4, 0, 1e-4)});
    const std::size_t n = raw.vertices.size();
    raw.triangles.emplace_back(n - 3, n - 2, n - 1);
  }
  return raw;
}

constexpr double kGaps[] = {0, 1e-15, -1e-15, 1e-12, 2e-12, 1e-9, -1e-9, 1e-7, 1e-5, -1e-2, 0.3, 3, -0.8};

TEST_P(SphereWalks, FindWhatMeetsAtEveryDepth) {
  std::mt19937_64 g(51);
  const test::Raw raw_a = needles(g, 3), raw_b = needles(g, 2);
  for (int depth = 1; depth <= 10; ++depth) {
    Counts counts;
    for (const Subdivision subdivision : {Subdivision::kOctree, Subdivision::kBono}) {
      // Of one depth, and of two.
      const Model a(raw_a, subdivision, depth), b(raw_b, Subdivision::kBono, depth % 3 == 0 ? 11 - depth : depth);
      const auto lazy_a = a.fresh(), lazy_b = b.fresh();
      for (const double gap : kGaps) {
        SCOPED_TRACE(testing::Message() << "depth " << depth << " gap " << gap);
        compare(a, b, *lazy_a, *lazy_b, touching(a, b, 0.7, gap, false, g), counts);
        compare(a, b, *lazy_a, *lazy_b, touching(a, b, 0.7, gap, true, g), counts);
        if (HasFatalFailure()) return;
      }
    }
    EXPECT_GT(counts.hits, 5u) << depth;
    EXPECT_GT(counts.misses, 5u) << depth;
  }
}

TEST_P(SphereWalks, FindWhatMeetsOnLatticesOfAnySize) {
  std::mt19937_64 g(52);
  const Model a(test::torus(24, 0.2), Subdivision::kBono, 5), b(test::torus(12, 0.3), Subdivision::kOctree, 4);
  const auto lazy_a = a.fresh(), lazy_b = b.fresh();
  for (const double scale : {1e-120, 1e-20, 1e-3, 0.03, 0.25, 0.5, 1.0, 1.9, 30.0, 1e3, 1e9, 1e20, 1e120}) {
    Counts counts;
    for (const double gap : kGaps) {
      SCOPED_TRACE(testing::Message() << "scale " << scale << " gap " << gap);
      compare(a, b, *lazy_a, *lazy_b, touching(a, b, scale, gap, false, g), counts);
      compare(a, b, *lazy_a, *lazy_b, touching(a, b, scale, gap, true, g), counts);
      if (HasFatalFailure()) return;
    }
    EXPECT_GT(counts.hits, 4u) << scale;
    EXPECT_GT(counts.misses, 4u) << scale;
  }
}

// Along the axes spheres stick out of the boxes about the surface the farthest, most where it but begins to reach into
// a cell.
TEST_P(SphereWalks, FindWhatMeetsAlongTheAxes) {
  std::mt19937_64 g(56);
  for (int depth = 2; depth <= 6; ++depth) {
    const double more = std::ldexp(0.1, -depth);
    for (const Subdivision subdivision : {Subdivision::kOctree, Subdivision::kBono}) {
      const Model a(test::box({0, 0, 0}, {1, 0.5 + more, 0.25 + more}), subdivision, depth);
      const Model b(test::box({0, 0, 0}, {0.5 + more, 1, 0.75 + more}), subdivision, depth);
      const auto lazy_a = a.fresh(), lazy_b = b.fresh();
      Counts counts;
      for (int face = 0; face < 6; ++face) {
        const Eigen::Vector3d direction = (face < 3 ? -1 : 1) * Eigen::Vector3d::Unit(face % 3);
        const auto outermost = [](const Model& model, const Eigen::Vector3d& along) {
          const auto less = [&along](const CellLeaf& x, const CellLeaf& y) {
            return along.dot(x.sphere.center) + x.sphere.radius < along.dot(y.sphere.center) + y.sphere.radius;
          };
          return std::max_element(model.leaves.begin(), model.leaves.end(), less)->sphere;
        };
        const Sphere of_a = outermost(a, direction), of_b = outermost(b, -direction);
        for (const double gap : {-1e-9, 1e-9}) {
          SimilarityTransform b_in_a;
          b_in_a.ready();
          b_in_a.translation = of_a.center + (of_a.radius + of_b.radius) * (1 + gap) * direction - of_b.center;
          SCOPED_TRACE(testing::Message() << "depth " << depth << " face " << face << " gap " << gap);
          compare(a, b, *lazy_a, *lazy_b, b_in_a, counts);
          if (HasFatalFailure()) return;
        }
      }
      EXPECT_GE(counts.hits, 6u);
    }
  }
}

// Margins come as tolerance, poses may be no rotations, and most pairs of a planner are far.
TEST_P(SphereWalks, FindWhatMeetsWithinTolerance) {
  std::mt19937_64 g(53);
  const Model a(test::torus(30, 0.2), Subdivision::kBono, 6), b(test::torus(20, 0.3), Subdivision::kBono, 5);
  const auto lazy_a = a.fresh(), lazy_b = b.fresh();
  Counts counts;
  std::uniform_real_distribution<double> unit(-1, 1);
  for (int i = 0; i < 60; ++i) {
    SCOPED_TRACE(testing::Message() << "pose " << i);
    SimilarityTransform b_in_a = touching(a, b, i % 2 ? 1 : 0.4, i % 3 * unit(g), i % 7 != 0, g);
    b_in_a.tolerance = i % 4 == 0 ? 0 : std::pow(10.0, 4 * unit(g));
    if (i % 5 == 0) {
      for (int k = 0; k < 9; ++k) b_in_a.rotation.data()[k] += 1e-4 * unit(g);
      b_in_a.orthogonality_error =
          (b_in_a.rotation.transpose() * b_in_a.rotation - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
      b_in_a.ready();
    }
    if (i % 6 == 0) b_in_a.translation += 40000 * test::randomDirection(g);
    compare(a, b, *lazy_a, *lazy_b, b_in_a, counts);
    if (HasFatalFailure()) return;
  }
  EXPECT_GT(counts.hits, 10u);
  EXPECT_GT(counts.misses, 10u);
  EXPECT_GT(counts.pairs, 10000u);
  EXPECT_GT(counts.boxes_apart, 3u);
}

TEST(Spheres, MeetWhereTheyTouch) {
  std::mt19937_64 g(55);
  std::uniform_real_distribution<double> u(0, 1);
  for (int i = 0; i < 2000; ++i) {
    const double tolerance = i % 3 == 0 ? u(g) : 0;
    const Sphere a{1e3 * test::randomDirection(g), 1 + 99 * u(g)};
    Sphere b{Eigen::Vector3d::Zero(), 1 + 99 * u(g)};
    const double distance = a.radius + b.radius + tolerance;
    const Eigen::Vector3d direction = test::randomDirection(g);
    b.center = a.center + distance * (1 + 1e-10) * direction;
    EXPECT_FALSE(spheresMeet(a, b, tolerance));
    b.center = a.center + distance * (1 - 1e-14) * direction;
    EXPECT_TRUE(spheresMeet(a, b, tolerance));
  }
}

// What resident pairs settle grows nothing, however long the walk to the hit is.
TEST(SphereWalk, AHitThatIsAskedAgainGrowsNothing) {
  std::mt19937_64 g(54);
  const Model a(test::torus(60, 0.2), Subdivision::kBono, 7), b(test::torus(40, 0.3), Subdivision::kBono, 7);
  const auto lazy_a = a.fresh(), lazy_b = b.fresh();
  std::vector<SimilarityTransform> poses;
  for (int i = 0; i < 50; ++i) poses.push_back(touching(a, b, 1, -0.9, false, g));
  const auto ask = [&] {
    const std::size_t before = lazy_a->statistics().expansions + lazy_b->statistics().expansions;
    for (const SimilarityTransform& b_in_a : poses) EXPECT_FALSE(walk(*lazy_a, *lazy_b, b_in_a, true).pairs.empty());
    return lazy_a->statistics().expansions + lazy_b->statistics().expansions - before;
  };
  EXPECT_GT(ask(), 0u);
  EXPECT_EQ(ask(), 0u);
  EXPECT_LT(lazy_a->statistics().expansions, a.whole->statistics().expansions / 2);
}

INSTANTIATE_TEST_SUITE_P(Targets, SphereWalks, testing::ValuesIn(test::EveryTarget::targets()),
                         test::EveryTarget::name);

}  // namespace
}  // namespace bocst::query
