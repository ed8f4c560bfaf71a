// SPDX-License-Identifier: BSD-3-Clause
// Margins: surfaces no farther apart than the margin collide. Against distances, and against brute force over
// triangles.
#include <bocst/is_closer_than.h>
#include <fcl/broadphase/broadphase_dynamic_AABB_tree.h>
#include <fcl/broadphase/default_broadphase_callbacks.h>
#include <gtest/gtest.h>

#include "conformance/octrees.h"
#include "conformance/reference.h"
#include "conformance/shapes.h"
#include "conformance/truth.h"
#include "geometry/triangle.h"

namespace bocst {
namespace {

using test::Raw;

Options with(double margin, Answer answer = Answer::kExact, Subdivision subdivision = Subdivision::kBono) {
  Options o;
  o.margin = margin;
  o.answer = answer;
  o.subdivision = subdivision;
  return o;
}

template <typename S>
class Margin : public testing::Test {};
TYPED_TEST_SUITE(Margin, test::Scalars);

// Just more and just less than the distance, however it is shared between the two.
TYPED_TEST(Margin, IsTheDistanceUpToWhichTheyCollide) {
  using S = TypeParam;
  const Raw ra = test::torus(40), rb = test::torus(23, 0.3);
  const Model<S> plain_a(ra.mesh()), plain_b(rb.mesh());
  const auto bvh = test::bvh<fcl::OBBRSS<S>>(rb);
  const double off = std::is_same<S, double>::value ? 1e-10 : 1e-4;
  std::mt19937_64 g(1);
  std::uniform_real_distribution<double> u(0, 1);
  int apart = 0;
  for (int i = 0; i < 24; ++i) {
    const auto X = test::pose<S>(test::randomRotation(g), test::randomDirection(g));
    const auto Y = test::pose<S>(test::randomRotation(g), test::randomDirection(g) * 4 * u(g));
    const double d = static_cast<double>(test::distance<S>(plain_a, X, plain_b, Y));
    if (d < 1e-3) continue;
    ++apart;
    const double share = i % 3 == 0 ? 0 : u(g);
    for (const double margin : {d * (1 + off), d * (1 - off), d * 3, d / 3}) {
      const bool hit = margin > d;
      const Model<S> a(ra.mesh(), with(margin * share)), b(rb.mesh(), with(margin * (1 - share)));
      const Model<S> all(ra.mesh(), with(margin));
      ASSERT_EQ(test::touching<S>(a, X, b, Y), hit) << margin << ' ' << d;
      ASSERT_EQ(test::touching<S>(b, Y, a, X), hit);
      ASSERT_EQ(test::touching<S>(all, X, *bvh, Y), hit);
      ASSERT_EQ(test::touching<S>(*bvh, Y, all, X), hit);
      const S least = static_cast<S>(margin);
      ASSERT_EQ(isCloserThan<S>(&a, X, &plain_b, Y, least), hit) << "which knows no margin of the models";
      ASSERT_EQ(isCloserThan<S>(&plain_b, Y, &plain_a, X, least), hit);
      ASSERT_EQ(isCloserThan<S>(bvh.get(), Y, &plain_a, X, least), hit);
      ASSERT_EQ(test::distance<S>(a, X, b, Y), test::distance<S>(plain_a, X, plain_b, Y)) << "distances know no margin";
    }
  }
  EXPECT_GT(apart, 8);
}

/// All pairs of triangles no farther apart than the margin.
test::Pairs bruteForce(const Raw& ra, const Raw& rb, const fcl::Transform3d& Y, double margin) {
  test::Pairs pairs;
  for (std::size_t i = 0; i < ra.triangles.size(); ++i) {
    const auto& s = ra.triangles[i];
    const query::Corners p = {ra.vertices[s[0]], ra.vertices[s[1]], ra.vertices[s[2]]};
    for (std::size_t j = 0; j < rb.triangles.size(); ++j) {
      const auto& t = rb.triangles[j];
      const query::Corners q = {Y * rb.vertices[t[0]], Y * rb.vertices[t[1]], Y * rb.vertices[t[2]]};
      Eigen::Vector3d on_p, on_q;
      if (query::nearestPoints(p, q, on_p, on_q) <= margin) {
        pairs.insert({static_cast<std::intptr_t>(i), static_cast<std::intptr_t>(j)});
      }
    }
  }
  return pairs;
}

// Corners of packed leaves are off by a 65536th of the leaf's size: about margins of that size, nothing is lost.
TYPED_TEST(Margin, MayBeAsSmallAsTheRoundingOfPackedLeaves) {
  using S = TypeParam;
  const bool is_double = std::is_same<S, double>::value;
  std::mt19937_64 g(17);
  std::uniform_real_distribution<double> u(-1, 1);
  for (int i = 0; i < 300; ++i) {
    const double margin = 2e-7 * (i + (is_double ? 1 : 100));  // above what float rounds
    // A triangle, or a segment, about the origin; what makes the leaf large is elsewhere.
    const double width = i % 2 == 0 ? 0 : 0.003;
    Raw large, small;
    large.vertices = {{0, 0, 0}, {0.005, 0, 0}, {0.002, width, 0}, {1, u(g), u(g)}, {1, 1, u(g)}, {u(g), u(g), -1}};
    large.triangles = {{0, 1, 2}, {3, 4, 5}};
    // It rises from above the first corner.
    const Eigen::Matrix3d R = test::randomRotation(g);
    for (const bool touch : {true, false}) {
      const double gap = margin * (touch ? 0.5 : 1.5);
      small.vertices = {{0, 0, gap}, {0, 0, 0.01}, {width, 0, 0.01}, {0, 0, 0.02}};
      small.triangles = {{0, 1, 2}, {0, 2, 3}};
      for (auto& v : small.vertices) v = R * v;
      const auto Y = test::pose<S>(R.transpose(), Eigen::Vector3d::Zero());
      const auto X = test::pose<S>(Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero());
      const Model<S> a(large.mesh(), with(margin)), b(small.mesh());
      for (int times = 0; times < 3; ++times) {
        ASSERT_EQ(test::touching<S>(a, X, b, Y), touch) << margin << ' ' << times;
        ASSERT_EQ(test::touching<S>(b, Y, a, X), touch) << margin << ' ' << times;
        fcl::CollisionResult<S> all;
        fcl::collide(&a, X, &b, Y, fcl::CollisionRequest<S>(10), all);
        ASSERT_EQ(all.numContacts(), touch ? 2u : 0u) << margin << ' ' << times;
      }
    }
  }
}

TEST(MarginDouble, ContactsAreAllPairsWithinIt) {
  const Raw meshes[] = {test::adversarial(), test::soup(60, 4), test::torus(7), test::torus(14, 0.3)};
  std::mt19937_64 g(2);
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  std::size_t found = 0;
  for (const Raw& ra : meshes) {
    for (const Raw& rb : meshes) {
      const auto bvh = test::bvh<fcl::OBBRSSd>(rb);
      for (const double margin : {1e-9, 0.01, 0.2, 30.0}) {
        const Modeld a(ra.mesh(), with(margin / 4)), b(rb.mesh(), with(margin * 3 / 4)), all(ra.mesh(), with(margin));
        for (int i = 0; i < 2; ++i) {
          const auto Y = test::pose<double>(test::randomRotation(g), test::randomDirection(g) * (0.7 + 0.9 * i));
          const test::Pairs expected = bruteForce(ra, rb, Y, margin);
          ASSERT_EQ(test::pairs<double>(a, I, b, Y), expected) << margin;
          ASSERT_EQ(test::pairs<double>(all, I, *bvh, Y), expected) << margin;
          test::Pairs swapped;
          for (const auto& [t, u] : test::pairs<double>(b, Y, a, I)) swapped.insert({u, t});
          ASSERT_EQ(swapped, expected) << margin;
          found += expected.size();
        }
      }
    }
  }
  EXPECT_GT(found, 1000u);
}

// The depth is how far the second must go along the normal until the two primitives are a margin apart.
TEST(MarginDouble, ContactsSayHowToPart) {
  const Raw ra = test::torus(20), rb = test::torus(15, 0.3);
  const double margin = 0.1;
  const Modeld a(ra.mesh(), with(margin)), b(rb.mesh());
  std::mt19937_64 g(3);
  const auto X = test::pose<double>(test::randomRotation(g), {0.3, 0.2, 0.1});
  int near = 0, meeting = 0;
  for (int i = 0; i < 6; ++i) {
    const auto Y = test::pose<double>(test::randomRotation(g), test::randomDirection(g) * (1.6 + 0.1 * i));
    for (const bool swapped : {false, true}) {
      const fcl::CollisionRequestd request(10000, true);
      fcl::CollisionResultd result;
      if (swapped) {
        fcl::collide(&b, Y, &a, X, request, result);
      } else {
        fcl::collide(&a, X, &b, Y, request, result);
      }
      for (std::size_t k = 0; k < result.numContacts(); ++k) {
        const auto& c = result.getContact(k);
        ASSERT_EQ(c.o1, swapped ? static_cast<const fcl::CollisionGeometryd*>(&b) : &a);
        query::Corners p, q;
        for (int v = 0; v < 3; ++v) {
          const auto &s = ra.triangles[static_cast<std::size_t>(swapped ? c.b2 : c.b1)],
                     &t = rb.triangles[static_cast<std::size_t>(swapped ? c.b1 : c.b2)];
          p[v] = X * ra.vertices[s[static_cast<std::size_t>(v)]];
          q[v] = Y * rb.vertices[t[static_cast<std::size_t>(v)]];
        }
        Eigen::Vector3d on_p, on_q;
        const double d = query::nearestPoints(p, q, on_p, on_q);
        ASSERT_NEAR(c.normal.norm(), 1, 1e-12);
        if (d > 1e-9) {
          ASSERT_NEAR(c.penetration_depth, margin - d, 1e-9);
          ASSERT_LT((c.pos - (on_p + on_q) / 2).norm(), 1e-6);
          ++near;
        } else {
          ASSERT_GE(c.penetration_depth, margin);
          ++meeting;
        }
        auto& moved = swapped ? p : q;
        for (auto& x : moved) x += c.normal * (c.penetration_depth + 1e-9);
        ASSERT_GE(query::nearestPoints(p, q, on_p, on_q), margin - 1e-9);
      }
    }
  }
  EXPECT_GT(near, 100);
  EXPECT_GT(meeting, 10);
}

TEST(MarginConservative, NeverFreeWithinIt) {
  const Raw ra = test::torus(40), rb = test::torus(23, 0.3);
  const Modeld exact_a(ra.mesh()), exact_b(rb.mesh());
  const auto bvh = test::bvh<fcl::OBBRSSd>(rb);
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  std::mt19937_64 g(4);
  std::uniform_real_distribution<double> u(0, 1);
  int free_ones = 0;
  for (const Subdivision subdivision : {Subdivision::kOctree, Subdivision::kBono}) {
    for (int i = 0; i < 12; ++i) {
      const auto Y = test::pose<double>(test::randomRotation(g), test::randomDirection(g) * (1.8 + 2 * u(g)));
      const double d = test::distance<double>(exact_a, I, exact_b, Y);
      for (const double margin : {d * (1 + 1e-9), d * 2 + 1e-3, d / 4}) {
        auto options = with(margin, Answer::kConservative, subdivision);
        options.depth = 5;
        auto none = options;
        none.margin = 0;
        const Modeld a(ra.mesh(), options), b(rb.mesh(), none), same(ra.mesh(), none);
        const bool hit = test::touching<double>(a, I, b, Y);
        EXPECT_TRUE(hit || margin < d);
        EXPECT_EQ(test::touching<double>(b, Y, a, I), hit);
        // As the distance of the spheres says, which is a query of its own.
        EXPECT_EQ(hit, test::distance<double>(same, I, b, Y) <= margin);
        for (const fcl::CollisionGeometryd* partner : test::Geometries<double>{&exact_b, bvh.get()}) {
          EXPECT_EQ(test::touching<double>(a, I, *partner, Y), test::distance<double>(same, I, *partner, Y) <= margin);
          EXPECT_EQ(test::touching<double>(*partner, Y, a, I), test::distance<double>(same, I, *partner, Y) <= margin);
        }
        free_ones += !hit;
      }
    }
  }
  EXPECT_GT(free_ones, 5);
}

// Shapes and octrees have no margin of their own.

TYPED_TEST(Margin, ShapesWithinItCollide) {
  using S = TypeParam;
  const Raw raw = test::torus(14);
  const Model<S> plain(raw.mesh());
  const double off = std::is_same<S, double>::value ? 1e-6 : 1e-3;
  std::mt19937_64 g(5);
  std::uniform_real_distribution<double> u(0, 1);
  for (const auto& [name, shape] : test::shapes<S>()) {
    SCOPED_TRACE(name);
    const test::Truth<S> truth(raw, *shape);
    int apart = 0;
    for (int i = 0; i < 30; ++i) {
      const auto X = test::pose<S>(test::randomRotation(g), test::randomDirection(g));
      const auto Y = test::pose<S>(test::randomRotation(g), test::randomDirection(g) * 4 * u(g));
      const double d = truth.distance(X, Y);
      for (const double margin : {d * (1 + off) + 1e-4, d * (1 - off) - 1e-4, d * 3 + 1e-2, d / 3}) {
        if (margin < 0) continue;
        const bool hit = margin > d || d == 0;
        const Model<S> wide(raw.mesh(), with(margin));
        for (const auto solver : {fcl::GST_LIBCCD, fcl::GST_INDEP}) {
          fcl::CollisionRequest<S> request;
          request.gjk_solver_type = solver;
          fcl::CollisionResult<S> one, other;
          ASSERT_EQ(fcl::collide(&wide, X, shape.get(), Y, request, one) > 0, hit) << margin << ' ' << d;
          ASSERT_EQ(fcl::collide(shape.get(), Y, &wide, X, request, other) > 0, hit) << margin << ' ' << d;
        }
        ASSERT_EQ(test::distance<S>(wide, X, *shape, Y), test::distance<S>(plain, X, *shape, Y))
            << "distances know no margin";
      }
      apart += d > 0;
    }
    EXPECT_GT(apart, 3);
  }
}

TYPED_TEST(Margin, ContactsWithShapesAreAllWithinItAndSayHowToPart) {
  using S = TypeParam;
  const Raw raw = test::torus(14);
  const double margin = 0.15, off = std::is_same<S, double>::value ? 1e-6 : 1e-4;
  const Model<S> wide(raw.mesh(), with(margin));
  std::mt19937_64 g(6);
  std::uniform_real_distribution<double> u(0, 1);
  for (const auto& [name, shape] : test::shapes<S>()) {
    SCOPED_TRACE(name);
    const test::Truth<S> truth(raw, *shape);
    int near = 0, meeting = 0;
    for (int i = 0; i < 16; ++i) {
      const auto X = test::pose<S>(test::randomRotation(g), test::randomDirection(g));
      const auto Y = test::pose<S>(test::randomRotation(g), X.translation().template cast<double>() +
                                                                test::randomDirection(g) * (0.3 + 1.6 * u(g)));
      const fcl::CollisionRequest<S> request(1000000, true);
      fcl::CollisionResult<S> ours, turned;
      fcl::collide(&wide, X, shape.get(), Y, request, ours);
      fcl::collide(shape.get(), Y, &wide, X, request, turned);
      ASSERT_EQ(ours.numContacts(), turned.numContacts());
      std::set<std::intptr_t> found, back;
      for (std::size_t k = 0; k < ours.numContacts(); ++k) {
        const auto &c = ours.getContact(k), &d = turned.getContact(k);
        found.insert(c.b1);
        back.insert(d.b2);
        const auto t = static_cast<std::size_t>(c.b1);
        const query::SeparationResult gap = truth.gap(t, X, Y);
        const double depth = static_cast<double>(c.penetration_depth);
        ASSERT_NEAR(c.normal.norm(), 1, 1e-5);
        if (gap.distance > off) {
          ASSERT_NEAR(depth, margin - gap.distance, off);
          ASSERT_LT((c.pos.template cast<double>() - (gap.on_body + gap.on_points) / 2).norm(), 0.05);
          ++near;
        } else {
          ASSERT_GE(depth, margin - off);
          ++meeting;
        }
        // Moved back from the shape by the depth, they are a margin apart.
        const Eigen::Vector3d n = c.normal.template cast<double>();
        ASSERT_GE(truth.gap(t, X, Y, -n * (depth * (1 + 1e-3))).distance, margin - 2 * off) << i << ' ' << depth;
      }
      ASSERT_EQ(found, back);
      ASSERT_EQ(found.size(), ours.numContacts()) << "no pair twice";
      for (std::size_t t = 0; t < raw.triangles.size(); ++t) {
        const double d = truth.gap(t, X, Y).distance;
        if (std::abs(d - margin) > off) {
          ASSERT_EQ(found.count(static_cast<std::intptr_t>(t)), d < margin) << d;
        }
      }
    }
    EXPECT_GT(near, 50);
    EXPECT_GT(meeting, 10);
  }
}

TYPED_TEST(Margin, CellsOfOctreesWithinItCollide) {
  using S = TypeParam;
  const Raw raw = test::torus(12);
  const auto octree = test::cloud<S>(2, 60);
  const auto boxes = octree->toBoxes();
  const double off = std::is_same<S, double>::value ? 1e-6 : 1e-4;
  std::mt19937_64 g(7);
  std::uniform_real_distribution<double> u(0, 1);
  std::size_t pairs = 0;
  for (int i = 0; i < 20; ++i) {
    const auto X = test::pose<S>(test::randomRotation(g), test::randomDirection(g));
    const auto Y = test::pose<S>(test::randomRotation(g),
                                 X.translation().template cast<double>() + test::randomDirection(g) * 3 * u(g));
    std::vector<double> gaps;
    for (std::size_t t = 0; t < raw.triangles.size(); ++t) {
      for (const auto& box : boxes) gaps.push_back(test::gap<S>(raw, t, X, box, Y));
    }
    const double least = *std::min_element(gaps.begin(), gaps.end());
    for (const double margin : {0.1, least * 1.01 + 1e-3, least * 0.99}) {
      const Model<S> wide(raw.mesh(), with(margin));
      const auto within = [&](double d) {
        return std::count_if(gaps.begin(), gaps.end(), [d](double x) { return x <= d; });
      };
      const fcl::CollisionRequest<S> request(1000000, true);
      fcl::CollisionResult<S> ours, turned;
      fcl::collide(&wide, X, octree.get(), Y, request, ours);
      fcl::collide(octree.get(), Y, &wide, X, request, turned);
      ASSERT_EQ(ours.numContacts(), turned.numContacts());
      ASSERT_GE(static_cast<long>(ours.numContacts()), within(margin - off));
      ASSERT_LE(static_cast<long>(ours.numContacts()), within(margin + off));
      ASSERT_EQ(test::touching<S>(wide, X, *octree, Y), ours.isCollision());
      pairs += ours.numContacts();
      for (std::size_t k = 0; k < ours.numContacts(); ++k) {
        const auto &c = ours.getContact(k), &d = turned.getContact(k);
        ASSERT_EQ(c.o2, octree.get());
        ASSERT_EQ(d.o1, octree.get());
        ASSERT_GE(c.penetration_depth, 0);
        ASSERT_NEAR(c.normal.norm(), 1, 1e-5);
      }
    }
  }
  EXPECT_GT(pairs, 1000u);
}

TEST(MarginConservative, ShapesAndCellsAreNeverFreeWithinIt) {
  const Raw raw = test::torus(14);
  std::vector<std::shared_ptr<fcl::CollisionGeometryd>> partners = {test::cloud<double>(9, 60)};
  for (const auto& [name, shape] : test::shapes<double>()) partners.push_back(shape);
  std::mt19937_64 g(8);
  std::uniform_real_distribution<double> u(0, 1);
  const Modeld exact(raw.mesh());
  int hits = 0, free_ones = 0;
  for (const auto& partner : partners) {
    for (const Subdivision subdivision : {Subdivision::kOctree, Subdivision::kBono}) {
      for (int i = 0; i < 6; ++i) {
        const auto X = test::pose<double>(test::randomRotation(g), test::randomDirection(g));
        const auto Y = test::pose<double>(test::randomRotation(g), test::randomDirection(g) * 4 * u(g));
        const double d = test::distance<double>(exact, X, *partner, Y);
        auto options = with(0, Answer::kConservative, subdivision);
        options.depth = 5;
        const Modeld none(raw.mesh(), options);
        const double e = test::distance<double>(none, X, *partner, Y);
        for (const double margin : {d * (1 + 1e-6) + 1e-6, e * (1 + 1e-4) + 1e-4, e * (1 - 1e-4) - 1e-4}) {
          if (margin < 0) continue;
          options.margin = margin;
          const Modeld a(raw.mesh(), options);
          fcl::CollisionResultd result;
          const bool hit = fcl::collide(&a, X, partner.get(), Y, fcl::CollisionRequestd(100, true), result) > 0;
          EXPECT_EQ(hit, e <= margin) << "as the distance of the spheres says";
          EXPECT_EQ(test::touching<double>(*partner, Y, a, X), hit);
          for (std::size_t k = 0; k < result.numContacts(); ++k) EXPECT_GE(result.getContact(k).penetration_depth, 0);
          (hit ? hits : free_ones)++;
        }
      }
    }
  }
  EXPECT_GT(hits, 100);
  EXPECT_GT(free_ones, 30);
}

TEST(MarginDouble, CostsAreOfWhatSharesRoom) {
  const Modeld plain(test::box({0, 0, 0}, {1, 1, 1}).mesh()), wide(plain.mesh(), with(0.5));
  const fcl::Boxd box(1, 1, 1);
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  for (const double x : {1.4, 1.7}) {
    const auto Y = test::pose<double>(I.linear(), {x, 0.5, 0.5});
    std::vector<fcl::CostSourced> p, w;
    for (const auto& [model, sources] : {std::pair(&plain, &p), std::pair(&wide, &w)}) {
      fcl::CollisionResultd result;
      fcl::collide(model, I, &box, Y, fcl::CollisionRequestd(1, false, 1000, true, false), result);
      result.getCostSources(*sources);
      EXPECT_EQ(result.isCollision(), x < 1.5 || model == &wide);
    }
    EXPECT_EQ(w.empty(), x > 1.5);
    EXPECT_GE(w.size(), p.size());
  }
}

TEST(MarginDouble, BroadphaseManagersSeeIt) {
  const auto model = std::make_shared<Modeld>(test::box({0, 0, 0}, {1, 1, 1}).mesh(), with(0.5));
  const auto bvh = test::bvh<fcl::OBBRSSd>(test::box({0, 0, 0}, {1, 1, 1}));
  for (const double x : {1.4, 1.6}) {
    fcl::CollisionObjectd a(model, fcl::Transform3d(fcl::Transform3d::Identity()));
    fcl::CollisionObjectd b(bvh, test::pose<double>(Eigen::Matrix3d::Identity(), {x, 0, 0}));
    fcl::DynamicAABBTreeCollisionManagerd manager;
    manager.registerObject(&a);
    manager.registerObject(&b);
    manager.setup();
    fcl::DefaultCollisionData<double> data;
    manager.collide(&data, fcl::DefaultCollisionFunction<double>);
    EXPECT_EQ(data.result.isCollision(), x < 1.5);
  }
}

// An edge whose direction has a component with a square too small for a double.
TYPED_TEST(Margin, AlongEdgesWithTinyComponents) {
  using S = TypeParam;
  Raw a, b;
  a.vertices = {{-1, -1, 0}, {1, 0, 0}, {0, 1, 0}};
  a.vertices[1].y() = -1;
  a.triangles.emplace_back(0, 1, 2);
  b.addTriangle({-1, 0, 0.1}, {1, 1e-33, 0.1}, {0, 0, 0.5});
  const auto I = fcl::Transform3<S>(fcl::Transform3<S>::Identity());
  const Model<S> narrow(a.mesh(), with(0.09)), wide(a.mesh(), with(0.2)), model(b.mesh());
  const auto bvh = test::bvh<fcl::AABB<S>>(b);
  for (const fcl::CollisionGeometry<S>* partner : test::Geometries<S>{&model, bvh.get()}) {
    EXPECT_TRUE(test::touching<S>(wide, I, *partner, I));
    EXPECT_TRUE(test::touching<S>(*partner, I, wide, I));
    EXPECT_FALSE(test::touching<S>(narrow, I, *partner, I));
    EXPECT_NEAR(static_cast<double>(test::distance<S>(wide, I, *partner, I)), 0.1, 1e-6);
  }
}

TEST(MarginDouble, TimesOfContactAreThoseOfTheMargin) {
  const Modeld a(test::box({-1, -1, -1}, {0, 1, 1}).mesh(), with(0.25)), b(test::torus(12).mesh(), with(0.125));
  const double left = b.mesh()->bounds().min().x();
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  const auto begin = test::pose<double>(I.linear(), {6 - left, 0.1, 0}),
             end = test::pose<double>(I.linear(), {-left, 0.1, 0});
  fcl::ContinuousCollisionRequestd request;
  fcl::ContinuousCollisionResultd result;
  fcl::continuousCollide(&a, I, I, &b, begin, end, request, result);
  EXPECT_TRUE(result.is_collide);
  EXPECT_NEAR(result.time_of_contact, (6 - 0.375) / 6, 1.1e-4);
  fcl::continuousCollide(&b, begin, end, &a, I, I, request, result);
  EXPECT_NEAR(result.time_of_contact, (6 - 0.375) / 6, 1.1e-4);
  const auto short_of_it = test::pose<double>(I.linear(), {0.376 - left, 0.1, 0});
  fcl::continuousCollide(&a, I, I, &b, begin, short_of_it, request, result);
  EXPECT_FALSE(result.is_collide);
}

TEST(MarginDouble, SignedDistancesAreThoseOfTheSurfaces) {
  const Raw raw = test::torus(20);
  const Modeld plain(raw.mesh()), wide(raw.mesh(), with(0.5));
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  fcl::DistanceRequestd request;
  request.enable_signed_distance = true;
  for (const double x : {1.3, 2.3}) {
    const auto Y = test::pose<double>(I.linear(), {x, 0.2, 0.1});
    fcl::DistanceResultd p, w;
    fcl::distance(&plain, I, &plain, Y, request, p);
    fcl::distance(&wide, I, &wide, Y, request, w);
    EXPECT_EQ(p.min_distance < 0, x < 2);
    EXPECT_EQ(w.min_distance < 0, x < 2);
    if (x > 2) {
      EXPECT_EQ(p.min_distance, w.min_distance);
    }
  }
}

// As near as distance() says, also where FCL's tolerance is larger than the geometries, or squares overflow.
TEST(IsCloserThan, IsThatOfDistancesAtAnySize) {
  const auto I = fcl::Transform3d(fcl::Transform3d::Identity());
  std::mt19937_64 g(12);
  for (const double s : {1e-9, 1e-6, 1e-5, 1.0, 1e6}) {
    const Modeld model(test::box(Eigen::Vector3d(-3, -3, 0) * s, Eigen::Vector3d(3, 4, 0) * s).mesh());
    const fcl::Cylinderd cylinder(s, s);
    const fcl::Boxd box(s, 2 * s, s);
    const fcl::Sphered ball(s);
    const fcl::Coned cone(s, s);
    const fcl::Capsuled capsule(s, s);
    for (const fcl::CollisionGeometryd* shape : test::Geometries<double>{&cylinder, &box, &ball, &cone, &capsule}) {
      for (int i = 0; i < 20; ++i) {
        auto X = test::pose<double>(test::randomRotation(g), Eigen::Vector3d(0, 0, 3 + i) * s);
        fcl::DistanceResultd result;
        const double d = bocst::distance<double>(&model, I, shape, X, fcl::DistanceRequestd(), result);
        ASSERT_GT(d, 0);
        ASSERT_TRUE(isCloserThan<double>(&model, I, shape, X, d * (1 + 1e-6))) << s;
        ASSERT_FALSE(isCloserThan<double>(&model, I, shape, X, d * (1 - 1e-6))) << s;
        ASSERT_FALSE(isCloserThan<double>(shape, X, &model, I, 0.0)) << s;
      }
    }
  }
  // Below the tolerance of FCL's solvers, with which collide() may report a contact.
  {
    const Modeld model(test::box({-3, -3, -1}, {3, 4, 0}).mesh());
    const fcl::Sphered ball(1);
    const auto X = test::pose<double>(Eigen::Matrix3d::Identity(), {0.3, 0.2, 1 + 2e-7});
    ASSERT_TRUE(isCloserThan<double>(&model, I, &ball, X, 3e-7));
    ASSERT_FALSE(isCloserThan<double>(&model, I, &ball, X, 1e-7));
    ASSERT_FALSE(isCloserThan<double>(&ball, X, &model, I, 0.0));
  }
  Options conservative;
  conservative.answer = Answer::kConservative;
  const Modeld exact(test::torus(9).mesh()), spheres(test::torus(9).mesh(), conservative);
  const fcl::Sphered ball(1);
  for (const double far : {1e60, 1e90, 1e155, 1e160, 1e300}) {
    const auto X = test::pose<double>(Eigen::Matrix3d::Identity(), {far, 0, 0});
    for (const fcl::CollisionGeometryd* a : {&exact, &spheres}) {
      for (const fcl::CollisionGeometryd* b : test::Geometries<double>{&ball, &exact, &spheres}) {
        EXPECT_FALSE(isCloserThan<double>(a, X, b, I, far / 2)) << far;
        EXPECT_TRUE(isCloserThan<double>(b, I, a, X, far * 2)) << far;
      }
    }
  }
}

// Half sides of cells below the least float.
TEST(IsCloserThan, FindsCellsOfAnySize) {
  const auto I = fcl::Transform3d(fcl::Transform3d::Identity());
  for (const double s : {1.0, 1e-30, 1e-40, 1e-44, 1e-45, 1e-50, 1e-200}) {
    test::Raw raw;
    raw.addTriangle({0, 0, 0}, {s, 0, 0}, {0, s, 0});
    const Modeld model(raw.mesh());
    auto map = std::make_shared<octomap::OcTree>(0.25 * s);
    map->updateNode(map->keyToCoord(octomap::OcTreeKey(32768, 32768, 32768)), true);  // from 0 to 0.25 s
    const fcl::OcTreed octree(map);
    const auto apart = test::pose<double>(Eigen::Matrix3d::Identity(), {0, 0, 0.75 * s});
    for (const double x : {1.0, 2.0}) {
      EXPECT_TRUE(isCloserThan<double>(&octree, apart, &model, I, x * 0.76 * s)) << s;
      EXPECT_TRUE(isCloserThan<double>(&model, I, &octree, I, x * s)) << s;
    }
    EXPECT_TRUE(isCloserThan<double>(&model, I, &octree, I, 0.0)) << s;
    if (s > 1e-160) {  // squares vanish below
      EXPECT_FALSE(isCloserThan<double>(&model, I, &octree, apart, 0.7 * s)) << s;
    }
  }
}

TEST(IsCloserThan, NothingIsNearAnEmptyModel) {
  const auto I = fcl::Transform3d(fcl::Transform3d::Identity());
  const Modeld empty, model(test::torus(9).mesh());
  const fcl::Sphered ball(1);
  for (const double d : {0.0, 1.0, 1e100}) {
    EXPECT_FALSE(isCloserThan<double>(&empty, I, &model, I, d));
    EXPECT_FALSE(isCloserThan<double>(&ball, I, &empty, I, d));
  }
}

TEST(IsCloserThan, RefusesWhatIsNoDistance) {
  const Modeld a(test::torus(9).mesh());
  const auto I = fcl::Transform3d(fcl::Transform3d::Identity());
  for (const double bad : {-1.0, std::nan(""), std::numeric_limits<double>::infinity()}) {
    EXPECT_THROW(isCloserThan<double>(&a, I, &a, I, bad), std::invalid_argument) << bad;
  }
  EXPECT_TRUE(isCloserThan<double>(&a, I, &a, I, 0.0));
}

}  // namespace
}  // namespace bocst
