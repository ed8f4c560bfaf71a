// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "query/kernels.h"
#include "query/triangle.h"
#include "query/volume.h"
#include "tree/tree.h"

namespace bocst::query {

/// What a walk can do with a node.
enum class State {
  kInner,  ///< Has resident children.
  kLeaf,   ///< Is tested itself: by its triangles, or as a sphere (cell).
  kGrows,  ///< Needs the oracle first.
};

/// One side of a pair: a model's tree. A partner of another kind is another class with these members (BvhSide).
/// The gate of the tree is held shared for the life of this object.
class TreeSide {
 public:
  using Node = tree::NodeRef;
  static constexpr bool kGrows = true;

  explicit TreeSide(tree::Tree& tree) : tree_(tree), now_(tree.now()) {}

  Node root() const { return Node(); }

  /// Leaves are cells of the collision depth, not triangles.
  bool cells() const { return tree_.conservative(); }

  State state(Node node) const {
    const tree::Link link = tree_.link(node);
    if (link.tag() == tree::Link::kBlock && !(cells() && tree_.isDeepest(level(node)))) return State::kInner;
    if (cells()) return tree_.isDeepest(level(node)) ? State::kLeaf : State::kGrows;
    if (link.tag() != tree::Link::kList) return State::kGrows;
    const bool small = tree_.list(link).count <= tree::Tree::kLeafTriangles;
    return small || tree_.isDeepest(level(node)) ? State::kLeaf : State::kGrows;
  }

  void grow(Node node, std::vector<tree::Tree::Growth>& batch) const { batch.push_back({&tree_, node, !cells()}); }

  Volume volume(Node node) const {
    const oracle::CellBounds b = tree_.bounds(node, tree_.link(node));
    const lattice::Cell cell = tree_.cell(node);
    const double side = cell.side(), byte = side / 255, normal = 1.0 / 127;
    Volume v;
    Eigen::Vector3d n, from_cell_center;
    for (int k = 0; k < 3; ++k) {
      v.half[k] = (b.hi[k] - b.lo[k]) * (byte / 2);
      from_cell_center[k] = (b.hi[k] + b.lo[k]) * (byte / 2) - side / 2;
      v.center[k] = cell.corner()[k] + side / 2 + from_cell_center[k];
      n[k] = b.normal[k];
    }
    v.normal = n * normal;
    v.slab_offset = (b.slab_center * side - n.dot(from_cell_center)) * normal;
    v.slab_half = b.slab_half * (side * normal / 2);
    return v;
  }

  /// Bounds the surface below a node, and the spheres of all cells below it: a cube's sphere holds those of its parts; the
  /// sphere of a part of a clipped region may stick out, by less than the factor sqrt(2) about the region's centre, as
  /// |h - h'| + |h'| <= sqrt(2) |h| for half extents 0 <= h' <= h.
  Sphere sphere(Node node) const {
    Sphere s = cellSphere(node);
    if (cells() && !tree_.isDeepest(level(node)) && !cube_) s.radius *= 1.4142135623730952;
    return s;
  }

  /// The sphere about the node's actual region.
  Sphere cellSphere(Node node) const {
    Sphere s;
    Eigen::Vector3d half;
    tree_.surface().lattice.region(tree_.cell(node), s.center, half);
    s.radius = half.norm();
    return s;
  }

  /// Names the cell of a leaf: its Morton code among those of its level.
  std::uint32_t cellId(Node node) const { return static_cast<std::uint32_t>(tree_.cell(node).morton()); }

  /// Calls f(child) for the children of an inner node that `other`, placed in this frame by `to`, may overlap.
  template <typename F>
  void overlappingChildren(Node node, const Volume& other, const Placement& to, F&& f) const {
    const std::uint32_t index = tree_.link(node).index();
    const tree::Block& block = tree_.block(index);
    tree_.touch(block, now_);
    const lattice::Cell cell = block.cell();
    const auto at = cell.corner();
    const Eigen::Vector3d corner(at[0], at[1], at[2]);
    const OneVolume one = seenFrom(other, to, corner, cell.side() / 2.0);
    for (int mask = overlappingOctants(block.octants, one) & block.grey; mask != 0; mask &= mask - 1) {
      f(Node::octant(index, __builtin_ctz(static_cast<unsigned>(mask))));
    }
  }

  /// Calls f(child) for all children.
  template <typename F>
  void children(Node node, F&& f) const {
    const std::uint32_t index = tree_.link(node).index();
    const tree::Block& block = tree_.block(index);
    tree_.touch(block, now_);
    for (int mask = block.grey; mask != 0; mask &= mask - 1) {
      f(Node::octant(index, __builtin_ctz(static_cast<unsigned>(mask))));
    }
  }

  /// Triangles of a leaf that is not a cell.
  std::size_t triangleCount(Node node) const { return tree_.list(tree_.link(node)).count; }
  std::uint32_t triangle(Node node, std::size_t i) const { return tree_.list(tree_.link(node)).ids[i]; }

  /// Corner k of triangle t in this side's frame.
  Eigen::Vector3d corner(std::uint32_t t, int k) const { return tree_.surface().corner(t, k); }

  std::int64_t now() const { return now_; }
  tree::Tree& tree() const { return tree_; }

 private:
  int level(Node node) const { return node.isRoot() ? 1 : tree_.block(node.block()).level + 1; }

  tree::Tree& tree_;
  const std::int64_t now_;
  const bool cube_ = tree_.surface().lattice.extent() ==
                     std::array<std::uint32_t, 3>{1u << lattice::kBits, 1u << lattice::kBits, 1u << lattice::kBits};
};

/// Orders a batch so that each node is grown once.
inline void uniqueGrowths(std::vector<tree::Tree::Growth>& batch) {
  using Growth = tree::Tree::Growth;
  std::sort(batch.begin(), batch.end(), [](const Growth& a, const Growth& b) {
    return a.tree != b.tree ? std::less<tree::Tree*>()(a.tree, b.tree) : a.node < b.node;
  });
  batch.erase(std::unique(batch.begin(), batch.end(),
                          [](const Growth& a, const Growth& b) { return a.tree == b.tree && a.node == b.node; }),
              batch.end());
}

}  // namespace bocst::query
