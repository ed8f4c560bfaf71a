// SPDX-License-Identifier: BSD-3-Clause
// Distances against FCL's own mesh query, against brute force over triangles, and against what they must mean.
#include <bocst/is_closer_than.h>
#include <fcl/narrowphase/detail/primitive_shape_algorithm/triangle_distance.h>
#include <gtest/gtest.h>

#include "conformance/reference.h"
#include "geometry/triangle.h"
#include "sanitized.h"
#include "thread_group.h"

namespace bocst {
namespace {

using test::Raw;

template <typename S>
fcl::DistanceResult<S> ask(const fcl::CollisionGeometry<S>& a, const fcl::Transform3<S>& X,
                           const fcl::CollisionGeometry<S>& b, const fcl::Transform3<S>& Y, bool is_signed = false) {
  fcl::DistanceRequest<S> request(true);
  request.enable_signed_distance = is_signed;
  fcl::DistanceResult<S> result;
  const S returned = fcl::distance(&a, X, &b, Y, request, result);
  EXPECT_EQ(returned, result.min_distance);
  return result;
}

template <typename S>
class Distance : public testing::Test {};
TYPED_TEST_SUITE(Distance, test::Scalars);

template <typename S>
Eigen::Vector3d onTriangle(const Raw& raw, std::intptr_t t, const fcl::Transform3<S>& X, const fcl::Vector3<S>& p) {
  const auto& i = raw.triangles[static_cast<std::size_t>(t)];
  const fcl::Transform3<double> Xd = X.template cast<double>();
  const query::Corners c = {Xd * raw.vertices[i[0]], Xd * raw.vertices[i[1]], Xd * raw.vertices[i[2]]};
  return query::closestPoint(p.template cast<double>(), c);
}

template <typename S>
double bruteForce(const Raw& a, const fcl::Transform3<S>& X, const Raw& b, const fcl::Transform3<S>& Y) {
  const fcl::Transform3<double> Xd = X.template cast<double>(), Yd = Y.template cast<double>();
  double least = std::numeric_limits<double>::infinity();
  for (const auto& s : a.triangles) {
    const query::Corners p = {Xd * a.vertices[s[0]], Xd * a.vertices[s[1]], Xd * a.vertices[s[2]]};
    for (const auto& t : b.triangles) {
      const query::Corners q = {Yd * b.vertices[t[0]], Yd * b.vertices[t[1]], Yd * b.vertices[t[2]]};
      Eigen::Vector3d on_p, on_q;
      least = std::min(least, query::nearestPoints(p, q, on_p, on_q));
    }
  }
  return least;
}

template <typename S>
void checkAgainstFcl(int poses, double scale) {
  Raw ra = test::torus(40), rb = test::torus(23, 0.3);
  ra.scale(scale);
  rb.scale(scale);
  const auto fa = test::bvh<fcl::OBBRSS<S>>(ra), fb = test::bvh<fcl::OBBRSS<S>>(rb);
  const Model<S> a(ra.mesh()), b(rb.mesh());
  std::mt19937_64 g(1);
  std::uniform_real_distribution<double> u(0, 1);
  const double tolerance = std::is_same<S, double>::value ? 1e-10 : 2e-5;
  int apart = 0;
  for (int i = 0; i < poses; ++i) {
    const auto X = test::pose<S>(test::randomRotation(g), test::randomDirection(g) * scale);
    const auto Y = test::pose<S>(test::randomRotation(g),
                                 X.translation().template cast<double>() + test::randomDirection(g) * 6 * u(g) * scale);
    const bool touch = test::touching<S>(*fa, X, *fb, Y);
    const double expected = touch ? 0 : static_cast<double>(ask<S>(*fa, X, *fb, Y).min_distance);
    apart += !touch;
    const auto check = [&](const fcl::CollisionGeometry<S>& o1, const fcl::Transform3<S>& X1, const Raw& r1,
                           const fcl::CollisionGeometry<S>& o2, const fcl::Transform3<S>& X2, const Raw& r2) {
      const auto d = ask<S>(o1, X1, o2, X2);
      ASSERT_NEAR(d.min_distance, expected, tolerance * scale) << i;
      ASSERT_EQ(d.o1, &o1);
      ASSERT_EQ(d.o2, &o2);
      const auto &p = d.nearest_points[0], &q = d.nearest_points[1];
      ASSERT_NEAR((p - q).norm(), d.min_distance, tolerance * scale);
      ASSERT_LT((onTriangle(r1, d.b1, X1, p) - p.template cast<double>()).norm(), tolerance * scale);
      ASSERT_LT((onTriangle(r2, d.b2, X2, q) - q.template cast<double>()).norm(), tolerance * scale);
    };
    check(a, X, ra, b, Y, rb);
    check(b, Y, rb, a, X, ra);
    check(a, X, ra, *fb, Y, rb);
    check(*fb, Y, rb, a, X, ra);
  }
  EXPECT_GT(apart, poses / 3);
  EXPECT_LT(apart, poses);
}

TYPED_TEST(Distance, EqualsFclsOnRandomPoses) {
  checkAgainstFcl<TypeParam>(60, 1);
  checkAgainstFcl<TypeParam>(20, 1e-4);
  checkAgainstFcl<TypeParam>(20, 1e4);
}

// Far beyond their sizes, where float tells nothing apart any more.
TEST(DistanceDouble, OfWhatIsFarApart) {
  const Raw ra = test::torus(20), rb = test::torus(17, 0.2);
  const Modeld a(ra.mesh()), b(rb.mesh());
  const auto theirs = test::bvh<fcl::OBBRSSd>(ra), others = test::bvh<fcl::OBBRSSd>(rb);
  std::mt19937_64 g(14);
  for (const double far : {30.0, 1e2, 1e3, 1e4, 1e6, 1e9, 1e12, 1e15, 1e20, 1e40}) {
    SCOPED_TRACE(far);
    for (int i = 0; i < 4; ++i) {
      const auto X = test::pose<double>(test::randomRotation(g), test::randomDirection(g));
      const auto Y = test::pose<double>(test::randomRotation(g), test::randomDirection(g) * far);
      const double expected = ask<double>(*theirs, X, *others, Y).min_distance;
      EXPECT_NEAR(ask<double>(a, X, b, Y).min_distance, expected, 1e-12 * far);
      EXPECT_NEAR(ask<double>(b, Y, a, X).min_distance, expected, 1e-12 * far);
    }
  }
}

// The spheres' radii count until they are no more than a rounding of the distance, and ids name cells at any distance.
TEST(DistanceConservative, OfWhatIsFarApart) {
  Options options;
  options.answer = Answer::kConservative;
  options.depth = 4;
  const Raw tetrahedron{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 1, 2}, {0, 1, 3}, {0, 2, 3}, {1, 2, 3}}};
  const Modeld a(tetrahedron.mesh(), options), b(tetrahedron.mesh(), options);
  const auto I = fcl::Transform3d(fcl::Transform3d::Identity());
  const auto near = ask<double>(a, I, b, test::pose<double>(Eigen::Matrix3d::Identity(), {10, 0, 0}));
  const double radii = 9 - near.min_distance;
  EXPECT_GT(radii, 0.01);
  for (const double far : {1e4, 1e7, 1e8, 4e8, 1e12, 1e40}) {
    SCOPED_TRACE(far);
    const auto Y = test::pose<double>(Eigen::Matrix3d::Identity(), {far, 0, 0});
    const auto d = ask<double>(a, I, b, Y);
    EXPECT_NEAR(d.min_distance, far - 1 - radii, 1e-13 * far);
    EXPECT_GE(d.b1, 0);
    EXPECT_LT(d.b1, 512);
    if (far < 1e12) {
      const fcl::Sphered ball(0.5);
      EXPECT_LT(ask<double>(a, I, ball, Y).min_distance, far - 1.5 - radii / 4);
    }
  }
}

