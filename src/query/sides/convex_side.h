// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>

#include "geometry/convex_shape.h"
#include "query/sides/side.h"

namespace bocst::query {

/// One solid body as a side of a walk: a single leaf, in the frame of the body.
class ConvexSide : public CompleteSide {
 public:
  using Node = int;
  static constexpr bool kBodies = true;
  static constexpr bool kNodesContainSurface = true;

  explicit ConvexSide(const ConvexShape& body) : body_(body) {}

  Node root() const { return 0; }
  State state(Node) const { return State::kLeaf; }

  /// FCL's name for what has no parts.
  std::uint64_t id(Node) const { return ~std::uint64_t{0}; }

  double size(Node) const { return body_.box().half.squaredNorm(); }
  OrientedVolume volume(Node) const { return body_.box(); }
  Sphere sphere(Node) const { return {body_.box().center, body_.box().half.norm()}; }

  bool hasExactBox(Node) const { return body_.hasExactBox(); }
  SeparationResult gap(Node, const PointSet& points, double cutoff) const { return body_.gap(points, cutoff); }
  ContactPoint penetration(Node, const PointSet& points, const SeparationResult& gap) const {
    return body_.penetration(points, gap);
  }

  std::optional<Eigen::Vector3d> point(Node) const { return body_.point(); }
  SweptHull hull(Node) const { return body_.hull(); }

  // A leaf has no children.
  template <typename F>
  void children(Node, F&&) const {}
  template <typename OtherVolume, typename F>
  void overlappingChildren(Node, OtherVolume&, const SimilarityTransform&, F&&) const {}

 private:
  const ConvexShape& body_;
};

}  // namespace bocst::query
