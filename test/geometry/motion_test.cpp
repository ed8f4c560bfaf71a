// SPDX-License-Identifier: BSD-3-Clause
// How soon gaps between moving bodies may close, against the ways of their points at many times.
#include "geometry/motion.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "geometry/triangle.h"
#include "meshes.h"

namespace bocst::query {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

class Motions : public testing::Test {
 protected:
  double uniform() { return std::uniform_real_distribution<double>(-1, 1)(g_); }
  Vector3d anywhere(double size) { return size * Vector3d(uniform(), uniform(), uniform()); }

  AxisMotion random() {
    return {test::pose<double>(test::randomRotation(g_), anywhere(2)), anywhere(1), anywhere(1),
            test::randomDirection(g_), 3 * uniform()};
  }
  // Of motions whose turns have much in common, too.
  AxisMotion randomBeside(const AxisMotion& a, int i) {
    const Isometry3d begin = test::pose<double>(test::randomRotation(g_), anywhere(2));
    const double angle = a.turn().norm();
    const Vector3d axis = a.turn() / angle;
    const Vector3d arm = begin.translation() - a.pointOfAxis();
    switch (i % 4) {
      case 0:  // the same
        return {begin, a.velocity(), arm, axis, angle};
      case 1:  // about a parallel axis
        return {begin, anywhere(1), anywhere(1), axis, 3 * uniform()};
      case 2:  // nearly the same
        return {begin, a.velocity() + anywhere(1e-3), arm, (axis + anywhere(1e-3)).normalized(), angle};
      default:
        return {begin, anywhere(1), anywhere(1), test::randomDirection(g_), 3 * uniform()};
    }
  }