// A dense mesh beside triangles that are larger than it: boxes of leaves tell nothing about it. Brute force knows none.
TYPED_TEST(Distance, BesideMuchLargerTriangles) {
  using S = TypeParam;
  Raw large = test::torus(6, 0.3);
  large.scale(100);
  const Raw small = test::torus(12, 0.2);
  const Model<S> a(large.mesh()), b(small.mesh());
  const auto bvh = test::bvh<fcl::OBBRSS<S>>(large);
  const double rounding = std::is_same<S, double>::value ? 1e-11 : 2e-3;
  std::mt19937_64 g(19);
  std::uniform_real_distribution<double> u(0, 1);
  int apart = 0;
  for (int i = 0; i < 12; ++i) {
    const auto X = test::pose<S>(test::randomRotation(g), test::randomDirection(g) * 50);
    const auto Y = test::pose<S>(test::randomRotation(g), test::randomDirection(g) * (10 + 200 * u(g)));
    const double expected = bruteForce<S>(large, X, small, Y);
    if (expected < 1) continue;
    ++apart;
    EXPECT_NEAR(ask<S>(a, X, b, Y).min_distance, expected, rounding) << i;
    EXPECT_NEAR(ask<S>(b, Y, a, X).min_distance, expected, rounding) << i;
    EXPECT_NEAR(ask<S>(*bvh, X, b, Y).min_distance, expected, rounding) << i;
    for (const double share : {0.5, 0.999, 1.001, 2.0}) {
      const bool closer = share > 1;
      EXPECT_EQ(isCloserThan<S>(&a, X, &b, Y, static_cast<S>(share * expected)), closer) << i << ": " << share;
      EXPECT_EQ(isCloserThan<S>(&b, Y, &a, X, static_cast<S>(share * expected)), closer) << i << ": " << share;
    }
  }
  EXPECT_GT(apart, 5);
}

