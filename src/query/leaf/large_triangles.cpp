// SPDX-License-Identifier: BSD-3-Clause
#include "query/leaf/large_triangles.h"

#include <algorithm>
#include <cmath>

#include "log/assert.h"

namespace bocst::query {
namespace {

// The region in which triangles of a pack can meet a node's volume v. The pack's frame has its origin at the middle of
// the root of v's tree, in lattice units. With M = `extent`, region and trianglesWithin() are off by 15 u M, as for
// LeafPairs.
PackRegion regionOf(const Volume& v, const SimilarityTransform& other_in_side, double size) {
  PackRegion region;
  double displacement[3], extent = size, offset = v.slab_offset;
  for (int k = 0; k < 3; ++k) {
    displacement[k] = v.center[k] - LargeTriangles::kMiddle;
    extent = std::max(extent, std::abs(displacement[k]) + v.half[k]);
    offset += v.normal[k] * displacement[k];
    region.normal[k] = v.normal[k];
  }
  const double rounding_margin =
      (32 * 0x1p-24 + 4 * other_in_side.orthogonality_error) * extent + 1.02 * other_in_side.tolerance;
  for (int k = 0; k < 3; ++k) {
    region.low[k] = static_cast<float>(displacement[k] - v.half[k] - rounding_margin);
    region.high[k] = static_cast<float>(displacement[k] + v.half[k] + rounding_margin);
  }
  region.slab_low = static_cast<float>(offset - v.slab_half - rounding_margin);
  region.slab_high = static_cast<float>(offset + v.slab_half + rounding_margin);
  return region;
}

}  // namespace

std::uint32_t LargeTriangles::meeting(const TreeSide& side, tree::NodeRef node, const TreeSide& other,
                                      tree::NodeRef leaf, std::uint32_t which, const SimilarityTransform& other_in_side,
                                      double unit) {
  if (count_ == 0 || !(leaf_ == leaf)) {
    leaf_ = leaf;
    known_ = 0;
    raw_.take(other, leaf, 0);
    count_ = raw_.count();
    BOCST_ASSERT(0 < count_ && count_ <= kCapacity);
    place_ = packTransform(other, other_in_side, Eigen::Vector3d::Constant(kMiddle), 1);
    raw_.place(place_, pack_);
  }
  std::uint32_t met = which & (count_ < 8 * sizeof(which) ? (1u << count_) - 1 : ~0u);
  if (inRange(pack_)) {
    met &= trianglesWithin(pack_, regionOf(side.volume(node), other_in_side, static_cast<double>(pack_.size)));
  }
  const std::uint32_t wanted = met & ~known_;
  if (wanted != 0) known_ |= boundTriangles(raw_.raw(), wanted, place_, unit, 2 * kMiddle * unit, placed_, bounds_);
  return met;
}

}  // namespace bocst::query
