// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <limits>
#include <optional>
#include <type_traits>
#include <vector>

#include "geometry/convex_shape.h"
#include "geometry/extent.h"
#include "geometry/motion.h"
#include "geometry/triangle.h"
#include "query/ccd/hull_advance.h"
#include "query/distance/best_first.h"
#include "query/distance/near_triangles.h"
#include "query/sides/box_side.h"
#include "query/sides/side.h"
#include "query/sides/turns.h"
#include "query/sides/visitor.h"
#include "thread/of_thread.h"

namespace bocst::query {

/// What counts as contact of two bodies that move, and how well its time must be known.
struct ContactGoal {
  double margin = 0;    ///< What is no farther than this touches.
  double rounding = 0;  ///< And what is no farther than margin + rounding, for the sake of rounding: at least 1e-13 of
                        ///< the lengths on the way, and more than 0.
  double time_error = 0;  ///< The answer may be earlier than the contact by so much.
};

/// Finds when two moving sides first touch, by conservative advancement of each pair of nodes by itself: apart by a gap
/// along a direction, they cannot touch before the gap is closed at the largest speed along it that any of their points
/// can have. Best first by that time, so a pair is looked at again at the time when it might touch, and only its parts
/// from there on. No contact is stepped over, whatever the motions are.
///
/// Where leaves of side B are solid bodies (B::kBodies), what is inside one touches it.
///
/// All in world coordinates, in the unit of the meshes.
template <typename A, typename B>
class ContactTimeWalk : private BestFirst<ContactTimeWalk<A, B>, A, B> {
  using Base = BestFirst<ContactTimeWalk<A, B>, A, B>;

 public:
  using Base::gaveUp;
  using Base::steps;

  /// `a_in_body` and `b_in_body` lead from the sides' frames to those of the bodies that the motions are about, without
  /// turning.
  ContactTimeWalk(const A& a, const SimilarityTransform& a_in_body, const Motion& motion_a, const B& b,
                  const SimilarityTransform& b_in_body, const Motion& motion_b)
      : Base(a, b, scratch()), a_in_body_(a_in_body), b_in_body_(b_in_body), motions_(motion_a, motion_b) {}

  /// The time of the first contact, at most goal.time_error too early and never too late; infinite without contact.
  /// `known`: a time at which there is contact. After `most_steps` it gives up, and returns the first that it found.
  /// `begin`: there is no contact before.
  double run(const ContactGoal& goal, double known = kNever, std::size_t most_steps = kNoLimit, double begin = 0) {
    goal_ = goal;
    worth_waiting_ = worthWaiting();
    first_ = known;
    first_skipped_ = kNever;
    if constexpr (!B::kBodies) scratch().near.clear();
    this->limitSteps(most_steps);
    at(begin);
    this->search();
    return gaveUp() ? first_ : std::min(first_, first_skipped_);
  }

 private:
  friend Base;
  using Pair = typename Base::Pair;
  using Base::a_;
  using Base::b_;
  using Base::push;
  using Base::spheres;

  // A pair that can be put off by this much of the way is looked at again before its parts are; on a way of more than
  // kLongWay radii of the smaller side, by this much of kLongWay radii, but of no more than kMostShort parts of the
  // way.
  static constexpr double kWorthWaiting = 1.0 / 64, kLongWay = 4, kMostShort = 64;

  // Two leaves' primitives are tested for the time in which the leaves move by this share of their sizes, but at least
  // for kLeastWindow of the motion.
  static constexpr double kShareOfLeaves = 0.25, kLeastWindow = 1e-6;
  // Where more windows than this for each pair of triangles would follow, as on a long way in a narrow gap, all pairs
  // are followed to the end at once: most slide along each other, and take a step or two.
  static constexpr double kWindowsPerPair = 0.1;
  // Pairs of triangles that are apart by this share of the smaller leaf's size are not looked at one by one.
  static constexpr double kShareOfSmaller = 1.0 / 32;
  // Of two sizes squared: there a bound by single triangles pays.
  static constexpr double kMuchLarger = 4 * 4;

  static constexpr double kFar = std::numeric_limits<double>::infinity(), kNever = kFar;

  // Relative error of bounds: 40 roundings at most.
  static constexpr double kRounding = 1e-14;