// A part in a room of posts and panels: their leaves are as large as the room. Some panels lie there forty times.
TYPED_TEST(Distance, BetweenWallsAndPosts) {
  using S = TypeParam;
  Raw room = test::box({-4, -4, -0.1}, {4, 4, 0});
  for (int i = 0; i < 8; ++i) {
    const double x = i - 3.5, y = i % 3 - 1.2;
    room.add(test::box({x, y, 0}, {x + 0.02, y + 0.05, 4}));
    room.add(test::box({x, -4, 0.4 * i}, {x + 0.9, 4, 0.4 * i + 0.01}));
  }
  Raw heap = room;
  for (int i = 0; i < 40; ++i) heap.addTriangle({-4, -4, 5}, {4, -4, 5}, {-4, 4, 5});
  Raw part = test::torus(16, 0.3);
  part.scale(0.25);
  const Model<S> b(part.mesh());
  const double rounding = std::is_same<S, double>::value ? 1e-12 : 1e-5;
  std::mt19937_64 g(20);
  std::uniform_real_distribution<double> u(-1, 1);
  for (const Raw& raw : {room, heap}) {
    const Model<S> a(raw.mesh());
    int apart = 0;
    for (int i = 0; i < 30; ++i) {
      const Eigen::Matrix3d turn = test::randomRotation(g);
      const auto X = test::pose<S>(turn, test::randomDirection(g));
      const Eigen::Vector3d at(3 * u(g), 3 * u(g), 2.5 + 2.4 * u(g));
      const auto Y = test::pose<S>(test::randomRotation(g), turn * at + X.translation().template cast<double>());
      const double expected = bruteForce<S>(raw, X, part, Y);
      apart += expected > 0;
      EXPECT_NEAR(ask<S>(a, X, b, Y).min_distance, expected, rounding) << i;
      EXPECT_NEAR(ask<S>(b, Y, a, X).min_distance, expected, rounding) << i;
    }
    EXPECT_GT(apart, 10);
  }
}

