// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

#include "query/kernels.h"
#include "query/side.h"
#include "tree/packed_triangles.h"

namespace bocst::query {

/// Where packed triangles go: x' = linear * q + offset for a corner of q steps, in float.
struct StepPlacement {
  float linear[3][3];
  float offset[3];

  /// No coordinate gets larger than this, nor does any part of it.
  float size() const;
};

/// Fills the pack, 1 to kCapacity triangles. Corners are off by at most 4 u size() a coordinate, u = 2^-24, beside half
/// a step: entries and offset are rounded, and three sums.
void unpackTriangles(const tree::PackedTriangles& packed, const StepPlacement& place, TrianglePack& pack);

/// Leaves of two trees against each other, triangle by triangle, where the trees keep their corners packed.
class PackedLeaves {
 public:
  /// To be called before the first test of a walk.
  void clear() { a_.count = 0; }

  /// The pairs that are not surely apart, as positions in the lists of the leaves; `found` has room for all.
  /// `center` is that of A's leaf.
  std::size_t test(tree::NodeRef leaf_a, const tree::PackedTriangles& a, const Eigen::Vector3d& center,
                   const tree::PackedTriangles& b, const Placement& b_in_a, PackPair* found);

 private:
  tree::NodeRef leaf_;  // whose triangles are in a_, if any are
  float error_a_ = 0;
  TrianglePack a_, b_;
};

}  // namespace bocst::query
