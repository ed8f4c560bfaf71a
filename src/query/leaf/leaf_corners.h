// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "geometry/overlap_kernels.h"
#include "geometry/volume.h"
#include "log/assert.h"
#include "tree/block.h"

namespace bocst::query {

/// A number of a node for places in tables of nodes.
inline std::size_t numberOf(tree::NodeRef node) { return node.bits; }
inline std::size_t numberOf(int node) { return static_cast<std::size_t>(node); }

/// Reads the corners of those triangles of `ids` that `which` has bits of, as the mesh gives them. Triangles and
/// vertices lie anywhere in memory: all are asked for before any is waited for.
template <typename Side, typename Ids>
void readCorners(const Side& side, const Ids& ids, std::uint32_t which, RawTriangles& raw) {
  const auto next = [](std::uint32_t left) { return static_cast<std::size_t>(__builtin_ctz(left)); };
  for (std::uint32_t left = which; left != 0; left &= left - 1) side.prefetch(ids[next(left)]);
  for (std::uint32_t left = which; left != 0; left &= left - 1) side.prefetchCorners(ids[next(left)]);
  for (std::uint32_t left = which; left != 0; left &= left - 1) {
    const std::size_t i = next(left);
    const std::uint32_t id = ids[i];
    for (int k = 0; k < 3; ++k) {
      const auto& v = side.vertex(id, k);
      for (int c = 0; c < 3; ++c) raw.xyz[3 * k + c][i] = v[c];
    }
  }
}

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
    const auto triangles = side.triangles(leaf);
    BOCST_ASSERT(begin < triangles.count);
    count_ = std::min(triangles.count - begin, TrianglePack::kCapacity);
    for (std::size_t i = 0; i < count_; ++i) ids_[i] = triangles.ids[begin + i];
    readCorners(side, ids_, ~0u >> (TrianglePack::kCapacity - count_), raw_);
    return true;
  }

  std::size_t count() const { return count_; }
  std::uint32_t id(std::size_t i) const { return ids_[i]; }
  void place(const PackTransform& to, TrianglePack& pack) { placeTriangles(raw_, count_, to, pack); }

 private:
  RawTriangles raw_;
  std::uint32_t ids_[TrianglePack::kCapacity];
  std::size_t count_ = 0, begin_ = 0;  // nothing is held when the count is 0
  typename Side::Node leaf_{};
};

/// True if the float tests can compute with these corners. Determinants of three lengths must neither overflow nor
/// vanish; NaN is out of range, too.
inline bool inRange(const TrianglePack& pack) { return pack.size > 1e-9f && pack.size < 1e9f; }

/// True if they can with this tolerance. A margin in the frame of a mesh without extent is beyond all floats.
inline bool inRange(double tolerance) { return tolerance < 1e9; }

/// Scale and rotation of `to` for corners in float; the offset is 0.
inline PackMotion turnOf(const SimilarityTransform& to) {
  PackMotion motion{};
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) motion.linear[r][c] = static_cast<float>(to.scale * to.rotation(r, c));
  }
  return motion;
}

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
