// SPDX-License-Identifier: BSD-3-Clause
#include "scene/edge.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <tuple>

#include "fcl/adapters/models.h"
#include "fcl/adapters/motion.h"
#include "fcl/adapters/validate.h"
#include "fcl/queries/scene_pair.h"
#include "scene/distance.h"
#include "scene/reach.h"

namespace bocst::scene {
namespace {

using fcl_adapter::poseAt;
using query::Motion;

/// Halvings of the way in search of what is near, before pairs are followed one by one.
constexpr int kHalvings = 2;

/// What passes closer than this share of the sizes is taken to touch, between two of FCL's geometries.
constexpr double kTouch = 1e-5;

/// No more than the distance of two of FCL's geometries. Its solvers may say more, each for other poses; shapes are
/// measured here, and of two octrees the lesser of both solvers' answers is taken.
template <typename S>
double leastDistance(const Object<S>& a, const fcl::Transform3<S>& X_WA, const Object<S>& b,
                     const fcl::Transform3<S>& X_WB) {
  const std::optional<double> known = fcl_adapter::distanceOfShapes<S>(*a.geometry, X_WA, *b.geometry, X_WB);
  if (known.has_value()) return *known;
  constexpr S kAny = std::numeric_limits<S>::max();
  return static_cast<double>(std::min(distanceBelow<S>(a, X_WA, b, X_WB, kAny, fcl::GST_LIBCCD),
                                      distanceBelow<S>(a, X_WA, b, X_WB, kAny, fcl::GST_INDEP)));
}

/// Planes and half-spaces have no bounds: where they turn, some of their points are arbitrarily fast.
template <typename S>
bool isPlane(const Object<S>& o) {
  const fcl::NODE_TYPE type = o.geometry->getNodeType();
  return type == fcl::GEOM_PLANE || type == fcl::GEOM_HALFSPACE;
}

/// One way of all moving objects.
template <typename S>
class Edge {
 public:
  Edge(const World<S>& world, StateCheck<S>& check, const fcl::Transform3<S>* begin, const fcl::Transform3<S>* end,
       fcl::CCDMotionType motion)
      : world_(world), check_(check), begin_(begin), end_(end), type_(motion) {
    check.start(world);
    for (std::size_t i = 0; i < world.moving.size(); ++i) {
      const Object<S>& o = world.moving[i];
      motions_.push_back(fcl_adapter::motionOf<S>(begin[i], end[i], motion));
      const Eigen::Vector3d center = motions_[i]->at(0) * o.bounds.center;
      speeds_.push_back(motions_[i]->fastest(center, o.bounds.radius, 0) * (1 + 1e-6));
      const bool is_straight = motion == fcl::CCDM_LINEAR || motion == fcl::CCDM_TRANS;
      velocities_.push_back(is_straight ? motions_[i]->at(1).translation() - motions_[i]->at(0).translation()
                                        : Eigen::Vector3d(0, 0, 0));
      double place = 0;
      double& orthogonality_error = check.orthogonality_errors[i];
      orthogonality_error = 1e-12;
      for (const fcl::Transform3<S>& X : {begin[i], end[i]}) {
        place = std::max(place, static_cast<double>(X.translation().template lpNorm<1>()));
        orthogonality_error = std::max(orthogonality_error, fcl_adapter::orthogonalityErrorOf<S>(X));
      }
      const Eigen::Vector3d origin = motions_[i]->at(0).translation();
      place += 2 * motions_[i]->fastest(origin, 0, 0);
      places_.push_back(place);
      // Poses on the way are rounded to S, which moves points by less than what is allowed for poses of such places.
      orthogonality_error = 2 * orthogonality_error + 8 * static_cast<double>(std::numeric_limits<S>::epsilon());
      check.reach[i] = 2 * world.reachWithin(o, place, orthogonality_error);
    }
  }

  bool isFree() {
    poses_.resize(world_.moving.size());
    if (touchesWithin(0, 1, nullptr, 0)) return false;
    const auto key = [](const PairAt& p) { return std::tuple(p.moving, p.group, p.lane); };
    std::sort(left_.begin(), left_.end(), [&](const PairAt& p, const PairAt& q) { return key(p) < key(q); });
    left_.erase(
        std::unique(left_.begin(), left_.end(), [&](const PairAt& p, const PairAt& q) { return key(p) == key(q); }),
        left_.end());
    return std::none_of(left_.begin(), left_.end(), [&](const PairAt& p) { return touchesOnWay(p); });
  }

 private:
  // True when something touches in the middle of a part of the way, or of its parts; what may touch elsewhere is left.
  bool touchesWithin(double from, double to, const std::vector<Entry>* list, int depth) {
    const double middle = (from + to) / 2;
    for (std::size_t i = 0; i < motions_.size(); ++i) {
      poses_[i] = poseAt<S>(*motions_[i], middle);
      check_.far[i] = speeds_[i] * (to - from) / 2;
    }
    std::vector<Entry> entries;
    const bool touches = list == nullptr
                             ? check_.runAll(poses_.data(), &entries)
                             : check_.run(poses_.data(), list->data(), list->data() + list->size(), &entries);
    if (touches) return true;
    entries.erase(std::remove_if(entries.begin(), entries.end(), [](const Entry& e) { return e.mask == 0; }),
                  entries.end());
    if (entries.empty()) return false;
    if (depth < kHalvings) {
      return touchesWithin(from, middle, &entries, depth + 1) || touchesWithin(middle, to, &entries, depth + 1);
    }
    for (const Entry& e : entries) {
      for (std::uint32_t lanes = e.mask; lanes != 0; lanes &= lanes - 1) {
        left_.push_back({e.moving, e.group, static_cast<std::uint32_t>(__builtin_ctz(lanes))});
      }
    }
    return false;
  }

