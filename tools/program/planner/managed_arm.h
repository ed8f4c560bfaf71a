// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/options.h>

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "planner/arm_world.h"

namespace bocst::program {

/// A pair that FCL's broad phase lets through, at the poses of one state. Links come first in the numbers of bodies,
/// then things.
struct AskedPair {
  std::size_t a, b;
  Eigen::Isometry3d X_WA, X_WB;
};

/// The arm and its world as one library's geometries in FCL's DynamicAABBTreeCollisionManager, one of links and one of
/// things, as a planner has them. Not for several threads at once.
class ManagedArm {
 public:
  ManagedArm() = default;
  virtual ~ManagedArm() = default;
  ManagedArm(const ManagedArm&) = delete;
  ManagedArm& operator=(const ManagedArm&) = delete;

  /// True if the state collides. Ends at the first pair that does. `pairs`, if not null, gets the pairs asked about;
  /// `narrow`, if not null, the microseconds spent on them.
  virtual bool collides(const ArmWorld::Poses& X_WL, std::vector<AskedPair>* pairs = nullptr,
                        double* narrow = nullptr) = 0;

  /// The same with new collision objects for the links, as MoveIt makes them of attached bodies for each check.
  virtual bool collidesWithNewObjects(const ArmWorld::Poses& X_WL) = 0;

  /// fcl::collide in its default form, and fcl::distance.
  virtual bool touch(const AskedPair& pair) const = 0;
  virtual double distance(const AskedPair& pair) const = 0;
};

/// With BVHModel<OBBRSS>.
std::unique_ptr<ManagedArm> manageFclArm(const ArmWorld& world);

/// With bocst's models.
class BocstManagedArm : public ManagedArm {
 public:
  /// Model::buildTree() of all.
  virtual void buildTrees() = 0;

  /// As after `seconds` without a query.
  virtual void rest(double seconds) = 0;

  /// Changes whenever a tree grows: what each has built so far, and its size.
  virtual std::vector<std::uint64_t> growth() const = 0;
};
std::unique_ptr<BocstManagedArm> manageBocstArm(const ArmWorld& world, const Options& options = {});

}  // namespace bocst::program
