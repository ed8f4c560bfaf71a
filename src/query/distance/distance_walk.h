// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <type_traits>
#include <vector>

#include "geometry/convex_shape.h"
#include "geometry/extent.h"
#include "geometry/triangle.h"
#include "query/distance/best_first.h"
#include "query/distance/near_triangles.h"
#include "query/distance/node_gaps.h"
#include "query/sides/convex_side.h"
#include "query/sides/side.h"
#include "query/sides/turns.h"
#include "query/sides/visitor.h"
#include "thread/of_thread.h"

namespace bocst::query {

/// The nearest primitives of two sides that a walk has seen, in the frame of side A.
struct Nearest {
  double distance = std::numeric_limits<double>::infinity();
  std::uint64_t a = 0, b = 0;  ///< Triangles, or names of cells.
  Eigen::Vector3d on_a = Eigen::Vector3d::Zero(), on_b = Eigen::Vector3d::Zero();
};

/// How far a walk has to go.
struct DistanceGoal {
  double below = std::numeric_limits<double>::infinity();  ///< Only what is nearer is of interest.
  double absolute = 0, relative = 0;  ///< An answer that is too large by so much will do, as in FCL's canStop().
  /// If set, it is asked about all pairs of triangles nearer than `below`, until it returns true; then this pair is the
  /// answer, else there is none.
  Visitor* visitor = nullptr;
};

/// Looks for the nearest primitives of two sides: triangles with exact answers, spheres of the collision depth with
/// conservative ones.
template <typename A, typename B>
class DistanceWalk : private BestFirst<DistanceWalk<A, B>, A, B> {
  using Base = BestFirst<DistanceWalk<A, B>, A, B>;

 public:
  using Base::steps;

  DistanceWalk(const A& a, const B& b, const SimilarityTransform& b_in_a)
      : Base(a, b, scratch()), b_in_a_(b_in_a), a_in_b_(b_in_a.inverse()) {
    if constexpr (!B::kBodies) {
      const SimilarityTransform lattices = betweenLattices(b, b_in_a);
      in_float_ = PairFrames::isFine(lattices, lattices.scale < 1 ? b.meshTriangles() : a.meshTriangles());
    }
    if constexpr (kHasLanes) {
      if (in_float_) gaps_.emplace(a, b, b_in_a);
    }
  }

  /// True if the walk ended after its most steps, before it was sure.
  bool gaveUp() const { return limit_ > 0 && Base::gaveUp(); }

  /// `known`: an answer in hand. After `most_steps` it gives up, and returns the nearest so far.
  Nearest run(const DistanceGoal& goal, const Nearest& known = {}, std::size_t most_steps = kNoLimit) {
    goal_ = goal;
    limit_ = goal.below;
    this->limitSteps(most_steps);
    if constexpr (!B::kBodies) {
      scratch().near.clear();
      const NodeExtent root_a = extentOfA(a_.root()), root_b = extentOfB(b_.root());
      const double rounding = spheres() && !hasGaps() ? kSphereRounding : kExtentRounding;
      tie_ = 4 * rounding * ((root_b.center - root_a.center).norm() + root_a.half.sum() + root_b.half.sum());
    }
    found(known);
    if (hasGaps()) descendGreedily();
    if (!settled()) this->search();
    return best_;
  }

 private:
  friend Base;
  using Pair = typename Base::Pair;
  using Base::a_;
  using Base::b_;
  using Base::spheres;
  static constexpr bool kHasLanes = A::kHasLanes && B::kHasLanes;
  struct Nothing {};
  using Gaps =
      typename std::conditional_t<kHasLanes, std::common_type<NodeGaps<A, B>>, std::common_type<Nothing>>::type;

  struct Scratch : Base::Heap {
    std::vector<TriangleExtent> a, b;
    std::conditional_t<B::kBodies, Nothing, NearTriangles<A, B>> near;
  };
  static Scratch& scratch() { return thread::ofThread<Scratch>(); }

