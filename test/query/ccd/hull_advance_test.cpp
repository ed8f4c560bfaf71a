// SPDX-License-Identifier: BSD-3-Clause
// Until when the hulls of two moving meshes are apart: against exact distances of hulls at many times.
#include "query/ccd/hull_advance.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "conformance/convex.h"
#include "meshes.h"

namespace bocst::query {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

test::Raw cloud(std::mt19937_64& g, std::size_t points) {
  test::Raw raw;
  for (std::size_t i = 0; i < points; ++i) raw.vertices.push_back(test::randomDirection(g));
  for (std::size_t i = 0; i + 2 < points; ++i) raw.triangles.emplace_back(i, i + 1, i + 2);
  return raw;
}

double hullsApartUntil(const Mesh& a, const Motion& motion_a, const Mesh& b, const Motion& motion_b, double clearance) {
  const MotionPair motions(motion_a, motion_b);
  return MeshHullAdvance(a, b, motions, clearance).run(24);
}

TEST(HullAdvance, NeverLaterThanTheFirstContactOfHulls) {
  std::mt19937_64 g(8);
  std::uniform_real_distribution<double> u(-1, 1);
  int always = 0, never = 0, later = 0;
  for (int i = 0; i < 300; ++i) {
    const auto a = cloud(g, 3 + g() % 12).mesh(), b = cloud(g, 3 + g() % 12).mesh();
    const auto at = [&](double spread) {
      return test::pose<double>(test::randomRotation(g), spread * test::randomDirection(g));
    };
    const auto motionFrom = [&](const Isometry3d& begin) {
      const Vector3d velocity = 3 * test::randomDirection(g);
      return i % 3 == 0 ? AxisMotion(begin, velocity)
                        : AxisMotion(begin, velocity, u(g) * test::randomDirection(g), test::randomDirection(g), u(g));
    };
    const AxisMotion motion_a = motionFrom(at(0)), motion_b = motionFrom(at(1.6 + 0.6 * u(g)));
    const double clearance = i % 2 == 0 ? 0.1 : 1e-9;
    const double until = hullsApartUntil(*a, motion_a, *b, motion_b, clearance);
    (until > 1 ? always : until > 0 ? later : never)++;
    for (int k = 0; k <= 60; ++k) {
      const double time = k / 60.0;
      if (time >= until) break;
      std::vector<Vector3d> of_a, of_b;
      for (const Vector3d& v : a->vertices()) of_a.push_back(motion_a.at(time) * v);
      for (const Vector3d& v : b->vertices()) of_b.push_back(motion_b.at(time) * v);
      const test::Interval distance =
          distanceOf(test::sweptHullOf(of_a), Isometry3d::Identity(), test::sweptHullOf(of_b));
      ASSERT_GE(distance.high, clearance) << "time " << time << " of " << until;
    }
  }
  EXPECT_GT(always, 50);
  EXPECT_GT(later, 20);
  EXPECT_GT(never, 20);
}

// Their boxes overlap all of the time.
TEST(HullAdvance, BodiesThatPassEachOtherAreFree) {
  const auto cube = test::box({-1, -1, -1}, {1, 1, 1}).mesh();
  const Eigen::Matrix3d R = Eigen::AngleAxisd(0.25 * std::acos(-1.0), Vector3d::UnitZ()).toRotationMatrix();
  const double edge = 1 + std::sqrt(2.0);  // an edge of the one touches a face of the other
  const AxisMotion still(test::pose<double>(Eigen::Matrix3d::Identity(), {0, 0, 0}), Vector3d::Zero());
  for (const double gap : {1e-6, 1e-3, 0.1}) {
    const AxisMotion along(test::pose<double>(R, {edge + gap, 0, 0}), {0, 0.3, 5});
    EXPECT_GT(hullsApartUntil(*cube, still, *cube, along, gap / 2), 1);
    EXPECT_GT(hullsApartUntil(*cube, along, *cube, still, gap / 2), 1);
    EXPECT_EQ(hullsApartUntil(*cube, still, *cube, along, 2 * gap), 0);
    const AxisMotion nearer(test::pose<double>(R, {edge + gap, 0, 0}), {-4 * gap, 0, 5});
    const double until = hullsApartUntil(*cube, nearer, *cube, still, gap / 2);
    EXPECT_LE(until, 0.125);
    EXPECT_GT(until, 0.1);
  }
}

}  // namespace
}  // namespace bocst::query
