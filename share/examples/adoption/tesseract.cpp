// SPDX-License-Identifier: BSD-3-Clause
// How Tesseract asks FCL (tesseract_collision_fcl), in small: an object is a type of its own, whose box is grown by the
// contact distance; links that move and links that stand have a manager each; a contact test collects all contacts, or
// the nearest points of what is closer than the contact distance. share/doc/planners.md has the change to bocst; both
// programs must print the same.
#include <fcl/broadphase/broadphase_dynamic_AABB_tree.h>
#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/narrowphase/collision.h>
#include <fcl/narrowphase/distance.h>

#include <cstdio>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "wavy_ball.h"

namespace {

using Transform = Eigen::Isometry3d;

// fcl_utils: createShapePrimitive() of a mesh, whose faces are rows of 3, a, b, c.
std::shared_ptr<fcl::CollisionGeometryd> createShapePrimitive(const std::vector<Eigen::Vector3d>& vertices,
                                                              const Eigen::VectorXi& faces) {
  auto geometry = std::make_shared<fcl::BVHModel<fcl::OBBRSSd>>();
  std::vector<fcl::Triangle> triangles;
  for (Eigen::Index i = 0; i < faces.size(); i += 4) triangles.emplace_back(faces[i + 1], faces[i + 2], faces[i + 3]);
  geometry->beginModel();
  geometry->addSubModel(vertices, triangles);
  geometry->endModel();
  return geometry;
}

// fcl_collision_object_wrapper: its box is that of the geometry, grown by the contact distance.
class Object : public fcl::CollisionObjectd {
 public:
  Object(std::string link, const std::shared_ptr<fcl::CollisionGeometryd>& geometry, double contact_distance)
      : CollisionObject(geometry), link_(std::move(link)), contact_distance_(contact_distance) {
    setUserData(this);
  }
  const std::string& link() const { return link_; }
  void moveTo(const Transform& pose) {
    setTransform(pose);
    const fcl::Vector3d center = pose * cgeom->aabb_center,
                        reach = fcl::Vector3d::Constant(cgeom->aabb_radius + contact_distance_);
    aabb.min_ = center - reach;
    aabb.max_ = center + reach;
  }

 private:
  std::string link_;
  double contact_distance_;
};

// fcl_utils: the results of a contact test and its two callbacks.
struct Contact {
  double distance;
  fcl::Vector3d nearest[2];
};
struct ContactTest {
  double contact_distance;
  std::size_t limit;
  std::map<std::pair<std::string, std::string>, std::vector<Contact>> results;

  std::vector<Contact>& of(fcl::CollisionObjectd* o1, fcl::CollisionObjectd* o2) {
    const auto link = [](fcl::CollisionObjectd* o) { return static_cast<Object*>(o->getUserData())->link(); };
    return results[std::minmax(link(o1), link(o2))];
  }
};

bool collisionCallback(fcl::CollisionObjectd* o1, fcl::CollisionObjectd* o2, void* user) {
  auto& test = *static_cast<ContactTest*>(user);
  fcl::CollisionResultd result;
  fcl::collide(o1, o2, fcl::CollisionRequestd(test.limit, true), result);
  for (std::size_t i = 0; i < result.numContacts(); ++i) {
    const fcl::Contactd& contact = result.getContact(i);
    test.of(o1, o2).push_back({-contact.penetration_depth, {contact.pos, contact.pos}});
  }
  return false;
}

bool distanceCallback(fcl::CollisionObjectd* o1, fcl::CollisionObjectd* o2, void* user, double&) {
  auto& test = *static_cast<ContactTest*>(user);
  fcl::DistanceResultd result;
  const double distance = fcl::distance(o1, o2, fcl::DistanceRequestd(true), result);
  if (distance < test.contact_distance)
    test.of(o1, o2).push_back({distance, {result.nearest_points[0], result.nearest_points[1]}});
  return false;
}

}  // namespace

int main() {
  std::mt19937 random(11);
  const auto uniform = [&](double size) { return std::uniform_real_distribution<double>(-size, size)(random); };
  const auto pose = [&] {
    const Eigen::Quaterniond q(uniform(1), uniform(1), uniform(1), uniform(1));
    return Transform(Eigen::Translation3d(uniform(0.6), uniform(0.6), uniform(0.6)) * q.normalized());
  };
  const double contact_distance = 0.05;
  fcl::DynamicAABBTreeCollisionManagerd moving, standing;
  std::vector<std::unique_ptr<Object>> objects;
  const auto add = [&](const std::string& link, int rings, fcl::DynamicAABBTreeCollisionManagerd& manager) {
    const WavyBall ball(0.2, rings);
    Eigen::VectorXi faces(4 * ball.triangles.size());
    for (std::size_t t = 0; t < ball.triangles.size(); ++t) faces.segment<4>(4 * t) << 3, ball.triangles[t];
    objects.push_back(std::make_unique<Object>(link, createShapePrimitive(ball.vertices, faces), contact_distance));
    objects.back()->moveTo(pose());
    manager.registerObject(objects.back().get());
  };
  for (int i = 0; i < 3; ++i) add("link_" + std::to_string(i), 20 + 10 * i, moving);
  for (int i = 0; i < 4; ++i) add("wall_" + std::to_string(i), 30, standing);
  standing.setup();
  moving.setup();

  for (int state = 0; state < 200; ++state) {
    for (int i = 0; i < 3; ++i) objects[i]->moveTo(pose());
    moving.update();
    ContactTest touching{0, 1000000, {}}, near{contact_distance, 0, {}};
    moving.collide(&standing, &touching, &collisionCallback);
    moving.collide(&touching, &collisionCallback);
    moving.distance(&standing, &near, &distanceCallback);
    moving.distance(&near, &distanceCallback);
    std::printf("state %d:", state);
    for (const auto& [links, contacts] : touching.results)
      std::printf(" %s-%s touch", links.first.c_str(), links.second.c_str());
    for (const auto& [links, contacts] : near.results) {
      if (touching.results.count(links) != 0) continue;
      std::printf(" %s-%s %.6f", links.first.c_str(), links.second.c_str(), contacts.front().distance);
      if ((contacts.front().nearest[0] - contacts.front().nearest[1]).norm() - contacts.front().distance > 1e-9)
        std::printf(" WRONG");
    }
    std::printf("\n");
  }
}
