// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <type_traits>
#include <utility>
#include <vector>

#include "geometry/extent.h"
#include "geometry/triangle.h"
#include "log/assert.h"
#include "query/collide/deferred_pairs.h"
#include "query/leaf/leaf_pairs.h"
#include "query/sides/convex_side.h"
#include "query/sides/turns.h"
#include "query/sides/visitor.h"
#include "thread/of_thread.h"

namespace bocst::query {

/// The walk over pairs of nodes. Resident pairs first, depth first. If the visitor has a cut, the walk goes on in the
/// cut's order once as many contacts are known as are wanted (isCut()), so that nothing is visited that lies beyond the
/// last of them. A pair that needs an unexpanded node is deferred. When the resident pairs do not settle the question,
/// nodes deferred grow in one batch and the walk goes on with their pairs, one level down.
///
/// Triangles against triangles are culled by boxes and slabs; where a side answers with cells, both are culled by
/// spheres, in double and on integer cells, so a conservative verdict does not depend on what is resident. Two such
/// sides have SphereWalk; a tree with cells beside one with triangles has TreeWalk.
///
/// Where leaves of side B are solid bodies (B::kBodies), the visitor is a ConvexVisitor, and spheres meet the bodies
/// themselves.
template <typename A, typename B>
class PairWalk {
  using V = VisitorOf<B>;

 public:
  /// `b_in_a` places side B's frame in side A's. Scratch memory is kept by the thread between walks.
  PairWalk(const A& a, const B& b, const SimilarityTransform& b_in_a, V& visitor)
      : a_(a),
        b_(b),
        b_in_a_(b_in_a),
        a_in_b_(b_in_a.inverse()),
        visitor_(visitor),
        spheres_(a.isConservative() || b.isConservative()),
        cut_(visitor.cut()) {
    if constexpr (!B::kBodies) BOCST_ASSERT(!a.isConservative() || !b.isConservative());
  }

  /// True when the visitor ended it.
  bool run() { return run(kNoLimit).met; }
  /// The same, but gives up after so many steps: a pair of nodes is one, and tests of triangles are more.
  WalkEnd run(std::size_t most_steps) {
    most_steps_ = most_steps;
    const bool ended = search();
    return {ended && !gave_up_, steps_, gave_up_};
  }

  /// Over complete trees with exact answers: pairs of leaves come in an order that culling does not change, and the
  /// visitor is told when all of a pair has come. Gives up after so many pairs of leaves.
  WalkEnd runInOrder(std::size_t most_leaf_pairs) {
    in_order_ = true;
    most_leaf_pairs_ = most_leaf_pairs;
    cut_ = nullptr;
    return run(kNoLimit);
  }

 private:
  using Pair = typename DeferredPairs<A, B>::Pair;

  bool search() {
    Scratch& s = scratch();
    s.stack.clear();
    s.ordered.clear();
    s.deferred.clear();
    s.leaves.start(b_in_a_, a_in_b_, visitor_.endsAtFirst(), cut_);
    s.large_a.clear();
    s.large_b.clear();
    const Pair root{a_.root(), b_.root()};
    if (!rootsMeet(root)) return false;
    s.stack.push_back(root);
    for (;;) {
      Pair pair;
      while (isCut() ? popFirst(s, pair) : popLast(s, pair)) {
        if (spheres_ ? stepSpheres(pair, s) : stepBoxes(pair, s)) return true;
        if (++steps_ < most_steps_) continue;
        gave_up_ = true;
        return false;
      }
      if (cut_ != nullptr) s.deferred.dropIf([this](const Pair& p) { return isBeyond(placeOf(p)); });
      if (s.deferred.empty()) return false;
      const bool may_end = visitor_.endsAtFirst() || cut_ != nullptr;
      s.deferred.grow(a_, b_, b_in_a_, may_end, [&s](const Pair& p) { s.stack.push_back(p); });
      seen_a_.valid = seen_b_.valid = least_a_.valid = least_b_.valid = leaf_known_ = false;
    }
  }

