// SPDX-License-Identifier: BSD-3-Clause
#include "query/packed_leaves.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/packed_leaves.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>

#include "query/octants-inl.h"

HWY_BEFORE_NAMESPACE();
namespace bocst::query::HWY_NAMESPACE {

void UnpackTriangles(const tree::PackedTriangles& packed, const StepPlacement& place, TrianglePack& pack) {
  const D d;
  const hn::Rebind<std::uint16_t, D> dh;
  const hn::RebindToSigned<D> di;
  for (std::size_t i = 0; i < packed.count; i += hn::Lanes(d)) {
    const std::uint16_t* const group = packed.steps +
                                       i / tree::PackedTriangles::kGroup * tree::PackedTriangles::kGroupSteps +
                                       i % tree::PackedTriangles::kGroup;
    BOCST_UNROLL
    for (std::size_t k = 0; k < 3; ++k) {
      V q[3];
      BOCST_UNROLL
      for (std::size_t c = 0; c < 3; ++c) {
        const auto steps = hn::LoadU(dh, group + tree::PackedTriangles::kGroup * (3 * k + c));
        q[c] = hn::ConvertTo(d, hn::PromoteTo(di, steps));
      }
      BOCST_UNROLL
      for (std::size_t c = 0; c < 3; ++c) {
        V x = hn::MulAdd(hn::Set(d, place.linear[c][0]), q[0], hn::Set(d, place.offset[c]));
        x = hn::MulAdd(hn::Set(d, place.linear[c][1]), q[1], x);
        x = hn::MulAdd(hn::Set(d, place.linear[c][2]), q[2], x);
        hn::Store(x, d, pack.xyz[3 * k + c] + i);
      }
    }
  }
}

}  // namespace bocst::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bocst::query {

HWY_EXPORT(UnpackTriangles);

float StepPlacement::size() const {
  float size = 0;
  for (int r = 0; r < 3; ++r) {
    const float row = std::abs(linear[r][0]) + std::abs(linear[r][1]) + std::abs(linear[r][2]);
    size = std::max(size, std::abs(offset[r]) + 65535.0f * row);
  }
  return size * 1.0001f;
}

void unpackTriangles(const tree::PackedTriangles& packed, const StepPlacement& place, TrianglePack& pack) {
  HWY_DYNAMIC_DISPATCH(UnpackTriangles)(packed, place, pack);
  pack.count = packed.count;
  pack.size = place.size();
}

namespace {

// How far off a corner is at most, as a distance: half a step along each axis, and the rounding.
float errorOf(const tree::PackedTriangles& packed, double scale, const TrianglePack& pack) {
  return 1.7321f * (0.5f * packed.step * static_cast<float>(scale) * 1.0001f + 4 * 0x1p-24f * pack.size);
}

}  // namespace

std::size_t PackedLeaves::test(tree::NodeRef leaf_a, const tree::PackedTriangles& a, const Eigen::Vector3d& center,
                               const tree::PackedTriangles& b, const Placement& b_in_a, PackPair* found) {
  if (a_.count == 0 || !(leaf_ == leaf_a)) {
    leaf_ = leaf_a;
    StepPlacement place{};
    for (int k = 0; k < 3; ++k) {
      place.linear[k][k] = a.step;
      place.offset[k] = static_cast<float>(static_cast<double>(a.origin[k]) - center[k]);
    }
    unpackTriangles(a, place, a_);
    error_a_ = errorOf(a, 1, a_);
  }
  StepPlacement place;
  const double* r = b_in_a.rotation.data();  // column by column
  const double step = b_in_a.scale * static_cast<double>(b.step);
  for (int k = 0; k < 3; ++k) {
    double at = 0;
    for (int c = 0; c < 3; ++c) {
      place.linear[k][c] = static_cast<float>(r[3 * c + k] * step);
      at += r[3 * c + k] * static_cast<double>(b.origin[c]);
    }
    place.offset[k] = static_cast<float>(at * b_in_a.scale + (b_in_a.translation[k] - center[k]));
  }
  unpackTriangles(b, place, b_);
  const float error = error_a_ + errorOf(b, b_in_a.scale, b_);
  return touchingPairs(a_, b_, (static_cast<float>(b_in_a.slack) + error) * 1.001f, found);
}

}  // namespace bocst::query
#endif
