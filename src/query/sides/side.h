// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "geometry/overlap_kernels.h"
#include "geometry/triangle.h"
#include "geometry/volume.h"
#include "tree/tree.h"

namespace bocst::query {

/// What a walk can do with a node.
enum class State {
  kInner,  ///< Has resident children.
  kLeaf,   ///< Is tested itself: by its triangles, or as a sphere (cell).
  kGrows,  ///< Needs the oracle first.
};

/// What sides have in common of which nothing grows, and which answer with their surface.
struct CompleteSide {
  bool isConservative() const { return false; }
  template <typename Node>
  bool growsFromGrid(const Node&) const {
    return false;
  }
  template <typename Node>
  void grow(const Node&, std::vector<tree::Tree::Growth>&) const {}
  // How the children of a node are tested eight at once: as lanes, with lanes(), overlappingLanes() and pushLanes() as
  // TreeSide has them, also for distances (SideFrames); or as octants of a cube, with childrenMeeting().
  static constexpr bool kHasLanes = false, kHasCubes = false;
  // Only a side that answers with cells is asked for these.
  template <typename Node>
  Sphere cellSphere(const Node&) const {
    return {};
  }
  template <typename Node>
  std::uint64_t cellId(const Node&) const {
    return 0;
  }
};

/// One side of a pair: a model's tree. A partner of another kind is another class with these members (BvhSide).
/// Nodes may be read only while the query lock of the tree is held shared.
class TreeSide {
 public:
  using Node = tree::NodeRef;
  static constexpr bool kBodies = false;
  static constexpr bool kNodesContainSurface = true;
  static constexpr bool kHasLanes = true, kHasCubes = false;

  explicit TreeSide(tree::Tree& tree) : TreeSide(tree, tree.now()) {}
  TreeSide(tree::Tree& tree, std::int64_t now) : tree_(tree), now_(now) {}

  Node root() const { return Node(); }

  /// Leaves are cells of the collision depth, not triangles.
  bool isConservative() const { return tree_.conservative(); }

  /// Where the children or triangles of a node are. While a query runs, another thread may put a whole tree below the
  /// root: all that this query reads of the root is of the block or leaf that it saw first.
  tree::ChildRef childRef(Node node) const {
    if (!node.isRoot()) return tree_.childRef(node);
    if (root_ref_.tag() != tree::ChildRef::kBlock && root_ref_.tag() != tree::ChildRef::kShortList) {
      root_ref_ = tree_.childRef(node);
    }
    return root_ref_;
  }

  State state(Node node) const {
    const tree::ChildRef ref = childRef(node);
    if (ref.tag() == tree::ChildRef::kBlock && !(isConservative() && tree_.isDeepest(level(node))))
      return State::kInner;
    if (isConservative()) return tree_.isDeepest(level(node)) ? State::kLeaf : State::kGrows;
    if (ref.tag() == tree::ChildRef::kShortList) return State::kLeaf;
    return ref.tag() == tree::ChildRef::kList && tree_.isDeepest(level(node)) ? State::kLeaf : State::kGrows;
  }

  /// Growing this node needs no oracle.
  bool growsFromGrid(Node node) const { return tree_.growsFromGrid(node); }

  void grow(Node node, std::vector<tree::Tree::Growth>& batch) const {
    batch.push_back({&tree_, node, !isConservative()});
  }

  /// Half the diagonal of the node's cell, squared: what decides which of two nodes is expanded.
  double size(Node node) const {
    const double side = 1 << (lattice::kMaxLevel - level(node));
    return 0.75 * side * side;
  }

  Volume volume(Node node) const {
    if (node.isRoot()) return tree::frameOf(lattice::Cell{}).decode(tree_.rootBounds());
    const tree::Block& parent = tree_.block(node.block());
    const bounds::NodeBounds b = parent.octants.get(static_cast<std::size_t>(node.octant()));
    return parent.isLoose() ? parent.frame().decode(b) : parent.octantFrame(node.octant()).decode(b);
  }

