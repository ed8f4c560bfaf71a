// SPDX-License-Identifier: BSD-3-Clause
// Rows of poses, on each instruction set, against one pose at a time.
#include "scene/pose_rows.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "conformance/reference.h"
#include "every_target.h"
#include "fcl/adapters/validate.h"
#include "scene/bounds.h"
#include "scene/reach.h"

namespace bocst::scene {
namespace {

constexpr std::size_t kMostMoving = 11;

struct PoseRows : test::EveryTarget {
  std::mt19937_64 g{7};
  std::uniform_real_distribution<double> u{-1, 1};

  Eigen::Vector3d vector(double size) { return {size * u(g), size * u(g), size * u(g)}; }

  // No more than its first three rows are a pose's.
  template <typename S>
  fcl::Transform3<S> pose(double size) {
    auto X = test::pose<S>(test::randomRotation(g), vector(size));
    X.matrix().row(3).setConstant(std::numeric_limits<S>::quiet_NaN());
    return X;
  }

  template <typename S>
  std::vector<fcl::Transform3<S>> states(std::size_t count, std::size_t moving) {
    std::vector<fcl::Transform3<S>> all;
    for (std::size_t k = 0; k < count * moving; ++k) all.push_back(pose<S>(2));
    return all;
  }

  std::vector<Bounds> someBounds(std::size_t moving) {
    std::vector<Bounds> all(moving);
    for (Bounds& b : all) {
      b.center = vector(0.5);
      b.axes = test::randomRotation(g);
      b.half = vector(0.3).cwiseAbs();
      b.reach = 0.01 * std::abs(u(g));
      b.radius = b.half.norm();
      b.size = b.radius + b.center.norm();
    }
    return all;
  }

  template <typename S>
  void findsTheFirstThatIsNotRigid() {
    for (std::size_t moving = 1; moving <= kMostMoving; ++moving) {
      const std::size_t count = 6;
      auto X = states<S>(count, moving);
      std::vector<double> deviations(roomFor(moving), 0);
      EXPECT_EQ(rigidStates(X[0].matrix().data(), count, moving, deviations.data()), count);
      const S nan = std::numeric_limits<S>::quiet_NaN(), infinite = std::numeric_limits<S>::infinity();
      for (const std::size_t bad : {std::size_t{0}, moving / 2, moving - 1}) {
        for (int way = 0; way < 6; ++way) {
          auto Y = X;
          fcl::Transform3<S>& Z = Y[4 * moving + bad];
          if (way == 0) Z.linear() *= S(1.001);
          if (way == 1) Z.linear().col(1) *= S(-1);
          if (way == 2) Z.linear()(2, 0) += S(0.01);
          if (way == 3) Z.translation().z() = nan;
          if (way == 4) Z.translation().y() = infinite;
          if (way == 5) Z.linear().setZero();
          EXPECT_EQ(rigidStates(Y[0].matrix().data(), count, moving, deviations.data()), 4u) << way;
        }
      }
    }
  }

  template <typename S>
  void deviationsAreEachObjectsOwn() {
    for (std::size_t moving = 1; moving <= kMostMoving; ++moving) {
      const std::size_t count = 5;
      auto X = states<S>(count, moving);
      for (std::size_t i = 0; i < moving; ++i) X[3 * moving + i].linear() *= S(1 + 1e-7 * static_cast<double>(i + 1));
      std::vector<double> deviations(roomFor(moving), 0), expected(moving, 0);
      ASSERT_EQ(rigidStates(X[0].matrix().data(), count, moving, deviations.data()), count);
      for (std::size_t k = 0; k < X.size(); ++k) {
        const S* m = X[k].matrix().data();
        const auto sums = fcl_adapter::rigidSumsOf<double>([m](int j) { return static_cast<double>(m[j]); });
        double& most = expected[k % moving];
        most = std::max(most, std::abs(sums.shear) + sums.stretch * sums.stretch / 4);
      }
      for (std::size_t i = 0; i < moving; ++i) EXPECT_NEAR(deviations[i], expected[i], 4e-15) << i << " of " << moving;
    }
  }

  template <typename S>
  void noPointMovesFartherThanThePath() {
    for (std::size_t moving = 1; moving <= kMostMoving; ++moving) {
      const std::size_t count = 7, room = roomFor(moving);
      const std::vector<Bounds> bounds = someBounds(moving);
      const auto X = states<S>(count, moving);
      std::vector<double> path(room * count), place(room);
      measurePaths(X[0].matrix().data(), count, rowsOf(bounds), path.data(), place.data());
      for (std::size_t i = 0; i < moving; ++i) {
        const auto at = [&](std::size_t k, const Eigen::Vector3d& p) -> Eigen::Vector3d {
          return X[k * moving + i].linear().template cast<double>() * p +
                 X[k * moving + i].translation().template cast<double>();
        };
        double farthest = 0, longest = 0;
        EXPECT_EQ(path[i], 0);
        for (std::size_t k = 0; k < count; ++k) {
          farthest = std::max(farthest, X[k * moving + i].translation().template cast<double>().template lpNorm<1>());
          const double step = k == 0 ? 0 : path[k * room + i] - path[(k - 1) * room + i];
          for (int n = 0; n < 20 && k > 0; ++n) {
            const Eigen::Vector3d p = bounds[i].center + bounds[i].radius * vector(1).normalized();
            const double way = (at(k, p) - at(k - 1, p)).norm();
            EXPECT_LE(way, step * (1 + 1e-9));
            longest = std::max(longest, way / step);
          }
        }
        EXPECT_NEAR(place[i], farthest, 1e-12);
        EXPECT_GT(longest, 0.4) << "a bound, but a useful one";
      }
    }
  }

