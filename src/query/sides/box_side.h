// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>

#include "query/sides/side.h"
#include "tree/box_tree.h"

namespace bocst::query {

/// A model's oriented boxes as a side of a walk, in the frame of its TreeSide, which must outlive this: for exact
/// answers of what is long and thin, and where the walk over blocks gives up.
class BoxSide : public CompleteSide {
 public:
  using Node = int;
  static constexpr bool kBodies = false;
  static constexpr bool kNodesContainSurface = true;

  static bool fits(const TreeSide& side) { return !side.isConservative() && side.tree().affordsBoxes(); }

  /// Builds a model's boxes if it has none. False without memory for them, or while the helper thread builds them.
  static bool build(const TreeSide& side) { return side.tree().buildBoxes(side.now()); }

  explicit BoxSide(const TreeSide& side) : side_(side), boxes_(side.tree().boxes(side.now())) {}

  std::size_t meshTriangles() const { return side_.meshTriangles(); }

  Node root() const { return 0; }
  State state(Node n) const { return node(n).second == 0 ? State::kLeaf : State::kInner; }
  double size(Node n) const { return node(n).half.squaredNorm(); }

  OrientedVolume volume(Node n) const {
    OrientedVolume v;
    v.center = node(n).center;
    v.axes = node(n).axes;
    v.half = node(n).half;
    return v;
  }
  Sphere sphere(Node n) const { return {node(n).center, node(n).half.norm()}; }

  template <typename F>
  void children(Node n, F&& f) const {
    f(n + 1);
    f(static_cast<Node>(node(n).second));
  }
  template <typename F>
  void overlappingChildren(Node n, const OrientedVolume& other, const SimilarityTransform& to, F&& f) const {
    children(n, [&](Node child) {
      if (!boxesApart(volume(child), other, to)) f(child);
    });
  }

  std::size_t triangleCount(Node n) const { return node(n).count; }
  struct Triangles {
    const std::uint32_t* ids;
    std::size_t count;
  };
  Triangles triangles(Node n) const { return {&boxes_.triangles()[node(n).begin], node(n).count}; }
  void prefetch(std::uint32_t t) const { side_.prefetch(t); }
  void prefetchCorners(std::uint32_t t) const { side_.prefetchCorners(t); }
  const Eigen::Vector3d& vertex(std::uint32_t t, int k) const { return side_.vertex(t, k); }
  const Eigen::Vector3d& origin() const { return side_.origin(); }
  double inverseUnit() const { return side_.inverseUnit(); }
  Corners corners(std::uint32_t t) const { return side_.corners(t); }

 private:
  const tree::BoxTree::Node& node(Node n) const { return boxes_.nodes()[static_cast<std::size_t>(n)]; }

  const TreeSide& side_;
  const tree::BoxTree& boxes_;
};

// For walks of a tree and another side by way of oriented boxes: those of a tree, and other sides as they are.

inline bool fitsBoxes(const TreeSide& side) { return BoxSide::fits(side); }
inline bool buildBoxes(const TreeSide& side) { return BoxSide::build(side); }
inline BoxSide boxesOf(const TreeSide& side) { return BoxSide(side); }
inline const tree::Tree* treeOf(const TreeSide& side) { return &side.tree(); }
template <typename Side>
bool fitsBoxes(const Side&) {
  return true;
}
template <typename Side>
bool buildBoxes(const Side&) {
  return true;
}
template <typename Side>
const Side& boxesOf(const Side& side) {
  return side;
}
template <typename Side>
const tree::Tree* treeOf(const Side&) {
  return nullptr;
}

/// Builds what walks over boxes need; false while they must go on over blocks.
template <typename B>
bool provideBoxes(const TreeSide& a, const B& b) {
  const bool first = buildBoxes(a), second = buildBoxes(b);
  return first && second;
}

/// True if two models have oriented boxes, and those of the roots are apart.
inline bool knownBoxesApart(const TreeSide& a, const TreeSide& b, const SimilarityTransform& b_in_a) {
  if (a.tree().knownBoxes() == nullptr || b.tree().knownBoxes() == nullptr) return false;
  const BoxSide boxes_a(a), boxes_b(b);
  return boxesApart(boxes_a.volume(0), boxes_b.volume(0), b_in_a);
}

}  // namespace bocst::query
