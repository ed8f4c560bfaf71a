// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "geometry/triangle.h"
#include "geometry/volume.h"

// Lower bounds of the distance between bodies, for distance queries. All in double, in one frame.

namespace bocst::query {

/// A pose relative to another may stretch a length by this factor: entries of R^T R - I of at most 1e-3 change the
/// square of a length by at most 3e-3, and either rotation may be so far off. 1.003 / 0.997 is less than its square.
constexpr double kMostStretch = 1.0031;

/// What bounds the surface of a node, placed in the common frame: a box of any direction AND a slab. The placed axes
/// need not be at right angles or of unit length.
struct NodeExtent {
  Eigen::Vector3d center;
  Eigen::Matrix3d axes;  ///< Columns.
  Eigen::Vector3d half;
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< Of the slab, along the axes; zero without a slab.
  double slab_offset = 0, slab_half = 0;             ///< Along normal, from center.

  NodeExtent(const Volume& v, const SimilarityTransform& to) : axes(to.rotation) {
    center = to * Eigen::Vector3d(v.center[0], v.center[1], v.center[2]);
    // All but the centre was rounded to float: twice over is enough.
    constexpr double round = 0x1p-22;
    half = Eigen::Vector3d(v.half[0], v.half[1], v.half[2]) * (to.scale * (1 + round));
    normal = Eigen::Vector3d(v.normal[0], v.normal[1], v.normal[2]);
    slab_offset = v.slab_offset * to.scale;
    slab_half = v.slab_half * to.scale + round * (std::abs(slab_offset) + half.sum());
  }
  NodeExtent(const OrientedVolume& v, const SimilarityTransform& to)
      : center(to * v.center), axes(to.rotation * v.axes), half(v.half * to.scale) {}

  /// Along a unit direction the node reaches from lo to hi, counted from its centre.
  void along(const Eigen::Vector3d& direction, double& lo, double& hi) const {
    const Eigen::Vector3d along_axes = axes.transpose() * direction;
    hi = along_axes.cwiseAbs().dot(half);
    lo = -hi;
    const double nn = normal.squaredNorm();
    if (!(nn > 0)) return;
    const double a = along_axes.dot(normal) / nn, middle = a * slab_offset;
    const double extent = std::abs(a) * slab_half + (along_axes - a * normal).cwiseAbs().dot(half);
    lo = std::max(lo, middle - extent);
    hi = std::min(hi, middle + extent);
  }
};

/// Calls f(direction) with directions along which the gap between two nodes may be large, the most likely one first,
/// until it returns true. True if it did. All are of unit length.
template <typename F>
bool anyDirectionApart(const NodeExtent& a, const NodeExtent& b, const F& f) {
  const Eigen::Vector3d t = b.center - a.center;
  const double apart = t.norm();
  if (apart > 0 && f(Eigen::Vector3d(t / apart))) return true;
  // On three axes at right angles, gaps add up as the sides of a box: the way between the nodes is the diagonal. Axes
  // in float are not quite at right angles, which matters far away, so no bound follows from the gaps themselves.
  const Eigen::Matrix3d s = (a.axes.transpose() * b.axes).cwiseAbs();
  const Eigen::Vector3d in_a = a.axes.transpose() * t, in_b = b.axes.transpose() * t;
  const Eigen::Vector3d gap_a = (in_a.cwiseAbs() - a.half - s * b.half).cwiseMax(0);
  const Eigen::Vector3d gap_b = (in_b.cwiseAbs() - b.half - s.transpose() * a.half).cwiseMax(0);
  const Eigen::Vector3d directions[] = {a.axes * gap_a.cwiseProduct(in_a.cwiseSign()),
                                        b.axes * gap_b.cwiseProduct(in_b.cwiseSign()), a.axes * a.normal,
                                        b.axes * b.normal};
  for (const Eigen::Vector3d& direction : directions) {
    const double length = direction.norm();
    if (length > 0 && f(Eigen::Vector3d(direction / length))) return true;
  }
  return false;
}

/// The error of computations in double, as a share of the distance and of all half extents; twice this is enough for
/// the boxes of a BoxTree, which are 2^-30 lattice units larger.
constexpr double kExtentRounding = 1e-13;

/// A lower bound of the distance of two nodes, less kExtentRounding of the sizes. `guess` is a direction along which
/// the bound is likely to be good, or zero; a bound of `cutoff` or more is not improved.
inline double distanceBound(const NodeExtent& a, const NodeExtent& b, const Eigen::Vector3d& guess, double cutoff) {
  const Eigen::Vector3d t = b.center - a.center;
  const double apart = t.norm(), rounding_margin = kExtentRounding * (apart + a.half.sum() + b.half.sum());
  double best = 0;
  const auto reachesCutoff = [&](const Eigen::Vector3d& direction) {
    double lo_a, hi_a, lo_b, hi_b;
    a.along(direction, lo_a, hi_a);
    b.along(direction, lo_b, hi_b);
    const double d = direction.dot(t);
    best = std::max({best, d + lo_b - hi_a, lo_a - d - hi_b});
    return best - rounding_margin >= cutoff;
  };
  if (!(guess.squaredNorm() > 0 && reachesCutoff(guess))) anyDirectionApart(a, b, reachesCutoff);
  return best - rounding_margin;
}

/// The same of a triangle and a node, along the line from the triangle's point nearest to the node's centre.
inline double distanceBound(const Corners& triangle, const NodeExtent& node) {
  const Eigen::Vector3d line = node.center - closestPoint(node.center, triangle);
  const double length = line.norm();
  if (!(length > 0)) return 0;
  const Eigen::Vector3d direction = line / length;
  double lo, hi, gap = std::numeric_limits<double>::infinity(), size = node.half.sum();
  node.along(direction, lo, hi);
  for (const Eigen::Vector3d& corner : triangle) {
    const Eigen::Vector3d way = node.center - corner;
    gap = std::min(gap, direction.dot(way));
    size = std::max(size, way.norm());
  }
  return gap + lo - 2 * kExtentRounding * size;
}

/// Some point of a is no farther from one of b than this.
inline double farthest(const NodeExtent& a, const NodeExtent& b) {
  return ((b.center - a.center).norm() + kMostStretch * (a.half.norm() + b.half.norm())) * (1 + 1e-12);
}

/// A ball that holds what `s` held before it was placed.
inline Sphere stretched(const Sphere& s) { return {s.center, kMostStretch * s.radius}; }

/// A triangle and its box.
struct TriangleExtent {
  Corners corners;
  Eigen::Vector3d lo, hi;
  double lowest = 0, highest = 0;  ///< Along a direction, see along().
  std::uint32_t id = 0;