TEST(DistanceDouble, SignedOfWhatIsInsideASolid) {
  Options options;
  options.solid = true;
  const Modeld hull(test::box({-2, -2, -2}, {2, 2, 2}).mesh(), options), inside(test::torus(12).mesh());
  const auto I = fcl::Transform3d(fcl::Transform3d::Identity());
  const double surfaces = ask<double>(Modeld(test::box({-2, -2, -2}, {2, 2, 2}).mesh()), I, inside, I).min_distance;
  EXPECT_GT(surfaces, 0.5);
  EXPECT_EQ(ask<double>(hull, I, inside, I).min_distance, 0);
  const auto d = ask<double>(hull, I, inside, I, true);
  EXPECT_NEAR(d.min_distance, -surfaces, 1e-12);
  EXPECT_EQ(d.b1, -1) << "Contact::NONE";
}

TEST(DistanceDouble, MovingByItTouchesAndNotBefore) {
  const Raw ra = test::torus(60), rb = test::torus(31, 0.2);
  const Modeld a(ra.mesh()), b(rb.mesh());
  std::mt19937_64 g(3);
  std::uniform_real_distribution<double> u(0, 1);
  const auto I = fcl::Transform3d(fcl::Transform3d::Identity());
  for (int i = 0; i < 40; ++i) {
    auto Y = test::pose<double>(test::randomRotation(g), test::randomDirection(g) * (2.5 + 3 * u(g)));
    const auto d = ask<double>(a, I, b, Y);
    if (d.min_distance <= 0) continue;
    const Eigen::Vector3d displacement = (d.nearest_points[0] - d.nearest_points[1]).normalized(),
                          start = Y.translation();
    Y.translation() = start + displacement * (d.min_distance - 1e-9);
    EXPECT_FALSE(test::touching<double>(a, I, b, Y)) << i;
    Y.translation() = start + displacement * (d.min_distance + 1e-9);
    EXPECT_TRUE(test::touching<double>(a, I, b, Y)) << i;
  }
}

// Slivers, segments, points, duplicates, a soup; and one triangle against many. Brute force knows no tree.
TEST(DistanceDouble, DegenerateMeshesAgainstBruteForce) {
  const Raw meshes[] = {test::adversarial(), test::soup(60, 4), test::torus(6)};
  std::mt19937_64 g(4);
  const auto I = fcl::Transform3d(fcl::Transform3d::Identity());
  for (const Raw& ra : meshes) {
    for (const Raw& rb : meshes) {
      const Modeld a(ra.mesh()), b(rb.mesh());
      for (int i = 0; i < 6; ++i) {
        const auto Y = test::pose<double>(test::randomRotation(g), test::randomDirection(g) * i * 0.8);
        const double expected = bruteForce<double>(ra, I, rb, Y);
        ASSERT_NEAR(ask<double>(a, I, b, Y).min_distance, expected, 1e-12);
        ASSERT_NEAR(ask<double>(b, Y, a, I).min_distance, expected, 1e-12);
      }
    }
  }
}

TEST(NearestPoints, EqualFclsTriangleDistance) {
  std::mt19937_64 g(5);
  std::uniform_real_distribution<double> u(-1, 1);
  int apart = 0;
  for (int round = 0; round < 20000; ++round) {
    query::Corners p, q;
    const double size = std::pow(10.0, u(g));
    const Eigen::Vector3d away = 2 * test::randomDirection(g) * size;
    for (int k = 0; k < 3; ++k) {
      p[k] = Eigen::Vector3d(u(g), u(g), u(g));
      q[k] = size * Eigen::Vector3d(u(g), u(g), u(g)) + away;
    }
    Eigen::Vector3d a, b, fa, fb;
    const double d = query::nearestPoints(p, q, a, b);
    const double expected = fcl::detail::TriangleDistance<double>::triDistance(p.data(), q.data(), fa, fb);
    ASSERT_NEAR(d, expected, 1e-10) << round;
    ASSERT_NEAR((a - b).norm(), d, 1e-12);
    ASSERT_LT((query::closestPoint(a, p) - a).norm(), 1e-9);
    ASSERT_LT((query::closestPoint(b, q) - b).norm(), 1e-9);
    apart += d > 0;
  }
  EXPECT_GT(apart, 10000);
  EXPECT_LT(apart, 20000);
}

