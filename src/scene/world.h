// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/model.h>
#include <bocst/scene.h>

#include <cstdint>
#include <memory>
#include <unordered_map>
#include <utility>
#include <vector>

#include "scene/bounds.h"
#include "scene/ignored_pairs.h"
#include "scene/pose_rows.h"

namespace bocst::scene {

/// An object of a scene: a geometry, its bounds, and its pose if it is fixed.
template <typename S>
struct Object {
  std::shared_ptr<fcl::CollisionGeometry<S>>
      geometry;                     ///< For a BVHModel, the Model made from it; null: an empty lane.
  const Model<S>* model = nullptr;  ///< `geometry` as a Model, or null.
  bool exact = false;               ///< A model with exact answers.
  bool grows_together = false;      ///< A model that is worth fcl_adapter::growTogether().
  Bounds bounds;
  Id id;
  fcl::Transform3<S> X_WG = fcl::Transform3<S>::Identity();  ///< Of a fixed object, in the world.
};

/// Writes at least the largest orthogonality error of the poses of each moving object to `orthogonality_errors`.
/// @throws std::invalid_argument that names the first pose that is not rigid. `state`: the name of the only one, or
/// null: they have numbers, from `first` on.
template <typename S>
void checkPoses(const char* query, const fcl::Transform3<S>* X_WM, std::size_t states, std::size_t moving,
                std::vector<double>& orthogonality_errors, const char* state = nullptr, std::size_t first = 0);

/// A scene as a query sees it. A change takes the time of the moving objects and of a path in the hierarchy of fixed
/// ones, but leaves the hierarchy less balanced: a new world is to be made once needsRebuild().
///
/// Threads: any number of queries, or one change alone.
template <typename S>
class World {
 public:
  World(std::vector<Object<S>> moving_objects, const std::vector<Object<S>>& fixed_objects,
        const IgnoredPairs& ignored);

  // Changes. They return false, and leave what no query may see, where a new world is to be made instead.

  /// Adds a fixed object, or replaces the one of this Id.
  bool putFixed(const Object<S>& object, const IgnoredPairs& ignored);
  void removeFixed(Id object);
  /// Lets go of the geometry of a removed object; no query before setMoving().
  void releaseMoving(Id object);
  bool setMoving(std::vector<Object<S>> objects, const IgnoredPairs& ignored);
  void setIgnored(Id a, Id b, bool ignored);
  bool needsRebuild() const { return changes_ > fixed.size() / 4 + 16; }

  std::size_t fixedGroups() const { return groups.size(); }
  std::size_t movingGroups() const { return (moving.size() + 7) / 8; }
  std::size_t allGroups() const { return fixedGroups() + movingGroups(); }

  /// Of a lane of a group: fixed groups are first.
  const Object<S>& object(std::size_t group, std::size_t lane) const {
    return group < fixedGroups() ? fixed[8 * group + lane] : moving[8 * (group - fixedGroups()) + lane];
  }
  bool isFixed(std::size_t group) const { return group < fixedGroups(); }
  std::size_t movingIndex(std::size_t group, std::size_t lane) const { return 8 * (group - fixedGroups()) + lane; }

  /// Places the boxes of all moving objects. `orthogonality_errors`, `reach`: see Placing. `others` has room for all.
  void place(const fcl::Transform3<S>* X_WM, const double* orthogonality_errors, const double* reach, BoxGroup* boxes,
             std::uint32_t* others) const;

  /// At least the reach of that box, while no coordinates of the pose's translation add up to more than `place`, and
  /// its orthogonality error is not larger.
  double reachWithin(const Object<S>& object, double place, double orthogonality_error) const;

  std::vector<Object<S>> moving;
  BoundsRows rows;               ///< Of the moving objects.
  std::vector<Object<S>> fixed;  ///< Eight a group.
  std::vector<BoxNode> nodes;    ///< Over the groups; none without a fixed object that is somewhere.
  std::vector<BoxGroup> groups;
  /// [i * allGroups() + group]: lanes that make a pair with moving object i; of two moving objects in row of the first.
  std::vector<std::uint8_t> masks;
  bool grows_together = false;  ///< Of any object.
  double fixed_error = 0;       ///< The largest orthogonality error of fixed objects.
  std::uint64_t serial = 0;     ///< No world with other moving objects has it.

 private:
  // The box of an object at a pose of this orthogonality error, without an extent for what is nowhere. `reach`: the
  // box's, if it is known.
  Box boxAt(const Object<S>& object, const fcl::Transform3<S>& X_WG, double orthogonality_error,
            double reach = 0) const;
  std::int32_t build(std::vector<std::uint32_t>& order, std::vector<std::pair<std::size_t, std::size_t>> parts,
                     const std::vector<Box>& boxes, const std::vector<Object<S>>& objects);
  void link();
  void refit(std::size_t group);
  std::size_t freePlace(const Box& box);
  void addGroup();
  void fillMasks(const IgnoredPairs& ignored);
  void setMask(std::size_t moving_index, std::size_t group, std::size_t lane, bool is_pair);

  // Where a child is in the hierarchy.
  struct Slot {
    std::size_t node, lane;
  };
  std::vector<Slot> slot_of_node_, slot_of_group_;  // of the root: not used
  std::vector<Slot> free_slots_;
  std::vector<std::uint8_t> occupied_;             // of each fixed group, a bit for each lane with an object
  std::vector<std::size_t> free_places_;           // 8 * group + lane
  std::unordered_map<Id, std::size_t> place_of_;   // of fixed objects that are somewhere
  std::unordered_map<Id, std::size_t> moving_of_;  // index of moving objects
  std::size_t changes_ = 0;                        // since the hierarchy was made

  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();  // coordinates of boxes count from here
  double largest_ = 0;                                // radius about the origin of its own frame
};

}  // namespace bocst::scene
