// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/motion.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace bocst::query {

using Eigen::AngleAxisd;
using Eigen::Isometry3d;
using Eigen::Vector3d;

double ClosingSpeed::timeFor(double gap) const {
  const double never = std::numeric_limits<double>::infinity();
  const double by_speed = ever > 0 ? gap / ever : never;
  if (!(change > 0)) return std::max(by_speed, now > 0 ? gap / now : never);
  const double root = std::sqrt(now * now + 2 * change * gap);
  return std::max(by_speed, now > 0 ? 2 * gap / (now + root) : (root - now) / change);
}

AxisMotion::AxisMotion(const Isometry3d& begin, const Vector3d& velocity)
    : AxisMotion(begin, velocity, Vector3d::Zero(), Vector3d::UnitX(), 0) {}

AxisMotion::AxisMotion(const Isometry3d& begin, const Vector3d& velocity, const Vector3d& arm, const Vector3d& axis,
                       double angle)
    : begin_(begin), velocity_(velocity), arm_(arm), axis_(axis), angle_(angle) {}

Isometry3d AxisMotion::at(double time) const {
  Isometry3d X = begin_;
  if (angle_ != 0) {
    const double turn = time * angle_, half = std::sin(turn / 2);
    X.linear() = AngleAxisd(turn, axis_).toRotationMatrix() * begin_.linear();
    // What the turn does to the arm, which may be long, with a small angle.
    const Vector3d across = axis_.cross(arm_);
    X.translation() += std::sin(turn) * across + 2 * half * half * axis_.cross(across);
  }
  X.translation() += time * velocity_;
  return X;
}

Vector3d AxisMotion::around(const Vector3d& point, double time) const {
  return axis_.cross(point - begin_.translation() - time * velocity_) + axis_.cross(arm_);
}

ClosingSpeed AxisMotion::closingSpeed(const Vector3d& direction, double blur, const Vector3d& center, double radius,
                                      double time) const {
  const double straight = direction.dot(velocity_) + blur * velocity_.norm();
  if (angle_ == 0) return {straight, straight, 0};
  // Each point keeps its distance from the axis, moves across it, and is drawn towards it.
  const double speed = std::abs(angle_);
  const Vector3d displacement = around(center, time);
  const double distance = displacement.norm() + radius, across = direction.cross(axis_).norm() + blur;
  const double now = angle_ * direction.dot(displacement) + speed * (across * radius + blur * distance);
  return {straight + speed * across * distance, straight + now, speed * speed * across * distance};
}

double AxisMotion::fastest(const Vector3d& center, double radius, double time) const {
  return velocity_.norm() + std::abs(angle_) * (around(center, time).norm() + radius);
}

RevolutionMotion::RevolutionMotion(const AxisMotion& motion, const Vector3d& own_axis)
    : motion_(motion), own_axis_(own_axis), turn_(motion.turn().norm()) {
  const Isometry3d begin = motion.at(0);
  sine_ = turn_ > 0 ? (begin.linear() * own_axis).cross(motion.turn() / turn_).norm() : 0;
  orbit_ = turn_ > 0 ? motion.around(begin.translation(), 0).norm() : 0;
}

// With the turn p and the own axis k, the frame turns by q = k x (p x k). All of it goes round p: q' = p x q, and the
// length of q does not change.
ClosingSpeed RevolutionMotion::closingSpeed(const Vector3d& direction, double blur, const Vector3d& center,
                                            double radius, double time) const {
  const Isometry3d X = at(time);
  const Vector3d own_axis = X.linear() * own_axis_, arm = center - X.translation();
  const Vector3d turn = own_axis.cross(motion_.turn().cross(own_axis));
  const Vector3d velocity = motion_.velocityAt(X.translation(), time);
  const double distance = arm.norm() + radius, wobble = turn_ * sine_, error = rounding(X.translation(), distance);
  const double straight = direction.dot(motion_.velocity()) + blur * motion_.velocity().norm();
  const double now = direction.dot(velocity + turn.cross(arm)) + direction.cross(turn).norm() * radius +
                     blur * (velocity.norm() + wobble * distance) + error;
  return {straight + turn_ * orbit_ + wobble * distance + error, now,
          turn_ * turn_ * orbit_ + wobble * (turn_ + wobble) * distance + turn_ * error};
}

