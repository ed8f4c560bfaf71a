// SPDX-License-Identifier: BSD-3-Clause
// The walks over pairs of nodes by themselves: on trees made by hand, and of two trees on small meshes. What touches is
// found, by brute force over all pairs; resident pairs come first; what is not needed does not grow.
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include "meshes.h"
#include "query/collide/pair_walk.h"
#include "query/collide/tree_walk.h"
#include "query/hand_tree.h"

namespace bocst::query {
namespace {

using test::HandTree;
using Pairs = std::set<std::pair<std::uint32_t, std::uint32_t>>;

class Recorder : public Visitor {
 public:
  explicit Recorder(bool ends_at_first = false) : ends_at_first_(ends_at_first) {}

  bool endsAtFirst() const override { return ends_at_first_; }
  const Cut* cut() const override { return cut_; }
  bool triangles(std::uint32_t a, std::uint32_t b, bool certain) override {
    pairs.insert({a, b});
    if (certain) certainly.insert({a, b});
    order.push_back(a);
    return ends_at_first_ && certain;
  }
  bool cells(const CellLeaf&, const CellLeaf&) override { return fail(); }
  bool cellOfA(const CellLeaf&, std::uint32_t, const Eigen::Vector3d&) override { return fail(); }
  bool cellOfB(std::uint32_t, const CellLeaf&, const Eigen::Vector3d&) override { return fail(); }

  Pairs pairs, certainly;
  std::vector<std::uint32_t> order;
  const Cut* cut_ = nullptr;

