// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/geometry/bvh/BVH_model.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "fcl/adapters/rounding.h"
#include "log/assert.h"
#include "query/sides/side.h"
#include "thread/of_thread.h"
#include "tree/outline.h"

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

/// A prebuilt FCL mesh as a side of a walk. Its frame is the model's. One class for all of FCL's volumes and scalars,
/// so that walks are compiled once. Lives no longer than the mesh.
class BvhSide : public query::CompleteSide {
 public:
  using Node = int;
  static constexpr bool kBodies = false;
  static constexpr bool kNodesContainSurface = true;
  static constexpr bool kHasLanes = true;
  /// A node of at most this many triangles is a leaf: FCL's smaller nodes cost more time than they save.
  static constexpr int kLeafTriangles = 8;
  static constexpr double kOutwards = 1 + 0x1p-22;  // what is rounded to float becomes no less

  /// @throws std::invalid_argument when the model is no finished triangle mesh.
  template <typename BV>
  BvhSide(const char* query, const fcl::BVHModel<BV>& bvh)
      : nodes_(nodesOf(query, bvh)),
        node_size_(sizeof(fcl::BVNode<BV>)),
        volume_([](const fcl::BVNodeBase& node) { return volumeOf(static_cast<const fcl::BVNode<BV>&>(node).bv); }),
        pack_(&pack<BV>),
        triangles_(bvh.tri_indices),
        triangle_count_(static_cast<std::size_t>(bvh.num_tris)),
        vertex_count_(static_cast<std::size_t>(bvh.num_vertices)),
        groups_(&thread::ofThread<Groups>()),
        number_(++groups_->sides) {
    setVertices(bvh.vertices);
    const query::OrientedVolume v = volume_(node(0));
    magnitude_ = (v.center.cwiseAbs() + v.axes.cwiseAbs() * v.half).maxCoeff();
    rounding_ = roundingOf<typename BV::S>(magnitude_);
  }

  /// The largest coordinate of the root's box, in absolute value, up to FCL's rounding.
  double magnitude() const { return magnitude_; }

  /// About all triangles.
  tree::Outline::Box outline() const {
    const query::OrientedVolume v = volume(root());
    return tree::Outline::boxOf(v.center, v.axes, v.half);
  }

  Node root() const { return 0; }
  query::State state(Node n) const { return isLeaf(node(n)) ? query::State::kLeaf : query::State::kInner; }

  double size(Node n) const { return volume(n).half.squaredNorm(); }

  query::OrientedVolume volume(Node n) const {
    query::OrientedVolume v = volume_(node(n));
    // FCL rounds its volumes to nearest: widen each by what that may have lost.
    v.half.array() += rounding_;
    return v;
  }

  query::Sphere sphere(Node n) const {
    const query::OrientedVolume v = volume(n);
    return {v.center, v.half.norm()};
  }

  /// Calls f(node) for the lanes that `other` may overlap. Those nearest to the centre of `other` come last, so that a
  /// stack returns them first: they are the most likely to be hit.
  template <typename OtherVolume, typename F>
  void overlappingChildren(Node n, OtherVolume& other, const query::SimilarityTransform& to, F&& f) const {
    const Group& group = groupOf(n);
    const query::OneVolume seen = seenFrom(group, other, to);
    std::pair<float, Node> nodes[8];
    int count = 0;
    for (unsigned left = query::overlappingBoxes(group.boxes, seen) & group.lanes; left != 0; left &= left - 1) {
      const int lane = __builtin_ctz(left);
      float squared = 0;
      for (int k = 0; k < 3; ++k) {
        const float way = seen.center[k] - group.boxes.center[k][lane];
        squared += way * way;
      }
      int at = count++;
      for (; at > 0 && nodes[at - 1].first < squared; --at) nodes[at] = nodes[at - 1];
      nodes[at] = {squared, group.node[lane]};
    }
    for (int i = 0; i < count; ++i) f(nodes[i].second);
  }

  /// Lanes are not the children of the node in FCL's tree, but up to eight nodes below it.
  template <typename OtherVolume>
  unsigned overlappingLanes(Node n, OtherVolume& other, const query::SimilarityTransform& to) const {
    const Group& group = groupOf(n);
    return query::overlappingBoxes(group.boxes, seenFrom(group, other, to)) & group.lanes;
  }

  /// All of them.
  unsigned lanes(Node n) const { return groupOf(n).lanes; }

  /// Writes the volumes of lanes(n); other entries stay as they are.
  void laneVolumes(Node n, query::Volume (&volumes)[8]) const {
    const Group& group = groupOf(n);
    for (unsigned left = group.lanes; left != 0; left &= left - 1) {
      const int i = __builtin_ctz(left);
      volumes[i] = uprightVolume(group.node[i]);
    }
  }