  // What is at this distance or beyond does not improve the answer by more than rounding, or than the caller lets go.
  // Where many pairs are equally near (faces that are parallel, triangles about a tip), none but the first is computed.
  double cutoff() const {
    const double needed = std::max(best_.distance - goal_.absolute, best_.distance / (1 + goal_.relative));
    return std::min(limit_, needed - std::min(tie_, kTieShare * needed));
  }
  bool worthIt(double bound) const { return bound < cutoff(); }
  double tie() const { return tie_; }
  bool hasGaps() const { return gaps_.has_value(); }
  bool settled() const { return !(limit_ > 0) || gaveUp(); }
  // Pairs that pass the bound of their boxes are bounded once more where that bound is poor: of a body, which may be
  // much smaller than its box; of a leaf beside a much smaller node, which may be nearer to the leaf's box than to its
  // triangles; and of spheres, where many pairs may be equally near, and float is too coarse to tell.
  bool again(const Pair& pair) {
    double bound = 0;
    if (spheres()) {
      if constexpr (kHasLanes) {
        if (!gaps_.has_value() || pair.bound + gaps_->doubt() < cutoff()) return false;
        bound = gaps_->ofSpheres(pair.a, pair.b, direction_, cutoff());
      } else {
        return false;
      }
    } else if constexpr (B::kBodies) {
      const OrientedVolume box = oriented(a_.volume(pair.a));
      if (steps() < kLongWalk || b_.hasExactBox(pair.b)) {
        bound = gapOnLine(b_, pair.b, box, a_in_b_) * b_in_a_.scale;
      } else {
        Eigen::Vector3d corners[8];
        cornersOf(box, a_in_b_, corners);
        bound = body_gaps_.gap(b_, pair.b, {corners, 8}, cutoff() * a_in_b_.scale).at_least * b_in_a_.scale;
      }
    } else {
      if (hasGaps()) return false;  // gapsOf() has seen to it
      const bool leaf_a = a_.state(pair.a) == State::kLeaf, leaf_b = b_.state(pair.b) == State::kLeaf;
      if (leaf_a == leaf_b) return false;
      const double size_a = a_.size(pair.a), size_b = b_.size(pair.b) * b_in_a_.scale * b_in_a_.scale;
      if (!isMuchLarger(leaf_a ? size_a : size_b, leaf_a ? size_b : size_a)) return false;
      bound = leaf_a ? boundOfLeaf(a_, pair.a, SimilarityTransform(), extentOfB(pair.b))
                     : boundOfLeaf(b_, pair.b, b_in_a_, extentOfA(pair.a));
    }
    // Rounding margins make bounds negative.
    if (!(bound > pair.bound + 1e-9 * std::abs(pair.bound))) return false;
    this->push({bound, pair.a, pair.b});
    return true;
  }

  // True if the bound by triangles of a leaf of size `large` is worth it for a node of size `small`, both squared. A
  // node that is hardly larger than a tie would be left out for the first of its triangles.
  bool isMuchLarger(double large, double small) const {
    return large >= kMuchLarger * small && small >= kManyTies * tie_ * tie_;
  }

  // No triangle of a leaf, placed in the frame of A, is nearer to the other side's node than this.
  template <typename Side>
  double boundOfLeaf(const Side& side, typename Side::Node leaf, const SimilarityTransform& place,
                     const NodeExtent& other) const {
    double bound = std::numeric_limits<double>::infinity();
    const auto triangles = side.triangles(leaf);
    for (std::size_t i = 0; i < triangles.count; ++i) {
      bound = std::min(bound, distanceBound(placed(side.corners(triangles.ids[i]), place), other));
    }
    return bound;
  }

  double scaleOfB() const { return b_in_a_.scale; }

  NodeExtent extentOfA(typename A::Node n) const { return NodeExtent(a_.volume(n), SimilarityTransform()); }
  NodeExtent extentOfB(typename B::Node n) const { return NodeExtent(b_.volume(n), b_in_a_); }

  double boundOf(const NodeExtent& a, const NodeExtent& b) {
    // Where each node holds a piece of surface, something is no farther than this. From bodies, distances are measured
    // in their own frame.
    if (B::kNodesContainSurface) exists(farthest(a, b) * (B::kBodies ? kMostStretch : 1));
    return distanceBound(a, b, direction_, cutoff());
  }

  Sphere sphereOfA(typename A::Node n) const { return a_.sphere(n); }
  // Of bodies the ball would be a poor bound: they are asked themselves.
  auto sphereOfB(typename B::Node n) const {
    if constexpr (B::kBodies) {
      return n;
    } else {
      return stretched(placed(b_.sphere(n), b_in_a_));
    }
  }

  static double boundOf(const Sphere& a, const Sphere& b) {
    return (a.center - b.center).norm() * (1 - kSphereRounding) - (a.radius + b.radius) * (1 + kSphereRounding);
  }
  double boundOf(const Sphere& a, typename B::Node body) const {
    const Sphere ball = stretched(placed(a, a_in_b_));
    const double extent = ball.radius * (1 + 1e-12);
    return (b_.gap(body, {&ball.center, 1}, cutoff() * a_in_b_.scale + extent).at_least - extent) * b_in_a_.scale;
  }

