// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "geometry/extent.h"
#include "query/distance/distance_kernels.h"
#include "query/distance/side_frames.h"
#include "query/leaf/leaf_corners.h"
#include "query/sides/side.h"
#include "thread/of_thread.h"

namespace bocst::query {

/// Bounds for the distances of the nodes of two sides that have lanes, eight at once: of the surfaces, or, where a tree
/// answers conservatively, of the spheres of its leaves. Lengths are those of side A's lattice.
template <typename A, typename B>
class NodeGaps {
 public:
  static_assert(std::is_same<A, TreeSide>::value, "its frame is its lattice");

  /// Of sides for which PairFrames::isFine().
  NodeGaps(const A& a, const B& b, const SimilarityTransform& b_in_a)
      : a_(a), b_(b), b_in_a_(b_in_a), lattices_(betweenLattices(b, b_in_a)), geometry_(lattices_) {
    Scratch& s = scratch();
    s.a.start(a, geometry_, 0);
    s.b.start(b, geometry_, 1);
    for (auto& leaf : s.large_a) leaf.count = 0;
    for (auto& leaf : s.large_b) leaf.count = 0;
    addRadius(a, 1);
    addRadius(b, b_in_a.scale);
    doubt_ += 4 * static_cast<double>(geometry_.slab_rounding_margin);
  }

  /// Expects the nearest points along this direction from A to B, a unit vector in A's frame.
  void expect(const Eigen::Vector3d& direction) {
    const Eigen::Vector3d back = b_in_a_.rotation.transpose() * direction;
    for (int k = 0; k < 3; ++k) {
      direction_.in[0][k] = static_cast<float>(direction[k]);
      direction_.in[1][k] = static_cast<float>(back[k]);
    }
  }

  /// The gaps between the lanes of an inner node of one side and a node of the other. `beside`: the latter is a leaf of
  /// exact answers that is much larger than the lanes, so its triangles are looked at, too.
  LaneGaps ofLanesOfA(typename A::Node x, typename B::Node y, bool beside) {
    Scratch& s = scratch();
    return ofLanes<0>(s.a.ofLanes(a_, x), s.b, b_, y, beside, s.large_b);
  }
  LaneGaps ofLanesOfB(typename A::Node y, typename B::Node x, bool beside) {
    Scratch& s = scratch();
    return ofLanes<1>(s.b.ofLanes(b_, x), s.a, a_, y, beside, s.large_a);
  }

  /// The same of two nodes in double, where a side answers conservatively: up to kExtentRounding of the sizes, which is
  /// taken off. `direction` and `cutoff`: see distanceBound().
  double ofSpheres(typename A::Node a, typename B::Node b, const Eigen::Vector3d& direction, double cutoff) const {
    double radii = 0;
    const NodeExtent extent_a = extentOf(a_, a, SimilarityTransform(), radii),
                     extent_b = extentOf(b_, b, b_in_a_, radii);
    return distanceBound(extent_a, extent_b, direction, cutoff + radii) - radii;
  }
  /// It may exceed the bound of lanes by this length, in the unit of A, because of rounding and of smaller spheres
  /// alone.
  double doubt() const { return doubt_; }

 private:
  // The triangles of a leaf in the frame of the other side, as triangleGaps() sees them.
  template <typename Side>
  struct LargeLeaf {
    typename Side::Node leaf{};
    std::size_t count = 0;  // nothing is held when it is 0
    TriangleBounds bounds;
  };
  static constexpr std::size_t kLargeLeaves = 8;

  struct Scratch {
    SideFrames<A> a;
    SideFrames<B> b;
    LargeLeaf<A> large_a[kLargeLeaves];
    LargeLeaf<B> large_b[kLargeLeaves];
    RawTriangles raw, placed;
  };
  static Scratch& scratch() { return thread::ofThread<Scratch>(); }

  // Of the spheres of a side's leaves. Where regions are clipped, some are smaller.
  template <typename Side>
  void addRadius(const Side& side, double scale) {
    if constexpr (std::is_same<Side, TreeSide>::value) {
      if (!side.isConservative()) return;
      constexpr double kHalfDiagonal = 0.8660254037844387;  // of a cube of side 1
      const LeafCells leaves = SideFrames<TreeSide>::leavesOf(side);
      const double radius = kHalfDiagonal * leaves.side * scale;
      radii_ += static_cast<float>(radius * (1 + 0x1p-20));
      const bool is_clipped = std::any_of(leaves.extent.begin(), leaves.extent.end(),
                                          [&](std::int32_t end) { return end % leaves.side != 0; });
      if (is_clipped) doubt_ += radius;
    }
  }

