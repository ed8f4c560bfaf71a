// SPDX-License-Identifier: BSD-3-Clause
// Times of contact against brute-force sampling, against what can be computed by hand, and against FCL's motions.
#include <fcl/math/motion/interp_motion.h>
#include <fcl/math/motion/screw_motion.h>
#include <fcl/math/motion/spline_motion.h>
#include <fcl/math/motion/translation_motion.h>
#include <gtest/gtest.h>

#include "conformance/octrees.h"
#include "conformance/reference.h"
#include "conformance/shapes.h"
#include "fcl/adapters/motion.h"

namespace bocst {
namespace {

using fcl_adapter::motionOf;
using fcl_adapter::poseAt;
using test::Raw;

/// Shapes and cells that are no farther apart may be said to touch, for FCL's solvers may say so at half of it.
constexpr double kFclTolerance = 2e-6;

constexpr fcl::CCDMotionType kTypes[] = {fcl::CCDM_TRANS, fcl::CCDM_LINEAR, fcl::CCDM_SCREW, fcl::CCDM_SPLINE};

template <typename S>
fcl::Transform3<S> identity() {
  return fcl::Transform3<S>::Identity();
}

fcl::Transform3d currentPose(const fcl::MotionBase<double>& m) {
  fcl::Transform3d X;
  m.getCurrentTransform(X);
  return X;
}

// Motions.

fcl::Transform3d randomPose(std::mt19937_64& g, double reach) {
  return test::pose<double>(test::randomRotation(g), test::randomDirection(g) * reach);
}

TEST(Motions, GoWhereFclsGo) {
  std::mt19937_64 g(1);
  for (int round = 0; round < 50; ++round) {
    const fcl::Transform3d X = randomPose(g, 2), Y = randomPose(g, 3);
    const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
    const fcl::TranslationMotion<double> translation(X, Y);
    const fcl::InterpMotion<double> interp(X.linear(), X.translation(), Y.linear(), Y.translation(), zero);
    const fcl::ScrewMotion<double> screw(X, Y);
    const std::pair<const fcl::MotionBase<double>*, fcl::CCDMotionType> all[] = {
        {&translation, fcl::CCDM_TRANS}, {&interp, fcl::CCDM_LINEAR}, {&screw, fcl::CCDM_SCREW}};
    for (const auto& [theirs, type] : all) {
      const auto ours = motionOf<double>(X, Y, type);
      for (const double t : {0.0, 0.1, 0.5, 0.9, 1.0}) {
        theirs->integrate(t);
        ASSERT_LT((ours->at(t).matrix() - currentPose(*theirs).matrix()).cwiseAbs().maxCoeff(), 1e-10)
            << type << ' ' << t;
      }
    }
    const auto spline = motionOf<double>(X, Y, fcl::CCDM_SPLINE);
    EXPECT_LT((spline->at(0).matrix() - X.matrix()).cwiseAbs().maxCoeff(), 1e-12);
    EXPECT_LT((spline->at(1).matrix() - Y.matrix()).cwiseAbs().maxCoeff(), 1e-12);
  }
}

// The axis of a screw with a small turn is far away; its poses are as good as any.
TEST(Motions, ScrewsWithSmallTurns) {
  std::mt19937_64 g(12);
  for (const double angle : {1e-3, 1e-6, 1e-9, 1e-12, 1e-15, 0.0}) {
    const Eigen::Vector3d axis = test::randomDirection(g);
    const fcl::Transform3d X = randomPose(g, 2);
    fcl::Transform3d Y = X;
    Y.linear() = Eigen::AngleAxisd(angle, axis).toRotationMatrix() * X.linear();
    Y.translation() += 3 * test::randomDirection(g);
    const auto screw = motionOf<double>(X, Y, fcl::CCDM_SCREW);
    EXPECT_EQ(screw->at(0).matrix(), X.matrix());
    // The angle itself is known only as well as the poses are.
    EXPECT_LT((screw->at(1).matrix() - Y.matrix()).cwiseAbs().maxCoeff(), 1e-12) << angle;
    const Eigen::Vector3d middle = (X.translation() + Y.translation()) / 2;
    EXPECT_LT((screw->at(0.5).translation() - middle).norm(), angle + 1e-12) << angle;
  }
}

query::SplineMotion::Points randomPoints(std::mt19937_64& g, double size) {
  query::SplineMotion::Points p;
  for (auto& x : p) x = size * test::randomDirection(g);
  return p;
}

TEST(Motions, SplinesGoWhereFclsGo) {
  std::mt19937_64 g(2);
  for (int round = 0; round < 50; ++round) {
    const auto p = randomPoints(g, 3), r = randomPoints(g, 2);
    const fcl::SplineMotion<double> theirs(p[0], p[1], p[2], p[3], r[0], r[1], r[2], r[3]);
    const query::SplineMotion ours(p, r);
    for (const double t : {0.0, 0.3, 1.0}) {
      theirs.integrate(t);
      ASSERT_LT((ours.at(t).matrix() - currentPose(theirs).matrix()).cwiseAbs().maxCoeff(), 1e-12);
    }
  }
}

TEST(Motions, SplinesTurnTheShorterWay) {
  std::mt19937_64 g(14);
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector3d axis = test::randomDirection(g);
    const auto turned = [&](double angle) {
      return test::pose<double>(Eigen::AngleAxisd(angle, axis).toRotationMatrix(), {0, 0, 0});
    };
    // Through half a turn, where the rotation vector changes its sign.
    const auto spline = motionOf<double>(turned(3), turned(-3), fcl::CCDM_SPLINE);
    const double half_turn = std::acos(-1.0);
    EXPECT_LT((spline->at(0.5).matrix() - turned(half_turn).matrix()).cwiseAbs().maxCoeff(), 1e-9);
  }
}

TEST(Motions, NothingIsFasterThanTheyClaim) {
  std::mt19937_64 g(3);
  std::uniform_real_distribution<double> u(0, 1);
  for (int round = 0; round < 400; ++round) {
    std::unique_ptr<query::Motion> m;
    if (round % 5 == 4) {
      m = std::make_unique<query::SplineMotion>(randomPoints(g, 3), randomPoints(g, 4 * u(g)));
    } else {
      m = motionOf<double>(randomPose(g, 1), randomPose(g, 2 * u(g)), kTypes[round % 4]);
    }
    const double time = u(g), radius = u(g);
    const Eigen::Vector3d center = 3 * test::randomDirection(g), direction = test::randomDirection(g);
    const query::ClosingSpeed closing_speed = m->closingSpeed(direction, 0, center, radius, time);
    const double fastest = m->fastest(center, radius, time), reach = 2 * u(g);
    EXPECT_LE(closing_speed.now, closing_speed.ever + 1e-9);
    EXPECT_LE(closing_speed.ever, fastest + 1e-12);
    EXPECT_GE(m->closingSpeed(direction, 0.1, center, radius, time).now, closing_speed.now);
    const Eigen::Isometry3d back = m->at(time).inverse();
    for (int i = 0; i < 60; ++i) {
      const Eigen::Vector3d displacement = test::randomDirection(g), start = center + radius * displacement,
                            point = back * start;
      const double t = time + (1 - time) * u(g), h = std::min(1e-6, 1 - t);
      if (!(h > 1e-9)) continue;
      const Eigen::Vector3d v = (m->at(t + h) * point - m->at(t) * point) / h;
      ASSERT_LE(v.norm(), fastest + 1e-6) << round;
      ASSERT_LE(direction.dot(v), closing_speed.ever + 1e-6) << round;
      ASSERT_LE(direction.dot(v), closing_speed.now + closing_speed.change * (t + h - time) + 1e-6) << round;
      // No point goes so far before the time that a gap needs.
      const double needed = closing_speed.timeFor(reach);
      ASSERT_LE(direction.dot(m->at(std::min(1.0, time + needed)) * point - start), reach + 1e-9);
    }
  }
}

// Times of contact.

template <typename S>
using Result = fcl::ContinuousCollisionResult<S>;

template <typename S>
fcl::ContinuousCollisionRequest<S> request(fcl::CCDMotionType type, double toc_err = 1e-4) {
  fcl::ContinuousCollisionRequest<S> r;
  r.ccd_motion_type = type;
  r.ccd_solver_type = fcl::CCDC_CONSERVATIVE_ADVANCEMENT;
  r.toc_err = static_cast<S>(toc_err);
  return r;
}

/// Two geometries on their ways.
template <typename S>
struct Ways {
  const fcl::CollisionGeometry<S>* o1;
  fcl::Transform3<S> begin1, end1;
  const fcl::CollisionGeometry<S>* o2;
  fcl::Transform3<S> begin2, end2;