TEST(DistanceRequest, MinimaRunAndErrorsAreTaken) {
  const Raw ra = test::torus(60), rb = test::torus(31, 0.2);
  const Modeld a(ra.mesh()), b(rb.mesh());
  const auto I = fcl::Transform3d(fcl::Transform3d::Identity());
  const auto Y = test::pose<double>(Eigen::Matrix3d::Identity(), Eigen::Vector3d(4, 0.3, 0.5));
  const double exact = ask<double>(a, I, b, Y).min_distance;
  ASSERT_GT(exact, 0.5);

  fcl::DistanceRequestd request;
  fcl::DistanceResultd result;
  result.min_distance = exact / 2;
  EXPECT_EQ(fcl::distance(&a, I, &b, Y, request, result), exact / 2) << "something nearer is known";
  EXPECT_EQ(result.o1, nullptr);
  result.min_distance = exact * 2;
  EXPECT_NEAR(fcl::distance(&a, I, &b, Y, request, result), exact, 1e-12);
  EXPECT_EQ(result.o1, &a);

  result.clear();
  result.min_distance = 0;
  EXPECT_EQ(fcl::distance(&a, I, &b, Y, request, result), 0) << "satisfied before it starts";

  for (const double error : {1e-3, 0.1, 0.5}) {
    const Modeld fresh(ra.mesh()), other(rb.mesh());
    fcl::DistanceRequestd loose(true, false, error, 0);
    fcl::DistanceResultd relative;
    const double r = fcl::distance(&fresh, I, &other, Y, loose, relative);
    EXPECT_GE(r, exact * (1 - 1e-12));
    EXPECT_LE(r, exact * (1 + error) * (1 + 1e-12));
    fcl::DistanceRequestd looser(true, false, 0, error);
    fcl::DistanceResultd absolute;
    const double s = fcl::distance(&fresh, I, &other, Y, looser, absolute);
    EXPECT_GE(s, exact * (1 - 1e-12));
    EXPECT_LE(s, exact + error + 1e-12);
  }
}

// The first answer of a walk is often off by more than these; the smaller of the two errors counts, as for FCL.
TEST(DistanceRequest, SmallErrorsAreInTheCallersUnit) {
  std::mt19937_64 g(8);
  const auto I = fcl::Transform3d(fcl::Transform3d::Identity());
  for (const double scale : {1e-3, 1e3}) {
    Raw ra = test::torus(30, 0.2), rb = test::torus(31, 0.3);
    const auto ma = ra.scale(scale).mesh(), mb = rb.scale(scale).mesh();
    const Modeld a(ma), b(mb);
    const auto bvh = test::bvh<fcl::OBBRSSd>(rb);
    for (int i = 0; i < 40; ++i) {
      const auto Y = test::pose<double>(test::randomRotation(g), test::randomDirection(g) * 3 * scale);
      const double exact = ask<double>(a, I, b, Y).min_distance;
      for (const fcl::CollisionGeometryd* partner : test::Geometries<double>{&b, bvh.get()}) {
        for (const double error : {1e-6, 1e-5, 1e-4, 1e-3}) {
          const double absolute = error * scale;
          fcl::DistanceResultd with_absolute, with_relative;
          fcl::distance(&a, I, partner, Y, fcl::DistanceRequestd(true, false, 1e9, absolute), with_absolute);
          EXPECT_NEAR(with_absolute.min_distance, exact + absolute / 2, absolute * 0.501);
          fcl::distance(&a, I, partner, Y, fcl::DistanceRequestd(true, false, error, 1e9), with_relative);
          EXPECT_NEAR(with_relative.min_distance, exact * (1 + error / 2), exact * error * 0.501);
        }
      }
    }
  }
}

