// SPDX-License-Identifier: BSD-3-Clause
// What probes prove is so: the walk finds contact at the same pose. On every instruction set.
#include "query/cull/crossing.h"

#include <gtest/gtest.h>

#include <limits>
#include <memory>
#include <random>
#include <vector>

#include "conformance/reference.h"
#include "every_target.h"
#include "meshes.h"

namespace bocst::query {
namespace {

using Eigen::Vector3d;
using test::Raw;

struct Side {
  explicit Side(const Raw& raw)
      : mesh(raw.mesh()), lattice(mesh->bounds(), Options().subdivision, 0), interior(*mesh, lattice), model(mesh) {}

  std::shared_ptr<const Mesh> mesh;
  lattice::Lattice lattice;
  Interior interior;
  Model<double> model;
};

SimilarityTransform inLattice(const Side& a, const fcl::Transform3d& X_AB, const Side& b) {
  SimilarityTransform to;
  to.rotation = X_AB.linear();
  to.scale = b.lattice.unit() / a.lattice.unit();
  to.translation = a.lattice.toLattice(X_AB * b.lattice.origin());
  to.ready();
  return to;
}

bool proved(const Side& a, const fcl::Transform3d& X_AB, const Side& b) {
  return surelyCross(a.interior, b.interior, inLattice(a, X_AB, b));
}

bool touch(const Side& a, const fcl::Transform3d& X_AB, const Side& b) {
  return test::touching<double>(a.model, fcl::Transform3d::Identity(), b.model, X_AB);
}

class Crossing : public test::EveryTarget {};

TEST_P(Crossing, IsProvedOnlyWhereThereIsContact) {
  Raw open = test::torus(20);
  open.triangles.pop_back();
  Raw far = test::torus(16);
  far.move({40, -30, 20});
  const std::vector<Raw> raws = {test::torus(20),
                                 test::box({-0.4, -0.5, -0.3}, {0.4, 0.5, 0.3}),
                                 test::torus(24, 0.3).scale(0.2),
                                 test::box({-0.02, -0.02, -1.5}, {0.02, 0.02, 1.5}),
                                 test::torus(10).add(test::box({1.5, 0, 0}, {2, 0.5, 0.5})),
                                 open,
                                 far};
  std::vector<std::unique_ptr<Side>> sides;
  for (const Raw& raw : raws) sides.push_back(std::make_unique<Side>(raw));
  std::mt19937_64 g(1);
  std::uniform_real_distribution<double> u(-1.5, 1.5);
  std::size_t hits = 0, proofs = 0, asymmetric = 0;
  for (const auto& a : sides) {
    for (const auto& b : sides) {
      for (int n = 0; n < 60; ++n) {
        fcl::Transform3d X = test::pose<double>(test::randomRotation(g), {0, 0, 0});
        X.translation() =
            a->mesh->bounds().center() + Vector3d(u(g), u(g), u(g)) - X.linear() * b->mesh->bounds().center();
        const bool hit = touch(*a, X, *b), is_proved = proved(*a, X, *b);
        ASSERT_TRUE(hit || !is_proved) << &a - &sides[0] << " " << &b - &sides[0] << " pose " << n;
        hits += hit;
        proofs += is_proved;
        asymmetric += is_proved != proved(*b, X.inverse(Eigen::Isometry), *a);
      }
    }
  }
  EXPECT_GT(proofs, hits / 3);
  EXPECT_LT(hits, 49u * 60 * 3 / 4);
  EXPECT_LE(asymmetric, proofs / 50) << "either side's probes are asked, whatever the order";
}

// What is wholly inside touches nothing.
TEST_P(Crossing, IsNotProvedOfWhatIsWhollyInside) {
  const Side outer(test::box({-1, -1, -1}, {1, 1, 1})), inner(test::torus(20).scale(0.2));
  std::mt19937_64 g(2);
  for (int n = 0; n < 100; ++n) {
    const fcl::Transform3d X = test::pose<double>(test::randomRotation(g), 0.3 * test::randomDirection(g));
    ASSERT_FALSE(touch(outer, X, inner));
    EXPECT_FALSE(proved(outer, X, inner));
    EXPECT_FALSE(proved(inner, X.inverse(Eigen::Isometry), outer));
  }
}

// A piece inside and a piece outside, with nothing between them.
TEST_P(Crossing, IsNotProvedByTwoPieces) {
  const Side box(test::box({-1, -1, -1}, {1, 1, 1}));
  const Side pieces(test::box({-0.1, -0.1, -0.1}, {0.1, 0.1, 0.1}).add(test::box({2.9, -0.1, -0.1}, {3.1, 0.1, 0.1})));
  const fcl::Transform3d X = fcl::Transform3d::Identity();
  ASSERT_FALSE(touch(box, X, pieces));
  EXPECT_FALSE(proved(box, X, pieces));
  EXPECT_FALSE(proved(pieces, X, box));
}

// Of sizes so different that a probe's rounding is more than a cell of the other's grid.
TEST_P(Crossing, IsNotProvedWhereRoundingIsTooCoarse) {
  const Side large(test::torus(40).scale(1e9)), small(test::box({-1, -1, -1}, {1, 1, 1}));
  std::mt19937_64 g(3);
  std::uniform_int_distribution<std::size_t> pick(0, large.mesh->vertexCount() - 1);
  for (int n = 0; n < 100; ++n) {
    const fcl::Transform3d X =
        test::pose<double>(test::randomRotation(g), large.mesh->vertex(pick(g)) + 3 * test::randomDirection(g));
    EXPECT_TRUE(touch(large, X, small) || !proved(large, X, small));
  }
  fcl::Transform3d X = fcl::Transform3d::Identity();
  X.translation().setConstant(std::numeric_limits<double>::quiet_NaN());
  EXPECT_FALSE(proved(small, X, small));
  X.translation().setConstant(1e300);
  EXPECT_FALSE(proved(small, X, small));
}

// Positions that may be off by a tenth of a cell prove nothing.
TEST_P(Crossing, IsNotProvedWherePositionsAreNotKnown) {
  const Side a(test::box({-1, -1, -1}, {1, 1, 1}));
  const fcl::Transform3d X = test::pose<double>(Eigen::Matrix3d::Identity(), {0.9, 0.8, 0.7});
  SimilarityTransform to = inLattice(a, X, a);
  ASSERT_TRUE(surelyCross(a.interior, a.interior, to));
  const double cell = 1 / a.interior.cells_per_unit[0];
  to.tolerance = 0.1 * cell;
  EXPECT_FALSE(surelyCross(a.interior, a.interior, to));
  to.tolerance = 0;
  to.orthogonality_error = 1e-2;
  Interior without = a.interior;
  without.bits = 0;
  EXPECT_FALSE(surelyCross(without, a.interior, to)) << "the transposed rotation is off by so much";
}

INSTANTIATE_TEST_SUITE_P(Targets, Crossing, testing::ValuesIn(test::EveryTarget::targets()), test::EveryTarget::name);

}  // namespace
}  // namespace bocst::query