double RevolutionMotion::fastest(const Vector3d& center, double radius, double time) const {
  const Vector3d origin = at(time).translation();
  const double distance = (center - origin).norm() + radius;
  return motion_.velocity().norm() + turn_ * (orbit_ + sine_ * distance) + rounding(origin, distance);
}

// What is left of a turn whose axes are nearly the same may be this.
double RevolutionMotion::rounding(const Vector3d& origin, double distance) const {
  return 1e-14 * (motion_.velocity().norm() + turn_ * (orbit_ + distance)) + 1e-15 * turn_ * origin.norm();
}

SplineMotion::SplineMotion(const Points& positions, const Points& rotations)
    : positions_(positions), rotations_(rotations) {
  // The derivatives of a B-spline are those of its differences, so they stay in their convex hull. exp'(W) has norm
  // |W'| at most, as W is skew, and exp''(W) has |W''| + |W'|^2: each is an integral over products of rotations with
  // these.
  for (std::size_t i = 0; i < 3; ++i) {
    velocities_[i] = positions[i + 1] - positions[i];
    turns_[i] = rotations[i + 1] - rotations[i];
    turn_ = std::max(turn_, turns_[i].norm());
  }
  for (std::size_t i = 0; i < 2; ++i) {
    accelerations_[i] = velocities_[i + 1] - velocities_[i];
    turn_change_ = std::max(turn_change_, (turns_[i + 1] - turns_[i]).norm());
  }
  turn_change_ += turn_ * turn_;
}

namespace {

Vector3d onSpline(const SplineMotion::Points& p, double t) {
  const double s = 1 - t;
  return (s * s * s * p[0] + (4 - 6 * t * t + 3 * t * t * t) * p[1] + (4 - 6 * s * s + 3 * s * s * s) * p[2] +
          t * t * t * p[3]) /
         6;
}

Vector3d derivative(const std::array<Vector3d, 3>& d, double t) {
  const double s = 1 - t;
  return (s * s * d[0] + (1 + 2 * t * s) * d[1] + t * t * d[2]) / 2;
}

// The angular velocity of exp(w) when w changes by dw.
Vector3d angularVelocity(const Vector3d& w, const Vector3d& dw) {
  const double t = w.norm(), tt = t * t;
  const double a = t > 1e-4 ? (1 - std::cos(t)) / tt : 0.5 - tt / 24;
  const double b = t > 1e-2 ? (t - std::sin(t)) / (tt * t) : 1.0 / 6 - tt / 120;
  return dw + a * w.cross(dw) + b * w.cross(w.cross(dw));
}

}  // namespace

Isometry3d SplineMotion::at(double time) const {
  const Vector3d turn = onSpline(rotations_, time);
  const double angle = turn.norm();
  Isometry3d X = Isometry3d::Identity();
  if (angle > 0) X.linear() = AngleAxisd(angle, turn / angle).toRotationMatrix();
  X.translation() = onSpline(positions_, time);
  return X;
}

ClosingSpeed SplineMotion::closingSpeed(const Vector3d& direction, double blur, const Vector3d& center, double radius,
                                        double time) const {
  double straight = direction.dot(velocities_[0]), fastest = 0, change = direction.dot(accelerations_[0]);
  for (const Vector3d& v : velocities_) {
    straight = std::max(straight, direction.dot(v));
    fastest = std::max(fastest, v.norm());
  }
  change = std::max(change, direction.dot(accelerations_[1]));
  change += blur * std::max(accelerations_[0].norm(), accelerations_[1].norm());
  const Vector3d arm = center - onSpline(positions_, time);
  const double distance = arm.norm() + radius;
  const Vector3d turn = angularVelocity(onSpline(rotations_, time), derivative(turns_, time));
  const double now = direction.dot(derivative(velocities_, time) + turn.cross(arm)) +
                     direction.cross(turn).norm() * radius + 1e-12 * (fastest + turn_ * distance);
  return {straight + blur * fastest + turn_ * distance, now + blur * (fastest + turn_ * distance),
          change + turn_change_ * distance};
}

double SplineMotion::fastest(const Vector3d& center, double radius, double time) const {
  double straight = 0;
  for (const Vector3d& v : velocities_) straight = std::max(straight, v.norm());
  return straight + turn_ * ((center - onSpline(positions_, time)).norm() + radius);
}

