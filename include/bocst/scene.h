// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/export.h>
#include <fcl/common/types.h>
#include <fcl/geometry/collision_geometry.h>
#include <fcl/narrowphase/continuous_collision_request.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>

namespace bocst {

/// Names an object of one Scene. Small and cheap to copy; the number of an object that was removed is not given again.
class Id {
 public:
  Id() = default;  ///< Names nothing.

  bool isValid() const { return scene_ != 0; }  ///< False for an Id that names nothing.
  /// Do both name the same object?
  friend bool operator==(Id a, Id b) { return a.scene_ == b.scene_ && a.number_ == b.number_; }
  friend bool operator!=(Id a, Id b) { return !(a == b); }  ///< Do they name different objects?
  /// Any order, for containers.
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
  Id a;  ///< The moving object, of two that was added first.
  Id b;  ///< The other.
};

/// How a scene works; answers do not depend on it.
struct SceneOptions {
  /// Threads that share the states of one call with many states, the calling one included; 0: as many as the machine
  /// runs at once. Answers do not depend on it.
  unsigned threads = 1;
};

/// All that a planner asks about a robot among obstacles, for whole states and edges in one call.
///
/// An object is a geometry that is fixed in the world or moves. Geometries are bocst::Model and all that fcl::collide
/// takes: FCL's shapes, BVHModel and OcTree. A scene holds pairs of a moving object and any other object; two fixed
/// objects are no pair. A state is the poses of all moving objects, world from geometry, in the order of adding: that
/// of moving object i in state k is X_WM[k * movingCount() + i].
///
/// Verdicts: a state collides when fcl::collide(a, b) with the default request says so of one of its pairs (Pair has
/// the order of the arguments) that is not ignored. They do not depend on earlier queries, on threads or on what is
/// resident. Each query checks all poses that it is given.
///
/// Threads: any number of threads may query one scene, also while another thread changes it: each query sees the scene
/// from before or after a change, never a mixture. Changes wait for each other. The first query after changes prepares
/// what they need, and queries at the same time wait for it; apart from that, no query waits for another. Where models
/// need not grow, collides() and rows of up to 128 states allocate no memory once the thread has asked similar ones,
/// but for what FCL's own code does for a pair without a Model.
template <typename S>
class BOCST_EXPORT Scene {
 public:
  using Geometry = fcl::CollisionGeometry<S>;  ///< What an object is.
  using Transform = fcl::Transform3<S>;        ///< Where it is: world from geometry.

  /// An empty scene.
  explicit Scene(const SceneOptions& options = {});
  ~Scene();
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  // Changes. All throw std::invalid_argument, and change nothing, for an Id of another scene or of an object that was
  // removed, for a null geometry, one that fcl::collide does not take, and for what is no rigid pose.

  /// An object that stays at X_WG. Bounds its geometry tightly, in time linear in its vertices.
  Id addFixed(std::shared_ptr<Geometry> geometry, const Transform& X_WG);
  /// An object whose pose comes with each state.
  Id addMoving(std::shared_ptr<Geometry> geometry);
  /// The order of the other moving objects stays.
  void remove(Id object);
  /// Another place for a fixed object.
  void setPose(Id fixed, const Transform& X_WG);
  /// The two may touch (allowed collision, SRDF's disabled pairs); `ignored` false takes that back.
  void ignore(Id a, Id b, bool ignored = true);
  /// To be called when a geometry has changed its form: Model::updateVertices(), a changed map of an OcTree.
  void update(Id object);

  // Queries. X_WM may be null where no pose is asked for.

  /// Does this state collide? `first`, if it does: a pair that collides; any, where several do.
  bool collides(const Transform* X_WM, Pair* first = nullptr) const;
  /// The least index of a state that collides, or `states`.
  std::size_t firstCollision(const Transform* X_WM, std::size_t states) const;
  /// Does any state collide? Looks at the middle of each part of the way before its halves, so that a collision on an
  /// edge is found early. `where`, if so: the index of a state that collides; the same for every number of threads.
  bool anyCollision(const Transform* X_WM, std::size_t states, std::size_t* where = nullptr) const;
  /// hit[k] is set to 1 when state k collides, else to 0.
  void collisions(const Transform* X_WM, std::size_t states, std::uint8_t* hit) const;
  /// The least fcl::distance of all pairs, 0 where a pair touches; std::numeric_limits<S>::max() without pairs.
  /// `nearest`: a pair that is so near, or no valid Ids without pairs. Options::margin does not count, as in FCL.
  /// @throws std::invalid_argument for a pair of FCL's geometries of which FCL knows no distance.
  S clearance(const Transform* X_WM, Pair* nearest = nullptr) const;
  /// Is the motion of all moving objects from one state to another free, at all times? Never steps over a contact: what
  /// passes as close as fcl::continuousCollide cannot tell from a contact (see bocst/fcl.h), for two of FCL's
  /// geometries 1e-5 of their sizes, is taken to touch. With CCDM_LINEAR each object's origin moves on a line, and its
  /// rotation about a fixed axis (slerp).
  /// @throws std::invalid_argument as clearance().
  bool edgeIsFree(const Transform* X_WM_begin, const Transform* X_WM_end,
                  fcl::CCDMotionType motion = fcl::CCDM_LINEAR) const;

  std::size_t movingCount() const;  ///< Poses of a state.
  std::size_t fixedCount() const;   ///< Objects that are fixed in the world.
  std::size_t pairCount() const;    ///< That are not ignored.
  /// The place of a moving object among the poses of a state.
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

/// For unordered containers.
template <>
struct std::hash<bocst::Id> {
  /// Of one Id.
  std::size_t operator()(bocst::Id id) const {
    return std::hash<std::uint64_t>()(std::uint64_t{id.scene_} << 32 | id.number_);
  }
};
