// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <limits>
#include <utility>

#include "fcl/adapters/shapes.h"
#include "geometry/convex_shape.h"

namespace bocst::fcl_adapter {

/// FCL's polytope; its vertices are read where they are.
template <typename S>
class PolytopeShape final : public query::SupportShape {
 public:
  explicit PolytopeShape(const fcl::Convex<S>& convex)
      : SupportShape(query::boxOf(convex.getVertices()), 0), convex_(convex) {}

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

  const fcl::Convex<S>& convex_;
};

/// n . x = d of a plane or half-space, with n of unit length: FCL's constructors see to that, but n and d are public.
template <typename Shape>
std::pair<Eigen::Vector3d, double> equationOf(const Shape& s) {
  const Eigen::Vector3d n = s.n.template cast<double>();
  const double length = n.stableNorm();
  if (!(length > 0)) return {Eigen::Vector3d::UnitX(), 0};  // as FCL's constructors do
  return {n / length, static_cast<double>(s.d) / length};
}

/// A shape as a body in its own frame; unbounded ones reach as far as `region` (same frame) does.
template <typename S>
query::BoxShape bodyOf(const fcl::Box<S>& s, const query::Sphere&) {
  return query::BoxShape(s.side.template cast<double>() / 2);
}
template <typename S>
query::CapsuleShape bodyOf(const fcl::Sphere<S>& s, const query::Sphere&) {
  return query::CapsuleShape(s.radius, 0);
}
template <typename S>
query::EllipsoidShape bodyOf(const fcl::Ellipsoid<S>& s, const query::Sphere&) {
  return query::EllipsoidShape(s.radii.template cast<double>());
}
template <typename S>
query::CapsuleShape bodyOf(const fcl::Capsule<S>& s, const query::Sphere&) {
  return query::CapsuleShape(s.radius, s.lz);
}
template <typename S>
query::RoundShape bodyOf(const fcl::Cone<S>& s, const query::Sphere&) {
  return query::RoundShape(s.radius, 0, s.lz);
}
template <typename S>
query::RoundShape bodyOf(const fcl::Cylinder<S>& s, const query::Sphere&) {
  return query::RoundShape(s.radius, s.radius, s.lz);
}
template <typename S>
PolytopeShape<S> bodyOf(const fcl::Convex<S>& s, const query::Sphere&) {
  return PolytopeShape<S>(s);
}
template <typename S>
query::PlaneShape bodyOf(const fcl::Plane<S>& s, const query::Sphere& region) {
  const auto [n, d] = equationOf(s);
  return query::PlaneShape(n, d, region);
}
template <typename S>
query::HalfspaceShape bodyOf(const fcl::Halfspace<S>& s, const query::Sphere& region) {
  const auto [n, d] = equationOf(s);
  return query::HalfspaceShape(n, d, region);
}
template <typename S>
query::TriangleShape bodyOf(const fcl::TriangleP<S>& s, const query::Sphere&) {
  return query::TriangleShape({s.a.template cast<double>(), s.b.template cast<double>(), s.c.template cast<double>()});
}

/// Calls f with the body of a shape.
template <typename S, typename F>
void withConvexShape(const fcl::ShapeBase<S>& shape, const query::Sphere& region, F&& f) {
  withShape(shape, [&](const auto& s) { f(bodyOf(s, region)); });
}

}  // namespace bocst::fcl_adapter
