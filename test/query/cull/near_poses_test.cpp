// SPDX-License-Identifier: BSD-3-Clause
// What the test of many poses settles is rigid and apart, on every instruction set that the dispatch can choose.
#include "query/cull/near_poses.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "every_target.h"

namespace bocst::query {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix4d;
using Eigen::Vector3d;

PoseBoxes someBoxes() {
  PoseBoxes boxes = {{0.1, -0.2, 0.3}, {1, 0.5, -2}, {1, 0.2, 0.4}, {0.3, 2, 0.1}, {0.3, 2, 0.1}, 0, 0.25, 1e-9};
  boxes.radius_sum = Vector3d(boxes.half_a).norm() + Vector3d(boxes.middle_b).norm() + Vector3d(boxes.half_b).norm();
  return boxes;
}

/// By how much an axis parts the boxes at most, or the way between a's middle and b's origin: positive means apart.
double gapOf(const PoseBoxes& boxes, const Matrix4d& X) {
  const Matrix3d R = X.topLeftCorner<3, 3>();
  const Vector3d way = R * Vector3d(boxes.middle_b) + X.topRightCorner<3, 1>() - Vector3d(boxes.middle_a);
  double gap = (X.topRightCorner<3, 1>() - Vector3d(boxes.middle_a)).norm() - boxes.radius_sum - boxes.allowed;
  for (int k = 0; k < 6; ++k) {
    const Vector3d axis = k < 3 ? Vector3d(Matrix3d::Identity().col(k)) : Vector3d(R.col(k - 3));
    const double reach =
        axis.cwiseAbs().dot(Vector3d(boxes.half_a)) + (R.transpose() * axis).cwiseAbs().dot(Vector3d(boxes.half_b));
    gap = std::max(gap, std::abs(way.dot(axis)) - reach - boxes.allowed);
  }
  return gap;
}

template <typename S>
std::vector<std::uint32_t> nearOf(const PoseBoxes& boxes, const std::vector<Matrix4d>& poses, bool rows) {
  std::vector<S> numbers;
  for (const Matrix4d& X : poses) {
    for (int k = 0; k < 16; ++k) numbers.push_back(static_cast<S>(rows ? X(k / 4, k % 4) : X(k % 4, k / 4)));
  }
  std::vector<std::uint32_t> near(poses.size());
  near.resize(findNearPoses(boxes, numbers.data(), rows, poses.size(), near.data()));
  return near;
}

class NearPoses : public test::EveryTarget {};

TEST_P(NearPoses, AreThoseWhoseBoxesAreNot) {
  const PoseBoxes boxes = someBoxes();
  std::mt19937_64 g(1);
  std::normal_distribution<double> n;
  std::uniform_real_distribution<double> u(-3, 3);
  std::size_t found = 0, all = 0;
  for (std::size_t count = 0; count < 150; ++count) {
    std::vector<Matrix4d> poses(count, Matrix4d::Identity());
    std::vector<std::uint32_t> expected;
    for (Matrix4d& X : poses) {
      do {
        X.topLeftCorner<3, 3>() = Eigen::Quaterniond(n(g), n(g), n(g), n(g)).normalized().toRotationMatrix();
        X.topRightCorner<3, 1>() = Vector3d(u(g), u(g), u(g));
      } while (std::abs(gapOf(boxes, X)) < 1e-5);  // what float's rounding would decide
      if (gapOf(boxes, X) < 0) expected.push_back(static_cast<std::uint32_t>(&X - poses.data()));
    }
    for (const bool rows : {false, true}) {
      ASSERT_EQ(nearOf<double>(boxes, poses, rows), expected) << count << rows;
      ASSERT_EQ(nearOf<float>(boxes, poses, rows), expected) << count << rows;
    }
    found += expected.size();
    all += count;
  }
  EXPECT_GT(found, all / 10);
  EXPECT_LT(found, all * 9 / 10);
}

TEST_P(NearPoses, AreAllThatAreNoPoses) {
  const PoseBoxes boxes = someBoxes();
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
  Matrix4d far = Matrix4d::Identity();
  far.topRightCorner<3, 1>().setConstant(100);
  ASSERT_TRUE(nearOf<double>(boxes, std::vector<Matrix4d>(9, far), true).empty());
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) {
      for (const double wrong : {nan, infinity, -infinity, 0.5}) {
        if (i < 3 && j == 3 && wrong == 0.5) continue;
        for (std::size_t k = 0; k < 9; ++k) {
          std::vector<Matrix4d> poses(9, far);
          poses[k](i, j) = wrong;
          for (const bool rows : {false, true}) {
            const std::vector<std::uint32_t> expected{static_cast<std::uint32_t>(k)};
            ASSERT_EQ(nearOf<double>(boxes, poses, rows), expected) << i << j << " " << wrong;
            ASSERT_EQ(nearOf<float>(boxes, poses, rows), expected) << i << j << " " << wrong;
          }
        }
      }
    }
  }
  Matrix4d reflection = far;
  reflection(1, 1) = -1;
  EXPECT_EQ(nearOf<double>(boxes, {far, reflection}, true), std::vector<std::uint32_t>{1});
}

// Rotations with ever larger errors: what is settled is off by no more than a pose may be.
TEST_P(NearPoses, AreThoseThatAreHardlyRigid) {
  const PoseBoxes boxes = someBoxes();
  std::mt19937_64 g(2);
  std::normal_distribution<double> n;
  std::uniform_real_distribution<double> u(-1, 1), size(-6, 0.5);
  std::size_t settled = 0, refused = 0;
  for (int round = 0; round < 20000; ++round) {
    Matrix4d X = Matrix4d::Identity();
    const Matrix3d error = std::pow(10, size(g)) * Matrix3d::NullaryExpr([&] { return u(g); });
    const Matrix3d R = Eigen::Quaterniond(n(g), n(g), n(g), n(g)).normalized() * Matrix3d(Matrix3d::Identity() + error);
    X.topLeftCorner<3, 3>() = R;
    X.topRightCorner<3, 1>().setConstant(100);
    const bool near = !nearOf<double>(boxes, {X}, round % 2 == 0).empty();
    if (!near) {
      ASSERT_LE((R.transpose() * R - Matrix3d::Identity()).cwiseAbs().maxCoeff(), 3e-4);
    }
    (near ? refused : settled)++;
  }
  EXPECT_GT(settled, 3000u);
  EXPECT_GT(refused, 3000u);
}

INSTANTIATE_TEST_SUITE_P(Targets, NearPoses, testing::ValuesIn(test::EveryTarget::targets()), test::EveryTarget::name);

}  // namespace
}  // namespace bocst::query
