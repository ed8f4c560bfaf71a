// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <limits>
#include <optional>

#include "geometry/triangle.h"
#include "geometry/volume.h"

// Solid convex bodies against the convex hull of a few points (a triangle, a point, a box), in the frame of the body.
// All in double.

namespace bocst::query {

/// A few points; what is meant is their convex hull.
struct PointSet {
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

/// Of points in float or double.
template <typename Points>
Eigen::AlignedBox3d boxOf(const Points& points) {
  Eigen::AlignedBox3d box;
  for (const auto& p : points) box.extend(p.template cast<double>());
  return box;
}

/// How far points are from a body.
struct SeparationResult {
  /// The distance is surely no less, up to 4e-15 of the coordinates, which is taken off: where it is not positive, the
  /// two may touch.
  double at_least = 0;
  /// Of the nearest points; 0 where the two touch, at a point of both. Not looked for when `at_least` was found to be
  /// enough.
  double distance = std::numeric_limits<double>::infinity();
  Eigen::Vector3d on_body = Eigen::Vector3d::Zero(), on_points = Eigen::Vector3d::Zero();
  /// The unit direction, from the body to the points, along which they are apart by `at_least`. Where `at_least` was
  /// more than enough, it may be zero.
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  /// Where cores overlap: points of the difference (body minus points) in whose hull the origin is, for penetration().
  Eigen::Vector3d around[4];
  int around_count = 0;

  bool isTouching() const { return !(at_least > 0 && distance > 0); }
};

/// A few points in whose hull, blown up by a radius, a body lies: what bounds how fast any point of it moves.
struct SweptHull {
  Eigen::Vector3d corners[8];
  std::size_t count = 0;
  double radius = 0;
};

/// That of a box.
SweptHull sweptHullOf(const OrientedVolume& box);

class ConvexShape {
 public:
  virtual ~ConvexShape() = default;

  /// A box about the body; of an unbounded one, about the part of it in the region that its constructor was given.
  const OrientedVolume& box() const { return box_; }

  /// The box bounds the body tightly: what meets the box nearly always meets the body, so the box alone culls.
  virtual bool hasExactBox() const { return false; }

  /// The distance of the points. More than `cutoff` is not looked at closely.
  virtual SeparationResult gap(const PointSet& points, double cutoff) const = 0;

  /// How far the points surely are beyond the body along a unit direction: no more than gap() finds, but quickly had.
  virtual double gapAlong(const Eigen::Vector3d& direction, const PointSet& points) const = 0;

  /// A point of the body; none if it is unbounded.
  virtual std::optional<Eigen::Vector3d> point() const = 0;

  /// That of its box, if nothing better is known.
  virtual SweptHull hull() const { return sweptHullOf(box_); }

  /// The translation that ends the overlap with points that touch the body: normal from the body to the points, depth
  /// >= 0 so that moving the points by depth * normal leaves them touching at most, and a point in or beside the
  /// overlap. For boxes, balls, planes, half-spaces and triangles it is the shortest one; for other bodies it is seldom
  /// longer by more than a tenth. `gap` is what gap() says of these points.
  virtual ContactPoint penetration(const PointSet& points, const SeparationResult& gap) const = 0;

 protected:
  OrientedVolume box_;
};

/// A convex core, blown up by a radius.
class SupportShape : public ConvexShape {
 public:
  SeparationResult gap(const PointSet& points, double cutoff) const override;
  double gapAlong(const Eigen::Vector3d& direction, const PointSet& points) const override;
  ContactPoint penetration(const PointSet& points, const SeparationResult& gap) const override;
  std::optional<Eigen::Vector3d> point() const override { return support(Eigen::Vector3d::UnitX()); }

  /// The point of the core that is farthest along d, which has any length but zero.
  virtual Eigen::Vector3d support(const Eigen::Vector3d& d) const = 0;
  double radius() const { return radius_; }

 protected:
  SupportShape(const Eigen::Vector3d& center, const Eigen::Vector3d& half_of_core, double radius);
  SupportShape(const Eigen::AlignedBox3d& core, double radius)
      : SupportShape(core.center(), core.sizes() / 2, radius) {}

  /// True if the point is surely in the core. False also where a quick test cannot tell.
  virtual bool contains(const Eigen::Vector3d&) const { return false; }

