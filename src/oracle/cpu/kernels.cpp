// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/cpu/kernels.h"

#include "simd/unroll.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "oracle/cpu/kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace bocst::oracle::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using D = hn::CappedTag<float, 8>;  // lists are short: wider vectors lose more to padding than they gain
using V = hn::Vec<D>;
using M = hn::Mask<D>;

// Edge e = b - a against the axis e x k: only the coordinates p = k + 1 and q = k + 2 matter.
HWY_INLINE void edgeAxis(D d, V ep, V eq, V ap, V aq, V bp, V bq, V half, int p, int q, M (&alive)[8]) {
  const V fa = hn::Sub(hn::Mul(ep, aq), hn::Mul(eq, ap));
  const V fb = hn::Sub(hn::Mul(ep, bq), hn::Mul(eq, bp));
  const V lo = hn::Min(fa, fb), hi = hn::Max(fa, fb);
  const V r = hn::Mul(half, hn::Add(hn::Abs(ep), hn::Abs(eq)));
  const V lo_r = hn::Sub(lo, r), hi_r = hn::Add(hi, r);
  const V h = hn::Set(d, 0.5f);
  const V hp = hn::Mul(h, ep), hq = hn::Mul(h, eq);
  BOCST_UNROLL
  for (int sp = 0; sp < 2; ++sp) {
    BOCST_UNROLL
    for (int sq = 0; sq < 2; ++sq) {
      // The octant's centre has coordinates +-1/2.
      const V a = sq ? hp : hn::Neg(hp);
      const V c = sp ? hn::Sub(a, hq) : hn::Add(a, hq);
      const M meets = hn::And(hn::Le(lo_r, c), hn::Ge(hi_r, c));
      BOCST_UNROLL
      for (int o = 0; o < 8; ++o) {
        if ((o >> p & 1) == sp && (o >> q & 1) == sq) alive[o] = hn::And(alive[o], meets);
      }
    }
  }
}

// The octants that the triangle's box meets. v[corner][axis], the cell is [-1, 1]^3.
HWY_INLINE void boxAxes(const V (&v)[3][3], V rounding_margin, M (&alive)[8]) {
  const D d;
  const V outer = hn::Add(hn::Set(d, 1.0f), rounding_margin);
  const V low_outer = hn::Neg(outer), low_margin = hn::Neg(rounding_margin);
  M side[3][2];  // the halves of the cell along an axis
  BOCST_UNROLL
  for (int c = 0; c < 3; ++c) {
    const V lo = hn::Min(hn::Min(v[0][c], v[1][c]), v[2][c]);
    const V hi = hn::Max(hn::Max(v[0][c], v[1][c]), v[2][c]);
    side[c][0] = hn::And(hn::Le(lo, rounding_margin), hn::Ge(hi, low_outer));
    side[c][1] = hn::And(hn::Ge(hi, low_margin), hn::Le(lo, outer));
  }
  BOCST_UNROLL
  for (int o = 0; o < 8; ++o) {
    alive[o] = hn::And(hn::And(side[0][o & 1], side[1][o >> 1 & 1]), side[2][o >> 2 & 1]);
  }
}

// Those of these that the triangle's plane meets. e[edge][axis]; h is half an octant's side, with the margin.
HWY_INLINE void planeAxis(const V (&v)[3][3], const V (&e)[3][3], V h, M (&alive)[8]) {
  const D d;
  const V one = hn::Set(d, 1.0f), half = hn::Set(d, 0.5f);
  V n[3], dist = hn::Zero(d), reach = hn::Zero(d), round = hn::Zero(d);
  BOCST_UNROLL
  for (int c = 0; c < 3; ++c) {
    const int p = (c + 1) % 3, q = (c + 2) % 3;
    const V a = hn::Mul(e[0][p], e[1][q]), b = hn::Mul(e[0][q], e[1][p]);
    n[c] = hn::Sub(a, b);
    dist = hn::MulAdd(n[c], v[0][c], dist);
    reach = hn::MulAdd(h, hn::Abs(n[c]), reach);
    round = hn::MulAdd(hn::Add(hn::Abs(a), hn::Abs(b)), hn::Add(hn::Abs(v[0][c]), one), round);
  }
  reach = hn::MulAdd(hn::Set(d, 24 * 0x1p-24f), round, reach);
  const V nx = hn::Mul(half, n[0]), ny = hn::Mul(half, n[1]), nz = hn::Mul(half, n[2]);
  BOCST_UNROLL
  for (int o = 0; o < 8; ++o) {
    V c = (o & 1) ? nx : hn::Neg(nx);
    c = (o >> 1 & 1) ? hn::Add(c, ny) : hn::Sub(c, ny);
    c = (o >> 2 & 1) ? hn::Add(c, nz) : hn::Sub(c, nz);
    alive[o] = hn::And(alive[o], hn::Le(hn::Abs(hn::Sub(dist, c)), reach));
  }
}

void OctantMasks(const float* xyz, std::size_t stride, std::size_t count, float tolerance, std::uint8_t* masks) {
  const D d;
  const hn::RebindToSigned<D> di;
  for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
    V v[3][3];
    V size = hn::Set(d, 1.0f);
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      BOCST_UNROLL
      for (int c = 0; c < 3; ++c) {
        v[k][c] = hn::Load(d, xyz + static_cast<std::size_t>(3 * k + c) * stride + i);
        size = hn::Max(size, hn::Abs(v[k][c]));
      }
    }
    const V rounding_margin = hn::MulAdd(hn::Set(d, 16 * 0x1p-24f), size, hn::Set(d, tolerance));
    const V h = hn::Add(hn::Set(d, 0.5f), rounding_margin);

    M alive[8];
    boxAxes(v, rounding_margin, alive);
    V e[3][3];
    BOCST_UNROLL
    for (int c = 0; c < 3; ++c) {
      e[0][c] = hn::Sub(v[1][c], v[0][c]);
      e[1][c] = hn::Sub(v[2][c], v[1][c]);
      e[2][c] = hn::Sub(v[0][c], v[2][c]);
    }
    planeAxis(v, e, h, alive);
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      BOCST_UNROLL
      for (int c = 0; c < 3; ++c) {
        const int p = (c + 1) % 3, q = (c + 2) % 3, across = (k + 2) % 3;
        edgeAxis(d, e[k][p], e[k][q], v[k][p], v[k][q], v[across][p], v[across][q], h, p, q, alive);
      }
    }

    auto bits = hn::Zero(di);
    BOCST_UNROLL
    for (int o = 0; o < 8; ++o) {
      bits = hn::Or(bits, hn::IfThenElseZero(hn::RebindMask(di, alive[o]), hn::Set(di, 1 << o)));
    }
    HWY_ALIGN std::int32_t lanes[8];
    hn::Store(bits, di, lanes);
    for (std::size_t k = 0; k < hn::Lanes(d) && i + k < count; ++k) masks[i + k] = static_cast<std::uint8_t>(lanes[k]);
  }
}

const char* InstructionSet() { return hwy::TargetName(HWY_TARGET); }

}  // namespace bocst::oracle::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bocst::oracle {

HWY_EXPORT(OctantMasks);
HWY_EXPORT(InstructionSet);

void octantMasks(const float* xyz, std::size_t stride, std::size_t count, float tolerance, std::uint8_t* masks) {
  HWY_DYNAMIC_DISPATCH(OctantMasks)(xyz, stride, count, tolerance, masks);
}

const char* instructionSet() { return HWY_DYNAMIC_DISPATCH(InstructionSet)(); }

}  // namespace bocst::oracle
#endif
