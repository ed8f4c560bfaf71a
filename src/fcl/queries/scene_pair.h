// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/model.h>

#include <memory>
#include <optional>

// What a Scene asks of one pair of models beside the queries of <bocst/fcl.h>.

namespace bocst::fcl_adapter {

/// True if the convex hulls of the two are surely farther apart than their margins and `gap` together. Looks for a
/// direction between them, so it may miss one. With conservative answers: their root boxes, widened by the spheres.
template <typename S>
bool hullsApart(const Model<S>& a, const fcl::Transform3<S>& X_WA, const Model<S>& b, const fcl::Transform3<S>& X_WB,
                double gap);

/// No more than the distance of two of FCL's bounded shapes, or of one and the occupied cells of an OcTree (infinite
/// without any), and less than it by rounding alone, at poses that are rigid up to rounding; 0 where they may touch.
/// Null for other geometries. fcl::distance may be too large, by a tenth and more for boxes whose faces are parallel,
/// and takes up to a millisecond beside an OcTree.
template <typename S>
std::optional<double> distanceOfShapes(const fcl::CollisionGeometry<S>& a, const fcl::Transform3<S>& X_WA,
                                       const fcl::CollisionGeometry<S>& b, const fcl::Transform3<S>& X_WB);

/// Moves two points in the world, one on each of two bounded shapes at this distance, to where these are nearest, if
/// they are farther apart than that. Does nothing for other geometries.
template <typename S>
void improvePoints(const fcl::CollisionGeometry<S>& a, const fcl::Transform3<S>& X_WA,
                   const fcl::CollisionGeometry<S>& b, const fcl::Transform3<S>& X_WB, double distance,
                   fcl::Vector3<S>* points);

/// Of two geometries, with their nearest points in the world.
struct PlaneDistance {
  double distance;
  Eigen::Vector3d nearest_points[2];
};

/// The distance of a bounded shape of FCL and a Plane or Halfspace, which FCL does not compute; 0 where they touch.
/// Null for other geometries.
template <typename S>
std::optional<PlaneDistance> distanceToPlane(const fcl::CollisionGeometry<S>& a, const fcl::Transform3<S>& X_WA,
                                             const fcl::CollisionGeometry<S>& b, const fcl::Transform3<S>& X_WB);

/// A model of the triangles of an fcl::BVHModel. @throws std::invalid_argument for other geometries, and for a mesh
/// that is not finished or that Mesh refuses.
template <typename S>
std::unique_ptr<Model<S>> modelOfBvh(const fcl::CollisionGeometry<S>& geometry);

}  // namespace bocst::fcl_adapter
