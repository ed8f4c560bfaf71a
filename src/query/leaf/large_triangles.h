// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>

#include "query/leaf/leaf_corners.h"
#include "query/sides/side.h"

namespace bocst::query {

/// The triangles of a leaf of one side as smaller nodes of the other see them: with large triangles the leaf's volume
/// says little. What misses a node misses its octants, so only the first of these is asked about all triangles.
class LargeTriangles {
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
                        std::uint32_t which, const SimilarityTransform& other_in_side, double unit);

  // Of triangles that are known.

  /// In the coordinates of PairFrames.
  const TriangleBounds& bounds() const { return bounds_; }
  /// In lattice units of the smaller side, about the middle of its root.
  Eigen::Vector3d corner(std::size_t i, std::size_t k) const {
    return {placed_.xyz[3 * k][i], placed_.xyz[3 * k + 1][i], placed_.xyz[3 * k + 2][i]};
  }
  std::uint32_t id(std::size_t i) const { return raw_.id(i); }

  static constexpr double kMiddle = lattice::kMiddle;

 private:
  LeafCorners<TreeSide> raw_;
  TrianglePack pack_;  // about the middle of the smaller side's root
  PackTransform place_;
  tree::NodeRef leaf_;
  std::size_t count_ = 0;  // nothing is held when it is 0
  std::uint32_t known_ = 0;
  RawTriangles placed_;
  TriangleBounds bounds_;
};

}  // namespace bocst::query
