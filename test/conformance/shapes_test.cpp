// SPDX-License-Identifier: BSD-3-Clause
// FCL's shapes as partners: against FCL's own mesh query where that is right, against every triangle one by one, and
// against what the answers must mean.
#include "conformance/shapes.h"

#include <fcl/broadphase/broadphase_dynamic_AABB_tree.h>
#include <fcl/broadphase/default_broadphase_callbacks.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

#include "conformance/reference.h"
#include "conformance/truth.h"
#include "fcl/adapters/models.h"
#include "sanitized.h"
#include "thread_group.h"
#include "tree/tree.h"

namespace bocst {
namespace {

using Eigen::Vector3d;
using test::Raw;
using test::Truth;

constexpr fcl::GJKSolverType kSolvers[] = {fcl::GST_LIBCCD, fcl::GST_INDEP};

template <typename S>
fcl::CollisionRequest<S> all(fcl::GJKSolverType solver, bool contacts = false) {
  fcl::CollisionRequest<S> request(1000000, contacts);
  request.gjk_solver_type = solver;
  return request;
}

/// Poses around contact and anywhere.
template <typename S, typename F>
void forPoses(int count, unsigned seed, const Truth<S>& truth, F&& f) {
  std::mt19937_64 g(seed);
  std::uniform_real_distribution<double> u(0, 1);
  for (int i = 0; i < count; ++i) {
    const auto X = test::pose<S>(test::randomRotation(g), test::randomDirection(g));
    const Eigen::Matrix3d R = test::randomRotation(g);
    const Vector3d p = X.translation().template cast<double>(), displacement = test::randomDirection(g);
    const auto at = [&](double d) { return test::pose<S>(R, p + displacement * d); };
    double d = 2.5 * u(g);
    if (i % 2 == 1) {
      d = test::contactDistance([&](double x) { return truth.distance(X, at(x)) == 0; }, 4, 12);
      d += (i % 4 == 1 ? 1 : -1) * std::pow(10.0, -1 - 7 * u(g));
    }
    f(i, X, at(d));
  }
}

template <typename S>
class Shapes : public testing::Test {};
TYPED_TEST_SUITE(Shapes, test::Scalars);

TYPED_TEST(Shapes, RequestsAreHonoured) {
  using S = TypeParam;
  const Raw raw = test::torus(20);
  const Model<S> model(raw.mesh());
  const fcl::Sphere<S> sphere(S(0.5));
  const auto I = test::pose<S>(Eigen::Matrix3d::Identity(), {0, 0, 0});
  const auto Y = test::pose<S>(Eigen::Matrix3d::Identity(), {0.9, 0.2, 0.1});
  const fcl::CollisionGeometry<S>*m = &model, *s = &sphere;
  fcl::CollisionResult<S> result;
  EXPECT_EQ(fcl::collide(m, I, s, Y, fcl::CollisionRequest<S>(3), result), 3u);
  EXPECT_EQ(fcl::collide(m, I, s, Y, fcl::CollisionRequest<S>(3), result), 3u) << "satisfied already";
  EXPECT_EQ(fcl::collide(s, Y, m, I, fcl::CollisionRequest<S>(5), result), 5u) << "accumulates";
  for (std::size_t i = 0; i < 5; ++i) {
    const auto& c = result.getContact(i);
    EXPECT_TRUE(std::isnan(c.penetration_depth) && c.normal.hasNaN() && c.pos.hasNaN()) << "not asked for";
  }
  fcl::CollisionResult<S> none;
  EXPECT_EQ(fcl::collide(m, I, s, Y, fcl::CollisionRequest<S>(0), none), 0u);
  // A solver that the caller brings.
  const fcl::detail::GJKSolver_libccd<S> libccd;
  const fcl::detail::GJKSolver_indep<S> indep;
  for (const S x : {S(0.9), S(3)}) {
    const auto Z = test::pose<S>(Eigen::Matrix3d::Identity(), {static_cast<double>(x), 0, 0});
    fcl::CollisionResult<S> a, b, c;
    const fcl::CollisionRequest<S> request;
    fcl::collide(m, I, s, Z, &libccd, request, a);
    fcl::collide(s, Z, m, I, &indep, request, b);
    fcl::collide<S>(s, Z, m, I, request, c);  // through what the library exports
    EXPECT_TRUE(a.isCollision() == (x < 1) && b.isCollision() == (x < 1) && c.isCollision() == (x < 1));
  }
}

TYPED_TEST(Shapes, FreeAndUncertainShapesDoNotCollide) {
  using S = TypeParam;
  const Raw raw = test::torus(20);
  const Model<S> model(raw.mesh());
  fcl::Box<S> box(1, 1, 1);
  const auto I = test::pose<S>(Eigen::Matrix3d::Identity(), {0, 0, 0});
  const auto Y = test::pose<S>(Eigen::Matrix3d::Identity(), {0.9, 0.2, 0.1});
  EXPECT_TRUE(test::touching<S>(model, I, box, Y));
  for (const bool approximate : {false, true}) {
    const fcl::CollisionRequest<S> request(1, false, 100, true, approximate);
    for (const S density : {S(0.5), S(0)}) {
      box.cost_density = density;
      fcl::CollisionResult<S> result;
      EXPECT_EQ(fcl::collide(&model, I, &box, Y, request, result), 0u);
      std::vector<fcl::CostSource<S>> sources;
      result.getCostSources(sources);
      EXPECT_EQ(sources.empty(), density == 0) << "uncertain costs, free does not";
      fcl::CollisionResult<S> turned;
      EXPECT_EQ(fcl::collide(&box, Y, &model, I, request, turned), 0u);
      turned.getCostSources(sources);
      EXPECT_EQ(sources.empty(), density == 0);
    }
    EXPECT_FALSE(test::touching<S>(model, I, box, Y));
    box.cost_density = 1;
  }
}

TEST(ShapesDouble, CostsEqualFcls) {
  const Raw raw = test::torus(24);
  const auto theirs = test::bvh<fcl::OBBRSSd>(raw);
  const auto boxed = test::bvh<fcl::AABBd>(raw);  // whose box about the mesh is ours
  for (const auto& entry : test::shapes<double>()) {
    const std::string& name = entry.name;
    const auto& shape = entry.shape;
    if (name == "triangle") continue;
    SCOPED_TRACE(name);
    shape->computeLocalAABB();
    shape->cost_density = 2;
    const Modeld model(raw.mesh());
    const Truth<double> truth(raw, *shape);
    int costs = 0;
    std::mt19937_64 g(3);
    for (int i = 0; i < 6; ++i) {
      const auto X = test::pose<double>(test::randomRotation(g), {0, 0, 0});
      const auto Y = test::pose<double>(test::randomRotation(g), test::randomDirection(g) * 0.8);
      for (const bool approximate : {false, true}) {
        const fcl::CollisionRequestd request(3, false, 1000000, true, approximate);
        const auto ask = [&](const fcl::CollisionGeometryd* a, const auto& XA, const fcl::CollisionGeometryd* b,
                             const auto& XB) {
          fcl::CollisionResultd result;
          fcl::collide(a, XA, b, XB, request, result);
          EXPECT_EQ(result.numContacts(), truth.distance(X, Y) == 0 ? 3u : 0u);
          std::vector<fcl::CostSourced> sources;
          result.getCostSources(sources);
          return sources;
        };
        const auto ours = ask(&model, X, shape.get(), Y), turned = ask(shape.get(), Y, &model, X);
        ASSERT_EQ(turned.size(), ours.size());
        if (truth.distance(X, Y) > 0) continue;
        ASSERT_GT(ours.size(), 0u);
        ++costs;
        if (approximate) {
          // One, of the whole mesh.
          ASSERT_EQ(ours.size(), 1u);
          ASSERT_EQ(ours[0].cost_density, 2);
          ASSERT_GT(ours[0].total_cost, 0);
          // FCL calls a null pointer for a BVHModel<AABB> and what is unbounded.
          if (name == "plane" || name == "half-space") continue;
          const auto reference = ask(boxed.get(), X, shape.get(), Y);
          ASSERT_EQ(reference.size(), 1u);
          ASSERT_EQ(reference[0].cost_density, 2);
          ASSERT_NEAR(ours[0].total_cost, reference[0].total_cost, 1e-9 * reference[0].total_cost);
          ASSERT_LT((ours[0].aabb_min - reference[0].aabb_min).norm(), 1e-9);
          ASSERT_LT((ours[0].aabb_max - reference[0].aabb_max).norm(), 1e-9);
          continue;
        }
        const auto reference = ask(theirs.get(), X, shape.get(), Y);
        // FCL's solver may miss what it just touches, and unbounded boxes have no cost that one could sum.
        ASSERT_NEAR(static_cast<double>(ours.size()), static_cast<double>(reference.size()), 2);
        const auto sum = [](const auto& sources) {
          double total = 0;
          for (const auto& s : sources) total += s.total_cost;
          return total;
        };
        ASSERT_NEAR(sum(ours), sum(reference), 1e-3 * sum(reference));
        fcl::CollisionRequestd few(3, false, 2, true, false);
        fcl::CollisionResultd result;
        fcl::collide(&model, X, shape.get(), Y, few, result);
        std::vector<fcl::CostSourced> sources;
        result.getCostSources(sources);
        ASSERT_LE(sources.size(), 2u);
      }
    }
    EXPECT_GT(costs, 5);
  }
}

// The one sphere about a model of depth 1 and a half-space: the depth of the sphere, and the middle of their overlap.
TEST(ShapesDouble, ContactsOfASphereAndAHalfspaceAreExact) {
  Options options;
  options.answer = Answer::kConservative;
  options.depth = 1;
  const auto I = test::pose<double>(Eigen::Matrix3d::Identity(), {0, 0, 0});
  for (const double margin : {0.0, 0.3}) {
    options.margin = margin;
    const Modeld model(test::torus(14).mesh(), options);
    Eigen::Vector3d center;
    double radius = 0;
    model.visit([&](const NodeView& node) {
      center = node.center;
      radius = node.radius;
    });
    ASSERT_GT(radius, 0.5);
    const fcl::Halfspaced below(Eigen::Vector3d::UnitZ(), 0);
    for (const double height : {-0.4, 0.0, 0.2, radius - 0.01, radius + 0.2, radius + 0.4}) {
      const auto X = test::pose<double>(Eigen::Matrix3d::Identity(), Eigen::Vector3d(0.3, 0, height) - center);
      for (const bool turned : {false, true}) {
        const fcl::CollisionRequestd request(9, true);
        fcl::CollisionResultd result;
        turned ? fcl::collide<double>(&below, I, &model, X, request, result)
               : fcl::collide<double>(&model, X, &below, I, request, result);
        ASSERT_EQ(result.numContacts(), height <= radius + margin ? 1u : 0u) << height;
        if (result.numContacts() == 0) continue;
        const fcl::Contactd& c = result.getContact(0);
        EXPECT_NEAR(c.penetration_depth, radius - height + margin, 1e-9) << height;
        EXPECT_NEAR((c.normal - Eigen::Vector3d(0, 0, turned ? 1 : -1)).norm(), 0, 1e-9) << height;
        EXPECT_NEAR((c.pos - Eigen::Vector3d(0.3, 0, (height - radius) / 2)).norm(), 0, 1e-9) << height;
      }
    }
  }
}

TYPED_TEST(Shapes, ConservativeAnswersMissNothing) {
  using S = TypeParam;
  const Raw raw = test::torus(14);
  for (const auto& entry : test::shapes<S>()) {
    const std::string& name = entry.name;
    const auto& shape = entry.shape;
    SCOPED_TRACE(name);
    const Truth<S> truth(raw, *shape);
    for (const Subdivision subdivision : {Subdivision::kOctree, Subdivision::kBono}) {
      std::vector<std::unique_ptr<Model<S>>> models;
      for (const int depth : {1, 4, 7}) {
        Options options;
        options.answer = Answer::kConservative;
        options.subdivision = subdivision;
        options.depth = depth;
        models.push_back(std::make_unique<Model<S>>(raw.mesh(), options));
      }
      int hits[3] = {0, 0, 0}, expected = 0;
      forPoses<S>(test::repetitions(40), 4, truth, [&](int i, const auto& X, const auto& Y) {
        const double distance = truth.distance(X, Y);
        expected += distance == 0;
        for (std::size_t m = 0; m < models.size(); ++m) {
          fcl::CollisionResult<S> ours, turned;
          fcl::collide(models[m].get(), X, shape.get(), Y, all<S>(fcl::GST_LIBCCD, true), ours);
          fcl::collide(shape.get(), Y, models[m].get(), X, all<S>(fcl::GST_INDEP, true), turned);
          ASSERT_EQ(ours.numContacts(), turned.numContacts()) << i;
          if (distance == 0) {
            ASSERT_TRUE(ours.isCollision()) << i;
          }
          hits[m] += ours.isCollision();
          std::map<std::intptr_t, fcl::Vector3<S>> normals;
          for (std::size_t k = 0; k < turned.numContacts(); ++k) {
            normals[turned.getContact(k).b2] = turned.getContact(k).normal;
          }
          for (std::size_t k = 0; k < ours.numContacts(); ++k) {
            const auto& c = ours.getContact(k);
            ASSERT_EQ(c.b2, +fcl::Contact<S>::NONE);
            ASSERT_GE(c.penetration_depth, 0);
            ASSERT_NEAR(c.normal.norm(), 1, 1e-5);
            ASSERT_EQ(c.normal, -normals[c.b1]);
          }
          if (m > 0) {
            ASSERT_TRUE(!ours.isCollision() || distance < 4 * std::pow(2, -3.0 * static_cast<double>(m))) << distance;
          }
        }
      });
      EXPECT_GE(hits[0], hits[1]);
      EXPECT_GE(hits[1], hits[2]);
      EXPECT_GE(hits[2], expected);
    }
  }
}

template <typename S>
fcl::DistanceResult<S> askDistance(const fcl::CollisionGeometry<S>& a, const fcl::Transform3<S>& X,
                                   const fcl::CollisionGeometry<S>& b, const fcl::Transform3<S>& Y,
                                   fcl::GJKSolverType solver = fcl::GST_LIBCCD, bool is_signed = false) {
  fcl::DistanceRequest<S> request(true, is_signed);
  request.gjk_solver_type = solver;
  fcl::DistanceResult<S> result;
  const S returned = fcl::distance(&a, X, &b, Y, request, result);
  EXPECT_EQ(returned, result.min_distance);
  return result;
}

TYPED_TEST(Shapes, MinimaRunAndErrorsAreTaken) {
  using S = TypeParam;
  const Raw raw = test::torus(30);
  const fcl::Cylinder<S> cylinder(S(0.4), S(1));
  const auto I = test::pose<S>(Eigen::Matrix3d::Identity(), {0, 0, 0});
  const auto Y = test::pose<S>(Eigen::Matrix3d::Identity(), {3, 0.3, 0.5});
  const Model<S> model(raw.mesh());
  const S exact = askDistance<S>(model, I, cylinder, Y).min_distance;
  ASSERT_GT(exact, 1);
  fcl::DistanceRequest<S> request;
  fcl::DistanceResult<S> result;
  result.min_distance = exact / 2;
  EXPECT_EQ(fcl::distance(&model, I, &cylinder, Y, request, result), exact / 2) << "something nearer is known";
  EXPECT_EQ(result.o1, nullptr);
  result.min_distance = exact * 2;
  EXPECT_NEAR(fcl::distance(&cylinder, Y, &model, I, request, result), exact, 1e-5);
  EXPECT_EQ(result.o2, &model);
  for (const S error : {S(1e-3), S(0.1), S(0.5)}) {
    const Model<S> fresh(raw.mesh());
    fcl::DistanceRequest<S> loose(true, false, error, 0), looser(true, false, 0, error);
    fcl::DistanceResult<S> relative, absolute;
    EXPECT_LE(fcl::distance(&fresh, I, &cylinder, Y, loose, relative), exact * (1 + error) * S(1.0001));
    EXPECT_LE(fcl::distance(&fresh, I, &cylinder, Y, looser, absolute), (exact + error) * S(1.0001));
    EXPECT_GE(relative.min_distance, exact * S(0.9999));
    EXPECT_GE(absolute.min_distance, exact * S(0.9999));
  }
}

// Far from the origin, tiny and huge: where FCL says that they touch, we do, and what we say is near enough.
TYPED_TEST(Shapes, FarTinyAndHuge) {
  using S = TypeParam;
  for (const double scale : {1e-3, 1.0, 1e3}) {
    for (const double far : {0.0, 30.0, 3000.0}) {
      Raw raw = test::torus(14);
      raw.scale(scale);
      const auto theirs = test::bvh<fcl::OBBRSS<S>>(raw);
      const Model<S> model(raw.mesh());
      const S size = static_cast<S>(scale);
      const std::vector<std::shared_ptr<fcl::ShapeBase<S>>> shapes = {
          std::make_shared<fcl::Box<S>>(S(0.7) * size, S(0.4) * size, size),
          std::make_shared<fcl::Sphere<S>>(S(0.5) * size), std::make_shared<fcl::Cylinder<S>>(S(0.3) * size, size),
          std::make_shared<fcl::Halfspace<S>>(fcl::Vector3<S>(0, 0, 1), S(0.1) * size)};
      std::mt19937_64 g(5);
      std::uniform_real_distribution<double> u(0, 1);
      for (const auto& shape : shapes) {
        shape->computeLocalAABB();
        const Truth<S> truth(raw, *shape);
        for (int i = 0; i < 12; ++i) {
          const Vector3d place = test::randomDirection(g) * far * scale;
          const auto X = test::pose<S>(test::randomRotation(g), place);
          const auto Y = test::pose<S>(test::randomRotation(g), place + test::randomDirection(g) * 2 * u(g) * scale);
          fcl::CollisionRequest<S> request;
          request.gjk_tolerance = static_cast<S>(1e-6 * scale);
          fcl::CollisionResult<S> ours, reference;
          fcl::collide(&model, X, shape.get(), Y, request, ours);
          fcl::collide(theirs.get(), X, shape.get(), Y, request, reference);
          const double distance = truth.distance(X, Y);
          if (reference.isCollision() || distance == 0) {
            ASSERT_TRUE(ours.isCollision()) << scale << ' ' << far << ' ' << i;
          }
          const double tolerance = 100 * static_cast<double>(std::numeric_limits<S>::epsilon()) * (far + 3) * scale;
          if (ours.isCollision()) {
            ASSERT_LT(distance, tolerance + 2e-6 * scale) << scale << ' ' << far << ' ' << i;
          }
        }
      }
    }
  }
}

// FCL's test of a sphere takes a triangle without area to be anywhere.
TEST(ShapesDouble, DegenerateMeshes) {
  for (const Raw& raw : {test::adversarial(), test::soup(60, 4)}) {
    const Modeld model(raw.mesh());
    std::mt19937_64 g(6);
    std::uniform_real_distribution<double> u(-1, 2);
    for (const auto& entry : test::shapes<double>()) {
      const std::string& name = entry.name;
      const auto& shape = entry.shape;
      SCOPED_TRACE(name);
      const Truth<double> truth(raw, *shape);
      int hits = 0;
      for (int i = 0; i < 40; ++i) {
        Vector3d p(u(g), u(g), u(g));
        if (i % 2) p = (p * 4).array().round() / 4;
        const auto Y =
            test::pose<double>(i % 3 ? Eigen::Matrix3d(Eigen::Matrix3d::Identity()) : test::randomRotation(g), p);
        const auto I = test::pose<double>(Eigen::Matrix3d::Identity(), {0, 0, 0});
        const double distance = truth.distance(I, Y);
        const bool touch = test::touching<double>(model, I, *shape, Y);
        hits += touch;
        if (distance == 0 || distance > 2e-6) {
          ASSERT_EQ(touch, distance == 0) << i << ' ' << distance;
        }
      }
      EXPECT_GT(hits, 0);
    }
  }
}

// Discs, needles, sheets and points: as those that are a little thicker.
TEST(ShapesDouble, ShapesWithoutExtent) {
  const Raw raw = test::torus(14);
  const Modeld model(raw.mesh());
  const auto make = [](double e) {
    return std::vector<std::shared_ptr<fcl::ShapeBase<double>>>{
        std::make_shared<fcl::Boxd>(1, 1, e),       std::make_shared<fcl::Boxd>(e, 1, e),
        std::make_shared<fcl::Boxd>(e, e, e),       std::make_shared<fcl::Sphered>(e),
        std::make_shared<fcl::Capsuled>(e, 1),      std::make_shared<fcl::Capsuled>(0.3, e),
        std::make_shared<fcl::Cylinderd>(0.5, e),   std::make_shared<fcl::Cylinderd>(e, 1),
        std::make_shared<fcl::Coned>(0.5, e),       std::make_shared<fcl::Coned>(e, 1),
        std::make_shared<fcl::Ellipsoidd>(1, 1, e), std::make_shared<fcl::Ellipsoidd>(e, 1, e)};
  };
  const auto thin = make(0), thick = make(1e-7);
  const auto I = test::pose<double>(Eigen::Matrix3d::Identity(), {0, 0, 0});
  std::mt19937_64 g(11);
  int hits = 0;
  for (std::size_t s = 0; s < thin.size(); ++s) {
    for (int i = 0; i < 30; ++i) {
      const auto Y = test::pose<double>(test::randomRotation(g), test::randomDirection(g));
      const bool touch = test::touching<double>(model, I, *thin[s], Y);
      hits += touch;
      const double d = askDistance<double>(model, I, *thin[s], Y).min_distance;
      ASSERT_NEAR(d, askDistance<double>(model, I, *thick[s], Y).min_distance, 1e-6) << s << ' ' << i;
      if (touch) {
        ASSERT_TRUE(test::touching<double>(*thick[s], Y, model, I)) << s << ' ' << i;
      } else {
        ASSERT_GT(d, 0);
      }
    }
  }
  EXPECT_GT(hits, 60);
}

// A rotation within the stated bound is taken as it is: its transpose is not its inverse.
TEST(ShapesDouble, RotationsThatAreNotQuiteOrthogonal) {
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  Raw far;
  far.addTriangle({1000, 0, 0}, {1001, 0, 0}, {1000, 1, 0});
  const Modeld model(far.mesh());
  const fcl::Sphered small(0.01), unit(1);
  fcl::Transform3d X_WM = I, X_WB = test::pose<double>(I.linear(), {1000.8, 0.2, 0});
  X_WM.linear() *= 1.000499;
  fcl::DistanceResultd result;
  EXPECT_TRUE(test::touching<double>(model, X_WM, small, X_WB));
  EXPECT_TRUE(test::touching<double>(small, X_WB, model, X_WM));
  EXPECT_LE(fcl::distance(&model, X_WM, &small, X_WB, fcl::DistanceRequestd(), result), 0);

  const Modeld plate(test::box({-5, -5, 0}, {5, 5, 0}).mesh());
  for (const double stretch : {1.000499, 0.999501}) {
    fcl::Transform3d X = I;
    X.linear() *= stretch;
    // Between the two, a ball that the rotation stretches and one that it does not (as FCL's) differ.
    for (const double z : {std::min(stretch, 1.0) - 1e-5, std::max(stretch, 1.0) + 1e-5}) {
      X.translation().z() = z;
      EXPECT_EQ(test::touching<double>(plate, I, unit, X), z < stretch) << stretch;
      EXPECT_EQ(test::touching<double>(unit, X, plate, I), z < stretch) << stretch;
    }
  }
}

TEST(ShapesDouble, NormalsOfContactsAreUnitVectors) {
  const Modeld model(test::torus(20).mesh()), other(test::box({-1, -1, -1}, {1, 1, 1}).mesh());
  const fcl::Sphered ball(1);
  const fcl::Boxd box(1, 2, 3);
  fcl::Transform3d X = fcl::Transform3d::Identity();
  X.linear() *= 1 + 4.9e-4;
  fcl::CollisionRequestd request(1000, true);
  std::size_t contacts = 0;
  for (const fcl::CollisionGeometryd* partner : test::Geometries<double>{&ball, &box, &other}) {
    for (const bool turned : {false, true}) {
      fcl::CollisionResultd result;
      const auto Y = test::pose<double>(Eigen::Matrix3d::Identity(), {0.9, 0.1, 0.2});
      turned ? fcl::collide(partner, Y, &model, X, request, result)
             : fcl::collide(&model, X, partner, Y, request, result);
      for (std::size_t i = 0; i < result.numContacts(); ++i) {
        ASSERT_NEAR(result.getContact(i).normal.norm(), 1, 1e-12);
      }
      contacts += result.numContacts();
    }
  }
  EXPECT_GT(contacts, 100u);
}

// Plane and Halfspace have open members, so their normals need not be unit vectors.
TEST(ShapesDouble, NormalsOfAnyLength) {
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  const Modeld cube(test::box({-1, -1, -1}, {1, 1, 1}).mesh());
  for (const double length : {2.0, 1e-3, 1e9}) {
    for (const double d : {-0.5, 0.5, -1.5, 1.5}) {
      fcl::Halfspaced half(Eigen::Vector3d::UnitZ(), 0);
      fcl::Planed plane(Eigen::Vector3d::UnitZ(), 0);
      half.n = plane.n = length * Eigen::Vector3d::UnitZ();
      half.d = plane.d = length * d;
      EXPECT_EQ(test::touching<double>(cube, I, half, I), d > -1) << d;
      EXPECT_EQ(test::touching<double>(half, I, cube, I), d > -1) << d;
      EXPECT_EQ(test::touching<double>(cube, I, plane, I), std::abs(d) < 1) << d;
      EXPECT_EQ(test::touching<double>(plane, I, cube, I), std::abs(d) < 1) << d;
    }
  }
}

TEST(ShapesDouble, WhatIsWhollyInsideASolidTouchesIt) {
  Raw raw = test::torus(12);
  raw.scale(0.01);
  const Modeld model(raw.mesh());
  const auto I = test::pose<double>(Eigen::Matrix3d::Identity(), {0, 0, 0});
  for (const auto& entry : test::shapes<double>()) {
    const std::string& name = entry.name;
    const auto& shape = entry.shape;
    if (name == "plane" || name == "triangle" || name == "half-space") continue;
    SCOPED_TRACE(name);
    EXPECT_TRUE(test::touching<double>(model, I, *shape, I)) << "a shape is solid";
  }
  const fcl::Sphered dust(1e-6);
  const Modeld shell(test::torus(12).mesh());
  EXPECT_FALSE(test::touching<double>(shell, I, dust, test::pose<double>(Eigen::Matrix3d::Identity(), {0.7, 0, 0})))
      << "a model is not";
}

// Gaps down to what rounding leaves of them: FCL's solver calls them contacts.
TEST(ShapesDouble, NormalsOfWhatIsJustOffAreUnitVectors) {
  Raw raw;
  raw.addTriangle({-3, -2, 0}, {4, -1, 0}, {0, 5, 0});
  const Modeld model(raw.mesh());
  const double lean = 0.3;
  const std::vector<std::pair<std::shared_ptr<fcl::ShapeBased>, double>> shapes = {
      {std::make_shared<fcl::Sphered>(0.3), 0.3},
      {std::make_shared<fcl::Capsuled>(0.3, 0.8), 0.3 + 0.4 * std::cos(lean)},
      {std::make_shared<fcl::Boxd>(0.7, 0.4, 1.1), 0.35 * std::sin(lean) + 0.55 * std::cos(lean)},
      {std::make_shared<fcl::Cylinderd>(0.4, 0.8), 0.4 * std::sin(lean) + 0.4 * std::cos(lean)}};
  std::mt19937_64 g(12);
  int contacts = 0;
  for (const auto& [shape, reach] : shapes) {
    for (int i = 0; i < 300; ++i) {
      const auto W = test::pose<double>(test::randomRotation(g), test::randomDirection(g));
      const double gap = std::pow(10.0, -7 - 9.0 * i / 300);
      const Eigen::Matrix3d R = Eigen::AngleAxisd(lean, Vector3d::UnitY()).toRotationMatrix();
      const auto Y = test::pose<double>(R, {0.1, 0.2, reach + gap});
      for (const auto solver : kSolvers) {
        fcl::CollisionResultd result;
        fcl::collide(&model, W, shape.get(), W * Y, all<double>(solver, true), result);
        if (!result.isCollision()) continue;
        const auto& c = result.getContact(0);
        ASSERT_NEAR(c.normal.norm(), 1, 1e-12) << gap;
        ASSERT_GT(c.normal.dot(W.linear().col(2)), 0.9) << gap;
        ++contacts;
      }
    }
  }
  EXPECT_GT(contacts, 500);
}

// Where the two just touch, the difference of a triangle and a body is as flat as rounding about the origin.
TEST(ShapesDouble, WhatJustTouchesTouchesAtBoth) {
  Raw raw;
  raw.addTriangle({-1, 0.5, -0.25}, {-1, 0.5, 0.25}, {1, 0.5, 0.25});
  const std::shared_ptr<fcl::ShapeBased> shapes[] = {std::make_shared<fcl::Cylinderd>(0.2, 0.3),
                                                     std::make_shared<fcl::Coned>(0.2, 0.3),
                                                     std::make_shared<fcl::Ellipsoidd>(0.2, 0.3, 0.1)};
  constexpr double kRadius = 0.4;  // none is larger
  std::uniform_real_distribution<double> u(-1, 1);
  for (const double margin : {0.0, 0.25}) {
    Options options;
    options.margin = margin;
    const Modeld model(raw.mesh(), options);
    int contacts = 0;
    for (const auto& shape : shapes) {
      std::mt19937_64 g(7);
      for (int i = 0; i < test::repetitions(1500); ++i) {
        const auto X = test::pose<double>(test::randomRotation(g), {0, 0, 0});
        auto Y = test::pose<double>(test::randomRotation(g), X * Vector3d(u(g), 0.5 + 0.5 * u(g), 0.25 * u(g)));
        fcl::DistanceRequestd request;
        request.enable_nearest_points = true;
        fcl::DistanceResultd d;
        for (int step = 0; step < 4; ++step) {
          d = fcl::DistanceResultd();
          fcl::distance(&model, X, shape.get(), Y, request, d);
          if (d.min_distance <= 0) break;
          Y.translation() += d.nearest_points[0] - d.nearest_points[1];
        }
        for (const Vector3d& p : d.nearest_points) ASSERT_LT((p - Y.translation()).norm(), kRadius + 1e-6) << i;
        fcl::CollisionResultd result;
        fcl::collide(&model, X, shape.get(), Y, fcl::CollisionRequestd(1, true), result);
        if (!result.isCollision()) continue;
        ++contacts;
        ASSERT_LT((result.getContact(0).pos - Y.translation()).norm(), kRadius + margin + 1e-6) << i;
      }
    }
    EXPECT_GT(contacts, 3 * test::repetitions(1500) / 2);
  }
}

// A bound that rounding has made negative must not be taken for a better one for ever.
TYPED_TEST(Shapes, DistancesOfWhatTouchesALargeOrAtAPointEnd) {
  using S = TypeParam;
  const auto mesh = test::box({-1, -0.5, -0.25}, {1, 0.5, 0.25}).mesh();
  const Model<S> box(mesh);
  const auto distance = [](const Model<S>& model, const fcl::Sphere<S>& ball, const Vector3d& at) {
    fcl::DistanceResult<S> result;
    return fcl::distance<S>(&model, fcl::Transform3<S>::Identity(), &ball,
                            test::pose<S>(Eigen::Matrix3d::Identity(), at), fcl::DistanceRequest<S>(), result);
  };
  for (const double radius : {1e6, 1e7, 1e8}) {
    const fcl::Sphere<S> ball{static_cast<S>(radius)};
    std::mt19937_64 g(3);
    for (int i = 0; i < 40; ++i) {
      const Vector3d n = test::randomDirection(g);
      // Inside, about, and outside of contact.
      for (const double off : {-1.0, -0.5, -0.1, 0.1}) {
        const double d = static_cast<double>(distance(box, ball, (radius + off) * n));
        EXPECT_LE(d, 0.2 + 4 * radius * static_cast<double>(std::numeric_limits<S>::epsilon()));
      }
    }
  }
  Raw point;
  point.vertices = {{1, -1, 0.25}};
  point.triangles.emplace_back(0, 0, 0);
  EXPECT_EQ(distance(Model<S>(point.mesh()), fcl::Sphere<S>(S(1.25)), {2, -1, 1}), S(0));
}

// Far from the origin, triangles in float that are apart by less than the rounding of their poses.
TEST(ShapesFloat, PositionsOfContactsWithinAMarginAreFinite) {
  Raw raw;
  raw.addTriangle({-1, 0.5, -0.25}, {-1, 0.5, 0.25}, {1, 0.5, 0.25});
  Options options;
  options.margin = 0.25;
  const Modelf model(raw.mesh(), options);
  const fcl::TriangleP<float> triangle(fcl::Vector3f(-0.3f, -0.2f, 0), fcl::Vector3f(0.1f, 0.2f, -0.3f),
                                       fcl::Vector3f(0.2f, -0.1f, 0.2f));
  std::mt19937_64 g(5);
  std::uniform_real_distribution<double> u(-1, 1);
  int contacts = 0;
  for (int i = 0; i < test::repetitions(3000); ++i) {
    const auto X = test::pose<float>(test::randomRotation(g), {1e5, 7e4, 3e4});
    const Vector3d near(u(g), 0.5 + 0.5 * u(g), 0.25 * u(g));
    auto Y = test::pose<float>(test::randomRotation(g), {0, 0, 0});
    Y.translation() = X.translation() + X.linear() * near.cast<float>();
    fcl::CollisionResultf result;
    fcl::collide<float>(&model, X, &triangle, Y, fcl::CollisionRequestf(1, true), result);
    if (!result.isCollision()) continue;
    ++contacts;
    ASSERT_TRUE(result.getContact(0).pos.allFinite()) << i;
  }
  EXPECT_GT(contacts, test::repetitions(3000) / 2);
}

// A floor of slivers about one vertex: only oriented boxes part them, and queries pay for these.
TEST(ShapesDouble, BesideSliversAreAskedOverOrientedBoxes) {
  constexpr std::size_t kSlivers = 1500;
  Raw raw;
  raw.vertices.emplace_back(0, 0, 0);
  for (std::size_t i = 0; i < kSlivers; ++i) {
    const double angle = 2 * std::acos(-1.0) * static_cast<double>(i) / static_cast<double>(kSlivers);
    raw.vertices.emplace_back(5 * std::cos(angle), 5 * std::sin(angle), 0);
    raw.triangles.emplace_back(0, 1 + i, 1 + (i + 1) % kSlivers);
  }
  const Modeld model(raw.mesh());
  const tree::Tree& tree = fcl_adapter::treeOf<double>(model);
  const auto I = test::pose<double>(Eigen::Matrix3d::Identity(), {0, 0, 0});
  for (const bool has_boxes : {false, true}) {
    SCOPED_TRACE(has_boxes);
    std::mt19937_64 g(7);
    std::uniform_real_distribution<double> u(-1, 1);
    ASSERT_EQ(tree.knownBoxes() != nullptr, has_boxes);
    for (const test::NamedShape<double>& named : test::shapes<double>()) {
      SCOPED_TRACE(named.name);
      const Truth<double> truth(raw, *named.shape);
      for (int i = 0; i < (has_boxes ? test::repetitions(12) : 1); ++i) {
        const auto X = test::pose<double>(test::randomRotation(g), Vector3d(4 * u(g), 4 * u(g), 0.8 * u(g)));
        const double distance = truth.distance(I, X);
        fcl::CollisionResultd result, few, all;
        EXPECT_EQ(fcl::collide(&model, I, named.shape.get(), X, fcl::CollisionRequestd(), result) > 0, distance == 0);
        fcl::DistanceResultd nearest;
        fcl::distance(&model, I, named.shape.get(), X, fcl::DistanceRequestd(), nearest);
        ASSERT_NEAR(nearest.min_distance, distance, 1e-9) << i;
        // Few contacts are some of all, whatever they were found over.
        fcl::collide(&model, I, named.shape.get(), X, fcl::CollisionRequestd(1000000), all);
        fcl::collide(named.shape.get(), X, &model, I, fcl::CollisionRequestd(3), few);
        std::size_t touching = 0;
        for (std::size_t t = 0; t < kSlivers; ++t) touching += truth.gap(t, I, X).isTouching();
        EXPECT_EQ(all.numContacts(), touching) << i;
        ASSERT_EQ(few.numContacts(), std::min<std::size_t>(3, touching)) << i;
        std::set<std::intptr_t> of_all;
        for (std::size_t c = 0; c < all.numContacts(); ++c) of_all.insert(all.getContact(c).b1);
        EXPECT_EQ(of_all.size(), all.numContacts()) << "each once";
        for (std::size_t c = 0; c < few.numContacts(); ++c) EXPECT_TRUE(of_all.count(few.getContact(c).b2) == 1);
      }
    }
    if (has_boxes) break;
    const fcl::Boxd rod(0.02, 0.02, 2);
    for (int i = 0; i < 3000 && tree.knownBoxes() == nullptr; ++i) {
      const auto X = test::pose<double>(test::randomRotation(g), Vector3d(4 * u(g), 4 * u(g), 1.5 * u(g)));
      fcl::CollisionResultd result;
      fcl::collide(&model, I, &rod, X, fcl::CollisionRequestd(), result);
    }
  }
}

TEST(ShapesDouble, ManagersAndObjects) {
  const auto model = std::make_shared<Modeld>(test::torus(20).mesh());
  fcl::CollisionObjectd arm(model);
  const auto box = std::make_shared<fcl::Boxd>(0.5, 0.5, 0.5);
  fcl::CollisionObjectd near(box, Eigen::Matrix3d::Identity(), Vector3d(0.9, 0, 0));
  fcl::CollisionObjectd far(box, Eigen::Matrix3d::Identity(), Vector3d(0, 0, 0.9));
  for (auto* object : {&near, &far}) {
    object->computeAABB();
    fcl::DynamicAABBTreeCollisionManagerd manager;
    manager.registerObject(&arm);
    manager.setup();
    fcl::DefaultCollisionData<double> data;
    manager.collide(object, &data, fcl::DefaultCollisionFunction<double>);
    EXPECT_EQ(data.result.isCollision(), object == &near);
  }
}

TEST(ShapesDouble, ThreadsGrowOneModel) {
  const Modeld model(test::torus(60).mesh());
  const auto shapes = test::shapes<double>();
  const auto I = test::pose<double>(Eigen::Matrix3d::Identity(), {0, 0, 0});
  std::vector<fcl::Transform3d> poses;
  std::vector<bool> expected;
  std::mt19937_64 g(7);
  const Modeld calm(test::torus(60).mesh());
  for (std::size_t i = 0; i < 66; ++i) {
    poses.push_back(test::pose<double>(test::randomRotation(g), test::randomDirection(g) * 1.2));
    expected.push_back(test::touching<double>(calm, I, *shapes[i % shapes.size()].shape, poses.back()));
  }
  std::atomic<int> wrong{0};
  test::ThreadGroup(4, [&](std::size_t k) {
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const std::size_t n = (i * 7 + k * 11) % poses.size();
      const auto& shape = *shapes[n % shapes.size()].shape;
      wrong += test::touching<double>(shape, poses[n], model, I) != expected[n];
    }
  });
  EXPECT_EQ(wrong, 0);
}

}  // namespace
}  // namespace bocst
