// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <vector>

#include "fcl/adapters/pair.h"
#include "fcl/pair/convex_frame.h"
#include "query/sides/component_points.h"

// What lies wholly inside a solid (Options::solid), for surfaces that do not meet: each connected component is then
// inside or outside as any of its points is. While the query locks are held.

namespace bocst::fcl_adapter {

/// From the frame of the one to that of the other.
template <typename S>
Eigen::Isometry3d relative(const fcl::Transform3<S>& X_WA, const fcl::Transform3<S>& X_WB) {
  return isometryOf<S>(X_WA).inverse(Eigen::Affine) * isometryOf<S>(X_WB);
}

inline bool containsOne(const Solid& solid, const std::vector<Eigen::Vector3d>& points, const Eigen::Isometry3d& X,
                        double tolerance) {
  return std::any_of(points.begin(), points.end(),
                     [&](const Eigen::Vector3d& p) { return solid.mayContain(X * p, tolerance); });
}

/// True if something within this ball can be inside a mesh with these bounds.
inline bool reaches(const Eigen::AlignedBox3d& bounds, const Eigen::Vector3d& center, double radius) {
  return bounds.exteriorDistance(center) <= radius * (1 + 1e-9);
}

/// True if A is solid and a piece of B is inside it.
template <typename S>
bool contains(const tree::Tree& a, const fcl::Transform3<S>& X_WA, const tree::Tree& b, const fcl::Transform3<S>& X_WB,
              double magnitude) {
  if (a.solid() == nullptr) return false;
  const Eigen::Isometry3d X_AB = relative<S>(X_WA, X_WB);
  const Eigen::AlignedBox3d& box = b.surface().bounds;
  const double tolerance = roundingOf<S>(magnitude);
  if (!reaches(a.surface().bounds, X_AB * box.center(), box.diagonal().norm() / 2 + tolerance)) return false;
  return containsOne(*a.solid(), b.componentPoints(), X_AB, tolerance);
}

/// A BVHModel does not remember its pieces: a query whose balls meet takes time linear in its triangles.
template <typename S>
bool contains(const tree::Tree& a, const fcl::Transform3<S>& X_WA, const BvhSide& b, const fcl::Transform3<S>& X_WB,
              double magnitude) {
  if (a.solid() == nullptr) return false;
  const Eigen::Isometry3d X_AB = relative<S>(X_WA, X_WB);
  const query::OrientedVolume root = b.volume(b.root());
  const double tolerance = roundingOf<S>(magnitude);
  if (!reaches(a.surface().bounds, X_AB * root.center, root.half.norm() + tolerance)) return false;
  std::vector<Eigen::Vector3d> vertices(b.meshVertices());
  for (std::size_t i = 0; i < vertices.size(); ++i) vertices[i] = b.vertex(i);
  std::vector<Mesh::Indices> triangles(b.meshTriangles());
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) triangles[t][k] = static_cast<std::uint32_t>(b.indices(t)[k]);
  }
  return containsOne(*a.solid(), pointOfEachComponent(vertices, triangles), X_AB, tolerance);
}

/// True if a body of the partner, none of which meets the surface, is inside the solid.
template <typename S, typename Partner>
bool contains(const query::TreeSide& a, const ConvexFrame<S>& frame, const Partner& partner) {
  const Solid* solid = a.tree().solid();
  if (solid == nullptr) return false;
  const double rounding = frame.roundingOfPositions();
  const query::SimilarityTransform b_in_a = frame.toLattice(a.tree().surface().lattice, rounding);
  return query::ComponentPoints<query::TreeSide, Partner>(a, partner, b_in_a).any([&](const Eigen::Vector3d& p) {
    return solid->mayContain(frame.toModel(p), rounding);
  });
}

}  // namespace bocst::fcl_adapter
