// SPDX-License-Identifier: BSD-3-Clause
// Answers against FCL's own mesh query and, where FCL has none to trust, against brute force.
#include <fcl/narrowphase/detail/traversal/collision/intersect.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>

#include "conformance/reference.h"
#include "fcl/adapters/models.h"
#include "geometry/triangle.h"
#include "sanitized.h"
#include "tree/packed_share.h"

namespace bocst {
namespace {

using test::Pairs;
using test::Raw;

template <typename S>
class Collide : public testing::Test {};
TYPED_TEST_SUITE(Collide, test::Scalars);

TYPED_TEST(Collide, EqualsObbrssOnRandomPoses) {
  using S = TypeParam;
  const Raw ra = test::torus(50), rb = test::torus(23, 0.3);
  const auto fa = test::bvh<fcl::OBBRSS<S>>(ra), fb = test::bvh<fcl::OBBRSS<S>>(rb);
  for (const Subdivision s : {Subdivision::kOctree, Subdivision::kBono}) {
    Options options;
    options.subdivision = s;
    options.dimension = s == Subdivision::kBono ? 700 : 0;
    const Model<S> a(*fa, options), b(rb.mesh(), options);
    std::mt19937_64 g(1);
    std::uniform_real_distribution<double> u(0, 1);
    int hits = 0;
    for (int i = 0; i < 300; ++i) {
      const auto X = test::pose<S>(test::randomRotation(g), test::randomDirection(g) * u(g));
      const auto Y = test::pose<S>(test::randomRotation(g),
                                   X.translation().template cast<double>() + test::randomDirection(g) * 2.4 * u(g));
      const bool expected = test::touching<S>(*fa, X, *fb, Y);
      hits += expected;
      ASSERT_EQ(test::touching<S>(a, X, b, Y), expected) << i;
      ASSERT_EQ(test::touching<S>(b, Y, a, X), expected) << i;
      if (i % 5 == 0) {
        const Pairs want = test::pairs<S>(*fa, X, *fb, Y);
        ASSERT_EQ(test::pairs<S>(a, X, b, Y), want) << i;
        Pairs turned;
        for (const auto& p : test::pairs<S>(b, Y, a, X)) turned.insert({p.second, p.first});
        if (std::is_same<S, double>::value) {
          ASSERT_EQ(turned, want) << i;
        }
      }
    }
    EXPECT_GT(hits, 100);
    EXPECT_LT(hits, 290);
  }
}

TYPED_TEST(Collide, EqualsObbrssAroundContact) {
  using S = TypeParam;
  const Raw raw = test::torus(40, 0.2);
  const auto fa = test::bvh<fcl::OBBRSS<S>>(raw);
  const auto fo = test::bvh<fcl::OBB<S>>(raw);
  const Model<S> a(raw.mesh()), b(raw.mesh());
  std::mt19937_64 g(2);
  const auto I = fcl::Transform3<S>(fcl::Transform3<S>::Identity());
  int hits = 0, count = 0;
  for (int i = 0; i < 30; ++i) {
    const Eigen::Matrix3d R = test::randomRotation(g);
    const Eigen::Vector3d d = test::randomDirection(g);
    const auto at = [&](double x) { return test::pose<S>(R, d * x); };
    const double contact =
        test::contactDistance([&](double x) { return test::touching<S>(*fa, I, *fa, at(x)); }, 4, 52);
    for (const double gap : {-1e-2, -1e-4, -1e-6, -1e-9, -1e-12, 0.0, 1e-12, 1e-9, 1e-6, 1e-4, 1e-2}) {
      const auto X = at(contact + gap);
      const bool expected = test::touching<S>(*fa, I, *fa, X);
      hits += expected;
      ++count;
      ASSERT_EQ(test::touching<S>(a, I, b, X), expected) << i << " gap " << gap;
      ASSERT_EQ(test::touching<S>(*fo, I, *fo, X), expected);
    }
  }
  EXPECT_GT(hits, count / 4);
  EXPECT_LT(hits, count * 3 / 4);
}

TYPED_TEST(Collide, PackedLeavesChangeNoAnswer) {
  using S = TypeParam;
  // Around contact, where packed corners are off by more than the surfaces are apart.
  const Raw ra = test::torus(60, 0.2), rb = test::torus(31, 0.3);
  const auto fa = test::bvh<fcl::OBBRSS<S>>(ra), fb = test::bvh<fcl::OBBRSS<S>>(rb);
  const Model<S> a(ra.mesh()), b(rb.mesh());
  std::mt19937_64 g(12);
  const auto I = fcl::Transform3<S>(fcl::Transform3<S>::Identity());
  int hits = 0;
  for (int i = 0; i < 12; ++i) {
    const Eigen::Matrix3d R = test::randomRotation(g);
    const Eigen::Vector3d d = test::randomDirection(g);
    const auto at = [&](double x) { return test::pose<S>(R, d * x); };
    const double contact =
        test::contactDistance([&](double x) { return test::touching<S>(*fa, I, *fb, at(x)); }, 4, 52);
    for (const double gap : {-0.3, -1e-3, -1e-5, -1e-7, 0.0, 1e-7, 1e-5, 1e-3}) {
      const auto X = at(contact + gap);
      const bool expected = test::touching<S>(*fa, I, *fb, X);
      const Pairs want = test::pairs<S>(*fa, I, *fb, X);
      hits += expected;
      for (int again = 0; again < 6; ++again) {
        ASSERT_EQ(test::touching<S>(a, I, b, X), expected) << i << " gap " << gap << " asked " << again;
        ASSERT_EQ(test::pairs<S>(a, I, b, X), want) << i << " gap " << gap << " asked " << again;
      }
    }
  }
  EXPECT_GT(hits, 30);
  for (const auto* model : {&a, &b}) {
    const test::PackedShare found = test::packedShareOf(fcl_adapter::treeOf(*model));
    EXPECT_GT(found.packed, found.all / 2) << "of " << found.all << " triangles in leaves";
  }
}

// The pairs that FCL's own query finds; and with float, whose trees cull pairs that its triangle test takes for
// contacts, maybe some of these.
template <typename S>
void expectPairs(const Pairs& found, const Pairs& expected, const Raw& a, const fcl::Transform3<S>& X_WA, const Raw& b,
                 const fcl::Transform3<S>& X_WB) {
  if (std::is_same<S, double>::value) {
    ASSERT_EQ(found, expected);
  }
  ASSERT_TRUE(std::includes(found.begin(), found.end(), expected.begin(), expected.end()));
  fcl::Matrix3<S> R;
  fcl::Vector3<S> T;
  fcl::relativeTransform(X_WA.linear(), X_WA.translation(), X_WB.linear(), X_WB.translation(), R, T);
  for (const auto& pair : found) {
    if (expected.count(pair) != 0) continue;
    const auto corner = [](const Raw& raw, int t, std::size_t k) {
      const fcl::Vector3<S> v = raw.vertices[raw.triangles[static_cast<std::size_t>(t)][k]].template cast<S>();
      return v;
    };
    ASSERT_TRUE(fcl::detail::Intersect<S>::intersect_Triangle(
        corner(a, pair.first, 0), corner(a, pair.first, 1), corner(a, pair.first, 2), corner(b, pair.second, 0),
        corner(b, pair.second, 1), corner(b, pair.second, 2), R, T))
        << pair.first << " " << pair.second;
  }
}

// Triangles about a corner that they share, more than a leaf is to have.
Raw fan(std::mt19937_64& g) {
  constexpr std::size_t kTriangles = 70;
  std::uniform_real_distribution<double> u(-1, 1);
  Raw raw;
  raw.vertices.emplace_back(0, 0, 0);
  for (std::size_t i = 0; i < kTriangles; ++i) {
    const double angle = 2 * std::acos(-1.0) * static_cast<double>(i) / kTriangles;
    raw.vertices.emplace_back(std::cos(angle), std::sin(angle), 0.3 * u(g));
    raw.triangles.emplace_back(0, i + 1, (i + 1) % kTriangles + 1);
  }
  return raw;
}

TYPED_TEST(Collide, SmallMeshesBesideLargeTriangles) {
  using S = TypeParam;
  // As large as a few of the other's triangles, which it meets by their insides, their edges and their corners.
  const Raw rb = test::torus(50, 0.2);
  const auto fb = test::bvh<fcl::OBBRSS<S>>(rb);
  const Model<S> b(rb.mesh());
  std::mt19937_64 g(14);
  const auto I = fcl::Transform3<S>(fcl::Transform3<S>::Identity());
  int hits = 0, count = 0;
  for (const Raw& ra : {test::torus(12, 0.3).scale(4), test::torus(12, 0.3).scale(30), test::torus(12, 0.3).scale(200),
                        fan(g).scale(30)}) {
    const auto fa = test::bvh<fcl::OBBRSS<S>>(ra);
    const Model<S> a(ra.mesh());
    for (int i = 0; i < 12; ++i) {
      const Eigen::Matrix3d R = test::randomRotation(g);
      const Eigen::Vector3d d = test::randomDirection(g);
      const fcl::Triangle& t = ra.triangles[g() % ra.triangles.size()];
      const Eigen::Vector3d corner = ra.vertices[t[0]], edge = (corner + ra.vertices[t[1]]) / 2;
      const Eigen::Vector3d from = i % 3 == 0 ? corner : i % 3 == 1 ? edge : (2 * edge + ra.vertices[t[2]]) / 3;
      const auto at = [&](double x) { return test::pose<S>(R, from + d * x); };
      const double contact =
          test::contactDistance([&](double x) { return test::touching<S>(*fa, I, *fb, at(x)); }, 4, 52);
      for (const double gap : {-0.3, -1e-2, -1e-4, -1e-6, test::kAtContact, 1e-6, 1e-4, 1e-2}) {
        const auto X = at(contact + gap);
        const Pairs found = test::pairs<S>(a, I, b, X), turned = test::pairs<S>(b, X, a, I);
        SCOPED_TRACE(testing::Message() << ra.vertices[1].norm() << " pose " << i << " gap " << gap);
        expectPairs<S>(found, test::pairs<S>(*fa, I, *fb, X), ra, I, rb, X);
        expectPairs<S>(turned, test::pairs<S>(*fb, X, *fa, I), rb, X, ra, I);
        ASSERT_EQ(test::touching<S>(a, I, b, X), !found.empty());
        ASSERT_EQ(test::touching<S>(b, X, a, I), !turned.empty());
        hits += !found.empty();
        ++count;
      }
    }
  }
  EXPECT_GT(hits, count / 4);
  EXPECT_LT(hits, count * 3 / 4);
}

template <typename BV>
void checkPartner(double scale) {
  using S = typename BV::S;
  Raw ra = test::torus(30), rb = test::torus(17, 0.3);
  ra.scale(scale);
  rb.scale(scale);
  const auto fa = test::bvh<fcl::OBBRSS<S>>(ra), fb = test::bvh<fcl::OBBRSS<S>>(rb);
  const auto partner = test::bvh<BV>(rb);
  const Model<S> a(ra.mesh());
  Options options;
  options.answer = Answer::kConservative;
  options.depth = 7;
  const Model<S> spheres(ra.mesh(), options);
  std::mt19937_64 g(3);
  std::uniform_real_distribution<double> u(0, 1);
  int hits = 0;
  for (int i = 0; i < 60; ++i) {
    const auto X = test::pose<S>(test::randomRotation(g), test::randomDirection(g) * scale);
    const auto Y = test::pose<S>(test::randomRotation(g), X.translation().template cast<double>() +
                                                              test::randomDirection(g) * 2.4 * u(g) * scale);
    const bool expected = test::touching<S>(*fa, X, *fb, Y);
    hits += expected;
    ASSERT_EQ(test::touching<S>(a, X, *partner, Y), expected) << i;
    ASSERT_EQ(test::touching<S>(*partner, Y, a, X), expected) << i;
    if (expected) {
      ASSERT_TRUE(test::touching<S>(spheres, X, *partner, Y)) << i;
      ASSERT_TRUE(test::touching<S>(*partner, Y, spheres, X)) << i;
    }
    if (i % 6 == 0) {
      ASSERT_EQ(test::pairs<S>(a, X, *partner, Y), test::pairs<S>(*fa, X, *fb, Y)) << i;
    }
  }
  EXPECT_GT(hits, 15);
}

TYPED_TEST(Collide, EveryBvhIsAPartner) {
  using S = TypeParam;
  checkPartner<fcl::AABB<S>>(1);
  checkPartner<fcl::OBB<S>>(1);
  checkPartner<fcl::RSS<S>>(1);
  checkPartner<fcl::kIOS<S>>(1);
  checkPartner<fcl::OBBRSS<S>>(1);
  checkPartner<fcl::KDOP<S, 16>>(1);
  checkPartner<fcl::KDOP<S, 18>>(1);
  checkPartner<fcl::KDOP<S, 24>>(1);
  checkPartner<fcl::OBBRSS<S>>(1e-3);
  checkPartner<fcl::OBBRSS<S>>(1e3);
}

TEST(CollideDouble, AnyScaleAndFarAway) {
  for (const double scale : {1e-6, 1.0, 1e6}) {
    for (const double away : {0.0, 1e6}) {
      for (const bool mesh_away : {false, true}) {
        Raw ra = test::torus(36), rb = test::torus(20, 0.3);
        ra.scale(scale);
        rb.scale(scale);
        const Eigen::Vector3d far = Eigen::Vector3d(0.6, -0.7, 0.4) * away * scale;
        if (mesh_away) {  // the mesh lies far from its own origin
          ra.move(far);
          rb.move(far);
        }
        const auto fa = test::bvh<fcl::OBBRSSd>(ra), fb = test::bvh<fcl::OBBRSSd>(rb);
        Options octree;  // O rounds its centre where B keeps a corner
        octree.subdivision = Subdivision::kOctree;
        const Modeld a(ra.mesh()), b(rb.mesh()), oa(ra.mesh(), octree), ob(rb.mesh(), octree);
        std::mt19937_64 g(4);
        std::uniform_real_distribution<double> u(0, 1);
        int hits = 0;
        for (int i = 0; i < 60; ++i) {
          const Eigen::Matrix3d R = test::randomRotation(g);
          const Eigen::Vector3d d = test::randomDirection(g) * 2.3 * u(g) * scale;
          const auto X = test::pose<double>(Eigen::Matrix3d::Identity(), mesh_away ? Eigen::Vector3d(0, 0, 0) : far);
          const auto Y = test::pose<double>(R, mesh_away ? Eigen::Vector3d(far - R * far + d) : far + d);
          const bool expected = test::touching<double>(*fa, X, *fb, Y);
          hits += expected;
          ASSERT_EQ(test::touching<double>(a, X, b, Y), expected) << "scale " << scale << " away " << away << " " << i;
          ASSERT_EQ(test::touching<double>(oa, X, ob, Y), expected)
              << "scale " << scale << " away " << away << " " << i;
          if (i % 10 == 0) {
            ASSERT_EQ(test::pairs<double>(a, X, b, Y), test::pairs<double>(*fa, X, *fb, Y));
          }
        }
        EXPECT_GT(hits, 15);
      }
    }
  }
}

TEST(CollideDouble, MeshesOfVeryDifferentSize) {
  const Raw ra = test::torus(60);
  const auto fa = test::bvh<fcl::OBBRSSd>(ra);
  const Modeld a(ra.mesh());
  for (const double scale : {1e-6, 1e-3, 1e3}) {
    Raw rb = test::torus(20);
    rb.scale(scale);
    const auto fb = test::bvh<fcl::OBBRSSd>(rb);
    const Modeld b(rb.mesh());
    std::mt19937_64 g(5);
    std::uniform_real_distribution<double> u(-1, 1);
    int hits = 0;
    for (int i = 0; i < 200; ++i) {
      // A vertex of one near the surface of the other.
      const Eigen::Matrix3d R = test::randomRotation(g);
      const Eigen::Vector3d p = ra.vertices[g() % ra.vertices.size()] - R * rb.vertices[g() % rb.vertices.size()] +
                                test::randomDirection(g) * u(g) * 0.5 * std::min(scale, 1.0);
      const auto X = test::pose<double>(Eigen::Matrix3d::Identity(), {0, 0, 0}), Y = test::pose<double>(R, p);
      const bool expected = test::touching<double>(*fa, X, *fb, Y);
      hits += expected;
      ASSERT_EQ(test::touching<double>(a, X, b, Y), expected) << "scale " << scale << " " << i;
    }
    EXPECT_GT(hits, 20);
  }
}

// Conservative answers: never a miss, fewer false alarms with depth, the same verdict from any history and order.
// Small triangles in seven octants of each level's last: as many pairs at every level wait for deeper ones as can.
Raw nested(int levels, int in_each, double size, unsigned seed) {
  std::mt19937_64 g(seed);
  std::uniform_real_distribution<double> u(0, 1);
  const auto point = [&] { return Eigen::Vector3d(u(g), u(g), u(g)); };
  Raw raw;
  raw.vertices = {{0, 0, 0}, {1, 1, 1}};
  raw.triangles = {fcl::Triangle(0, 0, 0), fcl::Triangle(1, 1, 1)};
  double side = 1;
  for (int level = 0; level < levels; ++level) {
    side /= 2;
    for (int o = 0; o < 7; ++o) {
      const Eigen::Vector3d corner =
          Eigen::Vector3d::Constant(1 - 2 * side) + side * Eigen::Vector3d(o & 1, o >> 1 & 1, o >> 2);
      for (int i = 0; i < in_each; ++i) {
        const Eigen::Vector3d at = corner + side * (0.9 * point() + Eigen::Vector3d::Constant(0.05));
        const std::size_t n = raw.vertices.size();
        for (int k = 0; k < 3; ++k) {
          raw.vertices.push_back(at + size * side * (point() - Eigen::Vector3d::Constant(0.5)));
        }
        raw.triangles.emplace_back(n, n + 1, n + 2);
      }
    }
  }
  return raw;
}

TEST(CollideDouble, AllLevelsAtOnce) {
  const Raw ra = nested(15, 36, 0.9, 1), rb = nested(15, 36, 0.9, 2);
  const auto fa = test::bvh<fcl::OBBRSS<double>>(ra), fb = test::bvh<fcl::OBBRSS<double>>(rb);
  const Model<double> a(ra.mesh()), b(rb.mesh());
  const Eigen::Vector3d corner(1, 1, 1);
  std::mt19937_64 g(3);
  std::size_t met = 0;
  for (int i = 0; i < 8; ++i) {
    const Eigen::Matrix3d R =
        Eigen::AngleAxisd(i % 2 * std::pow(10.0, -0.5 * i), test::randomDirection(g)).toRotationMatrix();
    const Eigen::Vector3d displacement = (i + 1) * 1e-5 * test::randomDirection(g);
    const auto X = test::pose<double>(Eigen::Matrix3d::Identity(), {0, 0, 0});
    const auto Y = test::pose<double>(R, corner - R * corner + displacement);
    const Pairs want = test::pairs<double>(*fa, X, *fb, Y);
    ASSERT_GT(want.size(), 100u) << i;
    met += want.size();
    for (int again = 0; again < 3; ++again) {
      ASSERT_EQ(test::pairs<double>(a, X, b, Y), want) << i;
      ASSERT_EQ(test::touching<double>(a, X, b, Y), !want.empty());
    }
  }
  EXPECT_GT(met, 50000u);
  EXPECT_GE(a.statistics().nodes_per_level.size(), 4u);
}

TEST(CollideDouble, OneTriangleOfAnySizeThroughAMesh) {
  // Float tests of the two overflow, or see only one of them.
  const Raw small = test::torus(40, 0.2);
  const auto fa = test::bvh<fcl::OBBRSS<double>>(small);
  const auto I = fcl::Transform3<double>(fcl::Transform3<double>::Identity());
  for (const double size : {1.0, 1e3, 1e6, 1e8, 1e9, 1e10, 1e12, 1e15}) {
    Raw huge;
    huge.addTriangle({-size, -size, -0.3 * size}, {size, -size, 0.3 * size}, {0, size, 0});
    const auto fb = test::bvh<fcl::OBBRSS<double>>(huge);
    const Pairs want = test::pairs<double>(*fa, I, *fb, I), turned = test::pairs<double>(*fb, I, *fa, I);
    ASSERT_GT(want.size(), 10u);
    // Where rounding is as large as the mesh, FCL's own trees cull pairs that its triangle test takes for contacts.
    const auto check = [size](const Pairs& found, const Pairs& expected) {
      if (size <= 1e12) {
        EXPECT_EQ(found, expected) << size;
      } else {
        EXPECT_TRUE(std::includes(found.begin(), found.end(), expected.begin(), expected.end())) << size;
      }
    };
    const Modeld a(small.mesh()), b(huge.mesh());
    for (int again = 0; again < 3; ++again) {
      check(test::pairs<double>(a, I, b, I), want);
      check(test::pairs<double>(a, I, *fb, I), want);
      check(test::pairs<double>(b, I, a, I), turned);
      EXPECT_TRUE(test::touching<double>(a, I, b, I)) << size;
      EXPECT_TRUE(test::touching<double>(b, I, a, I)) << size;
    }
  }
}

TEST(CollideDouble, PartnersInUnitsThatFloatDoesNotHave) {
  for (const double scale : {1e-60, 1e-36, 1e-12, 1e12, 1e40, 1e70}) {
    Raw ra = test::torus(24, 0.2), rb = test::torus(17, 0.3);
    ra.scale(scale);
    rb.scale(scale);
    const Modeld a(ra.mesh()), b(rb.mesh());
    const auto fb = test::bvh<fcl::OBB<double>>(rb);
    const auto I = fcl::Transform3<double>(fcl::Transform3<double>::Identity());
    // Brute force: FCL's trees do not go so far.
    const auto X = test::pose<double>(Eigen::Matrix3d::Identity(), Eigen::Vector3d(0.7, 0.4, 0.1) * scale);
    Pairs want;
    for (std::size_t t = 0; t < ra.triangles.size(); ++t) {
      for (std::size_t u = 0; u < rb.triangles.size(); ++u) {
        const auto p = [&](std::size_t k) { return ra.vertices[ra.triangles[t][k]]; };
        const auto q = [&](std::size_t k) { return rb.vertices[rb.triangles[u][k]]; };
        if (fcl::detail::Intersect<double>::intersect_Triangle(p(0), p(1), p(2), q(0), q(1), q(2), X.linear(),
                                                               X.translation())) {
          want.insert({static_cast<int>(t), static_cast<int>(u)});
        }
      }
    }
    EXPECT_EQ(test::pairs<double>(a, I, b, X), want) << scale;
    EXPECT_EQ(test::pairs<double>(a, I, *fb, X), want) << scale;
  }
}

TEST(CollideFloat, SliversAreJudgedByFclHoweverItIsAsked) {
  // Apart in exact numbers; FCL's test in float takes them for a contact.
  Raw ra, rb;
  ra.vertices = {{.846626937, .939808547, -.0532171503},
                 {.570552647, -.0348982476, -.704938114},
                 {.886638999, 1.08112156, .0412970334}};
  rb.vertices = {{.846753597, .939733148, -.0531537607},
                 {.528128147, -.213764593, -.818966568},
                 {.644336283, .206439346, -.539995611}};
  ra.triangles.emplace_back(0, 1, 2);
  rb.triangles.emplace_back(0, 1, 2);
  const auto I = fcl::Transform3<float>(fcl::Transform3<float>::Identity());
  std::array<fcl::Vector3f, 3> p, q;
  for (std::size_t k = 0; k < 3; ++k) {
    p[k] = ra.vertices[k].cast<float>();
    q[k] = rb.vertices[k].cast<float>();
  }
  const bool expected = fcl::detail::Intersect<float>::intersect_Triangle(p[0], p[1], p[2], q[0], q[1], q[2],
                                                                          I.linear(), I.translation());
  const Modelf a(ra.mesh()), b(rb.mesh());
  for (const std::size_t most : {std::size_t{1}, std::size_t{100}}) {
    for (const bool contacts : {false, true}) {
      const fcl::CollisionRequestf request(most, contacts);
      fcl::CollisionResultf result;
      EXPECT_EQ(fcl::collide(&a, I, &b, I, request, result), expected ? 1u : 0u) << most << " " << contacts;
    }
  }
}

// Two large triangles through a fine mesh, far from the world's origin: every pair that FCL's test sees, and no other.
TEST(CollideFloat, LargeBesideFineFarAway) {
  Raw ra;
  ra.vertices = {{-9, -8, 0.1}, {9, -7, -0.2}, {0.3, 9, 0.05}, {-8, 0.2, -9}, {9, -0.1, -7}, {0.5, 0.15, 9}};
  ra.triangles.emplace_back(0, 1, 2);
  ra.triangles.emplace_back(3, 4, 5);
  const Raw rb = test::torus(36, 0.3);
  const Modelf a(ra.mesh()), b(rb.mesh());
  std::mt19937_64 g(21);
  std::size_t found = 0;
  for (int i = 0; i < 24; ++i) {
    const Eigen::Vector3d far = 3e3 * test::randomDirection(g);
    const auto X = test::pose<float>(test::randomRotation(g), far);
    const auto Y = test::pose<float>(test::randomRotation(g), far + 0.5 * test::randomDirection(g));
    fcl::Matrix3f R;
    fcl::Vector3f T;
    fcl::relativeTransform(X.linear(), X.translation(), Y.linear(), Y.translation(), R, T);
    Pairs want;
    for (std::size_t t = 0; t < ra.triangles.size(); ++t) {
      for (std::size_t u = 0; u < rb.triangles.size(); ++u) {
        const auto p = [&](std::size_t k) { return fcl::Vector3f(ra.vertices[ra.triangles[t][k]].cast<float>()); };
        const auto q = [&](std::size_t k) { return fcl::Vector3f(rb.vertices[rb.triangles[u][k]].cast<float>()); };
        if (fcl::detail::Intersect<float>::intersect_Triangle(p(0), p(1), p(2), q(0), q(1), q(2), R, T)) {
          want.insert({static_cast<int>(t), static_cast<int>(u)});
        }
      }
    }
    found += want.size();
    for (int round = 0; round < 2; ++round) EXPECT_EQ(test::pairs<float>(a, X, b, Y), want) << i;
  }
  EXPECT_GT(found, 2000u);
}

TEST(CollideConservative, NeverMissesAndTightensWithDepth) {
  const Raw ra = test::torus(40), rb = test::torus(28, 0.3);
  const auto fa = test::bvh<fcl::OBBRSSd>(ra), fb = test::bvh<fcl::OBBRSSd>(rb);
  const auto ma = ra.mesh(), mb = rb.mesh();
  for (const Subdivision s : {Subdivision::kOctree, Subdivision::kBono}) {
    for (const double dimension : {0.0, 600.0}) {
      int first = -1, last = 1 << 30;
      for (int depth = 2; depth <= 8; depth += 2) {
        Options options;
        options.subdivision = s;
        options.dimension = dimension;
        options.answer = Answer::kConservative;
        options.depth = depth;
        const Modeld a(ma, options), b(mb, options), exact(mb);
        std::mt19937_64 g(6);
        std::uniform_real_distribution<double> u(0, 1);
        int alarms = 0;
        for (int i = 0; i < test::repetitions(120); ++i) {
          const auto X = test::pose<double>(test::randomRotation(g), {1, 2, 3});
          const auto Y = test::pose<double>(test::randomRotation(g),
                                            X.translation() + test::randomDirection(g) * (0.8 + 1.6 * u(g)));
          const bool truth = test::touching<double>(*fa, X, *fb, Y);
          const bool verdict = test::touching<double>(a, X, b, Y);
          ASSERT_LE(truth, verdict) << "depth " << depth << " pose " << i;
          ASSERT_LE(truth, test::touching<double>(a, X, exact, Y)) << "depth " << depth << " pose " << i;
          ASSERT_LE(truth, test::touching<double>(exact, Y, a, X)) << "depth " << depth << " pose " << i;
          ASSERT_EQ(verdict, test::touching<double>(b, Y, a, X)) << "argument order";
          if (i % 10 == 0) {
            ASSERT_EQ(verdict, test::touching<double>(Modeld(ma, options), X, Modeld(mb, options), Y)) << "history";
          }
          alarms += verdict && !truth;
        }
        EXPECT_LE(alarms, last) << "depth " << depth;
        last = alarms;
        if (first < 0) first = alarms;
      }
      EXPECT_LE(last, first / 2) << "of the false alarms at depth 2";
    }
  }
}

// Where spheres just touch, the relative pose is rounded one way from the one model and another way from the other.
TEST(CollideConservative, OrderDoesNotMatterAtTheEdge) {
  Options options;
  options.answer = Answer::kConservative;
  options.depth = 5;
  const Modelf a(test::torus(20).mesh(), options), b(test::torus(17, 0.3).mesh(), options);
  std::mt19937_64 g(12);
  int hits = 0, misses = 0;
  for (int i = 0; i < 60; ++i) {
    const Eigen::Vector3d place = 10 * test::randomDirection(g), direction = test::randomDirection(g);
    const Eigen::Matrix3d R = test::randomRotation(g), Q = test::randomRotation(g);
    const auto X = test::pose<float>(R, place);
    const auto verdict = [&](double distance, bool turned) {
      const auto Y = test::pose<float>(Q, place + distance * direction);
      return turned ? test::touching<float>(b, Y, a, X) : test::touching<float>(a, X, b, Y);
    };
    double free = 4, touching = free;
    while (touching > 0 && !verdict(touching, false)) touching -= 0.1;
    for (int step = 0; step < 30; ++step) {
      const double middle = (free + touching) / 2;
      (verdict(middle, false) ? touching : free) = middle;
    }
    for (int step = -20; step <= 20; ++step) {
      const double distance = touching + step * 2e-7;
      const bool hit = verdict(distance, false);
      (hit ? hits : misses)++;
      ASSERT_EQ(verdict(distance, true), hit) << i << ' ' << step;
    }
  }
  EXPECT_GT(hits, 500);
  EXPECT_GT(misses, 500);
}

TEST(CollideConservative, EqualsItsSpheresWhereTheyBeginToMeet) {
  std::mt19937_64 g(31);
  std::normal_distribution<double> n;
  int hits = 0, misses = 0;
  for (const Subdivision subdivision : {Subdivision::kOctree, Subdivision::kBono}) {
    for (const double dimension : {0.0, 17.0}) {
      Options options;
      options.answer = Answer::kConservative;
      options.depth = 4;
      options.subdivision = subdivision;
      options.dimension = dimension;
      const auto mesh_a = test::torus(9).mesh(), mesh_b = test::torus(7).scale(0.4).move({3, 0, 1}).mesh();
      const Modeld a(mesh_a, options), b(mesh_b, options);
      struct Sphere {
        Eigen::Vector3d center;
        double radius;
      };
      std::vector<Sphere> spheres[2];
      for (int side = 0; side < 2; ++side) {
        Modeld whole(side == 0 ? mesh_a : mesh_b, options);
        whole.expandAll(options.depth);
        whole.visit([&](const NodeView& v) {
          if (v.children.empty()) spheres[side].push_back({v.center, v.radius});
        });
      }
      const auto gap = [&](const fcl::Transform3d& X) {
        double least = std::numeric_limits<double>::infinity();
        for (const Sphere& s : spheres[0]) {
          for (const Sphere& t : spheres[1])
            least = std::min(least, (s.center - X * t.center).norm() - s.radius - t.radius);
        }
        return least;
      };
      for (int i = 0; i < 40; ++i) {
        fcl::Transform3d X = test::pose<double>(test::randomRotation(g), {0, 0, 0});
        const Eigen::Vector3d way = Eigen::Vector3d(n(g), n(g), n(g)).normalized();
        const auto place = [&](double t) { X.translation() = t * way - X.linear() * Eigen::Vector3d(3, 0, 1); };
        double in = 6, out = 12;
        for (; in > 0; in -= 0.1) {
          place(in);
          if (gap(X) < 0) break;
        }
        if (in <= 0) continue;
        for (int k = 0; k < 40; ++k) {
          place((in + out) / 2);
          (gap(X) > 0 ? out : in) = (in + out) / 2;
        }
        for (const double t : {in - 1e-6, in, out + 1e-6, out + 0.1, out + 1, out + 3}) {
          place(t);
          const double least = gap(X);
          if (std::abs(least) < 1e-9) continue;
          const fcl::CollisionRequestd request;
          fcl::CollisionResultd result;
          ASSERT_EQ(fcl::collide(&a, fcl::Transform3d(fcl::Transform3d::Identity()), &b, X, request, result) > 0,
                    least < 0)
              << "gap " << least << ", dimension " << dimension;
          ++(least < 0 ? hits : misses);
        }
      }
    }
  }
  EXPECT_GT(hits, 100);
  EXPECT_GT(misses, 300);
}

TEST(CollideConservative, ContactsAreSpheresOfTheDepth) {
  Options options;
  options.answer = Answer::kConservative;
  options.depth = 5;
  const Modeld a(test::torus(30).mesh(), options), b(test::torus(30).mesh(), options);
  const auto X = test::pose<double>(Eigen::Matrix3d::Identity(), {0, 0, 0});
  const auto Y = test::pose<double>(Eigen::Matrix3d::Identity(), {1.3, 0.1, 0.2});
  fcl::CollisionRequestd request(100000, true);
  fcl::CollisionResultd result;
  const fcl::CollisionGeometryd *ga = &a, *gb = &b;
  ASSERT_GT(fcl::collide(ga, X, gb, Y, request, result), 5u);
  Pairs seen;
  const double radius = std::sqrt(3.0) / 2 * a.mesh()->bounds().sizes().maxCoeff() / 16;
  for (std::size_t i = 0; i < result.numContacts(); ++i) {
    const auto& c = result.getContact(i);
    EXPECT_TRUE(seen.insert({c.b1, c.b2}).second);
    EXPECT_LT(c.b1, 1 << 12);
    EXPECT_NEAR(c.normal.norm(), 1, 1e-12);
    EXPECT_GE(c.penetration_depth, 0);
    EXPECT_LE(c.penetration_depth, 2 * radius + 1e-12);
  }
}

// The request and the contacts.

// Where spheres meet in the world does not depend on which model is named first.
TEST(CollideConservative, ContactsLieWhereTheyDoInBothOrders) {
  Options options;
  options.answer = Answer::kConservative;
  options.depth = 4;
  const Modeld a(test::torus(20).mesh(), options), b(test::torus(13, 0.3).mesh(), options);
  std::mt19937_64 g(22);
  std::size_t found = 0;
  for (int i = 0; i < 12; ++i) {
    const auto X = test::pose<double>(test::randomRotation(g), 2 * test::randomDirection(g));
    const auto Y = test::pose<double>(test::randomRotation(g), X.translation() + 0.8 * test::randomDirection(g));
    const fcl::CollisionRequestd request(100000, true);
    fcl::CollisionResultd one, two;
    fcl::collide(&a, X, &b, Y, request, one);
    fcl::collide(&b, Y, &a, X, request, two);
    ASSERT_EQ(one.numContacts(), two.numContacts());
    std::map<std::pair<std::intptr_t, std::intptr_t>, fcl::Contactd> swapped;
    for (std::size_t k = 0; k < two.numContacts(); ++k) {
      const fcl::Contactd& c = two.getContact(k);
      swapped[{c.b2, c.b1}] = c;
    }
    for (std::size_t k = 0; k < one.numContacts(); ++k) {
      const fcl::Contactd& c = one.getContact(k);
      const auto other = swapped.find({c.b1, c.b2});
      ASSERT_TRUE(other != swapped.end());
      ASSERT_LT((c.pos - other->second.pos).norm(), 1e-9);
      ASSERT_LT((c.normal + other->second.normal).norm(), 1e-9);
      // In the balls of both meshes.
      ASSERT_LT((c.pos - X.translation()).norm(), 2.5);
      ASSERT_LT((c.pos - Y.translation()).norm(), 2.5);
      ++found;
    }
  }
  EXPECT_GT(found, 100u);
}

TEST(CollideRequest, ContactsAreWhatTheHeaderSays) {
  const Raw raw = test::torus(40);
  const auto partner = test::bvh<fcl::OBBRSSd>(raw);
  const Modeld a(raw.mesh()), b(raw.mesh());
  std::mt19937_64 g(7);
  std::size_t contacts = 0;
  for (int i = 0; i < 10; ++i) {
    const auto X = test::pose<double>(test::randomRotation(g), {5, 6, 7});
    const auto Y = test::pose<double>(test::randomRotation(g), X.translation() + test::randomDirection(g) * 1.2);
    const std::vector<std::pair<const fcl::CollisionGeometryd*, const fcl::CollisionGeometryd*>> orders = {
        {&a, &b}, {&b, &a}, {&a, partner.get()}, {partner.get(), &b}};
    for (const auto& [first, second] : orders) {
      fcl::CollisionRequestd request(100000, true);
      fcl::CollisionResultd result;
      fcl::collide(first, X, second, Y, request, result);
      contacts += result.numContacts();
      Pairs seen;
      for (std::size_t k = 0; k < result.numContacts(); ++k) {
        const auto& c = result.getContact(k);
        EXPECT_EQ(c.o1, first) << "the caller's order";
        EXPECT_EQ(c.o2, second);
        EXPECT_TRUE(seen.insert({c.b1, c.b2}).second) << "each pair once";
        const auto corners = [&](const fcl::Transform3d& P, std::intptr_t t, query::Corners& out) {
          const auto& triangle = raw.triangles[static_cast<std::size_t>(t)];
          for (std::size_t j = 0; j < 3; ++j) out[j] = P * raw.vertices[triangle[j]];
        };
        query::Corners p, q;
        corners(X, c.b1, p);
        corners(Y, c.b2, q);
        EXPECT_NEAR(c.normal.norm(), 1, 1e-9);
        EXPECT_GE(c.penetration_depth, 0);
        EXPECT_LT((query::closestPoint(c.pos, p) - c.pos).norm(), 1e-9);
        EXPECT_LT((query::closestPoint(c.pos, q) - c.pos).norm(), 1e-9);
        const Eigen::Vector3d out = (c.penetration_depth + 1e-9) * c.normal;
        EXPECT_FALSE(
            fcl::detail::Intersect<double>::intersect_Triangle(p[0], p[1], p[2], q[0] + out, q[1] + out, q[2] + out))
            << "from the first to the second by depth parts the two triangles";
      }
    }
  }
  EXPECT_GT(contacts, 1000u);
}

TEST(CollideRequest, CountsStopAndAccumulate) {
  const Raw raw = test::torus(40);
  const Modeld a(raw.mesh()), b(raw.mesh());
  const auto X = test::pose<double>(Eigen::Matrix3d::Identity(), {0, 0, 0});
  const auto Y = test::pose<double>(Eigen::Matrix3d::Identity(), {1.2, 0.3, 0.1});
  const fcl::CollisionGeometryd *ga = &a, *gb = &b;
  fcl::CollisionResultd result;
  EXPECT_EQ(fcl::collide(ga, X, gb, Y, fcl::CollisionRequestd(3), result), 3u);
  EXPECT_EQ(fcl::collide(ga, X, gb, Y, fcl::CollisionRequestd(3), result), 3u) << "satisfied already";
  EXPECT_EQ(fcl::collide(ga, X, gb, Y, fcl::CollisionRequestd(5), result), 5u) << "accumulates";
  for (std::size_t i = 0; i < 5; ++i) {
    const auto& c = result.getContact(i);
    EXPECT_TRUE(std::isnan(c.penetration_depth) && c.normal.hasNaN() && c.pos.hasNaN()) << "not asked for";
  }
  fcl::CollisionResultd none;
  EXPECT_EQ(fcl::collide(ga, X, gb, Y, fcl::CollisionRequestd(0), none), 0u);
}

// Pairs are looked at several at once, while the walk goes on; as many are reported as are asked for, and no other.
TEST(CollideRequest, AnyNumberOfContacts) {
  const Raw raw = test::torus(40);
  const auto bvh = test::bvh<fcl::OBBRSSd>(raw);
  const Modeld a(raw.mesh()), b(raw.mesh());
  const auto X = test::pose<double>(Eigen::Matrix3d::Identity(), {0, 0, 0});
  const auto Y = test::pose<double>(Eigen::Matrix3d::Identity(), {1.2, 0.3, 0.1});
  const Pairs all = test::pairs<double>(*bvh, X, *bvh, Y);
  ASSERT_GT(all.size(), 100u);
  const fcl::CollisionGeometryd* ga = &a;
  for (const fcl::CollisionGeometryd* gb : test::Geometries<double>{&b, bvh.get()}) {
    for (std::size_t limit = 1; limit < all.size() + 3; limit += limit < 100 ? 1 : 7) {
      for (const bool with_geometry : {false, true}) {
        fcl::CollisionResultd result;
        const std::size_t count = fcl::collide(ga, X, gb, Y, fcl::CollisionRequestd(limit, with_geometry), result);
        ASSERT_EQ(count, std::min(limit, all.size()));
        Pairs found;
        for (std::size_t i = 0; i < count; ++i) {
          const auto& c = result.getContact(i);
          ASSERT_TRUE(found.insert({c.b1, c.b2}).second) << "twice, of " << limit;
          ASSERT_EQ(std::isfinite(c.penetration_depth), with_geometry);
        }
        ASSERT_TRUE(std::includes(all.begin(), all.end(), found.begin(), found.end())) << limit;
      }
    }
  }
}

TEST(CollideRequest, FreeAndUncertainGeometriesDoNotCollide) {
  const Raw raw = test::torus(20);
  Modeld a(raw.mesh()), b(raw.mesh());
  const auto X = test::pose<double>(Eigen::Matrix3d::Identity(), {0, 0, 0});
  const auto Y = test::pose<double>(Eigen::Matrix3d::Identity(), {1.2, 0.3, 0.1});
  EXPECT_TRUE(test::touching<double>(a, X, b, Y));
  const fcl::CollisionGeometryd *ga = &a, *gb = &b;
  fcl::CollisionRequestd costs(1, false, 100, true);
  fcl::CollisionResultd result;
  b.cost_density = 0.5;  // uncertain: costs, but no contact
  EXPECT_EQ(fcl::collide(ga, X, gb, Y, costs, result), 0u);
  std::vector<fcl::CostSourced> sources;
  result.getCostSources(sources);
  EXPECT_FALSE(sources.empty());
  EXPECT_FALSE(test::touching<double>(a, X, b, Y));
  b.cost_density = 0;  // free
  result.clear();
  EXPECT_EQ(fcl::collide(ga, X, gb, Y, costs, result), 0u);
  result.getCostSources(sources);
  EXPECT_TRUE(sources.empty());
}

TEST(CollideRequest, CostsEqualFcls) {
  const Raw ra = test::torus(24), rb = test::torus(16, 0.3);
  const auto fa = test::bvh<fcl::OBBRSSd>(ra), fb = test::bvh<fcl::OBBRSSd>(rb);
  Modeld a(ra.mesh()), b(rb.mesh());
  std::mt19937_64 g(8);
  int touching = 0;
  for (int i = 0; i < 10; ++i) {
    const auto X = test::pose<double>(test::randomRotation(g), {0, 0, 0});
    const auto Y = test::pose<double>(test::randomRotation(g), test::randomDirection(g) * 1.2);
    fcl::CollisionRequestd request(1, false, 1000000, true);
    const auto sum = [&](const fcl::CollisionGeometryd* p, const fcl::CollisionGeometryd* q) {
      fcl::CollisionResultd result;
      fcl::collide(p, X, q, Y, request, result);
      std::vector<fcl::CostSourced> sources;
      result.getCostSources(sources);
      double total = 0;
      for (const auto& s : sources) total += s.total_cost;
      return std::make_pair(sources.size(), total);
    };
    const auto ours = sum(&a, &b), theirs = sum(fa.get(), fb.get());
    touching += ours.first > 0;
    // FCL adds the box of each pair; equal boxes collapse, so the sets are compared by size and sum.
    EXPECT_EQ(ours.first, theirs.first);
    EXPECT_NEAR(ours.second, theirs.second, 1e-9 * theirs.second);
  }
  EXPECT_GT(touching, 5);
}

TEST(CollideRequest, BothSolversAndObjects) {
  const Raw raw = test::torus(24);
  const auto a = std::make_shared<Modeld>(raw.mesh()), b = std::make_shared<Modeld>(raw.mesh());
  for (const auto solver : {fcl::GST_LIBCCD, fcl::GST_INDEP}) {
    for (const double x : {1.2, 5.0}) {
      fcl::CollisionObjectd oa(a), ob(b, test::pose<double>(Eigen::Matrix3d::Identity(), {x, 0.3, 0.1}));
      fcl::CollisionRequestd request;
      request.gjk_solver_type = solver;
      fcl::CollisionResultd result;
      EXPECT_EQ(fcl::collide(&oa, &ob, request, result) > 0, x < 2);
    }
  }
}

/// A geometry that nobody knows.
class Strange final : public fcl::CollisionGeometryd {
 public:
  void computeLocalAABB() override {}
};

TEST(CollideRequest, UnsupportedPartnersThrow) {
  const Modeld a(test::torus(8).mesh());
  const Strange strange;
  const fcl::CollisionGeometryd *ga = &a, *gs = &strange;
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  fcl::CollisionRequestd request;
  fcl::CollisionResultd result;
  EXPECT_THROW(fcl::collide(ga, I, gs, I, request, result), std::invalid_argument);
  EXPECT_THROW(fcl::collide(gs, I, ga, I, request, result), std::invalid_argument);
  fcl::DistanceRequestd distance_request;
  fcl::DistanceResultd distance_result;
  EXPECT_THROW(fcl::distance(ga, I, gs, I, distance_request, distance_result), std::invalid_argument);
  EXPECT_THROW(fcl::distance(gs, I, ga, I, distance_request, distance_result), std::invalid_argument);
  fcl::BVHModel<fcl::OBBRSSd> unfinished;
  EXPECT_THROW(fcl::collide(ga, I, static_cast<const fcl::CollisionGeometryd*>(&unfinished), I, request, result),
               std::invalid_argument);
  const fcl::Sphered sphere(1);
  EXPECT_EQ(fcl::collide(&sphere, I, &sphere, I, request, result), 1u) << "other pairs go on to FCL";
}

// Degenerate meshes against brute force over triangles with a test that knows segments and points.
bool bruteForce(const Raw& a, const Raw& b, const fcl::Transform3d& X_AB, bool& close) {
  bool hit = false;
  close = false;
  for (const auto& s : a.triangles) {
    const query::Corners p = {a.vertices[s[0]], a.vertices[s[1]], a.vertices[s[2]]};
    for (const auto& t : b.triangles) {
      const query::Corners q = {X_AB * b.vertices[t[0]], X_AB * b.vertices[t[1]], X_AB * b.vertices[t[2]]};
      if (query::isDegenerate(p) || query::isDegenerate(q)) {
        Eigen::Vector3d on_p, on_q;
        const double d = query::nearestPoints(p, q, on_p, on_q);
        hit |= d <= 1e-14;
        close |= d < 1e-11;
      } else {
        hit |= fcl::detail::Intersect<double>::intersect_Triangle(p[0], p[1], p[2], q[0], q[1], q[2]);
      }
    }
  }
  return hit;
}

TEST(CollideDegenerate, AnswersAreRight) {
  Raw single;
  single.addTriangle({0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  Raw point;
  point.vertices.assign(3, Eigen::Vector3d(0.2, 0.3, 0.4));
  point.triangles.emplace_back(0, 1, 2);
  Raw segment;
  segment.addTriangle({0, 0, 0}, {0, 0, 1}, {0, 0, 0.5});
  Raw same;
  same.vertices = single.vertices;
  same.triangles.assign(5000, single.triangles[0]);
  const std::vector<Raw> meshes = {
      single, point, segment, test::adversarial(), test::box({0, 0, 0}, {1, 1, 1}), test::soup(60, 3)};
  std::mt19937_64 g(9);
  std::uniform_real_distribution<double> u(-1, 1);
  int hits = 0, count = 0;
  for (const Raw& ra : meshes) {
    for (const Raw& rb : meshes) {
      const Modeld a(ra.mesh()), b(rb.mesh());
      for (int i = 0; i < 60; ++i) {
        // Lattice translations and right angles make faces coplanar and corners meet; the rest is anywhere.
        Eigen::Vector3d p = Eigen::Vector3d(u(g), u(g), u(g));
        Eigen::Matrix3d R = test::randomRotation(g);
        if (i % 2) p = (p * 4).array().round() / 4;
        if (i % 3) R = Eigen::Matrix3d::Identity();
        if (i == 0) p.setZero();
        const auto X = test::pose<double>(R, p), I = test::pose<double>(Eigen::Matrix3d::Identity(), {0, 0, 0});
        bool close = false;
        const bool expected = bruteForce(ra, rb, X, close);
        ++count;
        hits += expected;
        const bool answer = test::touching<double>(a, I, b, X);
        if (close && !expected) continue;  // apart by less than rounding: either answer is right
        ASSERT_EQ(answer, expected) << "pose " << i;
      }
    }
  }
  EXPECT_GT(hits, count / 8);
  EXPECT_LT(hits, count * 7 / 8);
  // Many copies of one triangle: all pairs are found, memory stays bounded.
  const Modeld many(same.mesh()), one(single.mesh());
  const auto I = test::pose<double>(Eigen::Matrix3d::Identity(), {0, 0, 0});
  EXPECT_EQ(test::pairs<double>(many, I, one, test::pose<double>(test::randomRotation(g), {0.2, 0.2, 0})).size(),
            5000u);
  EXPECT_FALSE(test::touching<double>(many, I, one, test::pose<double>(Eigen::Matrix3d::Identity(), {0, 0, 1e-9})));
  EXPECT_LE(many.statistics().resident_bytes, 300u * same.triangles.size()) << "oriented boxes included";
}

TEST(CollideDegenerate, CoplanarAndTouchingFacesAreReported) {
  const Modeld a(test::box({0, 0, 0}, {1, 1, 1}).mesh()), b(test::box({0, 0, 0}, {1, 1, 1}).mesh());
  const auto at = [](double x, double y, double z) {
    return test::pose<double>(Eigen::Matrix3d::Identity(), {x, y, z});
  };
  const auto I = at(0, 0, 0);
  EXPECT_TRUE(test::touching<double>(a, I, b, at(1, 0, 0))) << "face on face";
  EXPECT_TRUE(test::touching<double>(a, I, b, at(1, 1, 0))) << "edge on edge";
  EXPECT_TRUE(test::touching<double>(a, I, b, at(1, 1, 1))) << "corner on corner";
  EXPECT_TRUE(test::touching<double>(a, I, b, I)) << "the same place";
  EXPECT_FALSE(test::touching<double>(a, I, b, at(1 + 1e-9, 0, 0)));
  const Modeld inner(test::box({0.4, 0.4, 0.4}, {0.6, 0.6, 0.6}).mesh());
  EXPECT_FALSE(test::touching<double>(a, I, inner, I)) << "a mesh is a surface";
}

TEST(CollideSelf, OneModelOnBothSides) {
  const Modeld a(test::torus(40).mesh());
  const auto f = test::bvh<fcl::OBBRSSd>(test::torus(40));
  std::mt19937_64 g(10);
  std::uniform_real_distribution<double> u(0, 1);
  for (int i = 0; i < 60; ++i) {
    const auto X = test::pose<double>(test::randomRotation(g), {0, 0, 0});
    const auto Y = test::pose<double>(test::randomRotation(g), test::randomDirection(g) * 2.3 * u(g));
    ASSERT_EQ(test::touching<double>(a, X, a, Y), test::touching<double>(*f, X, *f, Y));
  }
}

// A rotation may be off by as much as is allowed: then its transpose is not its inverse, and what lies far from the
// origins is not where a walk that takes it for the inverse would place it. In both orders, FCL's poses decide.
TEST(CollideRigid, NoPairIsLostToARotationThatIsNotQuiteOne) {
  std::mt19937_64 g(11);
  std::uniform_real_distribution<double> u(-1, 1);
  const auto anywhere = [&] { return Eigen::Vector3d(u(g), u(g), u(g)); };
  const auto crooked = [&](double defect) {
    Eigen::Matrix3d R = test::randomRotation(g);
    for (int k = 0; k < 9; ++k) R(k / 3, k % 3) += defect * u(g);
    return R;
  };
  std::size_t pairs = 0;
  for (const double defect : {1e-12, 1e-9, 1e-7, 1e-5, 2e-4}) {
    for (int round = 0; round < 40; ++round) {
      const double far = round % 4 < 2 ? 200 : 1;
      const auto X1 = test::pose<double>(crooked(defect), far * anywhere()),
                 X2 = test::pose<double>(crooked(defect), far * anywhere());
      const Eigen::Matrix3d R = X1.linear().transpose() * X2.linear(), back = R.inverse();
      const Eigen::Vector3d t = X1.linear().transpose() * (X2.translation() - X1.translation());
      const Eigen::Vector3d middle = far * anywhere();
      Raw a, b;
      Eigen::Vector3d cluster = middle;
      for (std::size_t i = 0; i < 100; ++i) {
        if (i % 20 == 0) cluster = middle + anywhere();
        const Eigen::Vector3d c = cluster + 4e-3 * anywhere(), e = 1e-3 * anywhere(), f = 1e-3 * anywhere(),
                              n = e.cross(f).normalized();
        a.addTriangle(c + e, c + f, c - e - f);
        b.addTriangle(back * (c - 1e-8 * n - t), back * (c + 1e-3 * n + 0.3 * e - t),
                      back * (c + 1e-3 * n - 0.3 * e - t));
      }
      const bool turned = round % 2 != 0;
      const Raw &first = turned ? b : a, &second = turned ? a : b;
      const auto &X = turned ? X2 : X1, &Y = turned ? X1 : X2;
      const Modeld model1(first.mesh()), model2(second.mesh());
      const auto bvh1 = test::bvh<fcl::OBBRSSd>(first);
      // The model is side A of a walk with a mesh of FCL, whichever comes first.
      const auto found =
          round % 8 < 4 ? test::pairs<double>(*bvh1, X, model2, Y) : test::pairs<double>(model1, X, model2, Y);
      for (std::size_t i = 0; i < 100; ++i) {
        const auto *p = &first.vertices[3 * i], *q = &second.vertices[3 * i];
        if (!fcl::detail::Intersect<double>::intersect_Triangle(
                p[0], p[1], p[2], q[0], q[1], q[2], X.linear().transpose() * Y.linear(),
                Eigen::Vector3d(X.linear().transpose() * (Y.translation() - X.translation())))) {
          continue;
        }
        ++pairs;
        ASSERT_EQ(found.count({i, i}), 1u) << "defect " << defect << ", triangle " << i;
      }
    }
  }
  EXPECT_GT(pairs, 15000u);
}

TEST(CollideBatches, AtMostOneALevelWhenEverythingIsAsked) {
  const Modeld a(test::torus(120).mesh()), b(test::torus(120).mesh());
  const auto X = test::pose<double>(Eigen::Matrix3d::Identity(), {0, 0, 0});
  const auto Y = test::pose<double>(Eigen::Matrix3d::Identity(), {1.2, 0.3, 0.1});
  EXPECT_GT(test::pairs<double>(a, X, b, Y).size(), 100u);
  const Statistics s = a.statistics();
  EXPECT_LE(s.oracle_batches, s.nodes_per_level.size() + 1);
}

}  // namespace
}  // namespace bocst
