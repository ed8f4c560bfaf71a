// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>

#include "geometry/overlap_kernels.h"
#include "query/sides/side.h"

namespace bocst::query {

/// By how much a PackRegion reaches beyond what it bounds, for a node of the other side that `to` places and corners
/// that are off by `error`; no coordinate is larger than `extent`. `tolerance`: usually that of `to`.
inline double regionMargin(const SimilarityTransform& to, double tolerance, double extent, double error) {
  return (32 * 0x1p-24 + 4 * to.orthogonality_error) * extent + 1.02 * (tolerance + error);
}

/// The triangles of a leaf of one side as smaller nodes of the other see them: with large triangles the leaf's volume
/// says little. What misses a node misses its octants, so only the first of these is asked about all triangles. Their
/// packed corners are precise enough to say which of them miss a node; only the others are read from the mesh.
class LargeTriangles {
 public:
  static constexpr std::size_t kCapacity = TrianglePack::kCapacity;

  /// To be called before the first use in a walk.
  void clear() {
    count_ = 0;
    known_ = 0;
  }

  /// True if these triangles of the leaf have been placed.
  bool know(tree::NodeRef leaf, std::uint32_t which) const {
    return count_ != 0 && leaf_ == leaf && (which & ~known_) == 0;
  }

  /// Places those triangles in `which` of a leaf of `other` that may meet the node, and says which these are. The leaf
  /// has at most kCapacity; `unit` is that of `side` in PairFrames.
  std::uint32_t meeting(const TreeSide& side, tree::NodeRef node, const TreeSide& other, tree::NodeRef leaf,
                        std::uint32_t which, const SimilarityTransform& other_in_side, double unit);

  /// Those triangles of a leaf of `other` that may come within `tolerance` of a ball in the frame of the other side.
  std::uint32_t near(const Sphere& ball, double tolerance, const TreeSide& other, tree::NodeRef leaf,
                     const SimilarityTransform& other_in_side);

  // Of triangles that are known.

  /// In the coordinates of PairFrames.
  const TriangleBounds& bounds() const { return bounds_; }
  /// Those in `which` about a point of the smaller side, in its lattice units.
  void takeRows(std::uint32_t which, const double (&about)[3], TrianglePack& rows, PackSlabs& slabs) const {
    query::takeRows(placed_, bounds_, which, {about[0] - kMiddle, about[1] - kMiddle, about[2] - kMiddle}, rows, slabs);
  }
  std::uint32_t id(std::size_t i) const { return ids_[i]; }

  static constexpr double kMiddle = lattice::kMiddle;

 private:
  void start(const TreeSide& other, tree::NodeRef leaf, const SimilarityTransform& other_in_side);
  std::uint32_t all() const { return ~0u >> (kCapacity - count_); }

  TrianglePack pack_;  // about the middle of the smaller side's root
  double error_ = 0;   // its corners may be so far from where they are, beside what placing rounds
  PackTransform place_;
  PackMotion motion_;
  tree::NodeRef leaf_;
  std::size_t count_ = 0;    // nothing is held when it is 0
  std::uint32_t read_ = 0;   // triangles whose corners are in raw_
  std::uint32_t known_ = 0;  // and those in placed_ and bounds_
  tree::TriangleIds ids_;
  RawTriangles raw_{};
  RawTriangles placed_;
  TriangleBounds bounds_;
};

}  // namespace bocst::query