  template <typename S>
  void boxesHoldTheirObjects() {
    for (std::size_t moving = 1; moving <= kMostMoving; ++moving) {
      for (int turn = 0; turn < 8; ++turn) {
        std::vector<Bounds> bounds = someBounds(moving);
        auto X = states<S>(1, moving);
        std::vector<double> errors(roomFor(moving), 1e-9), reach(roomFor(moving), 0);
        const std::size_t odd = static_cast<std::size_t>(turn) % moving;
        if (turn == 1) bounds[odd].kind = Bounds::kNowhere;
        if (turn == 2) X[odd].translation().x() = S(3e12);
        if (turn == 3) errors[odd] = 2 * kFineError;
        if (turn == 4) reach[odd] = 0.25;
        const bool is_other = turn >= 1 && turn <= 3;
        const Eigen::Vector3d origin = vector(3);
        std::vector<BoxGroup> groups((moving + 7) / 8 + 1);
        std::vector<std::uint32_t> others(moving);
        const std::size_t count = placeBoxes(X[0].matrix().data(), rowsOf(bounds),
                                             {errors.data(), reach.data(), {origin[0], origin[1], origin[2]}, 2},
                                             groups.data(), others.data());
        ASSERT_EQ(count, is_other ? 1u : 0u) << turn;
        if (is_other) {
          EXPECT_EQ(others[0], odd);
        }
        for (std::size_t i = 0; i < moving; ++i) {
          if (is_other && i == odd) continue;
          const BoxGroup& b = groups[i / 8];
          const std::size_t l = i % 8;
          if (turn == 4 && i == odd) {
            EXPECT_FLOAT_EQ(b.reach[l], 0.25f);
          }
          EXPECT_GT(static_cast<double>(b.reach[l]), bounds[i].reach);
          EXPECT_LT(static_cast<double>(b.reach[l]), turn == 4 && i == odd ? 0.26 : bounds[i].reach + 3e-3);
          for (int corner = 0; corner < 8; ++corner) {
            const Eigen::Vector3d sign(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
            const Eigen::Vector3d p = bounds[i].center + bounds[i].axes * sign.cwiseProduct(bounds[i].half);
            const Eigen::Vector3d at =
                X[i].linear().template cast<double>() * p + X[i].translation().template cast<double>() - origin;
            Eigen::Vector3d from_center;
            for (int k = 0; k < 3; ++k) {
              EXPECT_GE(at[k], static_cast<double>(b.lo[k][l]));
              EXPECT_LE(at[k], static_cast<double>(b.hi[k][l]));
              from_center[k] = at[k] - static_cast<double>(b.center[k][l]);
            }
            // The corner of the oriented box, too.
            for (int k = 0; k < 3; ++k) {
              const Eigen::Vector3d axis(b.axis[k][0][l], b.axis[k][1][l], b.axis[k][2][l]);
              EXPECT_NEAR(axis.dot(from_center), sign[k] * static_cast<double>(b.half[k][l]), 2e-6);
            }
          }
        }
        const BoxGroup& next = groups.back();
        EXPECT_TRUE(std::isinf(next.lo[0][0])) << "groups of no object are left alone";
      }
    }
  }
};

TEST_P(PoseRows, FindTheFirstThatIsNotRigid) {
  findsTheFirstThatIsNotRigid<float>();
  findsTheFirstThatIsNotRigid<double>();
}

TEST_P(PoseRows, DeviationsAreEachObjectsOwn) {
  deviationsAreEachObjectsOwn<float>();
  deviationsAreEachObjectsOwn<double>();
}

TEST_P(PoseRows, NoPointMovesFartherThanThePath) {
  noPointMovesFartherThanThePath<float>();
  noPointMovesFartherThanThePath<double>();
}

TEST_P(PoseRows, BoxesHoldTheirObjects) {
  boxesHoldTheirObjects<float>();
  boxesHoldTheirObjects<double>();
}

INSTANTIATE_TEST_SUITE_P(Targets, PoseRows, testing::ValuesIn(test::EveryTarget::targets()), test::EveryTarget::name);

}  // namespace
}  // namespace bocst::scene