  void ready() {
    lo = corners[0].cwiseMin(corners[1]).cwiseMin(corners[2]);
    hi = corners[0].cwiseMax(corners[1]).cwiseMax(corners[2]);
  }
  Eigen::Vector3d middle() const { return corners[0] + corners[1] + corners[2]; }  ///< Times three.
  void along(const Eigen::Vector3d& direction) {
    const double x = direction.dot(corners[0]), y = direction.dot(corners[1]), z = direction.dot(corners[2]);
    lowest = std::min({x, y, z});
    highest = std::max({x, y, z});
  }
};

/// The box about a body, placed by `to`. Triangles that are apart from it along its axes or those of the frame are not
/// tested against the body itself. Triangles are in a root cube; the margin is that of boxesApart().
class BodyBox {
 public:
  BodyBox(const OrientedVolume& box, const SimilarityTransform& to)
      : center_(to * box.center), axes_(to.rotation * box.axes), half_(to.scale * box.half) {
    constexpr double kRoot = 3 * (1 << lattice::kBits);
    const double margin =
        (center_.lpNorm<1>() + kRoot + half_.lpNorm<1>()) * (64 * 0x1p-53 + 4 * to.orthogonality_error) + to.tolerance;
    half_.array() += margin;
    const Eigen::Vector3d extent = axes_.cwiseAbs() * half_;
    lo_ = center_ - extent;
    hi_ = center_ + extent;
  }

  // Comparisons with what is infinite or none (of a plane's box) say no.
  bool isApart(const TriangleExtent& t) const {
    for (int k = 0; k < 3; ++k) {
      if (t.hi[k] < lo_[k] || t.lo[k] > hi_[k]) return true;
    }
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d axis = axes_.col(k);
      const double middle = axis.dot(center_), p = axis.dot(t.corners[0]) - middle, q = axis.dot(t.corners[1]) - middle,
                   r = axis.dot(t.corners[2]) - middle;
      if (std::min({p, q, r}) > half_[k] || std::max({p, q, r}) < -half_[k]) return true;
    }
    return false;
  }

 private:
  Eigen::Vector3d center_;
  Eigen::Matrix3d axes_;
  Eigen::Vector3d half_, lo_, hi_;
};

/// True if the one is at least this far from the other, by their boxes or along the line of their middles.
inline bool isBeyond(const TriangleExtent& a, const TriangleExtent& b, double distance) {
  const double least = distance * (1 + 1e-12);
  if ((b.lo - a.hi).cwiseMax(a.lo - b.hi).cwiseMax(0).squaredNorm() >= least * least) return true;
  const Eigen::Vector3d line = b.middle() - a.middle();
  double highest = line.dot(a.corners[0]), lowest = line.dot(b.corners[0]);
  for (int k = 1; k < 3; ++k) {
    highest = std::max(highest, line.dot(a.corners[k]));
    lowest = std::min(lowest, line.dot(b.corners[k]));
  }
  const double size = a.corners[0].lpNorm<1>() + b.corners[0].lpNorm<1>();
  return lowest - highest >= line.norm() * (least + 1e-14 * size);
}

}  // namespace bocst::query
