// SPDX-License-Identifier: BSD-3-Clause
#include "tree/bulk_kernels.h"

#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tree/bulk_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace bocst::tree::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using D = hn::CappedTag<float, 16>;
using V = hn::Vec<D>;

// Twice the area of triangles i, i + 1, ... along their normals.
HWY_INLINE void normalsAt(const CornerRows& c, std::size_t i, V (&normal)[3]) {
  const D d;
  V e[3], f[3];
  for (std::size_t k = 0; k < 3; ++k) {
    const V p = hn::LoadU(d, c.row[k] + i);
    e[k] = hn::Sub(hn::LoadU(d, c.row[3 + k] + i), p);
    f[k] = hn::Sub(hn::LoadU(d, c.row[6 + k] + i), p);
  }
  for (std::size_t k = 0; k < 3; ++k) {
    const std::size_t a = (k + 1) % 3, b = (k + 2) % 3;
    normal[k] = hn::NegMulAdd(e[b], f[a], hn::Mul(e[a], f[b]));
  }
}

void SumNormals(const CornerRows& c, std::size_t begin, std::size_t count, float (&sum)[3]) {
  const D d;
  V total[3] = {hn::Zero(d), hn::Zero(d), hn::Zero(d)}, first[3] = {hn::Zero(d), hn::Zero(d), hn::Zero(d)};
  bool found = false;
  for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
    V n[3];
    normalsAt(c, begin + i, n);
    const auto in = hn::FirstN(d, count - i);
    for (V& x : n) x = hn::IfThenElseZero(in, x);
    if (!found) {
      const auto some = hn::Gt(hn::MulAdd(n[0], n[0], hn::MulAdd(n[1], n[1], hn::Mul(n[2], n[2]))), hn::Zero(d));
      const auto at = hn::FindFirstTrue(d, some);
      found = at >= 0;
      if (found) {
        HWY_ALIGN float lanes[HWY_MAX_BYTES / sizeof(float)];
        for (std::size_t k = 0; k < 3; ++k) {
          hn::Store(n[k], d, lanes);
          first[k] = hn::Set(d, lanes[at]);
        }
      }
    }
    const V along = hn::MulAdd(n[0], first[0], hn::MulAdd(n[1], first[1], hn::Mul(n[2], first[2])));
    const auto turned = hn::Lt(along, hn::Zero(d));
    for (std::size_t k = 0; k < 3; ++k) total[k] = hn::Add(total[k], hn::IfThenElse(turned, hn::Neg(n[k]), n[k]));
  }
  for (std::size_t k = 0; k < 3; ++k) sum[k] = hn::GetLane(hn::SumOfLanes(d, total[k]));
}

void ExtremesAlong(const CornerRows& c, std::size_t begin, std::size_t count, const float (&n)[3], float& least,
                   float& most) {
  const D d;
  const V n0 = hn::Set(d, n[0]), n1 = hn::Set(d, n[1]), n2 = hn::Set(d, n[2]);
  V lo = hn::Set(d, std::numeric_limits<float>::infinity()), hi = hn::Neg(lo);
  for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
    const auto in = hn::FirstN(d, count - i);
    for (std::size_t k = 0; k < 9; k += 3) {
      const std::size_t at = begin + i;
      const V along =
          hn::MulAdd(n0, hn::LoadU(d, c.row[k] + at),
                     hn::MulAdd(n1, hn::LoadU(d, c.row[k + 1] + at), hn::Mul(n2, hn::LoadU(d, c.row[k + 2] + at))));
      lo = hn::IfThenElse(in, hn::Min(lo, along), lo);
      hi = hn::IfThenElse(in, hn::Max(hi, along), hi);
    }
  }
  least = hn::GetLane(hn::MinOfLanes(d, lo));
  most = hn::GetLane(hn::MaxOfLanes(d, hi));
}

}  // namespace bocst::tree::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bocst::tree {

HWY_EXPORT(SumNormals);
HWY_EXPORT(ExtremesAlong);

void sumNormals(const CornerRows& corners, std::size_t begin, std::size_t count, float (&sum)[3]) {
  HWY_DYNAMIC_DISPATCH(SumNormals)(corners, begin, count, sum);
}

void extremesAlong(const CornerRows& corners, std::size_t begin, std::size_t count, const float (&n)[3], float& least,
                   float& most) {
  HWY_DYNAMIC_DISPATCH(ExtremesAlong)(corners, begin, count, n, least, most);
}

}  // namespace bocst::tree
#endif
