// SPDX-License-Identifier: BSD-3-Clause
// What the supports of two surfaces say is never more than brute force over all vertices does, on every instruction set
// that the dispatch can choose, and soon it is little less.
#include "query/cull/separation.h"

#include <bocst/bocst.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "conformance/reference.h"
#include "every_target.h"
#include "meshes.h"
#include "query/collide/tree_walk.h"
#include "query/cull/far_apart.h"

namespace bocst::query {
namespace {

using Eigen::Vector3d;

// A tree and the vertices of its mesh, counted from the middle of the root.
struct Side {
  explicit Side(const test::Raw& raw, const Options& options = Options())
      : tree(raw.mesh(), options), middle(Vector3d::Constant(1 << (lattice::kBits - 1))) {
    for (const auto& t : raw.triangles) {
      for (std::size_t k = 0; k < 3; ++k) {
        vertices.push_back(tree.surface().lattice.toLattice(raw.vertices[t[k]]) - middle);
      }
    }
  }
  double support(const Vector3d& u) const { return u.dot(extreme(u)); }
  Vector3d extreme(const Vector3d& u) const {
    const auto less = [&u](const Vector3d& v, const Vector3d& w) { return u.dot(v) < u.dot(w); };
    return *std::max_element(vertices.begin(), vertices.end(), less);
  }

