// SPDX-License-Identifier: BSD-3-Clause
// Bodies against triangles, points and boxes: what a gap claims is proved by a separating plane or by a common point
// that know nothing of how it was found.
#include "geometry/convex_shape.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "exact.h"
#include "meshes.h"
#include "sanitized.h"

namespace bocst::query {
namespace {

using Eigen::Vector3d;

/// A body and what is known of it in closed form.
struct Known {
  const char* name;
  std::shared_ptr<const ConvexShape> body;
  std::function<double(const Vector3d&)> level;   // convex, and at most 0 exactly in the body
  std::function<double(const Vector3d&)> height;  // the farthest along a unit direction
  bool shortest;                                  // penetration() is the shortest way
};

ContactPoint penetration(const ConvexShape& body, const PointSet& points) {
  return body.penetration(points, body.gap(points, std::numeric_limits<double>::infinity()));
}

std::vector<Known> bodies() {
  const Vector3d h(0.7, 0.4, 1.1), r(0.5, 1.2, 0.8);
  const double radius = 0.6, half = 0.9, top = 0.2;
  const Vector3d n = Vector3d(1, 2, -2) / 3;
  const Sphere region{Vector3d(0.3, -0.2, 0.1), 50};
  const auto round = [half](double bottom, double above) {
    return Known{"round", std::make_shared<RoundShape>(bottom, above, 2 * half),
                 [=](const Vector3d& x) {
                   const double at = bottom + (above - bottom) * (x.z() + half) / (2 * half);
                   return std::max(std::hypot(x.x(), x.y()) - at, std::abs(x.z()) - half);
                 },
                 [=](const Vector3d& d) {
                   const double out = std::hypot(d.x(), d.y());
                   return std::max(out * bottom - d.z() * half, out * above + d.z() * half);
                 },
                 false};
  };
  return {
      {"box", std::make_shared<BoxShape>(h), [=](const Vector3d& x) { return (x.cwiseAbs() - h).maxCoeff(); },
       [=](const Vector3d& d) { return d.cwiseAbs().dot(h); }, true},
      {"ball", std::make_shared<CapsuleShape>(radius, 0), [=](const Vector3d& x) { return x.norm() - radius; },
       [=](const Vector3d&) { return radius; }, true},
      {"capsule", std::make_shared<CapsuleShape>(radius, 2 * half),
       [=](const Vector3d& x) { return (x - Vector3d(0, 0, std::min(std::max(x.z(), -half), half))).norm() - radius; },
       [=](const Vector3d& d) { return radius + half * std::abs(d.z()); }, false},
      {"ellipsoid", std::make_shared<EllipsoidShape>(r),
       [=](const Vector3d& x) { return x.cwiseQuotient(r).norm() - 1; },
       [=](const Vector3d& d) { return d.cwiseProduct(r).norm(); }, false},
      round(0.6, 0.6),
      round(0.8, 0),
      round(0.5, top),
      {"half-space", std::make_shared<HalfspaceShape>(n, 0.25, region),
       [=](const Vector3d& x) { return n.dot(x) - 0.25; },
       [=](const Vector3d& d) { return (d - n).norm() < 1e-9 ? 0.25 : std::numeric_limits<double>::infinity(); }, true},
      {"plane", std::make_shared<PlaneShape>(n, 0.25, region),
       [=](const Vector3d& x) { return std::abs(n.dot(x) - 0.25); },
       [=](const Vector3d& d) {
         if ((d - n).norm() < 1e-9) return 0.25;
         return (d + n).norm() < 1e-9 ? -0.25 : std::numeric_limits<double>::infinity();
       },
       true},
  };
}

/// The least of a convex function over a triangle, by golden sections within golden sections.
double least(const std::function<double(const Vector3d&)>& f, const Vector3d* t) {
  const auto section = [](const auto& g) {
    const double golden = (std::sqrt(5.0) - 1) / 2;
    double lo = 0, hi = 1;
    for (int i = 0; i < 70; ++i) {
      const double a = hi - golden * (hi - lo), b = lo + golden * (hi - lo);
      (g(a) < g(b) ? hi : lo) = g(a) < g(b) ? b : a;
    }
    return std::min({g(0), g((lo + hi) / 2), g(1)});
  };
  return section([&](double u) {
    const Vector3d a = t[0] + u * (t[1] - t[0]), b = t[0] + u * (t[2] - t[0]);
    return section([&](double v) { return f(a + v * (b - a)); });
  });
}

double lowest(const Vector3d& n, const PointSet& p) {
  double h = n.dot(p.x[0]);
  for (int i = 1; i < p.count; ++i) h = std::min(h, n.dot(p.x[i]));
  return h;
}

constexpr double kFar = std::numeric_limits<double>::infinity();

/// A body that is a point.
class PointShape final : public SupportShape {
 public:
  explicit PointShape(const Vector3d& at) : SupportShape(at, Vector3d::Zero(), 0), at_(at) {}

