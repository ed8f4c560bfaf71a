// SPDX-License-Identifier: BSD-3-Clause
// Triangles that are segments, points or slivers, meshes without extent, of any size and far away: every query against
// exact arithmetic.
#include <fcl/narrowphase/continuous_collision.h>
#include <fcl/narrowphase/distance.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "conformance/reference.h"
#include "exact.h"
#include "geometry/triangle.h"

namespace bocst {
namespace {

using Eigen::Vector3d;
using query::Corners;
using test::Raw;

Raw rawOf(const Corners& t) {
  Raw raw;
  raw.vertices = {t[0], t[1], t[2]};
  raw.triangles.emplace_back(0, 1, 2);
  return raw;
}

std::ostream& operator<<(std::ostream& out, const Corners& t) {
  const Eigen::IOFormat row(17, Eigen::DontAlignCols, ", ", ", ", "", "", "(", ")");
  return out << t[0].transpose().format(row) << t[1].transpose().format(row) << t[2].transpose().format(row);
}

Options optionsOf(Answer answer, double margin = 0) {
  Options options;
  options.answer = answer;
  options.margin = margin;
  options.subdivision = margin > 0 ? Subdivision::kOctree : Subdivision::kBono;
  return options;
}

template <typename S>
fcl::Transform3<S> at(const Eigen::Isometry3d& X) {
  return test::pose<S>(X.linear(), X.translation());
}

template <typename S>
S distance(const fcl::CollisionGeometry<S>& a, const fcl::Transform3<S>& X, const fcl::CollisionGeometry<S>& b,
           const fcl::Transform3<S>& Y) {
  fcl::DistanceRequest<S> request;
  request.enable_nearest_points = true;
  fcl::DistanceResult<S> result;
  fcl::distance(&a, X, &b, Y, request, result);
  return result.min_distance;
}

template <typename S>
bool everTouch(const fcl::CollisionGeometry<S>& a, const fcl::Transform3<S>& X, const fcl::Transform3<S>& X_end,
               const fcl::CollisionGeometry<S>& b, const fcl::Transform3<S>& Y, const fcl::Transform3<S>& Y_end) {
  fcl::ContinuousCollisionRequest<S> request;
  request.ccd_motion_type = fcl::CCDM_TRANS;
  fcl::ContinuousCollisionResult<S> result;
  fcl::continuousCollide(&a, X, X_end, &b, Y, Y_end, request, result);
  return result.is_collide;
}

/// One pair, q placed by X, in every query, both orders, beside a model and beside a BVHModel.
template <typename S>
void expectRight(const Corners& p, const Corners& q, const Eigen::Isometry3d& X) {
  constexpr double kEpsilon = static_cast<double>(std::numeric_limits<S>::epsilon()), kMargin = 0.01;
  std::ostringstream name;
  name << p << " x " << q << " at " << X.translation().transpose();
  SCOPED_TRACE(name.str());
  const auto apart = static_cast<double>(std::sqrt(exact::squaredDistance(p, X, q)));
  // What poses and coordinates may be off by.
  const double rounding = 64 * kEpsilon * 8;
  const auto I = at<S>(Eigen::Isometry3d::Identity()), Y = at<S>(X);
  const Vector3d away = Vector3d(3, 5, 4);
  auto Y_away = Y;
  Y_away.translation() += away.cast<S>();
  const Raw rp = rawOf(p), rq = rawOf(q);
  const auto mesh_p = rp.mesh(), mesh_q = rq.mesh();
  const auto bvh_p = test::bvh<fcl::OBBRSS<S>>(rp), bvh_q = test::bvh<fcl::OBBRSS<S>>(rq);
  const Model<S> a(mesh_p), b(mesh_q);
  const Model<S> wide(mesh_p, optionsOf(Answer::kExact, kMargin));
  const Model<S> coarse_a(mesh_p, optionsOf(Answer::kConservative)), coarse_b(mesh_q, optionsOf(Answer::kConservative));
  using Geometry = fcl::CollisionGeometry<S>;
  const std::pair<const Geometry*, const Geometry*> exact_pairs[] = {{&a, &b}, {&a, bvh_q.get()}, {bvh_p.get(), &b}};
  const bool degenerate = query::isDegenerate(p) || query::isDegenerate(q);
  for (const auto& [one, two] : exact_pairs) {
    const bool touching = test::touching<S>(*one, I, *two, Y), swapped = test::touching<S>(*two, Y, *one, I);
    const std::size_t contacts = test::pairs<S>(*one, I, *two, Y).size();
    ASSERT_EQ(touching, swapped);
    ASSERT_EQ(contacts, touching ? 1u : 0u);
    if (apart == 0 || (degenerate && apart > rounding)) {
      ASSERT_EQ(touching, apart == 0) << apart;
    }
    ASSERT_NEAR(static_cast<double>(distance<S>(*one, I, *two, Y)), apart, rounding);
    ASSERT_NEAR(static_cast<double>(distance<S>(*two, Y, *one, I)), apart, rounding);
    if (apart == 0) {
      ASSERT_TRUE(everTouch<S>(*one, I, I, *two, Y_away, Y));
      ASSERT_TRUE(everTouch<S>(*two, Y_away, Y, *one, I, I));
    }
  }
  for (const Geometry* two : {static_cast<const Geometry*>(&b), static_cast<const Geometry*>(bvh_q.get())}) {
    if (std::abs(apart - kMargin) > rounding) {
      ASSERT_EQ(test::touching<S>(wide, I, *two, Y), apart < kMargin) << apart;
      ASSERT_EQ(test::touching<S>(*two, Y, wide, I), apart < kMargin) << apart;
    }
    if (apart > 0) continue;
    for (const Geometry* one : {static_cast<const Geometry*>(&a), static_cast<const Geometry*>(&coarse_a)}) {
      ASSERT_TRUE(test::touching<S>(*one, I, coarse_b, Y));
      ASSERT_TRUE(test::touching<S>(coarse_b, Y, *one, I));
    }
    ASSERT_TRUE(test::touching<S>(coarse_a, I, *two, Y));
    ASSERT_TRUE(test::touching<S>(*two, Y, coarse_a, I));
  }
  // A ball about a corner of p that q reaches, or just does not.
  const fcl::Sphere<S> ball(static_cast<S>(0.5));
  const Corners center = {p[0], p[0], p[0]};
  const auto far = static_cast<double>(std::sqrt(exact::squaredDistance(center, X, q)));
  auto at_corner = I;
  at_corner.translation() = p[0].cast<S>();
  if (std::abs(far - 0.5) > 1e-5) {
    ASSERT_EQ(test::touching<S>(ball, at_corner, b, Y), far < 0.5) << far;
    ASSERT_EQ(test::touching<S>(b, Y, ball, at_corner), far < 0.5) << far;
    ASSERT_NEAR(static_cast<double>(distance<S>(b, Y, ball, at_corner)), std::max(far - 0.5, 0.0), 1e-5);
  }
}

// Collinear corners, up to the rounding of 0.3 d, through the inside of a triangle.
template <typename S>
void throughTheInside() {
  const Corners p = {{{-1, -1, 0}, {2, -1, 0}, {-1, 2, 0}}};
  int count = 0, orders = 0;
  for (int x = -9; x <= 9; ++x) {
    for (int y = -9; y <= 9; ++y) {
      for (int z = 1; z <= 9; ++z) {
        if ((count++) % (std::is_same<S, double>::value ? 1 : 5) != 0) continue;
        const Vector3d d = Vector3d(x / 10.0, y / 10.0, z / 10.0).cast<S>().template cast<double>();
        const Corners q = {-d, d, (0.3 * d).cast<S>().template cast<double>()};
        ASSERT_TRUE(exact::intersect(p, q));
        ASSERT_NO_FATAL_FAILURE(expectRight<S>(p, q, Eigen::Isometry3d::Identity()));
        ++orders;
      }
    }
  }
  EXPECT_GT(orders, 600);
}
TEST(DegenerateDouble, ThroughTheInside) { throughTheInside<double>(); }
TEST(DegenerateFloat, ThroughTheInside) { throughTheInside<float>(); }

// Segments, points and triangles on small grids, where touching is common, by poses that round nothing.
template <typename S>
void onGrids(int rounds) {
  std::mt19937_64 g(7);
  int hits = 0, degenerate = 0;
  for (int i = 0; i < rounds; ++i) {
    const auto most = static_cast<int>(1 + g() % 2);
    const double unit = g() % 2 ? 1 : 0.5;
    const auto u = [&] { return unit * (static_cast<int>(g() % static_cast<unsigned>(2 * most + 1)) - most); };
    Corners p, q;
    for (Corners* t : {&p, &q}) {
      for (Vector3d& v : *t) v = Vector3d(u(), u(), u());
      if (g() % 3) (*t)[2] = (*t)[0] + 0.5 * static_cast<double>(g() % 4) * ((*t)[1] - (*t)[0]);
      if (g() % 6 == 0) (*t)[1] = (*t)[0];
      if (g() % 12 == 0) (*t)[2] = (*t)[0];
      std::shuffle(std::begin(*t), std::end(*t), g);
    }
    Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
    if (g() % 2) {
      const auto k = static_cast<int>(g() % 3);
      X.linear() << Vector3d::Unit(k), Vector3d::Unit((k + 1) % 3), Vector3d::Unit((k + 2) % 3);
      X.translation() = Vector3d(u(), u(), u());
    }
    hits += exact::squaredDistance(p, X, q) == 0;
    degenerate += query::isDegenerate(p) || query::isDegenerate(q);
    ASSERT_NO_FATAL_FAILURE(expectRight<S>(p, q, X)) << "round " << i;
  }
  EXPECT_GT(hits, rounds / 12);
  EXPECT_LT(hits, rounds * 7 / 8);
  EXPECT_GT(degenerate, rounds / 2);
}
TEST(DegenerateDouble, OnGrids) { onGrids<double>(3000); }
TEST(DegenerateFloat, OnGrids) { onGrids<float>(1500); }

// Exact contacts that rounding tears apart in FCL's test: points of a segment or a sliver that lie in no plane of
// FCL's.
template <typename S>
void slivers(int rounds) {
  std::mt19937_64 g(8);
  std::uniform_real_distribution<double> u(-1, 1);
  const auto inS = [](const Vector3d& v) { return Vector3d(v.cast<S>().template cast<double>()); };
  int hits = 0;
  for (int i = 0; i < rounds; ++i) {
    Corners p, q;
    for (Vector3d& v : p) v = inS(Vector3d(u(g), u(g), u(g)));
    if (g() % 2) p[2] = inS(p[0] + u(g) * (p[1] - p[0]));
    // From a corner of p, or through a point of an edge as far as S can say it.
    const Vector3d start = g() % 2 ? p[g() % 3] : inS((p[0] + p[1]) / 2), displacement = Vector3d(u(g), u(g), u(g));
    q[0] = start;
    q[1] = inS(start + displacement);
    q[2] = inS(start + 0.3 * (q[1] - start));
    std::shuffle(std::begin(q), std::end(q), g);
    hits += exact::intersect(p, q);
    Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
    ASSERT_NO_FATAL_FAILURE(expectRight<S>(p, q, X)) << "round " << i;
  }
  EXPECT_GT(hits, rounds / 3);
}
TEST(DegenerateDouble, SliversAtContact) { slivers<double>(1500); }
TEST(DegenerateFloat, SliversAtContact) { slivers<float>(1000); }

// With a rotation, placing rounds; what touches in exact arithmetic is said to touch all the same.
TEST(DegenerateDouble, InAnyPose) {
  std::mt19937_64 g(9);
  std::uniform_real_distribution<double> u(-1, 1);
  int through = 0;
  for (int i = 0; i < 1000; ++i) {
    Corners p, q;
    for (Vector3d& v : p) v = Vector3d(u(g), u(g), u(g));
    const Vector3d inside = 0.3 * p[0] + 0.3 * p[1] + 0.4 * p[2];
    Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
    X.linear() = test::randomRotation(g);
    X.translation() = Vector3d(u(g), u(g), u(g));
    const Vector3d d(u(g), u(g), u(g)), middle = X.inverse() * inside;
    q[0] = middle - d;
    q[1] = middle + d;
    q[2] = middle + 0.3 * d;
    if (exact::squaredDistance(p, X, q) > 0) continue;
    ++through;
    ASSERT_NO_FATAL_FAILURE(expectRight<double>(p, q, X)) << "round " << i;
  }
  EXPECT_GT(through, 800);
}

double exactDistance(const Raw& a, const Raw& b, const Eigen::Isometry3d& X_AB) {
  long double least = std::numeric_limits<long double>::infinity();
  for (const auto& s : a.triangles) {
    const Corners p = {a.vertices[s[0]], a.vertices[s[1]], a.vertices[s[2]]};
    for (const auto& t : b.triangles) {
      const Corners q = {b.vertices[t[0]], b.vertices[t[1]], b.vertices[t[2]]};
      least = std::min(least, exact::squaredDistance(p, X_AB, q));
    }
  }
  return static_cast<double>(std::sqrt(least));
}

double largest(const Raw& raw) {
  double size = 0;
  for (const Vector3d& v : raw.vertices) size = std::max(size, v.cwiseAbs().maxCoeff());
  return size;
}

// Meshes of all sizes, points among them, beside meshes of all sizes: apart, or with a corner in common.
template <typename S>
void ofAnySize(const std::vector<double>& sizes) {
  std::mt19937_64 g(10);
  std::uniform_real_distribution<double> u(-1, 1);
  const auto I = at<S>(Eigen::Isometry3d::Identity());
  int count = 0, meeting = 0;
  for (const double size_a : sizes) {
    for (const double size_b : sizes) {
      for (int i = 0; i < 6; ++i) {
        Raw ra, rb;
        for (auto [raw, size] : {std::pair(&ra, size_a), std::pair(&rb, size_b)}) {
          // One in three is a point, at its own origin or elsewhere.
          const bool point = g() % 3 == 0;
          const Vector3d middle = Vector3d(u(g), u(g), u(g)) * size * static_cast<double>(g() % 2);
          for (int k = 0; k < 9; ++k) {
            const Vector3d v = middle + (point ? 0.0 : size) * Vector3d(u(g), u(g), u(g));
            raw->vertices.push_back(v.cast<S>().template cast<double>());
            if (k % 3 == 0) raw->triangles.emplace_back(k, k + 1, k + 2);
          }
        }
        if (i % 2) {
          // A corner in common, as far as the smaller one's coordinates can say.
          const Vector3d corner = ra.vertices[4];
          for (Vector3d& v : rb.vertices) v = (v + corner).cast<S>().template cast<double>();
          rb.vertices[4] = corner;
        }
        const Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
        const double apart = exactDistance(ra, rb, X);
        const double rounding =
            64 * static_cast<double>(std::numeric_limits<S>::epsilon()) * (largest(ra) + largest(rb)) +
            static_cast<double>(std::numeric_limits<S>::denorm_min()) + 0x1p-280;
        std::ostringstream name;
        name << size_a << " x " << size_b << ", round " << i << ", apart " << apart;
        SCOPED_TRACE(name.str());
        ++count;
        meeting += apart == 0;
        const auto fb = test::bvh<fcl::OBBRSS<S>>(rb);
        for (const Subdivision subdivision : {Subdivision::kOctree, Subdivision::kBono}) {
          Options options, conservative;
          options.subdivision = conservative.subdivision = subdivision;
          conservative.answer = Answer::kConservative;
          const Model<S> a(ra.mesh(), options), b(rb.mesh(), options);
          const Model<S> ca(ra.mesh(), conservative), cb(rb.mesh(), conservative);
          using Geometry = fcl::CollisionGeometry<S>;
          const Geometry* const ones[] = {&a, &ca};
          const Geometry* const twos[] = {&b, &cb, fb.get()};
          for (const Geometry* one : ones) {
            for (const Geometry* two : twos) {
              const bool exact = one == &a && two != &cb;
              for (const bool swapped : {false, true}) {
                const bool touching =
                    swapped ? test::touching<S>(*two, I, *one, I) : test::touching<S>(*one, I, *two, I);
                const auto d =
                    static_cast<double>(swapped ? distance<S>(*two, I, *one, I) : distance<S>(*one, I, *two, I));
                if (apart == 0) {
                  ASSERT_TRUE(touching) << exact;
                }
                if (exact && apart > rounding) {
                  ASSERT_FALSE(touching);
                }
                if (exact) {
                  ASSERT_NEAR(d, apart, rounding) << d - apart;
                } else {
                  ASSERT_LE(d, apart + rounding);
                }
              }
            }
          }
        }
      }
    }
  }
  EXPECT_GT(meeting, count / 3);
}
TEST(SizesDouble, AnyBesideAny) { ofAnySize<double>({1e-150, 1e-100, 1e-78, 1e-74, 1e-60, 1e-6, 1, 1e6, 1e40, 2e74}); }
TEST(SizesFloat, AnyBesideAny) { ofAnySize<float>({1e-30, 1e-15, 1e-12, 1e-9, 1e-6, 1, 1e6}); }

// However far away: at once, and right. What does not end in time is a fault, too.
// One triangle through a torus, of any size: beyond some size no kernel in float can compute with it.
TEST(SizesDouble, AWallThroughAFineMesh) {
  const Modeld torus(test::torus(30).mesh());
  const auto I = at<double>(Eigen::Isometry3d::Identity());
  test::Pairs expected;
  for (const double size : {1e1, 1e2, 1e4, 1e6, 1e9, 1e12, 1e15, 1e30, 1e60}) {
    SCOPED_TRACE(size);
    Raw raw;
    raw.vertices = {{-2 * size, -size, 0}, {2 * size, -size, 0}, {0, 2 * size, 0}};
    raw.triangles = {{0, 1, 2}};
    const Modeld wall(raw.mesh());
    for (int again = 0; again < 3; ++again) {
      const test::Pairs pairs = test::pairs<double>(torus, I, wall, I);
      if (expected.empty()) expected = pairs;
      ASSERT_GT(pairs.size(), 100u);
      ASSERT_EQ(pairs, expected);
      ASSERT_EQ(test::pairs<double>(wall, I, torus, I).size(), expected.size());
    }
  }
}

template <typename S>
void farAway(const std::vector<double>& distances) {
  const Raw ra = test::box({-1, -2, 0}, {1, 1, 0.5}), rb = test::box({0, 0, 0}, {0.3, 0.2, 0.7});
  const Raw fine = test::torus(40);
  const Model<S> a(ra.mesh()), b(rb.mesh()), fine_a(fine.mesh()), fine_b(fine.mesh());
  const Model<S> coarse(rb.mesh(), optionsOf(Answer::kConservative)), wide(rb.mesh(), optionsOf(Answer::kExact, 0.1));
  const auto fb = test::bvh<fcl::OBBRSS<S>>(rb), fine_bvh = test::bvh<fcl::OBBRSS<S>>(fine);
  const fcl::Sphere<S> ball(1);
  const fcl::Box<S> box(1, 2, 3);
  using Geometry = fcl::CollisionGeometry<S>;
  std::mt19937_64 g(11);
  const auto I = at<S>(Eigen::Isometry3d::Identity());
  for (const double far : distances) {
    SCOPED_TRACE(far);
    for (int i = 0; i < 4; ++i) {
      Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
      if (i % 2) X.linear() = test::randomRotation(g).cast<S>().template cast<double>();
      X.translation() = (far * test::randomDirection(g)).cast<S>().template cast<double>();
      const auto Y = at<S>(X);
      const double apart = exactDistance(ra, rb, X);
      const double rounding = 16 * static_cast<double>(std::numeric_limits<S>::epsilon()) * far;
      const Geometry* const twos[] = {&b, fb.get(), &wide, &coarse};
      for (const Geometry* two : twos) {
        ASSERT_FALSE(test::touching<S>(a, I, *two, Y));
        ASSERT_FALSE(test::touching<S>(*two, Y, a, I));
        if (two == &coarse) {
          ASSERT_LE(static_cast<double>(distance<S>(a, I, *two, Y)), apart + rounding);
          continue;
        }
        ASSERT_NEAR(static_cast<double>(distance<S>(a, I, *two, Y)), apart, rounding);
        ASSERT_NEAR(static_cast<double>(distance<S>(*two, Y, a, I)), apart, rounding);
      }
      for (const Geometry* shape : {static_cast<const Geometry*>(&ball), static_cast<const Geometry*>(&box)}) {
        ASSERT_FALSE(test::touching<S>(fine_a, I, *shape, Y));
        ASSERT_NEAR(static_cast<double>(distance<S>(fine_a, I, *shape, Y)), far, rounding + 4);
      }
      const Geometry* const fines[] = {&fine_b, fine_bvh.get()};
      for (const Geometry* two : fines) {
        ASSERT_TRUE(test::pairs<S>(fine_a, I, *two, Y).empty());
        ASSERT_NEAR(static_cast<double>(distance<S>(*two, Y, fine_a, I)), far, rounding + 4);
      }
      auto Z = Y;
      Z.translation() += Y.translation() / 8;
      everTouch<S>(fine_a, I, I, fine_b, Y, Z);
      ASSERT_TRUE(everTouch<S>(fine_a, I, I, fine_b, Y, I));
    }
  }
}
TEST(FarDouble, AnyDistance) { farAway<double>({1e5, 1e8, 1e10, 1e12, 1e15, 1e20, 1e38, 1e75, 1e150, 1e200, 1e300}); }
TEST(FarFloat, AnyDistance) { farAway<float>({1e5, 1e8, 1e12, 1e18, 1e20, 1e30, 1e38}); }

}  // namespace
}  // namespace bocst
