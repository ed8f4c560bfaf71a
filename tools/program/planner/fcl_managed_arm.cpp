// SPDX-License-Identifier: BSD-3-Clause
// No bocst overload is in sight here, see pairs/fcl_pair.cpp.
#include <bocst/fcl_templates.h>
#include <fcl/narrowphase/collision.h>
#include <fcl/narrowphase/distance.h>

#include "pairs/fcl_calls.h"
#include "pairs/fcl_tree.h"
#include "planner/managed_arm_of.h"

namespace bocst::program {
namespace {

std::shared_ptr<fcl::CollisionGeometryd> build(const std::shared_ptr<const Mesh>& mesh) {
  std::shared_ptr<fcl::CollisionGeometryd> model = buildFclTree<fcl::OBBRSSd>(MeshArrays(*mesh, Scalar::kDouble));
  model->computeLocalAABB();
  return model;
}

}  // namespace

std::unique_ptr<ManagedArm> manageFclArm(const ArmWorld& world) {
  std::vector<std::shared_ptr<fcl::CollisionGeometryd>> geometries;
  for (const ArmWorld::Thing& link : world.links()) geometries.push_back(build(link.mesh));
  for (const ArmWorld::Thing& thing : world.things()) geometries.push_back(build(thing.mesh));
  return std::make_unique<ManagedArmOf<ManagedArm, FclCalls>>(world, std::move(geometries));
}

}  // namespace bocst::program
