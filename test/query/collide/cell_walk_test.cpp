// SPDX-License-Identifier: BSD-3-Clause
// A model with conservative answers and one with exact ones: the walk finds exactly the triangles that the spheres of
// cells meet in double, on every instruction set, whatever is resident and whichever side has the cells.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <set>
#include <utility>

#include "every_target.h"
#include "geometry/triangle.h"
#include "meshes.h"
#include "query/collide/cell_tree.h"
#include "query/collide/tree_walk.h"

namespace bocst::query {
namespace {

using Eigen::Vector3d;

class CellWalks : public test::EveryTarget {};

using Pairs = std::set<std::pair<std::uint64_t, std::uint32_t>>;  // a cell's id and a triangle

/// Wants one pair, all, or those of the `most` cells that have the smallest ids.
class Found : public Visitor {
 public:
  Found(bool cells_are_a, bool ends_at_first, std::size_t most)
      : cells_are_a_(cells_are_a), ends_at_first_(ends_at_first), most_(most) {
    cut_.cell_side = cells_are_a ? 0 : 1;
  }

  bool endsAtFirst() const override { return ends_at_first_; }
  const Cut* cut() const override { return most_ > 0 ? &cut_ : nullptr; }
  bool triangles(std::uint32_t, std::uint32_t, bool) override { return fail(); }
  bool cells(const CellLeaf&, const CellLeaf&) override { return fail(); }
  bool cellOfA(const CellLeaf& a, std::uint32_t b, const Vector3d&) override { return add(cells_are_a_, a.id, b); }
  bool cellOfB(std::uint32_t a, const CellLeaf& b, const Vector3d&) override { return add(!cells_are_a_, b.id, a); }

  Pairs pairs;

 private:
  bool add(bool is_right_side, std::uint64_t cell, std::uint32_t triangle) {
    EXPECT_TRUE(is_right_side);
    EXPECT_LE(cell, cut_.last_cell);
    pairs.emplace(cell, triangle);
    ids_.insert(cell);
    if (most_ > 0 && ids_.size() >= most_) cut_.last_cell = *std::next(ids_.begin(), static_cast<long>(most_) - 1);
    return ends_at_first_;
  }
  static bool fail() {
    ADD_FAILURE() << "neither two cells nor two triangles can meet";
    return true;
  }

  const bool cells_are_a_, ends_at_first_;
  const std::size_t most_;
  std::set<std::uint64_t> ids_;
  Cut cut_;
};

struct Cells : test::CellTree {
  using CellTree::CellTree;
  std::unique_ptr<tree::Tree> lazy = fresh();
};

struct Triangles {
  explicit Triangles(const test::Raw& raw) : mesh(raw.mesh()) {
    Options options;
    options.ttl = std::chrono::milliseconds(0);
    lazy = std::make_unique<tree::Tree>(mesh, options);
  }

  std::shared_ptr<const Mesh> mesh;
  std::unique_ptr<tree::Tree> lazy;
};

/// What is where: side A is the cells' or the triangles' side.
struct Setting {
  const Cells& cells;
  const Triangles& triangles;
  bool cells_are_a;
  SimilarityTransform b_in_a;

