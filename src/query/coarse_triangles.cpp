// SPDX-License-Identifier: BSD-3-Clause
#include "query/coarse_triangles.h"

#include <algorithm>
#include <cmath>

namespace bocst::query {
namespace {

// An axis as floats, and how far the corners reach along it.
struct Axis {
  float axis[3];
  double low, high;

  Axis(const Eigen::Vector3d& along, const Corners& corners, double far) : axis{0, 0, 0}, low(-far), high(far) {
    const double size = std::abs(along[0]) + std::abs(along[1]) + std::abs(along[2]);
    if (!(size > 1e-100 && size < 1e100)) return;
    const double scale = 1 / size;
    Eigen::Vector3d n;
    for (int k = 0; k < 3; ++k) {
      axis[k] = static_cast<float>(along[k] * scale);
      n[k] = axis[k];
    }
    const double a = n.dot(corners[0]), b = n.dot(corners[1]), c = n.dot(corners[2]);
    low = std::min({a, b, c});
    high = std::max({a, b, c});
  }
};

float within(double x, double far) { return static_cast<float>(std::min(std::max(x, -far), far)); }

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

TriangleBounds::TriangleBounds(const Corners& corners, double far) {
  far *= 2;
  for (int k = 0; k < 3; ++k) {
    low[k] = within(std::min({corners[0][k], corners[1][k], corners[2][k]}), far);
    high[k] = within(std::max({corners[0][k], corners[1][k], corners[2][k]}), far);
  }
  const Eigen::Vector3d edges[3] = {corners[1] - corners[0], corners[2] - corners[1], corners[0] - corners[2]};
  const Eigen::Vector3d n = edges[0].cross(edges[1]);
  const Axis plane(n, corners, far);
  std::copy_n(plane.axis, 3, normal);
  normal_low = within(plane.low, far);
  normal_high = within(plane.high, far);
  for (int e = 0; e < 3; ++e) {
    const Axis out(edges[e].cross(n), corners, far);
    std::copy_n(out.axis, 3, edge[e]);
    edge_high[e] = within(out.high, far);
  }
}

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
  for (std::uint32_t left = met & ~known_; left != 0; left &= left - 1) {
    const auto i = static_cast<std::size_t>(__builtin_ctz(left));
    Corners scaled;
    for (std::size_t k = 0; k < 3; ++k) {
      const Eigen::Vector3d v = raw_.corner(i, k);
      for (int r = 0; r < 3; ++r) {
        const double(&l)[3] = place_.linear[r];
        corners_[i][k][r] = l[0] * v[0] + l[1] * v[1] + l[2] * v[2] + place_.offset[r];
      }
      scaled[k] = corners_[i][k] * unit;
    }
    bounds_[i] = TriangleBounds(scaled, kMiddle * unit);
  }
  known_ |= met;
  return met;
}

}  // namespace bocst::query
