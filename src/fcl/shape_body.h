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

#include <functional>

#include "query/body.h"

namespace bocst::fcl_room {

/// FCL's polytope; its vertices are read where they are.
template <typename S>
class ConvexShapeBody final : public query::ConvexBody {
 public:
  explicit ConvexShapeBody(const fcl::Convex<S>& convex) : ConvexShapeBody(convex, boxOf(convex)) {}

 protected:
  Eigen::Vector3d support(const Eigen::Vector3d& d) const override {
    // FCL's climb along the edges is worth it, and is used by FCL itself, where there are many.
    if (convex_.getVertices().size() > kMany) {
      return convex_.findExtremeVertex(d.normalized().template cast<S>()).template cast<double>();
    }
    Eigen::Vector3d best = Eigen::Vector3d::Zero();
    double most = -std::numeric_limits<double>::infinity();
    for (const fcl::Vector3<S>& v : convex_.getVertices()) {
      const Eigen::Vector3d x = v.template cast<double>();
      const double h = d.dot(x);
      if (h > most) most = h, best = x;
    }
    return best;
  }

 private:
  static constexpr std::size_t kMany = 64;

  ConvexShapeBody(const fcl::Convex<S>& convex, const Eigen::AlignedBox3d& box)
      : ConvexBody(box.center(), box.sizes() / 2, 0), convex_(convex) {}

  static Eigen::AlignedBox3d boxOf(const fcl::Convex<S>& convex) {
    Eigen::AlignedBox3d box;
    for (const fcl::Vector3<S>& v : convex.getVertices()) box.extend(v.template cast<double>());
    return box;
  }

  const fcl::Convex<S>& convex_;
};

/// One of FCL's shapes that are partners, TriangleP too (but not Model, which shares its node type)?
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

/// Calls f with the shape as a body in its own frame; unbounded ones reach as far as `region` (same frame) does.
template <typename S, typename F>
void withBody(const fcl::ShapeBase<S>& shape, const query::Sphere& region, F&& f) {
  const auto vector = [](const fcl::Vector3<S>& v) { return Eigen::Vector3d(v.template cast<double>()); };
  switch (shape.getNodeType()) {
    case fcl::GEOM_BOX:
      return f(query::BoxBody(vector(static_cast<const fcl::Box<S>&>(shape).side) / 2));
    case fcl::GEOM_SPHERE:
      return f(query::CapsuleBody(static_cast<const fcl::Sphere<S>&>(shape).radius, 0));
    case fcl::GEOM_ELLIPSOID:
      return f(query::EllipsoidBody(vector(static_cast<const fcl::Ellipsoid<S>&>(shape).radii)));
    case fcl::GEOM_CAPSULE: {
      const auto& s = static_cast<const fcl::Capsule<S>&>(shape);
      return f(query::CapsuleBody(s.radius, s.lz));
    }
    case fcl::GEOM_CONE: {
      const auto& s = static_cast<const fcl::Cone<S>&>(shape);
      return f(query::RoundBody(s.radius, 0, s.lz));
    }
    case fcl::GEOM_CYLINDER: {
      const auto& s = static_cast<const fcl::Cylinder<S>&>(shape);
      return f(query::RoundBody(s.radius, s.radius, s.lz));
    }
    case fcl::GEOM_CONVEX:
      return f(ConvexShapeBody<S>(static_cast<const fcl::Convex<S>&>(shape)));
    case fcl::GEOM_PLANE: {
      const auto& s = static_cast<const fcl::Plane<S>&>(shape);
      return f(query::PlaneBody(vector(s.n), s.d, region));
    }
    case fcl::GEOM_HALFSPACE: {
      const auto& s = static_cast<const fcl::Halfspace<S>&>(shape);
      return f(query::HalfspaceBody(vector(s.n), s.d, region));
    }
    default: {
      const auto& s = static_cast<const fcl::TriangleP<S>&>(shape);
      return f(query::TriangleBody({vector(s.a), vector(s.b), vector(s.c)}));
    }
  }
}

}  // namespace bocst::fcl_room
