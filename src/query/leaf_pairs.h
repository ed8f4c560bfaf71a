// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "oracle/cpu/kernels.h"
#include "query/side.h"

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
    count_ = std::min(side.triangleCount(leaf) - begin, TrianglePack::kCapacity);
    for (std::size_t i = 0; i < count_; ++i) {
      const std::uint32_t t = ids_[i] = side.triangle(leaf, begin + i);
      for (int k = 0; k < 3; ++k) {
        const auto& v = side.vertex(t, k);
        for (int c = 0; c < 3; ++c) raw_.xyz[3 * k + c][i] = v[c];
      }
    }
    return true;
  }

  std::size_t count() const { return count_; }
  std::uint32_t id(std::size_t i) const { return ids_[i]; }
  void place(const PackPlacement& to, TrianglePack& pack) { placeTriangles(raw_, count_, to, pack); }

 private:
  RawTriangles raw_;
  std::uint32_t ids_[TrianglePack::kCapacity];
  std::size_t count_ = 0, begin_ = 0;  // nothing is held when the count is 0
  typename Side::Node leaf_{};
};

/// Corners straight from the vertices into the frame that `place` leads to, about `center` there and `scale` times as
/// large. Vertices of a side lie at (v - origin) * inverse_unit in its frame.
template <typename Side>
PackPlacement packPlacement(const Side& side, const Placement& place, const Eigen::Vector3d& center, double scale) {
  const Eigen::Matrix3d linear = place.rotation * (place.scale * side.inverseUnit());
  const Eigen::Vector3d offset = place.translation - linear * side.origin() - center;
  PackPlacement t;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) t.linear[r][c] = linear(r, c) * scale;
    t.offset[r] = offset[r] * scale;
  }
  return t;
}

/// The triangles of a leaf against the octants of smaller nodes of the other side: with large triangles the leaf's
/// volume says little.
template <typename Other>
class CoarseLeaf {
 public:
  /// To be called before the first use in a walk.
  void clear() { leaf_.clear(); }

  /// The octants in `mask` of an inner node that a triangle of `leaf` meets.
  unsigned octantsMeeting(const TreeSide& side, tree::NodeRef node, unsigned mask, const Other& other,
                          typename Other::Node leaf, const Placement& other_in_side) {
    Eigen::Vector3d center;
    const double half = side.octantsOf(node, center), scale = 1 / half;
    const PackPlacement place = packPlacement(other, other_in_side, center, scale);
    const auto slack = static_cast<float>(other_in_side.slack * scale * 1.001);
    const std::size_t count = other.triangleCount(leaf);
    unsigned met = 0;
    for (std::size_t begin = 0; begin < count && (mask & ~met) != 0; begin += TrianglePack::kCapacity) {
      leaf_.take(other, leaf, begin);
      leaf_.place(place, pack_);
      std::uint8_t masks[TrianglePack::kCapacity];
      oracle::octantMasks(pack_.xyz[0], TrianglePack::kCapacity, leaf_.count(), slack, masks);
      for (std::size_t i = 0; i < leaf_.count(); ++i) met |= masks[i];
    }
    return mask & met;
  }

 private:
  LeafCorners<Other> leaf_;
  TrianglePack pack_;
};

/// Leaves against leaves, triangle by triangle.
template <typename A, typename B>
class LeafPairs {
 public:
  /// To be called before the first test of a walk.
  void clear() {
    corners_a_.clear();
    corners_b_.clear();
  }

  /// Calls f(triangle of a, triangle of b) for the pairs that are not surely apart, until it returns true.
  template <typename F>
  bool test(const A& a, typename A::Node node_a, const B& b, typename B::Node node_b, const Placement& b_in_a, F&& f) {
    const Eigen::Vector3d center = a.cellSphere(node_a).center;
    const PackPlacement to_b = packPlacement(b, b_in_a, center, 1);
    const std::size_t count_a = a.triangleCount(node_a), count_b = b.triangleCount(node_b);
    for (std::size_t i = 0; i < count_a; i += TrianglePack::kCapacity) {
      if (corners_a_.take(a, node_a, i)) corners_a_.place(packPlacement(a, Placement(), center, 1), a_);
      for (std::size_t j = 0; j < count_b; j += TrianglePack::kCapacity) {
        corners_b_.take(b, node_b, j);
        corners_b_.place(to_b, b_);
        const std::size_t found = touchingPairs(a_, b_, static_cast<float>(b_in_a.slack * 1.001), found_);
        for (std::size_t k = 0; k < found; ++k) {
          if (f(corners_a_.id(found_[k].row), corners_b_.id(found_[k].lane))) return true;
        }
      }
    }
    return false;
  }

 private:
  LeafCorners<A> corners_a_;
  LeafCorners<B> corners_b_;
  TrianglePack a_, b_;
  PackPair found_[TrianglePack::kCapacity * TrianglePack::kCapacity];
};

}  // namespace bocst::query
