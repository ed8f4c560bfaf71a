// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// Triangles whose corners are integers, small enough for the fast path of exact.h.

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "exact.h"

namespace bocst::fuzz {

using Integer = std::int64_t;
constexpr Integer kMaxCoordinate = (1 << 18) - 1;

struct Point {
  Integer x, y, z;
  friend Point operator+(const Point& a, const Point& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  friend Point operator-(const Point& a, const Point& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend Point operator*(Integer s, const Point& a) { return {s * a.x, s * a.y, s * a.z}; }
  friend bool operator==(const Point& a, const Point& b) { return a.x == b.x && a.y == b.y && a.z == b.z; }
};
using Corners = std::array<Point, 3>;

inline Integer dot(const Point& a, const Point& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

inline bool hasArea(const Corners& t) {
  const Point e = t[1] - t[0], f = t[2] - t[0];
  return !(Point{e.y * f.z, e.z * f.x, e.x * f.y} == Point{e.z * f.y, e.x * f.z, e.y * f.x});
}

/// The distance of their bounding boxes: no more than that of the triangles.
inline double boxDistance(const Corners& p, const Corners& q) {
  double squared = 0;
  for (const auto c : {&Point::x, &Point::y, &Point::z}) {
    const Integer gap = std::max(std::min({p[0].*c, p[1].*c, p[2].*c}) - std::max({q[0].*c, q[1].*c, q[2].*c}),
                                 std::min({q[0].*c, q[1].*c, q[2].*c}) - std::max({p[0].*c, p[1].*c, p[2].*c}));
    if (gap > 0) squared += static_cast<double>(gap) * static_cast<double>(gap);
  }
  return std::sqrt(squared);
}

/// 0 exactly where they meet, else rounded.
inline double distance(const Corners& p, const Corners& q) {
  exact::Corners a, b;
  for (std::size_t i = 0; i < 3; ++i) {
    a[i] << static_cast<double>(p[i].x), static_cast<double>(p[i].y), static_cast<double>(p[i].z);
    b[i] << static_cast<double>(q[i].x), static_cast<double>(q[i].y), static_cast<double>(q[i].z);
  }
  return std::sqrt(static_cast<double>(exact::squaredDistance(a, b)));
}

}  // namespace bocst::fuzz