  // Unit directions are off by less.
  static constexpr double kBlur = 1e-15;

  struct Primitive {
    Corners corners;
    std::size_t count = 0;  // 3: a triangle, 1: a ball about its first corner
    double radius = 0;
  };
  struct Convex : SweptHull {
    typename B::Node node;
  };
  struct Nothing {};
  using PrimitiveOfB = std::conditional_t<B::kBodies, Convex, Primitive>;
  struct Scratch : Base::Heap {
    std::vector<Primitive> a;
    std::vector<PrimitiveOfB> b;
    std::vector<Eigen::AlignedBox3d> boxes_a, boxes_b;
    std::conditional_t<B::kBodies, Nothing, NearTriangles<A, B>> near;
  };
  static Scratch& scratch() { return thread::ofThread<Scratch>(); }

  double worthWaiting() {
    at(0);
    const Sphere a = query::placed(a_.sphere(a_.root()), a_in_world_),
                 b = query::placed(b_.sphere(b_.root()), b_in_world_);
    const double way = speedOf(a, b, 0) / std::min(a.radius, b.radius);
    return way > kLongWay ? kWorthWaiting * std::max(kLongWay / way, 1 / kMostShort) : kWorthWaiting;
  }

  double contactDistance() const { return goal_.margin + goal_.rounding; }
  // Nodes go on to half of what counts as contact, as primitives do. So rounding, which is less than the other half,
  // cannot stop them before their primitives touch, and the first that do settle all that is no nearer.
  double clearance() const { return goal_.margin + goal_.rounding / 2; }
  bool worthIt(double time) {
    if (!(time <= 1 && time < first_)) return false;
    if (time < first_ - tie()) return true;
    first_skipped_ = std::min(first_skipped_, time);
    return false;
  }
  bool settled() const { return !(first_ > 0) || gaveUp(); }

  // Pairs that touch no earlier than this before the first contact are left out: of faces that land flat, all touch at
  // about the same time. The rest of goal_.time_error is for single pairs.
  double tie() const { return goal_.time_error / 2; }
  double scaleOfB() const { return b_in_body_.scale / a_in_body_.scale; }

  static SimilarityTransform placed(const SimilarityTransform& in_body, const Motion& motion, double time) {
    const Eigen::Isometry3d X = motion.at(time);
    SimilarityTransform p;
    p.rotation = X.linear();
    p.scale = in_body.scale;
    p.translation = X * in_body.translation;
    return p;
  }

  void at(double time) {
    if (time == now_) return;
    now_ = time;
    a_in_world_ = placed(a_in_body_, motions_.a(), time);
    b_in_world_ = placed(b_in_body_, motions_.b(), time);
    if constexpr (B::kBodies) world_in_b_ = b_in_world_.inverse();
  }

  // The time at which a gap along a direction, between two parts, may be closed.
  template <typename PartA, typename PartB>
  double whenClosed(double gap, const Eigen::Vector3d& direction, double blur, const PartA& a, const PartB& b) const {
    return gap > 0 ? now_ + motions_.timeToClose(gap, direction, blur, a, b, now_) * (1 - 1e-12) : now_;
  }

  double boundOf(const NodeExtent& a, const NodeExtent& b) {
    const Eigen::Vector3d t = b.center - a.center;
    const double apart = t.norm(), radius_a = kMostStretch * a.half.norm(), radius_b = kMostStretch * b.half.norm();
    const double rounding_margin = kRounding * (apart + radius_a + radius_b) + clearance();
    double best = now_;
    const auto consider = [&](Eigen::Vector3d direction) {
      double lo_a, hi_a, lo_b, hi_b, along = direction.dot(t);
      if (along < 0) {
        direction = -direction;
        along = -along;
      }
      a.along(direction, lo_a, hi_a);
      b.along(direction, lo_b, hi_b);
      const double gap = along + lo_b - hi_a - rounding_margin;
      if (gap > 0) {
        best = std::max(
            best, whenClosed(gap, direction, kBlur, MovingBall{a.center, radius_a}, MovingBall{b.center, radius_b}));
      }
      return !worthIt(best);
    };
    anyDirectionApart(a, b, consider);
    return best;
  }

