// SPDX-License-Identifier: BSD-3-Clause
// The reference of the matrix, against what is known in closed form and against itself.
#include "conformance/convex.h"

#include <gtest/gtest.h>

#include "meshes.h"

namespace bocst::test {
namespace {

using Eigen::Vector3d;

Eigen::Isometry3d at(const Vector3d& p, const Eigen::Matrix3d& R = Eigen::Matrix3d::Identity()) {
  return test::pose<double>(R, p);
}

Solid ball(double radius) {
  Solid s = sweptHullOf({Vector3d::Zero()});
  s.round = s.reach = radius;
  return s;
}

/// A ball that is not told to be one.
Solid smooth(double radius) {
  Solid s;
  s.reach = radius;
  s.support = [=](const Vector3d& d) { return Vector3d(radius * d.normalized()); };
  return s;
}

Solid cube() {
  std::vector<Vector3d> corners;
  for (int i = 0; i < 8; ++i) corners.emplace_back(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1);
  return sweptHullOf(corners);
}

TEST(ConvexDistance, KnowsBallsAndCubes) {
  std::mt19937_64 g(1);
  std::uniform_real_distribution<double> u(0, 4);
  for (int i = 0; i < 500; ++i) {
    const Vector3d p = randomDirection(g) * u(g);
    const double expected = std::max(p.norm() - 1.5, 0.0), to_cube = (p.cwiseAbs().array() - 1).max(0).matrix().norm();
    for (const Solid& a : {ball(1), smooth(1)}) {
      const Interval d = distanceOf(a, at(p, randomRotation(g)), ball(0.5));
      ASSERT_NEAR(d.low, expected, 1e-9);
      ASSERT_NEAR(d.high, expected, 1e-9);
    }
    const Interval d = distanceOf(ball(0), at(p), cube()), e = distanceOf(cube(), at(-p), ball(0));
    ASSERT_NEAR(d.low, to_cube, 1e-12);
    ASSERT_NEAR(d.high, to_cube, 1e-12);
    ASSERT_NEAR(e.high, to_cube, 1e-12);
    ASSERT_EQ(d.meets(), to_cube == 0);
  }
  EXPECT_TRUE(distanceOf(cube(), at({2, 0.5, 0}), cube()).meets()) << "touching";
  EXPECT_TRUE(distanceOf(cube(), at({0, 0, 0}), cube()).meets());
  EXPECT_NEAR(distanceOf(cube(), at({2.5, 0.5, 0}), cube()).low, 0.5, 1e-12);
}

TEST(ConvexDistance, TrianglesThatMeetAndThoseThatDoNot) {
  std::mt19937_64 g(2);
  std::normal_distribution<double> n;
  const auto any = [&] { return Vector3d(n(g), n(g), n(g)); };
  int meeting = 0;
  for (int i = 0; i < 3000; ++i) {
    const Solid a = sweptHullOf({any(), any(), any()}), b = sweptHullOf({any(), any(), any()});
    const Interval d = distanceOf(a, at({0, 0, 0}), b), e = distanceOf(b, at({0, 0, 0}), a);
    ASSERT_EQ(d.meets(), e.meets());
    ASSERT_LE(d.high - d.low, 1e-9);
    ASSERT_NEAR(d.high, e.high, 1e-9);
    meeting += d.meets();
    // Where an edge of one goes through the other they meet, and otherwise not.
    const auto cuts = [](const Solid& p, const Solid& q) {
      std::vector<Vector3d> c, t;
      std::mt19937_64 h(3);
      for (const auto* s : {&p, &q}) {
        auto& corners = s == &p ? c : t;
        while (corners.size() < 3) {
          const Vector3d x = s->support(randomDirection(h));
          if (std::find(corners.begin(), corners.end(), x) == corners.end()) corners.push_back(x);
        }
      }
      const auto volume = [](const Vector3d& o, const Vector3d& x, const Vector3d& y, const Vector3d& z) {
        return (x - o).dot((y - o).cross(z - o));
      };
      for (std::size_t k = 0; k < 3; ++k) {
        const Vector3d &from = c[k], &to = c[(k + 1) % 3];
        if (volume(from, t[0], t[1], t[2]) * volume(to, t[0], t[1], t[2]) > 0) continue;
        const double x = volume(from, to, t[0], t[1]), y = volume(from, to, t[1], t[2]),
                     z = volume(from, to, t[2], t[0]);
        if ((x > 0) == (y > 0) && (y > 0) == (z > 0)) return true;
      }
      return false;
    };
    ASSERT_EQ(d.meets(), cuts(a, b) || cuts(b, a)) << i;
  }
  EXPECT_GT(meeting, 300);
}

}  // namespace
}  // namespace bocst::test
