// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/geometry/bvh/BVH_model.h>

#include <stdexcept>
#include <string>

#include "fcl/adapters/rounding.h"
#include "query/sides/side.h"

namespace bocst::fcl_adapter {

/// The box about a bounding volume of FCL, in the frame of its model.
template <typename S>
query::OrientedVolume volumeOf(const fcl::AABB<S>& bv) {
  query::OrientedVolume v;
  v.center = (bv.min_.template cast<double>() + bv.max_.template cast<double>()) / 2;
  v.half = (bv.max_.template cast<double>() - bv.min_.template cast<double>()) / 2;
  return v;
}

template <typename S>
query::OrientedVolume volumeOf(const fcl::OBB<S>& bv) {
  query::OrientedVolume v;
  v.center = bv.To.template cast<double>();
  v.axes = bv.axis.template cast<double>();
  v.half = bv.extent.template cast<double>();
  return v;
}

// A rectangle from its corner To along the first two axes, swept by a sphere.
template <typename S>
query::OrientedVolume volumeOf(const fcl::RSS<S>& bv) {
  query::OrientedVolume v;
  v.axes = bv.axis.template cast<double>();
  v.half = Eigen::Vector3d(bv.l[0] / 2.0 + bv.r, bv.l[1] / 2.0 + bv.r, bv.r);
  v.center = bv.To.template cast<double>() + v.axes * Eigen::Vector3d(bv.l[0] / 2.0, bv.l[1] / 2.0, 0);
  return v;
}

template <typename S>
query::OrientedVolume volumeOf(const fcl::OBBRSS<S>& bv) {
  return volumeOf(bv.obb);
}

template <typename S>
query::OrientedVolume volumeOf(const fcl::kIOS<S>& bv) {
  return volumeOf(bv.obb);
}

// The first three directions of a k-DOP are the axes.
template <typename S, std::size_t N>
query::OrientedVolume volumeOf(const fcl::KDOP<S, N>& bv) {
  query::OrientedVolume v;
  for (std::size_t k = 0; k < 3; ++k) {
    const double lo = bv.dist(k), hi = bv.dist(k + N / 2);
    v.center[static_cast<Eigen::Index>(k)] = (lo + hi) / 2;
    v.half[static_cast<Eigen::Index>(k)] = (hi - lo) / 2;
  }
  return v;
}

/// A prebuilt FCL mesh as a side of a walk. Its frame is the model's.
template <typename BV>
class BvhSide {
 public:
  using S = typename BV::S;
  using Node = int;
  static constexpr bool kBodies = false;
  static constexpr bool kNodesContainSurface = true;

  /// @throws std::invalid_argument when the model is no finished triangle mesh.
  BvhSide(const char* query, const fcl::BVHModel<BV>& bvh) : bvh_(bvh) {
    if (bvh.getModelType() != fcl::BVH_MODEL_TRIANGLES || bvh.num_tris <= 0 || bvh.getNumBVs() <= 0) {
      throw std::invalid_argument(std::string("bocst::") + query + ": the BVHModel is not a finished triangle mesh");
    }
    const query::OrientedVolume v = volumeOf(bvh.getBV(0).bv);
    magnitude_ = v.center.cwiseAbs().maxCoeff() + v.half.norm();
  }

  /// No coordinate is larger, in absolute value.
  double magnitude() const { return magnitude_; }

  Node root() const { return 0; }
  bool isConservative() const { return false; }
  query::State state(Node node) const { return bvh_.getBV(node).isLeaf() ? query::State::kLeaf : query::State::kInner; }
  bool growsFromGrid(Node) const { return true; }
  void grow(Node, std::vector<tree::Tree::Growth>&) const {}

  double size(Node node) const { return volume(node).half.squaredNorm(); }

  query::OrientedVolume volume(Node node) const {
    query::OrientedVolume v = volumeOf(bvh_.getBV(node).bv);
    // FCL rounds its volumes to nearest: widen each by what that may have lost.
    v.half.array() += roundingOf<S>(magnitude_);
    return v;
  }

  query::Sphere sphere(Node node) const {
    const query::OrientedVolume v = volume(node);
    return {v.center, v.half.norm()};
  }

  // Only a side that answers with cells is asked for these.
  query::Sphere cellSphere(Node node) const { return sphere(node); }
  std::uint64_t cellId(Node node) const { return static_cast<std::uint64_t>(node); }

  template <typename F>
  void overlappingChildren(Node node, const query::Volume& other, const query::SimilarityTransform& to, F&& f) const {
    children(node, [&](Node child) {
      if (!query::boxesApart(volume(child), query::oriented(other), to)) f(child);
    });
  }

  // A pair of children is not worth a look at each triangle.
  template <typename Large, typename Other, typename F>
  void childrenMeeting(Node node, const query::Volume& volume, const query::SimilarityTransform& to, Large&,
                       const Other&, typename Other::Node, F&& f) const {
    overlappingChildren(node, volume, to, f);
  }

  template <typename F>
  void children(Node node, F&& f) const {
    f(bvh_.getBV(node).leftChild());
    f(bvh_.getBV(node).rightChild());
  }

  std::size_t triangleCount(Node) const { return 1; }
  std::uint32_t triangle(Node node, std::size_t) const {
    return static_cast<std::uint32_t>(bvh_.getBV(node).primitiveId());
  }
  void prefetch(std::uint32_t) const {}  // there is no other in the leaf
  const fcl::Vector3<S>& vertex(std::uint32_t t, int k) const {
    return bvh_.vertices[bvh_.tri_indices[t][static_cast<std::size_t>(k)]];
  }
  Eigen::Vector3d origin() const { return Eigen::Vector3d::Zero(); }
  double inverseUnit() const { return 1; }
  Eigen::Vector3d corner(std::uint32_t t, int k) const { return vertex(t, k).template cast<double>(); }

 private:
  const fcl::BVHModel<BV>& bvh_;
  double magnitude_ = 0;
};

}  // namespace bocst::fcl_adapter