  // Two balls stay apart as long as their middles do: turning does not matter to a ball.
  double boundOf(const Sphere& a, const Sphere& b) const {
    const Eigen::Vector3d t = b.center - a.center;
    const double apart = t.norm();
    const double gap = apart * (1 - kRounding) - (a.radius + b.radius) * (1 + kRounding) - clearance();
    return gap > 0 ? whenClosed(gap, t / apart, kBlur, MovingBall{a.center, 0}, MovingBall{b.center, 0}) : now_;
  }

  // What lies in a ball and a node of bodies, apart by a gap of the ball's middle or of other points in it.
  double boundOf(const SeparationResult& gap, double radius, const Sphere& ball, double radius_of_turn,
                 const Convex& b) const {
    const double far = gap.at_least * b_in_world_.scale;
    const double free = far * (1 - kRounding) - radius * (1 + kRounding) - clearance();
    if (!(free > 0)) return now_;
    const Eigen::Vector3d direction = -(b_in_world_.rotation * gap.normal);
    const Convex in_world = inWorld(b, b_in_world_);
    return whenClosed(free, direction, kBlur, MovingBall{ball.center, radius_of_turn}, hullOf(in_world));
  }

  // Of bodies the ball would be a poor bound: they are asked themselves.
  double boundOf(const Sphere& a, typename B::Node b) const {
    const Eigen::Vector3d center = world_in_b_ * a.center;
    return boundOf(b_.gap(b, {&center, 1}, kFar), a.radius, a, 0, convexOf(b));
  }

  // A body may be much smaller than the box about it.
  double bodyBound(const Pair& pair) const {
    const OrientedVolume box = oriented(a_.volume(pair.a));
    Eigen::Vector3d corners[8];
    cornersOf(box, a_in_world_, corners);
    for (Eigen::Vector3d& x : corners) x = world_in_b_ * x;
    const Sphere ball{a_in_world_ * box.center, kMostStretch * box.half.norm() * a_in_world_.scale};
    return boundOf(b_.gap(pair.b, {corners, 8}, kFar), 0, ball, ball.radius, convexOf(pair.b));
  }

  // A leaf that is much larger than the other node, as a room is beside a part in it, reaches all around that node:
  // its triangles are looked at one by one.
  double triangleBound(const Pair& pair) const {
    const double scale = scaleOfB(), size_a = a_.size(pair.a), size_b = b_.size(pair.b) * scale * scale;
    if (size_b >= kMuchLarger * size_a && b_.state(pair.b) == State::kLeaf) {
      return triangleBound(extentOfA(pair.a), b_, pair.b, b_in_world_, 1);
    }
    if (size_a >= kMuchLarger * size_b && a_.state(pair.a) == State::kLeaf) {
      return triangleBound(extentOfB(pair.b), a_, pair.a, a_in_world_, -1);
    }
    return now_;
  }
  // `sign`: 1 if the leaf is of side B.
  template <typename Side>
  double triangleBound(const NodeExtent& small, const Side& side, typename Side::Node leaf,
                       const SimilarityTransform& to_world, double sign) const {
    const double radius = kMostStretch * small.half.norm();
    double best = kNever;
    const auto triangles = side.triangles(leaf);
    for (std::size_t i = 0; i < triangles.count; ++i) {
      Corners t = side.corners(triangles.ids[i]);
      for (Eigen::Vector3d& x : t) x = to_world * x;
      const Eigen::Vector3d way = closestPoint(small.center, t) - small.center;
      const double apart = way.norm();
      if (!(apart > 0)) return now_;
      const Eigen::Vector3d direction = way / apart;
      double lo, hi;
      small.along(direction, lo, hi);
      const double begin = std::min(
          {direction.dot(t[0] - small.center), direction.dot(t[1] - small.center), direction.dot(t[2] - small.center)});
      const double largest = t[0].lpNorm<1>() + t[1].lpNorm<1>() + t[2].lpNorm<1>() + small.center.lpNorm<1>();
      const double gap = begin - hi - kRounding * (largest + radius) - clearance();
      if (!(gap > 0)) return now_;
      const MovingBall ball{small.center, radius};
      const MovingHull hull{t.data(), 3};
      best = std::min(best, sign > 0 ? whenClosed(gap, direction, kBlur, ball, hull)
                                     : whenClosed(gap, -direction, kBlur, hull, ball));
    }
    return best;
  }

