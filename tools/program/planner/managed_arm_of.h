// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/broadphase/broadphase_dynamic_AABB_tree.h>
#include <fcl/narrowphase/collision_object.h>
#include <fcl/narrowphase/collision_request.h>
#include <fcl/narrowphase/collision_result.h>
#include <fcl/narrowphase/distance_request.h>
#include <fcl/narrowphase/distance_result.h>

#include <cstdint>

#include "cli/report.h"
#include "planner/managed_arm.h"

namespace bocst::program {

/// A ManagedArm over FCL geometries. Queries is FclCalls, as for PairOf.
template <typename Base, typename Queries>
class ManagedArmOf : public Base {
 public:
  using Geometries = std::vector<std::shared_ptr<fcl::CollisionGeometryd>>;

  ManagedArmOf(const ArmWorld& world, Geometries geometries) : world_(world), geometries_(std::move(geometries)) {
    const std::size_t links = world.links().size();
    for (std::size_t i = 0; i < geometries_.size(); ++i) {
      auto object = makeObject(i);
      if (i >= links) {
        object->setTransform(world.things()[i - links].X_WT);
        object->computeAABB();
      }
      (i < links ? robot_ : things_).registerObject(object.get());
      objects_.push_back(std::move(object));
    }
    robot_.setup();
    things_.setup();
  }

  bool collides(const ArmWorld::Poses& X_WL, std::vector<AskedPair>* pairs, double* narrow) override {
    for (std::size_t i = 0; i < X_WL.size(); ++i) {
      objects_[i]->setTransform(X_WL[i]);
      objects_[i]->computeAABB();
    }
    robot_.update();
    Check check{this, pairs, narrow, false};
    robot_.collide(&things_, &check, &ask);
    if (!check.hit) robot_.collide(&check, &ask);
    return check.hit;
  }

  bool collidesWithNewObjects(const ArmWorld::Poses& X_WL) override {
    std::vector<std::unique_ptr<fcl::CollisionObjectd>> links;
    fcl::DynamicAABBTreeCollisionManagerd robot;
    Check check{this, nullptr, nullptr, false};
    for (std::size_t i = 0; i < X_WL.size(); ++i) {
      links.push_back(makeObject(i));
      links.back()->setTransform(X_WL[i]);
      links.back()->computeAABB();
      if (!check.hit) things_.collide(links.back().get(), &check, &ask);
      robot.registerObject(links.back().get());
    }
    robot.setup();
    if (!check.hit) robot.collide(&check, &ask);
    return check.hit;
  }

  bool touch(const AskedPair& pair) const override {
    const fcl::CollisionRequestd request;
    fcl::CollisionResultd result;
    Queries::collide(geometries_[pair.a].get(), pair.X_WA, geometries_[pair.b].get(), pair.X_WB, request, result);
    return result.isCollision();
  }

  double distance(const AskedPair& pair) const override {
    const fcl::DistanceRequestd request;
    fcl::DistanceResultd result;
    Queries::distance(geometries_[pair.a].get(), pair.X_WA, geometries_[pair.b].get(), pair.X_WB, request, result);
    return result.min_distance;
  }

 protected:
  const Geometries& geometries() const { return geometries_; }

 private:
  struct Check {
    const ManagedArmOf* arm;
    std::vector<AskedPair>* pairs;
    double* narrow;
    bool hit;
  };

  std::unique_ptr<fcl::CollisionObjectd> makeObject(std::size_t body) const {
    auto object = std::make_unique<fcl::CollisionObjectd>(geometries_[body]);
    object->setUserData(reinterpret_cast<void*>(std::uintptr_t{body}));
    object->computeAABB();
    return object;
  }

  static std::size_t bodyOf(const fcl::CollisionObjectd* object) {
    return static_cast<std::size_t>(reinterpret_cast<std::uintptr_t>(object->getUserData()));
  }

  static bool ask(fcl::CollisionObjectd* o1, fcl::CollisionObjectd* o2, void* data) {
    auto& check = *static_cast<Check*>(data);
    if (check.hit) return true;
    const std::size_t a = bodyOf(o1), b = bodyOf(o2), links = check.arm->world_.links().size();
    if (a < links && b < links && check.arm->world_.mayTouch(a, b)) return false;
    const AskedPair pair{a, b, o1->getTransform(), o2->getTransform()};
    if (check.pairs != nullptr) check.pairs->push_back(pair);
    if (check.narrow == nullptr) {
      check.hit = check.arm->touch(pair);
    } else {
      const Stopwatch watch;
      check.hit = check.arm->touch(pair);
      *check.narrow += watch.microseconds();
    }
    return check.hit;
  }

  const ArmWorld& world_;
  const Geometries geometries_;
  std::vector<std::unique_ptr<fcl::CollisionObjectd>> objects_;
  fcl::DynamicAABBTreeCollisionManagerd robot_, things_;
};

}  // namespace bocst::program
