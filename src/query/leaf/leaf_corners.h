// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "geometry/overlap_kernels.h"
#include "geometry/volume.h"
#include "log/assert.h"

namespace bocst::query {

/// The corners of a leaf as its mesh gives them, kept until another leaf is asked for: depth first, most pairs of
/// leaves share one with the pair before.
template <typename Side>
class LeafCorners {
 public:
  /// To be called before the first use in a walk.
  void clear() { count_ = 0; }

  /// Takes at most a pack of the leaf's triangles, from the one at `begin`. False when it has them already.
  bool take(const Side& side, typename Side::Node leaf, std::size_t begin) {
    if (count_ != 0 && leaf_ == leaf && begin_ == begin) return false;
    leaf_ = leaf;
    begin_ = begin;
    BOCST_ASSERT(begin < side.triangleCount(leaf));
    count_ = std::min(side.triangleCount(leaf) - begin, TrianglePack::kCapacity);
    // Triangles and vertices lie anywhere in memory: ask for all of them before any is waited for.
    for (std::size_t i = 0; i < count_; ++i) {
      ids_[i] = side.triangle(leaf, begin + i);
      side.prefetch(ids_[i]);
    }
    for (std::size_t i = 0; i < count_; ++i) side.prefetchCorners(ids_[i]);
    for (std::size_t i = 0; i < count_; ++i) {
      for (int k = 0; k < 3; ++k) {
        const auto& v = side.vertex(ids_[i], k);
        for (int c = 0; c < 3; ++c) raw_.xyz[3 * k + c][i] = v[c];
      }
    }
    return true;
  }

  std::size_t count() const { return count_; }
  std::uint32_t id(std::size_t i) const { return ids_[i]; }
  const RawTriangles& raw() const { return raw_; }
  void place(const PackTransform& to, TrianglePack& pack) { placeTriangles(raw_, count_, to, pack); }

 private:
  RawTriangles raw_;
  std::uint32_t ids_[TrianglePack::kCapacity];
  std::size_t count_ = 0, begin_ = 0;  // nothing is held when the count is 0
  typename Side::Node leaf_{};
};

/// Can the float tests compute with these corners? Determinants of three lengths must neither overflow nor vanish; NaN
/// is out of range, too.
inline bool inRange(const TrianglePack& pack) { return pack.size > 1e-9f && pack.size < 1e9f; }

/// And with this tolerance? A margin in the frame of a mesh without extent is beyond all floats.
inline bool inRange(double tolerance) { return tolerance < 1e9; }

/// Corners straight from the vertices into the frame that `place` leads to, about `center` there and `scale` times as
/// large. Vertices of a side lie at (v - origin) * inverse_unit in its frame.
template <typename Side>
PackTransform packTransform(const Side& side, const SimilarityTransform& place, const Eigen::Vector3d& center,
                            double scale) {
  const Eigen::Matrix3d linear = place.rotation * (place.scale * side.inverseUnit());
  const Eigen::Vector3d offset = place.translation - linear * side.origin() - center;
  PackTransform t;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) t.linear[r][c] = linear(r, c) * scale;
    t.offset[r] = offset[r] * scale;
  }
  return t;
}

}  // namespace bocst::query
