// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>

#include <cstddef>
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

/// Advances two moving sets of points while their convex hulls are surely farther apart than `clearance`, by steps of
/// conservative advancement as in ContactTimeWalk. All in world coordinates.
class HullAdvance {
 public:
  /// The hulls are not asked about before `begin`.
  HullAdvance(const MotionPair& motions, double clearance, double begin)
      : motions_(motions), clearance_(clearance), time_(begin) {}

  /// They are apart before this time; more than 1: all the time.
  double time() const { return time_; }

  /// One step; false if it leads no farther. place(time, points_a, points_b) says where the points are. Looks at all of
  /// them some twenty times.
  template <typename Place>
  bool step(Place&& place) {
    constexpr double kRounding = 1e-14, kBlur = 1e-15;
    if (met_ || time_ > 1) return false;
    place(time_, points_a_, points_b_);
    const HullShape b(points_b_);
    const SeparationResult gap =
        b.gap({points_a_.data(), static_cast<int>(points_a_.size())}, std::numeric_limits<double>::infinity());
    const double free = gap.at_least - kRounding * (largest(points_a_) + largest(points_b_)) - clearance_;
    met_ = !(free > 0);
    if (met_) return false;
    // gap.normal leads from B to A.
    time_ += motions_.timeToTouch(free, -gap.normal, kBlur, {points_a_.data(), points_a_.size()},
                                  {points_b_.data(), points_b_.size()}, time_) *
             (1 - 1e-12);
    return true;
  }

 private:
  static double largest(const std::vector<Eigen::Vector3d>& points) {
    const Eigen::AlignedBox3d box = boxOf(points);
    return box.min().cwiseAbs().cwiseMax(box.max().cwiseAbs()).norm() + box.diagonal().norm();
  }

  const MotionPair& motions_;
  const double clearance_;
  double time_;
  bool met_ = false;
  std::vector<Eigen::Vector3d> points_a_, points_b_;
};

/// The hulls of two meshes that move.
class MeshHullAdvance {
 public:
  MeshHullAdvance(const Mesh& a, const Mesh& b, const MotionPair& motions, double clearance)
      : a_(a), b_(b), motions_(motions), hulls_(motions, clearance, 0) {}

  /// At most so many steps more; fewer where the hulls hardly advance, as before they touch. Returns
  /// HullAdvance::time().
  double run(std::size_t steps) {
    constexpr double kShortStep = 1.0 / 1024;
    const auto place = [this](double time, auto& points_a, auto& points_b) {
      placeVertices(a_, motions_.a().at(time), points_a);
      placeVertices(b_, motions_.b().at(time), points_b);
    };
    for (double before = -1; steps > 0 && hulls_.time() - before > kShortStep; --steps) {
      before = hulls_.time();
      hulls_.step(place);
    }
    return hulls_.time();
  }

 private:
  // Vertices of no triangle may lie anywhere, and are left out.
  static void placeVertices(const Mesh& mesh, const Eigen::Isometry3d& X, std::vector<Eigen::Vector3d>& points) {
    points.clear();
    const Eigen::AlignedBox3d box = mesh.bounds();
    for (const Eigen::Vector3d& v : mesh.vertices()) {
      if (box.contains(v)) points.push_back(X * v);
    }
  }

  const Mesh &a_, &b_;
  const MotionPair& motions_;
  HullAdvance hulls_;
};

}  // namespace bocst::query
