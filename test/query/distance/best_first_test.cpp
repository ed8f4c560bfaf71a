// SPDX-License-Identifier: BSD-3-Clause
// The search for the least by itself, on trees made by hand: the distance of boxes.
#include "query/distance/best_first.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <vector>

#include "meshes.h"
#include "query/hand_tree.h"

namespace bocst::query {
namespace {

using test::HandTree;
using Box = Eigen::AlignedBox3d;

/// The least distance of two leaves' boxes, by the distances of boxes about them.
class Nearest : public BestFirst<Nearest, HandTree, HandTree> {
 public:
  using Base = BestFirst<Nearest, HandTree, HandTree>;
  friend Base;

  Nearest(const HandTree& a, const HandTree& b) : Base(a, b, heap()) {}

  double run() {
    search();
    return best;
  }

  double best = std::numeric_limits<double>::infinity();
  double enough = -1;             ///< What is no farther settles it.
  double put_off = 0;             ///< Bounds are worse by so much until they are asked for again.
  std::vector<double> at_leaves;  ///< The bounds of pairs of leaves, in their order.

 private:
  static Heap& heap() {
    static Heap h;
    return h;
  }
  bool worthIt(double bound) const { return bound < best; }
  double tie() const { return 0; }
  bool settled() const { return best <= enough; }
  double scaleOfB() const { return 1; }
  Box extentOfA(int n) const { return a_.box(n); }
  Box extentOfB(int n) const { return b_.box(n); }
  Box sphereOfA(int n) const { return a_.box(n); }
  Box sphereOfB(int n) const { return b_.box(n); }
  double boundOf(const Box& a, const Box& b) const { return std::max(0.0, a.exteriorDistance(b) - put_off); }
  bool again(const Pair& pair) {
    const double better = a_.box(pair.a).exteriorDistance(b_.box(pair.b));
    if (better <= pair.bound) return false;
    push({better, pair.a, pair.b});
    return true;
  }
  void leaves(const Pair& pair) {
    at_leaves.push_back(pair.bound);
    best = std::min(best, a_.box(pair.a).exteriorDistance(b_.box(pair.b)));
  }
};

double bruteForce(const HandTree& a, const HandTree& b) {
  double least = std::numeric_limits<double>::infinity();
  for (int n = 0; n < static_cast<int>(a.size()); ++n) {
    if (a.state(n) != State::kLeaf) continue;
    for (int m = 0; m < static_cast<int>(b.size()); ++m) {
      if (b.state(m) == State::kLeaf) least = std::min(least, a.box(n).exteriorDistance(b.box(m)));
    }
  }
  return least;
}

TEST(BestFirst, FindsTheLeastAndAsksNothingThatIsFarther) {
  std::mt19937_64 g(1);
  for (int i = 0; i < 200; ++i) {
    auto triangles = test::cloud(g, 1 + g() % 80, 6);
    HandTree b(test::cloud(g, 1 + g() % 80, 6), 1 + g() % 3);
    const Eigen::Vector3d by = test::randomDirection(g) * 12;
    for (auto& t : triangles) {
      for (auto& x : t.corners) x += by;
    }
    HandTree a(triangles, 1 + g() % 3);
    if (i % 2 == 0) a.sleepFrom(static_cast<int>(g() % 3));
    if (i % 4 < 2) b.sleepFrom(static_cast<int>(g() % 4));
    Nearest nearest(a, b);
    nearest.put_off = i % 3 == 0 ? 1.5 : 0;
    const double least = bruteForce(a, b);
    ASSERT_EQ(nearest.run(), least) << i;
    // Leaves come by their bounds, as long as nothing waits to grow.
    ASSERT_FALSE(nearest.at_leaves.empty());
    if (a.grown().empty() && b.grown().empty()) {
      ASSERT_TRUE(std::is_sorted(nearest.at_leaves.begin(), nearest.at_leaves.end()));
      for (const double bound : nearest.at_leaves) ASSERT_LE(bound, least);
    }
  }
}

TEST(BestFirst, OneLeafIsAskedWhereOneIsNearer) {
  HandTree a(test::row(256)), b(test::row(1, 5));
  Nearest nearest(a, b);
  EXPECT_DOUBLE_EQ(nearest.run(), 5);
  EXPECT_EQ(nearest.at_leaves.size(), 1u);
}

TEST(BestFirst, WhatIsResidentMakesGrowthNeedless) {
  HandTree a(test::row(64)), b(test::row(1, 0.5));
  a.sleepFrom(1);
  std::vector<tree::Tree::Growth> none;
  for (int n = 1; a.box(n).max().x() < 32; ++n) a.grow(n, none);
  const std::size_t before = a.grown().size();
  Nearest nearest(a, b);
  EXPECT_DOUBLE_EQ(nearest.run(), 0.5);
  EXPECT_EQ(a.grown().size(), before) << "the other half is 31 units away";
}

TEST(BestFirst, EndsWhereTheAnswerIsGoodEnough) {
  HandTree a(test::row(64)), b(test::row(64, 2));
  Nearest nearest(a, b);
  nearest.enough = 2;
  EXPECT_DOUBLE_EQ(nearest.run(), 2);
  EXPECT_EQ(nearest.at_leaves.size(), 1u);
}

TEST(BestFirst, NothingIsWorthItBeyondWhatIsKnown) {
  HandTree a(test::row(64)), b(test::row(64, 2));
  a.sleepFrom(0);
  Nearest nearest(a, b);
  nearest.best = 2;  // known from elsewhere
  EXPECT_DOUBLE_EQ(nearest.run(), 2);
  EXPECT_TRUE(nearest.at_leaves.empty());
  EXPECT_TRUE(a.grown().empty());
}

}  // namespace
}  // namespace bocst::query