TEST(DistanceRequest, TouchingIsZeroOrTheDepthOfAContact) {
  const Modeld a(test::torus(40).mesh()), b(test::torus(40).mesh());
  const auto I = fcl::Transform3d(fcl::Transform3d::Identity());
  const auto Y = test::pose<double>(Eigen::Matrix3d::Identity(), Eigen::Vector3d(1.3, 0.2, 0.1));
  ASSERT_TRUE(test::touching<double>(a, I, b, Y));
  const auto d = ask<double>(a, I, b, Y);
  EXPECT_EQ(d.min_distance, 0);
  EXPECT_LT((d.nearest_points[0] - d.nearest_points[1]).norm(), 1e-12);
  const auto s = ask<double>(a, I, b, Y, true);
  EXPECT_LT(s.min_distance, 0);
  // Which of the contacts is found first may depend on what is resident.
  fcl::CollisionRequestd request(100000, true);
  fcl::CollisionResultd result;
  fcl::collide(&a, I, &b, Y, request, result);
  std::vector<fcl::Contactd> contacts;
  result.getContacts(contacts);
  EXPECT_TRUE(std::any_of(contacts.begin(), contacts.end(), [&](const fcl::Contactd& c) {
    return c.b1 == s.b1 && c.b2 == s.b2 && c.penetration_depth == -s.min_distance && c.pos == s.nearest_points[0];
  }));

  // A shell inside a shell is as far as the surfaces are.
  Raw small = test::torus(20);
  small.scale(1e-3);
  const Modeld inside(small.mesh());
  const auto hole = ask<double>(a, I, inside, I);
  EXPECT_GT(hole.min_distance, 0.1);
  EXPECT_EQ(ask<double>(a, I, inside, I, true).min_distance, hole.min_distance);
}

// A result that was used before has all its fields of the pair that was asked last.
TEST(DistanceRequest, ResultsOfEarlierPairsAreOverwritten) {
  Options options;
  options.solid = true;
  const Modeld box(test::box({-1, -1, -1}, {1, 1, 1}).mesh(), options);
  const Modeld inner(test::torus(8).scale(0.1).mesh()), other(test::torus(6).mesh());
  const fcl::Sphered ball(0.1);
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  const auto there = test::pose<double>(I.linear(), {0.5, 0.2, 0.3}), away = test::pose<double>(I.linear(), {9, 0, 0});
  for (const fcl::CollisionGeometryd* partner : test::Geometries<double>{&inner, &ball}) {
    for (const bool is_signed : {false, true}) {
      fcl::DistanceRequestd request;
      request.enable_nearest_points = true;
      request.enable_signed_distance = is_signed;
      fcl::DistanceResultd fresh, used;
      // Which of several triangles that share the nearest vertex is named may depend on what has grown.
      fcl::distance(&box, I, partner, there, request, used);
      fcl::distance(&box, I, partner, there, request, fresh);
      fcl::distance(&other, I, &other, away, request, used);
      used.min_distance = std::numeric_limits<double>::max();
      fcl::distance(&box, I, partner, there, request, used);
      EXPECT_EQ(used.min_distance, fresh.min_distance);
      EXPECT_EQ(used.o1, &box);
      EXPECT_EQ(used.o2, partner);
      EXPECT_EQ(used.b1, fresh.b1);
      EXPECT_EQ(used.b2, fresh.b2);
      EXPECT_EQ(used.nearest_points[0], fresh.nearest_points[0]);
      EXPECT_EQ(used.nearest_points[1], fresh.nearest_points[1]);
    }
  }
}

