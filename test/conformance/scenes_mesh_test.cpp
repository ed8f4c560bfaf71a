// SPDX-License-Identifier: BSD-3-Clause
// What FCL's own tests of meshes check (test_fcl_collision, _distance, _frontlist, _shape_mesh_consistency), made anew
// with models in place of BVHModels.
#include <fcl/geometry/geometric_shape_to_BVH_model.h>
#include <gtest/gtest.h>

#include "conformance/reference.h"
#include "conformance/solids.h"

namespace bocst {
namespace {

using Eigen::Vector3d;
using test::Pairs;
using test::Raw;

/// A town of boxes and bumpy rings, some 6000 wide; a robot that could walk in it.
Raw town() {
  Raw all;
  std::mt19937_64 g(1);
  std::uniform_real_distribution<double> u(0, 1);
  for (int i = 0; i < 70; ++i) {
    Raw part =
        i % 2 ? test::torus(6 + static_cast<std::size_t>(i % 5)) : test::box({-1, -1, 0}, {1, 1, 3 * u(g) + 0.1});
    const Eigen::Matrix3d R = test::randomRotation(g);
    if (i % 2) {
      for (auto& v : part.vertices) v = R * v;
    }
    all.add(part.scale(100 + 300 * u(g)).move(6000 * Vector3d(u(g) - 0.5, u(g) - 0.5, 0.1 * u(g))));
  }
  return all;
}
Raw robot() {
  Raw all = test::torus(14);
  all.add(test::box({-0.2, -0.2, 0}, {0.2, 0.2, 1.5}));
  all.add(test::box({-0.1, 0, 1.2}, {1.4, 0.1, 1.3}));
  return all.scale(200);
}

fcl::Transform3d anywhereInTown(std::mt19937_64& g) {
  std::uniform_real_distribution<double> u(-1, 1);
  return test::pose<double>(test::randomRotation(g), {2600 * u(g), 2600 * u(g), 500 * u(g)});
}

template <typename BV>
std::shared_ptr<fcl::BVHModel<BV>> split(const Raw& raw, fcl::detail::SplitMethodType method) {
  auto model = std::make_shared<fcl::BVHModel<BV>>();
  model->bv_splitter.reset(new fcl::detail::BVSplitter<BV>(method));
  model->beginModel();
  model->addSubModel(raw.vertices, raw.triangles);
  model->endModel();
  return model;
}

/// Each bounding volume and each way to split, as a mesh in the place of one side.
std::vector<std::shared_ptr<fcl::CollisionGeometryd>> everyBvh(const Raw& raw) {
  std::vector<std::shared_ptr<fcl::CollisionGeometryd>> all;
  for (const auto method :
       {fcl::detail::SPLIT_METHOD_MEAN, fcl::detail::SPLIT_METHOD_MEDIAN, fcl::detail::SPLIT_METHOD_BV_CENTER}) {
    all.push_back(split<fcl::AABBd>(raw, method));
    all.push_back(split<fcl::OBBd>(raw, method));
    all.push_back(split<fcl::RSSd>(raw, method));
    all.push_back(split<fcl::kIOSd>(raw, method));
    all.push_back(split<fcl::OBBRSSd>(raw, method));
    all.push_back(split<fcl::KDOP<double, 16>>(raw, method));
    all.push_back(split<fcl::KDOP<double, 18>>(raw, method));
    all.push_back(split<fcl::KDOP<double, 24>>(raw, method));
  }
  return all;
}

TEST(TownAndRobot, TheSameContactsWithEveryBvhAndEverySplit) {
  const Raw env = town(), rob = robot();
  const auto fcl_env = test::bvh<fcl::OBBRSSd>(env), fcl_rob = test::bvh<fcl::OBBRSSd>(rob);
  const Modeld town_model(env.mesh()), robot_model(*fcl_rob);
  const auto meshes = everyBvh(rob);
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  std::mt19937_64 g(2);
  int hits = 0;
  const int count = 40;
  for (int i = 0; i < count; ++i) {
    const auto X = anywhereInTown(g);
    const Pairs expected = test::pairs<double>(*fcl_rob, X, *fcl_env, I);
    hits += !expected.empty();
    ASSERT_EQ(test::pairs<double>(robot_model, X, town_model, I), expected) << i;
    for (std::size_t k = 0; k < meshes.size(); ++k) {
      ASSERT_EQ(test::pairs<double>(*meshes[k], X, town_model, I), expected) << i << " mesh " << k;
      ASSERT_EQ(test::touching<double>(town_model, I, *meshes[k], X), !expected.empty()) << i << " mesh " << k;
    }
  }
  EXPECT_GT(hits, count / 5);
  EXPECT_LT(hits, count * 4 / 5);
}

TEST(TownAndRobot, TheSameDistances) {
  const Raw env = town(), rob = robot();
  const auto fcl_env = test::bvh<fcl::RSSd>(env), fcl_rob = test::bvh<fcl::RSSd>(rob);
  const Modeld town_model(env.mesh()), robot_model(rob.mesh());
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  std::mt19937_64 g(3);
  int apart = 0;
  for (int i = 0; i < 40; ++i) {
    const auto X = anywhereInTown(g);
    const auto ask = [&](const fcl::CollisionGeometryd& a, const auto& XA, const fcl::CollisionGeometryd& b,
                         const auto& XB) {
      fcl::DistanceRequestd request(true);
      fcl::DistanceResultd result;
      fcl::distance(&a, XA, &b, XB, request, result);
      return result;
    };
    const bool touch = test::touching<double>(robot_model, X, town_model, I);
    const double expected = touch ? 0 : ask(*fcl_rob, X, *fcl_env, I).min_distance;
    apart += !touch;
    for (const auto& d : {ask(robot_model, X, town_model, I), ask(town_model, I, robot_model, X),
                          ask(*fcl_rob, X, town_model, I), ask(town_model, I, *fcl_rob, X)}) {
      ASSERT_NEAR(d.min_distance, expected, 1e-8) << i;
      if (touch) continue;
      ASSERT_NEAR((d.nearest_points[0] - d.nearest_points[1]).norm(), expected, 1e-8) << i;
    }
  }
  EXPECT_GT(apart, 8);
}

// FCL keeps a front list for that; a model keeps what it has grown.
TEST(TownAndRobot, StepByStepByPoseAndByVertices) {
  const Raw env = town(), rob = robot();
  const auto fcl_env = test::bvh<fcl::OBBRSSd>(env), fcl_rob = test::bvh<fcl::OBBRSSd>(rob);
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  std::mt19937_64 g(4);
  int turns = 0, steps = 0;
  for (int walk = 0; walk < 14; ++walk) {
    Options options;
    options.ttl = std::chrono::milliseconds(walk % 2 ? 1 : 2000);
    const Modeld by_pose(rob.mesh(), options);
    Modeld town_model(env.mesh(), options), by_vertices(rob.mesh(), options);
    fcl::Transform3d X = anywhereInTown(g);
    const Vector3d displacement = test::randomDirection(g) * 25, axis = test::randomDirection(g);
    bool before = false;
    for (int i = 0; i < 60; ++i, ++steps) {
      X.translation() += displacement;
      X.rotate(Eigen::AngleAxisd(0.03, axis));
      std::vector<Vector3d> moved;
      for (const auto& v : rob.vertices) moved.push_back(X * v);
      by_vertices.updateVertices(moved);
      const Pairs expected = test::pairs<double>(*fcl_rob, X, *fcl_env, I);
      ASSERT_EQ(test::pairs<double>(by_pose, X, town_model, I), expected) << walk << ' ' << i;
      // Vertices are rounded when they are moved, so pairs that just touch may differ; none does here.
      ASSERT_EQ(test::pairs<double>(town_model, I, by_vertices, I).size(), expected.size()) << walk << ' ' << i;
      if (i % 20 == 0) town_model.prune(Clock::now() + std::chrono::seconds(10));
      turns += i > 0 && before != expected.empty();
      before = expected.empty();
    }
  }
  EXPECT_GT(turns, 8) << "of " << steps;
}

/// A shape, and what FCL makes of it: a mesh with its vertices on the surface of the shape.
template <typename S>
struct Pattern {
  std::string name;
  std::shared_ptr<fcl::ShapeBase<S>> shape;
  std::shared_ptr<Model<S>> model;
  std::shared_ptr<fcl::BVHModel<fcl::OBBRSS<S>>> bvh;
};

/// No one of these has room for another, so where two overlap, their surfaces cut each other.
template <typename S>
std::vector<Pattern<S>> patterns() {
  std::vector<Pattern<S>> all;
  const auto add = [&](const char* name, auto shape, auto... parts) {
    auto bvh = std::make_shared<fcl::BVHModel<fcl::OBBRSS<S>>>();
    fcl::generateBVHModel(*bvh, *shape, fcl::Transform3<S>::Identity(), parts...);
    shape->computeLocalAABB();
    all.push_back({name, shape, std::make_shared<Model<S>>(*bvh), bvh});
  };
  const unsigned n = 40;
  add("sphere", std::make_shared<fcl::Sphere<S>>(S(0.6)), n, n);
  add("ellipsoid", std::make_shared<fcl::Ellipsoid<S>>(S(0.45), S(0.6), S(0.8)), n, n);
  add("box", std::make_shared<fcl::Box<S>>(S(1), S(0.9), S(1.1)));
  add("cylinder", std::make_shared<fcl::Cylinder<S>>(S(0.5), S(1.2)), n, n / 4);
  add("cone", std::make_shared<fcl::Cone<S>>(S(0.7), S(1.4)), n, n / 4);
  return all;
}

test::Solid shrunk(test::Solid s, double by) {
  s.support = [by, support = s.support](const Vector3d& d) { return Vector3d(by * support(d)); };
  s.round *= by;
  return s;
}

template <typename S>
class ShapesAsMeshes : public testing::Test {};
TYPED_TEST_SUITE(ShapesAsMeshes, test::Scalars);

TYPED_TEST(ShapesAsMeshes, AgreeWithTheShapes) {
  using S = TypeParam;
  const auto all = patterns<S>();
  // How far a mesh may be inside its shape.
  const double sag = 0.012, rounding = std::is_same<S, double>::value ? 1e-8 : 1e-5;
  std::mt19937_64 g(5);
  std::uniform_real_distribution<double> u(0, 1);
  int overlapping = 0, apart = 0;
  for (const auto& a : all) {
    for (const auto& b : all) {
      SCOPED_TRACE(a.name + " and " + b.name);
      const test::Solid sa = test::solidOf<S>(*a.shape), sb = test::solidOf<S>(*b.shape);
      for (int i = 0; i < 16; ++i) {
        // Along an axis at first, as FCL does, then any way; the pair as it is, and the two moved together.
        const bool plain = i % 4 == 0;
        const Vector3d displacement = plain ? Vector3d(Vector3d::UnitX()) : test::randomDirection(g);
        const Eigen::Matrix3d R = plain ? Eigen::Matrix3d(Eigen::Matrix3d::Identity()) : test::randomRotation(g);
        const auto between = [&](double d) { return test::pose<double>(R, displacement * d); };
        const auto meet = [&](double d) {
          return distanceOf(sa, Eigen::Isometry3d(between(d).inverse().matrix()), sb).meets();
        };
        const double d = test::contactDistance(meet, 3, 30) + (i % 2 ? -1 : 1) * (0.02 + 0.4 * u(g));
        const auto W = i % 8 < 4 ? test::pose<double>(Eigen::Matrix3d::Identity(), {0, 0, 0})
                                 : test::pose<double>(test::randomRotation(g), 3 * test::randomDirection(g));
        const fcl::Transform3<S> X = W.template cast<S>(), Y = (W * between(d)).template cast<S>();
        const Eigen::Isometry3d X_BA(between(d).inverse().matrix());
        const test::Interval gap = distanceOf(sa, X_BA, sb);
        const bool surely = distanceOf(shrunk(sa, 0.97), X_BA, shrunk(sb, 0.97)).meets();
        overlapping += surely;
        apart += gap.low > 0;
        using Geometry = const fcl::CollisionGeometry<S>*;
        const std::pair<Geometry, Geometry> pairs[] = {{a.model.get(), b.model.get()},
                                                       {a.model.get(), b.shape.get()},
                                                       {a.shape.get(), b.model.get()},
                                                       {a.model.get(), b.bvh.get()},
                                                       {a.bvh.get(), b.model.get()}};
        for (const auto& [p, q] : pairs) {
          for (const auto solver : {fcl::GST_LIBCCD, fcl::GST_INDEP}) {
            fcl::CollisionRequest<S> request;
            request.gjk_solver_type = solver;
            fcl::CollisionResult<S> result;
            const bool hit = fcl::collide(p, X, q, Y, request, result) > 0;
            fcl::DistanceRequest<S> far(true);
            far.gjk_solver_type = solver;
            fcl::DistanceResult<S> nearest;
            const double distance = static_cast<double>(fcl::distance(p, X, q, Y, far, nearest));
            if (surely) {
              ASSERT_TRUE(hit) << i;
              ASSERT_LE(distance, 0) << i;
            }
            if (gap.low > 0) {
              ASSERT_FALSE(hit) << i;
              ASSERT_GE(distance, gap.low - rounding) << i;
              ASSERT_LE(distance, gap.high + 2 * sag + rounding) << i;
            }
          }
        }
        ASSERT_EQ(test::pairs<S>(*a.model, X, *b.model, Y), test::pairs<S>(*a.bvh, X, *b.bvh, Y)) << i;
      }
    }
  }
  EXPECT_GT(overlapping, 100);
  EXPECT_GT(apart, 150);
}

// Both about the same place, and one in the other: shapes are solid, meshes are shells.
TYPED_TEST(ShapesAsMeshes, OneInTheOther) {
  using S = TypeParam;
  const fcl::Transform3<S> I = fcl::Transform3<S>::Identity();
  for (const auto& a : patterns<S>()) {
    SCOPED_TRACE(a.name);
    EXPECT_TRUE(test::touching<S>(*a.model, I, *a.shape, I));
    EXPECT_TRUE(test::touching<S>(*a.model, I, *a.model, I));
    Raw small;
    for (std::size_t i = 0; i < a.model->mesh()->vertexCount(); ++i)
      small.vertices.push_back(a.model->mesh()->vertex(i) / 4);
    for (std::size_t i = 0; i < a.model->mesh()->triangleCount(); ++i)
      small.triangles.push_back(a.model->mesh()->triangle(i));
    const Model<S> inner(small.mesh());
    EXPECT_FALSE(test::touching<S>(*a.model, I, inner, I));
    EXPECT_TRUE(test::touching<S>(inner, I, *a.shape, I)) << "it is in the solid shape";
    EXPECT_GT(test::distance<S>(inner, I, *a.model, I), S(0.1));
  }
}

}  // namespace
}  // namespace bocst
