// SPDX-License-Identifier: BSD-3-Clause
// FCL's seven broadphase managers with FCL's default callbacks, on models, on FCL's meshes, and on both mixed.
#include <fcl/broadphase/broadphase_SSaP.h>
#include <fcl/broadphase/broadphase_SaP.h>
#include <fcl/broadphase/broadphase_bruteforce.h>
#include <fcl/broadphase/broadphase_dynamic_AABB_tree.h>
#include <fcl/broadphase/broadphase_dynamic_AABB_tree_array.h>
#include <fcl/broadphase/broadphase_interval_tree.h>
#include <fcl/broadphase/broadphase_spatialhash.h>
#include <fcl/broadphase/default_broadphase_callbacks.h>
#include <fcl/math/motion/interp_motion.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>

#include "conformance/reference.h"

namespace bocst {
namespace {

using test::Raw;

enum class Kind { kModels, kMixed, kMeshes };

/// What stands where: the same for every kind of geometry.
template <typename S>
struct Layout {
  std::vector<Raw> meshes;
  std::vector<fcl::Transform3<S>> poses;
};

template <typename S>
Layout<S> layout(std::size_t count, double spread, unsigned seed) {
  Layout<S> l;
  std::mt19937_64 g(seed);
  std::uniform_real_distribution<double> u(0, 1);
  for (std::size_t i = 0; i < count; ++i) {
    Raw raw = i % 3 == 2 ? test::box({-0.5, -0.2, -0.3}, {0.5, 0.4, 0.3}) : test::torus(8 + i % 7);
    raw.scale(0.4 + u(g));
    l.meshes.push_back(raw);
    l.poses.push_back(test::pose<S>(test::randomRotation(g), spread * Eigen::Vector3d(u(g), u(g), u(g))));
  }
  return l;
}

/// The objects of a layout. Each has a geometry of its own, so a contact tells whose it is.
template <typename S>
class Scene {
 public:
  Scene(const Layout<S>& l, Kind kind) {
    for (std::size_t i = 0; i < l.meshes.size(); ++i) {
      const bool is_model = kind == Kind::kModels || (kind == Kind::kMixed && i % 2 == 0);
      std::shared_ptr<fcl::CollisionGeometry<S>> geometry;
      if (is_model) {
        geometry = std::make_shared<Model<S>>(l.meshes[i].mesh());
      } else {
        geometry = test::bvh<fcl::OBBRSS<S>>(l.meshes[i]);
      }
      index_[geometry.get()] = i;
      objects_.push_back(std::make_unique<fcl::CollisionObject<S>>(geometry, l.poses[i]));
    }
  }

  std::vector<fcl::CollisionObject<S>*> objects(std::size_t begin, std::size_t end) const {
    std::vector<fcl::CollisionObject<S>*> all;
    for (std::size_t i = begin; i < end; ++i) all.push_back(objects_[i].get());
    return all;
  }
  std::vector<fcl::CollisionObject<S>*> objects() const { return objects(0, size()); }
  fcl::CollisionObject<S>* object(std::size_t i) const { return objects_[i].get(); }
  std::size_t size() const { return objects_.size(); }
  std::size_t indexOf(const fcl::CollisionGeometry<S>* geometry) const { return index_.at(geometry); }

  void move(const Layout<S>& l) {
    for (std::size_t i = 0; i < size(); ++i) {
      objects_[i]->setTransform(l.poses[i]);
      objects_[i]->computeAABB();
    }
  }

 private:
  std::vector<std::unique_ptr<fcl::CollisionObject<S>>> objects_;
  std::map<const fcl::CollisionGeometry<S>*, std::size_t> index_;
};

/// Two objects and a triangle of each, the object of the smaller index first: managers do not agree on the order.
using Hit = std::array<std::intptr_t, 4>;

template <typename S>
std::set<Hit> hitsOf(const Scene<S>& scene, const fcl::CollisionResult<S>& result) {
  std::set<Hit> hits;
  for (std::size_t k = 0; k < result.numContacts(); ++k) {
    const auto& c = result.getContact(k);
    const auto i = static_cast<std::intptr_t>(scene.indexOf(c.o1)), j = static_cast<std::intptr_t>(scene.indexOf(c.o2));
    hits.insert(i < j ? Hit{i, j, c.b1, c.b2} : Hit{j, i, c.b2, c.b1});
  }
  return hits;
}

/// What the queries between the objects [0, count) and the last `others`, or all among themselves, must give.
template <typename S>
struct Expected {
  std::set<Hit> hits;
  double distance = std::numeric_limits<double>::max();