RelativeMotion::RelativeMotion(const AxisMotion& a, const AxisMotion& b)
    : velocity_(b.velocity() - a.velocity()),
      velocity_b_(b.velocity()),
      turn_a_(a.turn()),
      turn_(b.turn() - a.turn()),
      axis_b_(b.pointOfAxis()),
      between_(b.pointOfAxis() - a.pointOfAxis()),
      speeds_(a.velocity().norm() + b.velocity().norm()),
      turns_(a.turn().norm() + b.turn().norm()) {}

// With u from B's axis to a point of B, s from A's axis to B's, w = s', and the turns p of A and p + d of B, the
// point's velocity as A sees it is w + d x u - p x s, and its acceleration (d x p) x u + d x (d x u) + p x (p x s) - 2
// p x w. The length of u does not change, and s is linear in the time: what is affine in it is longest at an end.
ClosingSpeed RelativeMotion::closingSpeed(const Vector3d& direction, double blur, const Vector3d& center, double radius,
                                          double time) const {
  const double ever = fastest(center, radius, time), distance = distanceToAxis(center, radius, time);
  const Vector3d displacement = center - axis_b_ - time * velocity_b_;
  const double now = direction.dot(shift(time) + turn_.cross(displacement)) + turn_.cross(direction).norm() * radius +
                     blur * ever + rounding(distance, time);
  const auto drawn = [this](double t) {
    return (turn_a_.cross(turn_a_.cross(between(t))) - 2 * turn_a_.cross(velocity_)).norm();
  };
  const double change = (turn_.cross(turn_a_).norm() + turn_.squaredNorm()) * distance +
                        std::max(drawn(time), drawn(1)) + turns_ * rounding(distance, time);
  return {ever, now, change};
}

double RelativeMotion::fastest(const Vector3d& center, double radius, double time) const {
  const double distance = distanceToAxis(center, radius, time);
  return std::max(shift(time).norm(), shift(1).norm()) + turn_.norm() * distance + rounding(distance, time);
}

// What is left of velocities that nearly cancel may be this.
double RelativeMotion::rounding(double distance, double time) const {
  return 1e-13 * (speeds_ + turns_ * (distance + std::max(between(time).norm(), between(1).norm())));
}

MotionPair::MotionPair(const Motion& a, const Motion& b) : a_(a), b_(b) {
  const auto *axis_a = dynamic_cast<const AxisMotion*>(&a), *axis_b = dynamic_cast<const AxisMotion*>(&b);
  // Without a turn of both, what they do together is in the sum of their speeds along a direction already.
  if (axis_a == nullptr || axis_b == nullptr || axis_a->turn().isZero(0) || axis_b->turn().isZero(0)) return;
  relative_.emplace(*axis_a, *axis_b);
}

namespace {

/// How far the points of a hull are behind its front, that along `direction`.
class BehindFront {
 public:
  BehindFront(const MovingHull& hull, const Vector3d& direction, double blur) : direction_(direction) {
    double size = 0;
    for (std::size_t i = 0; i < hull.count; ++i) {
      front_ = std::max(front_, direction.dot(hull.points[i]));
      size = std::max(size, (hull.points[i] - hull.points[0]).norm());
    }
    front_ -= 2 * blur * size;
  }
  double operator()(const Vector3d& point) const { return std::max(0.0, front_ - direction_.dot(point)); }

 private:
  const Vector3d direction_;
  double front_ = -std::numeric_limits<double>::infinity();
};

}  // namespace

