// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "oracle/cpu/kernels.h"
#include "query/side.h"

namespace bocst::query {

/// Gathers the corners of at most a pack of a leaf's triangles, from the one at `begin`; returns how many.
template <typename Side, typename Node>
std::size_t gatherCorners(const Side& side, Node leaf, std::size_t begin, RawTriangles& raw) {
  const std::size_t count = std::min(side.triangleCount(leaf) - begin, TrianglePack::kCapacity);
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t t = side.triangle(leaf, begin + i);
    for (int k = 0; k < 3; ++k) {
      const auto& v = side.vertex(t, k);
      for (int c = 0; c < 3; ++c) raw.xyz[3 * k + c][i] = v[c];
    }
  }
  return count;
}

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
/// volume says little. Keeps the leaf's corners: depth first, most nodes meet the same leaf as the one before.
template <typename Other>
class CoarseLeaf {
 public:
  /// To be called before the first use in a walk.
  void clear() { count_ = 0; }

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
      if (count_ == 0 || !(leaf_ == leaf) || begin_ != begin) {
        count_ = gatherCorners(other, leaf, begin, raw_);
        leaf_ = leaf;
        begin_ = begin;
      }
      placeTriangles(raw_, count_, place, pack_);
      std::uint8_t masks[TrianglePack::kCapacity];
      oracle::octantMasks(pack_.xyz[0], TrianglePack::kCapacity, count_, slack, masks);
      for (std::size_t i = 0; i < count_; ++i) met |= masks[i];
    }
    return mask & met;
  }

 private:
  RawTriangles raw_;
  TrianglePack pack_;
  // What raw_ holds; nothing when the count is 0.
  std::size_t count_ = 0, begin_ = 0;
  typename Other::Node leaf_{};
};

/// Leaves against leaves, triangle by triangle. Keeps the pack of the last leaf of side A: depth first, most pairs
/// share it with the one before.
template <typename A, typename B>
class LeafPairs {
 public:
  /// To be called before the first test of a walk.
  void clear() { pack_of_a_ = kNoPack; }

  /// Calls f(triangle of a, triangle of b) for the pairs that are not surely apart, until it returns true.
  template <typename F>
  bool test(const A& a, typename A::Node node_a, const B& b, typename B::Node node_b, const Placement& b_in_a, F&& f) {
    const Eigen::Vector3d center = a.cellSphere(node_a).center;
    const PackPlacement to_a = packPlacement(a, Placement(), center, 1), to_b = packPlacement(b, b_in_a, center, 1);
    const std::size_t count_a = a.triangleCount(node_a), count_b = b.triangleCount(node_b);
    for (std::size_t i = 0; i < count_a; i += TrianglePack::kCapacity) {
      const std::uint64_t key = std::uint64_t{node_a.bits} << 32 | i;
      if (key != pack_of_a_) fill(a, node_a, i, to_a, a_);
      pack_of_a_ = key;
      for (std::size_t j = 0; j < count_b; j += TrianglePack::kCapacity) {
        fill(b, node_b, j, to_b, b_);
        const std::size_t found = touchingPairs(a_, b_, static_cast<float>(b_in_a.slack * 1.001), found_);
        for (std::size_t k = 0; k < found; ++k) {
          if (f(a_.ids[found_[k].row], b_.ids[found_[k].lane])) return true;
        }
      }
    }
    return false;
  }

 private:
  static constexpr std::uint64_t kNoPack = ~std::uint64_t{0};

  template <typename Side, typename Node>
  void fill(const Side& side, Node node, std::size_t begin, const PackPlacement& place, TrianglePack& pack) {
    const std::size_t count = gatherCorners(side, node, begin, raw_);
    for (std::size_t i = 0; i < count; ++i) pack.ids[i] = side.triangle(node, begin + i);
    placeTriangles(raw_, count, place, pack);
  }

  RawTriangles raw_;
  TrianglePack a_, b_;
  std::uint64_t pack_of_a_ = kNoPack;  // which node and part of its list pack a_ holds
  PackPair found_[TrianglePack::kCapacity * TrianglePack::kCapacity];
};

}  // namespace bocst::query
