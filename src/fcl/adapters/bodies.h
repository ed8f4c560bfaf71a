// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/config.h>

#include "fcl/adapters/convex_shapes.h"
#include "fcl/adapters/models.h"
#if FCL_HAVE_OCTOMAP
#include "fcl/adapters/octree_side.h"
#endif
#include "fcl/adapters/pair.h"
#include "query/sides/convex_side.h"

namespace bocst::fcl_adapter {

/// True for a shape or an octree.
template <typename S>
bool isBodies(const fcl::CollisionGeometry<S>* geometry) {
#if FCL_HAVE_OCTOMAP
  if (geometry->getNodeType() == fcl::GEOM_OCTREE) return true;
#endif
  return isShape(geometry);
}

/// @throws std::invalid_argument for a geometry that is no Model, BVHModel, shape or OcTree.
template <typename S>
void checkPartners(const char* query, const fcl::CollisionGeometry<S>* o1, const fcl::CollisionGeometry<S>* o2) {
  for (const auto* o : {o1, o2}) {
    if (asModel<S>(o) == nullptr && !isBodies(o)) withBvh<S>(query, o, [](const auto&) {});
  }
}

/// Calls f with the side of a shape or of an octree (see isBodies()) at a pose, unless the octree has no occupied cell.
/// Unbounded shapes reach as far as `region` (in the geometry's frame) does.
template <typename S, typename F>
void withBodies(const fcl::CollisionGeometry<S>& geometry, [[maybe_unused]] const fcl::Transform3<S>& X_WG,
                const query::Sphere& region, F&& f) {
#if FCL_HAVE_OCTOMAP
  if (geometry.getNodeType() == fcl::GEOM_OCTREE) {
    const OcTreeSide<S> side(static_cast<const fcl::OcTree<S>&>(geometry), X_WG, 1, false);
    if (!side.empty()) f(side);
    return;
  }
#endif
  withConvexShape(static_cast<const fcl::ShapeBase<S>&>(geometry), region,
                  [&](const query::ConvexShape& body) { f(query::ConvexSide(body)); });
}

}  // namespace bocst::fcl_adapter