TEST(DistanceConservative, IsNeverMoreAndNearerWithDepth) {
  const Raw ra = test::torus(60), rb = test::torus(31, 0.2);
  const Modeld exact_a(ra.mesh()), exact_b(rb.mesh());
  const auto fb = test::bvh<fcl::OBBRSSd>(rb);
  std::mt19937_64 g(6);
  const auto I = fcl::Transform3d(fcl::Transform3d::Identity());
  for (const Subdivision subdivision : {Subdivision::kOctree, Subdivision::kBono}) {
    for (int i = 0; i < test::repetitions(5); ++i) {
      const auto Y = test::pose<double>(test::randomRotation(g), test::randomDirection(g) * (2.2 + 0.5 * i));
      const double exact = ask<double>(exact_a, I, exact_b, Y).min_distance;
      double before = -1;
      for (const int depth : {4, 6, 8}) {
        Options options;
        options.answer = Answer::kConservative;
        options.subdivision = subdivision;
        options.depth = depth;
        const Modeld a(ra.mesh(), options), b(rb.mesh(), options);
        const double d = ask<double>(a, I, b, Y).min_distance;
        EXPECT_LE(d, exact + 1e-12);
        EXPECT_GE(d, before - 0.15 / depth) << "spheres shrink with depth";
        EXPECT_EQ(d > 0, !test::touching<double>(a, I, b, Y));
        EXPECT_NEAR(ask<double>(b, Y, a, I).min_distance, d, 1e-12);
        // Spheres against triangles lie between.
        for (const fcl::CollisionGeometryd* partner : test::Geometries<double>{&exact_b, fb.get()}) {
          const double mixed = ask<double>(a, I, *partner, Y).min_distance;
          EXPECT_GE(mixed, d - 1e-12);
          EXPECT_LE(mixed, exact + 1e-12);
          EXPECT_NEAR(ask<double>(*partner, Y, a, I).min_distance, mixed, 1e-12);
        }
        before = d;
      }
      EXPECT_NEAR(before, exact, 0.1);
    }
  }
}

// Faces that are parallel, of boxes that no power of two divides, have many pairs that are equally near.
TEST(DistanceConservative, IsThatOfTheNearestSpheres) {
  std::mt19937_64 g(21);
  const auto I = fcl::Transform3d(fcl::Transform3d::Identity());
  const auto leavesOf = [](const Modeld& model) {
    const int depth = model.options().depth;
    Modeld whole(model.mesh(), model.options());
    whole.expandAll(depth);
    std::vector<NodeView> leaves;
    whole.visit([&](const NodeView& node) {
      if (node.level == depth) leaves.push_back(node);
    });
    return leaves;
  };
  const std::pair<Raw, Raw> pairs[] = {
      {test::torus(20), test::torus(17, 0.2)},
      {test::box({0, 0, 0}, {1.3, 1, 0.9}), test::box({-0.6, -0.4, 0}, {0.3, 0.4, 1})}};
  for (const auto& [ra, rb] : pairs) {
    const bool flat = ra.triangles.size() == 12;
    for (const Subdivision subdivision : {Subdivision::kOctree, Subdivision::kBono}) {
      for (const int depth : {1, 2, 4, 6}) {
        Options options;
        options.answer = Answer::kConservative;
        options.subdivision = subdivision;
        options.depth = depth;
        const Modeld a(ra.mesh(), options), b(rb.mesh(), options);
        const auto of_a = leavesOf(a), of_b = leavesOf(b);
        for (int i = 0; i < 5; ++i) {
          const Eigen::Matrix3d R = flat && i < 3 ? Eigen::Matrix3d::Identity() : test::randomRotation(g);
          const Eigen::Vector3d t = flat && i < 3 ? Eigen::Vector3d(0.3, 0.2, 1.2 * i + 1)
                                                  : Eigen::Vector3d(test::randomDirection(g) * (2.6 + i));
          const auto Y = test::pose<double>(R, t);
          double expected = std::numeric_limits<double>::infinity();
          for (const NodeView& v : of_b) {
            const Eigen::Vector3d center = Y * v.center;
            for (const NodeView& u : of_a)
              expected = std::min(expected, (center - u.center).norm() - u.radius - v.radius);
          }
          SCOPED_TRACE(testing::Message() << flat << depth << i);
          EXPECT_NEAR(ask<double>(a, I, b, Y).min_distance, std::max(expected, 0.0), 1e-11);
          EXPECT_NEAR(ask<double>(b, Y, a, I).min_distance, std::max(expected, 0.0), 1e-11);
        }
      }
    }
  }
}

