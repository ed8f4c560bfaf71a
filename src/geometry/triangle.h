// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <limits>
#include <optional>

#include "geometry/penetration_kernels.h"

namespace bocst::query {

using Corners = std::array<Eigen::Vector3d, 3>;

/// Where two primitives touch: unit normal from the first to the second, depth >= 0 such that moving the second by
/// depth * normal ends the overlap, and a point midway in it.
struct ContactPoint {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitX();
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  double depth = 0;
};

/// The shortest way to part two triangles that touch: the separating axis (face normals, edge cross products, in-plane
/// edge normals) with the least overlap. point is the middle of the segment in which they cut, or of the polygon that
/// they share if they are coplanar; else it is between their nearest points.
ContactPoint trianglePenetration(const Corners& p, const Corners& q);

/// What the depths of many pairs say, a bit each: whether FCL's test surely finds that they meet, or that they do not.
struct PenetrationVerdicts {
  std::uint32_t meet, apart;
};

/// The same for many pairs at once, whether they touch or not; `contacts` has room for pairs.count, or is null where
/// nobody asks. `tolerance` is a length that corners may be off by without that meet or apart is wrong.
PenetrationVerdicts trianglePenetrations(const TrianglePairs& pairs, double tolerance, ContactPoint* contacts);

/// Of the segment in which two triangles cut each other, the smallest coordinate along a direction, known to
/// `tolerance` (both may have any length). Nothing where they do not, or where rounding leaves that in doubt.
std::optional<double> nearEndOfCut(const Corners& p, const Corners& q, const Eigen::Vector3d& direction,
                                   double tolerance);

/// The point of a closed triangle, degenerate or not, that is nearest to x.
Eigen::Vector3d closestPoint(const Eigen::Vector3d& x, const Corners& triangle);

/// Its height over the longest edge, as a part of that edge; 0 for a point. Known to 1e-15, whatever the order of the
/// corners and the unit.
double relativeWidth(const Corners& triangle);

/// Below this relative width a triangle is the segment or the point that it is up to rounding.
constexpr double kDegenerate = 1e-14;
inline bool isDegenerate(const Corners& triangle) { return relativeWidth(triangle) <= kDegenerate; }

/// True if two closed triangles, degenerate or not, are surely farther apart than `distance`. Looks for an axis among
/// their normals and the cross products of their edges; a fiftieth of the time of nearestPoints() on slivers.
bool areApart(const Corners& p, const Corners& q, double distance);

/// True if points of edges of both, degenerate or not, are found no farther apart than `distance`. Looks in double, so
/// each point may be off its edge by 4 roundings of the largest coordinate. False says nothing.
bool edgesTouch(const Corners& p, const Corners& q, double distance, Eigen::Vector3d& on_p, Eigen::Vector3d& on_q);

/// The distance between two closed triangles, degenerate or not, 0 where an edge cuts the inside of the other, and a
/// point of each that is as near to the other. It is off by a few roundings of the coordinates, also of triangles that
/// are all but segments: where doubles have too few digits, twice as many are used. Where these would be and areApart()
/// knows that the two are farther apart than `farthest`, it is infinity, and the points are any.
double nearestPoints(const Corners& p, const Corners& q, Eigen::Vector3d& on_p, Eigen::Vector3d& on_q,
                     double farthest = std::numeric_limits<double>::infinity());

}  // namespace bocst::query
