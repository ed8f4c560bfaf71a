// SPDX-License-Identifier: BSD-3-Clause
// What FCL's own tests of octrees and of managers check (test_fcl_octomap_collision, _cost, _distance,
// test_fcl_broadphase and its parts), made anew with models in place of BVHModels.
#include <fcl/broadphase/broadphase_SSaP.h>
#include <fcl/broadphase/broadphase_SaP.h>
#include <fcl/broadphase/broadphase_bruteforce.h>
#include <fcl/broadphase/broadphase_dynamic_AABB_tree.h>
#include <fcl/broadphase/broadphase_dynamic_AABB_tree_array.h>
#include <fcl/broadphase/broadphase_interval_tree.h>
#include <fcl/broadphase/broadphase_spatialhash.h>
#include <fcl/broadphase/default_broadphase_callbacks.h>
#include <fcl/geometry/geometric_shape_to_BVH_model.h>
#include <gtest/gtest.h>

#include <map>
#include <tuple>

#include "conformance/reference.h"
#include "conformance/solids.h"

namespace bocst {
namespace {

using Eigen::Vector3d;
using test::Raw;
using Objects = std::vector<std::unique_ptr<fcl::CollisionObjectd>>;
using Manager = fcl::DynamicAABBTreeCollisionManagerd;

std::vector<fcl::CollisionObjectd*> pointers(const Objects& objects) {
  std::vector<fcl::CollisionObjectd*> all;
  for (const auto& o : objects) all.push_back(o.get());
  return all;
}

fcl::Transform3d anywhere(std::mt19937_64& g, double extent) {
  std::uniform_real_distribution<double> u(-1, 1);
  return test::pose<double>(test::randomRotation(g), extent * Vector3d(u(g), u(g), u(g)));
}

template <typename Shape, typename... Parts>
std::shared_ptr<Modeld> modelOf(const Shape& shape, Parts... parts) {
  fcl::BVHModel<fcl::OBBRSSd> bvh;
  fcl::generateBVHModel(bvh, shape, fcl::Transform3d::Identity(), parts...);
  return std::make_shared<Modeld>(bvh);
}

/// As FCL's environments are: boxes, spheres and cylinders, here as meshes.
Objects meshes(std::size_t count, double extent, unsigned seed) {
  std::mt19937_64 g(seed);
  Objects all;
  for (std::size_t i = 0; i < count; ++i) {
    std::shared_ptr<Modeld> model = i % 3 == 0   ? modelOf(fcl::Boxd(0.5, 1, 2))
                                    : i % 3 == 1 ? modelOf(fcl::Sphered(0.75), 12u, 12u)
                                                 : modelOf(fcl::Cylinderd(0.4, 2), 12u, 4u);
    all.push_back(std::make_unique<fcl::CollisionObjectd>(model, anywhere(g, extent)));
  }
  return all;
}

struct Map {
  std::shared_ptr<octomap::OcTree> map;
  std::shared_ptr<fcl::OcTreed> octree;
};

/// Walls of cells, some of them merged into larger ones, and free space.
Map walls(double resolution) {
  Map m;
  m.map = std::make_shared<octomap::OcTree>(resolution);
  const auto fill = [&](const Vector3d& lo, const Vector3d& hi, bool occupied) {
    for (double x = lo.x() + resolution / 2; x < hi.x(); x += resolution) {
      for (double y = lo.y() + resolution / 2; y < hi.y(); y += resolution) {
        for (double z = lo.z() + resolution / 2; z < hi.z(); z += resolution) {
          m.map->updateNode(octomap::point3d(static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)),
                            occupied);
        }
      }
    }
  };
  fill({-1, -1, -1}, {3, 3, 1}, false);
  fill({-2, -2, -2}, {-1.5, 2, 2}, true);
  fill({0, 0, 0}, {1, 1, 1}, true);
  fill({-1, 1.5, -1}, {2, 2, 0}, true);
  m.map->prune();
  m.octree = std::make_shared<fcl::OcTreed>(m.map);
  return m;
}

/// The occupied cells as boxes of their own.
Objects boxesOf(const fcl::OcTreed& octree, const fcl::Transform3d& W) {
  Objects all;
  for (const auto& b : octree.toBoxes()) {
    auto box = std::make_shared<fcl::Boxd>(b[3], b[3], b[3]);
    box->cost_density = b[4];
    box->threshold_occupied = b[5];
    all.push_back(std::make_unique<fcl::CollisionObjectd>(
        box, W * test::pose<double>(Eigen::Matrix3d::Identity(), {b[0], b[1], b[2]})));
  }
  return all;
}

template <typename Ask>
fcl::CollisionResultd collected(const fcl::CollisionRequestd& request, Ask&& ask) {
  fcl::DefaultCollisionData<double> data;
  data.request = request;
  ask(&data);
  return data.result;
}

/// Three ways to the same: the octree as one geometry, the octree as the manager cuts it up, and boxes for its cells.
struct ThreeWays {
  Manager environment, cells;
  Objects objects, boxes;
  Map map;
  std::unique_ptr<fcl::CollisionObjectd> octree;

