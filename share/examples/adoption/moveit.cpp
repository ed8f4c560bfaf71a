// SPDX-License-Identifier: BSD-3-Clause
// How MoveIt 2 asks FCL (moveit_core/collision_detection_fcl), in small: geometries are made once for each shape and
// cached, objects are made anew for each state, a manager holds the world, links that may touch are left out, contacts
// are counted for each pair of bodies. share/doc/planners.md has the change to bocst; both programs must print the
// same.
#include <fcl/broadphase/broadphase_dynamic_AABB_tree.h>
#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/geometry/shape/box.h>
#include <fcl/narrowphase/collision.h>
#include <fcl/narrowphase/distance.h>

#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "wavy_ball.h"

namespace {

using Transform = Eigen::Isometry3d;

// geometric_shapes: shapes::Mesh and shapes::Box.
struct Shape {
  enum class Type { kBox, kMesh } type;
  Eigen::Vector3d size = {0, 0, 0};
  std::vector<double> vertices;     // x, y, z of each
  std::vector<unsigned> triangles;  // three vertices of each
};

Shape meshOf(const WavyBall& ball) {
  Shape shape{Shape::Type::kMesh, {}, {}, {}};
  for (const Eigen::Vector3d& v : ball.vertices) shape.vertices.insert(shape.vertices.end(), v.data(), v.data() + 3);
  for (const Eigen::Vector3i& t : ball.triangles) shape.triangles.insert(shape.triangles.end(), t.data(), t.data() + 3);
  return shape;
}

// collision_common: CollisionGeometryData and FCLGeometry.
struct Body {
  std::string name;
};
struct Geometry {
  std::shared_ptr<fcl::CollisionGeometryd> collision_geometry;
  Body body;
};

// collision_common: createCollisionGeometry(), with its cache.
template <typename BV>
std::shared_ptr<const Geometry> createCollisionGeometry(const std::shared_ptr<const Shape>& shape,
                                                        const std::string& name) {
  static std::map<std::weak_ptr<const Shape>, std::shared_ptr<const Geometry>, std::owner_less<>> cache;
  if (const auto found = cache.find(shape); found != cache.end()) return found->second;
  auto geometry = std::make_shared<Geometry>();
  geometry->body.name = name;
  switch (shape->type) {
    case Shape::Type::kBox:
      geometry->collision_geometry = std::make_shared<fcl::Boxd>(shape->size);
      break;
    case Shape::Type::kMesh: {
      auto mesh = std::make_shared<fcl::BVHModel<BV>>();
      if (!shape->vertices.empty() && !shape->triangles.empty()) {
        std::vector<fcl::Triangle> triangles(shape->triangles.size() / 3);
        for (std::size_t t = 0; t < triangles.size(); ++t) {
          triangles[t] =
              fcl::Triangle(shape->triangles[3 * t], shape->triangles[3 * t + 1], shape->triangles[3 * t + 2]);
        }
        std::vector<fcl::Vector3d> points(shape->vertices.size() / 3);
        for (std::size_t v = 0; v < points.size(); ++v) points[v] = fcl::Vector3d(shape->vertices.data() + 3 * v);
        mesh->beginModel();
        mesh->addSubModel(points, triangles);
        mesh->endModel();
      }
      geometry->collision_geometry = mesh;
      break;
    }
  }
  geometry->collision_geometry->computeLocalAABB();
  geometry->collision_geometry->setUserData(&geometry->body);
  cache[shape] = geometry;
  return geometry;
}

// collision_common: CollisionData and collisionCallback(), for contacts.
struct CollisionData {
  std::set<std::pair<std::string, std::string>> allowed;
  std::size_t max_contacts_per_pair = 1;
  std::map<std::pair<std::string, std::string>, std::size_t> contacts;
};

std::pair<std::string, std::string> namesOf(fcl::CollisionObjectd* o1, fcl::CollisionObjectd* o2) {
  const auto name = [](fcl::CollisionObjectd* o) {
    return static_cast<Body*>(o->collisionGeometry()->getUserData())->name;
  };
  return std::minmax(name(o1), name(o2));
}

bool collisionCallback(fcl::CollisionObjectd* o1, fcl::CollisionObjectd* o2, void* user) {
  auto& data = *static_cast<CollisionData*>(user);
  const auto names = namesOf(o1, o2);
  if (names.first == names.second || data.allowed.count(names) != 0) return false;
  const fcl::CollisionRequestd request(data.max_contacts_per_pair, true);
  fcl::CollisionResultd result;
  if (const std::size_t found = fcl::collide(o1, o2, request, result); found != 0) data.contacts[names] += found;
  return false;
}

// collision_common: distanceCallback(), for the nearest pair.
struct DistanceData {
  const CollisionData* rules;
  fcl::DistanceResultd nearest;
  std::pair<std::string, std::string> names;
};

bool distanceCallback(fcl::CollisionObjectd* o1, fcl::CollisionObjectd* o2, void* user, double& distance) {
  auto& data = *static_cast<DistanceData*>(user);
  const auto names = namesOf(o1, o2);
  if (names.first == names.second || data.rules->allowed.count(names) != 0) return false;
  fcl::DistanceResultd result;
  if (fcl::distance(o1, o2, fcl::DistanceRequestd(true), result) < data.nearest.min_distance) {
    data.nearest = result;
    data.names = names;
  }
  distance = data.nearest.min_distance;
  return false;
}

// collision_env_fcl: a manager of the world, and objects of the robot that are made anew for each state.
struct Manager {
  fcl::DynamicAABBTreeCollisionManagerd tree;
  std::vector<std::unique_ptr<fcl::CollisionObjectd>> objects;
  void add(const Geometry& geometry, const Transform& pose) {
    objects.push_back(std::make_unique<fcl::CollisionObjectd>(geometry.collision_geometry, pose));
    tree.registerObject(objects.back().get());
  }
};

}  // namespace

