// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/export.h>
#include <fcl/common/types.h>
#include <fcl/geometry/collision_geometry.h>
#include <fcl/narrowphase/continuous_collision_request.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <vector>

namespace bocst {

/// Identifies an object of one Scene. Small and cheap to copy. The id of a removed object is not used again.
class Id {
 public:
  Id() = default;  ///< Identifies no object.

  bool isValid() const { return scene_ != 0; }  ///< False for an Id that identifies no object.
  /// True if both identify the same object.
  friend bool operator==(Id a, Id b) { return a.scene_ == b.scene_ && a.number_ == b.number_; }
  friend bool operator!=(Id a, Id b) { return !(a == b); }  ///< True for different objects.
  /// An arbitrary order, for containers.
  friend bool operator<(Id a, Id b) { return a.scene_ != b.scene_ ? a.scene_ < b.scene_ : a.number_ < b.number_; }

 private:
  template <typename S>
  friend class Scene;
  friend struct std::hash<Id>;
  Id(std::uint32_t scene, std::uint32_t number) : scene_(scene), number_(number) {}

  std::uint32_t scene_ = 0, number_ = 0;
};

/// Two objects of a scene: `a` moves; `b` is fixed, or moves and was added after `a`.
struct Pair {
  Id a;  ///< The moving object; of two, the one added first.
  Id b;  ///< The other object.
};

/// Two objects of a scene and the distance between their surfaces in one state, in the unit of the poses.
template <typename S>
struct PairDistance {
  Pair pair;                         ///< The two objects.
  S distance = 0;                    ///< fcl::distance of the two; 0 if they touch.
  fcl::Vector3<S> nearest_points[2]; /**< In the world, on the surfaces of pair.a and pair.b, as fcl::distance finds
                                        them; without meaning if the two touch. */
};

/// Options of a scene.
struct SceneOptions {
  /// Number of threads that share the states of one call with many states, including the calling thread; 0: one per
  /// hardware thread. Answers do not depend on it.
  unsigned threads = 1;
};

/// The collision queries of a planner for a robot among obstacles: one call checks whole states or an edge.
///
/// An object is a geometry that is fixed in the world or moves. Geometries are bocst::Model and all types that
/// fcl::collide accepts: FCL's shapes, BVHModel and OcTree. Of a BVHModel, the scene makes a Model with default
/// options, which objects with the same geometry share, and checks that one, because two models are checked several
/// times as fast. A scene checks each pair of a moving object and any other object, not pairs of two fixed objects. A
/// state is the list of the poses of all moving objects, world from geometry, in the order in which they were added:
/// the pose of moving object i in state k is X_WM[k * movingCount() + i].
///
/// Verdicts: a state collides if fcl::collide(a, b) with the default request reports a collision for one of its pairs
/// that is not ignored (Pair has the order of the arguments; a Model stands for a BVHModel). Verdicts do not depend on
/// earlier queries, on threads or on the resident nodes. Each query checks that all its poses are rigid.
///
/// Threads: any number of threads may query one scene, also while another thread changes it: each query sees the scene
/// before or after a change, never a mixture (changes of a geometry itself: see update()). A query reads as
/// many poses as there are moving objects when it begins. Before you add or remove a moving object, make sure that no
/// other thread passes a state of the old length: use a lock of your own, or a scene for each thread (a new one costs
/// little, see addFixed()). Changes wait for each other. A change of a fixed object takes microseconds; while
/// queries are under way, it copies what they share (0.2 ms for 20 000 fixed objects). The first query, and the first
/// one after moving objects came or went or after many changes, updates the scene's internal data, and other queries
/// wait for that; apart from changes, no query waits for another. When no tree has to grow, collides() and calls with
/// up to 128 states allocate no memory (after the first such calls of a thread), except inside FCL: for pairs without a
/// Model, and for a triangle near a shape or a cell. A child of fork() works alone; calls throw std::runtime_error if
/// another thread of the parent was at work in the scene or in one of its models at the fork.
template <typename S>
class BOCST_EXPORT Scene {
 public:
  using Geometry = fcl::CollisionGeometry<S>;  ///< The type of an object's geometry.
  using Transform = fcl::Transform3<S>;        ///< The type of its pose: world from geometry.

  /// An empty scene.
  explicit Scene(const SceneOptions& options = {});
  ~Scene();
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  // Changes. All throw std::invalid_argument, and change nothing, for an Id of another scene or of a removed object,
  // for a null geometry, an empty Model, a geometry that fcl::collide does not accept, a pose that is not rigid,
  // ignore(a, a), setPose() of a moving object and movingIndex() of a fixed one; std::logic_error for a Model between
  // beginModel() and endModel().

  /// Adds an object that stays at X_WG. Computes a bounding box of its geometry. For a mesh this takes time linear
  /// in its vertices, once in the process; for an OcTree most cells are not read. Objects with the same geometry share
  /// the box.
  Id addFixed(std::shared_ptr<Geometry> geometry, const Transform& X_WG);
  /// Adds an object whose pose is part of each state.
  Id addMoving(std::shared_ptr<Geometry> geometry);
  /// Removes an object. The other moving objects keep their order. To replace an object while other threads query, add
  /// the new one before you remove the old one: then no query misses both. A geometry that nobody else holds is
  /// destroyed by this call, or by the last query that uses it: an OcTree of 100 000 cells takes 80 ms.
  void remove(Id object);
  /// Moves a fixed object to another pose.
  void setPose(Id fixed, const Transform& X_WG);
  /// Allows the two to touch (allowed collision, SRDF's disabled pairs); `ignored` = false undoes this.
  void ignore(Id a, Id b, bool ignored = true);
  /// Call this after the geometry of an object has changed: Model::updateVertices(), a changed map of an OcTree, new
  /// vertices, thresholds or cost density of a BVHModel. Updates all objects with the same geometry. Between the change
  /// of the geometry and the end of this call, queries may miss contacts, because they look for the new surface in the
  /// bounds of the old one. Where other threads query meanwhile, add an object with a new geometry instead, then remove
  /// the old one.
  void update(Id object);