  /// A box along the axes of the frame, and a slab across the node's shortest side.
  query::Volume uprightVolume(Node n) const {
    const query::OrientedVolume v = volume(n);
    constexpr float kLeast = std::numeric_limits<float>::denorm_min();  // lengths may be less than all floats but 0
    int shortest = 0;
    const double thickness = v.half.minCoeff(&shortest);
    query::Volume upright;
    const Eigen::Vector3d half = v.axes.cwiseAbs() * v.half;
    for (int k = 0; k < 3; ++k) {
      upright.center[k] = v.center[k];
      upright.half[k] = static_cast<float>(half[k] * kOutwards) + kLeast;
      upright.normal[k] = static_cast<float>(v.axes(k, shortest));
    }
    upright.slab_offset = 0;
    // The normal is rounded, too.
    upright.slab_half = static_cast<float>(thickness + 0x1p-22 * v.half.sum()) + kLeast;
    return upright;
  }

  /// Calls f(node, lane) for the nodes in `mask`.
  template <typename F>
  void pushLanes(Node n, unsigned mask, F&& f) const {
    const Group& group = groupOf(n);
    for (; mask != 0; mask &= mask - 1) f(group.node[__builtin_ctz(mask)], __builtin_ctz(mask));
  }

  template <typename F>
  void children(Node n, F&& f) const {
    f(node(n).first_child);
    f(node(n).first_child + 1);
  }

  std::size_t triangleCount(Node n) const { return static_cast<std::size_t>(node(n).num_primitives); }
  struct Triangles {
    std::uint32_t ids[kLeafTriangles];
    std::size_t count;
  };
  /// Of a leaf.
  Triangles triangles(Node n) const {
    const fcl::BVNodeBase& top = node(n);
    Triangles leaf;
    leaf.count = static_cast<std::size_t>(top.num_primitives);
    if (top.first_child < 0) {
      leaf.ids[0] = triangleOf(top);
      return leaf;
    }
    // FCL numbers the nodes below a node one after the other.
    const Node end = top.first_child + 2 * (top.num_primitives - 1);
    std::uint32_t* id = leaf.ids;
    for (Node below = top.first_child; below < end; ++below) {
      if (node(below).first_child < 0) *id++ = triangleOf(node(below));
    }
    BOCST_ASSERT(id == leaf.ids + leaf.count);
    return leaf;
  }
  void prefetch(std::uint32_t t) const { __builtin_prefetch(&triangles_[t]); }
  void prefetchCorners(std::uint32_t t) const {
    for (int k = 0; k < 3; ++k) {
      const std::size_t v = corner(t, k);
      // A vertex may lie in two cache lines.
      const char* const at = doubles_ != nullptr ? reinterpret_cast<const char*>(&doubles_[v])
                                                 : reinterpret_cast<const char*>(&floats_[v]);
      __builtin_prefetch(at);
      __builtin_prefetch(at + 16);
    }
  }
  Eigen::Vector3d vertex(std::uint32_t t, int k) const { return vertex(corner(t, k)); }
  Eigen::Vector3d origin() const { return Eigen::Vector3d::Zero(); }
  double inverseUnit() const { return 1; }
  query::Corners corners(std::uint32_t t) const { return {vertex(t, 0), vertex(t, 1), vertex(t, 2)}; }

  // Of the whole mesh.
  std::size_t meshTriangles() const { return triangle_count_; }
  const fcl::Triangle& indices(std::size_t t) const { return triangles_[t]; }
  std::size_t meshVertices() const { return vertex_count_; }
  Eigen::Vector3d vertex(std::size_t v) const {
    return doubles_ != nullptr ? doubles_[v] : floats_[v].cast<double>().eval();
  }

 private:
  static bool isLeaf(const fcl::BVNodeBase& node) { return node.num_primitives <= kLeafTriangles; }

  /// Up to eight nodes that hold all triangles below another one, for tests in SIMD.
  struct Group {
    std::uint64_t side = 0;  ///< Of which it was made.
    Node parent = 0, node[8];
    unsigned lanes = 0;      ///< A bit for each node.
    double middle[3], unit;  ///< Of the coordinates of `boxes`.
    float size;              ///< The largest |center|_1 + |half|_1 of `boxes`.
    query::OrientedBoxes boxes;
  };
  struct Groups {
    static constexpr std::size_t kCount = 128;
    std::uint64_t sides = 0;
    Group group[kCount];
  };

  template <typename OtherVolume>
  static query::OneVolume seenFrom(const Group& group, OtherVolume& other, const query::SimilarityTransform& to) {
    query::OneVolume seen = query::seenFrom(other, to, group.middle, group.unit);
    seen.rounding_margin += group.size * to.rounding_margin;
    return seen;
  }

