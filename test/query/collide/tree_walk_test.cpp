// SPDX-License-Identifier: BSD-3-Clause
// Exact answers of two models: where a point of one triangle comes to lie on a point of another, or within the
// tolerance of it, the walk finds the pair, on every instruction set, whatever is resident.
#include "query/collide/tree_walk.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include "every_target.h"
#include "meshes.h"

namespace bocst::query {
namespace {

using Eigen::Vector3d;

class TreeWalks : public test::EveryTarget {};

class Triangles : public Visitor {
 public:
  bool endsAtFirst() const override { return false; }
  bool triangles(std::uint32_t a, std::uint32_t b, bool) override {
    pairs.emplace(a, b);
    return false;
  }
  bool cells(const CellLeaf&, const CellLeaf&) override { return fail(); }
  bool cellOfA(const CellLeaf&, std::uint32_t, const Vector3d&) override { return fail(); }
  bool cellOfB(std::uint32_t, const CellLeaf&, const Vector3d&) override { return fail(); }

  std::set<std::pair<std::uint32_t, std::uint32_t>> pairs;

 private:
  static bool fail() {
    ADD_FAILURE() << "no spheres were asked for";
    return true;
  }
};

struct Model {
  explicit Model(const test::Raw& raw_) : raw(raw_), mesh(raw.mesh()), tree(fresh()) {}

  std::unique_ptr<tree::Tree> fresh() const {
    Options options;
    options.ttl = std::chrono::milliseconds(0);
    return std::make_unique<tree::Tree>(mesh, options);
  }
  Vector3d corner(std::size_t t, std::size_t k) const {
    return tree->surface().lattice.toLattice(mesh->vertex(mesh->indices(t)[k]));
  }
  /// A triangle that reaches farthest along a direction, and there a corner.
  std::size_t farthest(const Vector3d& direction, Vector3d& p) const {
    double most = -std::numeric_limits<double>::infinity();
    std::size_t triangle = 0;
    for (std::size_t t = 0; t < mesh->triangleCount(); ++t) {
      for (std::size_t k = 0; k < 3; ++k) {
        const Vector3d v = corner(t, k);
        if (!(direction.dot(v) > most)) continue;
        most = direction.dot(v);
        triangle = t;
        p = v;
      }
    }
    return triangle;
  }
  /// Any triangle, and a corner of it, a point of an edge or one between.
  std::size_t any(std::mt19937_64& g, Vector3d& p) const {
    std::uniform_real_distribution<double> u(0, 1);
    const std::size_t t = g() % mesh->triangleCount();
    const double s = g() % 3 == 0 ? std::round(u(g)) : u(g), r = g() % 2 == 0 ? 0 : u(g) * (1 - s);
    p = corner(t, 0) + s * (corner(t, 1) - corner(t, 0)) + r * (corner(t, 2) - corner(t, 0));
    return t;
  }

  test::Raw raw;
  std::shared_ptr<const Mesh> mesh;
  std::unique_ptr<tree::Tree> tree;
};

/// Some triangles all through the unit cube.
test::Raw large(std::size_t count, unsigned seed) {
  std::mt19937_64 g(seed);
  std::uniform_real_distribution<double> u(0, 1);
  test::Raw raw;
  for (std::size_t i = 0; i < count; ++i) {
    for (int k = 0; k < 3; ++k) raw.vertices.emplace_back(u(g), u(g), u(g));
    raw.triangles.emplace_back(3 * i, 3 * i + 1, 3 * i + 2);
  }
  return raw;
}

void findsWhatTouches(const std::vector<test::Raw>& meshes, const std::vector<double>& exponents, int rounds,
                      unsigned seed) {
  std::mt19937_64 g(seed);
  std::uniform_real_distribution<double> u(-1, 1);
  std::vector<std::unique_ptr<Model>> models;
  for (const test::Raw& raw : meshes) models.push_back(std::make_unique<Model>(raw));
  for (int round = 0; round < rounds; ++round) {
    const Model &a = *models[g() % models.size()], &b = *models[g() % models.size()];
    SimilarityTransform to;
    to.rotation = test::randomRotation(g);
    if (round % 4 == 0) to.rotation = Eigen::AngleAxisd(1e-6 * u(g), Vector3d::UnitX()).toRotationMatrix();
    to.scale = std::exp2(exponents[g() % exponents.size()] + u(g));
    // What placing itself rounds away, and a margin.
    const double rounding = 0x1p-49 * 2 * lattice::kMiddle * 2 * std::max(1.0, to.scale);
    const double margin = round % 3 == 0 ? 0 : std::pow(10.0, 1 + 3 * u(g)) * std::max(1.0, to.scale);
    to.tolerance = rounding + margin;
    to.ready();
    const Vector3d direction = test::randomDirection(g);
    Vector3d p, q;
    // Mostly the two lie on either side of the point, and no other pair is as near.
    const bool outside = round % 4 != 3;
    const std::size_t s = outside ? a.farthest(direction, p) : a.any(g, p);
    const std::size_t t = outside ? b.farthest(-(to.rotation.transpose() * direction), q) : b.any(g, q);
    to.translation = p + 0.999 * margin * direction - to.scale * (to.rotation * q);
    const std::pair<std::uint32_t, std::uint32_t> expected(s, t);
    SCOPED_TRACE(testing::Message() << "triangle " << s << " of " << a.mesh->triangleCount() << " at " << p.transpose()
                                    << ", " << t << " of " << b.mesh->triangleCount() << " at " << q.transpose());
    const auto find = [&](tree::Tree& tree_a, tree::Tree& tree_b, const char* what) {
      const TreeSide side_a(tree_a), side_b(tree_b);
      TreeWalk walk(side_a, side_b, to);
      Triangles found;
      ASSERT_FALSE(walk.isNeedless()) << what << ", round " << round << " scale " << to.scale << " tolerance "
                                      << to.tolerance;
      walk.run(found);
      ASSERT_EQ(found.pairs.count(expected), 1u)
          << what << ", round " << round << " scale " << to.scale << " tolerance " << to.tolerance;
    };
    find(*a.tree, *b.tree, "as queries left them");
    if (round % 8 == 0) find(*a.fresh(), *b.fresh(), "fresh");
    if (testing::Test::HasFatalFailure()) return;
  }
}

TEST_P(TreeWalks, FindWhatTouches) {
  findsWhatTouches({test::torus(50), test::torus(9, 0.3), test::adversarial(), large(20, 1), large(300, 2),
                    test::box({0, 0, 0}, {1, 1e-3, 3e-4})},
                   {0, 0, -2, 3, -8}, 1500, 61);
}

// Leaves of large triangles among nodes far smaller, and boxes that hold nothing but their surface.
TEST_P(TreeWalks, FindWhatTouchesLargeTriangles) {
  findsWhatTouches({large(1, 3), large(5, 4), large(32, 5), test::torus(30), test::box({0, 0, 0}, {1, 1, 1})},
                   {0, -4, 5, -8.9, 8.9}, 2500, 62);
}

INSTANTIATE_TEST_SUITE_P(Targets, TreeWalks, testing::ValuesIn(test::EveryTarget::targets()), test::EveryTarget::name);

}  // namespace
}  // namespace bocst::query
