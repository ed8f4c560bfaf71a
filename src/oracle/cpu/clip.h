// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "bounds/cell_frame.h"
#include "oracle/oracle.h"

namespace bocst::oracle {

/// A point in the cell's own coordinates (centre 0, half side 1); the last of four lanes is 0.
using LocalPoint = Eigen::Vector4f;

/// Clipping moves each plane outwards by this, and each bound by twice as much. With u the unit roundoff and M the
/// triangle's largest coordinate, a corner is off by u M, and a point cut from an edge by 13 u M more than its ends: 4
/// u for the place along the edge, at most 2 M long, 2 u for the way there, and 1 u for the sum. A triangle is cut at
/// most nine times, so its parts are off by less than 128 u M: in float for M up to kFloatReach, in double for all M <=
/// 2^17.
constexpr float kClipMargin = 0x1p-14f;
constexpr float kFloatReach = 8;

/// A triangle cut by at most 6 + 3 planes, and the box of its corners.
template <typename Point>
struct Polygon {
  std::array<Point, 12 + 1> corners;  // the last is for what cut() tries
  int count = 0;
  Point lo, hi;

  void add(const Point& p) {
    lo = count == 0 ? p : Point(lo.cwiseMin(p));
    hi = count == 0 ? p : Point(hi.cwiseMax(p));
    corners[static_cast<std::size_t>(count++)] = p;
  }
};

/// What is known of the surface in one octant while its triangles go by.
class OctantAccumulator {
 public:
  void clear();

  /// A part of the surface, of no more than 12 corners. keep: remember these for the slab.
  void add(const LocalPoint* corners, int count, const LocalPoint& lo, const LocalPoint& hi, bool keep);
  template <typename Point>
  void add(const Polygon<Point>& part, bool keep);

  /// The bounds of all that the accumulators have seen, in a cell.
  static bounds::NodeBounds bounds(const OctantAccumulator* const* parts, std::size_t count,
                                   const bounds::CellFrame& frame);

 private:
  void extremesAlong(const LocalPoint& normal, float& lo, float& hi) const;

  LocalPoint lo_, hi_;
  LocalPoint area_;  // doubled area vector, all parts turned to one side
  bool slab_ = true;
  std::array<std::vector<float>, 3> corners_;
  std::size_t count_ = 0;
};

/// Divides the triangle among the octants of `mask` that it may meet.
/// emit(octant, polygon) is called for each octant that keeps a part.
template <typename Point, typename Emit>
void clipToOctants(const Point corners[3], std::uint8_t mask, Emit&& emit);

// Implementation.

template <typename Point>
void OctantAccumulator::add(const Polygon<Point>& part, bool keep) {
  if constexpr (std::is_same<Point, LocalPoint>::value) {
    add(part.corners.data(), part.count, part.lo, part.hi, keep);
  } else {
    Polygon<LocalPoint> rounded;
    for (int i = 0; i < part.count; ++i) {
      LocalPoint p = LocalPoint::Zero();
      p.head<3>() = part.corners[static_cast<std::size_t>(i)].template cast<float>();
      rounded.add(p);
    }
    add(rounded, keep);
  }
}

template <typename Point>
void cut(const Polygon<Point>& in, int axis, typename Point::Scalar bound, bool below, Polygon<Point>& out) {
  using S = typename Point::Scalar;
  // Out of a table: a coordinate that is written alone delays whoever reads the point.
  alignas(32) static constexpr S kUnit[3][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}};
  const Point unit = Eigen::Map<const Point>(kUnit[axis]), others = Point::Ones() - unit, plane = bound * unit;
  const S sign = below ? 1 : -1;
  const Point* a = &in.corners[static_cast<std::size_t>(in.count - 1)];
  S da = sign * ((*a)[axis] - bound);
  std::size_t count = 0;
  for (int i = 0; i < in.count; ++i) {
    const Point& b = in.corners[static_cast<std::size_t>(i)];
    const S db = sign * (b[axis] - bound);
    // Both are written, and stay if they are counted: to branch here is to guess.
    out.corners[count] = (*a + (da / (da - db)) * (b - *a)).cwiseProduct(others) + plane;
    count += static_cast<std::size_t>(((da < 0) & (db > 0)) | ((da > 0) & (db < 0)));
    out.corners[count] = b;
    count += static_cast<std::size_t>(db <= 0);
    a = &b;
    da = db;
  }
  out.count = static_cast<int>(count);
  if (count == 0) return;
  // As many steps as above, which are easier to foresee than as many as there are corners.
  out.lo = out.hi = out.corners[0];
  for (int i = 1; i <= in.count; ++i) {
    const Point& p = out.corners[std::min(static_cast<std::size_t>(i), count - 1)];
    out.lo = out.lo.cwiseMin(p);
    out.hi = out.hi.cwiseMax(p);
  }
}

template <typename Point, typename Emit>
void divide(const Polygon<Point>& p, int axis, int octant, std::uint8_t mask, Emit& emit) {
  if (axis == 3) {
    emit(octant, p);
    return;
  }
  // The octants of `mask` on either side, among those that agree with `octant` on the axes already divided.
  static constexpr std::uint8_t kUpper[3] = {0xaa, 0xcc, 0xf0};
  const std::uint8_t upper = mask & kUpper[axis], lower = mask & static_cast<std::uint8_t>(~kUpper[axis]);
  const auto lo = p.lo[axis], hi = p.hi[axis];
  Polygon<Point> part;
  if (lower != 0 && lo <= kClipMargin) {
    if (hi <= kClipMargin) {
      divide(p, axis + 1, octant, lower, emit);
    } else {
      cut<Point>(p, axis, kClipMargin, true, part);
      if (part.count > 0) divide(part, axis + 1, octant, lower, emit);
    }
  }
  if (upper != 0 && hi >= -kClipMargin) {
    if (lo >= -kClipMargin) {
      divide(p, axis + 1, octant | 1 << axis, upper, emit);
    } else {
      cut<Point>(p, axis, -kClipMargin, false, part);
      if (part.count > 0) divide(part, axis + 1, octant | 1 << axis, upper, emit);
    }
  }
}

template <typename Point, typename Emit>
void clipToOctants(const Point corners[3], std::uint8_t mask, Emit&& emit) {
  Polygon<Point> parts[2];
  Polygon<Point>*p = &parts[0], *q = &parts[1];
  for (int k = 0; k < 3; ++k) p->add(corners[k]);
  constexpr typename Point::Scalar outer = 1 + kClipMargin;
  for (int axis = 0; axis < 3; ++axis) {
    if (p->hi[axis] > outer) {
      cut<Point>(*p, axis, outer, true, *q);
      if (q->count == 0) return;
      std::swap(p, q);
    }
    if (p->lo[axis] < -outer) {
      cut<Point>(*p, axis, -outer, false, *q);
      if (q->count == 0) return;
      std::swap(p, q);
    }
  }
  divide(*p, 0, 0, mask, emit);
}

}  // namespace bocst::oracle