  const Group& groupOf(Node n) const {
    Group& group = groups_->group[static_cast<std::size_t>(n) % Groups::kCount];
    if (group.side != number_ || group.parent != n) fill(n, group);
    return group;
  }

  void fill(Node n, Group& group) const {
    group.side = number_;
    group.parent = n;
    int count = 1;
    split(n, group, count, 0);
    // Two levels more, all of one level at once: nodes lie anywhere in memory.
    for (int level = 0; level < 2; ++level) {
      for (int i = 0, end = count; i < end; ++i) {
        const Node child = group.node[i];
        if (!isLeaf(node(child))) split(child, group, count, i);
      }
    }
    group.lanes = (1u << count) - 1;
    pack_(*this, volume(n), count, group);
  }

  void split(Node n, Group& group, int& count, int at) const {
    group.node[at] = node(n).first_child;
    group.node[count] = node(n).first_child + 1;
    prefetchNode(group.node[at]);
    prefetchNode(group.node[count++]);
  }
  void prefetchNode(Node n) const {
    const char* const at = nodes_ + static_cast<std::size_t>(n) * node_size_;
    for (int line = 0; line < 3; ++line) __builtin_prefetch(at + 64 * line);
  }

  // The boxes of a group in float, about the middle of the parent's box, half the diagonal of which is the unit.
  template <typename BV>
  static void pack(const BvhSide& side, const query::OrientedVolume& parent, int count, Group& group) {
    const double radius = parent.half.norm(), scale = radius > 0 ? 1 / radius : 1;
    group.unit = 1 / scale;
    group.size = 0;
    for (int k = 0; k < 3; ++k) group.middle[k] = parent.center[k];
    for (int i = 0; i < count; ++i) {
      const query::OrientedVolume v = volumeOf(static_cast<const fcl::BVNode<BV>&>(side.node(group.node[i])).bv);
      float size = 0;
      for (int k = 0; k < 3; ++k) {
        const auto center = static_cast<float>((v.center[k] - parent.center[k]) * scale);
        const auto half = static_cast<float>((v.half[k] + side.rounding_) * scale);
        group.boxes.center[k][i] = center;
        group.boxes.half[k][i] = half;
        size += std::abs(center) + half;
        for (int j = 0; j < 3; ++j) group.boxes.axes[j][k][i] = static_cast<float>(v.axes(k, j));
      }
      group.size = std::max(group.size, size);
    }
  }

  template <typename BV>
  static const char* nodesOf(const char* query, const fcl::BVHModel<BV>& bvh) {
    if (bvh.getModelType() != fcl::BVH_MODEL_TRIANGLES || bvh.num_tris <= 0 || bvh.getNumBVs() <= 0) {
      throw std::invalid_argument(std::string("bocst::") + query +
                                  ": the BVHModel has no triangles or no tree (endModel() builds it)");
    }
    return reinterpret_cast<const char*>(static_cast<const fcl::BVNodeBase*>(&bvh.getBV(0)));
  }

  // FCL's own operator is a call into its library.
  std::size_t corner(std::uint32_t t, int k) const {
    static_assert(sizeof(fcl::Triangle) == 3 * sizeof(std::size_t), "three numbers of vertices");
    return reinterpret_cast<const std::size_t*>(&triangles_[t])[k];
  }

  static std::uint32_t triangleOf(const fcl::BVNodeBase& leaf) {
    return static_cast<std::uint32_t>(-leaf.first_child - 1);
  }

  const fcl::BVNodeBase& node(Node n) const {
    return *reinterpret_cast<const fcl::BVNodeBase*>(nodes_ + static_cast<std::size_t>(n) * node_size_);
  }

  void setVertices(const fcl::Vector3<double>* vertices) { doubles_ = vertices; }
  void setVertices(const fcl::Vector3<float>* vertices) { floats_ = vertices; }

  const char* nodes_;  // BVNode<BV> one after the other, of node_size_ bytes each
  std::size_t node_size_;
  query::OrientedVolume (*volume_)(const fcl::BVNodeBase&);
  void (*pack_)(const BvhSide&, const query::OrientedVolume& parent, int count, Group& group);
  const fcl::Triangle* triangles_;
  std::size_t triangle_count_, vertex_count_;
  const fcl::Vector3<double>* doubles_ = nullptr;  // the vertices, one of the two
  const fcl::Vector3<float>* floats_ = nullptr;
  double magnitude_ = 0, rounding_ = 0;
  Groups* groups_;
  std::uint64_t number_;  // of this side, among those of the thread
};

}  // namespace bocst::fcl_adapter