  // Sides with lanes have their bounds in SIMD.
  LaneGaps gapsOf(const Pair& pair, bool expands_a) {
    const State other = expands_a ? b_.state(pair.b) : a_.state(pair.a);
    bool beside = false;
    if (other == State::kLeaf && !spheres()) {
      const double size_a = a_.size(pair.a), size_b = b_.size(pair.b) * b_in_a_.scale * b_in_a_.scale;
      constexpr double kLane = 0.25;  // of the size of a node, squared
      beside = isMuchLarger(expands_a ? size_b : size_a, kLane * (expands_a ? size_a : size_b));
    }
    return expands_a ? gaps_->ofLanesOfA(pair.a, pair.b, beside) : gaps_->ofLanesOfB(pair.a, pair.b, beside);
  }
  template <typename F>
  void lanes(const Pair& pair, bool expands_a, F&& f) const {
    if (expands_a) {
      a_.pushLanes(pair.a, a_.lanes(pair.a), [&](typename A::Node c, int lane) { f(lane, c, pair.b); });
    } else {
      b_.pushLanes(pair.b, b_.lanes(pair.b), [&](typename B::Node c, int lane) { f(lane, pair.a, c); });
    }
  }

  void expand(const Pair& pair, bool expands_a) {
    if constexpr (kHasLanes) {
      if (gaps_.has_value()) {
        const LaneGaps gaps = gapsOf(pair, expands_a);
        lanes(pair, expands_a, [&](int o, typename A::Node a, typename B::Node b) {
          exists(double{gaps.at_most[o]});
          const Pair child{std::max(pair.bound, double{gaps.at_least[o]}), a, b};
          // The distance of two spheres costs less than a place on the heap.
          if (spheres() && a_.state(a) == State::kLeaf && b_.state(b) == State::kLeaf) {
            if (worthIt(child.bound)) leaves(child);
          } else {
            this->push(child);
          }
        });
        return;
      }
    }
    Base::expand(pair, expands_a);
  }

  // Straight down to a pair of leaves, if they are resident. With its answer in hand, and the direction in which it
  // was found, the search from the root on leaves most pairs out at once.
  void descendGreedily() {
    if constexpr (kHasLanes) {
      Pair pair{0, a_.root(), b_.root()};
      for (;;) {
        const State sa = a_.state(pair.a), sb = b_.state(pair.b);
        if (sa == State::kLeaf && sb == State::kLeaf) return leaves(pair);
        const bool expands_a = this->expandsA(pair, sa, sb);
        if ((expands_a ? sa : sb) == State::kGrows) return;
        const LaneGaps gaps = gapsOf(pair, expands_a);
        float least = std::numeric_limits<float>::infinity();
        Pair next = pair;
        lanes(pair, expands_a, [&](int o, typename A::Node a, typename B::Node b) {
          const float guess = gaps.at_least[o] + gaps.at_most[o];
          if (!(guess < least)) return;
          least = guess;
          next = {gaps.at_least[o], a, b};
        });
        // A cell at the edge of what is grey may have no grey octants.
        if (!std::isfinite(least)) return;
        pair = next;
      }
    }
  }

  void found(const Nearest& n) {
    if (!(n.distance < std::min(best_.distance, goal_.below))) return;
    best_ = n;
    exists(n.distance);
    expect(n);
  }

  // Something is no farther than this.
  void exists(double distance) {
    if (goal_.visitor == nullptr) limit_ = std::min(limit_, distance);
  }

  // Bounds along the direction of the nearest pair are the best ones.
  void expect(const Nearest& n) {
    if (!(n.distance > 0)) return;
    direction_ = (n.on_b - n.on_a) / n.distance;
    if constexpr (kHasLanes) {
      if (gaps_.has_value()) gaps_->expect(direction_);
    }
  }

  void leaves(const Pair& pair) {
    this->countSteps();
    if constexpr (B::kBodies) {
      leafBody(pair);
    } else {
      leafPair(pair);
    }
  }

  void leafBody(const Pair& pair) {
    if (a_.isConservative()) {
      const Sphere in_a = a_.cellSphere(pair.a), ball = placed(in_a, a_in_b_);
      const SeparationResult gap = b_.gap(pair.b, {&ball.center, 1}, cutoff() * a_in_b_.scale + ball.radius);
      if (std::isfinite(gap.distance)) bodyFound(a_.cellId(pair.a), pair.b, gap, ball.center, ball.radius);
      return;
    }
    const auto triangles = a_.triangles(pair.a);
    for (std::size_t i = 0; i < triangles.count; ++i) {
      const std::uint32_t t = triangles.ids[i];
      const Corners corners = placed(a_.corners(t), a_in_b_);
      const PointSet points{corners.data(), 3};
      const SeparationResult gap = body_gaps_.gap(b_, pair.b, points, cutoff() * a_in_b_.scale);
      if (std::isfinite(gap.distance)) bodyFound(t, pair.b, gap, gap.on_points, 0);
    }
  }

