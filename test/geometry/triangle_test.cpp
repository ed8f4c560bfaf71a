// SPDX-License-Identifier: BSD-3-Clause
// Two triangles, segments or points against exact arithmetic.
#include "geometry/triangle.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <utility>

#include "exact.h"
#include "meshes.h"

namespace bocst::query {
namespace {

using Eigen::Vector3d;

double largest(const Corners& p, const Corners& q) {
  double size = 0;
  for (int k = 0; k < 3; ++k) {
    size = std::max({size, p[k].cwiseAbs().maxCoeff(), q[k].cwiseAbs().maxCoeff()});
  }
  return size;
}

double exactDistance(const Corners& p, const Corners& q) {
  return static_cast<double>(std::sqrt(exact::squaredDistance(p, q)));
}

// The distance is right to `roundings` of the coordinates, its points lie on the triangles and are as far apart.
void expectRight(const Corners& p, const Corners& q, double roundings) {
  const double far = largest(p, q), least = roundings * 0x1p-53 * far, want = exactDistance(p, q);
  Vector3d on_p = Vector3d::Constant(NAN), on_q = on_p;
  const double distance = nearestPoints(p, q, on_p, on_q);
  ASSERT_NEAR(distance, want, least) << p[0].transpose() << ", " << p[1].transpose() << ", " << p[2].transpose() << "; "
                                     << q[0].transpose() << ", " << q[1].transpose() << ", " << q[2].transpose();
  ASSERT_FALSE(areApart(p, q, want)) << "at " << want;
  ASSERT_FALSE(areApart(q, p, want * (1 - 1e-15))) << "at " << want;
  const Corners at_p = {on_p, on_p, on_p}, at_q = {on_q, on_q, on_q};
  ASSERT_LE(exactDistance(at_p, p), least);
  ASSERT_LE(exactDistance(at_q, q), least);
  ASSERT_NEAR(exactDistance(at_p, at_q), want, least);
  for (const double d : {0.4 * want, want, want + least, 3 * least}) {
    Vector3d edge_p, edge_q;
    if (!edgesTouch(p, q, d, edge_p, edge_q)) continue;
    const double rounding = 8 * 0x1p-53 * far;
    ASSERT_LE(exactDistance({edge_p, edge_p, edge_p}, p), rounding);
    ASSERT_LE(exactDistance({edge_q, edge_q, edge_q}, q), rounding);
    ASSERT_LE(exactDistance({edge_p, edge_p, edge_p}, {edge_q, edge_q, edge_q}), d * (1 + 1e-15));
  }
  for (int k = 0; k < 3; ++k) {
    const Corners x = {p[k], p[k], p[k]};
    const Vector3d near = closestPoint(p[k], q);
    const Corners at = {near, near, near};
    ASSERT_LE(exactDistance(at, q), least);
    ASSERT_NEAR(exactDistance(at, x), exactDistance(x, q), least);
  }
}

// Collinear corners, or all but, in any order.
void flatten(std::mt19937_64& g, Corners& t, double by) {
  std::uniform_real_distribution<double> u(-1, 2);
  t[2] = t[0] + u(g) * (t[1] - t[0]) + by * (t[2] - t[0]);
  if (g() % 8 == 0) t[1] = t[0];
  if (g() % 16 == 0) t[2] = t[1] = t[0];
  std::shuffle(std::begin(t), std::end(t), g);
}

TEST(Exact, KnowsWhatIsPlain) {
  const Corners t = {{{0, 0, 0}, {2, 0, 0}, {0, 2, 0}}};
  const auto segment = [](const Vector3d& a, const Vector3d& b, exact::Corners& s) {
    s[0] = a;
    s[1] = b;
    s[2] = a;
  };
  Corners s;
  segment({0.5, 0.5, -1}, {0.5, 0.5, 1}, s);
  EXPECT_TRUE(exact::intersect(t, s)) << "through the inside";
  segment({1, 1, -1}, {1, 1, 1}, s);
  EXPECT_TRUE(exact::intersect(t, s)) << "through an edge";
  segment({1, 1 + 0x1p-52, -1}, {1, 1 + 0x1p-52, 1}, s);
  EXPECT_EQ(exact::squaredDistance(t, s), 0x1p-105L) << "past it";
  segment({0.5, 0.5, 1e-300}, {0.5, 0.5, 1e300}, s);
  EXPECT_NEAR(static_cast<double>(std::sqrt(exact::squaredDistance(t, s)) / 1e-300L), 1, 1e-15);
  segment({-1, 0.5, 0}, {3, 0.5, 0}, s);
  EXPECT_TRUE(exact::intersect(t, s)) << "in the plane";
  segment({-1, 3, 0}, {3, 3, 0}, s);
  EXPECT_EQ(exact::squaredDistance(t, s), 1);
  segment({0.5, 0.5, 0}, {0.5, 0.5, 0}, s);
  EXPECT_TRUE(exact::intersect(t, s)) << "a point inside";
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  X.translation() = Vector3d(0.1, 0.2, 0.3);
  EXPECT_EQ(exact::squaredDistance(t, X, t), 0.3L * 0.3L * 0 + static_cast<long double>(0.3) * 0.3);
}

// On grids touching is common. The same numbers go through 128 bits and, moved, through integers of any length.
TEST(Exact, IsTheSameInBothArithmetics) {
  std::mt19937_64 g(1);
  const auto u = [&g] { return static_cast<double>(g() % 5) - 2; };
  int hits = 0;
  for (int i = 0; i < 20000; ++i) {
    Corners p, q;
    for (Corners* t : {&p, &q}) {
      for (Vector3d& v : *t) v = Vector3d(u(), u(), u());
    }
    const Eigen::Isometry3d I = Eigen::Isometry3d::Identity();
    const long double d = exact::squaredDistance(p, q);
    ASSERT_EQ(exact::squaredDistance(p, I, q), d);
    ASSERT_LE(std::abs(exact::squaredDistance(q, p) - d), 1e-18L * d);
    hits += d == 0;
  }
  EXPECT_GT(hits, 5000);
  EXPECT_LT(hits, 15000);
}

TEST(NearestPoints, OfGridTrianglesSegmentsAndPoints) {
  std::mt19937_64 g(2);
  int hits = 0;
  for (int i = 0; i < 60000; ++i) {
    const auto most = static_cast<double>(1 + g() % 6), unit = std::pow(0.1, g() % 2);
    const auto u = [&] { return (static_cast<double>(g() % 1000) / 1000 * (2 * most + 1) - most); };
    Corners p, q;
    for (Corners* t : {&p, &q}) {
      for (Vector3d& v : *t) v = Vector3d(std::floor(u()), std::floor(u()), std::floor(u())) * unit;
      if (g() % 2) (*t)[2] = (*t)[0] + static_cast<double>(g() % 3) * ((*t)[1] - (*t)[0]);
      if (g() % 4 == 0) (*t)[1] = (*t)[0];
      std::shuffle(std::begin(*t), std::end(*t), g);
    }
    hits += exact::intersect(p, q);
    Vector3d on_p, on_q;
    ASSERT_NEAR(nearestPoints(p, q, on_p, on_q), exactDistance(p, q), 64 * 0x1p-53 * largest(p, q)) << "round " << i;
    if (i % 16 == 0) {
      ASSERT_NO_FATAL_FAILURE(expectRight(p, q, 64)) << "round " << i;
    }
  }
  EXPECT_GT(hits, 6000);
}

TEST(NearestPoints, OfSliversThatTouchOrAllButTouch) {
  std::mt19937_64 g(3);
  std::uniform_real_distribution<double> u(-1, 1);
  for (int i = 0; i < 10000; ++i) {
    Corners p, q;
    for (Corners* t : {&p, &q}) {
      for (Vector3d& v : *t) v = Vector3d(u(g), u(g), u(g));
      flatten(g, *t, std::pow(10.0, -20 * std::abs(u(g))));
    }
    // A point of each in one place, but for a gap.
    const auto pointOf = [&](const Corners& t) {
      const double a = std::abs(u(g)), b = (1 - a) * std::abs(u(g));
      return Vector3d(t[0] + a * (t[1] - t[0]) + b * (t[2] - t[0]));
    };
    const Vector3d displacement =
        pointOf(p) - pointOf(q) + test::randomDirection(g) * std::pow(10.0, -20 * std::abs(u(g)));
    for (Vector3d& v : q) v += displacement;
    ASSERT_NO_FATAL_FAILURE(expectRight(p, q, 1000)) << "round " << i;
  }
}

// Two triangles lie side by side, the edges between them almost parallel and almost in contact.
TEST(NearestPoints, OfEdgesThatAreAllButParallel) {
  std::mt19937_64 g(5);
  std::uniform_real_distribution<double> u(-1, 1);
  for (int i = 0; i < 20000; ++i) {
    Corners p, q;
    for (Vector3d& v : p) v = Vector3d(u(g), u(g), u(g));
    const Eigen::AngleAxisd turn(std::pow(10.0, -15 * std::abs(u(g))), test::randomDirection(g));
    const Vector3d edge = p[1] - p[0], pivot = p[0] + std::abs(u(g)) * edge;
    const Vector3d gap = test::randomDirection(g) * std::pow(10.0, -15 * std::abs(u(g)));
    // The third corner lies on the other side of the edge.
    q = {p[0], p[1], 2 * pivot - p[2]};
    for (Vector3d& v : q) v = pivot + turn * (v - pivot) + 0.5 * u(g) * edge * static_cast<double>(g() % 2) + gap;
    std::shuffle(std::begin(q), std::end(q), g);
    ASSERT_NO_FATAL_FAILURE(expectRight(p, q, 1000)) << "round " << i;
  }
}

TEST(NearestPoints, OfAnySizeAnywhere) {
  std::mt19937_64 g(4);
  std::uniform_real_distribution<double> u(-1, 1);
  for (int i = 0; i < 4000; ++i) {
    Corners p, q;
    // From 1e-150 to 1e150, of one size, or one of them of another.
    const double size = std::pow(10.0, 150 * u(g)), other = g() % 2 ? size : std::pow(10.0, 150 * u(g));
    const Vector3d far = Vector3d(u(g), u(g), u(g)) * size * std::pow(10.0, g() % 8);
    for (Vector3d& v : p) v = size * Vector3d(u(g), u(g), u(g));
    for (Vector3d& v : q) v = other * Vector3d(u(g), u(g), u(g)) + far;
    if (g() % 4 == 0) flatten(g, p, 0);
    if (g() % 4 == 0) flatten(g, q, 0);
    ASSERT_NO_FATAL_FAILURE(expectRight(p, q, 1000)) << "round " << i << " " << size << " " << other;
  }
}

TEST(AreApart, FindsWhatIsApartByFacesOrEdges) {
  std::mt19937_64 g(12);
  std::normal_distribution<double> n;
  int found = 0, apart = 0;
  for (int i = 0; i < 5000; ++i) {
    Corners p, q;
    for (Vector3d& v : p) v = {n(g), n(g), n(g)};
    for (Vector3d& v : q) v = {n(g) + 2, n(g), n(g)};
    if (i % 2 != 0) p[2] = (p[0] + p[1]) / 2;  // a segment
    const double distance = exactDistance(p, q);
    ASSERT_FALSE(areApart(p, q, distance));
    if (distance < 1e-3) continue;
    ++apart;
    // Where a corner is nearest to a corner or an edge, no such axis has all of the distance, but nearly all have some.
    found += areApart(p, q, 0);
  }
  EXPECT_GT(apart, 1000);
  EXPECT_EQ(found, apart);
  const Corners huge = {{{1e200, 0, 0}, {1e200, 1e200, 0}, {1e200, 0, 1e200}}},
                far = {{{-1e200, 0, 0}, {-1e200, 1e200, 0}, {-1e200, 0, 1e200}}};
  EXPECT_FALSE(areApart(huge, far, 3e200));
}

TEST(EdgesTouch, FindsWhatSharesAPointOfEdges) {
  std::mt19937_64 g(7);
  std::uniform_real_distribution<double> u(-1, 1);
  const auto point = [&] { return Vector3d(u(g), u(g), u(g)); };
  int found = 0;
  for (int round = 0; round < 3000; ++round) {
    const double size = std::exp2(60 * u(g));
    const Vector3d shared = size * point();
    Corners p = {size * point(), size * point(), size * point()}, q = {size * point(), size * point(), size * point()};
    if (round % 3 == 0) p[2] = p[0];
    if (round % 2 == 0) {
      p[0] = q[1] = shared;  // a corner
    } else {
      p[1] = shared + (shared - p[0]);  // the middles of two edges
      q[2] = shared + (shared - q[1]);
    }
    Vector3d on_p, on_q;
    found += edgesTouch(p, q, 16 * 0x1p-53 * largest(p, q), on_p, on_q);
    ASSERT_FALSE(edgesTouch(p, q, 0, on_p, on_q)) << round;
  }
  EXPECT_GT(found, 2700) << "all but those of nearly parallel edges";
  // So small that squares vanish.
  const Corners p = {Vector3d(0, 0, 0), Vector3d(1e-200, 0, 0), Vector3d(0, 1e-200, 0)};
  const Corners q = {Vector3d(0, 0, 1e-180), Vector3d(1e-200, 0, 1e-180), Vector3d(0, 1e-200, 1e-180)};
  Vector3d on_p, on_q;
  EXPECT_FALSE(edgesTouch(p, q, 1e-190, on_p, on_q));
}

// The points in which edges of one cut the other end the segment that both share.
TEST(NearEndOfCut, IsTheFirstPointOfBoth) {
  std::mt19937_64 g(11);
  std::uniform_real_distribution<double> u(-1, 1);
  std::uniform_int_distribution<int> step(-3, 3);
  int found = 0, doubtful = 0;
  for (int round = 0; round < 20000; ++round) {
    // On a grid corners and edges meet; thin ones and those in nearly one plane are cut where rounding decides.
    const bool on_grid = round % 4 == 0;
    const double thin = round % 4 == 1 ? std::exp2(20 * u(g) - 20) : 1, far = round % 8 == 2 ? 1e6 : 0;
    Corners p, q;
    for (Corners* t : {&p, &q}) {
      for (Vector3d& x : *t) {
        x = on_grid ? Vector3d(step(g), step(g), step(g)) : Vector3d(u(g), u(g), thin * u(g));
        x += Vector3d::Constant(far);
      }
    }
    const Vector3d direction = round % 3 == 0 ? Vector3d(0, 0, 2) : Vector3d(u(g), u(g), u(g));
    const double tolerance = 1e-6;
    const auto end = nearEndOfCut(p, q, direction, tolerance), same = nearEndOfCut(q, p, direction, tolerance);
    ASSERT_EQ(end.has_value(), same.has_value());
    double expected = std::numeric_limits<double>::infinity();
    for (const auto& [t, other] : {std::make_pair(&p, &q), std::make_pair(&q, &p)}) {
      for (int k = 0; k < 3; ++k) {
        const Vector3d begin = (*t)[k], way = (*t)[(k + 1) % 3] - begin;
        Eigen::Matrix<long double, 3, 3> m;
        m << ((*other)[1] - (*other)[0]).cast<long double>(), ((*other)[2] - (*other)[0]).cast<long double>(),
            -way.cast<long double>();
        const Eigen::FullPivLU<Eigen::Matrix<long double, 3, 3>> lu(m);
        if (!lu.isInvertible()) continue;
        const Eigen::Matrix<long double, 3, 1> x = lu.solve((begin - (*other)[0]).cast<long double>());
        if (!(x.minCoeff() >= -1e-9L && x[0] + x[1] <= 1 + 1e-9L && x[2] <= 1 + 1e-9L)) continue;
        expected = std::min(expected, direction.dot(begin) + static_cast<double>(x[2]) * direction.dot(way));
      }
    }
    if (!end.has_value()) {
      doubtful += std::isfinite(expected) && !on_grid && thin == 1 && far == 0;
      continue;
    }
    ++found;
    ASSERT_NEAR(*end, expected, direction.norm() * 2 * tolerance) << round;
    ASSERT_NEAR(*same, *end, direction.norm() * 2 * tolerance);
    ASSERT_LT(exactDistance(p, q), tolerance);
  }
  EXPECT_GT(found, 3000);
  EXPECT_LT(doubtful, found / 100);
}

TEST(IsDegenerate, WhateverTheOrderAndTheUnit) {
  std::mt19937_64 g(5);
  std::uniform_real_distribution<double> u(-1, 1);
  for (int i = 0; i < 20000; ++i) {
    // One that is a part `width` of its length high, over any point of its longest edge.
    const double width = std::pow(10.0, -10 - 8 * std::abs(u(g))), along = std::abs(u(g));
    if (std::abs(width - 1e-14) < 3e-15) continue;
    const double unit = std::ldexp(1.0, static_cast<int>(400 * u(g)));
    Corners t = {{{0, 0, 0}, {1, 0, 0}, {along, width, 0}}};
    std::shuffle(std::begin(t), std::end(t), g);
    for (Vector3d& v : t) v *= unit;
    ASSERT_EQ(isDegenerate(t), width < 1e-14) << width << " " << along << " " << unit;
  }
  const Corners point = {{{1e-200, 0, 0}, {1e-200, 0, 0}, {1e-200, 0, 0}}}, none = {{{0, 0, 0}, {0, 0, 0}, {0, 0, 0}}};
  const Corners small_far_away = {{{1, 1e-80, 0}, {1, 3e-80, 0}, {1, 1e-80, 2e-80}}};
  EXPECT_NEAR(relativeWidth(small_far_away), 0.5, 1e-15);
  EXPECT_TRUE(isDegenerate(point));
  EXPECT_TRUE(isDegenerate(none));
}

// Faces that rest on one another: boxes on floors, parts set down exactly.
TEST(Triangle, CoplanarTrianglesTouchInBoth) {
  std::mt19937_64 g(71);
  std::uniform_int_distribution<int> whole(-4, 4);
  std::normal_distribution<double> normal;
  int touching = 0;
  for (int round = 0; round < 20000; ++round) {
    Corners p, q;
    for (Corners* t : {&p, &q}) {
      for (Vector3d& v : *t) v = Vector3d(whole(g), whole(g), 0);
    }
    if (round % 3 == 1) q[whole(g) & 1] = p[0];                        // a common corner
    if (round % 3 == 2) q[whole(g) & 1] = p[0] + 0.5 * (p[1] - p[0]);  // a corner on an edge
    if (isDegenerate(p) || isDegenerate(q) || exactDistance(p, q) > 0) continue;
    ++touching;
    if (round % 2 == 1) {
      const Eigen::Quaterniond turn = Eigen::Quaterniond(normal(g), normal(g), normal(g), normal(g)).normalized();
      const Vector3d shift = 1e3 * Vector3d(normal(g), normal(g), normal(g));
      for (Corners* t : {&p, &q}) {
        for (Vector3d& v : *t) v = turn * v + shift;
      }
    }
    const ContactPoint contact = trianglePenetration(p, q);
    ASSERT_LT((closestPoint(contact.point, p) - contact.point).norm(), 1e-10) << round;
    ASSERT_LT((closestPoint(contact.point, q) - contact.point).norm(), 1e-10) << round;
  }
  EXPECT_GT(touching, 10000);
}

TEST(Triangle, CoplanarTrianglesTouchInTheMiddleOfWhatTheyShare) {
  // Half of a floor; a triangle of which half a square lies beyond it.
  const Corners floor = {Vector3d(0, 0, 0), Vector3d(10, 0, 0), Vector3d(0, 10, 0)};
  const Corners within = {Vector3d(1, 1, 0), Vector3d(4, 1, 0), Vector3d(1, 4, 0)};
  const Corners across = {Vector3d(-2, 1, 0), Vector3d(2, 1, 0), Vector3d(2, 5, 0)};
  for (const double height : {0.0, 1e-17, -1e-12}) {
    const auto at = [height](Corners t) {
      for (Vector3d& v : t) v.z() += height;
      return t;
    };
    for (const auto& [t, middle] : {std::pair(within, Vector3d(2, 2, 0)), std::pair(across, Vector3d(1, 2.5, 0))}) {
      EXPECT_LT((trianglePenetration(floor, at(t)).point - middle).norm(), 1e-9);
      EXPECT_LT((trianglePenetration(at(t), floor).point - middle).norm(), 1e-9);
    }
  }
  EXPECT_LT((trianglePenetration(floor, floor).point - Vector3d(10, 10, 0) / 3).norm(), 1e-9) << "of all it shares";
}

TEST(Triangle, TrianglesThatTouchByAnEdgeOrACornerDoSoThere) {
  const Corners floor = {Vector3d(0, 0, 0), Vector3d(10, 0, 0), Vector3d(0, 10, 0)};
  for (const double height : {0.0, 1e-13}) {
    for (const double rise : {1e-6, 1e-3, 1.0}) {
      for (const double of_second : {0.0, 0.5}) {
        const Corners t = {Vector3d(1, 1, height), Vector3d(4, 1, height + of_second * rise),
                           Vector3d(1, 4, height + rise)};
        for (const ContactPoint& contact : {trianglePenetration(floor, t), trianglePenetration(t, floor)}) {
          EXPECT_LT((closestPoint(contact.point, floor) - contact.point).norm(), 1e-9) << rise << ' ' << of_second;
          EXPECT_LT((closestPoint(contact.point, t) - contact.point).norm(), 1e-9) << rise << ' ' << of_second;
        }
      }
    }
  }
}

}  // namespace
}  // namespace bocst::query