  Convex convexOf(typename B::Node node) const {
    Convex convex;
    static_cast<SweptHull&>(convex) = b_.hull(node);
    convex.node = node;
    return convex;
  }

  NodeExtent extentOfA(typename A::Node n) const { return NodeExtent(a_.volume(n), a_in_world_); }
  NodeExtent extentOfB(typename B::Node n) const { return NodeExtent(b_.volume(n), b_in_world_); }
  Sphere sphereOfA(typename A::Node n) const { return stretched(query::placed(a_.sphere(n), a_in_world_)); }
  auto sphereOfB(typename B::Node n) const {
    if constexpr (B::kBodies) {
      return n;
    } else {
      return stretched(query::placed(b_.sphere(n), b_in_world_));
    }
  }

  bool again(const Pair& pair) {
    this->countSteps();
    at(pair.bound);
    double time = Base::boundOf(pair);
    if constexpr (B::kBodies) {
      if (!spheres() && !b_.hasExactBox(pair.b) && worthIt(time)) time = std::max(time, bodyBound(pair));
    } else if (!spheres() && time < now_ + worth_waiting_) {
      time = std::max(time, triangleBound(pair));
    }
    if (time < now_ + worth_waiting_) return !worthIt(time);
    push({time, pair.a, pair.b});
    return true;
  }

  // The primitives of a leaf, in the frame of their side.
  void fill(const B&, typename B::Node node, std::vector<Convex>& out) const { out.assign(1, convexOf(node)); }
  template <typename Side>
  void fill(const Side& side, typename Side::Node node, std::vector<Primitive>& out) const {
    if (side.isConservative()) {
      const Sphere s = side.cellSphere(node);
      out.resize(1);
      out[0].corners[0] = s.center;
      out[0].count = 1;
      out[0].radius = s.radius;
      return;
    }
    const auto triangles = side.triangles(node);
    out.resize(triangles.count);
    for (std::size_t i = 0; i < out.size(); ++i) {
      out[i].corners = side.corners(triangles.ids[i]);
      out[i].count = 3;
      out[i].radius = 0;
    }
  }

  // The primitives of two leaves, for as long as these take to go a part of their size: most are too far from each
  // other for that. Then the pair waits for its next turn. A single pair is followed to the end.
  void leaves(const Pair& pair) {
    if (triangles(pair)) return;
    Scratch& s = scratch();
    fill(a_, pair.a, s.a);
    fill(b_, pair.b, s.b);
    const Sphere a = boundsOf(s.a, a_in_world_, s.boxes_a), b = boundsOf(s.b, b_in_world_, s.boxes_b);
    const double speed = speedOf(a, b, pair.bound);
    const bool is_single = s.a.size() * s.b.size() == 1;
    const double gap = std::max(0.0, (a.center - b.center).norm() - a.radius - b.radius);
    const double window = is_single ? 2 : windowOf(gap + kShareOfLeaves * (a.radius + b.radius), speed);
    const double until = pair.bound + window;
    const double near = reachOf(window, speed, a, b);
    for (std::size_t i = 0; i < s.a.size(); ++i) {
      for (std::size_t j = 0; j < s.b.size(); ++j) {
        if (s.boxes_a[i].squaredExteriorDistance(s.boxes_b[j]) > near * near) continue;
        first_ = std::min(first_, firstContact(s.a[i], s.b[j], pair.bound, until));
      }
    }
    push({until, pair.a, pair.b});
  }

  // How fast points of two balls may close a gap from `time` on.
  double speedOf(const Sphere& a, const Sphere& b, double time) const {
    return motions_.fastest({a.center, a.radius}, {b.center, b.radius}, time);
  }
  static double windowOf(double way, double speed) { return speed > 0 ? std::max(kLeastWindow, way / speed) : 2; }
  // What is farther apart does not touch within a window.
  double reachOf(double window, double speed, const Sphere& a, const Sphere& b) const {
    return (window * speed + contactDistance()) * (1 + 1e-12) + 1e-14 * (a.center.norm() + b.center.norm());
  }

