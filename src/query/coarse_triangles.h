// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>

#include "query/leaf_corners.h"
#include "query/side.h"
#include "query/triangle.h"

namespace bocst::query {

/// Where a triangle is, for tests against boxes that are not larger than it: between two bounds along each axis, along
/// its normal, and behind its edges in its plane. In the coordinates of PairFrames.
///
/// Axes are rounded to float first and the bounds computed along what they are then, so whatever an axis is, it is one.
/// The sum of its entries' sizes is 1, or 0 where there is none.
struct TriangleBounds {
  float low[3], high[3];
  float normal[3], normal_low, normal_high;
  float edge[3][3], edge_high[3];

  /// `far`: a length that no box's coordinates exceed; bounds beyond twice that are cut off there.
  TriangleBounds(const Corners& corners, double far);
  TriangleBounds() = default;
};

/// The triangles of a leaf of one side as smaller nodes of the other see them: with large triangles the leaf's volume
/// says little. What misses a node misses its octants, so only the first of these is asked about all triangles.
class CoarseTriangles {
 public:
  static constexpr std::size_t kCapacity = TrianglePack::kCapacity;

  /// To be called before the first use in a walk.
  void clear() {
    count_ = 0;
    known_ = 0;
    raw_.clear();
  }

  /// Have these triangles of the leaf been placed?
  bool know(tree::NodeRef leaf, std::uint32_t which) const {
    return count_ != 0 && leaf_ == leaf && (which & ~known_) == 0;
  }

  /// Places those triangles in `which` of a leaf of `other` that may meet the node, and says which these are. The leaf
  /// has at most kCapacity; `unit` is that of `side` in PairFrames.
  std::uint32_t meeting(const TreeSide& side, tree::NodeRef node, const TreeSide& other, tree::NodeRef leaf,
                        std::uint32_t which, const Placement& other_in_side, double unit);

  // Of triangles that are known.

  const TriangleBounds& bounds(std::size_t i) const { return bounds_[i]; }
  /// Corners in lattice units of the smaller side, about the middle of its root.
  const Corners& corners(std::size_t i) const { return corners_[i]; }
  std::uint32_t id(std::size_t i) const { return raw_.id(i); }

  static constexpr double kMiddle = 1 << (lattice::kBits - 1);

 private:
  LeafCorners<TreeSide> raw_;
  TrianglePack pack_;  // about the middle of the smaller side's root
  PackPlacement place_;
  tree::NodeRef leaf_;
  std::size_t count_ = 0;  // nothing is held when it is 0
  std::uint32_t known_ = 0;
  TriangleBounds bounds_[kCapacity];
  Corners corners_[kCapacity];
};

}  // namespace bocst::query