  struct PlacedPair {
    double place;
    Pair pair;
    bool operator<(const PlacedPair& other) const { return place > other.place; }  // the front of a heap is the first
  };
  // Of leaves of `Side`, beside nodes of `Other`.
  template <typename Side, typename Other>
  using LargeLeaf = std::conditional_t<Other::kHasLanes, TriangleBoxes<Side>, LargeTriangleLeaf<Side>>;
  struct Scratch {
    std::vector<Pair> stack;
    std::vector<PlacedPair> ordered;  // a heap; the walk's pairs once isCut()
    DeferredPairs<A, B> deferred;
    LeafPairs<A, B> leaves;
    LargeLeaf<A, B> large_a;
    LargeLeaf<B, A> large_b;
    std::vector<TriangleExtent> leaf;  // beside bodies
  };
  static Scratch& scratch() { return thread::ofThread<Scratch>(); }

  static bool popLast(Scratch& s, Pair& pair) {
    if (s.stack.empty()) return false;
    pair = s.stack.back();
    s.stack.pop_back();
    return true;
  }

  // Takes what was pushed into the heap, and the first of that, unless it is beyond the cut.
  bool popFirst(Scratch& s, Pair& pair) {
    for (const Pair& pushed : s.stack) {
      const double place = placeOf(pushed);
      if (isBeyond(place)) continue;
      s.ordered.push_back({place, pushed});
      std::push_heap(s.ordered.begin(), s.ordered.end());
    }
    s.stack.clear();
    if (s.ordered.empty() || isBeyond(s.ordered.front().place)) return false;
    std::pop_heap(s.ordered.begin(), s.ordered.end());
    pair = s.ordered.back().pair;
    s.ordered.pop_back();
    return true;
  }

  // The least that Cut knows of a pair: along its axis, or the least id of its cells.
  double placeOf(const Pair& pair) {
    if (!spheres_) {
      // The pairs of a step share a node.
      if (!least_a_.valid || !(least_a_.node == pair.a)) {
        least_a_ = {pair.a, true, cut_->leastOf(a_.volume(pair.a))};
      }
      if (!least_b_.valid || !(least_b_.node == pair.b)) {
        least_b_ = {pair.b, true, cut_->leastOf(b_.volume(pair.b), b_in_a_)};
      }
      return std::max(least_a_.least, least_b_.least);
    }
    if constexpr (std::is_same<A, TreeSide>::value) {
      if (a_.isConservative()) return static_cast<double>(a_.firstCellId(pair.a));
    }
    if constexpr (std::is_same<B, TreeSide>::value) {
      if (b_.isConservative()) return static_cast<double>(b_.firstCellId(pair.b));
    }
    return 0;
  }

  // True once as many contacts are known as are wanted: before, depth first is the quickest.
  bool isCut() const {
    return cut_ != nullptr && (spheres_ ? cut_->last_cell != ~std::uint64_t{0} : std::isfinite(cut_->last));
  }
  bool isBeyond(double place) const {
    return spheres_ ? place > static_cast<double>(cut_->last_cell) : cut_->isBeyond(place);
  }

  bool rootsMeet(const Pair& root) const {
    return spheres_ ? sphereMeets(a_.sphere(root.a), root.b)
                    : !boxesApart(oriented(a_.volume(root.a)), oriented(b_.volume(root.b)), b_in_a_);
  }

  Sphere inA(const Sphere& s) const { return placed(s, b_in_a_); }

  bool spheresMeet(const Sphere& a, const Sphere& b) const { return query::spheresMeet(a, b, b_in_a_.tolerance); }

  bool sphereMeets(const Sphere& a, typename B::Node b) const { return !(gapTo(a, b) > 0); }

