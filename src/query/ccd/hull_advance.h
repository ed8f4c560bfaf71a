// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>

#include <limits>
#include <vector>

#include "geometry/convex_shape.h"
#include "geometry/motion.h"

namespace bocst::query {

/// The convex hull of points, which must outlive it.
class HullShape final : public SupportShape {
 public:
  explicit HullShape(const std::vector<Eigen::Vector3d>& points) : SupportShape(boxOf(points), 0), points_(points) {}

 protected:
  Eigen::Vector3d support(const Eigen::Vector3d& d) const override {
    return PointSet{points_.data(), static_cast<int>(points_.size())}.support(d);
  }

 private:
  const std::vector<Eigen::Vector3d>& points_;
};

/// A time before which two moving meshes are surely farther apart than `clearance`, because their convex hulls are;
/// more than 1: they are so all the time. Some steps of conservative advancement, as in ContactTimeWalk; each looks at
/// all vertices some twenty times. All in world coordinates.
inline double hullsApartUntil(const Mesh& a, const Motion& motion_a, const Mesh& b, const Motion& motion_b,
                              double clearance) {
  constexpr int kMostSteps = 24, kMostShortSteps = 2;  // so many short ones in a row mean that they soon touch
  constexpr double kShortStep = 1.0 / 32;
  constexpr double kRounding = 1e-14, kBlur = 1e-15;
  const auto place = [](const Mesh& mesh, const Eigen::Isometry3d& X, std::vector<Eigen::Vector3d>& points) {
    points.clear();
    const Eigen::AlignedBox3d box = mesh.bounds();  // vertices of no triangle may lie anywhere
    for (const Eigen::Vector3d& v : mesh.vertices()) {
      if (box.contains(v)) points.push_back(X * v);
    }
  };
  const double size = a.bounds().diagonal().norm() + b.bounds().diagonal().norm();
  const MotionPair motions(motion_a, motion_b);
  std::vector<Eigen::Vector3d> points_a, points_b;
  double time = 0;
  int short_steps = 0;
  for (int step = 0; step < kMostSteps && short_steps < kMostShortSteps && time <= 1; ++step) {
    const Eigen::Isometry3d X_WA = motion_a.at(time), X_WB = motion_b.at(time);
    place(a, X_WA, points_a);
    place(b, X_WB, points_b);
    const SeparationResult gap = HullShape(points_b).gap({points_a.data(), static_cast<int>(points_a.size())},
                                                         std::numeric_limits<double>::infinity());
    const double farthest = (X_WA * a.bounds().center()).norm() + (X_WB * b.bounds().center()).norm();
    const double free = gap.at_least - kRounding * (farthest + 2 * size) - clearance;
    if (!(free > 0)) break;
    // gap.normal leads from B to A.
    const double later = motions.timeToClose(free, -gap.normal, kBlur, MovingHull{points_a.data(), points_a.size()},
                                             MovingHull{points_b.data(), points_b.size()}, time);
    short_steps = later < kShortStep ? short_steps + 1 : 0;
    time += later * (1 - 1e-12);
  }
  return time;
}

}  // namespace bocst::query