 private:
  static bool fail() {
    ADD_FAILURE() << "no cells were asked for";
    return true;
  }
  const bool ends_at_first_;
};

SimilarityTransform shifted(const Eigen::Vector3d& by) {
  SimilarityTransform to;
  to.translation = by;
  to.ready();
  return to;
}

// What is surely within `distance` of each other, by brute force.
Pairs within(const HandTree& a, const HandTree& b, const SimilarityTransform& b_in_a, double distance) {
  Pairs pairs;
  for (std::uint32_t t = 0; t < a.triangles(); ++t) {
    for (std::uint32_t u = 0; u < b.triangles(); ++u) {
      if (test::distanceOf(a.corners(t), b.corners(u), b_in_a) <= distance) pairs.insert({t, u});
    }
  }
  return pairs;
}

bool holds(const Pairs& all, const Pairs& some) {
  return std::includes(all.begin(), all.end(), some.begin(), some.end());
}

TEST(PairWalk, FindsAllThatTouchesAndLittleElse) {
  std::mt19937_64 g(1);
  std::size_t touching = 0, visited = 0;
  for (int i = 0; i < 200; ++i) {
    HandTree a(test::cloud(g, 1 + g() % 60, 1.5), 1 + g() % 4), b(test::cloud(g, 1 + g() % 60, 1.5), 1 + g() % 4);
    SimilarityTransform b_in_a = shifted(test::randomDirection(g));
    b_in_a.rotation = test::randomRotation(g);
    b_in_a.scale = i % 3 == 0 ? 1 : 0.6;
    b_in_a.tolerance = i % 5 == 0 ? 0.1 : 0;
    b_in_a.orthogonality_error = 1e-15;
    b_in_a.ready();
    if (i % 2 == 0) a.sleepFrom(static_cast<int>(g() % 3));
    if (i % 4 < 2) b.sleepFrom(static_cast<int>(g() % 3));
    Recorder all;
    EXPECT_FALSE((PairWalk<HandTree, HandTree>(a, b, b_in_a, all).run()));
    const Pairs touch = within(a, b, b_in_a, b_in_a.tolerance);
    ASSERT_TRUE(holds(all.pairs, touch)) << i;
    ASSERT_TRUE(holds(within(a, b, b_in_a, b_in_a.tolerance + 1e-9), all.certainly)) << i;
    ASSERT_TRUE(holds(within(a, b, b_in_a, b_in_a.tolerance + 1), all.pairs)) << "pairs that are far apart";
    touching += touch.size();
    visited += all.pairs.size();
    Recorder first(true);
    EXPECT_EQ((PairWalk<HandTree, HandTree>(a, b, b_in_a, first).run()), !all.certainly.empty()) << i;
    EXPECT_LE(first.certainly.size(), 1u);
  }
  EXPECT_GT(touching, 1000u);
  EXPECT_LT(visited, 2 * touching);
}

TEST(PairWalk, WhatIsApartIsNotVisitedAndDoesNotGrow) {
  HandTree a(test::row(16)), b(test::row(16));
  a.sleepFrom(0);
  b.sleepFrom(0);
  Recorder none;
  // Beside each other along each axis, then only just.
  for (const Eigen::Vector3d& by :
       {Eigen::Vector3d(16, 0, 0), Eigen::Vector3d(0, 1, 0), Eigen::Vector3d(0, 0, 1e-9), Eigen::Vector3d(0, 0, -3)}) {
    EXPECT_FALSE((PairWalk<HandTree, HandTree>(a, b, shifted(by), none).run()));
  }
  EXPECT_TRUE(none.pairs.empty());
  EXPECT_TRUE(a.grown().empty() && b.grown().empty());
}

// Row b crosses row a at its last triangles only.
SimilarityTransform atTheEnd(std::size_t count) { return shifted({static_cast<double>(count) - 1, 0, 0}); }

TEST(PairWalk, GrowsOnlyWhatOverlaps) {
  HandTree a(test::row(64)), b(test::row(64));
  a.sleepFrom(0);
  b.sleepFrom(0);
  const SimilarityTransform b_in_a = atTheEnd(64);
  Recorder all;
  PairWalk<HandTree, HandTree>(a, b, b_in_a, all).run();
  EXPECT_EQ(all.pairs, (Pairs{{63, 0}}));
  // Six levels of each, of which one node overlaps.
  EXPECT_EQ(a.grown().size(), 6u);
  EXPECT_EQ(b.grown().size(), 6u);
  for (const int n : a.grown()) EXPECT_GE(a.box(n).max().x(), 63);
  for (const int n : b.grown()) EXPECT_LE(b.box(n).min().x(), 0);
}

// A blade across all of a row.
HandTree blade() {
  std::vector<test::HandTriangle> blade(1);
  blade[0].corners[0] = {-1, 0.4, -0.5};
  blade[0].corners[1] = {100, 0.4, -0.5};
  blade[0].corners[2] = {50, 0.4, 50};
  return HandTree(blade);
}

TEST(PairWalk, AHitAmongResidentPairsGrowsNothing) {
  HandTree a(test::row(64));
  const HandTree b = blade();
  a.sleepFrom(1);
  // The first half is resident down to its triangles, of which each touches; the other half sleeps.
  std::vector<tree::Tree::Growth> none;
  for (int n = 1; a.box(n).max().x() < 32; ++n) a.grow(n, none);
  const std::size_t before = a.grown().size();
  EXPECT_EQ(before, 31u);
  Recorder first(true);
  EXPECT_TRUE((PairWalk<HandTree, HandTree>(a, b, shifted({0, 0, 0}), first).run()));
  EXPECT_EQ(first.pairs.size(), 1u);
  EXPECT_EQ(a.grown().size(), before);
  Recorder all;
  EXPECT_FALSE((PairWalk<HandTree, HandTree>(a, b, shifted({0, 0, 0}), all).run()));
  EXPECT_EQ(all.certainly.size(), 64u);
  EXPECT_EQ(a.grown().size(), 62u);
}

TEST(PairWalk, AWalkThatMayEndGrowsTheDeepestOverlapsFirst) {
  // Four parts of the row sleep, with middles about 3.9, 11.9, 19.9 and 27.9; the blade's middle is moved to 12.
  HandTree a(test::row(32));
  a.sleepFrom(2);
  Recorder first(true);
  EXPECT_TRUE((PairWalk<HandTree, HandTree>(a, blade(), shifted({12 - 49.5, 0, 0}), first).run()));
  ASSERT_GE(a.grown().size(), 2u);
  std::set<int> middles;  // of the first batch
  for (std::size_t i = 0; i < 2; ++i) middles.insert(static_cast<int>(std::lround(a.box(a.grown()[i]).center().x())));
  EXPECT_EQ(middles, (std::set<int>{12, 20}));
}

TEST(PairWalk, ACutLeavesOutWhatLiesBeyondAndComesFromBelow) {
  HandTree a(test::row(32));
  auto wide = test::row(1);
  wide[0].corners[1] = {100, 0, 0};
  HandTree bar(wide);
  for (const double last : {-1.0, 0.0, 7.5, 20.0, 100.0}) {
    Cut cut;
    cut.last = last;
    Recorder some;
    some.cut_ = &cut;
    PairWalk<HandTree, HandTree>(a, bar, shifted({0, 0.1, 0}), some).run();
    for (const auto& [t, u] : some.pairs) EXPECT_LE(t, last + 0x1p-6);
    EXPECT_EQ(some.pairs.size(), static_cast<std::size_t>(std::clamp(std::floor(last) + 1, 0.0, 32.0)));
    EXPECT_TRUE(std::is_sorted(some.order.begin(), some.order.end()));
  }
}

// Two trees: their walk against brute force over the triangles, and against the walk of anything else. Also while
// another thread builds.
TEST(TreeWalk, FindsAllThatTouches) {
  std::mt19937_64 g(2);
  std::size_t touching = 0, visited = 0, certain = 0;
  for (int i = 0; i < 60; ++i) {
    std::shared_ptr<const Mesh> mesh[2];
    for (auto& m : mesh) {
      test::Raw raw;
      for (const test::HandTriangle& t : test::cloud(g, 1 + g() % 100, 2)) {
        for (const Eigen::Vector3d& x : t.corners) raw.vertices.push_back(x);
        const std::size_t n = raw.vertices.size();
        raw.triangles.emplace_back(n - 3, n - 2, n - 1);
      }
      m = raw.mesh();
    }
    tree::Tree a(mesh[0], Options()), b(mesh[1], Options());
    const TreeSide side_a(a), side_b(b);
    if (i % 3 != 0) {
      // A helper thread puts the whole tree, often a single leaf, in the place of blocks that the query has seen.
      a.expandAll(3);
      ASSERT_EQ(side_a.state(side_a.root()), State::kInner);
      a.build();
      if (i % 3 == 2) {
        b.expandAll(2);
        ASSERT_EQ(side_b.state(side_b.root()), State::kInner);
        b.build();
      }
    }
    const double unit_a = a.surface().lattice.unit(), unit_b = b.surface().lattice.unit();
    SimilarityTransform b_in_a;
    b_in_a.rotation = test::randomRotation(g);
    b_in_a.scale = unit_b / unit_a;
    b_in_a.translation = a.surface().lattice.toLattice(test::randomDirection(g)) -
                         b_in_a.scale * (b_in_a.rotation * b.surface().lattice.toLattice(Eigen::Vector3d::Zero()));
    b_in_a.orthogonality_error = 1e-15;
    b_in_a.ready();
    Pairs touch;
    for (std::uint32_t t = 0; t < mesh[0]->triangleCount(); ++t) {
      const Corners p = side_a.corners(t);
      for (std::uint32_t u = 0; u < mesh[1]->triangleCount(); ++u) {
        const Corners q = side_b.corners(u);
        if (test::distanceOf(p, q, b_in_a) == 0) touch.insert({t, u});
      }
    }
    ASSERT_TRUE(TreeWalk::fits(side_a, side_b, b_in_a));
    Recorder all, others, first(true);
    TreeWalk walk(side_a, side_b, b_in_a);
    if (walk.isNeedless()) {
      ASSERT_TRUE(touch.empty());
      continue;
    }
    EXPECT_FALSE(walk.run(all));
    ASSERT_TRUE(holds(all.pairs, touch)) << i;
    EXPECT_FALSE((PairWalk<TreeSide, TreeSide>(side_a, side_b, b_in_a, others).run()));
    ASSERT_TRUE(holds(others.pairs, touch)) << i;
    EXPECT_EQ(TreeWalk(side_a, side_b, b_in_a).run(first), !all.certainly.empty());
    for (const auto& pair : all.certainly) ASSERT_TRUE(touch.count(pair)) << i;
    touching += touch.size();
    visited += all.pairs.size();
    certain += all.certainly.size();
  }
  EXPECT_GT(touching, 500u);
  EXPECT_GT(certain, touching * 9 / 10);
  EXPECT_LT(visited, 2 * touching);
}

}  // namespace
}  // namespace bocst::query
