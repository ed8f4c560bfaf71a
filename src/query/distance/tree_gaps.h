// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>

#include "geometry/extent.h"
#include "query/distance/distance_kernels.h"
#include "query/leaf/leaf_corners.h"
#include "query/sides/side.h"

namespace bocst::query {

/// Bounds for the distances of two trees' nodes: of the surfaces, or, where a side answers conservatively, of the
/// spheres of its leaves. Lengths are those of side A's lattice.
class TreeGaps {
 public:
  TreeGaps(const TreeSide& a, const TreeSide& b, const SimilarityTransform& b_in_a);

  /// Expects the nearest points along this direction from A to B, a unit vector in A's frame.
  void expect(const Eigen::Vector3d& direction);

  /// The gaps between the octants of an inner node x of side `own` and a node y of the other side.
  OctantGaps ofOctants(int own, tree::NodeRef x, tree::NodeRef y);

  /// The same with the triangles of y, a leaf of exact answers that is much larger than the octants of x.
  OctantGaps ofOctantsBeside(int own, tree::NodeRef x, tree::NodeRef y);

  /// The same of two nodes in double, where a side answers conservatively: up to kExtentRounding of the sizes, which is
  /// taken off. `direction` and `cutoff`: see distanceBound().
  double ofSpheres(tree::NodeRef a, tree::NodeRef b, const Eigen::Vector3d& direction, double cutoff) const;
  /// Then it may be larger than that of ofOctants() by this much because of rounding and of smaller spheres alone.
  double doubt() const { return doubt_; }

 private:
  struct LargeLeaf;
  struct Scratch;
  static Scratch& scratch();

  LeafCells leavesOf(int side) const;
  NodeExtent extentOf(int side, tree::NodeRef node, double& radii) const;
  const LargeLeaf& largeLeaf(int side, tree::NodeRef leaf);
  const Frame& frame(int side, std::uint32_t block);
  const Frame& frameOf(int side, tree::NodeRef node, std::size_t& lane);

  const TreeSide* side_[2];
  const SimilarityTransform& b_in_a_;
  const PairFrames geometry_;
  FrameDirection direction_;
  double doubt_ = 0;
  float radii_ = 0;  // no spheres of leaves of both sides together have larger ones
};

}  // namespace bocst::query