  bool touchesOnWay(const PairAt& p) {
    const Object<S>&a = world_.moving[p.moving], &b = world_.object(p.group, p.lane);
    switch (fcl_adapter::kindOf<S>("edgeIsFree", a.geometry.get(), b.geometry.get())) {
      case fcl_adapter::PairKind::kForeign:
        return advance(p, a, b);
      case fcl_adapter::PairKind::kNothing:
        return false;
      case fcl_adapter::PairKind::kModel:
        break;
    }
    fcl::ContinuousCollisionRequest<S> request;
    request.ccd_motion_type = type_;
    request.toc_err = 2;  // any contact will do
    fcl::ContinuousCollisionResult<S> result;
    bocst::continuousCollide<S>(a.geometry.get(), begin_[p.moving], end_[p.moving], b.geometry.get(),
                                check_.pose(begin_, p.group, p.lane), check_.pose(end_, p.group, p.lane), request,
                                result);
    return result.is_collide;
  }

  // No distance between points of two moving objects changes faster. Origins move on lines, or their velocities are not
  // known and 0: then the speeds count in full. What is left of a speed is that of the turn about the origin. What one
  // joint turns moves together.
  double relativeSpeed(std::size_t i, std::size_t j) const {
    const double straight_i = velocities_[i].norm(), straight_j = velocities_[j].norm();
    const double rounding = 1e-14 * (straight_i + straight_j);
    const double by_origins = std::max(speeds_[i] - straight_i, 0.0) + std::max(speeds_[j] - straight_j, 0.0) +
                              (velocities_[i] - velocities_[j]).norm() + rounding;
    const Bounds &a = world_.moving[i].bounds, &b = world_.moving[j].bounds;
    if (a.kind != Bounds::kBox || b.kind != Bounds::kBox) return by_origins;
    const Eigen::Vector3d center_a = motions_[i]->at(0) * a.center, center_b = motions_[j]->at(0) * b.center;
    const double together =
        query::MotionPair(*motions_[i], *motions_[j]).fastest({center_a, a.radius}, {center_b, b.radius}, 0);
    return std::min(by_origins, together * (1 + 1e-6));
  }

  // Conservative advancement, of two of FCL's shapes and octrees: FCL's own may step over contacts.
  bool advance(const PairAt& p, const Object<S>& a, const Object<S>& b) {
    const bool fixed = world_.isFixed(p.group);
    const std::size_t j = fixed ? 0 : world_.movingIndex(p.group, p.lane);
    const double speed = fixed ? speeds_[p.moving] : relativeSpeed(p.moving, j);
    double size = 0;
    for (const Object<S>* o : {&a, &b}) {
      if (o->bounds.kind == Bounds::kBox) size += o->bounds.radius;
    }
    // Poses on the way, and FCL's distances, are rounded to S.
    const double place =
        places_[p.moving] + (fixed ? static_cast<double>(b.X_WG.translation().template lpNorm<1>()) : places_[j]);
    const double rounding = 64 * static_cast<double>(std::numeric_limits<S>::epsilon()) * place;
    const double near = kTouch * size + a.bounds.reach + b.bounds.reach + rounding;
    for (double time = 0;;) {
      const fcl::Transform3<S> X_WA = poseAt<S>(*motions_[p.moving], time);
      const fcl::Transform3<S> X_WB = fixed ? b.X_WG : poseAt<S>(*motions_[j], time);
      if (touch(a, X_WA, b, X_WB, result_)) return true;
      if (!a.geometry->isOccupied() || !b.geometry->isOccupied()) return false;
      if (isPlane(a) || (!fixed && isPlane(b))) {
        throw std::invalid_argument(
            "bocst::Scene::edgeIsFree: a Plane or Halfspace that moves needs a bocst::Model beside it");
      }
      const double gap = leastDistance<S>(a, X_WA, b, X_WB);
      if (gap <= near) return true;
      if (time >= 1 || gap >= speed * (1 - time) + near) return false;
      const double next = std::min(1.0, time + (gap - near / 2) / speed);
      if (!(next > time)) return true;  // nearer than the way is rounded
      time = next;
    }
  }

  const World<S>& world_;
  StateCheck<S>& check_;
  const fcl::Transform3<S>*begin_, *end_;
  const fcl::CCDMotionType type_;
  std::vector<std::unique_ptr<Motion>> motions_;
  std::vector<double> speeds_;
  std::vector<Eigen::Vector3d> velocities_;  // of origins that move on lines
  std::vector<double> places_;               // none on the way has coordinates that add up to more
  std::vector<fcl::Transform3<S>> poses_;
  std::vector<PairAt> left_;
  fcl::CollisionResult<S> result_;
};

}  // namespace

template <typename S>
bool edgeIsFree(const World<S>& world, StateCheck<S>& check, const fcl::Transform3<S>* begin,
                const fcl::Transform3<S>* end, fcl::CCDMotionType motion) {
  return Edge<S>(world, check, begin, end, motion).isFree();
}

#define BOCST_INSTANTIATE(S)                                                                                      \
  template bool edgeIsFree(const World<S>&, StateCheck<S>&, const fcl::Transform3<S>*, const fcl::Transform3<S>*, \
                           fcl::CCDMotionType);
BOCST_INSTANTIATE(float)
BOCST_INSTANTIATE(double)
#undef BOCST_INSTANTIATE

}  // namespace bocst::scene
