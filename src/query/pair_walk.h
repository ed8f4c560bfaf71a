// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "query/side.h"

namespace bocst::query {

/// A leaf that is a cell, as the visitor sees it: its sphere in the frame of side A.
struct CellLeaf {
  std::uint64_t id;
  Sphere sphere;
};

/// What a query does with the pairs that a walk finds. Each function returns true to end the walk. A pair may come more
/// than once.
class Visitor {
 public:
  virtual ~Visitor() = default;

  /// The first hit will end the walk.
  virtual bool endsAtFirst() const = 0;
  /// Triangle a of side A and b of side B may touch; everything that touches comes here.
  virtual bool triangles(std::uint32_t a, std::uint32_t b) = 0;
  /// The spheres of two cells overlap.
  virtual bool cells(const CellLeaf& a, const CellLeaf& b) = 0;
  /// A cell's sphere on one side meets a triangle on the other, whose point nearest to the sphere's centre is `point`
  /// (frame of A).
  virtual bool cellOfA(const CellLeaf& a, std::uint32_t b, const Eigen::Vector3d& point) = 0;
  virtual bool cellOfB(std::uint32_t a, const CellLeaf& b, const Eigen::Vector3d& point) = 0;
};

/// The one walk over pairs of nodes. Resident pairs first, depth first; a pair that needs an unexpanded node is set
/// aside. When the resident pairs do not settle the question, nodes set aside grow in one batch and the walk goes on
/// with their pairs, one level down. A walk that has to
/// see everything grows all that is set aside, so it makes one batch a level. One that ends at its first hit takes the
/// deepest overlaps first, and twice as many each time: a hit deep inside costs one small batch a level, a miss at most
/// the logarithm of its pairs more.
///
/// Triangles against triangles are culled by boxes and slabs; as soon as a side answers with cells, both are culled by
/// spheres, in double and on integer cells, so a conservative verdict does not depend on what is resident.
template <typename A, typename B>
class PairWalk {
 public:
  /// `b_in_a` places side B's frame in side A's. Scratch memory is kept by the thread between walks.
  PairWalk(const A& a, const B& b, const Placement& b_in_a, Visitor& visitor)
      : a_(a), b_(b), b_in_a_(b_in_a), a_in_b_(b_in_a.inverse()), visitor_(visitor), spheres_(a.cells() || b.cells()) {}

  /// Pairs in the first batch of a walk that may end early; a few oracle answers cost less than one too many.
  static constexpr std::size_t kFirstBatch = 8;

  /// A leaf so many times larger (squared) than the node it meets is taken triangle by triangle.
  static constexpr double kCoarse = 1.0;

  /// True when the visitor ended it.
  bool run() {
    Scratch& s = scratch();
    s.stack.clear();
    s.pending.clear();
    s.batch = kFirstBatch;
    s.pack_of_a = kNoPack;
    const Pair root{a_.root(), b_.root()};
    if (!rootsMeet(root)) return false;
    s.stack.push_back(root);
    for (;;) {
      while (!s.stack.empty()) {
        const Pair pair = s.stack.back();
        s.stack.pop_back();
        if (spheres_ ? stepSpheres(pair, s) : stepBoxes(pair, s)) return true;
      }
      if (s.pending.empty()) return false;
      growSome(s);
    }
  }

 private:
  struct Pair {
    typename A::Node a;
    typename B::Node b;
  };
  struct Waiting {
    Pair pair;
    double gap;  // see gap()
  };
  static constexpr std::uint64_t kNoPack = ~std::uint64_t{0};
  struct Scratch {
    std::vector<Pair> stack;
    std::vector<Waiting> pending;
    std::vector<tree::Tree::Growth> growths;
    std::size_t batch = kFirstBatch;
    TrianglePack a, b;
    std::uint64_t pack_of_a = kNoPack;  // which node and part of its list pack `a` holds
    PackPair found[TrianglePack::kCapacity * TrianglePack::kCapacity];
  };
  static Scratch& scratch() {
    thread_local Scratch s;
    return s;
  }

  bool rootsMeet(const Pair& root) const {
    return spheres_ ? spheresMeet(a_.sphere(root.a), inA(b_.sphere(root.b)))
                    : !boxesApart(oriented(a_.volume(root.a)), oriented(b_.volume(root.b)), b_in_a_);
  }

  Sphere inA(Sphere s) const { return {b_in_a_ * s.center, s.radius * b_in_a_.scale}; }

  bool spheresMeet(const Sphere& a, const Sphere& b) const {
    const double reach = (a.radius + b.radius) * (1 + 1e-12) + b_in_a_.slack;
    return (a.center - b.center).squaredNorm() <= reach * reach;
  }

