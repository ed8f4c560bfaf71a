// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/config.h>

#if FCL_HAVE_OCTOMAP

#include <fcl/geometry/octree/octree.h>
#include <fcl/geometry/shape/box.h>
#include <fcl/geometry/shape/utility.h>

#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "fcl/narrow_phase.h"
#include "query/body.h"
#include "query/side.h"

namespace bocst::fcl_room {

/// FCL's OcTree as a side of a walk: its leaves are boxes, in its own frame.
template <typename S>
class OcTreeSide {
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
  static constexpr bool kNodesHoldSurface = false;

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
  bool cells() const { return false; }
  query::State state(const Node& n) const {
    return n.node != nullptr && octree_.nodeHasChildren(n.node) ? query::State::kInner : query::State::kLeaf;
  }
  bool growsFreely(const Node&) const { return true; }
  void grow(const Node&, std::vector<tree::Tree::Growth>&) const {}

  /// As FCL names cells, see fcl::OcTree::getNodeByQueryCellId(); of cells that octomap does not have, by their places,
  /// with a prefix that no difference of addresses has.
  std::uint64_t name(const Node& n) const {
    if (n.node != nullptr) return static_cast<std::uint64_t>(n.node - root_node_);
    std::uint64_t name = 0xfffe;
    for (int k = 0; k < 3; ++k) {
      name = name << 16 | static_cast<std::uint64_t>((n.center[k] / root_.half + 1) * 0x1p15);
    }
    return name;
  }

  double size(const Node& n) const { return 3 * n.half * n.half; }
  query::OrientedVolume volume(const Node& n) const {
    query::OrientedVolume v;
    v.center = n.center;
    v.half = Eigen::Vector3d::Constant(n.half);
    return v;
  }
  query::Sphere sphere(const Node& n) const { return {n.center, std::sqrt(3.0) * n.half}; }

  bool isBox(const Node&) const { return true; }
  query::Gap gap(const Node& n, const query::Points& points, double enough) const {
    Eigen::Vector3d x[8];
    query::Gap gap = bodyOf(n).gap(about(n, points, x), enough);
    gap.on_body += n.center;
    gap.on_points += n.center;
    return gap;
  }
  query::Touch part(const Node& n, const query::Points& points, query::Gap gap) const {
    Eigen::Vector3d x[8];
    gap.on_body -= n.center;
    gap.on_points -= n.center;
    query::Touch touch = bodyOf(n).part(about(n, points, x), gap);
    touch.point += n.center;
    return touch;
  }
  std::optional<Eigen::Vector3d> point(const Node& n) const { return n.center; }
  query::Hull hull(const Node& n) const { return query::hullOf(volume(n)); }
  bool meets(const Node& n, const query::Sphere& s, double slack) const {
    const double reach = s.radius * (1 + 1e-12) + slack;
    return !(gap(n, {&s.center, 1}, reach).atLeast > reach);
  }

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
  template <typename OtherVolume, typename F>
  void overlappingChildren(const Node& n, const OtherVolume& other, const query::Placement& to, F&& f) const {
    children(n, [&](const Node& child) {
      if (!query::boxesApart(volume(child), query::oriented(other), to)) f(child);
    });
  }
  // Eight cells are not worth a look at each triangle.
  template <typename OtherVolume, typename Coarse, typename Other, typename F>
  void childrenMeeting(const Node& n, const OtherVolume& other, const query::Placement& to, Coarse&, const Other&,
                       typename Other::Node, F&& f) const {
    overlappingChildren(n, other, to, f);
  }

  // For BodyCollector. Cells are made as FCL makes them, with its rounding.
  bool touch(const Node& n, const NarrowPhase<S>& narrow_phase, const fcl::Vector3<S> (&corners)[3],
             const fcl::Transform3<S>& X_WM) const {
    fcl::Box<S> cell;
    fcl::Transform3<S> X_WC;
    fcl::constructBox(n.box, X_WO_, cell, X_WC);
    return narrow_phase.touch(cell, X_WC, corners, X_WM);
  }
  bool occupied(const Node& n) const { return n.node != nullptr && octree_.isNodeOccupied(n.node); }
  S density(const Node& n) const {
    return (n.node != nullptr ? static_cast<S>(n.node->getOccupancy()) : octree_.getOccupancyThres()) * density_;
  }
  fcl::AABB<S> worldBox(const Node& n) const {
    fcl::Box<S> cell;
    fcl::Transform3<S> X_WC;
    fcl::constructBox(n.box, X_WO_, cell, X_WC);
    fcl::AABB<S> box;
    fcl::computeBV(cell, X_WC, box);
    return box;
  }

 private:
  bool sees(const octomap::OcTreeNode* node) const {
    if (node == nullptr) return costs_;
    return octree_.isNodeOccupied(node) || (costs_ && !octree_.isNodeFree(node));
  }

  static query::BoxBody bodyOf(const Node& n) { return query::BoxBody(Eigen::Vector3d::Constant(n.half)); }
  static query::Points about(const Node& n, const query::Points& points, Eigen::Vector3d (&x)[8]) {
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

}  // namespace bocst::fcl_room

#endif  // FCL_HAVE_OCTOMAP