int main() {
  std::mt19937 random(7);
  const auto uniform = [&](double size) { return std::uniform_real_distribution<double>(-size, size)(random); };
  const auto pose = [&](double size) {
    const Eigen::Quaterniond q(uniform(1), uniform(1), uniform(1), uniform(1));
    return Transform(Eigen::Translation3d(uniform(size), uniform(size), uniform(size)) * q.normalized());
  };

  std::vector<std::shared_ptr<const Geometry>> links, things;
  std::vector<std::shared_ptr<const Shape>> shapes;
  const auto make = [&](const Shape& shape, const std::string& name) {
    shapes.push_back(std::make_shared<const Shape>(shape));
    return createCollisionGeometry<fcl::OBBRSSd>(shapes.back(), name);
  };
  for (int i = 0; i < 4; ++i) links.push_back(make(meshOf(WavyBall(0.15, 20 + 10 * i)), "link" + std::to_string(i)));
  for (int i = 0; i < 5; ++i) things.push_back(make(meshOf(WavyBall(0.2, 30)), "thing" + std::to_string(i)));
  things.push_back(make({Shape::Type::kBox, {1, 1, 0.1}, {}, {}}, "table"));

  Manager world;
  for (const auto& thing : things) world.add(*thing, pose(1));
  world.tree.setup();
  CollisionData data;
  data.allowed = {{"link0", "link1"}, {"link1", "link2"}};

  for (int state = 0; state < 300; ++state) {
    Manager robot;
    for (const auto& link : links) robot.add(*link, pose(1));
    robot.tree.setup();
    data.contacts.clear();
    for (const auto& object : robot.objects) world.tree.collide(object.get(), &data, &collisionCallback);
    robot.tree.collide(&data, &collisionCallback);
    std::printf("state %d:", state);
    for (const auto& [names, count] : data.contacts)
      std::printf(" %s-%s(%zu)", names.first.c_str(), names.second.c_str(), count);
    if (data.contacts.empty()) {
      DistanceData nearest{&data, {}, {}};
      for (const auto& object : robot.objects) world.tree.distance(object.get(), &nearest, &distanceCallback);
      std::printf(" free by %.6f, %s-%s", nearest.nearest.min_distance, nearest.names.first.c_str(),
                  nearest.names.second.c_str());
    }
    std::printf("\n");
  }
}