  /// Bounds the surface below a node, and the spheres of all cells below it: a cube's sphere holds those of its parts;
  /// the sphere of a part of a clipped region may stick out, by less than the factor sqrt(2) about the region's centre,
  /// as |h - h'| + |h'| <= sqrt(2) |h| for half extents 0 <= h' <= h.
  Sphere sphere(Node node) const {
    if (tree_.isLoose(node)) return sphereAbout(volume(node));
    const lattice::Cell cell = tree_.cell(node);
    Sphere s = sphereAbout(cell);
    if (isConservative() && !tree_.isDeepest(cell.level) && isClipped(cell)) s.radius *= 1.4142135623730952;
    return s;
  }

  /// The sphere about the node's cube: quickly had, for what only wants an order.
  Sphere roughSphere(Node node) const {
    if (tree_.isLoose(node)) return sphereAbout(volume(node));
    const lattice::Cell cell = tree_.cell(node);
    const double side = cell.side();
    return {(Eigen::Vector3d(cell.at[0], cell.at[1], cell.at[2]).array() + 0.5) * side, 0.8660254037844387 * side};
  }

  /// The sphere about the node's actual region.
  Sphere cellSphere(Node node) const { return sphereAbout(tree_.cell(node)); }

  /// The least id of the cells at and below a node with conservative answers.
  std::uint64_t firstCellId(Node node) const {
    const lattice::Cell cell = tree_.cell(node);
    return cell.morton() << 3 * (tree_.deepest() - cell.level);
  }

  /// Names the cell of a leaf: its Morton code among those of its level.
  std::uint64_t cellId(Node node) const { return tree_.cell(node).morton(); }

  /// Calls f(child) for the children of an inner node that `other`, placed in this frame by `to`, may overlap.
  template <typename OtherVolume, typename F>
  void overlappingChildren(Node node, OtherVolume& other, const SimilarityTransform& to, F&& f) const {
    pushLanes(node, overlappingLanes(node, other, to), [&f](Node child, int) { f(child); });
  }

  /// The children of an inner node that `other`, placed in this frame by `to`, may overlap: a bit for each lane.
  template <typename OtherVolume>
  unsigned overlappingLanes(Node node, OtherVolume& other, const SimilarityTransform& to) const {
    const std::uint32_t index = childRef(node).index();
    const tree::Block& block = tree_.block(index);
    tree_.markUsed(index, now_);
    if (block.isLoose()) {
      const bounds::LooseFrame frame = block.frame();
      const double corner[3] = {double(frame.origin[0]), double(frame.origin[1]), double(frame.origin[2])};
      return query::overlappingLanes(frame, block.octants, seenFrom(other, to, corner, frame.longest() / 2)) &
             block.grey;
    }
    const double side = 1 << (lattice::kMaxLevel - block.shape);
    const double corner[3] = {block.at[0] * side, block.at[1] * side, block.at[2] * side};
    return overlappingOctants(block.octants, seenFrom(other, to, corner, side / 2)) & block.grey;
  }

  /// Those of all children.
  unsigned lanes(Node node) const {
    const std::uint32_t index = childRef(node).index();
    tree_.markUsed(index, now_);
    return tree_.block(index).grey;
  }

  /// Calls f(child, lane) for the children in `mask`. What is still implicit comes first, so that a stack leaves it for
  /// last: a hit among resident nodes makes its growth unnecessary.
  template <typename F>
  void pushLanes(Node node, unsigned mask, F&& f) const {
    const std::uint32_t index = childRef(node).index();
    const tree::Block& block = tree_.block(index);
    unsigned resident = 0;
    for (unsigned left = mask; left != 0; left &= left - 1) {
      const int o = __builtin_ctz(left);
      if (block.child[o].load(std::memory_order_relaxed).tag() == tree::ChildRef::kImplicit) {
        f(Node::octant(index, o), o);
      } else {
        resident |= 1u << o;
      }
    }
    for (; resident != 0; resident &= resident - 1) {
      const int o = __builtin_ctz(resident);
      f(Node::octant(index, o), o);
    }
  }

  /// The block of an inner node.
  std::uint32_t block(Node node) const { return childRef(node).index(); }

  /// True if the children of an inner node are octants of a cell, false if they are lanes of a loose block.
  bool hasOctants(Node node) const { return !tree_.block(childRef(node).index()).isLoose(); }

