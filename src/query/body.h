// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <limits>
#include <optional>

#include "query/triangle.h"
#include "query/volume.h"

// Solid convex bodies against the convex hull of a few points (a triangle, a point, a box), in the frame of the body.
// All in double.

namespace bocst::query {

/// A few points; what is meant is their convex hull.
struct Points {
  const Eigen::Vector3d* x;
  int count;

  Eigen::Vector3d middle() const {
    Eigen::Vector3d m = x[0];
    for (int i = 1; i < count; ++i) m += x[i];
    return m / count;
  }
  /// The point that is farthest along d.
  const Eigen::Vector3d& support(const Eigen::Vector3d& d) const {
    int best = 0;
    double most = d.dot(x[0]);
    for (int i = 1; i < count; ++i) {
      const double h = d.dot(x[i]);
      if (h > most) most = h, best = i;
    }
    return x[best];
  }
};

/// How far points are from a body.
struct Gap {
  /// The distance is surely no less, up to 4e-15 of the coordinates, which is taken off: where it is not positive, the
  /// two may touch.
  double atLeast = 0;
  /// Of the nearest points; 0 where the two touch, at a point of both. Not looked for when `atLeast` was found to be
  /// enough.
  double distance = std::numeric_limits<double>::infinity();
  Eigen::Vector3d on_body = Eigen::Vector3d::Zero(), on_points = Eigen::Vector3d::Zero();
  /// The unit direction, from the body to the points, along which they are apart by `atLeast`. Where `atLeast` was more
  /// than enough, it may be zero.
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  /// Where cores overlap: points of the difference (body minus points) in whose hull the origin is, for part().
  Eigen::Vector3d around[4];
  int around_count = 0;

  bool touches() const { return !(atLeast > 0 && distance > 0); }
};

/// A few points in whose hull, blown up by a radius, a body lies: what bounds how fast any point of it moves.
struct Hull {
  Eigen::Vector3d corners[8];
  std::size_t count = 0;
  double radius = 0;
};

/// That of a box.
Hull hullOf(const OrientedVolume& box);

class Body {
 public:
  virtual ~Body() = default;

  /// A box about the body; of an unbounded one, about as much of it as its maker was told to care for.
  const OrientedVolume& box() const { return box_; }

  /// The box is the body, or as good: what meets the one is worth a look at the other.
  virtual bool isBox() const { return false; }

  /// The distance of the points. More than `enough` is not looked at closely.
  virtual Gap gap(const Points& points, double enough) const = 0;

  /// A point of the body; none of what has no end.
  virtual std::optional<Eigen::Vector3d> point() const = 0;

  /// That of its box, if nothing better is known.
  virtual Hull hull() const { return hullOf(box_); }

  /// How points that touch the body get away from it, in a straight line: normal from the body to the points, depth >=
  /// 0 so that moving the points by depth * normal leaves them touching at most, and a point in or beside the overlap.
  /// Of boxes, balls, planes, half-spaces and triangles the shortest way; of other bodies one that is seldom longer by
  /// more than a tenth. `gap` is what gap() says of these points.
  virtual Touch part(const Points& points, const Gap& gap) const = 0;
  Touch part(const Points& points) const { return part(points, gap(points, std::numeric_limits<double>::infinity())); }

 protected:
  OrientedVolume box_;
};

/// A convex core, blown up by a radius.
class ConvexBody : public Body {
 public:
  Gap gap(const Points& points, double enough) const override;
  using Body::part;
  Touch part(const Points& points, const Gap& gap) const override;
  std::optional<Eigen::Vector3d> point() const override { return support(Eigen::Vector3d::UnitX()); }

 protected:
  ConvexBody(const Eigen::Vector3d& center, const Eigen::Vector3d& half_of_core, double radius);

  /// The point of the core that is farthest along d, which has any length but zero.
  virtual Eigen::Vector3d support(const Eigen::Vector3d& d) const = 0;

  /// Is the point surely in the core? False where that is not known at a glance.
  virtual bool holds(const Eigen::Vector3d&) const { return false; }

  const double radius_;

 private:
  double boxGap(const Points& points) const;
  Gap coreGap(const Points& points, double enough) const;
  Touch along(const Eigen::Vector3d& normal, const Points& points) const;
  Touch shorten(Touch touch, const Points& points) const;
};

/// From half sizes, at the origin.
class BoxBody final : public ConvexBody {
 public:
  explicit BoxBody(const Eigen::Vector3d& half);

  bool isBox() const override { return true; }
  using Body::part;
  Touch part(const Points& points, const Gap& gap) const override;

 protected:
  Eigen::Vector3d support(const Eigen::Vector3d& d) const override;
  bool holds(const Eigen::Vector3d& x) const override;

 private:
  const Eigen::Vector3d half_;
};

/// What is within `radius` of a segment of the given length along z, about the origin: a capsule, or a ball.
class CapsuleBody final : public ConvexBody {
 public:
  CapsuleBody(double radius, double length);

  Hull hull() const override;

 protected:
  Eigen::Vector3d support(const Eigen::Vector3d& d) const override;

 private:
  const double half_length_;
};

class EllipsoidBody final : public ConvexBody {
 public:
  explicit EllipsoidBody(const Eigen::Vector3d& radii);

 protected:
  Eigen::Vector3d support(const Eigen::Vector3d& d) const override;
  bool holds(const Eigen::Vector3d& x) const override;

 private:
  const Eigen::Vector3d radii_;
};

/// About z, from -length / 2 with radius `bottom` to length / 2 with radius `top`: a cylinder, or a cone.
class RoundBody final : public ConvexBody {
 public:
  RoundBody(double bottom, double top, double length);

 protected:
  Eigen::Vector3d support(const Eigen::Vector3d& d) const override;
  bool holds(const Eigen::Vector3d& x) const override;

 private:
  const double bottom_, top_, half_length_;
};

/// A triangle, which parts as triangles do.
class TriangleBody final : public ConvexBody {
 public:
  explicit TriangleBody(const Corners& corners);

  Gap gap(const Points& points, double enough) const override;
  using Body::part;
  Touch part(const Points& points, const Gap& gap) const override;
  Hull hull() const override;

 protected:
  Eigen::Vector3d support(const Eigen::Vector3d& d) const override;

 private:
  Corners corners_;
};

/// What lies at or below a height along a unit normal: n.x <= height. Its box reaches as far as the region does.
class HalfspaceBody final : public Body {
 public:
  HalfspaceBody(const Eigen::Vector3d& normal, double height, const Sphere& region);

  bool isBox() const override { return true; }
  Gap gap(const Points& points, double enough) const override;
  using Body::part;
  Touch part(const Points& points, const Gap& gap) const override;
  std::optional<Eigen::Vector3d> point() const override { return std::nullopt; }

 private:
  const Eigen::Vector3d normal_;
  const double height_;
};

/// n.x == height.
class PlaneBody final : public Body {
 public:
  PlaneBody(const Eigen::Vector3d& normal, double height, const Sphere& region);

  bool isBox() const override { return true; }
  Gap gap(const Points& points, double enough) const override;
  using Body::part;
  Touch part(const Points& points, const Gap& gap) const override;
  std::optional<Eigen::Vector3d> point() const override { return std::nullopt; }

 private:
  const Eigen::Vector3d normal_;
  const double height_;
};

}  // namespace bocst::query
