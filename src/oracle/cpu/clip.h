// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "oracle/oracle.h"

namespace bocst::oracle {

/// Clipping happens in the cell's own coordinates (centre 0, half side 1) in double; its rounding, at most about
/// 4 * 2^-53 * 2^17 = 6e-11 there, is covered by this margin on every plane and on every bound.
constexpr double kClipMargin = 1e-9;

/// A triangle cut by at most 6 + 3 planes.
struct Polygon {
  std::array<Eigen::Vector3d, 12> corners;
  int count = 0;
};

/// What is known of the surface in one octant while its triangles go by.
class OctantAccumulator {
 public:
  void clear();

  /// A polygon of the surface inside the octant. keep: remember the corners for the slab.
  void add(const Eigen::Vector3d* corners, int count, bool keep);

  /// A part of the surface whose clipped form is not known beyond this box.
  void addBox(const Eigen::Vector3d& lo, const Eigen::Vector3d& hi);

  /// All of what `other` has seen, as if it had been added here.
  void merge(const OctantAccumulator& other);

  /// The bounds in a cell of the given centre and side, in the same coordinates as the parts.
  CellBounds bounds(const Eigen::Vector3d& center, double side) const;

 private:
  Eigen::Vector3d lo_, hi_;
  Eigen::Vector3d area_;  // doubled area vector, all parts turned to one side
  bool slab_ = true;
  std::vector<Eigen::Vector3f> corners_;
};

/// Divides the triangle, given in the cell's own coordinates, among the octants of `mask` that it may meet.
/// emit(octant, polygon) is called for each octant that keeps a part.
template <typename Emit>
void clipToOctants(const Eigen::Vector3d corners[3], std::uint8_t mask, Emit&& emit);

// Implementation.

inline void cut(const Polygon& in, int axis, double bound, bool below, Polygon& out) {
  out.count = 0;
  const double sign = below ? 1 : -1;
  for (int i = 0; i < in.count; ++i) {
    const Eigen::Vector3d& a = in.corners[i];
    const Eigen::Vector3d& b = in.corners[i + 1 == in.count ? 0 : i + 1];
    const double da = sign * (a[axis] - bound), db = sign * (b[axis] - bound);
    if (da <= 0) out.corners[out.count++] = a;
    if ((da < 0 && db > 0) || (da > 0 && db < 0)) {
      Eigen::Vector3d p = a + (da / (da - db)) * (b - a);
      p[axis] = bound;
      out.corners[out.count++] = p;
    }
  }
}

inline void extremes(const Polygon& p, int axis, double& lo, double& hi) {
  lo = hi = p.corners[0][axis];
  for (int i = 1; i < p.count; ++i) {
    lo = std::min(lo, p.corners[i][axis]);
    hi = std::max(hi, p.corners[i][axis]);
  }
}

template <typename Emit>
void divide(const Polygon& p, int axis, int octant, std::uint8_t mask, Emit& emit) {
  if (axis == 3) {
    emit(octant, p);
    return;
  }
  // The octants of `mask` on either side, among those that agree with `octant` on the axes already divided.
  static constexpr std::uint8_t kUpper[3] = {0xaa, 0xcc, 0xf0};
  const std::uint8_t upper = mask & kUpper[axis], lower = mask & static_cast<std::uint8_t>(~kUpper[axis]);
  double lo, hi;
  extremes(p, axis, lo, hi);
  Polygon part;
  if (lower != 0 && lo <= kClipMargin) {
    if (hi <= kClipMargin) {
      divide(p, axis + 1, octant, lower, emit);
    } else {
      cut(p, axis, kClipMargin, true, part);
      if (part.count > 0) divide(part, axis + 1, octant, lower, emit);
    }
  }
  if (upper != 0 && hi >= -kClipMargin) {
    if (lo >= -kClipMargin) {
      divide(p, axis + 1, octant | 1 << axis, upper, emit);
    } else {
      cut(p, axis, -kClipMargin, false, part);
      if (part.count > 0) divide(part, axis + 1, octant | 1 << axis, upper, emit);
    }
  }
}

template <typename Emit>
void clipToOctants(const Eigen::Vector3d corners[3], std::uint8_t mask, Emit&& emit) {
  Polygon p, q;
  p.count = 3;
  std::copy(corners, corners + 3, p.corners.begin());
  constexpr double outer = 1 + kClipMargin;
  for (int axis = 0; axis < 3; ++axis) {
    double lo, hi;
    extremes(p, axis, lo, hi);
    if (hi > outer) {
      cut(p, axis, outer, true, q);
      if (q.count == 0) return;
      std::swap(p, q);
    }
    if (lo < -outer) {
      cut(p, axis, -outer, false, q);
      if (q.count == 0) return;
      std::swap(p, q);
    }
  }
  divide(p, 0, 0, mask, emit);
}

}  // namespace bocst::oracle
