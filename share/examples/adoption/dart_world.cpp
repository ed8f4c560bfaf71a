// SPDX-License-Identifier: BSD-3-Clause
// Meshes in DART: which bodies touch in random poses and how far apart they are, and a link that falls on a table and
// comes to rest. share/doc/planners.md has the change to bocst; both programs must print the same.
//
// Usage: dart_world FOLDER
// FOLDER has link.obj and gripper.obj: share/models.
#include <cmath>
#include <cstdio>
#include <dart/collision/fcl/FCLCollisionDetector.hpp>
#include <dart/constraint/ConstraintSolver.hpp>
#include <dart/dynamics/BodyNode.hpp>
#include <dart/dynamics/BoxShape.hpp>
#include <dart/dynamics/FreeJoint.hpp>
#include <dart/dynamics/MeshShape.hpp>
#include <dart/dynamics/Skeleton.hpp>
#include <dart/simulation/World.hpp>
#include <filesystem>
#include <memory>
#include <random>
#include <string>

namespace {

std::shared_ptr<dart::collision::CollisionDetector> makeDetector() {
  auto detector = dart::collision::FCLCollisionDetector::create();
  detector->setContactPointComputationMethod(dart::collision::FCLCollisionDetector::FCL);
  return detector;
}

dart::dynamics::SkeletonPtr bodyOf(const std::string& name, const dart::dynamics::ShapePtr& shape) {
  auto skeleton = dart::dynamics::Skeleton::create(name);
  auto* body = skeleton->createJointAndBodyNodePair<dart::dynamics::FreeJoint>().second;
  body->createShapeNodeWith<dart::dynamics::CollisionAspect, dart::dynamics::DynamicsAspect>(shape);
  body->setInertia(dart::dynamics::Inertia(1, Eigen::Vector3d::Zero(), 0.01 * Eigen::Matrix3d::Identity()));
  return skeleton;
}

dart::dynamics::ShapePtr meshOf(const std::string& file) {
  return std::make_shared<dart::dynamics::MeshShape>(Eigen::Vector3d::Ones(),
                                                     dart::dynamics::MeshShape::loadMesh(file));
}

void moveTo(const dart::dynamics::SkeletonPtr& skeleton, const Eigen::Isometry3d& pose) {
  static_cast<dart::dynamics::FreeJoint*>(skeleton->getJoint(0))->setTransform(pose);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: %s FOLDER\n", argv[0]);
    return 2;
  }
  const std::string folder = std::filesystem::absolute(argv[1]);  // DART takes URIs
  const auto link_shape = meshOf(folder + "/link.obj"), gripper_shape = meshOf(folder + "/gripper.obj");
  const auto detector = makeDetector();

  std::mt19937 random(5);
  const auto uniform = [&](double size) { return std::uniform_real_distribution<double>(-size, size)(random); };
  const auto pose = [&](double size) {
    const Eigen::Quaterniond q(uniform(1), uniform(1), uniform(1), uniform(1));
    return Eigen::Isometry3d(Eigen::Translation3d(uniform(size), uniform(size), uniform(size)) * q.normalized());
  };
  const dart::dynamics::SkeletonPtr bodies[] = {bodyOf("link", link_shape), bodyOf("gripper", gripper_shape),
                                                bodyOf("other_link", link_shape)};
  std::unique_ptr<dart::collision::CollisionGroup> groups[3];
  for (int i = 0; i < 3; ++i) {
    groups[i] = detector->createCollisionGroup();
    groups[i]->addShapeFramesOf(bodies[i].get());
  }
  for (int state = 0; state < 200; ++state) {
    for (const auto& body : bodies) moveTo(body, pose(0.2));
    std::printf("state %d:", state);
    for (int i = 0; i < 3; ++i) {
      const int k = (i + 1) % 3;
      if (groups[i]->collide(groups[k].get())) {
        std::printf(" %d-%d touch", i, k);
      } else {
        std::printf(" %d-%d %.6f", i, k, groups[i]->distance(groups[k].get()));
      }
    }
    std::printf("\n");
  }

  const auto world = dart::simulation::World::create();
  world->getConstraintSolver()->setCollisionDetector(detector);
  // DART compares the contacts of a pair in threes.
  world->getConstraintSolver()->getCollisionOption().maxNumContacts = 50;
  const auto table = bodyOf("table", std::make_shared<dart::dynamics::BoxShape>(Eigen::Vector3d(2, 2, 0.1)));
  table->setMobile(false);
  world->addSkeleton(table);
  world->addSkeleton(bodies[0]);
  moveTo(table, Eigen::Isometry3d::Identity());
  moveTo(bodies[0], Eigen::Isometry3d(Eigen::Translation3d(0, 0, 0.2)));
  for (int step = 0; step < 500; ++step) world->step();
  const dart::dynamics::BodyNode& fallen = *bodies[0]->getBodyNode(0);
  const double height = fallen.getWorldTransform().translation().z(), speed = fallen.getLinearVelocity().norm();
  std::printf("the link %s the table and %s\n", height > 0 && height < 0.2 ? "lies on" : "fell through",
              speed < 0.05 ? "rests" : "moves");
  std::fprintf(stderr, "height %g, speed %g\n", height, speed);
}
