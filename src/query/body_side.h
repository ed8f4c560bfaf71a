// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "query/body.h"
#include "query/side.h"

namespace bocst::query {

/// One solid body as a side of a walk: a single leaf, in the frame of the body.
class BodySide {
 public:
  using Node = int;
  static constexpr bool kBodies = true;
  static constexpr bool kNodesHoldSurface = true;

  explicit BodySide(const Body& body) : body_(body) {}

  Node root() const { return 0; }
  bool cells() const { return false; }
  State state(Node) const { return State::kLeaf; }
  bool growsFreely(Node) const { return true; }
  void grow(Node, std::vector<tree::Tree::Growth>&) const {}

  /// FCL's name for what has no parts.
  std::uint64_t name(Node) const { return ~std::uint64_t{0}; }

  double size(Node) const { return body_.box().half.squaredNorm(); }
  OrientedVolume volume(Node) const { return body_.box(); }
  Sphere sphere(Node) const { return {body_.box().center, body_.box().half.norm()}; }

  bool isBox(Node) const { return body_.isBox(); }
  Gap gap(Node, const Points& points, double enough) const { return body_.gap(points, enough); }
  Touch part(Node, const Points& points, const Gap& gap) const { return body_.part(points, gap); }

  std::optional<Eigen::Vector3d> point(Node) const { return body_.point(); }
  Hull hull(Node) const { return body_.hull(); }

  /// Does a sphere in this frame come within `slack` of the body?
  bool meets(Node node, const Sphere& s, double slack) const {
    const double reach = s.radius * (1 + 1e-12) + slack;
    return !(gap(node, {&s.center, 1}, reach).atLeast > reach);
  }

  // A leaf has no children.
  template <typename F>
  void children(Node, F&&) const {}
  template <typename OtherVolume, typename F>
  void overlappingChildren(Node, OtherVolume&, const Placement&, F&&) const {}
  template <typename OtherVolume, typename Coarse, typename Other, typename F>
  void childrenMeeting(Node, OtherVolume&, const Placement&, Coarse&, const Other&, typename Other::Node, F&&) const {}

 private:
  const Body& body_;
};

}  // namespace bocst::query
