// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "query/distance/distance_kernels.h"
#include "query/leaf/leaf_corners.h"
#include "query/sides/side.h"

namespace bocst::query {

/// Finds the pairs of triangles of two leaves that may be near each other, eight at a time in float. Kept by a thread.
template <typename A, typename B>
class NearTriangles {
 public:
  /// A triangle of each leaf, and a lower bound of their distance in the unit of side A.
  struct Candidate {
    double at_least;
    std::uint32_t a, b;
  };

  /// To be called before the first use in a walk.
  void clear() {
    for (LeafCorners<A>& leaf : corners_a_) leaf.clear();
    for (LeafCorners<B>& leaf : corners_b_) leaf.clear();
  }

  /// The pairs that may be nearer than `cutoff`, that with the least bound first; unless `all` are wanted, only those
  /// that may be the nearest. `direction`: from side A to side B in the frame of A, see nearPairs(). Valid until the
  /// next call.
  const std::vector<Candidate>& find(const A& a, typename A::Node leaf_a, const B& b, typename B::Node leaf_b,
                                     const SimilarityTransform& b_in_a, const float (&direction)[3], double cutoff,
                                     bool all) {
    candidates_.clear();
    const Eigen::Vector3d center = centerOf(a, leaf_a);
    const PackTransform to_a = packTransform(a, SimilarityTransform(), center, 1),
                        to_b = packTransform(b, b_in_a, center, 1);
    const std::size_t count_a = a.triangleCount(leaf_a), count_b = b.triangleCount(leaf_b);
    LeafCorners<A>& corners_a = corners_a_[numberOf(leaf_a) % kLeaves];
    LeafCorners<B>& corners_b = corners_b_[numberOf(leaf_b) % kLeaves];
    const auto limit = static_cast<float>(cutoff * (1 + 0x1p-22));
    for (std::size_t i = 0; i < count_a; i += TrianglePack::kCapacity) {
      corners_a.take(a, leaf_a, i);
      corners_a.place(to_a, packs_[0]);
      for (std::size_t j = 0; j < count_b; j += TrianglePack::kCapacity) {
        corners_b.take(b, leaf_b, j);
        corners_b.place(to_b, packs_[1]);
        const std::size_t found = nearPairs(packs_[0], packs_[1], direction, limit, all, found_);
        for (std::size_t k = 0; k < found; ++k) {
          const NearPair& p = found_[k];
          candidates_.push_back({p.at_least, corners_a.id(p.row), corners_b.id(p.lane)});
        }
      }
    }
    std::sort(candidates_.begin(), candidates_.end(),
              [](const Candidate& x, const Candidate& y) { return x.at_least < y.at_least; });
    return candidates_;
  }

 private:
  static constexpr std::size_t kLeaves = 16;

  template <typename Side>
  static Eigen::Vector3d centerOf(const Side& side, typename Side::Node leaf) {
    if constexpr (std::is_same<Side, TreeSide>::value) {
      return side.roughSphere(leaf).center;
    } else {
      return side.sphere(leaf).center;
    }
  }

  LeafCorners<A> corners_a_[kLeaves];
  LeafCorners<B> corners_b_[kLeaves];
  TrianglePack packs_[2];
  NearPair found_[TrianglePack::kCapacity * TrianglePack::kCapacity];
  std::vector<Candidate> candidates_;
};

}  // namespace bocst::query