  /// Builds the complete trees of all models with exact answers now (Model::buildTree()), those of BVHModels included,
  /// on the scene's threads, and the internal data that the first query would update: for a planner whose set-up is not
  /// part of the planning time. Objects that are added later are not included. A model drops the branches that no query
  /// has used for Options::ttl; set that to 0 for models that shall keep their trees. (The scene's own models of
  /// BVHModels have the default, 2 s.) Queries and changes may run at the same time.
  /// @throws std::logic_error for a Model between beginModel() and endModel(); std::bad_alloc. Some of the trees may
  /// have been built then.
  void buildTrees();

  // Queries. X_WM may be null if there are no moving objects or no states. All throw std::invalid_argument, which names
  // the moving object and the state, for a pose that is not rigid, for another null pointer to poses or hits, and for
  // two geometries near each other of which FCL knows no collision: a Plane and a Convex, or a TriangleP and any
  // geometry that is not a Model.

  /// True if this state collides. `pair` is then set to one of the pairs that collide.
  bool collides(const Transform* X_WM, Pair* pair = nullptr) const;
  /// The smallest index of a state that collides; `states` if none does.
  std::size_t firstCollision(const Transform* X_WM, std::size_t states) const;
  /// True if any state collides. Checks the middle of each part before its halves, to find a collision on an edge
  /// early. `where` is then set to the index of such a state; it is the same for any number of threads.
  bool anyCollision(const Transform* X_WM, std::size_t states, std::size_t* where = nullptr) const;
  /// Sets hit[k] to 1 if state k collides, otherwise to 0. When it throws, some of hit[] may have been set.
  void collisions(const Transform* X_WM, std::size_t states, std::uint8_t* hit) const;
  /// The minimum distance of all pairs: fcl::distance, but of two of FCL's shapes, where that can be too large, the
  /// distance that bocst computes. If a pair touches, 0 up to the rounding of fcl::distance;
  /// std::numeric_limits<S>::max() without pairs. `nearest` is set to a pair at this distance; to invalid Ids without
  /// pairs. at_most: if no pair is nearer than this, the function returns at_most and sets no pair; it does not measure
  /// pairs that are farther apart. For thresholds and truncated distances. Options::margin has no effect. It includes
  /// a Plane or Halfspace beside another of FCL's shapes, of which fcl::distance computes nothing.
  /// @throws std::invalid_argument for other pairs of FCL's shapes and octrees whose distance FCL cannot compute,
  /// unless another pair is found to be nearer before; and if at_most is negative or NaN.
  S clearance(const Transform* X_WM, Pair* nearest = nullptr, S at_most = std::numeric_limits<S>::max()) const;
  /// Sets distances[k] to the clearance of state k, and nearest[k] to the pair that has it. The scene's threads share
  /// the states.
  /// @throws std::invalid_argument as clearance(); some of the numbers are then set.
  void clearances(const Transform* X_WM, std::size_t states, S* distances, Pair* nearest = nullptr,
                  S at_most = std::numeric_limits<S>::max()) const;
  /// All pairs that collide in this state, in the order of their Ids, where collides() stops at one. fcl::collide with
  /// the objects' geometries and poses reports the contacts of such a pair.
  std::vector<Pair> collidingPairs(const Transform* X_WM) const;
  /// All pairs whose distance in this state is at most `distance`, up to rounding, the nearest first; for optimisers
  /// that keep each pair apart. Options::margin has no effect; distances are those of clearance().
  /// @throws std::invalid_argument as clearance(), of pairs whose bounding boxes are that near; and for a `distance`
  /// that is negative or NaN.
  std::vector<PairDistance<S>> pairsWithin(const Transform* X_WM, S distance) const;
  /// True if the motion of all moving objects from one state to another is free of collisions at all times. Never steps
  /// over a contact. Geometries that pass closer than the resolution of fcl::continuousCollide (see bocst/fcl.h; for
  /// two of FCL's shapes and octrees 1e-5 of their sizes and 1e-5 in length units) count as touching. With CCDM_LINEAR,
  /// each object's origin moves on a line, and the object turns about a fixed axis (slerp of the normalised
  /// quaternions, which removes rounding errors of a rotation). Two of FCL's shapes and octrees that pass closer than
  /// the rounding of the motion's length also count as touching.
  /// @throws std::invalid_argument as clearance(), and for a Plane or Halfspace that moves near another of FCL's
  /// shapes.
  bool edgeIsFree(const Transform* X_WM_begin, const Transform* X_WM_end,
                  fcl::CCDMotionType motion = fcl::CCDM_LINEAR) const;

  std::size_t movingCount() const;  ///< Number of poses in a state.
  std::size_t fixedCount() const;   ///< Number of objects that are fixed in the world.
  std::size_t pairCount() const;    ///< Number of pairs that are not ignored.
  /// The index of a moving object among the poses of a state.
  std::size_t movingIndex(Id moving) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

using Scenef = Scene<float>;
using Scened = Scene<double>;

extern template class Scene<float>;
extern template class Scene<double>;

}  // namespace bocst

/// Hash of an Id, for unordered containers.
template <>
struct std::hash<bocst::Id> {
  /// The hash of one Id.
  std::size_t operator()(bocst::Id id) const {
    return std::hash<std::uint64_t>()(std::uint64_t{id.scene_} << 32 | id.number_);
  }
};