 protected:
  Vector3d support(const Vector3d&) const override { return at_; }

 private:
  const Vector3d at_;
};

void checkGap(const Known& k, const PointSet& p, double tolerance) {
  const SeparationResult gap = k.body->gap(p, kFar);
  ASSERT_LE(gap.at_least, gap.distance);
  if (gap.isTouching()) {
    ASSERT_EQ(gap.distance, 0);
    // At a point of both.
    ASSERT_EQ(gap.on_body, gap.on_points);
    ASSERT_LE(k.level(gap.on_body), tolerance);
    ASSERT_LE(PointShape(gap.on_points).gap(p, kFar).distance, tolerance);
    return;
  }
  ASSERT_LE(gap.distance - gap.at_least, tolerance);
  // The points are where they should be, and a plane between them has the two on its sides.
  const Vector3d n = (gap.on_points - gap.on_body).normalized();
  ASSERT_NEAR((gap.on_points - gap.on_body).norm(), gap.distance, tolerance);
  ASSERT_LE(k.level(gap.on_body), tolerance);
  if (gap.distance > 1e-4) {
    const double height = k.height(n);
    if (std::isfinite(height)) {
      ASSERT_GE(lowest(n, p) - height, gap.distance - 1e-5);
    }
  }
  // Asked whether they are within a part of the distance, it says no, with reason.
  const SeparationResult quick = k.body->gap(p, gap.distance / 2);
  ASSERT_GT(quick.at_least, gap.distance / 2);
  ASSERT_LE(quick.at_least, gap.distance + tolerance);
}

// Against exact arithmetic, far from the origin and near to each other, where rounding is all there is.
TEST(ConvexShape, TrianglesAreNoNearerThanTheySay) {
  std::mt19937_64 g(21);
  std::uniform_real_distribution<double> u(-1, 1);
  int apart = 0;
  for (int i = 0; i < 5000; ++i) {
    const Vector3d at = std::pow(10.0, 3 * std::abs(u(g))) * Vector3d(u(g), u(g), u(g)),
                   gap = std::pow(10.0, -8 * std::abs(u(g))) * Vector3d(u(g), u(g), u(g));
    exact::Corners p, q;
    for (int k = 0; k < 3; ++k) {
      p[k] = at + Vector3d(u(g), u(g), u(g));
      q[k] = at + gap + Vector3d(u(g), u(g), u(g));
    }
    if (i % 2 == 0) q[0] = p[0] + gap;
    const SeparationResult found = TriangleShape(p).gap({q.data(), 3}, kFar);
    ASSERT_LE(found.at_least, found.distance);
    const long double distance = std::sqrt(exact::squaredDistance(p, q));
    ASSERT_LE(static_cast<long double>(found.at_least), distance * (1 + 1e-17L)) << i;
    apart += distance > 0;
  }
  EXPECT_GT(apart, 2000);
}

// A plane between two bodies proves how far they are apart at least; a ball beside anything is as far as its centre is,
// less its radius.
TEST(ConvexShape, TwoBodiesAreNoNearerThanTheirDifferenceSays) {
  std::mt19937_64 g(31);
  std::uniform_real_distribution<double> u(-1, 1);
  const Vector3d origin = Vector3d::Zero();
  int pairs = 0, apart = 0;
  for (const Known& k : bodies()) {
    for (const Known& l : bodies()) {
      const auto *a = dynamic_cast<const SupportShape*>(k.body.get()),
                 *b = dynamic_cast<const SupportShape*>(l.body.get());
      if (a == nullptr || b == nullptr) continue;
      SCOPED_TRACE(std::string(k.name) + ", " + l.name);
      ++pairs;
      const bool is_ball = std::string(l.name) == "ball";
      for (int i = 0; i < test::repetitions(60); ++i) {
        Eigen::Isometry3d X_AB = Eigen::Isometry3d::Identity();
        if (i % 4 != 0) X_AB.linear() = test::randomRotation(g);
        X_AB.translation() = i % 4 == 1 ? Vector3d(0, 0, 6 * u(g)) : Vector3d(4 * u(g), 4 * u(g), 4 * u(g));
        const SeparationResult gap = DifferenceShape(*a, *b, X_AB).gap({&origin, 1}, kFar);
        if (is_ball) {
          const Vector3d center = X_AB.translation();
          const double expected = a->gap({&center, 1}, kFar).distance - 0.6;
          ASSERT_NEAR(std::max(gap.at_least, 0.0), std::max(expected, 0.0), 1e-5);
        }
        if (gap.isTouching()) continue;
        ++apart;
        ASSERT_LE(gap.distance - gap.at_least, 1e-5 * (1 + gap.distance));
        const Vector3d n = gap.normal;
        const double between = n.dot(X_AB.translation()) - l.height(-(X_AB.linear().transpose() * n)) - k.height(n);
        ASSERT_GE(between, gap.at_least - 1e-12);
      }
    }
  }
  EXPECT_GE(pairs, 25);
  EXPECT_GT(apart, 10 * pairs);
}

TEST(ConvexShape, GapsOfTrianglesAreProvedBothWays) {
  const int count = test::repetitions(1500);
  std::mt19937_64 g(1);
  std::uniform_real_distribution<double> u(-1, 1);
  for (const Known& k : bodies()) {
    SCOPED_TRACE(k.name);
    int touching = 0;
    for (int i = 0; i < count; ++i) {
      const double size = std::pow(10.0, 1.5 * u(g) - 0.5);
      const Vector3d at = 3 * Vector3d(u(g), u(g), u(g));
      const Vector3d t[3] = {at + size * Vector3d(u(g), u(g), u(g)), at + size * Vector3d(u(g), u(g), u(g)),
                             at + size * Vector3d(u(g), u(g), u(g))};
      const PointSet p{t, 3};
      checkGap(k, p, 1e-8);
      if (HasFatalFailure()) return;
      const bool touches = k.body->gap(p, kFar).isTouching();
      const double level = least(k.level, t);
      if (level < -1e-9 || level > 1e-6) {
        ASSERT_EQ(touches, level < 0) << i << ' ' << level;
      }
      touching += touches;
    }
    EXPECT_GT(touching, count / 60);
    EXPECT_LT(touching, count - count / 60);
  }
}

TEST(ConvexShape, GapsAlongADirectionAreNoMoreThanTheGap) {
  std::mt19937_64 g(5);
  std::uniform_real_distribution<double> u(-1, 1);
  for (const Known& k : bodies()) {
    SCOPED_TRACE(k.name);
    int apart = 0;
    for (int i = 0; i < 500; ++i) {
      Vector3d t[3];
      for (Vector3d& x : t) x = 2.5 * Vector3d(u(g), u(g), u(g));
      const PointSet p{t, 3};
      const SeparationResult gap = k.body->gap(p, kFar);
      const Vector3d direction = Vector3d(u(g), u(g), u(g)).normalized();
      const double height = k.height(direction), along = k.body->gapAlong(direction, p);
      ASSERT_LE(along, gap.distance) << i;
      if (gap.isTouching()) continue;
      ++apart;
      if (std::isfinite(height)) {
        ASSERT_NEAR(along, lowest(direction, p) - height, 1e-9) << i;
      } else {
        ASSERT_EQ(along, -kFar) << i;
      }
      ASSERT_NEAR(k.body->gapAlong(gap.normal, p), gap.at_least, 1e-9) << i;
    }
    EXPECT_GT(apart, 20);
  }
}

// The simplex of such a triangle is all but flat.
TEST(ConvexShape, TrianglesInTheFacesOfABoxTouchAtAPointOfBoth) {
  std::mt19937_64 g(6);
  std::uniform_real_distribution<double> u(-1, 1);
  const Known box = bodies().front();
  const Vector3d half = box.body->box().half;
  int touching = 0;
  for (int i = 0; i < 20000; ++i) {
    const auto k = static_cast<Eigen::Index>(g() % 3);
    Vector3d t[3];
    for (Vector3d& x : t) {
      x = 3 * Vector3d(u(g), u(g), u(g));
      x[k] = (i % 2 ? 1 : -1) * half[k] + std::pow(10.0, -11 - 6 * std::abs(u(g))) * u(g);
    }
    if (!box.body->gap({t, 3}, kFar).isTouching()) continue;
    ++touching;
    checkGap(box, {t, 3}, 1e-11);
    if (HasFatalFailure()) return;
  }
  EXPECT_GT(touching, 1000);
}

TEST(ConvexShape, NearContactNothingThatTouchesIsApart) {
  std::mt19937_64 g(2);
  std::uniform_real_distribution<double> u(-1, 1);
  for (const Known& k : bodies()) {
    SCOPED_TRACE(k.name);
    for (int i = 0; i < 400; ++i) {
      Vector3d t[3];
      for (Vector3d& x : t) x = 2.5 * Vector3d(u(g), u(g), u(g));
      const SeparationResult gap = k.body->gap({t, 3}, kFar);
      if (gap.isTouching()) continue;
      const Vector3d displacement = gap.on_body - gap.on_points;
      for (const double beyond : {1e-12, 1e-9, 1e-6, 1e-3}) {
        Vector3d in[3], out[3];
        for (int c = 0; c < 3; ++c) {
          in[c] = t[c] + displacement * (1 + beyond / displacement.norm());
          out[c] = t[c] + displacement * (1 - beyond / displacement.norm());
        }
        // What passes the tip of a cone need not meet it.
        if (k.shortest) {
          const SeparationResult found = k.body->gap({in, 3}, kFar);
          ASSERT_TRUE(found.isTouching()) << i << ' ' << beyond;
          ASSERT_LE(k.level(found.on_points), 1e-9) << i << ' ' << beyond;
        }
        const SeparationResult left = k.body->gap({out, 3}, kFar);
        ASSERT_NEAR(left.distance, beyond, 1e-8) << i;
        ASSERT_TRUE(!left.isTouching() || beyond < 1e-8) << i << ' ' << beyond;
      }
    }
  }
}

TEST(ConvexShape, PointsSegmentsAndBoxes) {
  std::mt19937_64 g(3);
  std::uniform_real_distribution<double> u(-1, 1);
  for (const Known& k : bodies()) {
    SCOPED_TRACE(k.name);
    for (int i = 0; i < 500; ++i) {
      const Vector3d x = 2 * Vector3d(u(g), u(g), u(g));
      checkGap(k, {&x, 1}, 1e-8);
      if (HasFatalFailure()) return;
      if (std::abs(k.level(x)) > 1e-9) {
        ASSERT_EQ(k.body->gap({&x, 1}, kFar).isTouching(), k.level(x) < 0);
      }
      const Vector3d same[3] = {x, x, x},
                     line[3] = {x, -x + Vector3d(3, 0, 0), Vector3d(1.5, 0, 0)};  // a segment and its middle
      ASSERT_NEAR(k.body->gap({same, 3}, kFar).distance, k.body->gap({&x, 1}, kFar).distance, 1e-12);
      ASSERT_NEAR(k.body->gap({line, 3}, kFar).distance, k.body->gap({line, 2}, kFar).distance, 1e-8);
      Vector3d corners[8];
      for (int c = 0; c < 8; ++c) {
        corners[c] = x + Vector3d(c & 1 ? 0.5 : -0.5, c & 2 ? 0.25 : -0.25, c & 4 ? 0.125 : -0.125);
      }
      checkGap(k, {corners, 8}, 1e-8);
      if (HasFatalFailure()) return;
    }
  }
}

// PointSet of which one or more lie exactly on the surface, or in a line with the axis.
TEST(ConvexShape, TouchingExactlyIsTouching) {
  const BoxShape box(Vector3d(1, 2, 0.5));
  const Vector3d on_face[3] = {{1, 0, 0}, {2, 1, 1}, {2, -1, 1}}, on_corner[3] = {{1, 2, 0.5}, {2, 3, 1}, {3, 2, 1}};
  const Vector3d on_edge[3] = {{2, 1, 0}, {0, 3, 0}, {2, 3, 0}}, flat[3] = {{-5, -5, 0.5}, {5, -5, 0.5}, {0, 9, 0.5}};
  for (const auto* t : {on_face, on_corner, on_edge, flat}) EXPECT_TRUE(box.gap({t, 3}, kFar).isTouching());
  const CapsuleShape ball(1, 0), capsule(1, 2);
  const Vector3d above[3] = {{0, 0, 1}, {1, 0, 1}, {0, 1, 1}}, tip[3] = {{0, 0, 2}, {1, 0, 3}, {0, 1, 3}};
  EXPECT_TRUE(ball.gap({above, 3}, kFar).isTouching());
  EXPECT_TRUE(capsule.gap({tip, 3}, kFar).isTouching());
  const RoundShape cone(1, 0, 2);
  const Vector3d apex[3] = {{0, 0, 1}, {1, 0, 2}, {0, 1, 2}}, base[3] = {{0, 0, -1}, {1, 0, -2}, {0, 1, -2}};
  EXPECT_TRUE(cone.gap({apex, 3}, kFar).isTouching());
  EXPECT_TRUE(cone.gap({base, 3}, kFar).isTouching());
  const PlaneShape plane(Vector3d::UnitZ(), 0.5, {Vector3d::Zero(), 9});
  EXPECT_TRUE(plane.gap({flat, 3}, kFar).isTouching()) << "a triangle in the plane";
}

// Rounding may put all corners of a triangle in the plane on one side of it, by hardly different heights.
TEST(ConvexShape, APlaneTouchesATriangleInItWhereTheTriangleIs) {
  std::mt19937_64 g(12);
  std::uniform_real_distribution<double> u(-1, 1);
  int on_one_side = 0;
  for (int i = 0; i < 20000; ++i) {
    const Vector3d n = test::randomDirection(g), a = n.unitOrthogonal(), b = n.cross(a);
    const double height = u(g);
    Vector3d t[3];
    for (Vector3d& x : t) x = height * n + u(g) * a + u(g) * b;
    const PlaneShape plane(n, height, {Vector3d::Zero(), 9});
    const SeparationResult gap = plane.gap({t, 3}, kFar);
    ASSERT_TRUE(gap.isTouching());
    const Eigen::AlignedBox3d box = Eigen::AlignedBox3d(t[0].cwiseMin(t[1]).cwiseMin(t[2]).array() - 1e-12,
                                                        t[0].cwiseMax(t[1]).cwiseMax(t[2]).array() + 1e-12);
    ASSERT_TRUE(box.contains(gap.on_points)) << i << ": " << gap.on_points.transpose();
    int above = 0;
    for (const Vector3d& x : t) above += n.dot(x) > height;
    on_one_side += above == 0 || above == 3;
  }
  EXPECT_GT(on_one_side, 1000);
}

TEST(ConvexShape, PartingPartsAndIsLeastWhereItSaysSo) {
  std::mt19937_64 g(4);
  std::uniform_real_distribution<double> u(-1, 1);
  for (const Known& k : bodies()) {
    SCOPED_TRACE(k.name);
    int parted = 0, longer = 0;
    for (int i = 0; i < 1500; ++i) {
      const double size = std::pow(10.0, u(g));
      const Vector3d at = Vector3d(u(g), u(g), u(g));
      Vector3d t[3];
      for (Vector3d& x : t) x = at + size * Vector3d(u(g), u(g), u(g));
      if (!k.body->gap({t, 3}, kFar).isTouching()) continue;
      const ContactPoint touch = penetration(*k.body, {t, 3});
      ASSERT_NEAR(touch.normal.norm(), 1, 1e-12);
      ASSERT_GE(touch.depth, 0);
      const auto moved = [&](const Vector3d& by) {
        const Vector3d m[3] = {t[0] + by, t[1] + by, t[2] + by};
        return k.body->gap({m, 3}, kFar);
      };
      ASSERT_FALSE(moved(touch.normal * (touch.depth + 1e-8)).isTouching()) << i;
      ++parted;
      double least = kFar;
      for (int j = 0; j < 300; ++j) {
        const Vector3d n = test::randomDirection(g);
        least = std::min(least, k.height(n) - lowest(n, {t, 3}));
      }
      if (k.shortest) {
        ASSERT_LE(touch.depth, least * (1 + 1e-9)) << i;
      }
      longer += touch.depth > 1.11 * least;
    }
    EXPECT_GT(parted, 100);
    EXPECT_LE(longer, parted / 100);
  }
}

TEST(ConvexShape, WhatOverlapsByLittlePartsByLittle) {
  std::mt19937_64 g(9);
  std::uniform_real_distribution<double> u(-1, 1);
  for (const Known& k : bodies()) {
    for (const double overlap : {1e-2, 1e-4, 1e-6}) {
      SCOPED_TRACE(std::string(k.name) + " by " + std::to_string(overlap));
      int parted = 0, longer = 0;
      for (int i = 0; i < 200; ++i) {
        const double size = std::pow(10.0, u(g));
        Vector3d t[3], m[3];
        for (Vector3d& x : t) x = size * Vector3d(u(g), u(g), u(g));
        const Vector3d displacement = test::randomDirection(g);
        const auto touchesAt = [&](double d) {
          for (int c = 0; c < 3; ++c) m[c] = t[c] + displacement * d;
          return k.body->gap({m, 3}, kFar).isTouching();
        };
        double lo = 0, hi = 40;
        if (!touchesAt(lo) || touchesAt(hi)) continue;
        for (int s = 0; s < 50; ++s) (touchesAt((lo + hi) / 2) ? lo : hi) = (lo + hi) / 2;
        if (!touchesAt(lo - overlap)) continue;
        // Back along the way is one way to part them.
        longer += penetration(*k.body, {m, 3}).depth > 1.5 * overlap;
        ++parted;
      }
      EXPECT_GT(parted, 50);
      EXPECT_LT(longer, parted / 10);
    }
  }
}

TEST(ConvexShape, TrianglesThatAreJustApartTouchBetweenTheirNearestPoints) {
  std::mt19937_64 g(10);
  std::uniform_real_distribution<double> u(-1, 1);
  for (int i = 0; i < 500; ++i) {
    Corners p, q;
    for (Vector3d& x : p) x = Vector3d(u(g), u(g), u(g));
    for (Vector3d& x : q) x = Vector3d(u(g), u(g), u(g));
    Vector3d a, b;
    if (nearestPoints(p, q, a, b) < 1e-3) continue;
    // Put so that they are 1e-9 apart, where they were nearest.
    const Vector3d step = (a - b) - (a - b).normalized() * 1e-9;
    for (Vector3d& x : q) x += step;
    const ContactPoint touch = trianglePenetration(p, q);
    ASSERT_LT((closestPoint(touch.point, p) - touch.point).norm(), 1e-6) << i;
    ASSERT_LT((closestPoint(touch.point, q) - touch.point).norm(), 1e-6) << i;
    ASSERT_LT(touch.depth, 1e-9) << i;
  }
}

// Bodies without extent, points on axes and in middles, triangles that are segments or points, in special positions.
TEST(ConvexShape, PartingPartsWhatIsFlatAndSymmetric) {
  std::vector<std::shared_ptr<const ConvexShape>> all;
  for (const double e : {0.0, 1e-12, 1e-6}) {
    all.push_back(std::make_shared<BoxShape>(Vector3d(0.5, 0.5, e)));
    all.push_back(std::make_shared<BoxShape>(Vector3d(e, 0.5, e)));
    all.push_back(std::make_shared<CapsuleShape>(e, 1));
    all.push_back(std::make_shared<CapsuleShape>(0.3, e));
    all.push_back(std::make_shared<RoundShape>(0.5, 0.5, e));
    all.push_back(std::make_shared<RoundShape>(e, e, 1));
    all.push_back(std::make_shared<RoundShape>(0.5, 0, e));
    all.push_back(std::make_shared<EllipsoidShape>(Vector3d(0.5, 0.7, e)));
    all.push_back(std::make_shared<EllipsoidShape>(Vector3d(e, 0.7, e)));
  }
  for (const Known& k : bodies()) all.push_back(k.body);
  std::vector<std::array<Vector3d, 3>> triangles;
  const double grid[] = {-0.5, 0, 0.25, 0.5};
  const auto at = [&](std::size_t i) { return Vector3d(grid[i % 4], grid[i / 4 % 4], grid[i / 16 % 4]); };
  for (std::size_t i = 0; i < 64; ++i) {
    triangles.push_back({at(i), at(i), at(i)});
    triangles.push_back({at(i), at(i * 7 + 3), at(i)});
    triangles.push_back({at(i), at(i * 7 + 3), at(i * 11 + 5)});
    triangles.push_back({at(i), Vector3d(-at(i)), Vector3d::Zero()});
    triangles.push_back({Vector3d(-1, -1, grid[i % 4]), Vector3d(1, -1, grid[i % 4]), Vector3d(0, 1, grid[i % 4])});
  }
  int parted = 0;
  for (std::size_t b = 0; b < all.size(); ++b) {
    for (std::size_t i = 0; i < triangles.size(); ++i) {
      const Vector3d* t = triangles[i].data();
      if (!all[b]->gap({t, 3}, kFar).isTouching()) continue;
      const ContactPoint touch = penetration(*all[b], {t, 3});
      ASSERT_NEAR(touch.normal.norm(), 1, 1e-9) << b << ' ' << i;
      ASSERT_GE(touch.depth, 0);
      ASSERT_LT(touch.depth, 3);
      ASSERT_TRUE(touch.point.allFinite());
      Vector3d moved[3];
      for (int k = 0; k < 3; ++k) moved[k] = t[k] + touch.normal * (touch.depth + 1e-8);
      ASSERT_FALSE(all[b]->gap({moved, 3}, kFar).isTouching()) << b << ' ' << i;
      ++parted;
    }
  }
  EXPECT_GT(parted, 1000);
}

TEST(ConvexShape, TrianglesPartAsTriangles) {
  const Corners c = {{{0, 0, 0}, {2, 0, 0}, {0, 2, 0}}};
  const TriangleShape body(c);
  const Vector3d across[3] = {{0.5, 0.5, -0.25}, {0.5, 0.5, 1}, {1, 0.5, 1}},
                 off[3] = {{0, 0, 1}, {1, 0, 1}, {0, 1, 1}};
  EXPECT_TRUE(body.gap({across, 3}, kFar).isTouching());
  EXPECT_NEAR(penetration(body, {across, 3}).depth, 0.25, 1e-12);
  EXPECT_NEAR(penetration(body, {across, 3}).normal.z(), 1, 1e-12);
  EXPECT_NEAR(body.gap({off, 3}, kFar).distance, 1, 1e-12);
  // More points than three.
  Vector3d corners[8];
  for (const double z : {-0.5, 0.25}) {
    for (int i = 0; i < 8; ++i) corners[i] = Vector3d(i & 1 ? 5 : 0.5, i & 2 ? 5 : 0.5, z + (i & 4 ? 1 : 0));
    EXPECT_EQ(body.gap({corners, 8}, kFar).isTouching(), z < 0);
  }
}

}  // namespace
}  // namespace bocst::query