  /// The centre of an inner node's cell and half its side, which is the side of its octants.
  double octantsOf(Node node, Eigen::Vector3d& center) const {
    const tree::Block& block = tree_.block(childRef(node).index());
    const double half = 1 << (lattice::kMaxLevel - block.shape - 1);
    center = Eigen::Vector3d(2 * block.at[0] + 1, 2 * block.at[1] + 1, 2 * block.at[2] + 1) * half;
    return half;
  }

  /// Calls f(child) for all children.
  template <typename F>
  void children(Node node, F&& f) const {
    const std::uint32_t index = childRef(node).index();
    const tree::Block& block = tree_.block(index);
    tree_.markUsed(index, now_);
    for (int mask = block.grey; mask != 0; mask &= mask - 1) {
      f(Node::octant(index, __builtin_ctz(static_cast<unsigned>(mask))));
    }
  }

  /// Triangles of a leaf that is not a cell.
  tree::TriangleList triangles(Node node) const { return tree_.list(childRef(node)); }
  std::size_t triangleCount(Node node) const { return triangles(node).count; }

  /// The corners of a leaf's triangles where the tree keeps them packed, and their numbers; else false.
  bool packed(Node node, tree::PackedTriangles& triangles, tree::TriangleIds& ids) const {
    const std::uint32_t list = childRef(node).index();
    if (!tree_.lists().packed(list, triangles)) {
      tree_.noteUnpacked(node);
      return false;
    }
    ids = tree_.lists()[list].ids;
    return true;
  }

  /// Triangle t is about to be read.
  void prefetch(std::uint32_t t) const { __builtin_prefetch(&tree_.surface().mesh->indices(t)); }
  void prefetchCorners(std::uint32_t t) const {
    for (int k = 0; k < 3; ++k) __builtin_prefetch(&vertex(t, k));
  }

  /// Corner k of triangle t as given; (v - origin()) * inverseUnit() is it in this side's frame.
  const Eigen::Vector3d& vertex(std::uint32_t t, int k) const {
    const Mesh& mesh = *tree_.surface().mesh;
    return mesh.vertex(mesh.indices(t)[static_cast<std::size_t>(k)]);
  }
  const Eigen::Vector3d& origin() const { return tree_.surface().lattice.origin(); }
  double inverseUnit() const { return 1 / tree_.surface().lattice.unit(); }

  /// The corners of triangle t in this side's frame.
  Corners corners(std::uint32_t t) const { return tree_.surface().corners(t); }

  std::int64_t now() const { return now_; }
  tree::Tree& tree() const { return tree_; }
  std::size_t meshTriangles() const { return tree_.surface().triangle_count; }

 private:
  static Sphere sphereAbout(const Volume& v) {
    Sphere s;
    s.center = {v.center[0], v.center[1], v.center[2]};
    s.radius = Eigen::Vector3d(double(v.half[0]), double(v.half[1]), double(v.half[2])).norm() * (1 + 0x1p-22);
    return s;
  }

  Sphere sphereAbout(const lattice::Cell& cell) const {
    Sphere s;
    Eigen::Vector3d half;
    tree_.surface().lattice.region(cell, s.center, half);
    s.radius = half.norm();
    return s;
  }

  /// True if the actual region is less than the cell. If not, none below it is.
  bool isClipped(const lattice::Cell& cell) const {
    const std::array<std::uint32_t, 3>& end = tree_.surface().lattice.extent();
    const std::array<std::uint32_t, 3> corner = cell.corner();
    for (std::size_t k = 0; k < 3; ++k) {
      if (corner[k] + cell.side() > end[k]) return true;
    }
    return false;
  }

  int level(Node node) const { return tree_.level(node); }

  tree::Tree& tree_;
  const std::int64_t now_;
  mutable tree::ChildRef root_ref_;
};

/// The transform with the reach of the spheres of both sides' leaves added to its tolerance: what separates the
/// surfaces by more also separates these spheres.
inline SimilarityTransform withSphereReach(const TreeSide& a, const TreeSide& b, SimilarityTransform b_in_a) {
  const auto reach = [](const TreeSide& side) { return side.tree().sphereReach() * side.inverseUnit(); };
  b_in_a.tolerance += (reach(a) + reach(b) * b_in_a.scale) * (1 + 1e-9);
  return b_in_a;
}

}  // namespace bocst::query
