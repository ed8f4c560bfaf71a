// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>

namespace bocst::query {

/// How fast a part of a body comes nearer along a direction, from some time until 1. Negative: it recedes.
struct ClosingSpeed {
  double ever;    ///< No point of it is ever faster.
  double now;     ///< Upper bound of the speed at that time.
  double change;  ///< How much `now` may grow per unit of time.

  ClosingSpeed operator+(const ClosingSpeed& o) const { return {ever + o.ever, now + o.now, change + o.change}; }
  /// What holds for two parts.
  static ClosingSpeed most(const ClosingSpeed& p, const ClosingSpeed& q) {
    return {std::max(p.ever, q.ever), std::max(p.now, q.now), std::max(p.change, q.change)};
  }
  /// The least time in which a gap may close.
  double timeFor(double gap) const;
};

/// How a body B moves in the world W while time goes from 0 to 1.
class Motion {
 public:
  virtual ~Motion() = default;

  /// X_WB, the pose at a time.
  virtual Eigen::Isometry3d at(double time) const = 0;

  /// Of the ball of the body that is at `center` (W) at this time, along the unit direction (W), or any that is off by
  /// at most `blur`.
  virtual ClosingSpeed closingSpeed(const Eigen::Vector3d& direction, double blur, const Eigen::Vector3d& center,
                                    double radius, double time) const = 0;

  /// No point of the ball is ever faster, from this time on.
  virtual double fastest(const Eigen::Vector3d& center, double radius, double time) const = 0;
};

/// Of the hull of some points (W): velocities are affine in position, so a hull's extremes are at its corners.
inline ClosingSpeed closingSpeedOf(const Motion& motion, const Eigen::Vector3d* points, std::size_t count,
                                   const Eigen::Vector3d& direction, double blur, double time) {
  ClosingSpeed most = motion.closingSpeed(direction, blur, points[0], 0, time);
  for (std::size_t i = 1; i < count; ++i) {
    most = ClosingSpeed::most(most, motion.closingSpeed(direction, blur, points[i], 0, time));
  }
  return most;
}

/// A constant turn about an axis that moves with a constant velocity: FCL's translation, interpolation and screw.
class AxisMotion final : public Motion {
 public:
  /// A pure translation, from a pose on.
  AxisMotion(const Eigen::Isometry3d& begin, const Eigen::Vector3d& velocity);
  /// The turn is by `angle` (radians, over the whole time) about `axis` (unit); `arm` leads from a point of the axis to
  /// the body's origin at time 0.
  AxisMotion(const Eigen::Isometry3d& begin, const Eigen::Vector3d& velocity, const Eigen::Vector3d& arm,
             const Eigen::Vector3d& axis, double angle);

  Eigen::Isometry3d at(double time) const override;
  ClosingSpeed closingSpeed(const Eigen::Vector3d& direction, double blur, const Eigen::Vector3d& center, double radius,
                            double time) const override;
  double fastest(const Eigen::Vector3d& center, double radius, double time) const override;

 private:
  Eigen::Vector3d around(const Eigen::Vector3d& point, double time) const;

  Eigen::Isometry3d begin_;
  Eigen::Vector3d velocity_, arm_, axis_;
  double angle_;
};

/// Position and rotation vector (about the body's origin) on uniform cubic B-splines: FCL's spline.
class SplineMotion final : public Motion {
 public:
  using Points = std::array<Eigen::Vector3d, 4>;
  SplineMotion(const Points& positions, const Points& rotations);

  Eigen::Isometry3d at(double time) const override;
  ClosingSpeed closingSpeed(const Eigen::Vector3d& direction, double blur, const Eigen::Vector3d& center, double radius,
                            double time) const override;
  double fastest(const Eigen::Vector3d& center, double radius, double time) const override;

 private:
  Points positions_, rotations_;
  std::array<Eigen::Vector3d, 3> velocities_, turns_;  // whose convex hulls hold the first derivatives
  std::array<Eigen::Vector3d, 2> accelerations_;       // and the second
  double turn_ = 0, turn_change_ = 0;                  // the largest first and second derivative of a rotation
};

/// The motions that FCL names, from a pose to a pose.
AxisMotion translation(const Eigen::Isometry3d& begin, const Eigen::Isometry3d& end);
AxisMotion interpolation(const Eigen::Isometry3d& begin, const Eigen::Isometry3d& end);
AxisMotion screw(const Eigen::Isometry3d& begin, const Eigen::Isometry3d& end);
SplineMotion spline(const Eigen::Isometry3d& begin, const Eigen::Isometry3d& end);

}  // namespace bocst::query