double MotionPair::timeToTouch(double gap, const Vector3d& direction, double blur, const MovingHull& part_a,
                               const MovingHull& part_b, double time) const {
  constexpr double kNever = std::numeric_limits<double>::infinity();
  const BehindFront behind_a(part_a, direction, blur), behind_b(part_b, -direction, blur);
  const auto speed_a = [&](const Vector3d& x, double) { return a_.closingSpeed(direction, blur, x, 0, time); };
  const auto speed_b = [&](const Vector3d& x, double) { return b_.closingSpeed(-direction, blur, x, 0, time); };
  double in_world = kNever;
  if (part_a.count <= kFewPoints && part_b.count <= kFewPoints) {
    ClosingSpeed of_a[kFewPoints];
    double from_a[kFewPoints];
    for (std::size_t i = 0; i < part_a.count; ++i) {
      of_a[i] = speed_a(part_a.points[i], 0);
      from_a[i] = gap + behind_a(part_a.points[i]);
    }
    for (std::size_t j = 0; j < part_b.count; ++j) {
      const double more = behind_b(part_b.points[j]);
      const ClosingSpeed of_b = speed_b(part_b.points[j], 0);
      for (std::size_t i = 0; i < part_a.count; ++i) {
        in_world = std::min(in_world, (of_a[i] + of_b).timeFor(from_a[i] + more));
      }
    }
  } else {
    const ClosingSpeed fastest_a = part_a.most(speed_a), fastest_b = part_b.most(speed_b);
    const double most = (fastest_a.ever + fastest_b.ever) * (1 - time);  // what is farther is not met
    const auto first = [&](const MovingHull& part, const BehindFront& behind, const auto& speed_of,
                           const ClosingSpeed& of_other) {
      double least = kNever;
      for (std::size_t i = 0; i < part.count; ++i) {
        const double free = gap + behind(part.points[i]);
        if (free <= most) least = std::min(least, (speed_of(part.points[i], 0) + of_other).timeFor(free));
      }
      return least;
    };
    in_world = std::max(first(part_a, behind_a, speed_a, fastest_b), first(part_b, behind_b, speed_b, fastest_a));
  }
  if (!relative_) return in_world;
  double seen_from_a = kNever;
  for (std::size_t j = 0; j < part_b.count; ++j) {
    const Vector3d& q = part_b.points[j];
    seen_from_a =
        std::min(seen_from_a, relative_->closingSpeed(-direction, blur, q, 0, time).timeFor(gap + behind_b(q)));
  }
  return std::max(in_world, seen_from_a);
}

double MotionPair::fastest(const MovingBall& part_a, const MovingBall& part_b, double time) const {
  const double in_world =
      a_.fastest(part_a.center, part_a.radius, time) + b_.fastest(part_b.center, part_b.radius, time);
  return relative_ ? std::min(in_world, relative_->fastest(part_b.center, part_b.radius, time)) : in_world;
}

AxisMotion translation(const Isometry3d& begin, const Isometry3d& end) {
  return {begin, end.translation() - begin.translation()};
}

AxisMotion interpolation(const Isometry3d& begin, const Isometry3d& end) {
  const AngleAxisd turn(Eigen::Matrix3d(end.linear() * begin.linear().transpose()));
  return {begin, end.translation() - begin.translation(), Vector3d::Zero(), turn.axis(), turn.angle()};
}

AxisMotion screw(const Isometry3d& begin, const Isometry3d& end) {
  const AngleAxisd turn(Eigen::Matrix3d(end.linear() * begin.linear().transpose()));
  const Vector3d displacement = end.translation() - begin.translation(), axis = turn.axis();
  // Below, the two motions are the same up to rounding.
  if (std::abs(turn.angle()) < 1e-14) return interpolation(begin, end);
  const Vector3d across = displacement - axis.dot(displacement) * axis;
  const Vector3d arm = -(across + axis.cross(displacement) / std::tan(turn.angle() / 2)) / 2;
  return {begin, axis.dot(displacement) * axis, arm, axis, turn.angle()};
}

SplineMotion spline(const Isometry3d& begin, const Isometry3d& end) {
  const auto vectorOf = [](const Isometry3d& X) {
    const AngleAxisd turn(X.linear());
    return Vector3d(turn.angle() * turn.axis());
  };
  Vector3d first = vectorOf(begin), last = vectorOf(end);
  // Of the rotation vectors that mean the same, the nearest.
  if (last.norm() > 0) {
    const Vector3d axis = last.normalized();
    const double around = 2 * std::acos(-1.0);
    last += axis * around * std::round((first - last).dot(axis) / around);
  }
  // Evenly spaced on a line, the four points make a spline that runs from the second to the third.
  const auto line = [](const Vector3d& p, const Vector3d& q) {
    return SplineMotion::Points{p - (q - p), p, q, q + (q - p)};
  };
  return {line(begin.translation(), end.translation()), line(first, last)};
}

}  // namespace bocst::query
