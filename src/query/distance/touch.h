// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "geometry/triangle.h"
#include "query/collide/pair_walk.h"
#include "query/collide/tree_walk.h"
#include "query/distance/distance_walk.h"
#include "query/sides/convex_side.h"

namespace bocst::query {

/// Two triangles of two trees with exact answers that touch, if a short walk for a verdict finds them: where many nodes
/// overlap, a search for the distance finds them late. Not looked for in trees whose roots are not expanded yet.
inline std::optional<Nearest> findTouch(const TreeSide& a, const TreeSide& b, const SimilarityTransform& b_in_a) {
  class Touch final : public Visitor {
   public:
    Touch(const TreeSide& a, const TreeSide& b, const SimilarityTransform& b_in_a) : a_(a), b_(b), b_in_a_(b_in_a) {}

    bool endsAtFirst() const override { return true; }
    bool triangles(std::uint32_t t, std::uint32_t u, bool) override {
      found.a = t;
      found.b = u;
      found.distance = nearestPoints(a_.corners(t), placed(b_.corners(u), b_in_a_), found.on_a, found.on_b);
      return found.distance == 0;
    }
    bool cells(const CellLeaf&, const CellLeaf&) override { return false; }
    bool cellOfA(const CellLeaf&, std::uint32_t, const Eigen::Vector3d&) override { return false; }
    bool cellOfB(std::uint32_t, const CellLeaf&, const Eigen::Vector3d&) override { return false; }

    Nearest found;

   private:
    const TreeSide &a_, &b_;
    const SimilarityTransform& b_in_a_;
  };
  constexpr std::size_t kMostLeafPairs = 64;
  if (!TreeWalk::fits(a, b, b_in_a)) return std::nullopt;
  if (a.state(a.root()) == State::kGrows || b.state(b.root()) == State::kGrows) return std::nullopt;
  TreeWalk walk(a, b, b_in_a);
  if (walk.isNeedless()) return std::nullopt;
  Touch touch(a, b, b_in_a);
  if (!walk.run(touch, kMostLeafPairs).met) return std::nullopt;
  return touch.found;
}

/// The same of a tree and a solid body.
inline std::optional<Nearest> findTouch(const TreeSide& a, const ConvexSide& b, const SimilarityTransform& b_in_a) {
  class Touch final : public ConvexVisitor<ConvexSide::Node> {
   public:
    Touch(const TreeSide& a, const ConvexSide& b, const SimilarityTransform& b_in_a)
        : a_(a), b_(b), b_in_a_(b_in_a), a_in_b_(b_in_a.inverse()) {}

    bool endsAtFirst() const override { return true; }
    bool triangle(std::uint32_t t, const ConvexSide::Node& body) override {
      const Corners corners = placed(a_.corners(t), a_in_b_);
      const SeparationResult gap = b_.gap(body, {corners.data(), 3}, 0);
      if (gap.distance != 0) return false;
      found.a = t;
      found.b = b_.id(body);
      found.distance = 0;
      found.on_a = found.on_b = b_in_a_ * gap.on_points;
      return true;
    }
    bool cell(const CellLeaf&, const ConvexSide::Node&) override { return false; }

    Nearest found;

   private:
    const TreeSide& a_;
    const ConvexSide& b_;
    const SimilarityTransform& b_in_a_;
    const SimilarityTransform a_in_b_;
  };
  constexpr std::size_t kMostSteps = 64;
  if (a.isConservative() || a.state(a.root()) == State::kGrows) return std::nullopt;
  Touch touch(a, b, b_in_a);
  if (!PairWalk<TreeSide, ConvexSide>(a, b, b_in_a, touch).run(kMostSteps).met) {
    return std::nullopt;
  }
  return touch.found;
}

}  // namespace bocst::query