  Sphere sphere(const CellLeaf& leaf) const { return cells_are_a ? leaf.sphere : placed(leaf.sphere, b_in_a); }
  Vector3d corner(std::uint32_t t, int k) const {
    const Vector3d v = triangles.lazy->surface().corner(t, k);
    return cells_are_a ? b_in_a * v : v;
  }
  bool meet(const CellLeaf& leaf, std::uint32_t t) const {
    const Corners corners = {corner(t, 0), corner(t, 1), corner(t, 2)};
    const Sphere ball = sphere(leaf);
    return spheresMeet(ball, {closestPoint(ball.center, corners), 0}, b_in_a.tolerance);
  }
  Pairs byDefinition() const {
    Pairs pairs;
    for (const CellLeaf& leaf : cells.leaves) {
      for (std::uint32_t t = 0; t < triangles.mesh->triangleCount(); ++t) {
        if (meet(leaf, t)) pairs.emplace(leaf.id, t);
      }
    }
    return pairs;
  }
  Pairs walked(tree::Tree& of_cells, bool ends_at_first, std::size_t most) const {
    const TreeSide c(of_cells), t(*triangles.lazy);
    const TreeSide &a = cells_are_a ? c : t, &b = cells_are_a ? t : c;
    Found found(cells_are_a, ends_at_first, most);
    EXPECT_TRUE(TreeWalk::fitsCells(a, b, b_in_a));
    TreeWalk walk(a, b, b_in_a);
    if (!walk.isNeedless()) {
      const bool ended = walk.run(found);
      EXPECT_EQ(ended, ends_at_first && !found.pairs.empty());
    }
    return found.pairs;
  }
};

/// Places the sides so that a cell's sphere and a point of a triangle are apart by `gap` times the radius.
Setting touching(const Cells& cells, const Triangles& triangles, bool cells_are_a, double scale, double gap,
                 std::mt19937_64& g) {
  Setting s{cells, triangles, cells_are_a, {}};
  s.b_in_a.rotation = test::randomRotation(g);
  s.b_in_a.scale = scale;
  s.b_in_a.orthogonality_error = 1e-15;
  s.b_in_a.ready();
  std::uniform_real_distribution<double> u(0, 1);
  const CellLeaf& leaf = cells.leaves[g() % cells.leaves.size()];
  const auto t = static_cast<std::uint32_t>(g() % triangles.mesh->triangleCount());
  const double r = std::round(3 * u(g)) / 3, q = (1 - r) * u(g);
  const Vector3d point = s.corner(t, 0) + r * (s.corner(t, 1) - s.corner(t, 0)) + q * (s.corner(t, 2) - s.corner(t, 0));
  const Sphere ball = s.sphere(leaf);
  const Vector3d target = ball.center + ball.radius * (1 + gap) * test::randomDirection(g);
  s.b_in_a.translation = cells_are_a ? Vector3d(target - point) : Vector3d(point - target);
  return s;
}

struct Counts {
  std::size_t hits = 0, misses = 0, pairs = 0;
};

void compare(const Setting& s, Counts& counts) {
  const Pairs expected = s.byDefinition();
  counts.pairs += expected.size();
  ++(expected.empty() ? counts.misses : counts.hits);
  for (tree::Tree* of_cells : {s.cells.lazy.get(), s.cells.whole.get()}) {
    const Pairs first = s.walked(*of_cells, true, 0);
    ASSERT_EQ(first.empty(), expected.empty());
    for (const auto& pair : first) ASSERT_EQ(expected.count(pair), 1u);
    for (const std::size_t most : {1u, 7u}) {
      std::set<std::uint64_t> ids;
      for (const auto& [cell, triangle] : expected) ids.insert(cell);
      const std::uint64_t last = ids.size() > most ? *std::next(ids.begin(), static_cast<long>(most) - 1) : ~0ull;
      const Pairs found = s.walked(*of_cells, false, most);
      for (const auto& pair : expected) {
        ASSERT_TRUE(pair.first > last || found.count(pair) == 1) << "of the first " << most;
      }
      for (const auto& pair : found) ASSERT_EQ(expected.count(pair), 1u);
    }
    ASSERT_EQ(s.walked(*of_cells, false, 0), expected);
  }
}

constexpr double kGaps[] = {0, 1e-9, -1e-9, 1e-6, 1e-3, -1e-2, 0.3, 3, -0.8};

TEST_P(CellWalks, FindWhatMeetsAtEveryDepth) {
  std::mt19937_64 g(61);
  const Triangles small(test::torus(9, 0.3)), large(test::soup(12, 63)), layers(test::box({0, 0, 0}, {2, 1, 1e-3}));
  for (int depth = 1; depth <= 7; ++depth) {
    Counts counts;
    for (const Subdivision subdivision : {Subdivision::kOctree, Subdivision::kBono}) {
      const Cells cells(depth < 5 ? test::torus(12, 0.2) : test::box({0, 0, 0}, {1, 0.01, 0.003}), subdivision, depth);
      for (const Triangles* triangles : {&small, &large, &layers}) {
        for (const double gap : kGaps) {
          for (const bool cells_are_a : {true, false}) {
            SCOPED_TRACE(testing::Message() << "depth " << depth << " gap " << gap << " A is cells " << cells_are_a);
            compare(touching(cells, *triangles, cells_are_a, 0.6, gap, g), counts);
            if (HasFatalFailure()) return;
          }
        }
      }
    }
    EXPECT_GT(counts.hits, 20u) << depth;
    EXPECT_GT(counts.pairs, 500u) << depth;
  }
}

TEST_P(CellWalks, FindWhatMeetsAtAnySizeAndTolerance) {
  std::mt19937_64 g(62);
  std::uniform_real_distribution<double> unit(-1, 1);
  const Cells cells(test::torus(10, 0.3), Subdivision::kBono, 4);
  const Triangles triangles(test::torus(11, 0.2));
  for (const double scale : {0.001, 0.03, 0.5, 1.0, 30.0, 1000.0}) {
    Counts counts;
    for (int i = 0; i < 40; ++i) {
      SCOPED_TRACE(testing::Message() << "scale " << scale << " pose " << i);
      Setting s = touching(cells, triangles, i % 2 == 0, scale, kGaps[static_cast<std::size_t>(i) % 9], g);
      if (i % 3 == 0) s.b_in_a.tolerance = std::pow(10.0, 4 * unit(g)) * std::min(1.0, scale);
      if (i % 5 == 0) {
        for (int k = 0; k < 9; ++k) s.b_in_a.rotation.data()[k] += 1e-4 * unit(g);
        s.b_in_a.orthogonality_error =
            (s.b_in_a.rotation.transpose() * s.b_in_a.rotation - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
        s.b_in_a.ready();
      }
      if (i % 6 == 0) s.b_in_a.translation += std::max(1.0, scale) * 50000 * test::randomDirection(g);
      compare(s, counts);
      if (HasFatalFailure()) return;
    }
    EXPECT_GT(counts.hits, 5u) << scale;
    EXPECT_GT(counts.misses, 2u) << scale;
  }
}

// A slab's normal may be longer than 1, and then says that what touches from above its faces is farther away.
TEST_P(CellWalks, FindFlatFacesThatASphereJustTouches) {
  std::mt19937_64 g(64);
  std::uniform_real_distribution<double> u(0, 1);
  Counts counts;
  for (int i = 0; i < 60; ++i) {
    const Cells cells(test::torus(12, 0.2), Subdivision::kOctree, 2 + i % 3);
    test::Raw plate = test::plate(16);
    const Eigen::Matrix3d turn = test::randomRotation(g);
    for (Vector3d& v : plate.vertices) v = turn * v;
    const Triangles triangles(plate);
    const bool cells_are_a = i % 2 == 0;
    SCOPED_TRACE(testing::Message() << "plate " << i);
    Setting s{cells, triangles, cells_are_a, {}};
    s.b_in_a.rotation = test::randomRotation(g);
    s.b_in_a.scale = cells_are_a ? 0.5 : 2;
    s.b_in_a.orthogonality_error = 1e-15;
    s.b_in_a.ready();
    const auto t = static_cast<std::uint32_t>(g() % triangles.mesh->triangleCount());
    const Corners corners = {s.corner(t, 0), s.corner(t, 1), s.corner(t, 2)};
    const Vector3d point = (corners[0] + corners[1] + corners[2]) / 3;
    const Vector3d normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalized();
    const Sphere ball = s.sphere(cells.leaves[g() % cells.leaves.size()]);
    const Vector3d target = ball.center + ball.radius * (1 - 0.004 * u(g)) * normal;
    s.b_in_a.translation = cells_are_a ? Vector3d(target - point) : Vector3d(point - target);
    compare(s, counts);
    if (HasFatalFailure()) return;
  }
  EXPECT_EQ(counts.misses, 0u);
}

INSTANTIATE_TEST_SUITE_P(Targets, CellWalks, testing::ValuesIn(test::EveryTarget::targets()), test::EveryTarget::name);

}  // namespace
}  // namespace bocst::query
