// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/narrowphase/collision_result.h>

#include <cstdint>
#include <vector>

#include "scene/world.h"

namespace bocst::scene {

/// Lanes of a group that make pairs with a moving object.
struct Entry {
  std::uint32_t moving, group, mask;
};

/// A moving object and another one, a lane of a group.
struct PairAt {
  std::uint32_t moving, group, lane;
};

/// True if fcl::collide with the default request says that they touch. `scratch` is a result to write to.
template <typename S>
bool touch(const Object<S>& a, const fcl::Transform3<S>& X_WA, const Object<S>& b, const fcl::Transform3<S>& X_WB,
           fcl::CollisionResult<S>& scratch);

/// Checks one state and lists the pairs that may touch in states near it. Each thread keeps one, to reuse its memory.
///
/// A result for a state also holds for every state in which no point of the box around moving object i is more than
/// far[i] away from where it is in this state: objects whose boxes or hulls are farther apart than both can move stay
/// apart.
template <typename S>
class StateCheck {
 public:
  /// To be called before other queries about a world.
  void start(const World<S>& world);

  /// For each moving object, in scene units. far: see above; 0 if only one state matters. reach: that of its box, valid
  /// in all these states; 0: it follows from the pose.
  std::vector<double> far, reach;

  /// Of the poses of each moving object, at least; to be set before anything is asked.
  std::vector<double> orthogonality_errors;

  /// A length that clearances of this world may have; more than 0.
  double clearance_guess = 0;

  /// True if lists should be complete where a pair touches, too.
  bool lists_after_hit = false;

  /// Places the objects, and finds pairs that may be near: among the entries [begin, end) of the list, or, without one,
  /// among all. Where `entries` is not null, pairs that may touch in one of the states are added to it.
  /// True when a pair touches in this state itself; then more pairs may be added than needed, or (without
  /// lists_after_hit) some are missing.
  bool run(const fcl::Transform3<S>* X_WM, const Entry* begin, const Entry* end, std::vector<Entry>* entries);
  bool runAll(const fcl::Transform3<S>* X_WM, std::vector<Entry>* entries);

  /// The pair that touched last.
  const PairAt& last() const { return last_; }

  /// Where an object is, in the state that was asked for.
  const fcl::Transform3<S>& pose(const fcl::Transform3<S>* X_WM, std::size_t group, std::size_t lane) const {
    return world_->isFixed(group) ? world_->object(group, lane).X_WG : X_WM[world_->movingIndex(group, lane)];
  }

  /// The pairs that touch, in any order.
  void listTouching(const fcl::Transform3<S>* X_WM, std::vector<PairAt>& pairs);

  /// Places the objects alone.
  void place(const fcl::Transform3<S>* X_WM);
  /// The groups that are no farther than `most` from each moving object, as they were last placed.
  const std::vector<NearGroup>& findNear(float most);

 private:
  struct Candidate {
    float gap;
    double depth;  // how far the boxes overlap, in widths of the thinner one
    PairAt pair;
    std::size_t entry;
  };

  BoxLane boxOf(std::size_t moving) const { return {&groups_[moving / 8], moving % 8}; }
  void addNear(std::size_t i, float far_a, const float* far_of_moving);
  void beginState(const fcl::Transform3<S>* X_WM);
  bool isDone(const std::vector<Entry>* entries) const { return touches_ && (entries == nullptr || !lists_after_hit); }
  void addCandidates(const fcl::Transform3<S>* X_WM, const NearGroup& n, std::vector<Entry>* entries);
  bool checkCandidates(const fcl::Transform3<S>* X_WM, std::vector<Entry>* entries);
  void askDeep(const fcl::Transform3<S>* X_WM, std::vector<Entry>* entries);
  void ask(const fcl::Transform3<S>* X_WM, const Candidate& c, std::vector<Entry>* entries);
  void touched(const PairAt& pair);

  const World<S>* world_ = nullptr;
  std::uint64_t serial_ = 0;
  std::vector<BoxGroup> groups_;          // of moving objects
  std::vector<std::uint32_t> others_;     // of World::place()
  std::vector<float> far_;                // as far, rounded up, eight a group
  const float* far_of_moving_ = nullptr;  // it, or null where all are 0
  std::vector<std::uint32_t> order_;      // of moving objects: those that touched last come first
  std::vector<NearGroup> near_;
  std::size_t near_count_ = 0;
  std::vector<std::int32_t> stack_;
  std::vector<Candidate> candidates_, deep_;
  PairAt last_{};  // that touched
  bool has_last_ = false;
  bool touches_ = false;  // in this state
  fcl::CollisionResult<S> result_;
};

}  // namespace bocst::scene