  // The same for several triangles, of which those near each other are found in float; false where float cannot. The
  // pair waits without a look at single triangles while all are apart by a part of the smaller leaf's size.
  bool triangles(const Pair& pair) {
    if constexpr (B::kBodies) {
      return false;
    } else {
      if (spheres() || a_.triangleCount(pair.a) * b_.triangleCount(pair.b) == 1) return false;
      const Sphere a = sphereOfA(pair.a), b = sphereOfB(pair.b);
      const double speed = speedOf(a, b, pair.bound);
      const SimilarityTransform world_in_a = a_in_world_.inverse();
      SimilarityTransform b_in_a;
      b_in_a.rotation = world_in_a.rotation * b_in_world_.rotation;
      b_in_a.scale = world_in_a.scale * b_in_world_.scale;
      b_in_a.translation = world_in_a * b_in_world_.translation;
      b_in_a.ready();
      // Beyond, squares of lengths may overflow in float.
      constexpr double kMost = 1e15;
      if (!(b_in_a.translation.norm() + 2 * lattice::kMiddle * (1 + b_in_a.scale) < kMost)) return false;
      const Eigen::Vector3f along =
          (a_in_world_.rotation.transpose() * (b.center - a.center).stableNormalized()).template cast<float>();
      const float direction[3] = {along[0], along[1], along[2]};
      NearTriangles<A, B>& near = scratch().near;
      const auto& nearest = near.find(a_, pair.a, b_, pair.b, b_in_a, direction, kMost, false);
      if (nearest.empty()) return false;
      const double part = kShareOfSmaller * std::min(a.radius, b.radius);
      const double free = nearest.front().at_least * a_in_world_.scale - reachOf(0, 0, a, b);
      if (free > part) {
        push({pair.bound + (speed > 0 ? free / speed * (1 - 1e-12) : 2), pair.a, pair.b});
        return true;
      }
      const double window = windowOf(2 * std::max(free, 0.0) + part, speed), until = pair.bound + window;
      const std::size_t pairs = a_.triangleCount(pair.a) * b_.triangleCount(pair.b);
      if (std::min(1.0, first_) - pair.bound > kWindowsPerPair * static_cast<double>(pairs) * window) {
        const double apart = hullsApartUntil(pair);
        if (apart > pair.bound + window) {
          push({apart, pair.a, pair.b});
        } else {
          followAll(pair);
        }
        return true;
      }
      Primitive p, q;
      p.count = q.count = 3;
      for (const auto& t : near.find(a_, pair.a, b_, pair.b, b_in_a, direction,
                                     reachOf(window, speed, a, b) / a_in_world_.scale, true)) {
        p.corners = a_.corners(t.a);
        q.corners = b_.corners(t.b);
        first_ = std::min(first_, firstContact(p, q, pair.bound, until));
      }
      push({until, pair.a, pair.b});
      return true;
    }
  }

  // A time before which the hulls of two leaves' triangles are apart; that of the pair where it is not much later. Of
  // flat leaves that slide along each other, all pairs of triangles are apart along one direction.
  double hullsApartUntil(const Pair& pair) {
    constexpr int kMostSteps = 8;
    constexpr std::size_t kStepsOfWalk = 8;  // that take as long as one
    constexpr double kWorthIt = 1.0 / 8;     // of the time that is left
    fill(a_, pair.a, scratch().a);
    fill(b_, pair.b, scratch().b);
    const auto place = [this](double time, auto& points_a, auto& points_b) {
      at(time);
      placeCorners(scratch().a, a_in_world_, points_a);
      placeCorners(scratch().b, b_in_world_, points_b);
    };
    HullAdvance hulls(motions_, clearance(), pair.bound);
    for (int step = 0; step < kMostSteps && hulls.time() < first_ && hulls.step(place); ++step) {
      this->countSteps(kStepsOfWalk);
    }
    at(pair.bound);
    return hulls.time() - pair.bound > kWorthIt * (1 - pair.bound) ? hulls.time() : pair.bound;
  }
  static void placeCorners(const std::vector<Primitive>& triangles, const SimilarityTransform& to,
                           std::vector<Eigen::Vector3d>& points) {
    points.clear();
    for (const Primitive& t : triangles) {
      for (const Eigen::Vector3d& corner : t.corners) points.push_back(to * corner);
    }
  }

