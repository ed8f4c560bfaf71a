// SPDX-License-Identifier: BSD-3-Clause
#include "scene/state_check.h"

#include <bocst/fcl.h>

#include <algorithm>
#include <limits>
#include <numeric>
#include <stdexcept>

#include "fcl/adapters/models.h"
#include "fcl/collide/collide_row.h"
#include "fcl/queries/scene_pair.h"

namespace bocst::scene {
namespace {

/// Pairs of boxes that overlap by at least this many widths of the thinner one are asked at once. Of the arm's in
/// scene_benchmark.cpp, 97 % touched among scans and 75 % among small objects; of the others 30 and 17 %.
constexpr double kDeep = 1.5;

/// A model that has lost its mesh since it was added. @throws std::logic_error for one that gets a new one.
template <typename S>
bool isEmptied(const Object<S>& o) {
  return o.model != nullptr && fcl_adapter::ModelTree::of(*o.model) == nullptr && o.model->empty();
}

// FCL's tables have no collision of a TriangleP: it answers "free" at every pose.
template <typename S>
void refuseTriangle(const fcl::CollisionGeometry<S>& a, const fcl::CollisionGeometry<S>& b) {
  if (a.getNodeType() != fcl::GEOM_TRIANGLE && b.getNodeType() != fcl::GEOM_TRIANGLE) return;
  throw std::invalid_argument("bocst::Scene: FCL knows no collision of " + fcl_adapter::typeName<S>(&a) + " and " +
                              fcl_adapter::typeName<S>(&b) + "; make the TriangleP a bocst::Model");
}

}  // namespace

template <typename S>
bool touch(const Object<S>& a, const fcl::Transform3<S>& X_WA, const Object<S>& b, const fcl::Transform3<S>& X_WB,
           fcl::CollisionResult<S>& scratch) {
  if (a.model != nullptr && b.model != nullptr) return fcl_adapter::touch(*a.model, X_WA, *b.model, X_WB);
  if (a.model == nullptr && b.model == nullptr) refuseTriangle<S>(*a.geometry, *b.geometry);
  static const fcl::CollisionRequest<S> request;
  scratch.clear();
  return bocst::collide<S>(a.geometry.get(), X_WA, b.geometry.get(), X_WB, request, scratch) > 0;
}

template <typename S>
void StateCheck<S>::start(const World<S>& world) {
  world_ = &world;
  lists_after_hit = false;
  if (serial_ != world.serial) {
    has_last_ = false;
    clearance_guess = std::numeric_limits<float>::min();
    for (const Object<S>& o : world.moving) {
      if (o.bounds.kind == Bounds::kBox) clearance_guess = std::max(clearance_guess, o.bounds.radius / 4);
    }
    order_.resize(world.moving.size());
    std::iota(order_.begin(), order_.end(), 0u);
  }
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

// Places the objects; far_ is far, rounded up.
template <typename S>
void StateCheck<S>::beginState(const fcl::Transform3<S>* X_WM) {
  place(X_WM);
  near_count_ = 0;
  candidates_.clear();
  deep_.clear();
  touches_ = false;
  far_of_moving_ = nullptr;
  for (std::size_t i = 0; i < far.size(); ++i) {
    const double more = far[i] * (1 + 1e-6);
    far_[i] = more < 1e30 ? static_cast<float>(more) : 1e30f;  // NaN is far, too
    if (far_[i] > 0) far_of_moving_ = far_.data();
  }
}

// What is near moving object i among all that make a pair with it.
template <typename S>
void StateCheck<S>::addNear(std::size_t i, float far_a, const float* far_of_moving) {
  const std::size_t all = world_->allGroups();
  if (near_.size() < near_count_ + all) near_.resize(2 * (near_count_ + all));
  const SceneBoxes boxes{world_->nodes.empty() ? nullptr : world_->nodes.data(), world_->groups.data(), groups_.data(),
                         world_->fixedGroups(), groups_.size()};
  near_count_ += nearBox(boxes, i, world_->masks.data() + i * all, far_a, far_of_moving, stack_.data(),
                         near_.data() + near_count_);
}

template <typename S>
const std::vector<NearGroup>& StateCheck<S>::findNear(float most) {
  near_count_ = 0;
  for (std::size_t i = 0; i < world_->moving.size(); ++i) addNear(i, most, nullptr);
  near_.resize(near_count_);
  return near_;
}

template <typename S>
bool StateCheck<S>::runAll(const fcl::Transform3<S>* X_WM, std::vector<Entry>* entries) {
  beginState(X_WM);
  for (std::size_t n = 0; n < order_.size() && !isDone(entries); ++n) {
    const std::uint32_t i = order_[n];
    near_count_ = 0;
    addNear(i, far_[i], far_of_moving_);
    for (std::size_t k = 0; k < near_count_; ++k) addCandidates(X_WM, near_[k], entries);
    askDeep(X_WM, entries);
  }
  return checkCandidates(X_WM, entries);
}

template <typename S>
bool StateCheck<S>::run(const fcl::Transform3<S>* X_WM, const Entry* begin, const Entry* end,
                        std::vector<Entry>* entries) {
  beginState(X_WM);
  for (const Entry* e = begin; e != end && !isDone(entries); ++e) {
    NearGroup n;
    if (world_->isFixed(e->group)) {
      nearInGroup(boxOf(e->moving), world_->groups[e->group], e->mask, far_[e->moving], nullptr, n);
    } else {
      const std::size_t g = e->group - world_->fixedGroups();
      nearInGroup(boxOf(e->moving), groups_[g], e->mask, far_[e->moving],
                  far_of_moving_ == nullptr ? nullptr : far_of_moving_ + 8 * g, n);
    }
    if (n.mask == 0) continue;
    n.box = e->moving;
    n.group = e->group;
    addCandidates(X_WM, n, entries);
    if (e + 1 == end || e[1].moving != e->moving) askDeep(X_WM, entries);
  }
  askDeep(X_WM, entries);
  return checkCandidates(X_WM, entries);
}

// Asks about pairs that probably touch: the one that touched last, and deep ones. The others are candidates.
template <typename S>
void StateCheck<S>::addCandidates(const fcl::Transform3<S>* X_WM, const NearGroup& n, std::vector<Entry>* entries) {
  if (entries != nullptr) entries->push_back({n.box, n.group, n.mask});
  for (std::uint32_t left = n.mask; left != 0 && !touches_; left &= left - 1) {
    const auto lane = static_cast<std::uint32_t>(__builtin_ctz(left));
    const float gap = n.gap[lane];
    if (!(gap <= 0)) continue;
    const Object<S>&a = world_->moving[n.box], &b = world_->object(n.group, lane);
    if (isEmptied(a) || isEmptied(b)) continue;
    const double width = std::min(a.bounds.width, b.bounds.width);
    const double depth = -static_cast<double>(gap) / width;  // NaN for what is flat and touches: not deep
    const bool is_last = has_last_ && last_.moving == n.box && last_.group == n.group && last_.lane == lane;
    // What is wholly inside the box of the other, as all is in that of a hall, may be anywhere: that says little.
    const double size = 2 * std::min(a.bounds.half.maxCoeff(), b.bounds.half.maxCoeff());
    const bool is_inside = -static_cast<double>(gap) > size;
    const Candidate c{is_inside ? 0 : gap, depth, {n.box, n.group, lane}, entries == nullptr ? 0 : entries->size() - 1};
    if (is_last) {
      ask(X_WM, c, entries);
    } else {
      (depth >= kDeep && !is_inside ? deep_ : candidates_).push_back(c);
    }
  }
}

template <typename S>
void StateCheck<S>::listTouching(const fcl::Transform3<S>* X_WM, std::vector<PairAt>& pairs) {
  place(X_WM);
  for (const NearGroup& n : findNear(0)) {
    for (std::uint32_t left = n.mask; left != 0; left &= left - 1) {
      const PairAt p{n.box, n.group, static_cast<std::uint32_t>(__builtin_ctz(left))};
      const Object<S>&mover = world_->moving[p.moving], &other = world_->object(p.group, p.lane);
      if (isEmptied(mover) || isEmptied(other)) continue;
      if (touch(mover, X_WM[p.moving], other, pose(X_WM, p.group, p.lane), result_)) pairs.push_back(p);
    }
  }
}

// Asks about the deep pairs of a moving object. What probes prove saves the walks of the others.
template <typename S>
void StateCheck<S>::askDeep(const fcl::Transform3<S>* X_WM, std::vector<Entry>* entries) {
  for (std::size_t k = 0; k < deep_.size() && deep_.size() > 1 && !touches_; ++k) {
    const PairAt& p = deep_[k].pair;
    const Object<S>&a = world_->moving[p.moving], &b = world_->object(p.group, p.lane);
    if (a.model == nullptr || b.model == nullptr) continue;
    if (fcl_adapter::surelyTouch(*a.model, X_WM[p.moving], *b.model, pose(X_WM, p.group, p.lane))) touched(p);
  }
  for (std::size_t k = 0; k < deep_.size() && !touches_; ++k) ask(X_WM, deep_[k], entries);
  deep_.clear();
}

// Asks about the candidates, the deepest first.
template <typename S>
bool StateCheck<S>::checkCandidates(const fcl::Transform3<S>* X_WM, std::vector<Entry>* entries) {
  if (!touches_) {
    std::sort(candidates_.begin(), candidates_.end(),
              [](const Candidate& p, const Candidate& q) { return p.gap < q.gap; });
    for (auto c = candidates_.begin(); c != candidates_.end() && !touches_; ++c) ask(X_WM, *c, entries);
  }
  return touches_;
}

// Asks whether the pair touches in this state. Takes it off its entry if it can touch in no state.
template <typename S>
void StateCheck<S>::ask(const fcl::Transform3<S>* X_WM, const Candidate& c, std::vector<Entry>* entries) {
  const Object<S>&a = world_->moving[c.pair.moving], &b = world_->object(c.pair.group, c.pair.lane);
  const fcl::Transform3<S>&X_WA = X_WM[c.pair.moving], &X_WB = pose(X_WM, c.pair.group, c.pair.lane);
  // Hulls of boxes that overlap deeply do, too.
  if (entries != nullptr && a.exact && b.exact && !(c.depth >= kDeep)) {
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
      return;
    }
  }
  if (touch(a, X_WA, b, X_WB, result_)) touched(c.pair);
}

template <typename S>
void StateCheck<S>::touched(const PairAt& pair) {
  touches_ = has_last_ = true;
  last_ = pair;
  const auto at = std::find(order_.begin(), order_.end(), pair.moving);
  std::rotate(order_.begin(), at, at + 1);
}

#define BOCST_INSTANTIATE(S)                                                                                    \
  template bool touch(const Object<S>&, const fcl::Transform3<S>&, const Object<S>&, const fcl::Transform3<S>&, \
                      fcl::CollisionResult<S>&);                                                                \
  template class StateCheck<S>;
BOCST_INSTANTIATE(float)
BOCST_INSTANTIATE(double)
#undef BOCST_INSTANTIATE

}  // namespace bocst::scene