  Result<S> ask(const fcl::ContinuousCollisionRequest<S>& r) const {
    Result<S> result;
    const S time = fcl::continuousCollide(o1, begin1, end1, o2, begin2, end2, r, result);
    EXPECT_EQ(time, result.time_of_contact);
    return result;
  }
  Ways swapped() const { return {o2, begin2, end2, o1, begin1, end1}; }
};

/// Checks an answer by many poses on the way, each asked of `a` and `b`, which look like the geometries of `ways`.
template <typename S>
void checkBySampling(const Ways<S>& ways, const fcl::CollisionGeometry<S>& a, const fcl::CollisionGeometry<S>& b,
                     fcl::CCDMotionType type, double toc_err, const Result<S>& result, int samples) {
  const auto m1 = motionOf<S>(ways.begin1, ways.end1, type), m2 = motionOf<S>(ways.begin2, ways.end2, type);
  const auto isHit = [&](double t) { return test::touching<S>(a, poseAt<S>(*m1, t), b, poseAt<S>(*m2, t)); };
  const double toc = static_cast<double>(result.time_of_contact), end = result.is_collide ? toc : 1;
  // Below this, the poses themselves are rounded.
  const double resolution = std::is_same<S, double>::value ? 1e-9 : 1e-4;
  for (int i = 0; i < samples && end > 0; ++i) {
    const double t = i == 0 ? 0 : end * (1 - resolution) * i / (samples - 1);
    ASSERT_FALSE(isHit(t)) << "a contact at " << t << " was stepped over; answer: " << result.is_collide << ' ' << toc;
  }
  if (!result.is_collide) {
    EXPECT_EQ(toc, 1);
    ASSERT_FALSE(isHit(1));
    return;
  }
  // Somewhere in what the answer leaves open, they touch.
  double nearest = std::numeric_limits<double>::infinity();
  const auto look = [&](double t) {
    const auto d = static_cast<double>(test::distance<S>(a, poseAt<S>(*m1, t), b, poseAt<S>(*m2, t)));
    nearest = std::min(nearest, d);
  };
  for (int i = 0; i <= 100; ++i) look(std::min(toc + toc_err * i / 100, 1.0));
  EXPECT_LT(nearest, (std::is_same<S, double>::value ? 1e-7 : 1e-3) + kFclTolerance) << toc;
  const auto X = m1->at(toc).matrix();
  EXPECT_LT((result.contact_tf1.matrix().template cast<double>() - X).cwiseAbs().maxCoeff(), 1e-5);
}

template <typename S>
class Continuous : public testing::Test {};
TYPED_TEST_SUITE(Continuous, test::Scalars);

template <typename S>
Ways<S> randomWays(std::mt19937_64& g, const fcl::CollisionGeometry<S>& a, const fcl::CollisionGeometry<S>& b,
                   double far) {
  std::uniform_real_distribution<double> u(0, 1);
  const Eigen::Vector3d p = test::randomDirection(g), q = test::randomDirection(g);
  Ways<S> w{&a, {}, {}, &b, {}, {}};
  w.begin1 = test::pose<S>(test::randomRotation(g), 0.3 * p);
  w.end1 = test::pose<S>(test::randomRotation(g), 0.5 * q);
  w.begin2 = test::pose<S>(test::randomRotation(g), far * test::randomDirection(g));
  w.end2 = test::pose<S>(test::randomRotation(g), far * u(g) * test::randomDirection(g));
  return w;
}

template <typename S, typename BV>
void checkRandomWays(int rounds) {
  const Raw ra = test::torus(24), rb = test::torus(17, 0.3);
  const auto fa = test::bvh<fcl::OBBRSS<S>>(ra), fb = test::bvh<fcl::OBBRSS<S>>(rb);
  const auto partner = test::bvh<BV>(rb);
  const Model<S> a(ra.mesh()), b(rb.mesh());
  std::mt19937_64 g(4);
  int hits = 0;
  for (int i = 0; i < rounds; ++i) {
    const fcl::CCDMotionType type = kTypes[i % 4];
    Ways<S> ways = randomWays<S>(g, a, b, i % 3 == 0 ? 1.6 : 2.6);
    const Result<S> result = ways.ask(request<S>(type));
    checkBySampling<S>(ways, *fa, *fb, type, 1e-4, result, 60);
    if (testing::Test::HasFatalFailure()) return;
    hits += result.is_collide && result.time_of_contact > 0;
    const auto same = [&](const Result<S>& other) {
      ASSERT_EQ(other.is_collide, result.is_collide);
      ASSERT_NEAR(other.time_of_contact, result.time_of_contact, 2e-4);
    };
    same(ways.swapped().ask(request<S>(type)));
    ways.o2 = partner.get();
    same(ways.ask(request<S>(type)));
    same(ways.swapped().ask(request<S>(type)));
  }
  EXPECT_GE(hits, rounds / 4);
}

TYPED_TEST(Continuous, NothingIsSteppedOverOnRandomWays) { checkRandomWays<TypeParam, fcl::OBBRSS<TypeParam>>(60); }

TYPED_TEST(Continuous, EveryBvhIsAPartner) {
  using S = TypeParam;
  checkRandomWays<S, fcl::AABB<S>>(4);
  checkRandomWays<S, fcl::OBB<S>>(4);
  checkRandomWays<S, fcl::RSS<S>>(4);
  checkRandomWays<S, fcl::kIOS<S>>(4);
  checkRandomWays<S, fcl::KDOP<S, 16>>(4);
  checkRandomWays<S, fcl::KDOP<S, 18>>(4);
  checkRandomWays<S, fcl::KDOP<S, 24>>(4);
}

// A bullet through a plate: sampling at a few times, as FCL's default solver does, misses it.
TYPED_TEST(Continuous, AThinPlateStopsAFastBullet) {
  using S = TypeParam;
  const Raw plate = test::box({-0.001, -1, -1}, {0.001, 1, 1});
  Raw bullet = test::torus(8);
  bullet.scale(0.02);
  const Model<S> a(plate.mesh()), b(bullet.mesh());
  const auto fa = test::bvh<fcl::OBBRSS<S>>(plate), fb = test::bvh<fcl::OBBRSS<S>>(bullet);
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  const auto begin = test::pose<S>(I, {-5, 0.1, 0.2}), end = test::pose<S>(I, {7, 0.1, 0.2});
  const double front = bullet.mesh()->bounds().max().x(), expected = (5 - 0.001 - front) / 12;
  const double rounding = std::is_same<S, double>::value ? 1e-9 : 1e-4;
  for (const auto type : kTypes) {
    for (const auto solver :
         {fcl::CCDC_NAIVE, fcl::CCDC_CONSERVATIVE_ADVANCEMENT, fcl::CCDC_RAY_SHOOTING, fcl::CCDC_POLYNOMIAL_SOLVER}) {
      for (const std::size_t iterations : {std::size_t{1}, std::size_t{10}}) {
        for (const double toc_err : {0.0, 1e-6, 1e-4, 0.01}) {
          auto r = request<S>(type, toc_err);
          r.ccd_solver_type = solver;
          r.num_max_iterations = iterations;
          const Ways<S> ways{&a, identity<S>(), identity<S>(), &b, begin, end};
          for (const Ways<S>& w : {ways, ways.swapped()}) {
            const Result<S> result = w.ask(r);
            ASSERT_TRUE(result.is_collide);
            EXPECT_LE(result.time_of_contact, expected + rounding);
            EXPECT_GE(result.time_of_contact, expected - toc_err - rounding);
          }
        }
      }
    }
  }
  // Beside the plate it flies on.
  const auto beside = test::pose<S>(I, {-5, 1.05, 0.2}), there = test::pose<S>(I, {7, 1.05, 0.2});
  const Result<S> miss = Ways<S>{&a, identity<S>(), identity<S>(), &b, beside, there}.ask(request<S>(fcl::CCDM_LINEAR));
  EXPECT_FALSE(miss.is_collide);
  EXPECT_EQ(miss.time_of_contact, 1);
  EXPECT_TRUE(miss.contact_tf2.isApprox(there));
}

// Far from the origin, float takes what glides past for touching now and then; no such pose may come before the answer.
TEST(ContinuousFloat, WhatGlidesPastWithinRoundingTouches) {
  const Raw plate = test::box({-1, -1, -0.1}, {1, 1, 0}), slider = test::box({-0.2, -0.2, 0}, {0.2, 0.2, 0.3});
  const Modelf a(plate.mesh()), b(slider.mesh());
  const auto fa = test::bvh<fcl::OBBRSSf>(plate), fb = test::bvh<fcl::OBBRSSf>(slider);
  std::mt19937_64 g(13);
  for (int i = 0; i < 12; ++i) {
    const Eigen::Matrix3d R = test::randomRotation(g);
    const Eigen::Vector3d place = 300 * test::randomDirection(g);
    const auto at = [&](double x, double z) { return test::pose<float>(R, place + R * Eigen::Vector3d(x, 0.1, z)); };
    const auto here = test::pose<float>(R, place);
    const double gap = 1e-5 * (i % 4);
    const Ways<float> ways{&a, here, here, &b, at(-3, gap), at(3, gap)};
    checkBySampling<float>(ways, *fa, *fb, fcl::CCDM_TRANS, 1e-4, ways.ask(request<float>(fcl::CCDM_TRANS)), 200);
    if (HasFatalFailure()) return;
  }
}

TEST(ContinuousDouble, FclsMotionsAreTakenAsTheyAre) {
  // A bar about the z axis meets a peg after a known angle, whatever its reference point is.
  const Modeld bar(test::box({0, -0.05, -0.05}, {1, 0.05, 0.05}).mesh());
  const Modeld peg(test::box({-0.05, 0.7, -0.5}, {0.05, 0.9, 0.5}).mesh());
  const fcl::Transform3d I = identity<double>();
  const auto quarter = test::pose<double>(Eigen::AngleAxisd(3, Eigen::Vector3d::UnitZ()).toRotationMatrix(), {0, 0, 0});
  const fcl::TranslationMotion<double> still(I, I);
  // The bar's upper face, at a distance of 0.05 from the axis, meets the peg's corner (0.05, 0.9) or (0.05, 0.7).
  const auto angleOf = [](double x, double y) { return std::atan2(y, x) - std::asin(0.05 / std::hypot(x, y)); };
  const double expected = std::min(angleOf(0.05, 0.7), angleOf(0.05, 0.9)) / 3;

  const fcl::InterpMotion<double> about_origin(I.linear(), I.translation(), quarter.linear(), quarter.translation(),
                                               Eigen::Vector3d::Zero());
  const fcl::ScrewMotion<double> screw(I, quarter);
  const Eigen::Vector3d o = Eigen::Vector3d::Zero(), z = Eigen::Vector3d::UnitZ();
  const fcl::SplineMotion<double> spline(o, o, o, o, -3 * z, 0 * z, 3 * z, 6 * z);
  for (const fcl::MotionBase<double>* turn :
       {static_cast<const fcl::MotionBase<double>*>(&about_origin), static_cast<const fcl::MotionBase<double>*>(&screw),
        static_cast<const fcl::MotionBase<double>*>(&spline)}) {
    turn->integrate(0.125);
    const auto before = currentPose(*turn);
    Result<double> result, other;
    fcl::continuousCollide(&bar, turn, &peg, &still, request<double>(fcl::CCDM_TRANS, 1e-6), result);
    fcl::continuousCollide(&peg, &still, &bar, turn, request<double>(fcl::CCDM_TRANS, 1e-6), other);
    EXPECT_TRUE(result.is_collide);
    EXPECT_NEAR(result.time_of_contact, expected, 2e-6);
    EXPECT_NEAR(other.time_of_contact, expected, 2e-6);
    EXPECT_EQ(currentPose(*turn).matrix(), before.matrix()) << "a motion is not written to";
    turn->integrate(result.time_of_contact);
    EXPECT_TRUE(result.contact_tf1.isApprox(currentPose(*turn), 1e-12));
  }
  // A screw about an axis beside the bar's origin, and one along a line, go where FCL's integrate() takes them.
  const auto turned =
      test::pose<double>(Eigen::AngleAxisd(1, Eigen::Vector3d(1, 2, 2) / 3).toRotationMatrix(), {1, 2, 3});
  const auto shifted = test::pose<double>(Eigen::Matrix3d::Identity(), {2, -1, 0.5});
  for (const auto& end : {turned, shifted}) {
    const fcl::ScrewMotion<double> motion(test::pose<double>(Eigen::Matrix3d::Identity(), {0.3, 0.1, -0.2}), end);
    const auto ours = motionOf<double>("motion", &motion);
    for (const double time : {0.0, 0.3, 1.0}) {
      motion.integrate(time);
      EXPECT_TRUE(ours->at(time).matrix().isApprox(currentPose(motion).matrix(), 1e-9)) << time;
    }
  }
  // About a point of its own: the bar's far end stays, so it swings the other way round.
  const fcl::InterpMotion<double> about_end(I.linear(), I.translation(), quarter.linear(),
                                            Eigen::Vector3d(1, 0, 0) - quarter.linear() * Eigen::Vector3d(1, 0, 0),
                                            Eigen::Vector3d(1, 0, 0));
  about_end.integrate(0.5);
  ASSERT_LT((currentPose(about_end) * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(1, 0, 0)).norm(), 1e-12);
  Result<double> result;
  fcl::continuousCollide(&bar, &about_end, &peg, &still, request<double>(fcl::CCDM_TRANS), result);
  EXPECT_FALSE(result.is_collide);
}

TEST(ContinuousDouble, SplinesFromRandomPoints) {
  const Raw ra = test::torus(20), rb = test::torus(15, 0.2);
  const Modeld a(ra.mesh()), b(rb.mesh());
  std::mt19937_64 g(6);
  const fcl::TranslationMotion<double> still(identity<double>(), identity<double>());
  int hits = 0;
  for (int i = 0; i < 20; ++i) {
    const auto p = randomPoints(g, 4), r = randomPoints(g, 2);
    const fcl::SplineMotion<double> m(p[0], p[1], p[2], p[3], r[0], r[1], r[2], r[3]);
    Result<double> result;
    fcl::continuousCollide(&a, &still, &b, &m, request<double>(fcl::CCDM_TRANS), result);
    const double end = result.is_collide ? result.time_of_contact - 1e-9 : 1;
    for (int k = 0; k < 100 && end > 0; ++k) {
      m.integrate(end * k / 99);
      ASSERT_FALSE(test::touching<double>(a, identity<double>(), b, currentPose(m)));
    }
    if (!result.is_collide) continue;
    EXPECT_LT(test::distance<double>(a, result.contact_tf1, b, result.contact_tf2), 1e-2);
    hits += result.time_of_contact > 0;
  }
  EXPECT_GT(hits, 2);
}

TEST(ContinuousDouble, SlidingAtASmallGapIsNoContact) {
  const Modeld floor(test::box({-10, -10, -1}, {10, 10, 0}).mesh());
  const Modeld foot(test::torus(30).mesh());
  const double low = -foot.mesh()->bounds().min().z();
  for (const double gap : {1e-3, 1e-6}) {
    const auto turn = Eigen::AngleAxisd(2, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    const auto begin = test::pose<double>(Eigen::Matrix3d::Identity(), {-8, 0, low + gap});
    const Ways<double> ways{
        &floor, identity<double>(), identity<double>(), &foot, begin, test::pose<double>(turn, {8, 1, low + gap})};
    for (const auto type : kTypes) {
      EXPECT_FALSE(ways.ask(request<double>(type)).is_collide) << gap << ' ' << type;
      EXPECT_FALSE(ways.swapped().ask(request<double>(type)).is_collide) << gap << ' ' << type;
    }
    const Ways<double> sinking{
        &floor, identity<double>(), identity<double>(), &foot, begin, test::pose<double>(turn, {8, 1, low - gap})};
    for (const auto type : kTypes) {
      const auto result = sinking.ask(request<double>(type));
      EXPECT_TRUE(result.is_collide);
      EXPECT_NEAR(result.time_of_contact, 0.5, 0.2) << gap << ' ' << type;
    }
  }
}

// A tilted tool slides along a flat part with one raised vertex. Of the larger part, hulls of leaves are advanced, of
// the smaller one those of the meshes, too.
TEST(ContinuousDouble, NothingIsSteppedOverAboveAFlatPart) {
  const Raw tool = test::torus(12);
  const auto fcl_tool = test::bvh<fcl::OBBRSSd>(tool);
  const Modeld tool_model(tool.mesh());
  std::mt19937_64 g(11);
  std::uniform_real_distribution<double> u(-1, 1);
  int hits = 0, free = 0;
  for (const std::size_t n : {std::size_t{30}, std::size_t{92}}) {
    Raw flat;
    for (std::size_t i = 0; i < n * n; ++i) {
      flat.vertices.emplace_back(20.0 * static_cast<double>(i % n) / static_cast<double>(n - 1) - 10,
                                 20.0 * static_cast<double>(i / n) / static_cast<double>(n - 1) - 10, 0);
    }
    for (std::size_t i = 0; i + n < n * n; ++i) {
      if (i % n == n - 1) continue;
      flat.triangles.emplace_back(i, i + 1, i + n);
      flat.triangles.emplace_back(i + 1, i + n + 1, i + n);
    }
    for (int round = 0; round < 24; ++round) {
      Raw part = flat;
      part.vertices[(n / 2) * n + n / 2].z() = round % 3 == 0 ? 0 : 0.05;
      const auto fcl_part = test::bvh<fcl::OBBRSSd>(part);
      const Modeld part_model(part.mesh());
      const auto above = [&](const Eigen::Matrix3d& R, double x) {
        double low = 0;
        for (const Eigen::Vector3d& v : tool.vertices) low = std::min(low, (R * v).z());
        return test::pose<double>(R, {x, 0.3 * u(g), 0.01 + 0.03 * std::abs(u(g)) - low});
      };
      const Eigen::Matrix3d tilt = (Eigen::AngleAxisd(0.4 * u(g), Eigen::Vector3d::UnitX()) *
                                    Eigen::AngleAxisd(0.4 * u(g), Eigen::Vector3d::UnitY()))
                                       .toRotationMatrix();
      const Eigen::Matrix3d turn =
          round % 2 == 0 ? tilt : Eigen::Matrix3d(Eigen::AngleAxisd(0.6 * u(g), Eigen::Vector3d::UnitZ()) * tilt);
      const Ways<double> ways{&tool_model, above(tilt, -8),    above(turn, 8),
                              &part_model, identity<double>(), identity<double>()};
      const auto result = ways.ask(request<double>(fcl::CCDM_LINEAR));
      checkBySampling<double>(ways, *fcl_tool, *fcl_part, fcl::CCDM_LINEAR, 1e-4, result, 200);
      if (HasFatalFailure()) return;
      const auto other = ways.swapped().ask(request<double>(fcl::CCDM_LINEAR));
      EXPECT_EQ(other.is_collide, result.is_collide);
      EXPECT_NEAR(other.time_of_contact, result.time_of_contact, 1e-4);
      (result.is_collide ? hits : free)++;
    }
  }
  EXPECT_GT(hits, 8);
  EXPECT_GT(free, 8);
}

// Two links beyond one joint, and a third that a joint between them turns a little.
TYPED_TEST(Continuous, NothingIsSteppedOverBetweenLinksThatTurnTogether) {
  using S = TypeParam;
  const Model<S> a(test::torus(14).mesh()), b(test::box({-0.4, -0.4, -0.2}, {0.4, 0.4, 0.2}).mesh());
  std::mt19937_64 g(31);
  std::uniform_real_distribution<double> u(-1, 1);
  int hits = 0, misses = 0;
  for (int i = 0; i < 300; ++i) {
    const fcl::CCDMotionType type = kTypes[1 + i % 2];
    const Eigen::Vector3d axis = test::randomDirection(g), at = 2 * test::randomDirection(g);
    const auto joint = [](const Eigen::Vector3d& about, const Eigen::Vector3d& through, double angle) {
      const Eigen::Matrix3d R = Eigen::AngleAxisd(angle, about).toRotationMatrix();
      return test::pose<double>(R, through - R * through);
    };
    const fcl::Transform3d X = randomPose(g, 0.5), Y = randomPose(g, 1.9);
    const fcl::Transform3d base = joint(axis, at, 1.5 * u(g));
    const fcl::Transform3d beyond =
        i % 3 == 0 ? identity<double>() : joint(test::randomDirection(g), Y.translation() / 2, 1.5 * u(g));
    const fcl::Transform3d X_end = base * X, Y_end = base * beyond * Y;
    const Ways<S> ways{&a, X.cast<S>(), X_end.cast<S>(), &b, Y.cast<S>(), Y_end.cast<S>()};
    const Result<S> result = ways.ask(request<S>(type)), other = ways.swapped().ask(request<S>(type));
    checkBySampling<S>(ways, a, b, type, 1e-4, result, 80);
    if (testing::Test::HasFatalFailure()) return;
    ASSERT_EQ(other.is_collide, result.is_collide) << i;
    hits += result.is_collide && result.time_of_contact > 0;
    misses += !result.is_collide;
  }
  EXPECT_GT(hits, 10);
  EXPECT_GT(misses, 40);
}

// A part of many triangles in a room of few, whose one leaf is all around it: near walls, edges and corners, where the
// part moves, the room does, or both.
TYPED_TEST(Continuous, PartsInRoomsOfFewTriangles) {
  using S = TypeParam;
  Raw room = test::box({-10, -8, -3}, {10, 8, 3}), part = test::torus(20);
  room.addTriangle({-10, 2, -3}, {10, 2.001, -2.9}, {0, 2, -2.999});  // a sliver
  part.scale(0.15);
  const Model<S> a(part.mesh()), b(room.mesh());
  const auto fa = test::bvh<fcl::OBBRSS<S>>(part), fb = test::bvh<fcl::OBBRSS<S>>(room);
  std::mt19937_64 g(41);
  std::uniform_real_distribution<double> u(-1, 1);
  int hits = 0, misses = 0;
  for (int i = 0; i < 240; ++i) {
    const fcl::CCDMotionType type = kTypes[i % 4];
    const Eigen::Vector3d near(u(g) * 10, u(g) * 8, i % 2 == 0 ? -2.5 : 2.5 + 0.2 * u(g));
    const auto at = [&](double way) {
      return test::pose<double>(test::randomRotation(g), near + way * test::randomDirection(g));
    };
    const auto room_at = [&](double way) {
      const Eigen::Matrix3d R = Eigen::AngleAxisd(0.02 * u(g), test::randomDirection(g)).toRotationMatrix();
      return test::pose<double>(R, way * test::randomDirection(g));
    };
    const fcl::Transform3d X = at(0), X_end = i % 3 == 1 ? X : at(0.4), Y = room_at(0.1),
                           Y_end = i % 3 == 0 ? Y : room_at(0.4);
    const Ways<S> ways{&a, X.cast<S>(), X_end.cast<S>(), &b, Y.cast<S>(), Y_end.cast<S>()};
    const Result<S> result = ways.ask(request<S>(type)), other = ways.swapped().ask(request<S>(type));
    checkBySampling<S>(ways, *fa, *fb, type, 1e-4, result, 100);
    if (testing::Test::HasFatalFailure()) return;
    ASSERT_EQ(other.is_collide, result.is_collide) << i;
    // With float, passes within 2e-5 of all lengths count.
    constexpr double kTolerance = std::is_same<S, double>::value ? 2e-4 : 5e-3;
    ASSERT_NEAR(other.time_of_contact, result.time_of_contact, kTolerance) << i;
    hits += result.is_collide && result.time_of_contact > 0;
    misses += !result.is_collide;
  }
  EXPECT_GT(hits, 20);
  EXPECT_GT(misses, 60);
}

// How near they may pass does not depend on where the origins of their meshes are.
TEST(ContinuousDouble, MeshesFarFromTheirOriginsPassAsNear) {
  for (const double far : {0.0, 1e2, 1e4}) {
    Raw cube = test::box({-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5});
    for (Eigen::Vector3d& v : cube.vertices) v.x() += far;
    Raw large = test::box({-5, -5, -9.5}, {5, 5, 0.5});
    for (Eigen::Vector3d& v : large.vertices) v.x() += far;
    const Modeld a(large.mesh()), b(cube.mesh());
    const auto at = [](double y, double gap) {
      return test::pose<double>(Eigen::Matrix3d::Identity(), {0.3, y, 1 + gap});
    };
    const double gap = 2e-9 + 1e-12 * far;
    const Ways<double> passing{&a, identity<double>(), identity<double>(), &b, at(-8, gap), at(8, gap)};
    EXPECT_FALSE(passing.ask(request<double>(fcl::CCDM_TRANS)).is_collide) << far;
    EXPECT_FALSE(passing.swapped().ask(request<double>(fcl::CCDM_TRANS)).is_collide) << far;
    const Ways<double> scraping{&a, identity<double>(), identity<double>(), &b, at(-8, -gap), at(8, -gap)};
    EXPECT_NEAR(scraping.ask(request<double>(fcl::CCDM_TRANS)).time_of_contact, 2.5 / 16, 1e-4) << far;
  }
}

TEST(ContinuousDouble, TouchingAtTheBeginOrTheEnd) {
  const Modeld a(test::box({0, 0, 0}, {1, 1, 1}).mesh()), b(test::box({0, 0, 0}, {1, 1, 1}).mesh());
  const auto at = [](double x) { return test::pose<double>(Eigen::Matrix3d::Identity(), {x, 0.25, 0.125}); };
  const fcl::Transform3d I = identity<double>();
  EXPECT_EQ((Ways<double>{&a, I, I, &b, at(0.5), at(4)}.ask(request<double>(fcl::CCDM_TRANS)).time_of_contact), 0);
  EXPECT_EQ((Ways<double>{&a, I, I, &b, at(1), at(4)}.ask(request<double>(fcl::CCDM_TRANS)).time_of_contact), 0);
  const auto end = Ways<double>{&a, I, I, &b, at(4), at(1)}.ask(request<double>(fcl::CCDM_TRANS));
  EXPECT_TRUE(end.is_collide);
  EXPECT_NEAR(end.time_of_contact, 1, 2e-4);
  EXPECT_LE(end.time_of_contact, 1);
  EXPECT_FALSE((Ways<double>{&a, I, I, &b, at(4), at(1 + 1e-6)}.ask(request<double>(fcl::CCDM_TRANS)).is_collide));
  EXPECT_FALSE((Ways<double>{&a, I, I, &b, at(4), at(4)}.ask(request<double>(fcl::CCDM_LINEAR)).is_collide));
}

TEST(ContinuousDouble, DegenerateMeshes) {
  const Raw meshes[] = {test::adversarial(), test::soup(60, 4), test::torus(6)};
  std::mt19937_64 g(8);
  for (const Raw& ra : meshes) {
    for (const Raw& rb : meshes) {
      const Modeld a(ra.mesh()), b(rb.mesh());
      for (int i = 0; i < 8; ++i) {
        const fcl::CCDMotionType type = kTypes[i % 4];
        const Ways<double> ways = randomWays<double>(g, a, b, 3);
        checkBySampling<double>(ways, a, b, type, 1e-4, ways.ask(request<double>(type)), 40);
        if (HasFatalFailure()) return;
      }
    }
  }
}

// With a margin, contact is where collide() first says so on the way, for triangles and for spheres.
TEST(ContinuousDouble, MarginsAreReachedInTime) {
  const Raw ra = test::torus(14), rb = test::box({-0.3, -0.2, -0.25}, {0.3, 0.2, 0.25});
  std::mt19937_64 g(14);
  int hits = 0;
  for (const Answer answer : {Answer::kExact, Answer::kConservative}) {
    Options options;
    options.answer = answer;
    options.margin = 0.4;
    const Modeld a(ra.mesh(), options), b(rb.mesh());
    for (int i = 0; i < 12; ++i) {
      const fcl::CCDMotionType type = kTypes[i % 4];
      const Ways<double> ways = randomWays<double>(g, a, b, 4);
      const Result<double> result = ways.ask(request<double>(type));
      const auto m1 = motionOf<double>(ways.begin1, ways.end1, type),
                 m2 = motionOf<double>(ways.begin2, ways.end2, type);
      constexpr int kSteps = 400;
      double first = 2;
      for (int k = 0; k <= kSteps && first > 1; ++k) {
        const double t = static_cast<double>(k) / kSteps;
        if (test::touching<double>(a, poseAt<double>(*m1, t), b, poseAt<double>(*m2, t))) first = t;
      }
      if (first > 1) continue;
      ++hits;
      ASSERT_TRUE(result.is_collide) << i;
      ASSERT_LE(result.time_of_contact, first) << i;
      ASSERT_GE(result.time_of_contact, first - 1.0 / kSteps - 1e-4 - 1e-9) << i;
    }
  }
  EXPECT_GT(hits, 8);
}

// What comes within toc_err of the end, but not in time, is no contact.
TEST(ContinuousDouble, StopsJustShort) {
  const auto I = identity<double>();
  for (const double short_of : {1e-5, 1e-4}) {
    const double end = std::acos(-1.0) / 4 - 0.1, reach = std::sqrt(2.0) * std::cos(0.1);
    const Modeld turning(test::box({-1, -1, -1}, {1, 1, 1}).mesh());
    const Modeld wall(test::box({reach + short_of, -3, -3}, {reach + 1, 3, 3}).mesh());
    const auto turned =
        test::pose<double>(Eigen::AngleAxisd(end, Eigen::Vector3d::UnitZ()).toRotationMatrix(), {0, 0, 0});
    for (const fcl::CCDMotionType type : {fcl::CCDM_LINEAR, fcl::CCDM_SCREW}) {
      const Ways<double> ways{&turning, I, turned, &wall, I, I};
      EXPECT_FALSE(ways.ask(request<double>(type, 0.01)).is_collide) << type;
      EXPECT_FALSE(ways.swapped().ask(request<double>(type, 0.01)).is_collide) << type;
      const auto further =
          test::pose<double>(Eigen::AngleAxisd(end + 1e-3, Eigen::Vector3d::UnitZ()).toRotationMatrix(), {0, 0, 0});
      EXPECT_TRUE((Ways<double>{&turning, I, further, &wall, I, I}.ask(request<double>(type, 0.01)).is_collide))
          << type;
    }
  }
}

// A rotation that is within the stated bound, but sheared: what its transpose says of a normal is off.
TEST(ContinuousDouble, ShearedRotationsStepOverNothing) {
  for (const Subdivision subdivision : {Subdivision::kOctree, Subdivision::kBono}) {
    Options options;
    options.subdivision = subdivision;
    const Modeld plate(test::box({-1, -1, -0.007863}, {1, 1, 0.007863}).mesh(), options);
    for (const double shear : {9.9e-4, -9.9e-4}) {
      auto sheared = identity<double>();
      sheared.linear()(0, 2) = shear;
      for (const double x : {-0.99, 0.0, 0.99}) {
        Raw speck;
        speck.addTriangle({x, 0, 0}, {x + 1e-5, 0, 0}, {x, 1e-5, 0});
        const Modeld small(speck.mesh());
        const auto at = [](double z) { return test::pose<double>(Eigen::Matrix3d::Identity(), {0, 0, z}); };
        for (const double end : {0.0074, -0.5}) {
          const Ways<double> ways{&small, at(1), at(end), &plate, sheared, sheared};
          const double first = (1 - 0.007863) / (1 - end);
          for (const Ways<double>& w : {ways, ways.swapped()}) {
            const Result<double> result = w.ask(request<double>(fcl::CCDM_TRANS, 1e-6));
            EXPECT_TRUE(result.is_collide);
            EXPECT_NEAR(result.time_of_contact, first, 2e-6);
            EXPECT_LE(result.time_of_contact, first + 1e-9);
          }
        }
      }
    }
  }
}

// A long body turns onto a plane, with which only its far end meets.
TEST(ContinuousDouble, ANeedleTurnsOntoAPlane) {
  const Modeld needle(test::box({-10, -0.01, -0.01}, {10, 0.01, 0.01}).mesh());
  const fcl::Planed plane(Eigen::Vector3d::UnitZ(), 0);
  const fcl::Halfspaced half_space(Eigen::Vector3d::UnitZ(), 0);
  const auto begin = test::pose<double>(Eigen::Matrix3d::Identity(), {0, 0, 5});
  const auto end = test::pose<double>(Eigen::AngleAxisd(1.2, Eigen::Vector3d::UnitY()).toRotationMatrix(), {0, 0, 5});
  const auto I = identity<double>();
  // The lowest corner: 5 - 10 sin(a) - 0.01 cos(a) = 0.
  double lo = 0, hi = 1.2;
  for (int i = 0; i < 60; ++i) {
    const double middle = (lo + hi) / 2;
    (5 - 10 * std::sin(middle) - 0.01 * std::cos(middle) > 0 ? lo : hi) = middle;
  }
  for (const fcl::CollisionGeometryd* shape : test::Geometries<double>{&plane, &half_space}) {
    for (const fcl::CCDMotionType type : {fcl::CCDM_LINEAR, fcl::CCDM_SCREW}) {
      const Result<double> result = Ways<double>{&needle, begin, end, shape, I, I}.ask(request<double>(type));
      EXPECT_TRUE(result.is_collide);
      EXPECT_LE(result.time_of_contact, lo / 1.2 + 1e-9) << type;
      EXPECT_NEAR(result.time_of_contact, lo / 1.2, 2e-4) << type;
    }
  }
}

// Spheres of the collision depth: never later than the surfaces, and as conservative collide() says on the way.
TEST(ContinuousConservative, IsNeverLater) {
  const Raw ra = test::torus(24), rb = test::torus(17, 0.3);
  const Modeld exact_a(ra.mesh()), exact_b(rb.mesh());
  const auto fb = test::bvh<fcl::OBBRSSd>(rb);
  std::mt19937_64 g(9);
  int later = 0;
  for (const Subdivision subdivision : {Subdivision::kOctree, Subdivision::kBono}) {
    for (int i = 0; i < 12; ++i) {
      Options options;
      options.answer = Answer::kConservative;
      options.subdivision = subdivision;
      options.depth = 4 + i % 3;
      const Modeld a(ra.mesh(), options), b(rb.mesh(), options);
      const fcl::CCDMotionType type = kTypes[i % 4];
      Ways<double> ways = randomWays<double>(g, exact_a, exact_b, 3);
      const double exact = ways.ask(request<double>(type)).time_of_contact;
      ways.o1 = &a;
      for (const fcl::CollisionGeometryd* other : test::Geometries<double>{&b, &exact_b, fb.get()}) {
        ways.o2 = other;
        const auto result = ways.ask(request<double>(type)), reversed = ways.swapped().ask(request<double>(type));
        EXPECT_LE(result.time_of_contact, exact);
        EXPECT_EQ(result.is_collide, reversed.is_collide);
        EXPECT_NEAR(result.time_of_contact, reversed.time_of_contact, 2e-4);
        checkBySampling<double>(ways, a, *other, type, 1e-4, result, 40);
        if (HasFatalFailure()) return;
        later += result.time_of_contact < exact;
      }
    }
  }
  EXPECT_GT(later, 10);
}

// Shapes and octrees as partners.

TYPED_TEST(Continuous, NoShapeIsSteppedOverOnRandomWays) {
  using S = TypeParam;
  const Raw raw = test::torus(16);
  const Model<S> a(raw.mesh());
  std::mt19937_64 g(21);
  for (const auto& entry : test::shapes<S>()) {
    const std::string& name = entry.name;
    const auto& shape = entry.shape;
    SCOPED_TRACE(name);
    int hits = 0;
    const int rounds = 24;
    for (int i = 0; i < rounds; ++i) {
      const fcl::CCDMotionType type = kTypes[i % 4];
      Ways<S> ways = randomWays<S>(g, a, *shape, i % 3 == 0 ? 1.6 : 2.6);
      const Result<S> result = ways.ask(request<S>(type)), other = ways.swapped().ask(request<S>(type));
      checkBySampling<S>(ways, a, *shape, type, 1e-4, result, 60);
      if (testing::Test::HasFatalFailure()) return;
      ASSERT_EQ(other.is_collide, result.is_collide) << i;
      ASSERT_NEAR(other.time_of_contact, result.time_of_contact, 2e-4);
      ASSERT_TRUE(other.contact_tf1.isApprox(result.contact_tf2, S(1e-2)));
      hits += result.is_collide && result.time_of_contact > 0;
    }
    // A plane or a half-space is touched at the begin, mostly.
    EXPECT_GE(hits, name == "plane" || name == "half-space" ? 1 : rounds / 4);
  }
}

// A wheel's turn about its own axis changes nothing; one about another axis does.
TYPED_TEST(Continuous, WheelsTurn) {
  using S = TypeParam;
  const Model<S> wall(test::torus(16).mesh());
  const fcl::Capsule<S> capsule(S(0.2), S(0.5));
  const fcl::Cylinder<S> cylinder(S(0.4), S(0.3));
  const fcl::Cone<S> cone(S(0.4), S(0.5));
  const fcl::Ellipsoid<S> along_z(S(0.4), S(0.4), S(0.2)), along_y(S(0.4), S(0.2), S(0.4)),
      along_x(S(0.2), S(0.4), S(0.4));
  const fcl::Box<S> box(S(0.4), S(0.3), S(0.5));
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX(), y = Eigen::Vector3d::UnitY(), z = Eigen::Vector3d::UnitZ();
  const std::pair<const fcl::CollisionGeometry<S>*, Eigen::Vector3d> bodies[] = {
      {&capsule, z}, {&cylinder, z}, {&cone, z},    {&along_z, z}, {&along_y, y},
      {&along_x, x}, {&box, z},      {&along_z, x}, {&along_x, y}, {&cylinder, x}};
  std::mt19937_64 g(41);
  std::uniform_real_distribution<double> u(-1, 1);
  int hits = 0;
  for (const auto& [body, axis] : bodies) {
    for (int i = 0; i < 36; ++i) {
      const fcl::CCDMotionType type = i % 2 == 0 ? fcl::CCDM_LINEAR : fcl::CCDM_SCREW;
      // About its own axis, one that is tilted, or one beside it; by little, as poses in float are, or by much.
      const double off = i % 4 < 2 ? 1 : 1e-5;
      Eigen::Vector3d about = axis;
      if (i % 3 == 1) about = (about + 0.2 * off * test::randomDirection(g)).normalized();
      const Eigen::Vector3d beside = i % 3 == 2 && type == fcl::CCDM_SCREW
                                         ? Eigen::Vector3d(0.3 * off * test::randomDirection(g))
                                         : Eigen::Vector3d::Zero();
      const fcl::Transform3d begin = randomPose(g, 1.8);
      const Eigen::Matrix3d turn = Eigen::AngleAxisd(2.5, about).toRotationMatrix();
      fcl::Transform3d end = begin * test::pose<double>(turn, beside - turn * beside);
      end.translation() += (type == fcl::CCDM_SCREW ? Eigen::Vector3d(begin.linear() * about * u(g))
                                                    : Eigen::Vector3d(2.5 * test::randomDirection(g)));
      const Ways<S> ways{&wall, identity<S>(), identity<S>(), body, begin.cast<S>(), end.cast<S>()};
      const Result<S> result = ways.ask(request<S>(type));
      checkBySampling<S>(ways, wall, *body, type, 1e-4, result, 60);
      if (testing::Test::HasFatalFailure()) return;
      hits += result.is_collide && result.time_of_contact > 0;
    }
  }
  EXPECT_GT(hits, 20);
}

// A cylinder above a floor turns about an axis that is not quite its own, so its ends go up and down by about the gap.
TEST(Wheels, WobbleAsFarAsTheyDo) {
  const Modeld floor(test::plate(4).scale(4).mesh());
  const fcl::Cylinderd wheel(0.4, 0.3);
  std::mt19937_64 g(42);
  std::uniform_real_distribution<double> u(0, 1);
  int hits = 0, misses = 0;
  for (int i = 0; i < 120; ++i) {
    const double tilt = std::pow(10, -1.5 - 2 * u(g)), gap = tilt * (0.02 + 0.5 * u(g));
    const Eigen::Vector3d about(1, tilt * test::randomDirection(g).y(), tilt * test::randomDirection(g).z());
    const fcl::Transform3d begin = test::pose<double>(
        Eigen::AngleAxisd(std::acos(-1.0) / 2, Eigen::Vector3d::UnitY()).toRotationMatrix(), {0.03, 0.02, 0.4 + gap});
    fcl::Transform3d end = begin;
    end.linear() = Eigen::AngleAxisd(2.5, about.normalized()) * begin.linear();
    const auto motion = motionOf<double>(begin, end, fcl::CCDM_LINEAR);
    double least = 1;
    for (int k = 0; k <= 100; ++k) {
      const fcl::Transform3d X = poseAt<double>(*motion, k / 100.0);
      least = std::min(least, test::distance<double>(floor, identity<double>(), wheel, X));
    }
    if (least > 0 && least < 0.02 * gap + 4e-6) continue;  // too near to say, or for FCL
    const Ways<double> ways{&floor, identity<double>(), identity<double>(), &wheel, begin, end};
    for (const Ways<double>& w : {ways, ways.swapped()}) {
      ASSERT_EQ(w.ask(request<double>(fcl::CCDM_LINEAR)).is_collide, !(least > 0))
          << tilt << ' ' << gap << ' ' << least;
    }
    ++(least > 0 ? misses : hits);
  }
  EXPECT_GT(hits, 20);
  EXPECT_GT(misses, 20);
}

// A plane or a half-space that the tip of a long rod meets, far from the foot of its origin.
TYPED_TEST(Continuous, TipsMeetUnboundedShapes) {
  using S = TypeParam;
  Raw raw = test::torus(40);
  const Eigen::Matrix3d tilt = Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitY()).toRotationMatrix();
  for (Eigen::Vector3d& v : raw.vertices) v = tilt * Eigen::Vector3d(5 * v.x() + 5.3, 0.1 * v.y(), 0.1 * v.z());
  const Model<S> rod(raw.mesh());
  const double lowest = rod.mesh()->bounds().min().z();
  const fcl::Plane<S> plane(fcl::Vector3<S>(0, 0, 1), 0);
  const fcl::Halfspace<S> half_space(fcl::Vector3<S>(0, 0, 1), 0);
  for (const fcl::CollisionGeometry<S>* shape : test::Geometries<S>{&plane, &half_space}) {
    for (const auto type : kTypes) {
      const auto at = [&](double height) {
        return test::pose<S>(Eigen::Matrix3d::Identity(), {0, 0, height - lowest});
      };
      const Ways<S> ways{&rod, at(0.1), at(-0.1), shape, identity<S>(), identity<S>()};
      for (const Ways<S>& w : {ways, ways.swapped()}) {
        const Result<S> result = w.ask(request<S>(type));
        EXPECT_TRUE(result.is_collide);
        EXPECT_NEAR(result.time_of_contact, 0.5, 1e-3);
      }
    }
  }
}

// Planes and half-spaces that are free at the begin, and move: they turn, so far from their origins they are fast.
TYPED_TEST(Continuous, UnboundedShapesMove) {
  using S = TypeParam;
  const Raw raw = test::torus(12);
  const Model<S> a(raw.mesh());
  std::mt19937_64 g(22);
  std::uniform_real_distribution<double> u(0, 1);
  const fcl::Plane<S> plane(fcl::Vector3<S>(0, 0, 1), 0);
  const fcl::Halfspace<S> half_space(fcl::Vector3<S>(0, 0, 1), 0);
  int hits = 0, misses = 0;
  for (const fcl::CollisionGeometry<S>* shape : test::Geometries<S>{&plane, &half_space}) {
    for (int i = 0; i < 32; ++i) {
      const fcl::CCDMotionType type = kTypes[i % 4];
      const Eigen::Vector3d place = 3 * test::randomDirection(g), slip(4 * u(g), 3 * u(g), -2 - u(g));
      const auto turn = [&](double angle) {
        return Eigen::AngleAxisd(angle * u(g), test::randomDirection(g)).toRotationMatrix();
      };
      Ways<S> ways{&a,    test::pose<S>(test::randomRotation(g), place), test::pose<S>(test::randomRotation(g), place),
                   shape, test::pose<S>(turn(0.3), place + slip),        test::pose<S>(turn(0.8), place + slip * u(g))};
      const Result<S> result = ways.ask(request<S>(type)), other = ways.swapped().ask(request<S>(type));
      checkBySampling<S>(ways, a, *shape, type, 1e-4, result, 60);
      if (testing::Test::HasFatalFailure()) return;
      ASSERT_EQ(other.is_collide, result.is_collide);
      ASSERT_NEAR(other.time_of_contact, result.time_of_contact, 2e-4);
      hits += result.is_collide && result.time_of_contact > 0;
      misses += !result.is_collide;
    }
  }
  EXPECT_GT(hits, 8);
  EXPECT_GT(misses, 8);
}

TYPED_TEST(Continuous, NoCellIsSteppedOverOnRandomWays) {
  using S = TypeParam;
  const Raw raw = test::torus(16);
  const Model<S> a(raw.mesh());
  const auto octree = test::cloud<S>(11, 60);
  std::mt19937_64 g(23);
  int hits = 0;
  for (int i = 0; i < 32; ++i) {
    const fcl::CCDMotionType type = kTypes[i % 4];
    Ways<S> ways = randomWays<S>(g, a, *octree, i % 3 == 0 ? 1.6 : 2.6);
    const Result<S> result = ways.ask(request<S>(type)), other = ways.swapped().ask(request<S>(type));
    checkBySampling<S>(ways, a, *octree, type, 1e-4, result, 60);
    if (testing::Test::HasFatalFailure()) return;
    ASSERT_EQ(other.is_collide, result.is_collide);
    ASSERT_NEAR(other.time_of_contact, result.time_of_contact, 2e-4);
    hits += result.is_collide && result.time_of_contact > 0;
  }
  EXPECT_GE(hits, 6);
  const fcl::OcTree<S> empty(0.1);
  Ways<S> ways = randomWays<S>(g, a, empty, 2);
  EXPECT_FALSE(ways.ask(request<S>(fcl::CCDM_LINEAR)).is_collide);
}

// A sphere through a wall, which FCL's advancement overruns or steps over, whichever comes first; a single step of its
// default solver answers NaN.
TYPED_TEST(Continuous, AWallStopsEveryBullet) {
  using S = TypeParam;
  const Raw wall = test::box({-0.001, -1, -1}, {0.001, 1, 1});
  const Model<S> a(wall.mesh());
  const auto v = [](double x, double y, double z) { return Eigen::Vector3d(x, y, z).cast<S>().eval(); };
  auto map = std::make_shared<octomap::OcTree>(0.02);
  map->updateNode(octomap::point3d(0.01f, 0.01f, 0.01f), 2.0f);
  const std::vector<std::pair<std::shared_ptr<fcl::CollisionGeometry<S>>, double>> bullets = {
      {std::make_shared<fcl::Sphere<S>>(S(0.02)), 0.02},
      {std::make_shared<fcl::Box<S>>(v(0.04, 0.02, 0.02)), 0.02},
      {std::make_shared<fcl::Ellipsoid<S>>(v(0.02, 0.01, 0.03)), 0.02},
      {std::make_shared<fcl::Capsule<S>>(S(0.02), S(0.05)), 0.02},
      {std::make_shared<fcl::Cone<S>>(S(0.02), S(0.05)), 0.02},
      {std::make_shared<fcl::Cylinder<S>>(S(0.02), S(0.05)), 0.02},
      {test::polytope<S>(6, {0.02, 0.02, 0.02}), 0.02 * std::cos(std::acos(-1.0) / 6)},
      {std::make_shared<fcl::TriangleP<S>>(v(0.02, 0, 0), v(-0.02, 0.01, 0), v(-0.02, 0, 0.01)), 0.02},
      {std::make_shared<fcl::Plane<S>>(v(1, 0, 0), S(0.02)), 0.02},
      {std::make_shared<fcl::Halfspace<S>>(v(1, 0, 0), S(0.02)), 0.02},
      {std::make_shared<fcl::OcTree<S>>(map), 0.02}};
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  const auto begin = test::pose<S>(I, {-5, 0.1, 0.2}), end = test::pose<S>(I, {7, 0.1, 0.2});
  const double rounding = std::is_same<S, double>::value ? 1e-6 : 1e-4;
  for (const auto& [bullet, front] : bullets) {
    double expected = (5 - 0.001 - front) / 12;
    if (bullet->getNodeType() == fcl::GEOM_CONVEX) {
      // Its foremost vertex.
      double x = 0;
      for (const auto& p : static_cast<const fcl::Convex<S>&>(*bullet).getVertices()) {
        x = std::max(x, static_cast<double>(p.x()));
      }
      expected = (5 - 0.001 - x) / 12;
    }
    for (const auto type : kTypes) {
      for (const auto solver :
           {fcl::CCDC_NAIVE, fcl::CCDC_CONSERVATIVE_ADVANCEMENT, fcl::CCDC_RAY_SHOOTING, fcl::CCDC_POLYNOMIAL_SOLVER}) {
        for (const double toc_err : {0.0, 1e-4, 0.01}) {
          auto r = request<S>(type, toc_err);
          r.ccd_solver_type = solver;
          r.num_max_iterations = 1;
          const Ways<S> ways{&a, identity<S>(), identity<S>(), bullet.get(), begin, end};
          for (const Ways<S>& w : {ways, ways.swapped()}) {
            const Result<S> result = w.ask(r);
            ASSERT_TRUE(result.is_collide) << bullet->getNodeType();
            EXPECT_LE(result.time_of_contact, expected + rounding) << bullet->getNodeType();
            EXPECT_GE(result.time_of_contact, expected - toc_err - rounding) << bullet->getNodeType();
          }
        }
      }
    }
  }
}

TEST(ContinuousDouble, ShapesAndFclsMotions) {
  const Modeld peg(test::box({-0.05, 0.7, -0.5}, {0.05, 0.9, 0.5}).mesh());
  const fcl::Boxd bar(2, 0.1, 0.1);
  const fcl::Transform3d I = identity<double>();
  const fcl::TranslationMotion<double> still(I, I);
  const auto turned = test::pose<double>(Eigen::AngleAxisd(3, Eigen::Vector3d::UnitZ()).toRotationMatrix(), {0, 0, 0});
  const auto angleOf = [](double x, double y) { return std::atan2(y, x) - std::asin(0.05 / std::hypot(x, y)); };
  const double expected = std::min(angleOf(0.05, 0.7), angleOf(0.05, 0.9)) / 3;
  const fcl::ScrewMotion<double> screw(I, turned);
  const fcl::InterpMotion<double> interp(I.linear(), I.translation(), turned.linear(), turned.translation(),
                                         Eigen::Vector3d::Zero());
  for (const fcl::MotionBase<double>* m :
       {static_cast<const fcl::MotionBase<double>*>(&screw), static_cast<const fcl::MotionBase<double>*>(&interp)}) {
    Result<double> result, other;
    fcl::continuousCollide(&bar, m, &peg, &still, request<double>(fcl::CCDM_TRANS, 1e-6), result);
    fcl::continuousCollide(&peg, &still, &bar, m, request<double>(fcl::CCDM_TRANS, 1e-6), other);
    EXPECT_TRUE(result.is_collide);
    EXPECT_NEAR(result.time_of_contact, expected, 4e-6);
    EXPECT_NEAR(other.time_of_contact, expected, 4e-6);
  }
  // A ball that turns in its place goes nowhere, a hair above a floor.
  const Modeld floor(test::box({-10, -10, -1}, {10, 10, 0}).mesh());
  const fcl::Sphered ball(0.5);
  const auto here = [](double angle, double z) {
    return test::pose<double>(Eigen::AngleAxisd(angle, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix(),
                              {0.3, 0.2, 0.5 + z});
  };
  for (const auto type : kTypes) {
    EXPECT_FALSE(
        (Ways<double>{&floor, I, I, &ball, here(0, 1e-4), here(3, 1e-4)}.ask(request<double>(type)).is_collide));
    EXPECT_TRUE(
        (Ways<double>{&floor, I, I, &ball, here(0, 1e-4), here(3, -1e-4)}.ask(request<double>(type)).is_collide));
  }
}

TEST(ContinuousDouble, MarginsAndSolidsWithShapes) {
  Options wide, full;
  wide.margin = 0.25;
  full.solid = true;
  const Raw raw = test::box({0, 0, 0}, {1, 1, 1});
  const Modeld a(raw.mesh(), wide), b(raw.mesh(), full), shell(raw.mesh());
  const fcl::Sphered ball(0.125);
  const auto octree = [] {
    auto map = std::make_shared<octomap::OcTree>(0.25);
    map->updateNode(octomap::point3d(0.01f, 0.01f, 0.01f), 2.0f);
    return std::make_shared<fcl::OcTreed>(map);
  }();
  const fcl::Transform3d I = identity<double>();
  const auto at = [&](double x) { return test::pose<double>(I.linear(), {x, 0.3, 0.4}); };
  const auto r = request<double>(fcl::CCDM_LINEAR, 1e-6);
  for (const auto& entry : {std::pair(static_cast<const fcl::CollisionGeometryd*>(&ball), 0.125),
                            std::pair(static_cast<const fcl::CollisionGeometryd*>(octree.get()), 0.0)}) {
    const auto& partner = entry.first;
    const double left = entry.second;
    for (const bool turned : {false, true}) {
      const auto ask = [&](const fcl::CollisionGeometryd* model, double from, double to) {
        const Ways<double> ways{model, I, I, partner, at(from), at(to)};
        return (turned ? ways.swapped() : ways).ask(r);
      };
      EXPECT_NEAR(ask(&a, 5, 0).time_of_contact, (4 - 0.25 - left) / 5, 3e-6);
      EXPECT_NEAR(ask(&shell, 5, 0).time_of_contact, (4 - left) / 5, 3e-6);
      EXPECT_FALSE(ask(&a, 5, 1.26 + left).is_collide);
      EXPECT_EQ(ask(&b, 0.4, 0.5).time_of_contact, 0);
      EXPECT_TRUE(ask(&b, 0.4, 0.5).is_collide);
      EXPECT_FALSE(ask(&shell, 0.4, 0.5).is_collide);
    }
  }
}

TEST(ContinuousConservative, ShapesAndCellsAreNeverLater) {
  const Raw raw = test::torus(16);
  const Modeld exact(raw.mesh());
  std::vector<std::shared_ptr<fcl::CollisionGeometryd>> partners = {test::cloud<double>(12, 40)};
  for (const auto& [name, shape] : test::shapes<double>()) partners.push_back(shape);
  std::mt19937_64 g(24);
  int later = 0;
  for (const auto& partner : partners) {
    for (int i = 0; i < 8; ++i) {
      Options options;
      options.answer = Answer::kConservative;
      options.subdivision = i % 2 ? Subdivision::kOctree : Subdivision::kBono;
      options.depth = 4 + i % 3;
      const Modeld a(raw.mesh(), options);
      const fcl::CCDMotionType type = kTypes[i % 4];
      Ways<double> ways = randomWays<double>(g, exact, *partner, 3);
      const double time = ways.ask(request<double>(type)).time_of_contact;
      ways.o1 = &a;
      const auto result = ways.ask(request<double>(type)), other = ways.swapped().ask(request<double>(type));
      EXPECT_LE(result.time_of_contact, time + 1e-4) << "each may be early by toc_err";
      EXPECT_EQ(other.is_collide, result.is_collide);
      EXPECT_NEAR(other.time_of_contact, result.time_of_contact, 2e-4);
      checkBySampling<double>(ways, a, *partner, type, 1e-4, result, 40);
      if (HasFatalFailure()) return;
      later += result.time_of_contact < time;
    }
  }
  EXPECT_GT(later, 10);
}

TEST(ContinuousRequest, WhatCannotBeDoneThrows) {
  struct Wobble : fcl::TranslationMotion<double> {
    using fcl::TranslationMotion<double>::TranslationMotion;
  };
  const Modeld a(test::torus(6).mesh()), b(test::torus(6).mesh());
  const fcl::Transform3d I = identity<double>(), far = test::pose<double>(Eigen::Matrix3d::Identity(), {9, 0, 0});
  const fcl::TranslationMotion<double> good(I, far);
  const Wobble unknown(I, far);
  Result<double> result;
  const auto r = request<double>(fcl::CCDM_LINEAR);
  EXPECT_THROW(fcl::continuousCollide(&a, &good, &b, &unknown, r, result), std::invalid_argument);
  EXPECT_THROW(fcl::continuousCollide(&a, static_cast<const fcl::MotionBase<double>*>(nullptr), &b, &good, r, result),
               std::invalid_argument);
  auto broken = far;
  broken.translation().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(fcl::continuousCollide(&a, I, I, &b, I, broken, r, result), std::invalid_argument);
  const fcl::TranslationMotion<double> nowhere(I, broken);
  EXPECT_THROW(fcl::continuousCollide(&a, &good, &b, &nowhere, r, result), std::invalid_argument);
  for (const double error : {-1e-3, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_THROW(fcl::continuousCollide(&a, I, I, &b, far, I, request<double>(fcl::CCDM_LINEAR, error), result),
                 std::invalid_argument);
  }
  auto odd = r;
  odd.ccd_motion_type = static_cast<fcl::CCDMotionType>(17);
  EXPECT_THROW(fcl::continuousCollide(&a, I, I, &b, far, I, odd, result), std::invalid_argument);
}

TEST(ContinuousRequest, OnlyOccupiedGeometriesCollide) {
  const Modeld a(test::torus(6).mesh());
  Modeld b(test::torus(6).mesh());
  b.cost_density = 0;
  b.threshold_occupied = 0.5;
  ASSERT_FALSE(b.isOccupied());
  const fcl::Transform3d I = identity<double>(), far = test::pose<double>(Eigen::Matrix3d::Identity(), {9, 0, 0});
  EXPECT_FALSE((Ways<double>{&a, I, I, &b, far, I}.ask(request<double>(fcl::CCDM_LINEAR)).is_collide));
  EXPECT_TRUE((Ways<double>{&a, I, I, &a, far, I}.ask(request<double>(fcl::CCDM_LINEAR)).is_collide));
}

TEST(ContinuousGrowth, OnlyWhatTheWayMeets) {
  const Raw raw = test::torus(100);
  const Modeld a(raw.mesh()), b(raw.mesh());
  const fcl::Transform3d I = identity<double>();
  const auto begin = test::pose<double>(Eigen::Matrix3d::Identity(), {4, 0.2, 0.1});
  EXPECT_FALSE((Ways<double>{&a, I, I, &b, begin, test::pose<double>(I.linear(), {9, 9, 0})}
                    .ask(request<double>(fcl::CCDM_LINEAR))
                    .is_collide));
  EXPECT_EQ(a.statistics().resident_nodes, 1u) << "what only recedes needs no tree";
  EXPECT_TRUE((Ways<double>{&a, I, I, &b, begin, I}.ask(request<double>(fcl::CCDM_LINEAR)).is_collide));
  Modeld whole(a.mesh());
  whole.expandAll(static_cast<int>(a.statistics().nodes_per_level.size()));
  EXPECT_LT(a.statistics().resident_nodes, whole.statistics().resident_nodes / 2);
}

TEST(Continuous, WaysBeyondTheLargestNumberAreRefusedByName) {
  const auto mesh = test::torus(8).mesh();
  const Modeld a(mesh), b(mesh);
  const auto at = [](double x) { return test::pose<double>(Eigen::Matrix3d::Identity(), {x, 0, 0}); };
  const auto ask = [&](double x) {
    fcl::ContinuousCollisionResultd result;
    fcl::continuousCollide(&a, at(-x), at(x), &b, at(0), at(0), fcl::ContinuousCollisionRequestd(), result);
  };
  EXPECT_NO_THROW(ask(8e307));
  try {
    ask(1e308);
    FAIL();
  } catch (const std::invalid_argument& e) {
    EXPECT_NE(std::string(e.what()).find("begin and the end of a motion"), std::string::npos) << e.what();
  }
}

}  // namespace
}  // namespace bocst