  // What is within `radius` of `point`, in the frame of B, is the gap away from a body.
  void bodyFound(std::uint64_t a, typename B::Node b, const SeparationResult& gap, const Eigen::Vector3d& point,
                 double radius) {
    Nearest n;
    n.a = a;
    n.b = b_.id(b);
    const double distance = std::max(gap.distance - radius, 0.0);
    const Eigen::Vector3d on_body = gap.isTouching() ? point : gap.on_body;
    n.distance = distance * b_in_a_.scale;
    n.on_b = b_in_a_ * on_body;
    // Straight on towards the body, by the radius at most.
    const double part = gap.distance > 0 ? std::min(radius / gap.distance, 1.0) : 0;
    n.on_a = b_in_a_ * Eigen::Vector3d(point + part * (on_body - point));
    found(n);
  }

  void leafPair(const Pair& pair) {
    if (spheres()) {
      leafSpheres(pair);
      return;
    }
    Scratch& s = scratch();
    if (in_float_) {
      leafPairInFloat(pair, s.near);
      return;
    }
    fill(a_, pair.a, SimilarityTransform(), s.a);
    fill(b_, pair.b, b_in_a_, s.b);
    // The pair of nearest middles first: a good answer makes most of the others superfluous.
    std::size_t first_a = 0, first_b = 0;
    double nearest = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < s.a.size(); ++i) {
      for (std::size_t j = 0; j < s.b.size(); ++j) {
        const double d = (s.a[i].middle() - s.b[j].middle()).squaredNorm();
        if (d < nearest) nearest = d, first_a = i, first_b = j;
      }
    }
    triangles(s.a[first_a], s.b[first_b]);
    for (TriangleExtent& t : s.a) t.along(direction_);
    for (TriangleExtent& t : s.b) t.along(direction_);
    for (const TriangleExtent& t : s.a) {
      for (const TriangleExtent& u : s.b) {
        if (worthIt(u.lowest - t.highest) && !isBeyond(t, u, cutoff())) triangles(t, u);
      }
    }
  }

  template <typename Near>
  void leafPairInFloat(const Pair& pair, Near& near) {
    const float direction[3] = {static_cast<float>(direction_[0]), static_cast<float>(direction_[1]),
                                static_cast<float>(direction_[2])};
    const bool all = goal_.visitor != nullptr;
    for (const auto& candidate : near.find(a_, pair.a, b_, pair.b, b_in_a_, direction, cutoff(), all)) {
      if (!worthIt(candidate.at_least)) break;
      triangles(candidate.a, candidate.b);
    }
  }

  template <typename Side, typename Node>
  static void fill(const Side& side, Node node, const SimilarityTransform& place, std::vector<TriangleExtent>& out) {
    const auto triangles = side.triangles(node);
    out.resize(triangles.count);
    for (std::size_t i = 0; i < out.size(); ++i) {
      out[i].id = triangles.ids[i];
      out[i].corners = placed(side.corners(out[i].id), place);
      out[i].ready();
    }
  }

  void triangles(const TriangleExtent& t, const TriangleExtent& u) { triangles(t.id, t.corners, u.id, u.corners); }

  void triangles(std::uint32_t t, std::uint32_t u) { triangles(t, a_.corners(t), u, placed(b_.corners(u), b_in_a_)); }

  void triangles(std::uint32_t t, const Corners& in_a, std::uint32_t u, const Corners& of_b) {
    this->countSteps();
    const auto along = [this](const Corners& c) {
      return Eigen::Vector3d(direction_.dot(c[0]), direction_.dot(c[1]), direction_.dot(c[2]));
    };
    if (along(of_b).minCoeff() - along(in_a).maxCoeff() >= cutoff()) return;
    this->countSteps(kExactTest);
    Nearest n;
    n.a = t;
    n.b = u;
    n.distance = nearestPoints(in_a, of_b, n.on_a, n.on_b);
    if (goal_.visitor == nullptr) return found(n);
    if (n.distance < goal_.below && goal_.visitor->triangles(t, u, false)) {
      best_ = n;
      limit_ = 0;
    } else if (n.distance < nearest_refused_) {
      nearest_refused_ = n.distance;
      expect(n);
    }
  }