  void add(const Scene<S>& meshes, std::size_t i, std::size_t j) {
    const auto &a = *meshes.object(i), &b = *meshes.object(j);
    const fcl::CollisionRequest<S> request(1000000000);
    fcl::CollisionResult<S> result;
    fcl::collide(&a, &b, request, result);
    const std::set<Hit> found = hitsOf(meshes, result);
    hits.insert(found.begin(), found.end());
    if (!found.empty()) {
      distance = 0;
    } else {
      fcl::DistanceResult<S> d;
      distance = std::min(distance, static_cast<double>(fcl::distance(&a, &b, fcl::DistanceRequest<S>(), d)));
    }
  }
};

/// Queries as a planner makes them: everything at once, and only whether there is something.
template <typename S, typename Ask>
void checkCollide(const Scene<S>& scene, const Expected<S>& expected, Ask&& ask) {
  fcl::DefaultCollisionData<S> all;
  all.request.num_max_contacts = 1000000000;
  ask(all);
  EXPECT_EQ(hitsOf(scene, all.result), expected.hits);
  fcl::DefaultCollisionData<S> one;
  ask(one);
  EXPECT_EQ(one.result.isCollision(), !expected.hits.empty());
  EXPECT_EQ(one.done, !expected.hits.empty());
  EXPECT_LE(one.result.numContacts(), 1u);
}

template <typename S, typename Ask>
void checkDistance(const Scene<S>& scene, const Expected<S>& expected, Ask&& ask) {
  fcl::DefaultDistanceData<S> data;
  data.request.enable_nearest_points = true;
  ask(data);
  const double tolerance = std::is_same<S, double>::value ? 1e-10 : 2e-5;
  ASSERT_NEAR(data.result.min_distance, expected.distance, tolerance);
  if (expected.distance <= 0) return;
  EXPECT_NE(scene.indexOf(data.result.o1), scene.indexOf(data.result.o2));
  EXPECT_NEAR((data.result.nearest_points[0] - data.result.nearest_points[1]).norm(), expected.distance, tolerance);
}

template <typename Manager>
struct Make {
  Manager operator()() const { return Manager(); }
};
template <typename S>
struct Make<fcl::SpatialHashingCollisionManager<S>> {
  fcl::SpatialHashingCollisionManager<S> operator()() const {
    return {S(1), fcl::Vector3<S>::Constant(-3), fcl::Vector3<S>::Constant(30)};
  }
};

template <typename Manager>
class Broadphase : public testing::Test {};
using Managers = testing::Types<fcl::DynamicAABBTreeCollisionManager<double>,
                                fcl::DynamicAABBTreeCollisionManager_Array<double>, fcl::NaiveCollisionManager<double>,
                                fcl::SaPCollisionManager<double>, fcl::SSaPCollisionManager<double>,
                                fcl::IntervalTreeCollisionManager<double>, fcl::SpatialHashingCollisionManager<double>,
                                fcl::DynamicAABBTreeCollisionManager<float>, fcl::NaiveCollisionManager<float>>;
TYPED_TEST_SUITE(Broadphase, Managers);

template <typename Manager>
struct ScalarOf;
template <template <typename...> class Manager, typename S, typename... Others>
struct ScalarOf<Manager<S, Others...>> {
  using type = S;
};

template <typename Manager, typename S>
void checkLayout(const Layout<S>& l, const Layout<S>& later) {
  const std::size_t n = l.meshes.size(), half = n / 2;
  for (const Kind kind : {Kind::kModels, Kind::kMixed, Kind::kMeshes}) {
    SCOPED_TRACE(static_cast<int>(kind));
    Scene<S> meshes(l, Kind::kMeshes), scene(l, kind);
    auto manager = Make<Manager>()(), other = Make<Manager>()(), everything = Make<Manager>()();
    manager.registerObjects(scene.objects(0, half));
    other.registerObjects(scene.objects(half, n));
    everything.registerObjects(scene.objects());
    manager.setup();
    other.setup();
    everything.setup();
    for (const bool is_later : {false, true}) {
      if (is_later) {
        meshes.move(later);
        scene.move(later);
        manager.update();
        other.update();
        everything.update();
      }
      Expected<S> among, between, to_last;
      for (std::size_t i = 0; i < n; ++i) {
        for (std::size_t j = i + 1; j < n; ++j) among.add(meshes, i, j);
      }
      for (std::size_t i = 0; i < half; ++i) {
        for (std::size_t j = half; j < n; ++j) between.add(meshes, i, j);
        to_last.add(meshes, i, n - 1);
      }
      const auto hit = &fcl::DefaultCollisionFunction<S>;
      const auto near = &fcl::DefaultDistanceFunction<S>;
      checkCollide(scene, among, [&](auto& data) { everything.collide(&data, hit); });
      checkCollide(scene, between, [&](auto& data) { manager.collide(&other, &data, hit); });
      checkCollide(scene, to_last, [&](auto& data) { manager.collide(scene.object(n - 1), &data, hit); });
      checkDistance(scene, among, [&](auto& data) { everything.distance(&data, near); });
      checkDistance(scene, between, [&](auto& data) { manager.distance(&other, &data, near); });
      checkDistance(scene, to_last, [&](auto& data) { manager.distance(scene.object(n - 1), &data, near); });
    }
  }
}

TYPED_TEST(Broadphase, SameAsFclsMeshesWhereObjectsCrowd) {
  using S = typename ScalarOf<TypeParam>::type;
  checkLayout<TypeParam>(layout<S>(16, 3, 1), layout<S>(16, 3, 2));
}

TYPED_TEST(Broadphase, SameAsFclsMeshesWhereObjectsAreScarce) {
  using S = typename ScalarOf<TypeParam>::type;
  checkLayout<TypeParam>(layout<S>(10, 20, 3), layout<S>(10, 25, 7));
}

// FCL has an interface for managers of moving objects, but none; what such a manager would call is its callback.
TEST(BroadphaseCallbacks, DefaultContinuousCallbackReachesModels) {
  const auto model = [](double size) {
    Raw raw = test::torus(10);
    raw.scale(size);
    return std::make_shared<Modeld>(raw.mesh());
  };
  const auto at = [](double x, double angle) {
    return test::pose<double>(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()).toRotationMatrix(), {x, 0, 0});
  };
  const auto moving = [](std::shared_ptr<fcl::CollisionGeometryd> geometry, const fcl::Transform3d& begin,
                         const fcl::Transform3d& end) {
    // FCL 0.7's other constructors leave the reference point or the velocities unset.
    const Eigen::Vector3d origin = Eigen::Vector3d::Zero();
    const auto motion = std::make_shared<fcl::InterpMotion<double>>(begin.linear(), begin.translation(), end.linear(),
                                                                    end.translation(), origin);
    fcl::ContinuousCollisionObjectd object(geometry, motion);
    object.computeAABB();
    return object;
  };
  int hits = 0, misses = 0;
  for (const double reach : {-8.6, -7.9, 5.0}) {
    const auto a = model(1), b = model(0.7);
    auto standing = moving(a, at(0, 0), at(0, 1)), coming = moving(b, at(9, 0), at(9 + reach, 0.5));
    for (const bool swapped : {false, true}) {
      fcl::DefaultContinuousCollisionData<double> data;
      data.request.ccd_motion_type = fcl::CCDM_LINEAR;
      data.request.ccd_solver_type = fcl::CCDC_CONSERVATIVE_ADVANCEMENT;
      auto &first = swapped ? coming : standing, &second = swapped ? standing : coming;
      EXPECT_FALSE(fcl::DefaultContinuousCollisionFunction(&first, &second, &data));
      fcl::ContinuousCollisionResultd expected;
      fcl::continuousCollide(a.get(), at(0, 0), at(0, 1), b.get(), at(9, 0), at(9 + reach, 0.5), data.request,
                             expected);
      EXPECT_EQ(data.result.is_collide, expected.is_collide);
      EXPECT_NEAR(data.result.time_of_contact, expected.time_of_contact, 2 * data.request.toc_err);
      (expected.is_collide ? hits : misses) += 1;
      fcl::DefaultContinuousCollisionData<double> done;
      done.done = true;
      EXPECT_TRUE(fcl::DefaultContinuousCollisionFunction(&first, &second, &done));
      EXPECT_FALSE(done.result.is_collide);
    }
  }
  EXPECT_EQ(hits, 4);
  EXPECT_EQ(misses, 2);
}

TEST(BroadphaseLayouts, HaveHitsAndDistances) {
  // What the tests above rest on: the first layouts touch, the second do not.
  for (const auto& [l, touches] :
       {std::pair(layout<double>(16, 3, 1), true), std::pair(layout<double>(16, 3, 2), true),
        std::pair(layout<double>(10, 20, 3), false), std::pair(layout<double>(10, 25, 7), false)}) {
    const Scene<double> meshes(l, Kind::kMeshes);
    Expected<double> among;
    for (std::size_t i = 0; i < meshes.size(); ++i) {
      for (std::size_t j = i + 1; j < meshes.size(); ++j) among.add(meshes, i, j);
    }
    EXPECT_EQ(!among.hits.empty(), touches);
  }
}

}  // namespace
}  // namespace bocst
