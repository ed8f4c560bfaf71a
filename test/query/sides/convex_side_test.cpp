// SPDX-License-Identifier: BSD-3-Clause
// Bodies against boxes along one line, and gaps one after the other: against the gap of the corners.
#include "query/sides/convex_side.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include "meshes.h"

namespace bocst::query {
namespace {

using Eigen::Vector3d;

constexpr double kFar = std::numeric_limits<double>::infinity();

struct Body {
  std::shared_ptr<const ConvexShape> shape;
  bool is_ball;
};

std::vector<Body> bodies() {
  return {{std::make_shared<CapsuleShape>(0.6, 0), true},
          {std::make_shared<CapsuleShape>(0.2, 1.8), false},
          {std::make_shared<BoxShape>(Vector3d(0.7, 0.4, 1.1)), false},
          {std::make_shared<RoundShape>(0.6, 0.6, 0.2), false},
          {std::make_shared<RoundShape>(0.03, 0.03, 2), false},
          {std::make_shared<RoundShape>(0.8, 0, 1), false},
          {std::make_shared<EllipsoidShape>(Vector3d(0.5, 1.2, 0.8)), false},
          {std::make_shared<HalfspaceShape>(Vector3d(1, 2, -2) / 3, 0.25, Sphere{Vector3d::Zero(), 50}), false}};
}

struct Placed {
  OrientedVolume box;
  SimilarityTransform to;
  Vector3d corners[8];
};

Placed randomBox(std::mt19937_64& g) {
  std::uniform_real_distribution<double> u(-1, 1);
  Placed p;
  p.to.rotation = test::randomRotation(g);
  p.to.scale = std::pow(10.0, 2 * u(g));
  p.to.translation = 2 * Vector3d(u(g), u(g), u(g));
  p.to.ready();
  p.box.axes = test::randomRotation(g);
  p.box.center = Vector3d(u(g), u(g), u(g)) / p.to.scale;
  for (int k = 0; k < 3; ++k) p.box.half[k] = std::pow(10.0, 1.5 * u(g) - 1) / p.to.scale;
  cornersOf(p.box, p.to, p.corners);
  return p;
}

TEST(ConvexSide, GapsOnALineAreNoMoreThanTheGap) {
  std::mt19937_64 g(1);
  for (const Body& body : bodies()) {
    const ConvexSide side(*body.shape);
    int apart = 0, found = 0;
    for (int i = 0; i < 2000; ++i) {
      const Placed p = randomBox(g);
      const SeparationResult gap = side.gap(0, {p.corners, 8}, kFar);
      const double on_line = gapOnLine(side, 0, p.box, p.to);
      ASSERT_LE(on_line, gap.distance + 1e-12) << i;
      if (gap.isTouching()) continue;
      if (body.is_ball) {
        ASSERT_NEAR(on_line, gap.distance, 1e-9) << i;
      }
      ++apart;
      found += on_line > 0.5 * gap.distance;
    }
    EXPECT_GT(apart, 300);
    // No line but the normal bounds a half-space.
    if (body.shape->point()) {
      EXPECT_GT(found, apart / 2) << "it is worth little";
    }
  }
}

TEST(ConvexSide, FromWithinThereIsNoLine) {
  const CapsuleShape ball(0.5, 0);
  OrientedVolume box;
  box.center = Vector3d::Zero();
  box.half = Vector3d::Constant(2);
  SimilarityTransform to;
  to.ready();
  EXPECT_LE(gapOnLine(ConvexSide(ball), 0, box, to), 0);
}

TEST(GapFinder, RefusesOnlyWhatIsFarther) {
  std::mt19937_64 g(2);
  std::uniform_real_distribution<double> u(-1, 1);
  for (const Body& body : bodies()) {
    const ConvexSide side(*body.shape);
    GapFinder gaps;
    int refused = 0, near = 0;
    for (int i = 0; i < 2000; ++i) {
      const Vector3d at = 2 * Vector3d(u(g), u(g), u(g));
      Vector3d t[3];
      for (Vector3d& x : t) x = at + 0.3 * Vector3d(u(g), u(g), u(g));
      const double cutoff = 0.5 * (1 + u(g));
      const SeparationResult truth = side.gap(0, {t, 3}, kFar), gap = gaps.gap(side, 0, {t, 3}, cutoff);
      ASSERT_LE(gap.at_least, truth.distance) << i;
      if (gap.at_least > cutoff) {
        ++refused;
      } else {
        ASSERT_EQ(gap.distance, truth.distance) << i << ": what is found does not depend on what was asked before";
        ASSERT_EQ(gap.on_points, truth.on_points) << i;
        ++near;
      }
    }
    EXPECT_GT(refused, 100);
    EXPECT_GT(near, 100);
  }
}

}  // namespace
}  // namespace bocst::query
