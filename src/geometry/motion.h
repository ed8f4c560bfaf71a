// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>

namespace bocst::query {

/// How fast a part of a body comes nearer along a direction, from some time until 1. Negative: it recedes.
struct ClosingSpeed {
  double ever = 0;    ///< No point of it is ever faster.
  double now = 0;     ///< Upper bound of the speed at that time.
  double change = 0;  ///< How much `now` may grow per unit of time.

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

  const Eigen::Vector3d& velocity() const { return velocity_; }
  Eigen::Vector3d turn() const { return angle_ * axis_; }                      ///< The angular velocity.
  Eigen::Vector3d pointOfAxis() const { return begin_.translation() - arm_; }  ///< At time 0.
  /// Of the body's point that is at `point` (W) at this time.
  Eigen::Vector3d velocityAt(const Eigen::Vector3d& point, double time) const {
    return velocity_ + angle_ * around(point, time);
  }
  /// The axis times the way from it to a point: the direction in which a positive turn moves the point.
  Eigen::Vector3d around(const Eigen::Vector3d& point, double time) const;

 private:
  Eigen::Isometry3d begin_;
  Eigen::Vector3d velocity_, arm_, axis_;
  double angle_;
};

/// The motion of a body of revolution without its turn about its own axis, which does not change the set of its points:
/// a wheel that rolls moves along a line. Speeds are those of a frame that does not turn about this axis.
class RevolutionMotion final : public Motion {
 public:
  /// `own_axis` (unit, in the body's frame) passes through the body's origin.
  RevolutionMotion(const AxisMotion& motion, const Eigen::Vector3d& own_axis);

  Eigen::Isometry3d at(double time) const override { return motion_.at(time); }
  ClosingSpeed closingSpeed(const Eigen::Vector3d& direction, double blur, const Eigen::Vector3d& center, double radius,
                            double time) const override;
  double fastest(const Eigen::Vector3d& center, double radius, double time) const override;

  /// How fast the turn moves points at a distance of `reach` from the origin, at most, as a share of what it would be
  /// with the turn about the own axis; 0 for a perfect wheel.
  double shareOfTurn(double reach) const { return (orbit_ + sine_ * reach) / reach; }

 private:
  double rounding(const Eigen::Vector3d& origin, double distance) const;

  AxisMotion motion_;
  Eigen::Vector3d own_axis_;
  double turn_;   // radians over the whole time
  double sine_;   // of the angle between the own axis and that of the turn
  double orbit_;  // distance of the body's origin from the axis of the turn
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

/// How a body B moves as a body A sees it, where both turn: what both do together changes no distance, so links that
/// one joint turns stay apart as they are. Positions and directions are those in the world at the time of the question.
class RelativeMotion {
 public:
  RelativeMotion(const AxisMotion& a, const AxisMotion& b);

  /// As Motion::closingSpeed(), of a part of B towards A, along a direction that turns with A.
  ClosingSpeed closingSpeed(const Eigen::Vector3d& direction, double blur, const Eigen::Vector3d& center, double radius,
                            double time) const;
  /// No distance between a point of A and a point of the ball of B ever changes faster.
  double fastest(const Eigen::Vector3d& center, double radius, double time) const;

 private:
  Eigen::Vector3d between(double time) const { return between_ + time * velocity_; }
  Eigen::Vector3d shift(double time) const { return velocity_ - turn_a_.cross(between(time)); }
  double distanceToAxis(const Eigen::Vector3d& center, double radius, double time) const {
    return (center - axis_b_ - time * velocity_b_).norm() + radius;
  }
  double rounding(double distance, double time) const;

  Eigen::Vector3d velocity_, velocity_b_;  // of B's axis against that of A, and in the world
  Eigen::Vector3d turn_a_, turn_;          // angular velocities: of A, and of B against A
  Eigen::Vector3d axis_b_, between_;       // a point of B's axis at time 0; the way to it from one of A's
  double speeds_, turns_;                  // sums of both
};

/// A part of a body that moves, in the world: a ball, or the hull of points. Velocities are affine in the position, so
/// a hull's extremes are at its corners.
struct MovingBall {
  const Eigen::Vector3d& center;
  double radius;
  template <typename SpeedOf>
  ClosingSpeed most(SpeedOf&& speed_of) const {
    return speed_of(center, radius);
  }
};
struct MovingHull {
  const Eigen::Vector3d* points;
  std::size_t count;
  template <typename SpeedOf>
  ClosingSpeed most(SpeedOf&& speed_of) const {
    ClosingSpeed most = speed_of(points[0], 0.0);
    for (std::size_t i = 1; i < count; ++i) most = ClosingSpeed::most(most, speed_of(points[i], 0.0));
    return most;
  }
};

/// Two bodies that move. It lives no longer than their motions.
class MotionPair {
 public:
  MotionPair(const Motion& a, const Motion& b);

  const Motion& a() const { return a_; }
  const Motion& b() const { return b_; }

  /// The least time in which a gap between two parts, along a unit direction from A to B that is off by at most `blur`,
  /// may close.
  template <typename PartA, typename PartB>
  double timeToClose(double gap, const Eigen::Vector3d& direction, double blur, const PartA& part_a,
                     const PartB& part_b, double time) const {
    const auto of_a = [&](const Eigen::Vector3d& x, double radius) {
      return a_.closingSpeed(direction, blur, x, radius, time);
    };
    const auto of_b = [&](const Eigen::Vector3d& x, double radius) {
      return b_.closingSpeed(-direction, blur, x, radius, time);
    };
    const double in_world = (part_a.most(of_a) + part_b.most(of_b)).timeFor(gap);
    if (!relative_) return in_world;
    const auto seen_from_a = [&](const Eigen::Vector3d& x, double radius) {
      return relative_->closingSpeed(-direction, blur, x, radius, time);
    };
    return std::max(in_world, part_b.most(seen_from_a).timeFor(gap));
  }

  /// The same of two hulls, where `gap` is the one between the hulls themselves: a point that is not at the front of
  /// its hull has its distance to the front to go, too. Of more than three points, a point of one hull is taken to meet
  /// the fastest of the other.
  double timeToTouch(double gap, const Eigen::Vector3d& direction, double blur, const MovingHull& part_a,
                     const MovingHull& part_b, double time) const;

  /// No distance between points of two balls ever changes faster.
  double fastest(const MovingBall& part_a, const MovingBall& part_b, double time) const;

 private:
  static constexpr std::size_t kFewPoints = 3;

  const Motion &a_, &b_;
  std::optional<RelativeMotion> relative_;
};

/// The motions that FCL names, from a pose to a pose.
AxisMotion translation(const Eigen::Isometry3d& begin, const Eigen::Isometry3d& end);
AxisMotion interpolation(const Eigen::Isometry3d& begin, const Eigen::Isometry3d& end);
AxisMotion screw(const Eigen::Isometry3d& begin, const Eigen::Isometry3d& end);
SplineMotion spline(const Eigen::Isometry3d& begin, const Eigen::Isometry3d& end);

}  // namespace bocst::query