  void leafSpheres(const Pair& pair) {
    const SimilarityTransform here;
    if (a_.isConservative() && b_.isConservative()) {
      spheresFound({a_.cellId(pair.a), a_.cellSphere(pair.a)},
                   {b_.cellId(pair.b), placed(b_.cellSphere(pair.b), b_in_a_)});
    } else if (a_.isConservative()) {
      const CellLeaf ball{a_.cellId(pair.a), a_.cellSphere(pair.a)};
      const auto triangles = b_.triangles(pair.b);
      for (std::size_t i = 0; i < triangles.count; ++i) {
        spheresFound(ball, pointOf(b_, triangles.ids[i], b_in_a_, ball.sphere.center));
      }
    } else {
      const CellLeaf ball{b_.cellId(pair.b), placed(b_.cellSphere(pair.b), b_in_a_)};
      const auto triangles = a_.triangles(pair.a);
      for (std::size_t i = 0; i < triangles.count; ++i) {
        spheresFound(pointOf(a_, triangles.ids[i], here, ball.sphere.center), ball);
      }
    }
  }

  // A triangle is a sphere without radius, at its point nearest to the other.
  template <typename Side>
  static CellLeaf pointOf(const Side& side, std::uint32_t t, const SimilarityTransform& place,
                          const Eigen::Vector3d& to) {
    return {t, {closestPoint(to, placed(side.corners(t), place)), 0}};
  }

  void spheresFound(const CellLeaf& a, const CellLeaf& b) {
    Nearest n;
    n.a = a.id;
    n.b = b.id;
    const Eigen::Vector3d displacement = b.sphere.center - a.sphere.center;
    const double apart = displacement.norm();
    const Eigen::Vector3d direction = apart > 0 ? Eigen::Vector3d(displacement / apart) : Eigen::Vector3d::UnitX();
    n.distance = std::max(apart - a.sphere.radius - b.sphere.radius, 0.0);
    n.on_a = a.sphere.center + std::min(a.sphere.radius, apart) * direction;
    n.on_b = n.on_a + n.distance * direction;
    found(n);
  }

  static constexpr double kSphereRounding = 1e-14;  // of the distance of two spheres
  static constexpr double kTieShare = 1e-3;     // of a distance: what is next to nothing is found as exactly as before
  static constexpr double kMuchLarger = 4 * 4;  // of two sizes squared: there the better bound of a leaf pays
  static constexpr double kManyTies = 1e4 * 1e4;  // of a size squared over a tie squared
  static constexpr std::size_t kLongWalk = 8;     // steps, from which on the best bound beside a body pays
  static constexpr std::size_t kExactTest = 2;    // steps in the time that the distance of two triangles takes

  const SimilarityTransform& b_in_a_;
  const SimilarityTransform a_in_b_;
  std::optional<Gaps> gaps_;
  bool in_float_ = false;  // floats can tell the triangles of both sides apart
  DistanceGoal goal_;
  Nearest best_;
  GapFinder body_gaps_;
  double limit_ = 0;  // something at least this near exists, or nobody asks for more
  double tie_ = 0;    // what is nearer by no more is as near
  double nearest_refused_ = std::numeric_limits<double>::infinity();  // by the visitor, or beyond `below`
  Eigen::Vector3d direction_ =
      Eigen::Vector3d::Zero();  // from side A to side B where they are nearest so far, unit length
};

/// The nearest primitives of a tree and another side that is no body. With exact answers, takes turns with a walk over
/// oriented boxes.
template <typename B>
Nearest findNearest(const TreeSide& a, const B& b, const SimilarityTransform& b_in_a, const DistanceGoal& goal) {
  DistanceWalk<TreeSide, B> trees(a, b, b_in_a);
  if (!fitsBoxes(a) || !fitsBoxes(b)) return trees.run(goal);
  Nearest nearest;
  for (Turns turns(a, b, tree::Tree::Search::kDistance, {1024, 1024, 1024, 4});; turns.next()) {
    nearest = trees.run(goal, nearest, turns.most());
    turns.tookOverBlocks(trees.steps(), trees.gaveUp());
    if (!trees.gaveUp()) return nearest;
    if (!provideBoxes(a, b)) continue;
    const BoxSide boxes_a(a);
    const auto& boxes_b = boxesOf(b);
    DistanceWalk<BoxSide, std::decay_t<decltype(boxes_b)>> boxes(boxes_a, boxes_b, b_in_a);
    nearest = boxes.run(goal, nearest, turns.mostOverBoxes());
    if (boxes.gaveUp()) continue;
    turns.endedOverBoxes(boxes.steps());
    return nearest;
  }
}

}  // namespace bocst::query