  std::mt19937_64 g_{12};
};

TEST_F(Motions, AsOneBodySeesTheOtherAreBounded) {
  constexpr double kRounding = 1e-9;
  for (int i = 0; i < 2000; ++i) {
    const AxisMotion a = random(), b = randomBeside(a, i);
    const RelativeMotion seen(a, b);
    const double begin = 0.5 + 0.5 * uniform();
    const Vector3d n = test::randomDirection(g_), center = anywhere(2);
    const double radius = i % 3 == 0 ? 0 : 0.5;
    const ClosingSpeed speed = seen.closingSpeed(n, 0, center, radius, begin);
    const double fastest = seen.fastest(center, radius, begin);
    const Vector3d p = anywhere(2), q = center + radius * test::randomDirection(g_);
    const Vector3d p_in_a = a.at(begin).inverse() * p, q_in_b = b.at(begin).inverse() * q;
    const Vector3d n_in_a = a.at(begin).linear().transpose() * n;
    const double distance = (p - q).norm();
    for (int k = 1; k <= 20; ++k) {
      const double step = (1 - begin) * k / 20, time = begin + step;
      const Vector3d at_p = a.at(time) * p_in_a, at_q = b.at(time) * q_in_b;
      const double way = (a.at(time).linear() * n_in_a).dot(at_q - at_p) - n.dot(q - p);
      ASSERT_LE(way, speed.ever * step + kRounding) << i;
      ASSERT_LE(way, speed.now * step + speed.change * step * step / 2 + kRounding) << i;
      ASSERT_LE(std::abs((at_q - at_p).norm() - distance), fastest * step + kRounding) << i;
    }
    // The bound of now is what a point has.
    if (radius == 0) {
      constexpr double kStep = 1e-6;
      const double time = begin * (1 - kStep) + kStep;  // not later than 1
      const double way = (a.at(time).linear() * n_in_a).dot(b.at(time) * q_in_b - a.at(time) * p_in_a) - n.dot(q - p);
      ASSERT_NEAR(way / (time - begin), speed.now, 1e-4) << i;
    }
    if (i % 4 == 0) {
      ASSERT_LT(fastest, 1e-11) << "the bodies move together";
    }
  }
}

// A disc on the body's own axis: how far it reaches along a direction.
TEST_F(Motions, OfBodiesOfRevolutionAreBounded) {
  for (int i = 0; i < 3000; ++i) {
    // From a perfect wheel to a body that is thrown about.
    const double off = i % 5 == 0 ? 0 : std::pow(10, -3 + 3 * uniform());
    const Isometry3d X = test::pose<double>(test::randomRotation(g_), anywhere(2));
    const Vector3d own_axis = test::randomDirection(g_), turned = X.linear() * own_axis;
    const Vector3d axis = (turned + off * test::randomDirection(g_)).normalized();
    const Vector3d arm = uniform() * axis + off * anywhere(1);
    const AxisMotion motion(X, anywhere(1), arm, axis, 3 * uniform());
    const RevolutionMotion wheel(motion, own_axis);
    const double begin = 0.5 + 0.5 * uniform(), height = uniform(), radius = 0.5 + 0.5 * uniform();
    const Vector3d n = test::randomDirection(g_);
    const auto reach = [&](double time) {
      const Isometry3d at = motion.at(time);
      const Vector3d own = at.linear() * own_axis;
      return n.dot(at.translation() + height * own) + radius * n.cross(own).norm();
    };
    const Vector3d center = motion.at(begin) * Vector3d(height * own_axis);
    const ClosingSpeed speed = wheel.closingSpeed(n, 0, center, radius, begin);
    const double fastest = wheel.fastest(center, radius, begin);
    for (int k = 1; k <= 20; ++k) {
      const double step = (1 - begin) * k / 20, way = reach(begin + step) - reach(begin);
      ASSERT_LE(way, speed.ever * step + 1e-12) << i;
      ASSERT_LE(way, speed.now * step + speed.change * step * step / 2 + 1e-12) << i;
      ASSERT_LE(std::abs(way), fastest * step + 1e-12) << i;
    }
    ASSERT_TRUE(wheel.at(begin).isApprox(motion.at(begin)));
    if (off > 0) continue;
    ASSERT_NEAR(speed.now, n.dot(motion.velocity()), 1e-12) << "it only goes straight on";
    ASSERT_NEAR(speed.ever, n.dot(motion.velocity()), 1e-12);
    ASSERT_NEAR(fastest, motion.velocity().norm(), 1e-12);
    ASSERT_LT(speed.change, 1e-12);
    ASSERT_LT(wheel.shareOfTurn(1), 1e-12);
  }
}

TEST_F(Motions, TrianglesDoNotTouchBeforeTheyCan) {
  int touching = 0, longer = 0;
  for (int i = 0; i < 6000; ++i) {
    const AxisMotion a = random(), b = randomBeside(a, i);
    const MotionPair both(a, b);
    const double begin = 0.4 + 0.4 * uniform();
    Corners p, q;
    const Vector3d p_at = anywhere(1), q_at = anywhere(1);
    for (std::size_t k = 0; k < 3; ++k) {
      p[k] = p_at + anywhere(0.3);
      q[k] = q_at + anywhere(0.3);
    }
    Vector3d on_p, on_q;
    nearestPoints(p, q, on_p, on_q);
    const double distance = (on_q - on_p).norm();
    if (distance < 1e-6) continue;
    const Vector3d n = (on_q - on_p) / distance;
    const MovingHull hull_p{p.data(), 3}, hull_q{q.data(), 3};
    const double touch = both.timeToTouch(distance, n, 1e-15, hull_p, hull_q, begin);
    const double close = both.timeToClose(distance, n, 1e-15, hull_p, hull_q, begin);
    ASSERT_GE(touch, close * (1 - 1e-9)) << i;
    longer += touch > 1.2 * close;
    const double until = std::min(touch, 1 - begin);
    touching += touch < 1 - begin;
    const Vector3d n_in_a = a.at(begin).linear().transpose() * n;
    for (int k = 1; k < 12; ++k) {
      const double time = begin + until * k / 12;
      const Isometry3d X_p = a.at(time) * a.at(begin).inverse(), X_q = b.at(time) * b.at(begin).inverse();
      // Along the direction, or as it turns with A, all corners are still on their sides.
      double in_world = std::numeric_limits<double>::infinity(), seen_from_a = in_world;
      for (const Vector3d& at_p : p) {
        for (const Vector3d& at_q : q) {
          const Vector3d way = X_q * at_q - X_p * at_p;
          in_world = std::min(in_world, n.dot(way));
          seen_from_a = std::min(seen_from_a, (a.at(time).linear() * n_in_a).dot(way));
        }
      }
      ASSERT_GT(std::max(in_world, seen_from_a), -1e-12) << i << ' ' << time - begin << " of " << touch;
    }
  }
  EXPECT_GT(touching, 1000);
  EXPECT_GT(longer, 250);
}

// A blade that turns slowly about an end near a wall: its other end, which is fast, has a longer way to the wall.
TEST_F(Motions, CornersBehindTheForemostHaveTheirOwnWay) {
  const double gap = 1e-3, behind = 0.1, angle = 0.05, length = 10;
  const Corners blade{Vector3d(0.01, gap, 0), Vector3d(length, gap + behind, 0), Vector3d(0.01, gap, 0.1)};
  const Corners wall{Vector3d(-50, 0, -50), Vector3d(50, 0, -50), Vector3d(0, 0, 90)};
  const Vector3d up = Vector3d::UnitY();
  const AxisMotion still(Isometry3d::Identity(), Vector3d::Zero());
  const AxisMotion down(Isometry3d::Identity(), Vector3d::Zero(), Vector3d::Zero(), -Vector3d::UnitZ(), angle);
  const MovingHull of_blade{blade.data(), 3}, of_wall{wall.data(), 3};
  const double exact = std::atan2(gap + behind, length) / angle;
  for (const bool turned : {false, true}) {
    const double time = turned ? MotionPair(down, still).timeToTouch(gap, -up, 1e-15, of_blade, of_wall, 0)
                               : MotionPair(still, down).timeToTouch(gap, up, 1e-15, of_wall, of_blade, 0);
    EXPECT_LE(time, exact);
    EXPECT_GE(time, 0.95 * exact);
  }
}

}  // namespace
}  // namespace bocst::query