  // How far a sphere is at least from a node of B, or above 0 if they do not touch; in units of B.
  double gapTo(const Sphere& a, typename B::Node b) const {
    const Sphere s = placed(a, a_in_b_);
    const double extent = s.radius * (1 + 1e-12) + a_in_b_.tolerance;
    if constexpr (B::kBodies) {
      return b_.gap(b, {&s.center, 1}, extent).at_least - extent;
    } else {
      if (b_.isConservative()) return spheresMeet(a, inA(b_.sphere(b))) ? 0 : 1;
      const OrientedVolume box = oriented(b_.volume(b));
      const Eigen::Vector3d displacement = s.center - box.center;
      const Eigen::Vector3d outside = ((box.axes.transpose() * displacement).cwiseAbs() - box.half).cwiseMax(0);
      return outside.norm() - extent - 4 * a_in_b_.orthogonality_error * displacement.norm();
    }
  }

  // True if a body is so round that much of the box about it is not of the body.
  static bool isRound(const OrientedVolume& box) { return box.half.maxCoeff() < 2 * box.half.minCoeff(); }

  // True if the box of a node may meet the body itself, and not only the box about it.
  bool boxMeets(typename A::Node a, typename B::Node b) const {
    const double tolerance = a_in_b_.tolerance + 4 * a_in_b_.orthogonality_error * a_in_b_.translation.norm();
    return !(gapOnLine(b_, b, oriented(a_.volume(a)), a_in_b_) > tolerance);
  }

  // Beside a pair of nodes: as many pairs of triangles take as long, and the exact test of one that many.
  static constexpr std::size_t kTrianglePairs = 32, kExactTest = 8;
  // So do as many triangles against a body's box.
  static constexpr std::size_t kBodyTests = 4;
  // So do as many tests of eight lanes against a triangle.
  static constexpr std::size_t kTriangleTests = 4;
  // Nodes beside a leaf so much larger, squared, are tested against each of its triangles: beside a mesh of few, as a
  // room's walls are, at once, else in a walk of so many steps. Before, a hit is likely, and comes sooner without.
  static constexpr double kMuchLarger = 4;
  static constexpr std::size_t kFewTriangles = 16, kLongWalk = 128;

  // Beside bodies, children keep their order. Beside triangles they do not, and steps depend on what is packed.
  template <typename Side>
  bool testsTriangles(const Side& side, double leaf, double node) const {
    return (B::kBodies || !in_order_) && leaf > kMuchLarger * node &&
           (steps_ >= kLongWalk || side.meshTriangles() <= kFewTriangles);
  }

  // The larger of two nodes is expanded, unless it is a leaf.
  static bool expandsA(State sa, State sb, double size_a, double size_b) {
    return sb == State::kLeaf || (sa != State::kLeaf && size_a >= size_b);
  }

  bool stepBoxes(const Pair& pair, Scratch& s) {
    // Depth first, most steps share a node with the one before.
    seeNode(a_, pair.a, seen_a_);
    seeNode(b_, pair.b, seen_b_);
    const State sa = seen_a_.state, sb = seen_b_.state;
    if (sa == State::kLeaf && sb == State::kLeaf) return leafTriangles(pair, s);
    if (waits(sa, sb)) {
      s.deferred.add(pair);
      return false;
    }
    const double size_b = seen_b_.size * b_in_a_.scale * b_in_a_.scale;
    if (expandsA(sa, sb, seen_a_.size, size_b)) {
      if (sa == State::kGrows) {
        s.deferred.add(pair);
      } else {
        const auto push = [&](typename A::Node c, std::uint32_t triangles = ~0u) {
          s.stack.push_back({c, pair.b, triangles});
        };
        if constexpr (!B::kBodies) {
          if (sb == State::kLeaf && testsTriangles(b_, size_b, seen_a_.size)) {
            childrenBesideLeaf(a_, pair.a, volumeOf(b_, seen_b_), b_in_a_, s.large_b, b_, pair.b, pair.triangles, push);
            return false;
          }
        }
        if constexpr (B::kBodies) {
          auto& body = volumeOf(b_, seen_b_);
          const bool is_round = !b_.hasExactBox(pair.b) && isRound(oriented(body));
          a_.overlappingChildren(pair.a, body, b_in_a_, [&](typename A::Node c) {
            if (!is_round || boxMeets(c, pair.b)) push(c);
          });
        } else {
          a_.overlappingChildren(pair.a, volumeOf(b_, seen_b_), b_in_a_, push);
        }
      }
    } else if (sb == State::kGrows) {
      s.deferred.add(pair);
    } else {
      const auto push = [&](typename B::Node c, std::uint32_t triangles = ~0u) {
        s.stack.push_back({pair.a, c, triangles});
      };
      if (sa == State::kLeaf && testsTriangles(a_, seen_a_.size, size_b)) {
        childrenBesideLeaf(b_, pair.b, volumeOf(a_, seen_a_), a_in_b_, s.large_a, a_, pair.a, pair.triangles, push);
      } else {
        b_.overlappingChildren(pair.b, volumeOf(a_, seen_a_), a_in_b_, push);
      }
    }
    return false;
  }