  template <int kOwn, typename Other>
  LaneGaps ofLanes(const Frame& f, SideFrames<Other>& frames, const Other& other, typename Other::Node y, bool beside,
                   LargeLeaf<Other> (&large)[kLargeLeaves]) {
    std::size_t lane = 0;
    const Frame& other_frame = frames.of(other, y, lane);
    LaneGaps gaps;
    laneGaps(geometry_, kOwn, f, other_frame, lane, direction_, gaps);
    if (radii_ > 0) {
      for (float& gap : gaps.at_least) gap = std::max(gap * (1 - 0x1p-22f) - radii_, 0.0f);
    }
    if (beside && other.triangleCount(y) <= TriangleBounds::kCapacity) {
      const LargeLeaf<Other>& leaf = largeLeaf<1 - kOwn>(other, y, large[numberOf(y) % kLargeLeaves]);
      triangleGaps(geometry_, f, leaf.bounds, leaf.count, gaps);
    }
    return gaps;
  }

  template <int kSide, typename Side>
  const LargeLeaf<Side>& largeLeaf(const Side& side, typename Side::Node node, LargeLeaf<Side>& large) {
    constexpr double kNowhere = 1e30;
    if (large.count != 0 && large.leaf == node) return large;
    Scratch& s = scratch();
    const auto triangles = side.triangles(node);
    large.leaf = node;
    large.count = triangles.count;
    const std::uint32_t all = ~0u >> (TriangleBounds::kCapacity - large.count);
    readCorners(side, triangles.ids, all, s.raw);
    const SimilarityTransform in_other = kSide == 1 ? b_in_a_ : lattices_.inverse();
    const PackTransform place = packTransform(side, in_other, Eigen::Vector3d::Constant(lattice::kMiddle), 1);
    boundTriangles(s.raw, all, place, static_cast<double>(geometry_.side[1 - kSide].unit), kNowhere, s.placed,
                   large.bounds);
    return large;
  }

  template <typename Side>
  static NodeExtent extentOf(const Side& side, typename Side::Node node, const SimilarityTransform& to, double&) {
    return {side.volume(node), to};
  }
  // As fillCenters() has it. Adds the radius that no leaf's sphere exceeds.
  static NodeExtent extentOf(const TreeSide& side, tree::NodeRef node, const SimilarityTransform& to, double& radii) {
    const Volume v = side.volume(node);
    if (!side.isConservative()) return {v, to};
    const LeafCells leaves = SideFrames<TreeSide>::leavesOf(side);
    const lattice::Cell cell = side.tree().cell(node);
    const double leaf = leaves.side, cells = cell.side() / leaf;
    OrientedVolume centers;
    Eigen::Vector3d largest;
    for (int k = 0; k < 3; ++k) {
      const auto i = static_cast<std::size_t>(k);
      const double corner = cell.corner()[i], half = double(v.half[i]), end = leaves.extent[i];
      const double lo = (v.center[i] - half - corner) / leaf, hi = (v.center[i] + half - corner) / leaf;
      const double first = std::clamp(std::floor(lo - kPartOfCell), 0.0, cells - 1),
                   last = std::clamp(std::ceil(hi + kPartOfCell) - 1, first, cells - 1);
      const double low = corner + first * leaf, high = corner + last * leaf;
      const double least = (low + std::min(low + leaf, end)) / 2, most = (high + std::min(high + leaf, end)) / 2;
      centers.center[k] = (least + most) / 2;
      centers.half[k] = (most - least) / 2;
      largest[k] = least - low;
    }
    radii += largest.norm() * to.scale;
    return {centers, to};
  }

  const A& a_;
  const B& b_;
  const SimilarityTransform& b_in_a_;
  const SimilarityTransform lattices_;  // from B's lattice to A's
  const PairFrames geometry_;
  FrameDirection direction_;
  double doubt_ = 0;
  float radii_ = 0;  // no spheres of leaves of both sides together have larger ones
};

}  // namespace bocst::query
