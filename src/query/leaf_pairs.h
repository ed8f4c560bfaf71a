// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "query/side.h"

namespace bocst::query {

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
    const PackPlacement to_a = toPack(a, Placement(), center), to_b = toPack(b, b_in_a, center);
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

  // Corners straight from the vertices into the frame of A, about the leaf of A. Vertices of a side lie at (v - origin)
  // * inverse_unit in its frame, which `place` puts into that of A.
  template <typename Side>
  static PackPlacement toPack(const Side& side, const Placement& place, const Eigen::Vector3d& center) {
    const Eigen::Matrix3d linear = place.rotation * (place.scale * side.inverseUnit());
    const Eigen::Vector3d offset = place.translation - linear * side.origin() - center;
    PackPlacement t;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) t.linear[r][c] = linear(r, c);
      t.offset[r] = offset[r];
    }
    return t;
  }

  template <typename Side, typename Node>
  void fill(const Side& side, Node node, std::size_t begin, const PackPlacement& place, TrianglePack& pack) {
    const std::size_t count = std::min(side.triangleCount(node) - begin, TrianglePack::kCapacity);
    for (std::size_t i = 0; i < count; ++i) {
      const std::uint32_t t = side.triangle(node, begin + i);
      pack.ids[i] = t;
      for (int k = 0; k < 3; ++k) {
        const auto& v = side.vertex(t, k);
        for (int c = 0; c < 3; ++c) raw_.xyz[3 * k + c][i] = v[c];
      }
    }
    placeTriangles(raw_, count, place, pack);
  }

  RawTriangles raw_;
  TrianglePack a_, b_;
  std::uint64_t pack_of_a_ = kNoPack;  // which node and part of its list pack a_ holds
  PackPair found_[TrianglePack::kCapacity * TrianglePack::kCapacity];
};

}  // namespace bocst::query
