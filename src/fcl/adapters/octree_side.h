// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/config.h>

#if FCL_HAVE_OCTOMAP

#include <fcl/geometry/octree/octree.h>
#include <fcl/geometry/shape/box.h>
#include <fcl/geometry/shape/utility.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>

#include "fcl/adapters/narrow_phase.h"
#include "geometry/convex_shape.h"
#include "query/sides/side.h"

namespace bocst::fcl_adapter {

/// FCL's OcTree as a side of a walk: its leaves are boxes, in its own frame.
template <typename S>
class OcTreeSide : public query::CompleteSide {
 public:
  /// A cube of the octree; without an octomap node it is one that nobody has seen.
  struct Node {
    const octomap::OcTreeNode* node = nullptr;
    Eigen::Vector3d center = Eigen::Vector3d::Zero();
    double half = 0;
    fcl::AABB<S> box;  ///< As FCL halves it, level by level, in S.

    bool operator==(const Node& other) const {
      return node == other.node && center == other.center && half == other.half;
    }
  };
  static constexpr bool kBodies = true;
  // Octomap's inner nodes need not be up to date.
  static constexpr bool kNodesContainSurface = false;

  /// `density` is that of the other geometry. Cells that are uncertain or not known are seen only where costs are asked
  /// for.
  OcTreeSide(const fcl::OcTree<S>& octree, const fcl::Transform3<S>& X_WO, S density, bool costs)
      : octree_(octree), X_WO_(X_WO), density_(density), costs_(costs), root_node_(octree.getRoot()) {
    root_.node = root_node_;
    root_.box = octree.getRootBV();
    root_.half = (static_cast<double>(root_.box.max_[0]) - static_cast<double>(root_.box.min_[0])) / 2;
  }

  /// Nothing in it is of interest.
  bool empty() const { return !sees(root_node_); }

  const Node& root() const { return root_; }
  query::State state(const Node& n) const {
    return n.node != nullptr && octree_.nodeHasChildren(n.node) ? query::State::kInner : query::State::kLeaf;
  }

  /// As FCL names cells, see fcl::OcTree::getNodeByQueryCellId(); of cells that octomap does not have, by their places,
  /// with a prefix that no difference of addresses has.
  std::uint64_t id(const Node& n) const {
    if (n.node != nullptr) return static_cast<std::uint64_t>(n.node - root_node_);
    std::uint64_t id = 0xfffe;
    for (int k = 0; k < 3; ++k) {
      id = id << 16 | static_cast<std::uint64_t>((n.center[k] / root_.half + 1) * 0x1p15);
    }
    return id;
  }

  double size(const Node& n) const { return 3 * n.half * n.half; }
  query::OrientedVolume volume(const Node& n) const {
    query::OrientedVolume v;
    v.center = n.center;
    v.half = Eigen::Vector3d::Constant(n.half);
    return v;
  }
  query::Sphere sphere(const Node& n) const { return {n.center, std::sqrt(3.0) * n.half}; }

  bool hasExactBox(const Node&) const { return true; }
  query::SeparationResult gap(const Node& n, const query::PointSet& points, double cutoff) const {
    Eigen::Vector3d x[8];
    query::SeparationResult gap = bodyOf(n).gap(about(n, points, x), cutoff);
    gap.on_body += n.center;
    gap.on_points += n.center;
    return gap;
  }
  query::ContactPoint penetration(const Node& n, const query::PointSet& points, query::SeparationResult gap) const {
    Eigen::Vector3d x[8];
    gap.on_body -= n.center;
    gap.on_points -= n.center;
    query::ContactPoint contact = bodyOf(n).penetration(about(n, points, x), gap);
    contact.point += n.center;
    return contact;
  }
  std::optional<Eigen::Vector3d> point(const Node& n) const { return n.center; }
  query::SweptHull hull(const Node& n) const { return query::sweptHullOf(volume(n)); }

  template <typename F>
  void children(const Node& n, F&& f) const {
    for (unsigned i = 0; i < 8; ++i) {
      Node child;
      if (octree_.nodeChildExists(n.node, i)) child.node = octree_.getNodeChild(n.node, i);
      if (!sees(child.node)) continue;
      child.half = n.half / 2;
      for (int k = 0; k < 3; ++k) child.center[k] = n.center[k] + ((i >> k & 1) != 0 ? child.half : -child.half);
      fcl::computeChildBV(n.box, i, child.box);
      f(child);
    }
  }
  template <typename F>
  void overlappingChildren(const Node& n, const query::Volume& other, const query::SimilarityTransform& to,
                           F&& f) const {
    children(n, [&](const Node& child) {
      query::Volume box{};
      for (int k = 0; k < 3; ++k) {
        box.center[k] = child.center[k];
        // Rounded outwards: the half side may be below all floats but 0.
        box.half[k] = std::nextafter(static_cast<float>(child.half), std::numeric_limits<float>::infinity());
      }
      if (!query::facesApart(box, other, to)) f(child);
    });
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
  bool sees(const octomap::OcTreeNode* node) const {
    if (node == nullptr) return costs_;
    return octree_.isNodeOccupied(node) || (costs_ && !octree_.isNodeFree(node));
  }

  // Made as FCL makes it, with its rounding.
  std::pair<fcl::Box<S>, fcl::Transform3<S>> cellOf(const Node& n) const {
    std::pair<fcl::Box<S>, fcl::Transform3<S>> cell;
    fcl::constructBox(n.box, X_WO_, cell.first, cell.second);
    return cell;
  }

  static query::BoxShape bodyOf(const Node& n) { return query::BoxShape(Eigen::Vector3d::Constant(n.half)); }
  static query::PointSet about(const Node& n, const query::PointSet& points, Eigen::Vector3d (&x)[8]) {
    for (int i = 0; i < points.count; ++i) x[i] = points.x[i] - n.center;
    return {x, points.count};
  }

  const fcl::OcTree<S>& octree_;
  const fcl::Transform3<S>& X_WO_;
  const S density_;
  const bool costs_;
  const octomap::OcTreeNode* root_node_;
  Node root_;
};

}  // namespace bocst::fcl_adapter

#endif  // FCL_HAVE_OCTOMAP
