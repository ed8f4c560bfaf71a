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
  double gapAlong(Node, const Eigen::Vector3d& direction, const PointSet& points) const {
    return body_.gapAlong(direction, points);
  }
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

/// How far a body surely is from a box, placed in the frame of the bodies by `to`, along one line between them: exact
/// for balls, and a tenth of the time that gap() of its corners takes. Not positive where it finds no such line.
template <typename Bodies>
double gapOnLine(const Bodies& bodies, const typename Bodies::Node& body, const OrientedVolume& box,
                 const SimilarityTransform& to) {
  const auto clamped = [](const Eigen::Vector3d& x, const Eigen::Vector3d& most) -> Eigen::Vector3d {
    return x.cwiseMax(-most).cwiseMin(most);
  };
  const OrientedVolume about = oriented(bodies.volume(body));
  const Eigen::Matrix3d axes = to.rotation * box.axes;
  const Eigen::Vector3d center = to * box.center, half = to.scale * box.half;
  // From the box about the body without the radius that a ball, a capsule or a rod has on all sides.
  const Eigen::Vector3d core = about.half.array() - about.half.minCoeff();
  const Eigen::Vector3d from =
      about.center + about.axes * clamped(about.axes.transpose() * (center - about.center), core);
  const Eigen::Vector3d in_box = axes.transpose() * (from - center);
  Eigen::Vector3d direction = axes * (clamped(in_box, half) - in_box);
  const double length = direction.norm();
  constexpr double kLeast = 1e-100;  // shorter ones cannot be made unit vectors
  if (!(length > kLeast)) return 0;
  direction /= length;
  const Eigen::Vector3d lowest =
      (direction.dot(center) - (direction.transpose() * axes).cwiseAbs().dot(half)) * direction;
  return bodies.gapAlong(body, direction, {&lowest, 1});
}

/// Asks for gaps between bodies and points, one after the other: first along the direction that separated the last
/// ones.
class GapFinder {
 public:
  /// ConvexShape::gap().
  template <typename Bodies>
  SeparationResult gap(const Bodies& bodies, const typename Bodies::Node& body, const PointSet& points, double cutoff) {
    if (direction_.squaredNorm() > 0) {
      SeparationResult known;
      known.at_least = bodies.gapAlong(body, direction_, points);
      known.normal = direction_;
      if (known.at_least > cutoff) return known;
    }
    const SeparationResult found = bodies.gap(body, points, cutoff);
    if (found.at_least > 0 && found.normal.squaredNorm() > 0) direction_ = found.normal;
    return found;
  }

 private:
  Eigen::Vector3d direction_ = Eigen::Vector3d::Zero();
};

}  // namespace bocst::query
