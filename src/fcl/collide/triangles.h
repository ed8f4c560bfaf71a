// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/common/types.h>
#include <fcl/math/bv/AABB.h>

#include <cstddef>
#include <cstdint>

#include "fcl/adapters/bvh_side.h"
#include "geometry/triangle.h"
#include "query/sides/side.h"
#include "tree/tree.h"

namespace bocst::fcl_adapter {

/// The triangles of one side, a model or a BVHModel, as FCL computes with them: corners in S, in the geometry's frame.
template <typename S>
class Triangles {
 public:
  explicit Triangles(const query::TreeSide& model) : mesh_(model.tree().surface().mesh.get()) {}
  explicit Triangles(const BvhSide& bvh) : bvh_(&bvh) {}

  fcl::Vector3<S> corner(std::uint32_t t, int k) const {
    if (bvh_ != nullptr) return bvh_->vertex(t, k).template cast<S>();
    return mesh_->vertex(mesh_->indices(t)[static_cast<std::size_t>(k)]).template cast<S>();
  }
  query::Corners corners(std::uint32_t t) const {
    const auto at = [t, this](int k) -> Eigen::Vector3d { return corner(t, k).template cast<double>(); };
    return {at(0), at(1), at(2)};
  }
  fcl::AABB<S> box(std::uint32_t t, const fcl::Transform3<S>& X_WM) const {
    return fcl::AABB<S>(X_WM * corner(t, 0), X_WM * corner(t, 1), X_WM * corner(t, 2));
  }
  /// Triangle t is about to be asked for, and now its corners.
  void prefetch(std::uint32_t t) const {
    if (bvh_ != nullptr) return bvh_->prefetch(t);
    __builtin_prefetch(&mesh_->indices(t));
  }
  void prefetchCorners(std::uint32_t t) const {
    if (bvh_ != nullptr) return bvh_->prefetchCorners(t);
    for (const std::uint32_t v : mesh_->indices(t)) {
      // A vertex may lie in two cache lines.
      __builtin_prefetch(&mesh_->vertex(v)[0]);
      __builtin_prefetch(&mesh_->vertex(v)[2]);
    }
  }

 private:
  const Mesh* mesh_ = nullptr;  // null where the host has none: conservative answers ask for no triangle
  const BvhSide* bvh_ = nullptr;
};

}  // namespace bocst::fcl_adapter
