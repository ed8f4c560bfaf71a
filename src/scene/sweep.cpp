// SPDX-License-Identifier: BSD-3-Clause
#include "scene/sweep.h"

#include <algorithm>

#include "scene/pose_rows.h"

namespace bocst::scene {
namespace {

/// Parts in which an object moves farther than this many of its radii are not checked as a whole.
constexpr double kFarthest = 4;

}  // namespace

template <typename S>
void Sweep<S>::measure(const World<S>& world, const fcl::Transform3<S>* X_WM, std::size_t states) {
  const std::size_t moving = world.moving.size(), room = roomFor(moving);
  path_.resize(room * states);
  place_.resize(room);
  measurePaths(X_WM->matrix().data(), states, world.rows, path_.data(), place_.data());
  // Of all states, as what is said of one holds for others.
  for (std::size_t i = 0; i < moving; ++i) {
    check_.reach[i] = world.reachWithin(world.moving[i], place_[i], check_.orthogonality_errors[i]);
  }
  is_measured_ = true;
}

// False when objects move too far in this part for its middle to say much about the rest.
template <typename S>
bool Sweep<S>::setFar(const World<S>& world, const fcl::Transform3<S>* X_WM, std::size_t states, const Part& part,
                      std::size_t middle) {
  const std::size_t moving = world.moving.size(), last = part.end - 1;
  const auto isTooFar = [&](std::size_t i, double far) {
    const Bounds& b = world.moving[i].bounds;
    // NaN: the motion is too long for a double.
    if (far <= kFarthest * b.radius || b.kind != Bounds::kBox) return false;
    farthest_ = i;
    return true;
  };
  // Of random states, the straight way of one object shows it: the one that did before is asked first.
  for (std::size_t n = 0, i = farthest_ % moving; n < moving && !is_measured_; ++n, i = i + 1 < moving ? i + 1 : 0) {
    const Eigen::Vector3d& c = world.moving[i].bounds.center;
    // Column by column: Eigen's product of a transform is not inlined.
    const auto at = [&](std::size_t k) -> Eigen::Vector3d {
      const auto columns = X_WM[k * moving + i].matrix().template topRows<3>().template cast<double>();
      return columns.col(0) * c[0] + columns.col(1) * c[1] + columns.col(2) * c[2] + columns.col(3);
    };
    const Eigen::Vector3d between = at(middle);
    if (isTooFar(i, std::max((at(part.begin) - between).norm(), (at(last) - between).norm()))) return false;
  }
  if (!is_measured_) measure(world, X_WM, states);
  const std::size_t room = roomFor(moving), most = std::max(middle - part.begin, last - middle);
  for (std::size_t i = 0; i < moving; ++i) {
    const double* path = path_.data() + i;
    const double to_begin = path[middle * room] - path[part.begin * room],
                 to_end = path[last * room] - path[middle * room];
    // Differences of sums: after a long way even 0 is rounded.
    const double rounding = 1e-15 * path[(states - 1) * room] * static_cast<double>(states);
    // See measurePaths().
    const double skew = 8.001 * check_.orthogonality_errors[i] * world.rows.radius[i] * static_cast<double>(most);
    check_.far[i] = std::max(to_begin, to_end) + rounding + skew;
    if (isTooFar(i, check_.far[i])) return false;
  }
  return true;
}

// What conservative answers to all states need grows in few batches, where an oracle is slow to answer; states in which
// models meet are known then.
template <typename S>
void Sweep<S>::growForAll(const World<S>& world, const fcl::Transform3<S>* X_WM, std::size_t states,
                          std::uint8_t* hit) {
  pairs_.clear();
  state_of_pair_.clear();
  for (std::size_t k = 0; k < states; ++k) {
    const fcl::Transform3<S>* X = X_WM + k * world.moving.size();
    check_.place(X);
    for (const NearGroup& n : check_.findNear(0)) {
      const Object<S>& a = world.moving[n.box];
      for (std::uint32_t left = n.mask; left != 0; left &= left - 1) {
        const auto lane = static_cast<std::uint32_t>(__builtin_ctz(left));
        const Object<S>& b = world.object(n.group, lane);
        if (!(n.gap[lane] <= 0) || a.model == nullptr || b.model == nullptr) continue;
        if (!a.model->isOccupied() || !b.model->isOccupied()) continue;
        if (!fcl_adapter::growsTogether(*a.model, *b.model)) continue;
        pairs_.push_back({a.model, X[n.box], b.model, check_.pose(X, n.group, lane)});
        state_of_pair_.push_back(k);
      }
    }
  }
  if (pairs_.empty()) return;
  const std::vector<fcl_adapter::Spheres>& found = fcl_adapter::growTogether<S>(pairs_);
  for (std::size_t i = 0; i < pairs_.size(); ++i) {
    if (found[i] == fcl_adapter::Spheres::kMeet) hit[state_of_pair_[i]] = 1;
  }
}

// In one function: the three goals differ in what comes next and when it ends, but share each state's check.
template <typename S>
std::size_t Sweep<S>::run(const World<S>& world, const fcl::Transform3<S>* X_WM, std::size_t states, Goal goal,
                          std::uint8_t* hit, const std::vector<double>& orthogonality_errors) {
  const std::size_t moving = world.moving.size();
  check_.start(world);
  check_.lists_after_hit = goal != Goal::kAny;
  check_.orthogonality_errors.assign(orthogonality_errors.begin(), orthogonality_errors.end());
  if (goal == Goal::kAll && states > 1 && world.grows_together) growForAll(world, X_WM, states, hit);
  is_measured_ = false;
  std::size_t found = states;
  parts_.clear();
  entries_.clear();
  parts_.push_back({0, states, 0, 0, false});
  // From the front, so that middles come first; from the back, so that early states do.
  for (std::size_t front = 0; front < parts_.size();) {
    const Part part = goal == Goal::kAny ? parts_[front] : parts_.back();
    if (goal == Goal::kAny) {
      ++front;
    } else {
      parts_.pop_back();
    }
    if (goal == Goal::kFirst && part.begin >= found) continue;
    const std::size_t middle = part.begin + (part.end - part.begin) / 2;
    const fcl::Transform3<S>* X = X_WM + middle * moving;
    Part rest{0, 0, 0, 0, false};
    bool touches = goal == Goal::kAll && hit[middle] != 0;  // known by growForAll()
    if (touches) {
      rest = part;
    } else {
      // The middle of an edge is asked alone: half of the edges that are not free end there.
      const bool alone = part.end - part.begin == 1 || (goal == Goal::kAny && front == 1);
      const bool whole = !alone && setFar(world, X_WM, states, part, middle);
      if (!whole) std::fill(check_.far.begin(), check_.far.end(), 0.0);
      found_.clear();
      std::vector<Entry>* entries = whole ? &found_ : nullptr;
      if (part.has_list) {
        touches = check_.run(X, entries_.data() + part.first, entries_.data() + part.last, entries);
        if (!whole) rest = part;
      } else {
        touches = check_.runAll(X, entries);
      }
      if (whole) {
        rest.has_list = true;
        rest.first = entries_.size();
        for (const Entry& e : found_) {
          if (e.mask != 0) entries_.push_back(e);
        }
        rest.last = entries_.size();
      }
    }
    if (touches) {
      found = middle;
      if (goal == Goal::kAny) return found;
      if (goal == Goal::kAll) hit[middle] = 1;
    }
    if (rest.has_list && rest.first == rest.last) continue;
    const auto add = [&](std::size_t begin, std::size_t end) {
      if (begin < end) parts_.push_back({begin, end, rest.first, rest.last, rest.has_list});
    };
    if (goal == Goal::kAny) {
      add(part.begin, middle);
      add(middle + 1, part.end);
    } else {
      if (goal == Goal::kAll || !touches) add(middle + 1, part.end);
      add(part.begin, middle);
    }
  }
  return found;
}

template class Sweep<float>;
template class Sweep<double>;

}  // namespace bocst::scene