  // Calls f for the children of an inner node that may meet a much larger leaf of the other side. The leaf's own box
  // separates little, so its triangles in `which` are tested one by one; of lanes, each child gets those that it may
  // meet.
  template <typename Side, typename Volume, typename Large, typename Other, typename F>
  void childrenBesideLeaf(const Side& side, typename Side::Node node, Volume& volume, const SimilarityTransform& to,
                          Large& large, const Other& other, typename Other::Node leaf, std::uint32_t which, F&& f) {
    if constexpr (Side::kHasLanes) {
      unsigned mask = side.overlappingLanes(node, volume, to);
      std::uint32_t triangles[8];
      std::fill(triangles, triangles + 8, ~0u);
      const auto* const boxes = mask != 0 ? large.get(other, leaf, to) : nullptr;
      if (boxes != nullptr) {
        std::fill(triangles, triangles + 8, 0);
        steps_ += static_cast<std::size_t>(__builtin_popcount(which & boxes->all())) / kTriangleTests;
        unsigned met = 0;
        for (which &= boxes->all(); which != 0; which &= which - 1) {
          const unsigned lanes = side.overlappingLanes(node, boxes->boxes[__builtin_ctz(which)], to) & mask;
          for (unsigned left = lanes; left != 0; left &= left - 1) triangles[__builtin_ctz(left)] |= which & -which;
          met |= lanes;
        }
        mask = met;
      }
      side.pushLanes(node, mask, [&](typename Side::Node child, int lane) { f(child, triangles[lane]); });
    } else if constexpr (Side::kHasCubes) {
      side.childrenMeeting(node, volume, to, large, other, leaf, f);
    } else {
      side.overlappingChildren(node, volume, to, f);
    }
  }

  // The triangles of the leaf asked last, kept because many bodies ask about the same leaf.
  const std::vector<TriangleExtent>& trianglesOf(typename A::Node leaf, Scratch& s) {
    if (leaf_known_ && leaf_ == leaf) return s.leaf;
    leaf_known_ = true;
    leaf_ = leaf;
    const auto triangles = a_.triangles(leaf);
    s.leaf.resize(triangles.count);
    for (std::size_t i = 0; i < s.leaf.size(); ++i) {
      TriangleExtent& t = s.leaf[i];
      t.id = triangles.ids[i];
      t.corners = a_.corners(t.id);
      t.ready();
    }
    return s.leaf;
  }

  bool leafTriangles(const Pair& pair, Scratch& s) {
    if (!in_order_) return visitTriangles(pair, s);
    gave_up_ = ++leaf_pairs_ > most_leaf_pairs_;
    if (gave_up_) return true;
    visitTriangles(pair, s);
    return visitor_.endLeaves();
  }

