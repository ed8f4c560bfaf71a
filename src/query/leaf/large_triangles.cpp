// SPDX-License-Identifier: BSD-3-Clause
#include "query/leaf/large_triangles.h"

#include <algorithm>
#include <cmath>

#include "log/assert.h"
#include "query/leaf/leaf_corners.h"
#include "query/leaf/unpack.h"

namespace bocst::query {
namespace {

// The region in which triangles of a pack can meet a node's volume v. The pack's frame has its origin at the middle of
// the root of v's tree, in lattice units; corners are off by `error`. With M = `extent`, region and trianglesWithin()
// are off by 15 u M, as for LeafPairs.
PackRegion regionOf(const Volume& v, const SimilarityTransform& other_in_side, double size, double error) {
  PackRegion region;
  double displacement[3], extent = size, offset = v.slab_offset;
  for (int k = 0; k < 3; ++k) {
    displacement[k] = v.center[k] - LargeTriangles::kMiddle;
    extent = std::max(extent, std::abs(displacement[k]) + v.half[k]);
    offset += v.normal[k] * displacement[k];
    region.normal[k] = v.normal[k];
  }
  const double rounding_margin = regionMargin(other_in_side, other_in_side.tolerance, extent, error);
  for (int k = 0; k < 3; ++k) {
    region.low[k] = static_cast<float>(displacement[k] - v.half[k] - rounding_margin);
    region.high[k] = static_cast<float>(displacement[k] + v.half[k] + rounding_margin);
  }
  region.slab_low = static_cast<float>(offset - v.slab_half - rounding_margin);
  region.slab_high = static_cast<float>(offset + v.slab_half + rounding_margin);
  return region;
}

}  // namespace

void LargeTriangles::start(const TreeSide& other, tree::NodeRef leaf, const SimilarityTransform& other_in_side) {
  if (count_ == 0) {  // the first leaf of a walk
    place_ = packTransform(other, other_in_side, Eigen::Vector3d::Constant(kMiddle), 1);
    motion_ = turnOf(other_in_side);
  }
  leaf_ = leaf;
  known_ = 0;
  tree::PackedTriangles packed;
  if (!other.packed(leaf, packed, ids_)) {
    const tree::TriangleList list = other.triangles(leaf);
    ids_ = list.ids;
    count_ = list.count;
    BOCST_ASSERT(0 < count_ && count_ <= kCapacity);
    readCorners(other, ids_, all(), raw_);
    read_ = all();
    placeTriangles(raw_, count_, place_, pack_);
    error_ = 0;
    return;
  }
  count_ = packed.count;
  read_ = 0;
  const Eigen::Vector3d origin = other_in_side * Eigen::Vector3d(packed.origin[0], packed.origin[1], packed.origin[2]);
  double size = 2 * other_in_side.scale * tree::PackedTriangles::kMost *
                static_cast<double>(packed.step);  // as B of moveTriangles()
  double offset = 0;
  for (int k = 0; k < 3; ++k) {
    motion_.offset[k] = static_cast<float>(origin[k] - kMiddle);
    offset = std::max(offset, std::abs(origin[k] - kMiddle));
  }
  size += offset;
  unpackTriangles(packed, motion_, pack_);
  error_ = other_in_side.scale * static_cast<double>(packingError(packed)) + 1.7321 * 6 * 0x1p-24 * size;
}

std::uint32_t LargeTriangles::near(const Sphere& ball, double tolerance, const TreeSide& other, tree::NodeRef leaf,
                                   const SimilarityTransform& other_in_side) {
  if (count_ == 0 || !(leaf_ == leaf)) start(other, leaf, other_in_side);
  if (!inRange(pack_)) return all();
  const Eigen::Vector3d center = ball.center.array() - kMiddle;
  const double extent = std::max(static_cast<double>(pack_.size), center.cwiseAbs().maxCoeff() + ball.radius);
  const double reach = ball.radius + regionMargin(other_in_side, tolerance, extent, error_);
  PackRegion region{};
  for (int k = 0; k < 3; ++k) {
    region.low[k] = static_cast<float>(center[k] - reach);
    region.high[k] = static_cast<float>(center[k] + reach);
  }
  return trianglesWithin(pack_, region) & all();
}

std::uint32_t LargeTriangles::meeting(const TreeSide& side, tree::NodeRef node, const TreeSide& other,
                                      tree::NodeRef leaf, std::uint32_t which, const SimilarityTransform& other_in_side,
                                      double unit) {
  if (count_ == 0 || !(leaf_ == leaf)) start(other, leaf, other_in_side);
  std::uint32_t met = which & all();
  if (inRange(pack_)) {
    const auto size = static_cast<double>(pack_.size);
    met &= trianglesWithin(pack_, regionOf(side.volume(node), other_in_side, size, error_));
  }
  const std::uint32_t wanted = met & ~known_;
  if (wanted == 0) return met;
  readCorners(other, ids_, wanted & ~read_, raw_);
  read_ |= wanted;
  boundTriangles(raw_, wanted, place_, unit, 2 * kMiddle * unit, placed_, bounds_);
  known_ |= wanted;
  return met;
}

}  // namespace bocst::query