TEST(DistanceGrowth, OnlyWhatTheBoundNeedsAndNothingTwice) {
  const Raw raw = test::torus(100);
  Modeld a(raw.mesh()), b(raw.mesh());
  const auto I = fcl::Transform3d(fcl::Transform3d::Identity());
  const auto Y = test::pose<double>(Eigen::Matrix3d::Identity(), Eigen::Vector3d(3.5, 0.2, 0.1));
  const double d = ask<double>(a, I, b, Y).min_distance;
  const Statistics first = a.statistics();
  EXPECT_GT(first.resident_nodes, 1u);
  Modeld whole(a.mesh());
  whole.expandAll(static_cast<int>(first.nodes_per_level.size()));
  EXPECT_LT(first.resident_nodes, whole.statistics().resident_nodes / 2);
  EXPECT_EQ(ask<double>(a, I, b, Y).min_distance, d);
  EXPECT_EQ(a.statistics().expansions, first.expansions);
  EXPECT_EQ(ask<double>(a, I, a, Y).min_distance, ask<double>(a, I, b, Y).min_distance) << "one model on both sides";
}

// FCL's managers ask most pairs only whether they are nearer than the nearest so far.
TEST(DistanceGrowth, NothingWhereBoundingBoxesAreFartherThanWhatIsKnown) {
  const Raw raw = test::torus(100);
  const Modeld a(raw.mesh()), b(raw.mesh());
  const auto bvh = test::bvh<fcl::OBBRSSd>(raw);
  const auto I = fcl::Transform3d(fcl::Transform3d::Identity());
  const auto Y = test::pose<double>(Eigen::Matrix3d::Identity(), Eigen::Vector3d(5, 0.2, 0.1));
  const fcl::CollisionGeometryd* ga = &a;
  for (const fcl::CollisionGeometryd* gb : test::Geometries<double>{&b, bvh.get()}) {
    fcl::DistanceResultd result;
    result.min_distance = 1.5;  // 5 is 2.6 more than the diameter
    EXPECT_EQ(fcl::distance(ga, I, gb, Y, fcl::DistanceRequestd(true), result), 1.5);
    EXPECT_EQ(result.o1, nullptr);
    EXPECT_EQ(a.statistics().resident_nodes, 1u);
  }
  const double exact = ask<double>(a, I, b, Y).min_distance;
  for (const double more : {1e-9, 1e-3}) {
    fcl::DistanceResultd result;
    result.min_distance = exact + more;
    EXPECT_NEAR(fcl::distance(ga, I, &b, Y, fcl::DistanceRequestd(true), result), exact, 1e-12);
    EXPECT_EQ(result.o1, ga);
  }
}

TEST(DistanceThreads, FreshModelsPruningAndCollisions) {
  const Raw raw = test::torus(60);
  std::mt19937_64 g(7);
  std::uniform_real_distribution<double> u(0, 1);
  const auto I = fcl::Transform3d(fcl::Transform3d::Identity());
  std::vector<fcl::Transform3d> poses;
  std::vector<double> expected;
  const Modeld calm(raw.mesh());
  for (int i = 0; i < 40; ++i) {
    poses.push_back(test::pose<double>(test::randomRotation(g), test::randomDirection(g) * (1 + 3 * u(g))));
    expected.push_back(ask<double>(calm, I, calm, poses.back()).min_distance);
  }
  Modeld a(raw.mesh()), b(raw.mesh());
  std::atomic<int> wrong{0};
  test::ThreadGroup(4, [&](std::size_t k) {
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const std::size_t n = (i * 7 + k * 11) % poses.size();
      const double d =
          k % 2 ? ask<double>(b, poses[n], a, I).min_distance : ask<double>(a, I, b, poses[n]).min_distance;
      wrong += !(std::abs(d - expected[n]) < 1e-12);
      wrong += test::touching<double>(a, I, b, poses[n]) != (expected[n] <= 0);
      if (i % 13 == k) a.prune(Clock::now() + std::chrono::hours(1));
    }
  });
  EXPECT_EQ(wrong, 0);
}

}  // namespace
}  // namespace bocst
