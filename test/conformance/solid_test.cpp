// SPDX-License-Identifier: BSD-3-Clause
// Solids: what is wholly inside a watertight mesh collides. Against winding numbers by solid angles, which know no
// rays.
#include "mesh/solid.h"

#include <gtest/gtest.h>

#include "conformance/octrees.h"
#include "conformance/reference.h"
#include "conformance/shapes.h"
#include "conformance/truth.h"
#include "geometry/triangle.h"

namespace bocst {
namespace {

using test::Raw;
using test::turnedOver;
using test::unwelded;

Options solid(Answer answer = Answer::kExact) {
  Options o;
  o.solid = true;
  o.answer = answer;
  return o;
}

/// How often the surface winds about a point, by the solid angles of its triangles.
double windings(const Raw& raw, const Eigen::Vector3d& p) {
  double sum = 0;
  for (const auto& t : raw.triangles) {
    const Eigen::Vector3d a = raw.vertices[t[0]] - p, b = raw.vertices[t[1]] - p, c = raw.vertices[t[2]] - p;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    sum += std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return sum / (2 * std::acos(-1.0));
}

double distanceTo(const Raw& raw, const Eigen::Vector3d& p) {
  double least = std::numeric_limits<double>::infinity();
  for (const auto& t : raw.triangles) {
    const query::Corners c = {raw.vertices[t[0]], raw.vertices[t[1]], raw.vertices[t[2]]};
    least = std::min(least, (query::closestPoint(p, c) - p).norm());
  }
  return least;
}

/// A box with a cavity, beside which two boxes overlap.
Raw cavity() {
  Raw raw = test::box({0, 0, 0}, {1, 1, 1});
  raw.add(turnedOver(test::box({0.25, 0.25, 0.25}, {0.75, 0.75, 0.75})));
  raw.add(test::box({2, 0, 0}, {3, 1, 1}));
  raw.add(test::box({2.5, 0.5, 0.5}, {3.5, 1.5, 1.5}));
  return raw;
}

TEST(Solid, HoldsWhatItsSurfaceWindsAbout) {
  std::mt19937_64 g(1);
  std::uniform_real_distribution<double> u(0, 1);
  Raw flat = test::torus(16);
  flat.scale(1);
  for (auto& v : flat.vertices) v.z() *= 1e-3;
  Raw far = test::torus(9);
  far.move({1e3, -2e3, 3e3});
  for (const Raw& raw : {test::box({0, 0, 0}, {1, 1, 1}), test::torus(30), test::torus(7, 0.3), cavity(), flat, far,
                         turnedOver(test::torus(12)), unwelded(test::torus(20, 0.2))}) {
    const Solid s(raw.mesh());
    const Eigen::AlignedBox3d b = raw.mesh()->bounds();
    int inside = 0;
    const auto check = [&](const Eigen::Vector3d& p) {
      // On the surface itself either answer would do.
      if (distanceTo(raw, p) < 1e-10 * b.max().cwiseAbs().maxCoeff()) return;
      const double w = windings(raw, p);
      ASSERT_NEAR(w, std::round(w), 1e-3);
      const bool is_inside = std::abs(w) > 0.5;
      ASSERT_EQ(s.mayContain(p, 0), is_inside) << p.transpose() << " winds " << w;
      inside += is_inside;
    };
    for (int i = 0; i < 300; ++i) {
      check(b.min() + 1.2 * b.sizes().cwiseProduct(Eigen::Vector3d(u(g), u(g), u(g))) - 0.1 * b.sizes());
      // Lines along z through corners, along edges, and through the middles of edges.
      const auto& t = raw.triangles[static_cast<std::size_t>(u(g) * static_cast<double>(raw.triangles.size()))];
      const Eigen::Vector3d v = raw.vertices[t[0]], w = raw.vertices[t[1]];
      const double z = b.min().z() + u(g) * b.sizes().z();
      check({v.x(), v.y(), z});
      check({(v.x() + w.x()) / 2, (v.y() + w.y()) / 2, z});
      check({v.x(), b.center().y(), z});
    }
    EXPECT_GT(inside, 50);
  }
}

TEST(Solid, PointsBesideTheSurfaceAreTakenToBeInside) {
  const Solid s(test::box({0, 0, 0}, {1, 1, 1}).mesh());
  EXPECT_FALSE(s.mayContain({0.5, 0.5, -1e-6}, 1e-9));
  EXPECT_TRUE(s.mayContain({0.5, 0.5, -1e-9}, 1e-9));
  EXPECT_TRUE(s.mayContain({-1e-9, 0.3, 0.3}, 1e-9));
  EXPECT_TRUE(s.mayContain({0.3, 1 + 1e-9, 0.3}, 1e-9));
  EXPECT_TRUE(s.mayContain({0.5, 0.5, 0.5}, 0));
  // Without a tolerance, no farther than rounding goes.
  for (const double far : {0.0, 300.0}) {
    const Eigen::Vector3d corner = Eigen::Vector3d::Constant(far);
    const Solid box(test::box(corner, corner + Eigen::Vector3d(1, 1, 1)).mesh());
    for (int face = 0; face < 6; ++face) {
      Eigen::Vector3d p = corner + Eigen::Vector3d(0.3, 0.4, 0.6);
      p[face % 3] = corner[face % 3] + (face < 3 ? -1e-12 : 1 + 1e-12) + (face < 3 ? -1 : 1) * 1e-13 * far;
      EXPECT_FALSE(box.mayContain(p, 0)) << p.transpose();
    }
  }
}

TEST(Solid, PiecesHaveOnePointEach) {
  Raw raw = unwelded(test::torus(12));
  std::vector<Raw> pieces{raw};
  for (int i = 1; i < 6; ++i) {
    pieces.push_back(i % 2 == 0 ? unwelded(test::torus(5)) : test::box({0, 0, 0}, {1, 1, 1}));
    pieces.back().move({3.0 * i, 0, 0});
    raw.add(pieces.back());
  }
  std::mt19937_64 g(7);
  for (int round = 0; round < 5; ++round) {
    std::shuffle(raw.triangles.begin(), raw.triangles.end(), g);
    const auto mesh = raw.mesh();
    const std::vector<Eigen::Vector3d> points = pointOfEachComponent(mesh->vertices(), mesh->triangles());
    ASSERT_EQ(points.size(), pieces.size());
    for (const Raw& piece : pieces) {
      const auto of_piece = [&](const Eigen::Vector3d& p) { return distanceTo(piece, p) < 1e-12; };
      EXPECT_EQ(std::count_if(points.begin(), points.end(), of_piece), 1);
    }
  }
}

std::string refusal(const Raw& raw) {
  try {
    Modeld model(raw.mesh(), solid());
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "none";
}

// Off the middle of a face that leads no axis straight to it, by less than the tolerance.
TEST(Solid, SlantedFacesHaveTheToleranceToo) {
  Raw raw;
  for (int k = 0; k < 3; ++k) {
    raw.vertices.push_back(Eigen::Vector3d::Unit(k));
    raw.vertices.push_back(-Eigen::Vector3d::Unit(k));
  }
  for (int i = 0; i < 8; ++i) {
    const std::size_t x = i & 1, y = 2 + (i >> 1 & 1), z = 4 + (i >> 2 & 1);
    const bool turned = (__builtin_popcount(static_cast<unsigned>(i)) & 1) != 0;
    raw.triangles.emplace_back(x, turned ? z : y, turned ? y : z);
  }
  const Solid solid(raw.mesh());
  for (const double tolerance : {1e-2, 1e-6}) {
    for (int i = 0; i < 8; ++i) {
      const Eigen::Vector3d out = Eigen::Vector3d(i & 1 ? -1 : 1, i & 2 ? -1 : 1, i & 4 ? -1 : 1) / std::sqrt(3.0);
      EXPECT_TRUE(solid.mayContain(out * (1 / std::sqrt(3.0) + 0.9 * tolerance), tolerance)) << i;
      EXPECT_FALSE(solid.mayContain(out * (1 / std::sqrt(3.0) + 4 * tolerance), tolerance)) << i;
    }
  }
}

// From the first geometry to the second, in either order, though a BVHModel is always side B of a walk.
TEST(SolidModel, NormalsFromInsideAreInTheCallersOrder) {
  const Modeld outer(test::box({-2, -2, -2}, {2, 2, 2}).mesh(), solid());
  const Raw small = test::box({0.5, -0.1, -0.1}, {0.7, 0.1, 0.1});
  const Modeld model(small.mesh());
  const auto bvh = test::bvh<fcl::OBBRSSd>(small);
  const auto I = test::pose<double>(Eigen::Matrix3d::Identity(), {0, 0, 0});
  for (const fcl::CollisionGeometryd* inner : test::Geometries<double>{&model, bvh.get()}) {
    fcl::CollisionRequestd request(10, true);
    fcl::CollisionResultd one, two;
    ASSERT_EQ(fcl::collide(&outer, I, inner, I, request, one), 1u);
    ASSERT_EQ(fcl::collide(inner, I, &outer, I, request, two), 1u);
    // The inner one is nearest to the wall at x = 2, and comes nearer to it where it is moved along +x.
    const Eigen::Vector3d n = one.getContact(0).normal;
    EXPECT_NEAR(std::abs(n.x()), 1, 1e-9);
    EXPECT_LT((two.getContact(0).normal + n).norm(), 1e-9);
    EXPECT_NEAR(one.getContact(0).penetration_depth, two.getContact(0).penetration_depth, 1e-9);
  }
}

TEST(SolidModel, OnlyOfWatertightMeshes) {
  for (const Raw& raw : {test::box({0, 0, 0}, {1, 1, 1}), test::torus(8), unwelded(test::torus(8)), cavity(),
                         turnedOver(test::torus(8))}) {
    EXPECT_EQ(refusal(raw), "none");
  }
  Raw degenerate = test::torus(8);
  degenerate.triangles.emplace_back(0, 0, 5);
  degenerate.triangles.emplace_back(3, 3, 3);
  EXPECT_EQ(refusal(degenerate), "none");

  Raw signs = unwelded(test::box({-1, 0, 0}, {1, 1, 1}));
  for (std::size_t i = 0; i < signs.vertices.size(); i += 2) {
    for (double& x : signs.vertices[i]) x = x == 0 ? -0.0 : x;
  }
  EXPECT_EQ(refusal(signs), "none") << "-0.0 is 0.0";

  Raw open = test::torus(8);
  open.triangles.erase(open.triangles.begin() + 17);
  EXPECT_NE(refusal(open).find("has only one triangle"), std::string::npos) << refusal(open);
  EXPECT_NE(refusal(open).find("watertight"), std::string::npos);
  Raw turned = test::torus(8);
  std::swap(turned.triangles[20][0], turned.triangles[20][1]);
  EXPECT_NE(refusal(turned).find("turned over"), std::string::npos) << refusal(turned);
  EXPECT_NE(refusal(test::soup(20, 1)), "none");
  EXPECT_NE(refusal(test::adversarial()), "none");

  // A mesh that loses its water keeps the shape it had.
  Modeld model(unwelded(test::torus(8)).mesh(), solid());
  const auto before = model.mesh();
  auto torn = before->vertices();
  torn[7].x() += 0.5;
  EXPECT_THROW(model.updateVertices(torn), std::invalid_argument);
  EXPECT_EQ(model.mesh(), before);
}

template <typename S>
class SolidQueries : public testing::Test {};
TYPED_TEST_SUITE(SolidQueries, test::Scalars);

TYPED_TEST(SolidQueries, WhatIsInsideCollidesEitherWayRound) {
  using S = TypeParam;
  const Raw ra = test::torus(30);
  Raw rb = test::torus(10, 0.2);
  rb.scale(0.12);
  const auto fa = test::bvh<fcl::OBBRSS<S>>(ra), fb = test::bvh<fcl::OBBRSS<S>>(rb);
  std::mt19937_64 g(2);
  std::uniform_real_distribution<double> u(0, 1);
  for (const Answer answer : {Answer::kExact, Answer::kConservative}) {
    Options deep = solid(answer), none = deep;
    deep.depth = none.depth = 8;
    none.solid = false;
    const Model<S> a(ra.mesh(), deep), b(rb.mesh(), none), both(rb.mesh(), deep), shell(ra.mesh(), none);
    int held = 0, is_free = 0;
    for (int i = 0; i < 150; ++i) {
      // Along the middle of the tube, and anywhere about it.
      const double angle = 6.3 * u(g);
      const Eigen::Vector3d tube(0.7 * std::cos(angle), 0.7 * std::sin(angle), 0);
      const auto X = test::pose<S>(test::randomRotation(g), test::randomDirection(g) * 5);
      const auto Y = X * test::pose<S>(test::randomRotation(g), tube + test::randomDirection(g) * 0.9 * u(g));
      const Eigen::Vector3d p = (X.inverse(Eigen::Isometry) * Y).template cast<double>() * rb.vertices[0];
      const bool touch = test::touching<S>(*fa, X, *fb, Y), inside = std::abs(windings(ra, p)) > 0.5;
      if (answer == Answer::kConservative && !touch && !inside) {
        // Only what spheres say may be more.
        ASSERT_EQ(test::touching<S>(a, X, b, Y), test::touching<S>(shell, X, b, Y));
        continue;
      }
      const bool hit = touch || inside;
      held += inside && !touch;
      is_free += !hit;
      ASSERT_EQ(test::touching<S>(a, X, b, Y), hit) << i;
      ASSERT_EQ(test::touching<S>(b, Y, a, X), hit) << i;
      ASSERT_EQ(test::touching<S>(a, X, both, Y), hit) << i;
      ASSERT_EQ(test::touching<S>(both, Y, a, X), hit) << i;
      ASSERT_EQ(test::touching<S>(a, X, *fb, Y), hit) << i;
      ASSERT_EQ(test::touching<S>(*fb, Y, a, X), hit) << i;
      if (answer == Answer::kExact) {
        // The other way round, the small one is no shell around the large one.
        ASSERT_EQ(test::touching<S>(shell, X, both, Y), touch) << i;
        ASSERT_EQ(test::pairs<S>(a, X, b, Y).size(), touch ? test::pairs<S>(*fa, X, *fb, Y).size() : inside) << i;
        ASSERT_EQ(test::distance<S>(a, X, b, Y) > 0, !hit) << i;
      }
    }
    EXPECT_GT(held, 20);
    EXPECT_TRUE(answer == Answer::kConservative || is_free > 20);
  }
}

// What is inside by the least, at the end of a ball about a long partner.
TEST(SolidModel, WhatReachesInWithItsFarthestPieceCollides) {
  const Modeld box(test::box({0, 0, 0}, {1, 1, 1}).mesh(), solid());
  const Eigen::Vector3d direction = Eigen::Vector3d(3, 2, 1).normalized();
  // Grains on a diagonal of their bounds, of which only the last is inside.
  Raw grains;
  for (int i = 0; i < 10; ++i) {
    Raw grain = test::box({-1e-3, -1e-3, -1e-3}, {1e-3, 1e-3, 1e-3});
    grains.add(grain.move(i * direction));
  }
  const Modeld model(grains.mesh());
  const auto bvh = test::bvh<fcl::OBBRSSd>(grains);
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  for (const double depth : {-0.01, 0.01}) {
    // The way leads along x, into the face at 0.
    const Eigen::Matrix3d R = test::turnOnto(direction, Eigen::Vector3d::UnitX());
    const auto X = test::pose<double>(R, Eigen::Vector3d(depth, 0.5, 0.5) - R * (9 * direction));
    for (const fcl::CollisionGeometryd* partner : test::Geometries<double>{&model, bvh.get()}) {
      EXPECT_EQ(test::touching<double>(box, I, *partner, X), depth > 0);
      EXPECT_EQ(test::touching<double>(*partner, X, box, I), depth > 0);
    }
  }
}

TEST(SolidModel, NewVerticesHaveNewPieces) {
  const Modeld box(test::box({0, 0, 0}, {1, 1, 1}).mesh(), solid());
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  for (const bool is_solid : {false, true}) {
    const Raw inside = test::box({0.2, 0.2, 0.2}, {0.3, 0.3, 0.3});
    Raw outside = inside;
    outside.move({0.5, 0, 2});
    Modeld grain(inside.mesh(), is_solid ? solid() : Options());
    for (int round = 0; round < 2; ++round) {
      EXPECT_TRUE(test::touching<double>(box, I, grain, I));
      grain.updateVertices(outside.vertices);
      EXPECT_FALSE(test::touching<double>(box, I, grain, test::pose<double>(I.linear(), {0, 0, -1.1})));
      EXPECT_TRUE(test::touching<double>(box, I, grain, test::pose<double>(I.linear(), {0, 0, -2})));
      grain.updateVertices(inside.vertices);
      EXPECT_FALSE(test::touching<double>(box, I, grain, test::pose<double>(I.linear(), {0, 0, -2})));
    }
  }
}

TEST(SolidModel, EachPieceCounts) {
  const Modeld box(test::box({0, 0, 0}, {1, 1, 1}).mesh(), solid());
  Raw dust;
  for (int i = 0; i < 5; ++i) {
    Raw grain = test::torus(5);
    grain.scale(0.02).move({2.0 + i, 0.5, 0.5});
    dust.add(grain);
  }
  const auto bvh = test::bvh<fcl::OBBRSSd>(dust);
  const Modeld model(dust.mesh());
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  for (int i = 0; i < 8; ++i) {
    const auto X = test::pose<double>(I.linear(), {-0.5 - i, 0, 0});
    const bool hit = i >= 1 && i <= 5;
    EXPECT_EQ(test::touching<double>(box, I, model, X), hit) << i;
    EXPECT_EQ(test::touching<double>(model, X, box, I), hit) << i;
    EXPECT_EQ(test::touching<double>(box, I, *bvh, X), hit) << i;
    EXPECT_EQ(test::touching<double>(*bvh, X, box, I), hit) << i;
  }
  // In the hole of a torus there is nothing; in a cavity neither.
  const Modeld ring(test::torus(30).mesh(), solid()), hollow(cavity().mesh(), solid());
  Raw grain = test::torus(6);
  grain.scale(0.05);
  const Modeld small(grain.mesh());
  const auto at = [&](double x, double y, double z) { return test::pose<double>(I.linear(), {x, y, z}); };
  EXPECT_FALSE(test::touching<double>(ring, I, small, I));
  EXPECT_TRUE(test::touching<double>(ring, I, small, at(0.7, 0, 0)));
  EXPECT_FALSE(test::touching<double>(hollow, I, small, at(0.5, 0.5, 0.5)));
  EXPECT_TRUE(test::touching<double>(hollow, I, small, at(0.12, 0.12, 0.12)));
  EXPECT_TRUE(test::touching<double>(hollow, I, small, at(2.75, 0.75, 0.75))) << "where two boxes overlap";
}

// Shapes and octrees.

/// Shapes that fit into the tube of a torus(), and a point of each.
template <typename S>
std::vector<std::pair<test::NamedShape<S>, Eigen::Vector3d>> smallShapes() {
  const auto v = [](double x, double y, double z) { return Eigen::Vector3d(x, y, z).cast<S>().eval(); };
  const Eigen::Vector3d o = Eigen::Vector3d::Zero();
  return {{{"box", std::make_shared<fcl::Box<S>>(v(0.1, 0.2, 0.05))}, o},
          {{"sphere", std::make_shared<fcl::Sphere<S>>(S(0.1))}, o},
          {{"ellipsoid", std::make_shared<fcl::Ellipsoid<S>>(v(0.03, 0.1, 0.07))}, o},
          {{"capsule", std::make_shared<fcl::Capsule<S>>(S(0.05), S(0.1))}, o},
          {{"cone", std::make_shared<fcl::Cone<S>>(S(0.08), S(0.15))}, o},
          {{"cylinder", std::make_shared<fcl::Cylinder<S>>(S(0.06), S(0.1))}, o},
          {{"convex", test::polytope<S>(6, {0.1, 0.06, 0.08})}, o},
          {{"triangle", std::make_shared<fcl::TriangleP<S>>(v(0.1, 0, 0), v(-0.1, 0.1, 0), v(0, -0.1, 0.05))},
           {0.1, 0, 0}}};
}

TYPED_TEST(SolidQueries, ShapesInsideCollideEitherWayRound) {
  using S = TypeParam;
  const Raw raw = test::torus(24);
  std::mt19937_64 g(3);
  std::uniform_real_distribution<double> u(0, 1);
  for (const Answer answer : {Answer::kExact, Answer::kConservative}) {
    Options deep = solid(answer), none = deep;
    deep.depth = none.depth = 8;
    none.solid = false;
    const Model<S> a(raw.mesh(), deep), shell(raw.mesh(), none);
    for (const auto& [named, point] : smallShapes<S>()) {
      const fcl::ShapeBase<S>& shape = *named.shape;
      SCOPED_TRACE(named.name);
      const test::Truth<S> truth(raw, shape);
      int held = 0, is_free = 0;
      for (int i = 0; i < 60; ++i) {
        const double angle = 6.3 * u(g);
        const Eigen::Vector3d tube(0.7 * std::cos(angle), 0.7 * std::sin(angle), 0);
        const auto X = test::pose<S>(test::randomRotation(g), test::randomDirection(g) * 5);
        const auto Y = X * test::pose<S>(test::randomRotation(g), tube + test::randomDirection(g) * 0.7 * u(g));
        const double d = truth.distance(X, Y);
        if (d > 0 && d < 1e-4) continue;  // FCL's tolerance
        const Eigen::Vector3d p = (X.inverse(Eigen::Isometry) * Y).template cast<double>() * point;
        const bool inside = std::abs(windings(raw, p)) > 0.5, hit = d == 0 || inside;
        if (answer == Answer::kConservative && !hit) {
          ASSERT_EQ(test::touching<S>(a, X, shape, Y), test::touching<S>(shell, X, shape, Y));
          continue;
        }
        held += inside && d > 0;
        is_free += !hit;
        ASSERT_EQ(test::touching<S>(a, X, shape, Y), hit) << i << ' ' << d;
        ASSERT_EQ(test::touching<S>(shape, Y, a, X), hit) << i << ' ' << d;
        if (answer == Answer::kConservative) continue;
        ASSERT_EQ(test::touching<S>(shell, X, shape, Y), d == 0);
        for (const bool turned : {false, true}) {
          fcl::DistanceResult<S> result;
          const fcl::DistanceRequest<S> request;
          turned ? fcl::distance(&shape, Y, &a, X, request, result) : fcl::distance(&a, X, &shape, Y, request, result);
          ASSERT_EQ(result.min_distance > 0, !hit);
        }
        if (!inside || d == 0) continue;
        // What brings the surfaces together.
        const fcl::CollisionRequest<S> request(100, true);
        fcl::CollisionResult<S> result;
        ASSERT_EQ(fcl::collide(&a, X, &shape, Y, request, result), 1u);
        const auto& c = result.getContact(0);
        ASSERT_EQ(c.b1, +fcl::Contact<S>::NONE);
        ASSERT_EQ(c.b2, +fcl::Contact<S>::NONE);
        ASSERT_NEAR(c.penetration_depth, d, 1e-4);
        auto Z = Y;
        Z.translation() += c.normal * (c.penetration_depth + S(1e-4));
        ASSERT_EQ(truth.distance(X, Z), 0);
        Z.translation() -= c.normal * S(3e-4);
        ASSERT_GT(truth.distance(X, Z), 0);
      }
      EXPECT_GT(held, 3);
      EXPECT_TRUE(answer == Answer::kConservative || is_free > 5);
    }
  }
}

// What has no end is never inside; a shape about a solid has it inside, as about any mesh.
TEST(SolidModel, UnboundedAndLargeShapes) {
  const Modeld box(test::box({0, 0, 0}, {1, 1, 1}).mesh(), solid());
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  const fcl::Planed plane(Eigen::Vector3d::UnitZ(), -0.5);
  const fcl::Halfspaced below(Eigen::Vector3d::UnitZ(), -0.5), above(-Eigen::Vector3d::UnitZ(), 0.5);
  EXPECT_FALSE(test::touching<double>(box, I, plane, I));
  EXPECT_FALSE(test::touching<double>(below, I, box, I));
  EXPECT_TRUE(test::touching<double>(above, I, box, I));
  EXPECT_TRUE(test::touching<double>(box, I, fcl::Sphered(5), I));
}

TYPED_TEST(SolidQueries, OccupiedCellsInsideCollide) {
  using S = TypeParam;
  const Raw raw = test::torus(24);
  const Model<S> a(raw.mesh(), solid());
  const auto I = test::pose<S>(Eigen::Matrix3d::Identity(), {0, 0, 0});
  std::mt19937_64 g(4);
  std::uniform_real_distribution<double> u(0, 1);
  int held = 0, is_free = 0;
  for (int i = 0; i < 120; ++i) {
    // A few cells here and there, of which one or none is in the tube; free ones, too.
    auto map = std::make_shared<octomap::OcTree>(0.05);
    const auto fill = [&](const Eigen::Vector3d& p, float odds) {
      map->updateNode(octomap::point3d(static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z())),
                      odds);
    };
    const double angle = 6.3 * u(g);
    const Eigen::Vector3d tube(0.7 * std::cos(angle), 0.7 * std::sin(angle), 0);
    for (int k = 0; k < 20; ++k) fill(2.5 * test::randomDirection(g), 2);
    for (int k = 0; k < 40; ++k) fill(test::randomDirection(g), -2);
    if (i % 3 != 0) fill(tube + test::randomDirection(g) * 0.3 * u(g), 2);
    map->updateInnerOccupancy();
    // A large cell of equal ones.
    if (i % 4 == 0) map->prune();
    fcl::OcTree<S> octree(map);
    const auto Y = test::pose<S>(Eigen::AngleAxisd(i % 2, test::randomDirection(g)).toRotationMatrix(), {0, 0, 0});
    double d = std::numeric_limits<double>::infinity();
    bool inside = false;
    for (const auto& b : octree.toBoxes()) {
      for (std::size_t t = 0; t < raw.triangles.size(); ++t) d = std::min(d, test::gap<S>(raw, t, I, b, Y));
      inside |= std::abs(windings(raw, Y.template cast<double>() * Eigen::Vector3d(b[0], b[1], b[2]))) > 0.5;
    }
    if (d > 0 && d < 1e-4) continue;
    const bool hit = d == 0 || inside;
    ASSERT_EQ(test::touching<S>(a, I, octree, Y), hit) << i;
    ASSERT_EQ(test::touching<S>(octree, Y, a, I), hit) << i;
    ASSERT_EQ(test::distance<S>(octree, Y, a, I) > 0, !hit) << i;
    held += inside && d > 0;
    is_free += !hit;
    if (!inside || d == 0) continue;
    fcl::CollisionResult<S> contacts;
    ASSERT_EQ(fcl::collide(&a, I, &octree, Y, fcl::CollisionRequest<S>(10, true), contacts), 1u);
    ASSERT_NEAR(contacts.getContact(0).penetration_depth, d, 1e-4);
    ASSERT_EQ(contacts.getContact(0).b2, +fcl::Contact<S>::NONE);
  }
  EXPECT_GT(held, 10);
  EXPECT_GT(is_free, 10);
}

// Blocks of cells that the surface does not meet are settled by one of their points, whatever is known of the tree.
TEST(SolidModel, BlocksOfCells) {
  auto map = std::make_shared<octomap::OcTree>(0.1);
  for (int x = -8; x < 8; ++x) {
    for (int y = -8; y < 8; ++y) {
      for (int z = -8; z < 8; ++z) {
        map->updateNode(octomap::point3d(0.1f * static_cast<float>(x) + 0.05f, 0.1f * static_cast<float>(y) + 0.05f,
                                         0.1f * static_cast<float>(z) + 0.05f),
                        2.0f);
      }
    }
  }
  map->updateInnerOccupancy();
  const fcl::OcTreed octree(map);
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  const auto at = [&](double x) { return test::pose<double>(I.linear(), {x, 0, 0}); };
  for (const std::size_t n : {std::size_t{6}, std::size_t{60}}) {
    Raw shell = test::torus(n);
    shell.scale(6);  // the tube is two units thick, its hole more
    const Modeld model(shell.mesh(), solid());
    EXPECT_FALSE(test::touching<double>(model, I, octree, at(0)));
    EXPECT_TRUE(test::touching<double>(model, I, octree, at(4.2)));
    EXPECT_TRUE(test::touching<double>(octree, at(-4.2), model, I));
    EXPECT_FALSE(test::touching<double>(model, I, octree, at(12)));
  }
}

TYPED_TEST(SolidQueries, WhatIsNotOccupiedIsNotHeld) {
  using S = TypeParam;
  const Model<S> box(test::box({0, 0, 0}, {1, 1, 1}).mesh(), solid());
  fcl::Sphere<S> ball(S(0.1));
  const auto I = test::pose<S>(Eigen::Matrix3d::Identity(), {0, 0, 0}),
             Y = test::pose<S>(Eigen::Matrix3d::Identity(), {0.5, 0.5, 0.5});
  EXPECT_TRUE(test::touching<S>(box, I, ball, Y));
  ball.cost_density = S(0.5);
  EXPECT_FALSE(test::touching<S>(box, I, ball, Y));
  auto map = std::make_shared<octomap::OcTree>(0.05);
  map->updateNode(octomap::point3d(0.5f, 0.5f, 0.5f), -2.0f);
  const fcl::OcTree<S> octree(map);
  EXPECT_FALSE(test::touching<S>(box, I, octree, I));
}

TEST(SolidModel, ContactsSayHowFarTheWallIs) {
  const Modeld box(test::box({0, 0, 0}, {1, 1, 1}).mesh(), solid()), shell(box.mesh());
  Raw raw = test::torus(10);
  raw.scale(0.1);
  const Modeld small(raw.mesh());
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  const auto X = test::pose<double>(Eigen::Matrix3d::Identity(), {0.5, 0.3, 0.6});
  const auto part = [](const fcl::Transform3d& Y, const Eigen::Vector3d& displacement) {
    fcl::Transform3d Z = Y;
    Z.translation() += displacement;
    return Z;
  };
  const fcl::CollisionRequestd request(100, true);
  fcl::CollisionResultd result;
  ASSERT_EQ(fcl::collide(&box, I, &small, X, request, result), 1u);
  const auto& c = result.getContact(0);
  EXPECT_EQ(c.o1, &box);
  EXPECT_EQ(c.b1, -1);
  EXPECT_EQ(c.b2, -1);
  EXPECT_NEAR(c.penetration_depth, 0.3 + raw.mesh()->bounds().min().y(), 1e-3);
  EXPECT_FALSE(test::touching<double>(shell, I, small, part(X, c.normal * (c.penetration_depth - 1e-9))));
  EXPECT_TRUE(test::touching<double>(shell, I, small, part(X, c.normal * (c.penetration_depth + 1e-9))));

  result.clear();
  ASSERT_EQ(fcl::collide(&small, X, &box, I, request, result), 1u);
  const auto& d = result.getContact(0);
  EXPECT_EQ(d.o1, &small);
  EXPECT_TRUE(test::touching<double>(small, X, shell, part(I, d.normal * (d.penetration_depth + 1e-9))));
  EXPECT_FALSE(test::touching<double>(small, X, shell, part(I, d.normal * (d.penetration_depth - 1e-9))));

  fcl::DistanceRequestd distance_request;
  distance_request.enable_signed_distance = true;
  fcl::DistanceResultd distance;
  fcl::distance(&box, I, &small, X, distance_request, distance);
  EXPECT_NEAR(distance.min_distance, -c.penetration_depth, 1e-12);

  result.clear();
  fcl::CollisionRequestd plain;
  ASSERT_EQ(fcl::collide(&box, I, &small, X, plain, result), 1u);
  EXPECT_TRUE(std::isnan(result.getContact(0).penetration_depth));
}

TEST(SolidModel, TimesOfContact) {
  const Modeld box(test::box({0, 0, 0}, {1, 1, 1}).mesh(), solid()), shell(box.mesh());
  Raw raw = test::torus(8);
  raw.scale(0.1);
  const Modeld small(raw.mesh());
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  const auto at = [&](double x) { return test::pose<double>(I.linear(), {x, 0.5, 0.5}); };
  fcl::ContinuousCollisionRequestd request;
  fcl::ContinuousCollisionResultd result;
  fcl::continuousCollide(&box, I, I, &small, at(0.5), at(0.6), request, result);
  EXPECT_TRUE(result.is_collide);
  EXPECT_EQ(result.time_of_contact, 0);
  fcl::continuousCollide(&shell, I, I, &small, at(0.5), at(0.6), request, result);
  EXPECT_FALSE(result.is_collide);
  fcl::continuousCollide(&small, at(3), at(0.5), &box, I, I, request, result);
  EXPECT_TRUE(result.is_collide);
  EXPECT_NEAR(result.time_of_contact, (3 - 1 + raw.mesh()->bounds().min().x()) / 2.5, 1.1e-4);
}

TEST(Solid, OfAnySize) {
  for (const double scale : {1e-110, 1e-150, 1e70}) {
    Raw raw = test::box({-1, -1, -1}, {1, 1, 1});
    raw.scale(scale);
    const Solid s(raw.mesh());
    std::mt19937_64 g(7);
    std::uniform_real_distribution<double> u(-2, 2);
    for (int i = 0; i < 100; ++i) {
      const Eigen::Vector3d p(u(g), u(g), u(g));
      ASSERT_EQ(s.mayContain(p * scale, 0), p.cwiseAbs().maxCoeff() < 1) << scale << ' ' << p.transpose();
    }
  }
}

TEST(SolidModel, OfManyTrianglesAndOfLargeOnes) {
  // Columns of a fine mesh, and one with a few triangles over all of them.
  Raw raw = test::torus(120);
  raw.add(test::box({-3, -3, -3}, {3, 3, -2}));
  const Solid s(raw.mesh());
  EXPECT_LT(s.bytes(), 64 * raw.triangles.size());
  std::mt19937_64 g(5);
  std::uniform_real_distribution<double> u(-1, 1);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d p = 3.2 * Eigen::Vector3d(u(g), u(g), u(g));
    ASSERT_EQ(s.mayContain(p, 0), std::abs(windings(raw, p)) > 0.5) << p.transpose();
  }
}

// A rotation that is off widens what surfaces tolerate, but not what is inside.
TEST(Solid, RotationsThatAreOffPutNothingInside) {
  Options solid;
  solid.solid = true;
  const Eigen::Vector3d c(1000, 0, 0);
  const Modeld model(test::box(c - Eigen::Vector3d::Ones(), c + Eigen::Vector3d::Ones()).mesh(), solid);
  const fcl::Sphered ball(1);
  auto X = test::pose<double>((1 + 4.9e-4) * Eigen::Matrix3d::Identity(), -(1 + 4.9e-4) * c);
  for (const double y : {7.0, 22.0, 24.0, 26.0, 40.0}) {
    const auto Y = test::pose<double>(Eigen::Matrix3d::Identity(), {0, y, 0});
    EXPECT_FALSE(test::touching<double>(model, X, ball, Y)) << y;
    EXPECT_NEAR(test::distance<double>(model, X, ball, Y), y - 2, 0.02) << y;
  }
}

}  // namespace
}  // namespace bocst
