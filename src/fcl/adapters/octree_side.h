// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/config.h>

#if FCL_HAVE_OCTOMAP

#include <fcl/geometry/octree/octree.h>
#include <fcl/geometry/shape/box.h>
#include <fcl/geometry/shape/utility.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>

#include "fcl/adapters/narrow_phase.h"
#include "geometry/convex_shape.h"
#include "geometry/overlap_kernels.h"
#include "query/sides/side.h"

namespace bocst::fcl_adapter {

/// FCL's OcTree as a side of a walk: its leaves are boxes, in its own frame.
template <typename S>
class OcTreeSide : public query::CompleteSide {
 public:
  /// A cube of the octree; without an octomap node it is one that nobody has seen.
  struct Node {
    const octomap::OcTreeNode* node = nullptr;
    std::array<std::uint16_t, 3> at{};  ///< Its place among the cubes of its level.
    std::uint16_t level = 0;            ///< 0: the root.

    bool operator==(const Node& other) const { return node == other.node && at == other.at && level == other.level; }
  };
  static constexpr bool kBodies = true;
  // Octomap's inner nodes need not be up to date.
  static constexpr bool kNodesContainSurface = false;
  static constexpr bool kHasLanes = false, kHasCubes = true;

  /// `density` is that of the other geometry. Cells that are uncertain or not known are seen only where costs are asked
  /// for.
  OcTreeSide(const fcl::OcTree<S>& octree, const fcl::Transform3<S>& X_WO, S density, bool costs)
      : octree_(octree),
        X_WO_(X_WO),
        density_(density),
        costs_(costs),
        root_node_(octree.getRoot()),
        root_box_(octree.getRootBV()),
        root_half_((static_cast<double>(root_box_.max_[0]) - static_cast<double>(root_box_.min_[0])) / 2),
        unit_(root_half_ / (1 << kLevels)) {}

  /// Nothing in it is of interest.
  bool empty() const { return !sees(root_node_); }

  Node root() const { return {root_node_}; }
  query::State state(const Node& n) const {
    if (n.node == nullptr) return query::State::kLeaf;
    octomap::AbstractOcTreeNode* const* const nodes = NodeChildren::of(*n.node);
    bool inner = false;
    for (int i = 0; nodes != nullptr && i < 8; ++i) inner |= nodes[i] != nullptr;
    return inner ? query::State::kInner : query::State::kLeaf;
  }

  /// As FCL names cells, see fcl::OcTree::getNodeByQueryCellId(); of cells that octomap does not have, by their places,
  /// with a prefix that no difference of addresses has.
  std::uint64_t id(const Node& n) const {
    if (n.node != nullptr) return static_cast<std::uint64_t>(n.node - root_node_);
    std::uint64_t id = 0xfffe;
    for (std::size_t k = 0; k < 3; ++k) {
      id = id << 16 | (2 * std::uint64_t{n.at[k]} + 1) << kLevels >> (n.level + 1);
    }
    return id;
  }

  /// Half the diagonal, squared, times 8: a cube is expanded before nodes of a model up to 2.8 times as large. Few of
  /// its children are occupied, so that takes fewer steps.
  double size(const Node& n) const { return 8 * 3 * half(n) * half(n); }

  query::Volume volume(const Node& n) const {
    const Eigen::Vector3d middle = center(n);
    query::Volume v{};
    for (int k = 0; k < 3; ++k) {
      v.center[k] = middle[k];
      // Rounded outwards; it may be less than all floats but 0.
      v.half[k] = static_cast<float>(half(n) * (1 + 0x1p-22)) + std::numeric_limits<float>::denorm_min();
    }
    return v;
  }
  query::Sphere sphere(const Node& n) const { return {center(n), std::sqrt(3.0) * half(n)}; }

