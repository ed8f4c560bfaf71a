// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/geometry/shape/box.h>
#include <fcl/geometry/shape/capsule.h>
#include <fcl/geometry/shape/cone.h>
#include <fcl/geometry/shape/convex.h>
#include <fcl/geometry/shape/cylinder.h>
#include <fcl/geometry/shape/ellipsoid.h>
#include <fcl/geometry/shape/halfspace.h>
#include <fcl/geometry/shape/plane.h>
#include <fcl/geometry/shape/sphere.h>
#include <fcl/geometry/shape/triangle_p.h>

#include <stdexcept>

namespace bocst::fcl_adapter {

/// True for FCL's shapes that are partners, TriangleP too (but not Model, which shares its node type).
template <typename S>
bool isShape(const fcl::CollisionGeometry<S>* geometry) {
  switch (geometry->getNodeType()) {
    case fcl::GEOM_BOX:
    case fcl::GEOM_SPHERE:
    case fcl::GEOM_ELLIPSOID:
    case fcl::GEOM_CAPSULE:
    case fcl::GEOM_CONE:
    case fcl::GEOM_CYLINDER:
    case fcl::GEOM_CONVEX:
    case fcl::GEOM_PLANE:
    case fcl::GEOM_HALFSPACE:
      return true;
    case fcl::GEOM_TRIANGLE:
      return dynamic_cast<const fcl::TriangleP<S>*>(geometry) != nullptr;
    default:
      return false;
  }
}

/// Calls f with one of the shapes of isShape() as what it is, and returns what f does.
template <typename S, typename F>
auto withShape(const fcl::ShapeBase<S>& shape, F&& f) {
  switch (shape.getNodeType()) {
    case fcl::GEOM_BOX:
      return f(static_cast<const fcl::Box<S>&>(shape));
    case fcl::GEOM_SPHERE:
      return f(static_cast<const fcl::Sphere<S>&>(shape));
    case fcl::GEOM_ELLIPSOID:
      return f(static_cast<const fcl::Ellipsoid<S>&>(shape));
    case fcl::GEOM_CAPSULE:
      return f(static_cast<const fcl::Capsule<S>&>(shape));
    case fcl::GEOM_CONE:
      return f(static_cast<const fcl::Cone<S>&>(shape));
    case fcl::GEOM_CYLINDER:
      return f(static_cast<const fcl::Cylinder<S>&>(shape));
    case fcl::GEOM_CONVEX:
      return f(static_cast<const fcl::Convex<S>&>(shape));
    case fcl::GEOM_PLANE:
      return f(static_cast<const fcl::Plane<S>&>(shape));
    case fcl::GEOM_HALFSPACE:
      return f(static_cast<const fcl::Halfspace<S>&>(shape));
    case fcl::GEOM_TRIANGLE:
      return f(static_cast<const fcl::TriangleP<S>&>(shape));
    default:
      throw std::logic_error("bocst: a shape of isShape() is missing in withShape()");
  }
}

}  // namespace bocst::fcl_adapter