  ThreeWays(Objects env, double resolution, const fcl::Transform3d& W)
      : objects(std::move(env)), map(walls(resolution)) {
    boxes = boxesOf(*map.octree, W);
    octree = std::make_unique<fcl::CollisionObjectd>(map.octree, W);
    environment.registerObjects(pointers(objects));
    environment.setup();
    cells.registerObjects(pointers(boxes));
    cells.setup();
  }

  template <typename F>
  void each(F&& f) {
    for (const bool whole : {true, false}) {
      environment.octree_as_geometry_collide = environment.octree_as_geometry_distance = whole;
      f(whole ? "as a geometry" : "cut up by the manager", [&](auto* data, auto callback) {
        if constexpr (std::is_same_v<decltype(data), fcl::DefaultCollisionData<double>*>) {
          environment.collide(octree.get(), data, callback);
        } else {
          environment.distance(octree.get(), data, callback);
        }
      });
    }
    f("as boxes", [&](auto* data, auto callback) {
      if constexpr (std::is_same_v<decltype(data), fcl::DefaultCollisionData<double>*>) {
        environment.collide(&cells, data, callback);
      } else {
        environment.distance(&cells, data, callback);
      }
    });
  }
};

TEST(OctreeAndMeshes, TheSameContactsThreeWays) {
  std::mt19937_64 g(1);
  int contacts = 0, free = 0;
  for (unsigned i = 0; i < 12; ++i) {
    SCOPED_TRACE(i);
    const fcl::Transform3d W = i < 4 ? fcl::Transform3d(fcl::Transform3d::Identity()) : anywhere(g, 1);
    ThreeWays scene(meshes(i % 3 == 2 ? 1 : 20, i % 3 == 2 ? 5 : 4, i), i % 2 ? 0.25 : 0.5, W);
    // All pairs of a cell and a triangle, counted by hand.
    std::size_t expected = 0;
    const test::Solids cells = test::solidsOf(*scene.map.octree, *scene.map.map);
    for (const auto& o : scene.objects) {
      const auto mesh = static_cast<const Modeld&>(*o->collisionGeometry()).mesh();
      test::Solids triangles;
      for (std::size_t t = 0; t < mesh->triangleCount(); ++t) {
        const auto corner = [&](std::size_t k) { return mesh->vertex(mesh->triangle(t)[k]); };
        triangles.push_back(test::sweptHullOf({corner(0), corner(1), corner(2)}));
      }
      const Eigen::Isometry3d X((W.inverse() * o->getTransform()).matrix());
      for (const auto& c : test::couples(triangles, X, cells, 0)) {
        expected += distanceOf(triangles[c.a], X, cells[c.b]).meets();
      }
    }
    scene.each([&](const char* way, auto&& ask) {
      const auto all = collected(fcl::CollisionRequestd(1000000),
                                 [&](auto* data) { ask(data, &fcl::DefaultCollisionFunction<double>); });
      EXPECT_EQ(all.numContacts(), expected) << way;
      const auto one =
          collected(fcl::CollisionRequestd(), [&](auto* data) { ask(data, &fcl::DefaultCollisionFunction<double>); });
      EXPECT_EQ(one.isCollision(), expected > 0) << way;
    });
    contacts += expected > 0;
    free += expected == 0;
  }
  EXPECT_GT(contacts, 6);
  EXPECT_GT(free, 0);
}

TEST(OctreeAndMeshes, ContactsLeadToTheCellAndTheTriangle) {
  const Objects objects = meshes(24, 2.5, 3);
  const Map map = walls(0.25);
  const fcl::CollisionObjectd octree(map.octree);
  std::size_t contacts = 0;
  for (const auto& o : objects) {
    for (const bool octree_first : {true, false}) {
      fcl::CollisionResultd result;
      const fcl::CollisionRequestd request(100000, true);
      octree_first ? fcl::collide(&octree, o.get(), request, result) : fcl::collide(o.get(), &octree, request, result);
      for (std::size_t i = 0; i < result.numContacts(); ++i) {
        const auto& c = result.getContact(i);
        ASSERT_EQ(octree_first ? c.o1 : c.o2, map.octree.get());
        const std::intptr_t cell = octree_first ? c.b1 : c.b2, triangle = octree_first ? c.b2 : c.b1;
        const auto* node = map.map->getRoot() + cell;
        ASSERT_LT(static_cast<std::size_t>(triangle),
                  static_cast<const Modeld&>(*o->collisionGeometry()).mesh()->triangleCount());
        // The node is the one that the map has about the contact, give or take the depth.
        bool is_there = false;
        for (auto leaf = map.map->begin_leafs(); leaf != map.map->end_leafs(); ++leaf) {
          if (&*leaf != node) continue;
          const auto at = leaf.getCoordinate();
          const Vector3d off = (c.pos - Vector3d(at.x(), at.y(), at.z())).cwiseAbs();
          is_there = (off.array() <= leaf.getSize() / 2 + c.penetration_depth + 1e-6).all();
        }
        ASSERT_TRUE(is_there);
        ++contacts;
      }
    }
  }
  EXPECT_GT(contacts, 100u);
}

TEST(OctreeAndMeshes, TheSameCostsThreeWays) {
  std::mt19937_64 g(4);
  for (unsigned i = 0; i < 6; ++i) {
    SCOPED_TRACE(i);
    ThreeWays scene(meshes(14, 2.5, 20 + i), 0.5,
                    i < 2 ? fcl::Transform3d(fcl::Transform3d::Identity()) : anywhere(g, 1));
    // Cells whose state is not known cost as well, where the octree is a geometry; here, all that may be met is known
    // or looked at by its own.
    fcl::CollisionRequestd request(1000000, false, 1000000, true, false);
    std::map<std::string, std::pair<std::size_t, double>> sums;
    scene.each([&](const char* way, auto&& ask) {
      auto result = collected(request, [&](auto* data) { ask(data, &fcl::DefaultCollisionFunction<double>); });
      std::vector<fcl::CostSourced> sources;
      result.getCostSources(sources);
      auto& sum = sums[way];
      for (const auto& s : sources) {
        if (s.cost_density <= 0.5) continue;
        ++sum.first;
        sum.second += s.total_cost;
      }
      EXPECT_GT(sum.first, 10u) << way;
    });
    EXPECT_NEAR(sums["as a geometry"].second, sums["as boxes"].second, 1e-3 * sums["as boxes"].second);
    EXPECT_NEAR(sums["cut up by the manager"].second, sums["as boxes"].second, 1e-3 * sums["as boxes"].second);
  }
}

TEST(OctreeAndMeshes, TheSameDistancesThreeWays) {
  std::mt19937_64 g(5);
  int apart = 0;
  for (unsigned i = 0; i < 16; ++i) {
    SCOPED_TRACE(i);
    const double extent = i % 2 ? 8 : 5;
    ThreeWays scene(meshes(4, extent, 40 + i), 0.5, anywhere(g, 1));
    std::vector<double> distances;
    scene.each([&](const char*, auto&& ask) {
      fcl::DefaultDistanceData<double> data;
      data.request.enable_nearest_points = true;
      ask(&data, &fcl::DefaultDistanceFunction<double>);
      distances.push_back(data.result.min_distance);
    });
    EXPECT_NEAR(distances[0], distances[2], 1e-6);
    EXPECT_NEAR(distances[1], distances[2], 1e-6);
    apart += distances[2] > 0;
  }
  EXPECT_GT(apart, 3);
  EXPECT_LT(apart, 16);
}

// Shapes, meshes and an octree in one environment, asked by models: whatever the manager, as one by one.
template <typename M>
struct Make {
  M operator()() const { return M(); }
};
template <>
struct Make<fcl::SpatialHashingCollisionManager<double>> {
  fcl::SpatialHashingCollisionManager<double> operator()() const {
    return {2, fcl::Vector3d::Constant(-30), fcl::Vector3d::Constant(30)};
  }
};

/// Contacts of models with others, each once: some managers call back twice for a pair.
using Touching = std::set<std::tuple<const void*, const void*, std::intptr_t, std::intptr_t>>;
void add(const fcl::CollisionResultd& result, Touching& all) {
  for (std::size_t i = 0; i < result.numContacts(); ++i) {
    const auto& c = result.getContact(i);
    const bool model_first = isModel<double>(c.o1);
    ASSERT_NE(model_first, isModel<double>(c.o2));
    model_first ? all.emplace(c.o1, c.o2, c.b1, c.b2) : all.emplace(c.o2, c.o1, c.b2, c.b1);
  }
}

template <typename M>
class ManagersOfAll : public testing::Test {};
using All = testing::Types<fcl::DynamicAABBTreeCollisionManagerd, fcl::DynamicAABBTreeCollisionManager_Array<double>,
                           fcl::NaiveCollisionManagerd, fcl::SaPCollisionManagerd, fcl::SSaPCollisionManagerd,
                           fcl::IntervalTreeCollisionManagerd, fcl::SpatialHashingCollisionManager<double>>;
TYPED_TEST_SUITE(ManagersOfAll, All);

TYPED_TEST(ManagersOfAll, AsOneByOne) {
  std::mt19937_64 g(6);
  Objects environment;
  int n = 0;
  for (int round = 0; round < 3; ++round) {
    for (const auto& [name, shape] : test::shapes<double>()) {
      if (name == "plane" || name == "half-space") continue;  // they would meet all
      environment.push_back(std::make_unique<fcl::CollisionObjectd>(shape, anywhere(g, 5)));
      environment.push_back(
          std::make_unique<fcl::CollisionObjectd>(test::bvh<fcl::OBBRSSd>(test::torus(6)), anywhere(g, 5)));
      ++n;
    }
  }
  environment.push_back(std::make_unique<fcl::CollisionObjectd>(walls(0.5).octree, anywhere(g, 5)));
  const auto asked = meshes(8, 4, 7);
  auto manager = Make<TypeParam>()(), askers = Make<TypeParam>()();
  manager.registerObjects(pointers(environment));
  askers.registerObjects(pointers(asked));
  manager.setup();
  askers.setup();
  int hits = 0, free = 0;
  for (int step = 0; step < 4; ++step) {
    if (step > 0) {
      for (const Objects* objects : {static_cast<const Objects*>(&environment), &asked}) {
        for (const auto& o : *objects) {
          o->setTransform(anywhere(g, 2 + 2 * step));
          o->computeAABB();
        }
      }
      manager.update();
      askers.update();
    }
    Touching total;
    double least = std::numeric_limits<double>::max();
    for (const auto& a : asked) {
      Touching expected, found;
      double nearest = std::numeric_limits<double>::max();
      for (const auto& e : environment) {
        fcl::CollisionResultd result;
        fcl::collide(a.get(), e.get(), fcl::CollisionRequestd(1000000), result);
        add(result, expected);
        fcl::DistanceResultd distance;
        nearest = std::min(nearest, fcl::distance(e.get(), a.get(), fcl::DistanceRequestd(), distance));
      }
      total.insert(expected.begin(), expected.end());
      least = std::min(least, nearest);
      const auto result = collected(fcl::CollisionRequestd(1000000), [&](auto* data) {
        manager.collide(a.get(), data, &fcl::DefaultCollisionFunction<double>);
      });
      add(result, found);
      ASSERT_EQ(found, expected);
      fcl::DefaultDistanceData<double> data;
      manager.distance(a.get(), &data, &fcl::DefaultDistanceFunction<double>);
      ASSERT_NEAR(data.result.min_distance, nearest, 1e-9);
      (expected.empty() ? free : hits)++;
    }
    const auto result = collected(fcl::CollisionRequestd(1000000), [&](auto* data) {
      manager.collide(&askers, data, &fcl::DefaultCollisionFunction<double>);
    });
    Touching found;
    add(result, found);
    ASSERT_EQ(found, total);
    fcl::DefaultDistanceData<double> data;
    manager.distance(&askers, &data, &fcl::DefaultDistanceFunction<double>);
    ASSERT_NEAR(data.result.min_distance, least, 1e-9);
  }
  EXPECT_GT(hits, 5);
  EXPECT_GT(free, 5);
}

}  // namespace
}  // namespace bocst
