// SPDX-License-Identifier: BSD-3-Clause
// Fills frames, once for each instruction set; see Highway's -inl.h headers.
#if defined(BOCST_QUERY_FRAMES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BOCST_QUERY_FRAMES_INL_H
#undef BOCST_QUERY_FRAMES_INL_H
#else
#define BOCST_QUERY_FRAMES_INL_H
#endif

#include "query/frames.h"
#include "query/octants-inl.h"

HWY_BEFORE_NAMESPACE();
namespace bocst::query::HWY_NAMESPACE {

// Writes the volumes of eight octants of side `side`, the first with its corner at `corner`, both in own coordinates.
HWY_INLINE void decode(const PairFrames& g, int own, const oracle::OctantBounds& octants, const float* corner,
                       float side, Frame& f) {
  const D d;
  const int other = 1 - own;
  const V byte = hn::Set(d, side * (1.0f / 510)), vside = hn::Set(d, side), per127 = hn::Set(d, 1.0f / 127);
  const V half = hn::Set(d, 0.5f * side);
  for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
    V c[3], h[3], n[3];
    V offset = hn::Mul(fromBytes(d, octants.slab_center + i), hn::Set(d, side * (1.0f / 127)));
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      const V lo = fromBytes(d, octants.lo[k] + i), hi = fromBytes(d, octants.hi[k] + i);
      const V within = hn::Mul(hn::Add(lo, hi), byte);
      c[k] = hn::Add(within, hn::MulAdd(hn::Load(d, kOctantCorner[k] + i), vside, hn::Set(d, corner[k])));
      h[k] = hn::Mul(hn::Sub(hi, lo), byte);
      n[k] = hn::Mul(fromBytes(d, octants.normal[k] + i), per127);
      // The slab is given from the octant's middle and wanted from its box's.
      offset = hn::NegMulAdd(n[k], hn::Sub(within, half), offset);
      hn::Store(c[k], d, f.center[own][k] + i);
      hn::Store(h[k], d, f.half[own][k] + i);
      hn::Store(n[k], d, f.normal[own][k] + i);
    }
    hn::Store(offset, d, f.slab_center + i);
    hn::Store(hn::Mul(fromBytes(d, octants.slab_half + i), hn::Set(d, side * (1.0f / 254))), d, f.slab_half + i);
    BOCST_UNROLL
    for (int j = 0; j < 3; ++j) {
      V cj = hn::Set(d, g.shift[own][j]), hj = hn::Zero(d), nj = hn::Zero(d);
      BOCST_UNROLL
      for (int k = 0; k < 3; ++k) {
        const V r = hn::Set(d, g.to_other[own][j][k]);
        cj = hn::MulAdd(r, c[k], cj);
        nj = hn::MulAdd(r, n[k], nj);
        hj = hn::MulAdd(hn::Set(d, g.abs_to_other[own][j][k]), h[k], hj);
      }
      hn::Store(cj, d, f.center[other][j] + i);
      hn::Store(hj, d, f.half[other][j] + i);
      hn::Store(nj, d, f.normal[other][j] + i);
    }
  }
}

template <typename Position>
HWY_INLINE void decodeCell(const PairFrames& g, int own, int level, const Position& at,
                           const oracle::OctantBounds& octants, Frame& f) {
  const int side = 1 << (lattice::kMaxLevel - 1 - level), middle = lattice::kMiddle;
  float corner[3];
  for (int k = 0; k < 3; ++k) corner[k] = static_cast<float>(2 * static_cast<int>(at[k]) * side - middle) * g.unit[own];
  decode(g, own, octants, corner, static_cast<float>(side) * g.unit[own], f);
}

HWY_INLINE void decodeRoot(const PairFrames& g, int own, const oracle::CellBounds& bounds, Frame& f) {
  oracle::OctantBounds root;
  root.set(0, bounds);
  const float middle = static_cast<float>(lattice::kMiddle) * g.unit[own];
  const float corner[3] = {-middle, -middle, -middle};
  decode(g, own, root, corner, 2 * middle, f);
}

}  // namespace bocst::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