  mutable tree::Tree tree;
  Vector3d middle;
  std::vector<Vector3d> vertices;
};

SimilarityTransform placement(const Eigen::Matrix3d& R, double scale, const Vector3d& translation) {
  SimilarityTransform to;
  to.rotation = R;
  to.scale = scale;
  to.translation = translation;
  to.orthogonality_error = (R.transpose() * R - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  to.ready();
  return to;
}

// Places b so that the middles of the roots are `way` apart.
SimilarityTransform apartBy(const Side& a, const Side& b, const Eigen::Matrix3d& R, double scale,
                            const Vector3d& displacement) {
  return placement(R, scale, a.middle + displacement - scale * (R * b.middle));
}

// The supports of both, as whole trees know them.
void learnSupports(const Side& a, const Side& b) {
  for (const Side* side : {&a, &b}) {
    side->tree.payRent(side->tree.surface().triangle_count);
    side->tree.buildIfDue();
  }
}

class Separation : public test::EveryTarget {};

std::vector<test::Raw> surfaces() {
  test::Raw rod = test::box({0, 0, 0}, {1, 0.001, 0.0003});
  test::Raw point;
  point.vertices = {{3, 4, 5}};
  point.triangles.emplace_back(0, 0, 0);
  return {
      test::torus(50), test::torus(9, 0.3), test::box({-1, -2, -0.5}, {1, 2, 0.5}), rod, test::adversarial(), point};
}

TEST_P(Separation, NeverExceedsBruteForce) {
  std::mt19937_64 g(31);
  std::uniform_real_distribution<double> u(-1, 1);
  const std::vector<test::Raw> raws = surfaces();
  for (std::size_t i = 0; i < raws.size(); ++i) {
    const Side a(raws[i]), b(raws[(i + 1) % raws.size()]);
    for (const bool sharp : {false, true}) {
      if (sharp) learnSupports(a, b);
      for (int round = 0; round < 60; ++round) {
        const Eigen::Matrix3d R =
            round % 4 == 0 ? Eigen::Matrix3d(Eigen::Matrix3d::Identity()) : test::randomRotation(g);
        const double scale = std::exp2(10 * u(g));
        const Vector3d displacement = test::randomDirection(g) * 32768 * (1 + scale) * 2 * std::abs(u(g));
        const SimilarityTransform to = apartBy(a, b, R, scale, displacement);
        EightSeparations eight;
        for (int lane = 0; lane < 8; ++lane) {
          Vector3d d = test::randomDirection(g);
          // Along axes, edges and diagonals of the cube of directions, too.
          if (lane >= 4) d = Vector3d(static_cast<int>(g() % 3) - 1, static_cast<int>(g() % 3) - 1, g() % 2 ? 1 : -1);
          for (int k = 0; k < 3; ++k) eight.u[k][lane] = static_cast<float>(d[k]);
        }
        evaluate(a.tree.supports(), b.tree.supports(), to, eight);
        for (int lane = 0; lane < 8; ++lane) {
          const Vector3d d(eight.u[0][lane], eight.u[1][lane], eight.u[2][lane]);
          const Vector3d in_b = -(R.transpose() * d);
          const double exact = d.dot(displacement) - a.support(d) - scale * b.support(in_b);
          const double size = 32768 * (1 + scale),
                       rounding_margin = 64 * 0x1p-24 * (displacement.norm() + 2 * size) * d.norm();
          ASSERT_LE(eight.value[lane], exact + rounding_margin)
              << i << ' ' << round << ' ' << lane << " sharp " << sharp;
          if (sharp) {
            ASSERT_GE(eight.value[lane], exact - 0.16 * size) << i << ' ' << round << ' ' << lane;
          }
        }
      }
    }
  }
}

TEST_P(Separation, WhatTouchesIsNotSeparate) {
  std::mt19937_64 g(32);
  std::uniform_real_distribution<double> u(-1, 1);
  const std::vector<test::Raw> raws = surfaces();
  int found = 0, looked = 0;
  for (std::size_t i = 0; i < raws.size(); ++i) {
    const Side a(raws[i]), b(raws[(i + 1) % raws.size()]);
    learnSupports(a, b);
    for (int round = 0; round < 300; ++round) {
      const Eigen::Matrix3d R = test::randomRotation(g);
      const double scale = round % 2 ? 1 : std::exp2(10 * u(g)), size = 32768 * (1 + scale);
      // The farthest vertex of each lies on that of the other.
      const Vector3d d = test::randomDirection(g);
      const Vector3d displacement = a.extreme(d) - scale * (R * b.extreme(-(R.transpose() * d)));
      bool shallow = false;
      EXPECT_FALSE(areSeparate(a.tree.supports(), b.tree.supports(), apartBy(a, b, R, scale, displacement), shallow))
          << i;
      // A little apart may be found so, and far apart must.
      found += areSeparate(a.tree.supports(), b.tree.supports(), apartBy(a, b, R, scale, displacement + 0.1 * size * d),
                           shallow);
      ++looked;
      EXPECT_TRUE(areSeparate(a.tree.supports(), b.tree.supports(),
                              apartBy(a, b, R, scale, displacement + 8 * size * d), shallow));
      // Slack counts as contact.
      SimilarityTransform loose = apartBy(a, b, R, scale, displacement + 0.1 * size * d);
      loose.tolerance = 0.1001 * size;
      EXPECT_FALSE(areSeparate(a.tree.supports(), b.tree.supports(), loose, shallow)) << i;
    }
  }
  EXPECT_GT(found, looked / 2);
}

TEST_P(Separation, WhatIsNoNumberIsNotSeparate) {
  const Side a(test::torus(20)), b(test::torus(20));
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  for (const double x : {nan, inf, -inf, 0.0}) {
    bool shallow = false;
    const SimilarityTransform to = apartBy(a, b, Eigen::Matrix3d::Identity(), 1, Vector3d(x, 0, 0));
    EXPECT_FALSE(areSeparate(a.tree.supports(), b.tree.supports(), to, shallow)) << x;
    EXPECT_FALSE(shallow) << x;
    // Nor is what is far from a rotation, however far apart the two are.
    SimilarityTransform crooked = apartBy(a, b, Eigen::Matrix3d::Identity(), 1, Vector3d(1e6, 0, 0));
    EXPECT_TRUE(areSeparate(a.tree.supports(), b.tree.supports(), crooked, shallow));
    crooked.orthogonality_error = 2e-3;
    EXPECT_FALSE(areSeparate(a.tree.supports(), b.tree.supports(), crooked, shallow));
    // Directions that are none lie among the kept ones, too.
    EightSeparations eight;
    for (int lane = 0; lane < 8; ++lane) {
      for (int k = 0; k < 3; ++k) eight.u[k][lane] = static_cast<float>((lane >> k & 1) != 0 ? x : 0);
    }
    evaluate(a.tree.supports(), b.tree.supports(), apartBy(a, b, Eigen::Matrix3d::Identity(), 1, {9, 9, 9}), eight);
    for (const float value : eight.value) EXPECT_FALSE(value > 0) << x;
  }
}

using Outline = tree::Outline;

/// A pose, its rotation off by `error` an entry of it at most.
Eigen::Isometry3d randomPose(std::mt19937_64& g, double size, double error) {
  std::uniform_real_distribution<double> u(-1, 1);
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  X.linear() = test::randomRotation(g) + error * Eigen::Matrix3d::NullaryExpr([&] { return u(g); });
  X.translation() = size * test::randomDirection(g);
  return X;
}

template <typename S>
Hulls hullsAt(const Side& a, const Eigen::Isometry3d& X_WA, const Side& b, const Eigen::Isometry3d& X_WB,
              double margin) {
  const Eigen::Matrix<S, 4, 4> X_A = X_WA.matrix().cast<S>(), X_B = X_WB.matrix().cast<S>();
  return hullsWithoutLock<S>({a.tree.supports(), a.tree.outline()}, X_A.data(), {b.tree.supports(), b.tree.outline()},
                             X_B.data(), margin);
}

// A vertex of one mesh comes to lie within the margin of a vertex of the other, however off the rotations may be, of
// meshes of any size and far from the origins of their frames.
TEST_P(Separation, HullsThatMeetAreNotApartWithoutLock) {
  std::mt19937_64 g(38);
  std::uniform_real_distribution<double> u(-1, 1);
  const std::vector<test::Raw> raws = surfaces();
  int found = 0, expected = 0, close = 0;
  for (std::size_t i = 0; i < raws.size(); ++i) {
    for (int round = 0; round < 60; ++round) {
      const double exponent = round % 2 ? 44 * u(g) : 0, size = std::pow(10.0, exponent);
      const auto moved = [&](const test::Raw& from) {
        test::Raw raw = from;
        const Vector3d away = size * std::exp2(6 * u(g)) * test::randomDirection(g);
        for (Vector3d& v : raw.vertices) v = size * v + (round % 3 ? Vector3d(0, 0, 0) : away);
        return raw;
      };
      const test::Raw raw_a = moved(raws[i]), raw_b = moved(raws[(i + 1) % raws.size()]);
      const Side a(raw_a), b(raw_b);
      learnSupports(a, b);
      const auto sizeOf = [](const test::Raw& raw) {
        double most = 0;
        for (const Vector3d& v : raw.vertices) most = std::max(most, v.norm());
        return most;
      };
      const double sizes = sizeOf(raw_a) + sizeOf(raw_b), error = round % 4 == 1 ? 2e-6 : 0;
      const double margin = round % 5 ? 0 : size * std::abs(u(g));
      const Eigen::Isometry3d X_WA = randomPose(g, size, error);
      Eigen::Isometry3d X_WB = randomPose(g, size, error);
      const Vector3d d = test::randomDirection(g);
      const auto extreme = [](const test::Raw& raw, const Vector3d& direction) {
        return *std::max_element(raw.vertices.begin(), raw.vertices.end(), [&](const Vector3d& v, const Vector3d& w) {
          return direction.dot(v) < direction.dot(w);
        });
      };
      const Vector3d touching = X_WA * extreme(raw_a, X_WA.linear().transpose() * d) -
                                X_WB.linear() * extreme(raw_b, -(X_WB.linear().transpose() * d));
      const auto at = [&](double gap) {
        X_WB.translation() = touching + gap * d;
        return round % 7 == 0 && std::abs(exponent) < 30 ? hullsAt<float>(a, X_WA, b, X_WB, margin)
                                                         : hullsAt<double>(a, X_WA, b, X_WB, margin);
      };
      ASSERT_NE(at(0.99 * margin), Hulls::kApart) << i << ' ' << round;
      // In units of a lattice about a point, all is too far; and far from the origins, too much is allowed for
      // rounding.
      const bool has_point = raw_a.triangles.size() == 1 || raw_b.triangles.size() == 1;
      if (std::abs(exponent) > 10 || has_point || round % 3 == 0) continue;
      ++expected;
      found += at(9 * (sizes + margin)) == Hulls::kApart;
      close += at(0.3 * sizes + margin) == Hulls::kApart;
    }
  }
  EXPECT_EQ(found, expected);
  EXPECT_GT(expected, 90);
  EXPECT_GT(close, expected / 2);
}

// Of a unit that is infinite as a float, or whose inverse is 0: lengths of the other mesh would vanish beside it.
TEST_P(Separation, UnitsBeyondFloatSayNothing) {
  for (const double exponent : {-44.0, -35.0, 34.0, 40.0, 43.2234, 44.0}) {
    const double size = std::pow(10.0, exponent);
    test::Raw large = test::box({-1, -1, -1}, {1, -0.1, -0.1}), small = test::box({-0.3, -0.3, -0.3}, {0.3, 0.3, 0.3});
    for (Vector3d& v : large.vertices) v *= size;
    for (Vector3d& v : small.vertices) v *= size;
    const Side a(large), b(small);
    const Eigen::Isometry3d here = Eigen::Isometry3d::Identity();
    EXPECT_NE(hullsAt<double>(a, here, b, here, 0), Hulls::kApart) << exponent;
    EXPECT_NE(hullsAt<double>(b, here, a, here, 0), Hulls::kApart) << exponent;
  }
  // The smallest number that a float holds is the unit of one, and 1.4 times that, which it rounds down, of the other.
  const double half = 32768 * static_cast<double>(std::numeric_limits<float>::denorm_min());
  const Vector3d corner = Vector3d::Constant(half);
  const Side a(test::box(-corner, corner)), b(test::box(-1.4 * corner, 1.4 * corner));
  Eigen::Isometry3d there = Eigen::Isometry3d::Identity();
  there.translation().x() = 2.39 * half;
  EXPECT_NE(hullsAt<double>(a, Eigen::Isometry3d::Identity(), b, there, 0), Hulls::kApart);
}

// Hulls between the two rounding margins are left to areSeparate(); those that overlap clearly are not.
TEST_P(Separation, HullsNearEachOtherAreClose) {
  const Side a(test::torus(20)), b(test::torus(20));
  learnSupports(a, b);
  const Eigen::Isometry3d here = Eigen::Isometry3d::Identity();
  const auto at = [&](double x) { return hullsAt<double>(a, here, b, here * Eigen::Translation3d(x, 0, 0), 0); };
  const double extent = 2 * a.tree.surface().bounds.max().x();
  EXPECT_EQ(at(1.1 * extent), Hulls::kApart);
  EXPECT_EQ(at(1.0001 * extent), Hulls::kClose);
  EXPECT_EQ(at(0.9999 * extent), Hulls::kClose);
  EXPECT_EQ(at(0.9 * extent), Hulls::kShallow);
  EXPECT_EQ(at(0.1 * extent), Hulls::kMeet);
  const TreeSide side_a(a.tree), side_b(b.tree);
  const SimilarityTransform far_apart = apartBy(a, b, Eigen::Matrix3d::Identity(), 1, {8 * 65536, 0, 0});
  TreeWalk walk(side_a, side_b, far_apart);
  EXPECT_TRUE(walk.isNeedless(Hulls::kUnknown));
  EXPECT_TRUE(walk.isNeedless(Hulls::kClose));
  EXPECT_FALSE(walk.isNeedless(Hulls::kShallow));
  EXPECT_FALSE(walk.isNeedless(Hulls::kMeet));
}

TEST_P(Separation, NothingIsSaidOfASurfaceThatChanges) {
  const Side a(test::torus(20)), b(test::torus(20));
  const Eigen::Isometry3d here = Eigen::Isometry3d::Identity(), there = here * Eigen::Translation3d(100, 0, 0);
  EXPECT_EQ(hullsAt<double>(a, here, b, there, 0), Hulls::kApart);
  EXPECT_NE(hullsAt<double>(a, here, b, here, 0), Hulls::kApart);
  // What set() calls sees what another thread sees meanwhile.
  for (const bool first : {false, true}) {
    Outline changing;
    Hulls hulls = Hulls::kMeet;
    changing.set(Outline::Box(), [&] {
      const OpenHull of_a{a.tree.supports(), first ? changing : a.tree.outline()},
          of_b{b.tree.supports(), first ? b.tree.outline() : changing};
      hulls = hullsWithoutLock<double>(of_a, here.matrix().data(), of_b, there.matrix().data(), 0);
    });
    EXPECT_EQ(hulls, Hulls::kUnknown) << first;
  }
}

INSTANTIATE_TEST_SUITE_P(Targets, Separation, testing::ValuesIn(test::EveryTarget::targets()), test::EveryTarget::name);

TEST(SupportTable, AreExactOnceATreeIsWhole) {
  for (const std::size_t n : {std::size_t{1}, std::size_t{20}, std::size_t{100}, std::size_t{200}}) {
    const Side a(n == 1 ? test::box({0, 0, 0}, {1, 2, 3}) : test::torus(n, 0.2)), b(test::torus(9));
    const Vector3d first = tree::SupportTable::direction(0);
    if (n > 1) {
      EXPECT_GT(a.tree.supports().value(0), a.support(first) + 1000) << "of a tree at rest, the box is known";
    }
    learnSupports(a, b);
    for (int number = 0; number < tree::SupportTable::kCount; ++number) {
      const double exact = a.support(tree::SupportTable::direction(number)), value = a.tree.supports().value(number);
      ASSERT_GE(value, exact) << number;
      ASSERT_LE(value, exact + 0.2) << number;  // lattice units: the margin of float coordinates
    }
  }
}

Outline::Box boxOf(const tree::Tree& tree) {
  Outline::Box box;
  EXPECT_TRUE(tree.outline().read([&box](const Outline::Reader& reader) {
    for (int c = 0; c < 3; ++c) {
      for (std::size_t k = 0; k < 3; ++k) box.axes[k].direction[c] = reader.axis(k)[c];
      box.center[c] = reader.center()[c];
    }
    for (std::size_t k = 0; k < 3; ++k) box.axes[k].half = reader.half(k);
    box.radius = reader.center()[3];
    return true;
  }));
  return box;
}

TEST(Outline, HoldsTheSurfaceBeforeAndAfterTheWholeBuild) {
  for (const test::Raw& raw : surfaces()) {
    const Side a(raw), b(test::torus(9));
    for (const bool is_whole : {false, true}) {
      if (is_whole) learnSupports(a, b);
      const Outline::Box box = boxOf(a.tree);
      const Vector3d center(box.center[0], box.center[1], box.center[2]);
      for (const auto& t : raw.triangles) {
        for (std::size_t k = 0; k < 3; ++k) {
          const Vector3d v = raw.vertices[t[k]];
          ASSERT_LE(v.norm(), static_cast<double>(box.radius) * (1 + 1e-6));
          for (std::size_t j = 0; j < 3; ++j) {
            const auto& [direction, half] = box.axes[j];
            const Vector3d axis(direction[0], direction[1], direction[2]);
            ASSERT_NEAR(axis.norm(), 1, 1e-6);
            const double least = static_cast<double>(half) + 1e-6 * static_cast<double>(box.radius);
            ASSERT_LE(std::abs(axis.dot(v - center)), least) << is_whole;
          }
        }
      }
    }
  }
  // A rod along a diagonal of its frame is far thinner than its box.
  test::Raw rod = test::box({0, 0, 0}, {1, 0.01, 0.01});
  const Eigen::Matrix3d R = test::turnOnto(Vector3d::UnitX(), Vector3d(1, 1, 1));
  for (Vector3d& v : rod.vertices) v = R * v;
  const Side a(rod), b(rod);
  learnSupports(a, b);
  const Outline::Box box = boxOf(a.tree);
  EXPECT_LT(box.axes[0].half * box.axes[1].half * box.axes[2].half, 1e-4f);
}

/// A box of that size about, and one of its corners.
Outline::Box randomBox(std::mt19937_64& g, double size, Vector3d& corner) {
  std::uniform_real_distribution<double> u(-1, 1);
  const Eigen::Matrix3d axes = test::randomRotation(g);
  const Vector3d center = size * test::randomDirection(g) * (g() % 2 ? 1 : 0);
  Vector3d half;
  for (double& h : half) h = size * std::exp2(4 * u(g) - 4);
  corner = center;
  for (int k = 0; k < 3; ++k) corner += axes.col(k) * half[k] * (g() % 2 ? 1 : -1);
  return Outline::boxOf(center, axes, half);
}

bool areFar(const Outline::Box& box_a, const Eigen::Isometry3d& X_WA, const Outline::Box& box_b,
            const Eigen::Isometry3d& X_WB, double margin, bool in_float) {
  Outline a, b;
  a.set(box_a);
  b.set(box_b);
  if (!in_float) return areFarApart(a, X_WA.matrix().data(), b, X_WB.matrix().data(), margin);
  const Eigen::Matrix4f X_A = X_WA.matrix().cast<float>(), X_B = X_WB.matrix().cast<float>();
  return areFarApart(a, X_A.data(), b, X_B.data(), margin);
}

// A point of one box comes to lie within the margin of a point of the other, however off the rotations may be.
TEST(Outline, BoxesThatMeetAreNotFarApart) {
  std::mt19937_64 g(35);
  std::uniform_real_distribution<double> u(-1, 1);
  int far = 0, expected = 0;
  for (int round = 0; round < 40000; ++round) {
    // Floats end within these; what is farther apart is not known to be.
    const double exponent = 45 * u(g), size = std::pow(10.0, exponent);
    Vector3d p, q;
    const Outline::Box a = randomBox(g, size, p), b = randomBox(g, size * std::exp2(8 * u(g)), q);
    // With 2e-6 an entry, one of R^T R - 1 is below 1e-5.
    const double error = round % 2 ? 2e-6 : 0, margin = round % 3 ? 0 : size * std::abs(u(g));
    const double reaches = static_cast<double>(a.radius) + static_cast<double>(b.radius);
    const Eigen::Isometry3d X_WA = randomPose(g, size, error);
    Eigen::Isometry3d X_WB = randomPose(g, size, error);
    for (const bool apart : {false, true}) {
      const Vector3d touching = X_WA * p - X_WB.linear() * q;
      X_WB.translation() = touching + test::randomDirection(g) * (apart ? 9 * (reaches + margin) : 0.99 * margin);
      // What is far from the world's origin is rounded with it.
      const bool in_float = round % 5 == 0 && std::abs(exponent) < 30,
                 found = areFar(a, X_WA, b, X_WB, margin, in_float);
      if (apart) {
        far += found;
        expected += std::abs(exponent) < 10;
      } else {
        ASSERT_FALSE(found) << round;
      }
    }
  }
  EXPECT_GE(far, expected);
  EXPECT_GT(expected, 6000);
}

/// A box about the origin whose corners and whose middles of faces are each in equally many triangles, so that the
/// principal axes are those of the box.
test::Raw evenBox(const Vector3d& half) {
  test::Raw raw;
  for (int i = 0; i < 8; ++i)
    raw.vertices.push_back(half.cwiseProduct(Vector3d(i & 1, i >> 1 & 1, i >> 2) * 2 - Vector3d::Ones()));
  for (int k = 0; k < 3; ++k) {
    for (const int side : {0, 1}) {
      const auto middle = static_cast<std::uint32_t>(raw.vertices.size());
      raw.vertices.push_back(half[k] * (2 * side - 1) * Vector3d::Unit(k));
      const std::uint32_t x = 1u << (k + 1) % 3, y = 1u << (k + 2) % 3, corner = static_cast<std::uint32_t>(side) << k;
      const std::uint32_t round[5] = {corner, corner | x, corner | x | y, corner | y, corner};
      for (int i = 0; i < 4; ++i) raw.triangles.emplace_back(round[i], round[i + 1], middle);
    }
  }
  return raw;
}

// Two boxes face to face, turned and far from the origins of their frames, are apart where there is a little more
// between them than what rounding the outlines to float takes away, and never where a corner is on the face.
TEST(Outline, SeparatesFacesCloseToEachOther) {
  std::mt19937_64 g(37);
  std::uniform_real_distribution<double> u(-1, 1);
  int close_turned = 0;  // of 190 or so
  for (int round = 0; round < 300; ++round) {
    const double exponent = 45 * u(g), length = round % 3 ? 1 : std::pow(10.0, exponent);
    struct Part {
      Eigen::Matrix3d axes;
      Vector3d center, half;
      double size;
      std::unique_ptr<Side> side;
    } parts[2];
    for (Part& part : parts) {
      part.axes = round % 4 == 0 ? Eigen::Matrix3d(Eigen::Matrix3d::Identity()) : test::randomRotation(g);
      for (double& h : part.half) h = length * std::exp2(3 * u(g));
      part.center = length * std::exp2(6 * u(g)) * test::randomDirection(g);
      part.size = part.center.norm() + part.half.norm();
      test::Raw raw = evenBox(part.half);
      for (Vector3d& v : raw.vertices) v = part.center + part.axes * v;
      part.side = std::make_unique<Side>(raw);
    }
    learnSupports(*parts[0].side, *parts[1].side);
    const Part &a = parts[0], &b = parts[1];
    const double size = a.size + b.size;
    const auto found = [&](double gap, double margin) {
      // Face k of a and face j of b, a corner of b above a corner of a or any other place.
      const auto k = static_cast<Eigen::Index>(g() % 3), j = static_cast<Eigen::Index>(g() % 3);
      const Eigen::Matrix3d R =
          test::turnOnto(b.axes.col(j), -a.axes.col(k)) * Eigen::AngleAxisd(3 * u(g), b.axes.col(j)).toRotationMatrix();
      Vector3d across = a.axes.col((k + 1) % 3) * a.half[(k + 1) % 3] * u(g);
      if (round % 2)
        across = a.axes.col((k + 1) % 3) * a.half[(k + 1) % 3] + a.axes.col((k + 2) % 3) * a.half[(k + 2) % 3];
      Vector3d to = a.center + a.axes.col(k) * (a.half[k] + gap) + across;
      Vector3d from = b.center + b.axes.col(j) * b.half[j];
      if (round % 2)
        from += b.axes.col((j + 1) % 3) * b.half[(j + 1) % 3] - b.axes.col((j + 2) % 3) * b.half[(j + 2) % 3];
      const lattice::Lattice &of_a = a.side->tree.surface().lattice, &of_b = b.side->tree.surface().lattice;
      const double scale = of_b.unit() / of_a.unit();
      SimilarityTransform X = placement(R, scale, of_a.toLattice(to) - scale * (R * of_b.toLattice(from)));
      X.tolerance = margin / of_a.unit();
      return outlinesApart(TreeSide(a.side->tree), TreeSide(b.side->tree), X);
    };
    ASSERT_FALSE(found(-1e-14 * size, 0)) << round;
    ASSERT_FALSE(found(0.1 * size, 0.1001 * size)) << round;
    if (round % 3 == 0 && std::abs(exponent) > 25) continue;
    close_turned += round % 4 != 0 && found(1e-5 * size, 0);
    if (round % 4 == 0) {
      ASSERT_TRUE(found(3e-6 * size, 0)) << round;
    }
  }
  EXPECT_GT(close_turned, 170);
}

// Beside boxes whose distance is known: a direction between them is found where there is one of the fifteen.
TEST(Outline, BoxesThatTheirAxesPartAreFarApart) {
  std::mt19937_64 g(36);
  std::uniform_real_distribution<double> u(-1, 1);
  int apart_by_faces = 0, apart_by_edges = 0;
  for (int round = 0; round < 20000; ++round) {
    Vector3d p, q;
    const Outline::Box a = randomBox(g, 1, p), b = randomBox(g, 1, q);
    const Eigen::Isometry3d X_WA = randomPose(g, 1, 0);
    Eigen::Isometry3d X_WB = randomPose(g, 1, 0);
    Eigen::Matrix3d A, B;
    Vector3d half_a, half_b;
    for (int k = 0; k < 3; ++k) {
      A.col(k) = X_WA.linear() * Eigen::Map<const Eigen::Vector3f>(a.axes[k].direction).cast<double>();
      B.col(k) = X_WB.linear() * Eigen::Map<const Eigen::Vector3f>(b.axes[k].direction).cast<double>();
      half_a[k] = static_cast<double>(a.axes[k].half);
      half_b[k] = static_cast<double>(b.axes[k].half);
    }
    const Vector3d center_a = X_WA * Eigen::Map<const Eigen::Vector3f>(a.center).cast<double>(),
                   center_b = X_WB * Eigen::Map<const Eigen::Vector3f>(b.center).cast<double>(),
                   way = center_b - center_a;
    const auto gap = [&](const Vector3d& direction) {
      const double length = direction.norm();
      if (length < 1e-3) return -1.0;
      return (std::abs(way.dot(direction)) - (A.transpose() * direction).cwiseAbs().dot(half_a) -
              (B.transpose() * direction).cwiseAbs().dot(half_b));
    };
    double by_faces = gap(way) / way.norm(), by_edges = -1;
    for (int i = 0; i < 3; ++i) {
      by_faces = std::max({by_faces, gap(A.col(i)), gap(B.col(i))});
      for (int j = 0; j < 3; ++j) by_edges = std::max(by_edges, gap(A.col(i).cross(B.col(j))));
    }
    const bool found = areFar(a, X_WA, b, X_WB, 0, false);
    if (std::max(by_faces, by_edges) > 0.005) {
      ASSERT_TRUE(found) << round;
    }
    if (std::max(by_faces, by_edges) < 0) {
      ASSERT_FALSE(found) << round;
    }
    apart_by_faces += by_faces > 0.005;
    apart_by_edges += by_faces < 0 && by_edges > 0.005;
  }
  EXPECT_GT(apart_by_faces, 5000);
  EXPECT_GT(apart_by_edges, 20);
}

// Answers by a walk, of which there must be none once supports part the two.
struct NoContact : Visitor {
  bool endsAtFirst() const override { return true; }
  bool triangles(std::uint32_t, std::uint32_t, bool) override { return false; }
  bool cells(const CellLeaf&, const CellLeaf&) override { return false; }
  bool cellOfA(const CellLeaf&, std::uint32_t, const Vector3d&) override { return false; }
  bool cellOfB(std::uint32_t, const CellLeaf&, const Vector3d&) override { return false; }
};

TEST(SupportTable, MissesPayForThem) {
  const Side a(test::torus(100, 0.2)), b(test::torus(100, 0.2));
  // Where the boxes' corners would meet, but not what is in them.
  const Eigen::Matrix3d R = Eigen::AngleAxisd(0.3, Vector3d::UnitZ()).toRotationMatrix();
  const Vector3d d = Vector3d(1, 1, 0.2).normalized();
  const SimilarityTransform to = apartBy(a, b, R, 1, a.extreme(d) - R * b.extreme(-(R.transpose() * d)) + 2500 * d);
  const auto ask = [&] {
    a.tree.buildIfDue();
    b.tree.buildIfDue();
    const TreeSide side_a(a.tree), side_b(b.tree);
    TreeWalk walk(side_a, side_b, to);
    if (walk.isNeedless()) return true;
    NoContact visitor;
    EXPECT_FALSE(walk.run(visitor));
    return false;
  };
  EXPECT_FALSE(ask()) << "the first must walk, and grow";
  int walks = 1;
  while (walks < 1000 && !ask()) ++walks;
  EXPECT_LT(walks, 1000);
  EXPECT_LE(a.tree.statistics().built_triangles, 2 * a.tree.surface().triangle_count);
}

TEST(SupportTable, ANewSurfaceHasNewOnes) {
  const test::Raw raw = test::torus(60);
  Modeld a(raw.mesh());
  const Modeld b(raw.mesh());
  const auto I = fcl::Transform3d(fcl::Transform3d::Identity());
  const auto X = test::pose<double>(Eigen::Matrix3d::Identity(), {1.61, 1.61, 0});
  for (int i = 0; i < 50; ++i) EXPECT_FALSE(test::touching<double>(a, I, b, X));
  // A bulge inside the same bounds, so that only the supports change.
  test::Raw bulged = raw;
  const auto less = [](const Vector3d& v, const Vector3d& w) { return v.x() + v.y() < w.x() + w.y(); };
  *std::max_element(bulged.vertices.begin(), bulged.vertices.end(), less) = Vector3d(1.04, 1.04, 0);
  a.updateVertices(bulged.vertices);
  EXPECT_TRUE(test::touching<double>(a, I, b, X));
  a.updateVertices(raw.vertices);
  EXPECT_FALSE(test::touching<double>(a, I, b, X));
}

TEST(SupportTable, ShallowContactsAreFclsPairByPair) {
  // Hulls that overlap by little: supports all but part them, and the walk does not expect a hit.
  const test::Raw ra = test::torus(50, 0.2), rb = test::torus(33, 0.3);
  const auto fa = test::bvh<fcl::OBBRSSd>(ra), fb = test::bvh<fcl::OBBRSSd>(rb);
  const Modeld a(ra.mesh()), b(rb.mesh());
  const auto I = fcl::Transform3d(fcl::Transform3d::Identity());
  std::mt19937_64 g(34);
  int hits = 0, misses = 0;
  for (int i = 0; i < 400; ++i) {
    const auto X = test::pose<double>(test::randomRotation(g),
                                      test::randomDirection(g) * std::uniform_real_distribution<double>(1.2, 2.4)(g));
    const test::Pairs want = test::pairs<double>(*fa, I, *fb, X);
    (want.empty() ? misses : hits)++;
    ASSERT_EQ(test::touching<double>(a, I, b, X), !want.empty()) << i;
    ASSERT_EQ(test::touching<double>(b, X, a, I), !want.empty()) << i;
    ASSERT_EQ(test::pairs<double>(a, I, b, X), want) << i;
  }
  EXPECT_GT(hits, 80);
  EXPECT_GT(misses, 80);
}

}  // namespace
}  // namespace bocst::query