  // The distance of the middles over the sizes, squared: least for the deepest overlap.
  double gap(const Pair& pair) const {
    const Sphere a = a_.sphere(pair.a), b = inA(b_.sphere(pair.b));
    return (a.center - b.center).squaredNorm() / (a.radius * a.radius + b.radius * b.radius);
  }

  void growSome(Scratch& s) {
    // What a tree knows already comes at once and costs nothing.
    auto end = std::partition(s.pending.begin(), s.pending.end(),
                              [this](const Waiting& w) { return asks(a_, w.pair.a) || asks(b_, w.pair.b); });
    if (end == s.pending.end()) {
      if (visitor_.endsAtFirst() && s.pending.size() > s.batch) {
        end -= static_cast<std::ptrdiff_t>(s.batch);
        for (Waiting& w : s.pending) w.gap = gap(w.pair);
        std::nth_element(s.pending.begin(), end, s.pending.end(),
                         [](const Waiting& x, const Waiting& y) { return x.gap > y.gap; });
      } else {
        end = s.pending.begin();
      }
      s.batch *= 2;
    }
    s.growths.clear();
    for (auto w = end; w != s.pending.end(); ++w) {
      // Both sides where both must grow: the smaller is the next to be expanded.
      if (a_.state(w->pair.a) == State::kGrows) a_.grow(w->pair.a, s.growths);
      if (b_.state(w->pair.b) == State::kGrows) b_.grow(w->pair.b, s.growths);
      s.stack.push_back(w->pair);
    }
    s.pending.erase(end, s.pending.end());
    uniqueGrowths(s.growths);
    if (!s.growths.empty()) tree::Tree::grow(s.growths);
    seen_a_.valid = seen_b_.valid = false;
  }

  template <typename Side>
  static bool asks(const Side& side, typename Side::Node node) {
    return side.state(node) == State::kGrows && !side.growsFreely(node);
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
      s.pending.push_back({pair, 0});
      return false;
    }
    const double size_b = seen_b_.size * b_in_a_.scale * b_in_a_.scale;
    if (expandsA(sa, sb, seen_a_.size, size_b)) {
      if (sa == State::kGrows) {
        s.pending.push_back({pair, 0});
      } else {
        const auto push = [&](typename A::Node c) { s.stack.push_back({c, pair.b}); };
        if (sb == State::kLeaf && seen_a_.size < kCoarse * size_b) {
          a_.childrenMeeting(
              pair.a, volumeOf(b_, seen_b_), b_in_a_, b_.triangleCount(pair.b),
              [&](std::size_t i, int k) { return b_in_a_ * b_.corner(b_.triangle(pair.b, i), k); }, push);
        } else {
          a_.overlappingChildren(pair.a, volumeOf(b_, seen_b_), b_in_a_, push);
        }
      }
    } else if (sb == State::kGrows) {
      s.pending.push_back({pair, 0});
    } else {
      const auto push = [&](typename B::Node c) { s.stack.push_back({pair.a, c}); };
      if (sa == State::kLeaf && size_b < kCoarse * seen_a_.size) {
        b_.childrenMeeting(
            pair.b, volumeOf(a_, seen_a_), a_in_b_, a_.triangleCount(pair.a),
            [&](std::size_t i, int k) { return a_in_b_ * a_.corner(a_.triangle(pair.a, i), k); }, push);
      } else {
        b_.overlappingChildren(pair.b, volumeOf(a_, seen_a_), a_in_b_, push);
      }
    }
    return false;
  }

  // Neither side has children to go on with.
  static bool waits(State sa, State sb) { return sa != State::kInner && sb != State::kInner; }

  bool stepSpheres(const Pair& pair, Scratch& s) {
    const State sa = a_.state(pair.a), sb = b_.state(pair.b);
    if (sa == State::kLeaf && sb == State::kLeaf) return leafSpheres(pair);
    const Sphere ball_a = a_.sphere(pair.a), ball_b = inA(b_.sphere(pair.b));
    if (expandsA(sa, sb, ball_a.radius, ball_b.radius)) {
      if (sa == State::kGrows) {
        s.pending.push_back({pair, 0});
      } else {
        a_.children(pair.a, [&](typename A::Node c) {
          if (spheresMeet(a_.sphere(c), ball_b)) s.stack.push_back({c, pair.b});
        });
      }
    } else if (sb == State::kGrows) {
      s.pending.push_back({pair, 0});
    } else {
      b_.children(pair.b, [&](typename B::Node c) {
        if (spheresMeet(ball_a, inA(b_.sphere(c)))) s.stack.push_back({pair.a, c});
      });
    }
    return false;
  }

  // Corners straight from the vertices: out = linear * v + offset, in the frame of A about the leaf of A.
  struct ToPack {
    double linear[3][3];
    double offset[3];
  };

