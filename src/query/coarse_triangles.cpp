// SPDX-License-Identifier: BSD-3-Clause
#include "query/coarse_triangles.h"

#include <algorithm>
#include <cmath>

namespace bocst::query {
namespace {

// Where a pack about the middle of the root can meet a node's volume. With M = `reach`, what is computed here and by
// trianglesWithin() is off by 15 u M, as for LeafPairs.
PackRegion regionOf(const Volume& v, const Placement& other_in_side, double size) {
  PackRegion region;
  double way[3], reach = size, offset = v.slab_offset;
  for (int k = 0; k < 3; ++k) {
    way[k] = v.center[k] - CoarseTriangles::kMiddle;
    reach = std::max(reach, std::abs(way[k]) + v.half[k]);
    offset += v.normal[k] * way[k];
    region.normal[k] = v.normal[k];
  }
  const double pad = (32 * 0x1p-24 + 4 * other_in_side.defect) * reach + 1.02 * other_in_side.slack;
  for (int k = 0; k < 3; ++k) {
    region.low[k] = static_cast<float>(way[k] - v.half[k] - pad);
    region.high[k] = static_cast<float>(way[k] + v.half[k] + pad);
  }
  region.slab_low = static_cast<float>(offset - v.slab_half - pad);
  region.slab_high = static_cast<float>(offset + v.slab_half + pad);
  return region;
}

}  // namespace

std::uint32_t CoarseTriangles::meeting(const TreeSide& side, tree::NodeRef node, const TreeSide& other,
                                       tree::NodeRef leaf, std::uint32_t which, const Placement& other_in_side,
                                       double unit) {
  if (count_ == 0 || !(leaf_ == leaf)) {
    leaf_ = leaf;
    known_ = 0;
    raw_.take(other, leaf, 0);
    count_ = raw_.count();
    place_ = packPlacement(other, other_in_side, Eigen::Vector3d::Constant(kMiddle), 1);
    raw_.place(place_, pack_);
  }
  std::uint32_t met = which & (count_ < 32 ? (1u << count_) - 1 : ~0u);
  if (inRange(pack_)) {
    met &= trianglesWithin(pack_, regionOf(side.volume(node), other_in_side, static_cast<double>(pack_.size)));
  }
  const std::uint32_t wanted = met & ~known_;
  if (wanted != 0) known_ |= boundTriangles(raw_.raw(), wanted, place_, unit, 2 * kMiddle * unit, placed_, bounds_);
  return met;
}

}  // namespace bocst::query