  bool hasExactBox(const Node&) const { return true; }
  query::SeparationResult gap(const Node& n, const query::PointSet& points, double cutoff) const {
    Eigen::Vector3d x[8];
    const Eigen::Vector3d middle = center(n);
    query::SeparationResult gap = bodyOf(n).gap(about(middle, points, x), cutoff);
    gap.on_body += middle;
    gap.on_points += middle;
    return gap;
  }
  double gapAlong(const Node& n, const Eigen::Vector3d& direction, const query::PointSet& points) const {
    Eigen::Vector3d x[8];
    return bodyOf(n).gapAlong(direction, about(center(n), points, x));
  }
  query::ContactPoint penetration(const Node& n, const query::PointSet& points, query::SeparationResult gap) const {
    Eigen::Vector3d x[8];
    const Eigen::Vector3d middle = center(n);
    gap.on_body -= middle;
    gap.on_points -= middle;
    query::ContactPoint contact = bodyOf(n).penetration(about(middle, points, x), gap);
    contact.point += middle;
    return contact;
  }
  std::optional<Eigen::Vector3d> point(const Node& n) const { return center(n); }
  query::SweptHull hull(const Node& n) const { return query::sweptHullOf(query::oriented(volume(n))); }

  template <typename F>
  void children(const Node& n, F&& f) const {
    visitChildren(n, 0xff, 0, f);
  }
  template <typename F>
  void overlappingChildren(const Node& n, const query::Volume& other, const query::SimilarityTransform& to,
                           F&& f) const {
    unsigned nearest = 0;
    const unsigned mask = octantsMeeting(center(n), half(n), other, to, nearest);
    visitChildren(n, mask, nearest, f);
  }

  /// The same against the triangles of a leaf of the other side, see LargeTriangleLeaf.
  template <typename Large, typename Other, typename F>
  void childrenMeeting(const Node& n, const query::Volume& volume, const query::SimilarityTransform& to, Large& large,
                       const Other& other, typename Other::Node leaf, F&& f) const {
    unsigned nearest = 0;
    unsigned mask = octantsMeeting(center(n), half(n), volume, to, nearest);
    if (mask != 0) mask = large.octantsMeeting(*this, n, mask, other, leaf, to);
    visitChildren(n, mask, nearest, f);
  }

  /// The centre of a cube, and half its side.
  double octantsOf(const Node& n, Eigen::Vector3d& middle) const {
    middle = center(n);
    return half(n);
  }

  // For ConvexCollector.
  bool fclOverlaps(const Node& n, const NarrowPhase<S>& narrow_phase, const fcl::Vector3<S> (&corners)[3],
                   const fcl::Transform3<S>& X_WM) const {
    const auto [cell, X_WC] = cellOf(n);
    return narrow_phase.fclOverlaps(cell, X_WC, corners, X_WM);
  }
  bool occupied(const Node& n) const { return n.node != nullptr && octree_.isNodeOccupied(n.node); }
  S density(const Node& n) const {
    return (n.node != nullptr ? static_cast<S>(n.node->getOccupancy()) : octree_.getOccupancyThres()) * density_;
  }
  fcl::AABB<S> worldBox(const Node& n) const {
    const auto [cell, X_WC] = cellOf(n);
    fcl::AABB<S> box;
    fcl::computeBV(cell, X_WC, box);
    return box;
  }

 private:
  static constexpr int kLevels = 16;  // octomap's
  inline static const bounds::OctantBounds kWholeOctants = [] {
    bounds::OctantBounds octants;
    octants.fill(bounds::NodeBounds{});
    return octants;
  }();

  // octomap keeps the children in a protected array; its functions, and FCL's, are calls for each child.
  struct NodeChildren : octomap::OcTreeNode {
    static octomap::AbstractOcTreeNode* const* of(const octomap::OcTreeNode& node) {
      return node.*&NodeChildren::children;
    }
  };

  double half(const Node& n) const { return unit_ * (1 << (kLevels - n.level)); }
  Eigen::Vector3d center(const Node& n) const {
    Eigen::Vector3d c;
    for (std::size_t k = 0; k < 3; ++k) {
      c[static_cast<int>(k)] = unit_ * (((2 * n.at[k] + 1) << (kLevels - n.level)) - (1 << kLevels));
    }
    return c;
  }