  // Vertices of a side lie at (v - origin) * inverse_unit in its frame, which `place` puts into that of A.
  template <typename Side>
  static ToPack toPack(const Side& side, const Placement& place, const Eigen::Vector3d& center) {
    const Eigen::Matrix3d linear = place.rotation * (place.scale * side.inverseUnit());
    const Eigen::Vector3d offset = place.translation - linear * side.origin() - center;
    ToPack t;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) t.linear[r][c] = linear(r, c);
      t.offset[r] = offset[r];
    }
    return t;
  }

  template <typename Side, typename Node>
  static void fill(const Side& side, Node node, std::size_t begin, const ToPack& to, TrianglePack& pack) {
    pack.count = std::min(side.triangleCount(node) - begin, TrianglePack::kCapacity);
    float size = 0;
    for (std::size_t i = 0; i < pack.count; ++i) {
      const std::uint32_t t = side.triangle(node, begin + i);
      pack.ids[i] = t;
      for (int k = 0; k < 3; ++k) {
        const auto& v = side.vertex(t, k);
        const double x = v[0], y = v[1], z = v[2];
        for (int c = 0; c < 3; ++c) {
          const float f =
              static_cast<float>(to.linear[c][0] * x + to.linear[c][1] * y + to.linear[c][2] * z + to.offset[c]);
          pack.xyz[3 * k + c][i] = f;
          size = std::max(size, std::abs(f));
        }
      }
    }
    pack.size = size;
  }

  bool leafTriangles(const Pair& pair, Scratch& s) {
    const Eigen::Vector3d center = a_.cellSphere(pair.a).center;
    const ToPack to_a = toPack(a_, Placement(), center), to_b = toPack(b_, b_in_a_, center);
    const std::size_t count_a = a_.triangleCount(pair.a), count_b = b_.triangleCount(pair.b);
    for (std::size_t i = 0; i < count_a; i += TrianglePack::kCapacity) {
      const std::uint64_t key = std::uint64_t{pair.a.bits} << 32 | i;
      if (key != s.pack_of_a) fill(a_, pair.a, i, to_a, s.a);
      s.pack_of_a = key;
      for (std::size_t j = 0; j < count_b; j += TrianglePack::kCapacity) {
        fill(b_, pair.b, j, to_b, s.b);
        const std::size_t found = touchingPairs(s.a, s.b, static_cast<float>(b_in_a_.slack * 1.001), s.found);
        for (std::size_t k = 0; k < found; ++k) {
          if (visitor_.triangles(s.a.ids[s.found[k].row], s.b.ids[s.found[k].lane])) return true;
        }
      }
    }
    return false;
  }

  bool leafSpheres(const Pair& pair) {
    if (a_.cells() && b_.cells()) {
      const CellLeaf a{a_.cellId(pair.a), a_.cellSphere(pair.a)};
      const CellLeaf b{b_.cellId(pair.b), inA(b_.cellSphere(pair.b))};
      return spheresMeet(a.sphere, b.sphere) && visitor_.cells(a, b);
    }
    if (a_.cells()) {
      const CellLeaf a{a_.cellId(pair.a), a_.cellSphere(pair.a)};
      for (std::size_t i = 0; i < b_.triangleCount(pair.b); ++i) {
        const std::uint32_t t = b_.triangle(pair.b, i);
        const Corners corners = {b_in_a_ * b_.corner(t, 0), b_in_a_ * b_.corner(t, 1), b_in_a_ * b_.corner(t, 2)};
        const Eigen::Vector3d point = closestPoint(a.sphere.center, corners);
        if (spheresMeet(a.sphere, {point, 0}) && visitor_.cellOfA(a, t, point)) return true;
      }
      return false;
    }
    const CellLeaf b{b_.cellId(pair.b), inA(b_.cellSphere(pair.b))};
    for (std::size_t i = 0; i < a_.triangleCount(pair.a); ++i) {
      const std::uint32_t t = a_.triangle(pair.a, i);
      const Corners corners = {a_.corner(t, 0), a_.corner(t, 1), a_.corner(t, 2)};
      const Eigen::Vector3d point = closestPoint(b.sphere.center, corners);
      if (spheresMeet(b.sphere, {point, 0}) && visitor_.cellOfB(t, b, point)) return true;
    }
    return false;
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
  // Only the side that is not expanded is looked at closely.
  template <typename Side>
  static auto& volumeOf(const Side& side, Seen<Side>& seen) {
    if (!seen.volume_valid) seen.volume = side.volume(seen.node);
    seen.volume_valid = true;
    return seen.volume;
  }

  Seen<A> seen_a_;
  Seen<B> seen_b_;
  const A& a_;
  const B& b_;
  const Placement b_in_a_, a_in_b_;
  Visitor& visitor_;
  const bool spheres_;
};

}  // namespace bocst::query