  bool visitTriangles(const Pair& pair, Scratch& s) {
    if constexpr (B::kBodies) {
      const BodyBox box(oriented(volumeOf(b_, seen_b_)), b_in_a_);
      const std::vector<TriangleExtent>& triangles = trianglesOf(pair.a, s);
      steps_ += triangles.size() / kBodyTests;
      for (const TriangleExtent& t : triangles) {
        if (box.isApart(t)) continue;
        steps_ += kExactTest;
        if (visitor_.triangle(t.id, pair.b)) return true;
      }
      return false;
    } else {
      const std::size_t before = s.leaves.tested();
      const auto visit = [this](std::uint32_t t, std::uint32_t u, bool certain) {
        if (!certain) steps_ += kExactTest;
        gave_up_ = steps_ > most_steps_;
        return gave_up_ || visitor_.triangles(t, u, certain);
      };
      const bool ended = s.leaves.test(a_, pair.a, b_, pair.b, visit);
      steps_ += (s.leaves.tested() - before) / kTrianglePairs;
      return ended;
    }
  }

  // Neither side has children to go on with.
  static bool waits(State sa, State sb) { return sa != State::kInner && sb != State::kInner; }

  bool stepSpheres(const Pair& pair, Scratch& s) {
    const State sa = a_.state(pair.a), sb = b_.state(pair.b);
    if (sa == State::kLeaf && sb == State::kLeaf) return leafSpheres(pair);
    const Sphere ball_a = a_.sphere(pair.a), ball_b = inA(b_.sphere(pair.b));
    // The pair that overlaps the most is taken first.
    const std::size_t start = s.stack.size();
    double least = 0;
    const auto push = [&](const Pair& child, double gap) {
      s.stack.push_back(child);
      if (s.stack.size() - 1 > start && !(gap < least)) std::swap(s.stack.back(), s.stack[s.stack.size() - 2]);
      least = std::min(least, gap);
    };
    if (expandsA(sa, sb, ball_a.radius, ball_b.radius)) {
      if (sa == State::kGrows) {
        s.deferred.add(pair);
      } else {
        a_.children(pair.a, [&](typename A::Node c) {
          const Sphere ball = a_.sphere(c);
          const double gap = gapTo(ball, pair.b);
          if (!(gap > 0) && (sb != State::kLeaf || meetsLeafOfB(ball, pair.b))) push({c, pair.b}, gap);
        });
      }
    } else if (sb == State::kGrows) {
      s.deferred.add(pair);
    } else {
      b_.children(pair.b, [&](typename B::Node c) {
        const double gap = gapTo(ball_a, c);
        if (gap > 0 || (sa == State::kLeaf && !meetsLeafOfA(inA(b_.sphere(c)), pair.a))) return;
        push({pair.a, c}, gap);
      });
    }
    return false;
  }

  // Calls f(triangle, its point that is nearest to the ball's middle) for the triangles of a leaf that meet a ball,
  // both in the frame that `place` leads to, until it returns true; says whether it did.
  template <typename Side, typename F>
  bool anyMeets(const Side& side, typename Side::Node leaf, const SimilarityTransform& place, const Sphere& ball,
                F&& f) const {
    const auto triangles = side.triangles(leaf);
    for (std::size_t i = 0; i < triangles.count; ++i) {
      const std::uint32_t t = triangles.ids[i];
      const Eigen::Vector3d point = closestPoint(ball.center, placed(side.corners(t), place));
      if (spheresMeet(ball, {point, 0}) && f(t, point)) return true;
    }
    return false;
  }

  // Beside a large triangle, the sphere about its leaf meets far more cells than the triangle does: without this test a
  // conservative tree would grow all of them. `ball` is in the frame of A.
  bool meetsLeafOfA(const Sphere& ball, typename A::Node leaf) const { return meetsLeaf(a_, leaf, here_, ball); }
  bool meetsLeafOfB(const Sphere& ball, typename B::Node leaf) const {
    if constexpr (B::kBodies) {
      return true;
    } else {
      return meetsLeaf(b_, leaf, b_in_a_, ball);
    }
  }
  template <typename Side>
  bool meetsLeaf(const Side& side, typename Side::Node leaf, const SimilarityTransform& place,
                 const Sphere& ball) const {
    const auto any = [](std::uint32_t, const Eigen::Vector3d&) { return true; };
    return side.isConservative() || anyMeets(side, leaf, place, ball, any);
  }