  const double radius_;

 private:
  double boxGap(const PointSet& points) const;
  SeparationResult coreGap(const PointSet& points, double cutoff) const;
  ContactPoint along(const Eigen::Vector3d& normal, const PointSet& points) const;
  ContactPoint shorten(ContactPoint contact, const PointSet& points) const;
};

/// All differences of a point of body a and one of body b, in the frame of a: the bodies are as far apart as it is from
/// the origin. Both bodies must outlive it.
class DifferenceShape final : public SupportShape {
 public:
  DifferenceShape(const SupportShape& a, const SupportShape& b, const Eigen::Isometry3d& X_AB);

  Eigen::Vector3d support(const Eigen::Vector3d& d) const override {
    return a_.support(d) - X_AB_ * b_.support(-(X_AB_.linear().transpose() * d));
  }

 private:
  const SupportShape &a_, &b_;
  const Eigen::Isometry3d X_AB_;
};

/// From half sizes, at the origin.
class BoxShape final : public SupportShape {
 public:
  explicit BoxShape(const Eigen::Vector3d& half);

  bool hasExactBox() const override { return true; }
  ContactPoint penetration(const PointSet& points, const SeparationResult& gap) const override;

 protected:
  Eigen::Vector3d support(const Eigen::Vector3d& d) const override;
  bool contains(const Eigen::Vector3d& x) const override;

 private:
  const Eigen::Vector3d half_;
};

/// What is within `radius` of a segment of the given length along z, about the origin: a capsule, or a ball.
class CapsuleShape final : public SupportShape {
 public:
  CapsuleShape(double radius, double length);

  SweptHull hull() const override;

 protected:
  Eigen::Vector3d support(const Eigen::Vector3d& d) const override;

 private:
  const double half_length_;
};

class EllipsoidShape final : public SupportShape {
 public:
  explicit EllipsoidShape(const Eigen::Vector3d& radii);

 protected:
  Eigen::Vector3d support(const Eigen::Vector3d& d) const override;
  bool contains(const Eigen::Vector3d& x) const override;

 private:
  const Eigen::Vector3d radii_;
};

/// About z, from -length / 2 with radius `bottom` to length / 2 with radius `top`: a cylinder, or a cone.
class RoundShape final : public SupportShape {
 public:
  RoundShape(double bottom, double top, double length);

 protected:
  Eigen::Vector3d support(const Eigen::Vector3d& d) const override;
  bool contains(const Eigen::Vector3d& x) const override;

 private:
  const double bottom_, top_, half_length_;
};

/// A triangle; its gap and penetration with another triangle are those of triangle.h.
class TriangleShape final : public SupportShape {
 public:
  explicit TriangleShape(const Corners& corners);

  SeparationResult gap(const PointSet& points, double cutoff) const override;
  ContactPoint penetration(const PointSet& points, const SeparationResult& gap) const override;
  SweptHull hull() const override;

 protected:
  Eigen::Vector3d support(const Eigen::Vector3d& d) const override;

 private:
  Corners corners_;
};

/// n.x == height, for a unit normal. Its box reaches as far as the region does.
class PlaneShape : public ConvexShape {
 public:
  PlaneShape(const Eigen::Vector3d& normal, double height, const Sphere& region);

  bool hasExactBox() const override { return true; }
  SeparationResult gap(const PointSet& points, double cutoff) const override;
  /// Along any direction but those of its normal it is unbounded.
  double gapAlong(const Eigen::Vector3d& direction, const PointSet& points) const override;
  ContactPoint penetration(const PointSet& points, const SeparationResult& gap) const override;
  std::optional<Eigen::Vector3d> point() const override { return std::nullopt; }

 protected:
  /// What lies at or below the height; `floor` is where the box ends.
  PlaneShape(const Eigen::Vector3d& normal, double height, const Sphere& region, double floor);

 private:
  const Eigen::Vector3d normal_;
  const double height_;
  const bool is_half_space_;
};

/// n.x <= height.
class HalfspaceShape final : public PlaneShape {
 public:
  HalfspaceShape(const Eigen::Vector3d& normal, double height, const Sphere& region);
};

}  // namespace bocst::query
