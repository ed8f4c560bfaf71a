// SPDX-License-Identifier: BSD-3-Clause
// Times of contact by themselves, on trees made by hand, where they are known in closed form.
#include "query/ccd/contact_time_walk.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "meshes.h"
#include "query/hand_tree.h"

namespace bocst::query {
namespace {

using test::HandTree;

constexpr double kNever = std::numeric_limits<double>::infinity();
constexpr double kRounding = 1e-9, kTimeError = 1e-7;

AxisMotion still() { return {Eigen::Isometry3d::Identity(), Eigen::Vector3d::Zero()}; }
AxisMotion moving(const Eigen::Vector3d& velocity) { return {Eigen::Isometry3d::Identity(), velocity}; }

double timeOf(const HandTree& a, const Motion& motion_a, const HandTree& b, const Motion& motion_b, double margin = 0) {
  SimilarityTransform same;
  same.ready();
  ContactTimeWalk<HandTree, HandTree> walk(a, same, motion_a, b, same, motion_b);
  ContactGoal goal;
  goal.margin = margin;
  goal.rounding = kRounding;
  goal.time_error = kTimeError;
  return walk.run(goal);
}

// Never later, and hardly earlier: the answer's own tolerances over the speed.
void expectTime(double time, double exact, double speed = 1) {
  EXPECT_LE(time, exact + 1e-12);
  EXPECT_GE(time, exact - kTimeError - 2 * kRounding / speed);
}

TEST(ContactTimes, RowsThatMeetHeadOn) {
  for (const double height : {0.25, 1.0, 7.0}) {
    HandTree a(test::row(32)), b(test::row(32, height));
    expectTime(timeOf(a, moving({0, 0, 8}), b, still()), height / 8, 8);
    expectTime(timeOf(a, still(), b, moving({0, 0, -8})), height / 8, 8);
    expectTime(timeOf(a, moving({0, 0, 6}), b, moving({0, 0, -6})), height / 12, 12);
    expectTime(timeOf(a, moving({0, 0, 8}), b, still(), 0.125), (height - 0.125) / 8, 8);
    EXPECT_EQ(timeOf(a, moving({0, 0, -8}), b, still()), kNever) << "they recede";
    EXPECT_EQ(timeOf(a, moving({5, 5, 0}), b, moving({5, 5, 0})), kNever) << "they go side by side";
    EXPECT_EQ(timeOf(a, moving({0, 0, 0.99 * height}), b, still()), kNever) << "the time is too short";
    EXPECT_EQ(timeOf(a, moving({0, 0, 8}), b, still(), height), 0) << "they touch from the start on";
  }
}

// One triangle of many is met, after the others were passed by.
TEST(ContactTimes, AHitBehindANearMissIsFound) {
  HandTree a(test::row(64));
  auto post = test::row(1);
  for (auto& x : post[0].corners) x += Eigen::Vector3d(70, 0, -0.4);
  post[0].corners[2].z() += 0.8;  // it cuts the plane of the row on y = 0.4, from x = 70 on
  HandTree b(post);
  // There the last triangle of the row ends at x = 63.4.
  expectTime(timeOf(a, moving({10, 0, 0}), b, still()), 0.66, 10);
  HandTree beside(test::row(64, 0.9));
  EXPECT_EQ(timeOf(beside, moving({10, 0, 0}), b, still()), kNever);
}

TEST(ContactTimes, ABladeThatTurnsIntoAWall) {
  // A blade along x of length 2 turns about z; the wall stands on x = 1 from y = 0.5 up: they meet where the blade's
  // edge reaches its lowest corner.
  std::vector<test::HandTriangle> blade(1), wall(1);
  blade[0].corners[0] = {0, 0, -1};
  blade[0].corners[1] = {0, 0, 1};
  blade[0].corners[2] = {20, 0, 0};
  wall[0].corners[0] = {1, 0.5, 0};
  wall[0].corners[1] = {1, 3, 0.1};
  wall[0].corners[2] = {1, 3, -0.1};
  HandTree a(blade), b(wall);
  const double angle = 1.5, exact = std::atan2(0.5, 1) / angle;
  const AxisMotion turn(Eigen::Isometry3d::Identity(), Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(),
                        Eigen::Vector3d::UnitZ(), angle);
  expectTime(timeOf(a, turn, b, still()), exact, 0.5);
  expectTime(timeOf(b, still(), a, turn), exact, 0.5);
  const AxisMotion back(Eigen::Isometry3d::Identity(), Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(),
                        Eigen::Vector3d::UnitZ(), -angle);
  EXPECT_EQ(timeOf(a, back, b, still()), kNever);
}

TEST(ContactTimes, CloudsAgreeWithManyDistances) {
  std::mt19937_64 g(3);
  int hits = 0, misses = 0;
  for (int i = 0; i < 40; ++i) {
    HandTree a(test::cloud(g, 1 + g() % 20, 3), 1 + g() % 3), b(test::cloud(g, 1 + g() % 20, 3), 1 + g() % 3);
    const Eigen::Vector3d direction = test::randomDirection(g);
    Eigen::Isometry3d begin = Eigen::Isometry3d::Identity();
    begin.translation() = -8 * direction + 2 * test::randomDirection(g);
    const AxisMotion motion(begin, 16 * direction);
    if (i % 2 == 0) a.sleepFrom(0), b.sleepFrom(1);
    const double time = timeOf(a, motion, b, still());
    // The distance of all pairs shortly before, and at that time.
    const auto distanceAt = [&](double t) {
      SimilarityTransform a_in_b;
      a_in_b.translation = motion.at(t).translation();
      a_in_b.ready();
      double least = kNever;
      for (std::uint32_t p = 0; p < b.triangles(); ++p) {
        for (std::uint32_t q = 0; q < a.triangles(); ++q) {
          least = std::min(least, test::distanceOf(b.corners(p), a.corners(q), a_in_b));
        }
      }
      return least;
    };
    const double until = std::min(time, 1.0);
    for (int k = 0; k < 50; ++k) ASSERT_GT(distanceAt(until * k / 50), 0) << "contact before " << time;
    if (time == kNever) {
      ++misses;
      continue;
    }
    ++hits;
    ASSERT_LE(distanceAt(time + kTimeError), 2e-6 + kRounding) << i;
  }
  EXPECT_GT(hits, 8);
  EXPECT_GT(misses, 4);
}

// All triangles of two rows meet at the same time: one pair is followed to its contact, not all.
TEST(ContactTimes, FlatLandingsTakeFewSteps) {
  HandTree a(test::row(64)), b(test::row(64, 1));
  SimilarityTransform same;
  same.ready();
  const AxisMotion up = moving({0, 0, 8}), none = still();
  ContactTimeWalk<HandTree, HandTree> walk(a, same, up, b, same, none);
  ContactGoal goal;
  goal.rounding = kRounding;
  goal.time_error = kTimeError;
  expectTime(walk.run(goal), 0.125, 8);
  EXPECT_FALSE(walk.gaveUp());
  EXPECT_LT(walk.steps(), 64u);
  // A walk that gives up keeps what it was told, or found.
  EXPECT_EQ(walk.run(goal, 0.5, 2), 0.5);
  EXPECT_TRUE(walk.gaveUp());
  expectTime(walk.run(goal, 0.5), 0.125, 8);
  // A contact that is known ends the walk where nothing is earlier.
  expectTime(walk.run(goal, 0.125), 0.125, 8);
  EXPECT_LE(walk.steps(), 1u);
}

// A joint turns two links together: nothing between them changes.
TEST(ContactTimes, BodiesThatTurnTogetherTakeFewSteps) {
  HandTree a(test::row(64)), b(test::row(64, 1e-5));
  SimilarityTransform same;
  same.ready();
  const Eigen::Vector3d axis = Eigen::Vector3d(1, 2, 3).normalized();
  const AxisMotion turn(Eigen::Isometry3d::Identity(), {1, 1, 0}, {3, 4, 5}, axis, 2);
  ContactTimeWalk<HandTree, HandTree> walk(a, same, turn, b, same, turn);
  ContactGoal goal;
  goal.rounding = kRounding;
  EXPECT_EQ(walk.run(goal), kNever);
  EXPECT_LT(walk.steps(), 100u);
}

// The corner of a blade passes a wall: the other corners come nearer faster than it does, from farther away.
TEST(ContactTimes, ACornerThatTurnsPastAWallTakesFewSteps) {
  std::vector<test::HandTriangle> blade(1), wall(1);
  blade[0].corners[0] = {0, 0, -0.1};
  blade[0].corners[1] = {0, 0, 0.1};
  blade[0].corners[2] = {1, 0, 0};
  for (const double gap : {1e-3, 1e-6, 1e-8}) {
    wall[0].corners[0] = {1 + gap, -5, -5};
    wall[0].corners[1] = {1 + gap, 5, -5};
    wall[0].corners[2] = {1 + gap, 0, 9};
    HandTree a(blade), b(wall);
    SimilarityTransform same;
    same.ready();
    Eigen::Isometry3d begin = Eigen::Isometry3d::Identity();
    begin.linear() = Eigen::AngleAxisd(-1, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    const AxisMotion turn(begin, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitZ(), 2),
        none = still();
    for (const bool turned : {false, true}) {
      ContactTimeWalk<HandTree, HandTree> walk(turned ? b : a, same, turned ? none : turn, turned ? a : b, same,
                                               turned ? turn : none);
      ContactGoal goal;
      goal.rounding = kRounding;
      goal.time_error = 1e-4;
      EXPECT_EQ(walk.run(goal), kNever) << gap;
      EXPECT_LT(walk.steps(), 100u) << gap;
    }
  }
}

TEST(ContactTimes, OnlyWhatMayTouchFirstGrows) {
  HandTree a(test::row(64)), b(test::row(1, 4));
  a.sleepFrom(0);
  expectTime(timeOf(a, moving({0, 0, 8}), b, still()), 0.5, 8);
  EXPECT_GE(a.grown().size(), 6u);
  EXPECT_LE(a.grown().size(), 12u) << "of 63";
  HandTree far(test::row(64));
  far.sleepFrom(0);
  EXPECT_EQ(timeOf(far, moving({0, 8, 0}), b, still()), kNever);
  EXPECT_TRUE(far.grown().empty());
}

}  // namespace
}  // namespace bocst::query
