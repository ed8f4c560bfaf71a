// SPDX-License-Identifier: BSD-3-Clause
#include "scene/sweep.h"

#include <algorithm>
#include <cmath>

namespace bocst::scene {
namespace {

/// Parts in which objects move farther than so many of their radii are not worth a look as a whole.
constexpr double kFarthest = 4;

}  // namespace

// From one pose to the next, a point at c + x of the box's centre c moves by (Y - X) c + (R_Y - R_X) x. For rotations
// the norm of R_Y - R_X is 1/sqrt(2) of its Frobenius norm; where they are off by `orthogonality_error`, it is more by
// less than 4 of it. Sums of roundings are far below the millionth that is added.
template <typename S>
void Sweep<S>::measure(const World<S>& world, const fcl::Transform3<S>* X_WM, std::size_t states) {
  const std::size_t moving = world.moving.size();
  path_.resize(moving * states);
  for (std::size_t i = 0; i < moving; ++i) {
    const Bounds& b = world.moving[i].bounds;
    const double radius = b.radius, c0 = b.center[0], c1 = b.center[1], c2 = b.center[2];
    const auto placeOf = [&](std::size_t k) {
      return static_cast<double>(X_WM[k * moving + i].translation().template lpNorm<1>());
    };
    const double orthogonality_error = check_.orthogonality_errors[i];
    double sum = 0, place = placeOf(0);
    double* path = path_.data() + i * states;
    path[0] = 0;
    for (std::size_t k = 1; k < states; ++k) {
      const S *x = X_WM[(k - 1) * moving + i].matrix().data(), *y = X_WM[k * moving + i].matrix().data();
      double displacement = 0, turn = 0;
      for (int j = 0; j < 3; ++j) {
        const double d0 = static_cast<double>(y[j]) - static_cast<double>(x[j]);
        const double d1 = static_cast<double>(y[4 + j]) - static_cast<double>(x[4 + j]);
        const double d2 = static_cast<double>(y[8 + j]) - static_cast<double>(x[8 + j]);
        const double d =
            d0 * c0 + d1 * c1 + d2 * c2 + (static_cast<double>(y[12 + j]) - static_cast<double>(x[12 + j]));
        displacement += d * d;
        turn += d0 * d0 + d1 * d1 + d2 * d2;
      }
      sum += (std::sqrt(displacement) + radius * (std::sqrt(turn / 2) + 8 * orthogonality_error)) * (1 + 1e-6);
      path[k] = sum;
      place = std::max(place, placeOf(k));
    }
    // Of all states, as what is said of one holds for others.
    if (states > 1) check_.reach[i] = world.reachWithin(world.moving[i], place, orthogonality_error);
  }
}

// False when objects move too far in this part for its middle to say much about the rest.
template <typename S>
bool Sweep<S>::setFar(const World<S>& world, std::size_t states, const Part& part, std::size_t middle) {
  bool near = true;
  for (std::size_t i = 0; i < world.moving.size(); ++i) {
    const double* path = path_.data() + i * states;
    const double far = std::max(path[middle] - path[part.begin], path[part.end - 1] - path[middle]);
    // Differences of sums: after a long way even 0 is rounded.
    check_.far[i] = far + 1e-15 * path[states - 1] * static_cast<double>(states);
    // NaN: the motion is too long for a double.
    if (!(check_.far[i] <= kFarthest * world.moving[i].bounds.radius) && world.moving[i].bounds.kind == Bounds::kBox)
      near = false;
  }
  return near;
}

// What conservative answers to all states need grows in few batches, where an oracle is slow to answer.
template <typename S>
void Sweep<S>::growForAll(const World<S>& world, const fcl::Transform3<S>* X_WM, std::size_t states) {
  pairs_.clear();
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
      }
    }
  }
  if (!pairs_.empty()) fcl_adapter::growTogether<S>(pairs_);
}

// In one function: the three goals differ in what comes next and when it ends, but share each state's check.
template <typename S>
std::size_t Sweep<S>::run(const World<S>& world, const fcl::Transform3<S>* X_WM, std::size_t states, Goal goal,
                          std::uint8_t* hit, const std::vector<double>& orthogonality_errors) {
  const std::size_t moving = world.moving.size();
  if (goal == Goal::kAll) std::fill(hit, hit + states, std::uint8_t{0});
  if (states == 0 || moving == 0) return states;
  check_.start(world);
  check_.orthogonality_errors.assign(orthogonality_errors.begin(), orthogonality_errors.end());
  if (goal == Goal::kAll && states > 1 && world.grows_together) growForAll(world, X_WM, states);
  measure(world, X_WM, states);
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
    bool touches;
    const bool whole = part.end - part.begin > 1 && setFar(world, states, part, middle);
    if (!whole) std::fill(check_.far.begin(), check_.far.end(), 0.0);
    found_.clear();
    std::vector<Entry>* entries = whole ? &found_ : nullptr;
    if (part.has_list) {
      touches = check_.run(X, entries_.data() + part.first, entries_.data() + part.last, entries, nullptr);
      if (!whole) rest = part;
    } else {
      touches = check_.runAll(X, entries, nullptr);
    }
    if (whole) {
      rest.has_list = true;
      rest.first = entries_.size();
      for (const Entry& e : found_) {
        if (e.mask != 0) entries_.push_back(e);
      }
      rest.last = entries_.size();
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