  // Follows each pair of two leaves' triangles to the end.
  void followAll(const Pair& pair) {
    Primitive p, q;
    p.count = q.count = 3;
    const auto ids_a = a_.triangles(pair.a);
    const auto ids_b = b_.triangles(pair.b);
    for (std::size_t i = 0; i < ids_a.count; ++i) {
      p.corners = a_.corners(ids_a.ids[i]);
      for (std::size_t j = 0; j < ids_b.count; ++j) {
        q.corners = b_.corners(ids_b.ids[j]);
        first_ = std::min(first_, firstContact(p, q, pair.bound, 2));
      }
    }
  }

  // Boxes of all bodies in the world, and a ball about these.
  template <typename T>
  static Sphere boundsOf(const std::vector<T>& primitives, const SimilarityTransform& to,
                         std::vector<Eigen::AlignedBox3d>& boxes) {
    boxes.clear();
    Eigen::AlignedBox3d all;
    for (const T& primitive : primitives) {
      const T w = inWorld(primitive, to);
      Eigen::AlignedBox3d box(w.corners[0]);
      for (std::size_t k = 1; k < w.count; ++k) box.extend(w.corners[k]);
      const Eigen::Vector3d r = Eigen::Vector3d::Constant(w.radius);
      boxes.emplace_back(box.min() - r, box.max() + r);
      all.extend(boxes.back());
    }
    return {all.center(), all.diagonal().norm() / 2};
  }

  template <typename T>
  static T inWorld(const T& primitive, const SimilarityTransform& to) {
    T w = primitive;
    for (std::size_t k = 0; k < w.count; ++k) w.corners[k] = to * w.corners[k];
    w.radius *= to.scale;
    return w;
  }

  // How far two primitives are apart, and the unit way from p to q.
  double distanceOf(const Primitive& p, const Primitive& q, Eigen::Vector3d& direction) const {
    Eigen::Vector3d on_p = p.corners[0], on_q = q.corners[0];
    if (p.count == 3 && q.count == 3) {
      nearestPoints(p.corners, q.corners, on_p, on_q);
    } else if (p.count == 3) {
      on_p = closestPoint(on_q, p.corners);
    } else if (q.count == 3) {
      on_q = closestPoint(on_p, q.corners);
    }
    direction = on_q - on_p;
    const double length = direction.norm();
    if (length > 0) direction /= length;
    return std::max(0.0, length - p.radius - q.radius);
  }
  double distanceOf(const Primitive& p, const Convex& q, Eigen::Vector3d& direction) const {
    Corners x;
    for (std::size_t k = 0; k < p.count; ++k) x[k] = world_in_b_ * p.corners[k];
    const SeparationResult gap = b_.gap(q.node, {x.data(), static_cast<int>(p.count)}, kFar);
    direction = -(b_in_world_.rotation * gap.normal);
    return gap.isTouching() ? 0 : std::max(0.0, gap.at_least * b_in_world_.scale - p.radius);
  }

  template <typename T>
  static MovingHull hullOf(const T& primitive) {
    return {std::data(primitive.corners), primitive.count};
  }

  template <typename T>
  static double sizeOf(const T& b) {
    double size = b.radius;
    for (std::size_t k = 1; k < b.count; ++k) size = std::max(size, (b.corners[k] - b.corners[0]).norm());
    return size;
  }

  bool isContact(const Primitive& p, const PrimitiveOfB& q, double time) {
    at(time);
    Eigen::Vector3d direction;
    return distanceOf(inWorld(p, a_in_world_), inWorld(q, b_in_world_), direction) <= contactDistance();
  }

