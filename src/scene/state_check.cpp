// SPDX-License-Identifier: BSD-3-Clause
#include "scene/state_check.h"

#include <bocst/fcl.h>

#include <algorithm>

#include "fcl/queries/scene_pair.h"

namespace bocst::scene {

template <typename S>
bool touch(const Object<S>& a, const fcl::Transform3<S>& X_WA, const Object<S>& b, const fcl::Transform3<S>& X_WB,
           fcl::CollisionResult<S>& scratch) {
  static const fcl::CollisionRequest<S> request;
  scratch.clear();
  return bocst::collide<S>(a.geometry.get(), X_WA, b.geometry.get(), X_WB, request, scratch) > 0;
}

template <typename S>
void StateCheck<S>::start(const World<S>& world) {
  world_ = &world;
  if (serial_ != world.serial) has_last_ = false;
  others_.resize(world.moving.size());
  // Each state fills all lanes with an object.
  if (serial_ != world.serial) groups_.assign(world.movingGroups(), BoxGroup());
  stack_.resize(world.nodes.size() + 1);
  far.assign(world.moving.size(), 0);
  reach.assign(roomFor(world.moving.size()), 0);
  far_.assign(8 * world.movingGroups(), 0);
  serial_ = world.serial;
}

template <typename S>
void StateCheck<S>::place(const fcl::Transform3<S>* X_WM) {
  world_->place(X_WM, orthogonality_errors.data(), reach.data(), groups_.data(), others_.data());
}

// Rounded up, as floats.
template <typename S>
void StateCheck<S>::spread() {
  for (std::size_t i = 0; i < far.size(); ++i) {
    const double more = far[i] * (1 + 1e-6);
    far_[i] = more < 1e30 ? static_cast<float>(more) : 1e30f;  // NaN is far, too
  }
}

// What is near moving object i among all that make a pair with it.
template <typename S>
void StateCheck<S>::addNear(std::size_t i, float far_a, const float* far_of_moving) {
  const std::size_t fixed = world_->fixedGroups(), all = world_->allGroups();
  if (near_.size() < near_count_ + all) near_.resize(2 * (near_count_ + all));
  const std::uint8_t* masks = world_->masks.data() + i * all;
  std::size_t count = near_count_;
  if (!world_->nodes.empty()) {
    count += nearInTree(boxOf(i), world_->nodes.data(), world_->groups.data(), masks, far_a, stack_.data(),
                        near_.data() + count);
  }
  for (std::size_t g = i / 8; g < groups_.size(); ++g) {
    if (masks[fixed + g] == 0) continue;
    NearGroup& n = near_[count];
    nearInGroup(boxOf(i), groups_[g], masks[fixed + g], far_a,
                far_of_moving == nullptr ? nullptr : far_of_moving + 8 * g, n);
    n.group = static_cast<std::uint32_t>(fixed + g);
    if (n.mask != 0) ++count;
  }
  for (; near_count_ < count; ++near_count_) near_[near_count_].box = static_cast<std::uint32_t>(i);
}

template <typename S>
const std::vector<NearGroup>& StateCheck<S>::findNear(float most) {
  near_count_ = 0;
  for (std::size_t i = 0; i < world_->moving.size(); ++i) addNear(i, most, nullptr);
  near_.resize(near_count_);
  return near_;
}

template <typename S>
bool StateCheck<S>::runAll(const fcl::Transform3<S>* X_WM, std::vector<Entry>* entries, PairAt* hit) {
  place(X_WM);
  spread();
  near_count_ = 0;
  for (std::size_t i = 0; i < world_->moving.size(); ++i) addNear(i, far_[i], far_.data());
  return look(X_WM, near_count_, entries, hit);
}

template <typename S>
bool StateCheck<S>::run(const fcl::Transform3<S>* X_WM, const Entry* begin, const Entry* end,
                        std::vector<Entry>* entries, PairAt* hit) {
  place(X_WM);
  spread();
  const auto size = static_cast<std::size_t>(end - begin);
  if (near_.size() < size) near_.resize(size);
  near_count_ = 0;
  for (const Entry* e = begin; e != end; ++e) {
    NearGroup& n = near_[near_count_];
    if (world_->isFixed(e->group)) {
      nearInGroup(boxOf(e->moving), world_->groups[e->group], e->mask, far_[e->moving], nullptr, n);
    } else {
      const std::size_t g = e->group - world_->fixedGroups();
      nearInGroup(boxOf(e->moving), groups_[g], e->mask, far_[e->moving], far_.data() + 8 * g, n);
    }
    if (n.mask == 0) continue;
    n.box = e->moving;
    n.group = e->group;
    ++near_count_;
  }
  return look(X_WM, near_count_, entries, hit);
}

// Looks closer at what is near.
template <typename S>
bool StateCheck<S>::look(const fcl::Transform3<S>* X_WM, std::size_t count, std::vector<Entry>* entries, PairAt* hit) {
  candidates_.clear();
  for (std::size_t k = 0; k < count; ++k) {
    const NearGroup& n = near_[k];
    for (std::uint32_t left = n.mask; left != 0; left &= left - 1) {
      const auto lane = static_cast<std::uint32_t>(__builtin_ctz(left));
      if (!(n.gap[lane] <= 0)) continue;
      Candidate c{n.gap[lane], {n.box, n.group, lane}, entries == nullptr ? 0 : entries->size()};
      // What touched last time is asked first, and then what is deepest in the other's box.
      if (has_last_ && last_.moving == n.box && last_.group == n.group && last_.lane == lane) c.gap = -1e30f;
      candidates_.push_back(c);
    }
    if (entries != nullptr) entries->push_back({n.box, n.group, n.mask});
  }
  std::sort(candidates_.begin(), candidates_.end(),
            [](const Candidate& p, const Candidate& q) { return p.gap < q.gap; });
  for (const Candidate& c : candidates_) {
    const Object<S>&a = world_->moving[c.pair.moving], &b = world_->object(c.pair.group, c.pair.lane);
    const fcl::Transform3<S>&X_WA = X_WM[c.pair.moving], &X_WB = pose(X_WM, c.pair.group, c.pair.lane);
    if (entries != nullptr && a.exact && b.exact) {
      double apart = far[c.pair.moving], orthogonality_error = orthogonality_errors[c.pair.moving];
      if (world_->isFixed(c.pair.group)) {
        orthogonality_error += world_->fixed_error;
      } else {
        const std::size_t j = world_->movingIndex(c.pair.group, c.pair.lane);
        apart += far[j];
        orthogonality_error += orthogonality_errors[j];
      }
      // Of all states, as in reachOf().
      apart += 16 * orthogonality_error * (a.bounds.size + b.bounds.size + apart);
      // A larger gap between hulls whose boxes overlap is seldom.
      if (apart < std::min(a.bounds.radius, b.bounds.radius) &&
          fcl_adapter::hullsApart(*a.model, X_WA, *b.model, X_WB, apart * (1 + 1e-4))) {
        (*entries)[c.entry].mask &= ~(1u << c.pair.lane);
        continue;
      }
    }
    if (touch(a, X_WA, b, X_WB, result_)) {
      last_ = c.pair;
      has_last_ = true;
      if (hit != nullptr) *hit = c.pair;
      return true;
    }
  }
  return false;
}

#define BOCST_INSTANTIATE(S)                                                                                    \
  template bool touch(const Object<S>&, const fcl::Transform3<S>&, const Object<S>&, const fcl::Transform3<S>&, \
                      fcl::CollisionResult<S>&);                                                                \
  template class StateCheck<S>;
BOCST_INSTANTIATE(float)
BOCST_INSTANTIATE(double)
#undef BOCST_INSTANTIATE

}  // namespace bocst::scene
