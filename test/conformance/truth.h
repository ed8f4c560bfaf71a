// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// What is true of a mesh and one of FCL's shapes, triangle by triangle.

#include <algorithm>
#include <limits>

#include "fcl/adapters/convex_shapes.h"
#include "meshes.h"

namespace bocst::test {

/// The distance of each triangle of a mesh from a shape, triangle by triangle, and how far it must go along a direction
/// to be off the shape. convex_shape_test proves these gaps.
template <typename S>
class Truth {
 public:
  Truth(const Raw& raw, const fcl::ShapeBase<S>& shape) : raw_(raw), shape_(shape) {}

  query::SeparationResult gap(std::size_t t, const fcl::Transform3<S>& X, const fcl::Transform3<S>& Y,
                              const Eigen::Vector3d& moved = Eigen::Vector3d::Zero()) const {
    query::SeparationResult gap;
    fcl_adapter::withConvexShape(shape_, {Eigen::Vector3d::Zero(), 1e3}, [&](const query::ConvexShape& body) {
      const auto Yd = Y.template cast<double>();
      Eigen::Vector3d c[3];
      for (std::size_t k = 0; k < 3; ++k) {
        c[k] = Yd.inverse() * (X.template cast<double>() * raw_.vertices[raw_.triangles[t][k]] + moved);
      }
      gap = body.gap({c, 3}, std::numeric_limits<double>::infinity());
      gap.on_body = Yd * gap.on_body;
      gap.on_points = Yd * gap.on_points;
    });
    return gap;
  }

  double distance(const fcl::Transform3<S>& X, const fcl::Transform3<S>& Y) const {
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t t = 0; t < raw_.triangles.size(); ++t) least = std::min(least, gap(t, X, Y).distance);
    return least;
  }

 private:
  const Raw& raw_;
  const fcl::ShapeBase<S>& shape_;
};

}  // namespace bocst::test