  bool leafSpheres(const Pair& pair) {
    if constexpr (B::kBodies) {
      const CellLeaf a{a_.cellId(pair.a), a_.cellSphere(pair.a)};
      return sphereMeets(a.sphere, pair.b) && visitor_.cell(a, pair.b);
    } else {
      return leafCells(pair);
    }
  }

  bool leafCells(const Pair& pair) {
    if (a_.isConservative()) {
      const CellLeaf a{a_.cellId(pair.a), a_.cellSphere(pair.a)};
      return anyMeets(b_, pair.b, b_in_a_, a.sphere,
                      [&](std::uint32_t t, const Eigen::Vector3d& point) { return visitor_.cellOfA(a, t, point); });
    }
    const CellLeaf b{b_.cellId(pair.b), inA(b_.cellSphere(pair.b))};
    return anyMeets(a_, pair.a, here_, b.sphere,
                    [&](std::uint32_t t, const Eigen::Vector3d& point) { return visitor_.cellOfB(t, b, point); });
  }

  template <typename Side>
  struct Seen {
    typename Side::Node node{};
    bool valid = false;
    State state = State::kLeaf;
    decltype(std::declval<const Side&>().volume(node)) volume;
    bool volume_valid = false;
    double size = 0;  // half diagonal, squared
  };
  template <typename Side>
  static void seeNode(const Side& side, typename Side::Node node, Seen<Side>& seen) {
    if (seen.valid && seen.node == node) return;
    seen.valid = true;
    seen.node = node;
    seen.state = side.state(node);
    seen.size = side.size(node);
    seen.volume_valid = false;
  }
  // The volume is decoded for the side that is not expanded only.
  template <typename Side>
  static auto& volumeOf(const Side& side, Seen<Side>& seen) {
    if (!seen.volume_valid) seen.volume = side.volume(seen.node);
    seen.volume_valid = true;
    return seen.volume;
  }

  // The least of a node's volume along the axis of the cut.
  template <typename Side>
  struct Least {
    typename Side::Node node{};
    bool valid = false;
    double least = 0;
  };

  Seen<A> seen_a_;
  Seen<B> seen_b_;
  Least<A> least_a_;
  Least<B> least_b_;
  typename A::Node leaf_{};  // whose triangles Scratch has, if that is known
  bool leaf_known_ = false;
  const A& a_;
  const B& b_;
  const SimilarityTransform here_, b_in_a_, a_in_b_;
  V& visitor_;
  const bool spheres_;
  const Cut* cut_;
  bool gave_up_ = false, in_order_ = false;
  std::size_t steps_ = 0, most_steps_ = 0, leaf_pairs_ = 0, most_leaf_pairs_ = 0;
};

/// A walk over the blocks of one model or two and one over their oriented boxes in turns, until one ends: the visitor
/// may see a pair in several turns. walk_blocks(most_steps) returns a WalkEnd.
template <typename B, typename WalkBlocks>
bool walkByTurns(const TreeSide& a, const B& b, const SimilarityTransform& b_in_a, VisitorOf<B>& visitor,
                 const Turns::LimitsByKind& limits, WalkBlocks&& walk_blocks) {
  Turns turns = visitor.endsAtFirst() ? Turns(a, b, tree::Tree::Search::kYesOrNo, limits.of_verdict)
                                      : Turns(a, b, tree::Tree::Search::kContacts, limits.of_contacts);
  for (;; turns.next()) {
    const WalkEnd blocks = walk_blocks(turns.most());
    turns.tookOverBlocks(blocks.steps, blocks.gave_up);
    if (!blocks.gave_up) return blocks.met;
    if (!provideBoxes(a, b)) continue;
    const BoxSide boxes_a(a);
    const auto& boxes_b = boxesOf(b);
    PairWalk<BoxSide, std::decay_t<decltype(boxes_b)>> walk_boxes(boxes_a, boxes_b, b_in_a, visitor);
    const WalkEnd boxes = walk_boxes.run(turns.mostOverBoxes());
    if (boxes.gave_up) continue;
    turns.endedOverBoxes(boxes.steps);
    return boxes.met;
  }
}

}  // namespace bocst::query