  // When two convex primitives that do not touch before `time` first do, if before `until`.
  double firstContact(const Primitive& p, const PrimitiveOfB& q, double time, double until) {
    std::size_t short_steps = 0;
    while (time < until && worthIt(time)) {
      this->countSteps();
      at(time);
      const Primitive pw = inWorld(p, a_in_world_);
      const PrimitiveOfB qw = inWorld(q, b_in_world_);
      Eigen::Vector3d direction;
      const double distance = distanceOf(pw, qw, direction);
      if (distance <= contactDistance()) return time;
      // The way is known as well as rounding lets it be.
      const double size = sizeOf(pw) + sizeOf(qw) + pw.corners[0].norm() + qw.corners[0].norm();
      const double blur = std::min(1.0, 8 * std::numeric_limits<double>::epsilon() * size / distance);
      // To half of what counts as contact, so that steps do not shrink for ever.
      const double gap = distance - contactDistance() + goal_.rounding / 2;
      double later;
      if constexpr (B::kBodies) {
        later = whenClosed(gap, direction, blur, hullOf(pw), hullOf(qw));
      } else {
        later = now_ + motions_.timeToTouch(gap, direction, blur, hullOf(pw), hullOf(qw), now_) * (1 - 1e-12);
      }
      if (!(later > time)) return time;
      // Close to a contact: if it is certain to come soon, the remaining steps can be skipped. While it does not come,
      // this is tested after 1, 2, 4, ... short steps.
      if (later - time < tie() && time + tie() <= 1) {
        const bool is_power = (short_steps & (short_steps - 1)) == 0;
        ++short_steps;
        if (is_power && isContact(p, q, time + tie())) return time;
      }
      time = later;
    }
    return kNever;
  }

  const SimilarityTransform a_in_body_, b_in_body_;
  const MotionPair motions_;
  ContactGoal goal_;
  double worth_waiting_ = kWorthWaiting;
  double now_ = -1, first_ = 0, first_skipped_ = 0;
  SimilarityTransform a_in_world_, b_in_world_, world_in_b_;  // at the time now_; the last for bodies only
};

/// When a tree and another side first touch. With exact answers, walks over blocks and over oriented boxes take turns:
/// parts that slide along each other are apart along an axis of such boxes.
template <typename B>
double findContactTime(const TreeSide& a, const SimilarityTransform& a_in_body, const Motion& motion_a, const B& b,
                       const SimilarityTransform& b_in_body, const Motion& motion_b, const ContactGoal& goal) {
  ContactTimeWalk<TreeSide, B> trees(a, a_in_body, motion_a, b, b_in_body, motion_b);
  if (!fitsBoxes(a) || !fitsBoxes(b)) return trees.run(goal);
  double time = std::numeric_limits<double>::infinity(), begin = 0;
  const MotionPair motions(motion_a, motion_b);
  std::optional<MeshHullAdvance> hulls;
  std::size_t steps_per_hulls = 0;  // of a walk, that take as long as one of the hulls
  if constexpr (std::is_same<B, TreeSide>::value) {
    // Bodies that pass each other usually do so with their hulls apart. To ask this many vertices takes about as long
    // as a step of a walk.
    constexpr std::size_t kFew = 32, kVerticesPerStep = 16, kMostVertices = 8192, kFirstSteps = 12;
    const std::shared_ptr<const Mesh>&mesh_a = a.tree().surface().mesh, &mesh_b = b.tree().surface().mesh;
    const bool are_here = mesh_a != nullptr && mesh_b != nullptr;
    const std::size_t vertices = are_here ? mesh_a->vertexCount() + mesh_b->vertexCount() : 0;
    if (are_here && vertices <= kMostVertices) {
      steps_per_hulls = std::max(kFew, vertices / kVerticesPerStep);
      time = trees.run(goal, time, steps_per_hulls);
      if (!trees.gaveUp()) return time;
      hulls.emplace(*mesh_a, *mesh_b, motions, goal.margin + goal.rounding);
      begin = hulls->run(kFirstSteps);
      if (begin > 1) return time;
    }
  }
  for (Turns turns(a, b, tree::Tree::Search::kContactTime, {256, 2048, 256, 1});; turns.next()) {
    time = trees.run(goal, time, turns.most(), begin);
    turns.tookOverBlocks(trees.steps(), trees.gaveUp());
    if (!trees.gaveUp()) return time;
    if (hulls) begin = hulls->run(turns.most() / steps_per_hulls);
    if (begin > 1) return time;
    if (!provideBoxes(a, b)) continue;
    const BoxSide boxes_a(a);
    const auto& boxes_b = boxesOf(b);
    ContactTimeWalk<BoxSide, std::decay_t<decltype(boxes_b)>> boxes(boxes_a, a_in_body, motion_a, boxes_b, b_in_body,
                                                                    motion_b);
    time = boxes.run(goal, time, turns.mostOverBoxes(), begin);
    if (boxes.gaveUp()) continue;
    turns.endedOverBoxes(boxes.steps());
    return time;
  }
}

}  // namespace bocst::query