  // The octants of a cube that a node of the model may meet, as a mask, and the octant nearest to the centre of that
  // node; `side` is that of an octant. If the octants are larger than the node, its bounding box alone is tested.
  static unsigned octantsMeeting(const Eigen::Vector3d& middle, double side, const query::Volume& other,
                                 const query::SimilarityTransform& to, unsigned& nearest) {
    const double* r = to.rotation.data();  // column by column
    double along[3], reach[3], size = 0;
    for (int k = 0; k < 3; ++k) {
      along[k] = to.scale * (r[k] * other.center[0] + r[k + 3] * other.center[1] + r[k + 6] * other.center[2]) +
                 to.translation[k] - middle[k];
      reach[k] = to.scale * (std::abs(r[k]) * static_cast<double>(other.half[0]) +
                             std::abs(r[k + 3]) * static_cast<double>(other.half[1]) +
                             std::abs(r[k + 6]) * static_cast<double>(other.half[2]));
      nearest |= unsigned{along[k] > 0} << k;
      size += reach[k];
    }
    if (size < side) {
      const double rounding_margin = (size + std::abs(along[0]) + std::abs(along[1]) + std::abs(along[2]) + 4 * side) *
                                         (0x1p-22 + 4 * to.orthogonality_error) +
                                     to.tolerance;
      constexpr unsigned kLower[] = {0x55, 0x33, 0x0f};
      unsigned mask = 0xff;
      for (int k = 0; k < 3; ++k) {
        if (along[k] > reach[k] + rounding_margin) mask &= ~kLower[k];
        if (-along[k] > reach[k] + rounding_margin) mask &= kLower[k];
      }
      return mask;
    }
    const Eigen::Vector3d corner = middle.array() - side;
    return query::overlappingOctants(kWholeOctants, query::seenFrom(other, to, corner.data(), side));
  }

  // Calls f for the children in `mask` that are seen. The nearest comes last, so that a stack returns it first: it is
  // the most likely to be hit.
  template <typename F>
  void visitChildren(const Node& n, unsigned mask, unsigned nearest, F&& f) const {
    octomap::AbstractOcTreeNode* const* const nodes = NodeChildren::of(*n.node);
    for (unsigned left = mask; left != 0; left &= left - 1) __builtin_prefetch(nodes[__builtin_ctz(left)]);
    Node child;
    child.level = static_cast<std::uint16_t>(n.level + 1);
    for (unsigned j = 8; j-- > 0;) {
      const unsigned i = j ^ nearest;
      if ((mask >> i & 1) == 0) continue;
      child.node = static_cast<const octomap::OcTreeNode*>(nodes[i]);
      if (!sees(child.node)) continue;
      if (child.node != nullptr) __builtin_prefetch(NodeChildren::of(*child.node));
      for (std::size_t k = 0; k < 3; ++k) child.at[k] = static_cast<std::uint16_t>(2 * n.at[k] + (i >> k & 1));
      f(child);
    }
  }

  bool sees(const octomap::OcTreeNode* node) const {
    if (node == nullptr) return costs_;
    return octree_.isNodeOccupied(node) || (costs_ && !octree_.isNodeFree(node));
  }

  // Made as FCL makes it, with its rounding: halved in S, level by level.
  std::pair<fcl::Box<S>, fcl::Transform3<S>> cellOf(const Node& n) const {
    fcl::AABB<S> box = root_box_;
    for (int level = n.level - 1; level >= 0; --level) {
      unsigned octant = 0;
      for (unsigned k = 0; k < 3; ++k) octant |= (n.at[k] >> level & 1u) << k;
      const fcl::AABB<S> parent = box;
      fcl::computeChildBV(parent, octant, box);
    }
    std::pair<fcl::Box<S>, fcl::Transform3<S>> cell;
    fcl::constructBox(box, X_WO_, cell.first, cell.second);
    return cell;
  }

  query::BoxShape bodyOf(const Node& n) const { return query::BoxShape(Eigen::Vector3d::Constant(half(n))); }
  static query::PointSet about(const Eigen::Vector3d& middle, const query::PointSet& points, Eigen::Vector3d (&x)[8]) {
    for (int i = 0; i < points.count; ++i) x[i] = points.x[i] - middle;
    return {x, points.count};
  }

  const fcl::OcTree<S>& octree_;
  const fcl::Transform3<S>& X_WO_;
  const S density_;
  const bool costs_;
  const octomap::OcTreeNode* const root_node_;
  const fcl::AABB<S> root_box_;
  const double root_half_, unit_;  // half the side of the root, and of a cube of the last level
};

}  // namespace bocst::fcl_adapter

#endif  // FCL_HAVE_OCTOMAP
