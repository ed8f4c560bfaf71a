// SPDX-License-Identifier: BSD-3-Clause
// Pairs of long and thin meshes, whose triangles are as long as they are: the contacts are FCL's, whatever is resident.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <random>
#include <vector>

#include "conformance/reference.h"
#include "thread_group.h"

namespace bocst {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using test::Pairs;
using test::Raw;

using Random = std::mt19937_64;
double uniform(Random& g, double lo, double hi) { return std::uniform_real_distribution<double>(lo, hi)(g); }
Matrix3d rotation(Random& g) {
  return Eigen::Quaterniond(uniform(g, -1, 1), uniform(g, -1, 1), uniform(g, -1, 1), uniform(g, -1, 1))
      .normalized()
      .matrix();
}

// The side of a cylinder of length 1 whose triangles run from end to end.
Raw rod(double radius, std::size_t sides) {
  Raw raw;
  for (std::size_t i = 0; i <= 1; ++i) {
    for (std::size_t j = 0; j < sides; ++j) {
      const double angle = 2 * std::acos(-1.0) * static_cast<double>(j) / static_cast<double>(sides);
      raw.vertices.emplace_back(i == 0 ? -0.5 : 0.5, radius * std::cos(angle), radius * std::sin(angle));
    }
  }
  for (std::size_t j = 0; j < sides; ++j) {
    const std::size_t k = (j + 1) % sides;
    raw.triangles.emplace_back(j, sides + j, k);
    raw.triangles.emplace_back(k, sides + j, sides + k);
  }
  return raw;
}

// Frames of B in A's: crossed, side by side, at an angle; from overlap to apart.
std::vector<fcl::Transform3d> poses(Random& g, double radius) {
  std::vector<fcl::Transform3d> all;
  for (const double angle : {0.0, 1e-4, 0.3, 1.5707963}) {
    for (const double gap : {0.5, 1.5, 1.98, 2.02, 2.5, 30.0}) {
      fcl::Transform3d X = fcl::Transform3d::Identity();
      X.linear() =
          (Eigen::AngleAxisd(angle, Vector3d::UnitZ()) * Eigen::AngleAxisd(uniform(g, 0, 6), Vector3d::UnitX()))
              .matrix();
      X.translation() =
          Vector3d(uniform(g, -0.2, 0.2), angle < 1e-3 ? gap * radius : 0, angle < 1e-3 ? 0 : gap * radius);
      all.push_back(X);
    }
  }
  return all;
}

TEST(Needles, ContactsAreFcls) {
  Random g(1);
  std::size_t hits = 0, misses = 0;
  for (const double radius : {2e-4, 1e-4, 5e-6, 1e-7}) {
    for (const bool turned : {false, true}) {
      // Turned in its own frame, a rod has a box along the axes that is not thin.
      const Matrix3d own = turned ? rotation(g) : Matrix3d(Matrix3d::Identity());
      Raw raw_a = rod(radius, 24), raw_b = rod(radius, 17);
      for (Vector3d& v : raw_a.vertices) v = own * v;
      for (Vector3d& v : raw_b.vertices) v = own * v;
      const auto bvh_a = test::bvh<fcl::OBBRSSd>(raw_a), bvh_b = test::bvh<fcl::OBBRSSd>(raw_b);
      const Modeld a(raw_a.mesh()), b(raw_b.mesh());
      for (const fcl::Transform3d& X_AB : poses(g, radius)) {
        const Matrix3d R = rotation(g);
        const Vector3d p(uniform(g, -2, 2), uniform(g, -2, 2), uniform(g, -2, 2));
        const fcl::Transform3d X = test::pose<double>(R, p), Y = X * test::pose<double>(own, {0, 0, 0}) * X_AB *
                                                                 test::pose<double>(own.transpose(), {0, 0, 0});
        SCOPED_TRACE(testing::Message() << radius << (turned ? " turned " : " ") << X_AB.translation().transpose()
                                        << "\n"
                                        << X_AB.linear());
        const Pairs expected = test::pairs<double>(*bvh_a, X, *bvh_b, Y);
        ASSERT_EQ(test::pairs<double>(a, X, b, Y), expected);
        Pairs swapped;
        for (const auto& [of_b, of_a] : test::pairs<double>(b, Y, a, X)) swapped.insert({of_a, of_b});
        ASSERT_EQ(swapped, expected);
        ASSERT_EQ(test::touching<double>(a, X, b, Y), !expected.empty());
        ++(expected.empty() ? misses : hits);
      }
    }
  }
  EXPECT_GT(hits, 40u);
  EXPECT_GT(misses, 40u);
}

// Few contacts are some of all, the same with and without boxes.
TEST(Needles, FewContactsAreSomeOfAll) {
  Random g(2);
  const Raw raw = rod(5e-6, 20);
  Options small;
  small.memory_budget = 4000;  // too little for boxes
  const Modeld a(raw.mesh()), b(raw.mesh()), small_a(raw.mesh(), small), small_b(raw.mesh(), small);
  const auto ask = [](const Modeld& one, const Modeld& two, const fcl::Transform3d& X, std::size_t most) {
    const fcl::CollisionRequestd request(most, true);
    fcl::CollisionResultd result;
    fcl::collide(&one, fcl::Transform3d::Identity(), &two, X, request, result);
    std::vector<fcl::Contactd> contacts;
    result.getContacts(contacts);
    return contacts;
  };
  for (const fcl::Transform3d& X : poses(g, 5e-6)) {
    const auto all = ask(a, b, X, 100000);
    for (const std::size_t most : {1, 3, 100000}) {
      const auto some = ask(a, b, X, most), same = ask(small_a, small_b, X, most);
      ASSERT_EQ(some.size(), std::min(most, all.size()));
      ASSERT_EQ(same.size(), some.size());
      auto next = all.begin();
      for (std::size_t i = 0; i < some.size(); ++i) {
        EXPECT_EQ(some[i].b1, same[i].b1);
        EXPECT_EQ(some[i].b2, same[i].b2);
        next = std::find_if(next, all.end(), [&](const auto& c) { return c.b1 == some[i].b1 && c.b2 == some[i].b2; });
        ASSERT_NE(next, all.end());
        EXPECT_EQ(some[i].penetration_depth, next->penetration_depth);
        EXPECT_EQ(some[i].pos, next->pos);
      }
    }
  }
}

TEST(Needles, MarginsAndFloat) {
  Random g(3);
  const double radius = 5e-6;
  const Raw raw = rod(radius, 9);
  Options wide;
  wide.margin = 3e-6;
  const Modeld a(raw.mesh(), wide), b(raw.mesh());
  const Modelf fa(raw.mesh()), fb(raw.mesh());
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  for (const fcl::Transform3d& X : poses(g, radius)) {
    const double distance = test::distance<double>(a, I, b, X);
    EXPECT_EQ(test::touching<double>(a, I, b, X), distance <= wide.margin) << distance;
    EXPECT_EQ(test::touching<double>(b, X, a, I), distance <= wide.margin);
    const fcl::Transform3f Xf = test::pose<float>(X.linear(), X.translation()), If = fcl::Transform3f::Identity();
    const Pairs pairs = test::pairs<float>(fa, If, fb, Xf);
    Pairs swapped;
    for (const auto& [of_b, of_a] : test::pairs<float>(fb, Xf, fa, If)) swapped.insert({of_a, of_b});
    EXPECT_EQ(pairs.empty(), !test::touching<float>(fa, If, fb, Xf));
    EXPECT_EQ(pairs.empty(), swapped.empty());
    // Beyond what float coordinates of length 1 are off by.
    if (distance > 1e-4) {
      EXPECT_TRUE(pairs.empty());
    } else if (distance == 0) {
      EXPECT_FALSE(pairs.empty());
    }
  }
}

TEST(Needles, BoxesComeAndGo) {
  const Raw raw = rod(5e-6, 40);
  Options options;
  options.ttl = std::chrono::seconds(10);
  Clock::time_point now{std::chrono::hours(1)};
  options.clock = [&now] { return now; };
  Modeld a(raw.mesh(), options);
  const Modeld b(raw.mesh());
  const fcl::Transform3d I = fcl::Transform3d::Identity(), X = test::pose<double>(Matrix3d::Identity(), {0.1, 7e-6, 0});
  const std::size_t before = a.statistics().resident_bytes;
  const auto isThere = [&] { return a.statistics().resident_bytes > before; };
  ASSERT_TRUE(test::touching<double>(a, I, b, X));
  EXPECT_TRUE(isThere());
  a.prune(now + std::chrono::seconds(9));
  EXPECT_TRUE(isThere());
  a.prune(now + std::chrono::seconds(11));
  EXPECT_FALSE(isThere());
  // A query drops them, too, at its end.
  ASSERT_TRUE(test::touching<double>(a, I, b, X));
  now += std::chrono::seconds(20);
  const Modeld ball(test::torus(8).mesh());
  ASSERT_FALSE(test::touching<double>(a, I, ball, test::pose<double>(Matrix3d::Identity(), {3, 0, 0})));
  EXPECT_FALSE(isThere());
  ASSERT_TRUE(test::touching<double>(a, I, b, X));
  std::vector<Vector3d> moved = raw.vertices;
  for (Vector3d& v : moved) v.y() += 1;
  a.updateVertices(moved);
  EXPECT_FALSE(isThere());
  EXPECT_FALSE(test::touching<double>(a, I, b, X));
  EXPECT_TRUE(test::touching<double>(a, test::pose<double>(Matrix3d::Identity(), {0, -1, 0}), b, X));
}

TEST(Needles, ThreadsBuildOnce) {
  const Raw raw = rod(5e-6, 60);
  for (int round = 0; round < 10; ++round) {
    Modeld a(raw.mesh()), b(raw.mesh());
    std::atomic<int> wrong{0};
    test::ThreadGroup(8, [&](std::size_t t) {
      for (int k = 0; k < 20; ++k) {
        const bool near = (t + k) % 2 == 0;
        const fcl::Transform3d X = test::pose<double>(Matrix3d::Identity(), {0.1, near ? 9e-6 : 1.1e-5, 0});
        wrong += test::touching<double>(a, fcl::Transform3d::Identity(), b, X) != near;
        if (t == 0) a.prune(Clock::now() + std::chrono::hours(1));
      }
    });
    EXPECT_EQ(wrong, 0);
  }
}

// A mesh so much larger than its details that these share a unit of its lattice: a part on the ground, or beside one
// triangle far away.
TEST(FineDetails, OfALargeMeshAreFoundByOrientedBoxes) {
  const Raw part = test::torus(16);
  for (const double far : {1e4, 1e6}) {
    for (const bool is_ground : {true, false}) {
      SCOPED_TRACE(testing::Message() << far << (is_ground ? " ground" : " outlier"));
      Raw raw = part;
      const std::size_t n = raw.vertices.size();
      if (is_ground) {
        for (const double x : {-far, far}) {
          for (const double y : {-far, far}) raw.vertices.emplace_back(x, y, -0.25);
        }
        raw.triangles.emplace_back(n, n + 1, n + 2);
        raw.triangles.emplace_back(n + 1, n + 3, n + 2);
      } else {
        for (const double x : {0.0, 1.0, 2.0}) raw.vertices.emplace_back(far, x, x * x);
        raw.triangles.emplace_back(n, n + 1, n + 2);
      }
      const auto bvh = test::bvh<fcl::OBBRSSd>(raw), bvh_of_part = test::bvh<fcl::OBBRSSd>(part);
      const Modeld a(raw.mesh()), b(part.mesh());
      Random g(4);
      std::size_t hits = 0, misses = 0;
      for (int i = 0; i < 60; ++i) {
        const fcl::Transform3d I = fcl::Transform3d::Identity(),
                               X = test::pose<double>(rotation(g), {uniform(g, -2, 2), uniform(g, -2, 2), 1});
        const Pairs expected = test::pairs<double>(*bvh, I, *bvh_of_part, X);
        ASSERT_EQ(test::touching<double>(a, I, b, X), !expected.empty());
        ASSERT_EQ(test::touching<double>(b, X, a, I), !expected.empty());
        ASSERT_EQ(test::pairs<double>(a, I, b, X), expected);
        fcl::DistanceResultd nearest;
        fcl::distance(bvh.get(), I, bvh_of_part.get(), X, fcl::DistanceRequestd(), nearest);
        const double distance = expected.empty() ? nearest.min_distance : 0;
        for (const double share : {0.9, 1.1}) {
          if (distance < 1e-3) continue;
          ASSERT_EQ(isCloserThan<double>(&a, I, &b, X, share * distance), share > 1);
        }
        ++(expected.empty() ? misses : hits);
      }
      EXPECT_GT(hits, 5u);
      EXPECT_GT(misses, 5u);
      EXPECT_GT(a.statistics().resident_bytes, 100 * raw.triangles.size()) << "the boxes";
    }
  }
}

}  // namespace
}  // namespace bocst
