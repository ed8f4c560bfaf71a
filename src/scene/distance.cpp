// SPDX-License-Identifier: BSD-3-Clause
#include "scene/distance.h"

#include <bocst/fcl.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <stdexcept>
#include <tuple>

#include "fcl/adapters/models.h"
#include "fcl/queries/scene_pair.h"
#include "scene/reach.h"
#include "thread/of_thread.h"

namespace bocst::scene {
namespace {

constexpr float kMost = std::numeric_limits<float>::max();

/// The next number after x as a float.
float above(double x) {
  return std::nextafter(static_cast<float>(std::min<double>(x, kMost)), std::numeric_limits<float>::infinity());
}

}  // namespace

template <typename S>
S distanceBelow(const Object<S>& a, const fcl::Transform3<S>& X_WA, const Object<S>& b, const fcl::Transform3<S>& X_WB,
                S below, fcl::GJKSolverType solver, fcl::Vector3<S>* points) {
  fcl::DistanceRequest<S> request;
  request.gjk_solver_type = solver;
  request.enable_nearest_points = points != nullptr;
  fcl::DistanceResult<S> result;
  const bool has_model = a.model != nullptr || b.model != nullptr;
  if (has_model) {
    result.min_distance = below;
  } else {
    const std::optional<fcl_adapter::PlaneDistance> known =
        fcl_adapter::distanceToPlane<S>(*a.geometry, X_WA, *b.geometry, X_WB);
    if (known.has_value()) {
      for (int i = 0; i < 2 && points != nullptr; ++i) points[i] = known->nearest_points[i].template cast<S>();
      return static_cast<S>(known->distance);
    }
  }
  // FCL's distance of two shapes may be too large, and its points not the nearest.
  constexpr S kLargest = std::numeric_limits<S>::max();
  std::optional<double> known;
  if (!has_model) known = fcl_adapter::distanceOfShapes<S>(*a.geometry, X_WA, *b.geometry, X_WB);
  if (known.has_value() && points == nullptr) {
    return *known < static_cast<double>(kLargest) ? static_cast<S>(*known) : kLargest;
  }
  const S d = bocst::distance<S>(a.geometry.get(), X_WA, b.geometry.get(), X_WB, request, result);
  if (!has_model && result.o1 == nullptr && !(d < kLargest)) {
    throw std::invalid_argument("bocst::Scene: FCL computes no distance of " +
                                fcl_adapter::typeName<S>(a.geometry.get()) + " and " +
                                fcl_adapter::typeName<S>(b.geometry.get()));
  }
  if (points != nullptr) std::copy_n(result.nearest_points, 2, points);
  if (!known.has_value()) return std::max(d, S(0));
  fcl_adapter::improvePoints<S>(*a.geometry, X_WA, *b.geometry, X_WB, *known, points);
  return static_cast<S>(*known);
}

template <typename S>
S clearance(const World<S>& world, StateCheck<S>& check, const fcl::Transform3<S>* X_WM, S at_most, PairAt& nearest) {
  check.start(world);
  check.place(X_WM);
  struct Candidate {
    float gap;
    PairAt pair;
  };
  struct Lists {
    std::vector<Candidate> candidates;
    std::vector<std::uint64_t> asked;
  };
  std::vector<Candidate>& candidates = thread::ofThread<Lists>().candidates;
  std::vector<std::uint64_t>& asked = thread::ofThread<Lists>().asked;  // in earlier rounds, sorted
  asked.clear();
  const auto nameOf = [](const PairAt& p) {
    return std::uint64_t{p.moving} << 32 | std::uint64_t{8 * p.group + p.lane};
  };
  S least = at_most;
  // Pairs of boxes are listed in rounds, each with a longer reach, so most are never listed. Once something was found,
  // the next round, as long as that, is the last.
  constexpr float kLonger = 4;
  const float guess = std::max(static_cast<float>(check.clearance_guess), std::numeric_limits<float>::min());
  for (float reach = std::min(guess, above(static_cast<double>(least)));;
       reach = std::min(kLonger * reach, above(static_cast<double>(least)))) {
    const bool is_last = !(reach < kUnboxedSize);
    if (is_last) reach = kMost;
    candidates.clear();
    for (const NearGroup& n : check.findNear(reach)) {
      for (std::uint32_t left = n.mask; left != 0; left &= left - 1) {
        const PairAt pair{n.box, n.group, static_cast<std::uint32_t>(__builtin_ctz(left))};
        if (std::binary_search(asked.begin(), asked.end(), nameOf(pair))) continue;
        candidates.push_back({n.gap[pair.lane], pair});
      }
    }
    std::sort(candidates.begin(), candidates.end(),
              [](const Candidate& p, const Candidate& q) { return p.gap < q.gap; });
    for (const Candidate& c : candidates) {
      if (static_cast<double>(c.gap) >= static_cast<double>(least)) break;
      asked.push_back(nameOf(c.pair));
      const Object<S>&a = world.moving[c.pair.moving], &b = world.object(c.pair.group, c.pair.lane);
      const S d = distanceBelow<S>(a, X_WM[c.pair.moving], b, check.pose(X_WM, c.pair.group, c.pair.lane), least);
      if (!(d < least)) continue;
      least = d;
      nearest = c.pair;
      if (!(least > 0)) return least;
    }
    if (is_last || static_cast<double>(least) <= static_cast<double>(reach)) break;
    std::sort(asked.begin(), asked.end());
  }
  const auto found = static_cast<double>(least);
  if (found < kUnboxedSize) check.clearance_guess = std::max(found, check.clearance_guess / kLonger);
  return least;
}

template <typename S>
std::vector<PairDistance<S>> pairsWithin(const World<S>& world, StateCheck<S>& check, const fcl::Transform3<S>* X_WM,
                                         S distance) {
  check.start(world);
  check.place(X_WM);
  const auto most = static_cast<double>(distance);
  constexpr S kAny = std::numeric_limits<S>::max();
  std::vector<PairDistance<S>> found;
  for (const NearGroup& n : check.findNear(most < kUnboxedSize ? above(most) : kMost)) {
    for (std::uint32_t left = n.mask; left != 0; left &= left - 1) {
      const auto lane = static_cast<std::uint32_t>(__builtin_ctz(left));
      const Object<S>&a = world.moving[n.box], &b = world.object(n.group, lane);
      // A search below a bound may miss what is less than it by rounding alone.
      constexpr double kRounding = 1024 * static_cast<double>(std::numeric_limits<S>::epsilon());
      const double below = most + kRounding * (most + a.bounds.size + b.bounds.size);
      const S limit = below < static_cast<double>(kAny) ? static_cast<S>(below) : kAny;
      PairDistance<S> pair;
      pair.distance = distanceBelow<S>(a, X_WM[n.box], b, check.pose(X_WM, n.group, lane), limit, fcl::GST_LIBCCD,
                                       pair.nearest_points);
      if (!(pair.distance < limit)) continue;
      pair.pair = {a.id, b.id};
      found.push_back(pair);
    }
  }
  std::sort(found.begin(), found.end(), [](const PairDistance<S>& p, const PairDistance<S>& q) {
    return std::tie(p.distance, p.pair.a, p.pair.b) < std::tie(q.distance, q.pair.a, q.pair.b);
  });
  return found;
}

#define BOCST_INSTANTIATE(S)                                                                                         \
  template S distanceBelow(const Object<S>&, const fcl::Transform3<S>&, const Object<S>&, const fcl::Transform3<S>&, \
                           S, fcl::GJKSolverType, fcl::Vector3<S>*);                                                 \
  template S clearance(const World<S>&, StateCheck<S>&, const fcl::Transform3<S>*, S, PairAt&);                      \
  template std::vector<PairDistance<S>> pairsWithin(const World<S>&, StateCheck<S>&, const fcl::Transform3<S>*, S);
BOCST_INSTANTIATE(float)
BOCST_INSTANTIATE(double)
#undef BOCST_INSTANTIATE

}  // namespace bocst::scene
