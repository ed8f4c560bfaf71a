// SPDX-License-Identifier: BSD-3-Clause
#include "query/kernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "query/octants-inl.h"
#include "query/vectors-inl.h"

HWY_BEFORE_NAMESPACE();
namespace bocst::query::HWY_NAMESPACE {

std::uint8_t OverlappingOctants(const oracle::OctantBounds& octants, const OneVolume& b) {
  const D d;
  const V pad = hn::Set(d, b.pad), byte = hn::Set(d, 1.0f / 510), half = hn::Set(d, 0.5f);
  const V per127 = hn::Set(d, 1.0f / 127), per254 = hn::Set(d, 1.0f / 254);
  std::uint8_t result = 0;
  for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
    // The octant's box: middle and half extents; delta is the way to the volume's middle.
    V middle[3], h[3], delta[3];
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      const V lo = fromBytes(d, octants.lo[k] + i), hi = fromBytes(d, octants.hi[k] + i);
      middle[k] = hn::MulAdd(hn::Add(lo, hi), byte, hn::Load(d, kOctantCorner[k] + i));
      h[k] = hn::Mul(hn::Sub(hi, lo), byte);
      delta[k] = hn::Sub(hn::Set(d, b.center[k]), middle[k]);
    }
    M apart = hn::MaskFromVec(hn::Zero(d));
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      V r = hn::Add(h[k], pad);
      BOCST_UNROLL
      for (int j = 0; j < 3; ++j) {
        r = hn::MulAdd(hn::Abs(hn::Set(d, b.axes[j][k])), hn::Set(d, b.half[j]), r);
      }
      apart = hn::Or(apart, hn::Gt(hn::Abs(delta[k]), r));
    }
    BOCST_UNROLL
    for (int j = 0; j < 3; ++j) {
      V t = hn::Zero(d), r = hn::Add(hn::Set(d, b.half[j]), pad);
      BOCST_UNROLL
      for (int k = 0; k < 3; ++k) {
        const V a = hn::Set(d, b.axes[j][k]);
        t = hn::MulAdd(a, delta[k], t);
        r = hn::MulAdd(hn::Abs(a), h[k], r);
      }
      apart = hn::Or(apart, hn::Gt(hn::Abs(t), r));
    }

    // Slabs: for z in a box with |m.z - offset| <= w, any a gives n.z in a * offset +- (|a| w + |n - a m| over the
    // box).
    V n[3], along = hn::Zero(d);
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      n[k] = hn::Mul(fromBytes(d, octants.normal[k] + i), per127);
      along = hn::MulAdd(n[k], hn::Set(d, b.normal[k]), along);
    }
    const V center = hn::Mul(fromBytes(d, octants.slab_center + i), per127);
    const V w = hn::Mul(fromBytes(d, octants.slab_half + i), per254);
    const V abs_along = hn::Abs(along), bw = hn::Set(d, b.slab_half), boffset = hn::Set(d, b.slab_offset);
    {
      // Along the octant's normal; its slab is measured from the octant's centre.
      V t = hn::MulSub(along, boffset, center), r = hn::MulAdd(abs_along, bw, hn::Add(w, pad));
      BOCST_UNROLL
      for (int k = 0; k < 3; ++k) {
        const V from = hn::Sub(hn::Set(d, b.center[k]), hn::Add(hn::Load(d, kOctantCorner[k] + i), half));
        t = hn::MulAdd(n[k], from, t);
      }
      V rest[3];
      BOCST_UNROLL
      for (int k = 0; k < 3; ++k) rest[k] = hn::NegMulAdd(along, hn::Set(d, b.normal[k]), n[k]);
      BOCST_UNROLL
      for (int j = 0; j < 3; ++j) {
        V p = hn::Mul(rest[0], hn::Set(d, b.axes[j][0]));
        p = hn::MulAdd(rest[1], hn::Set(d, b.axes[j][1]), p);
        p = hn::MulAdd(rest[2], hn::Set(d, b.axes[j][2]), p);
        r = hn::MulAdd(hn::Abs(p), hn::Set(d, b.half[j]), r);
      }
      apart = hn::Or(apart, hn::Gt(hn::Abs(t), r));
    }
    {
      // Along the volume's normal; the octant's slab counted from its box's middle.
      V own = center, r = hn::MulAdd(abs_along, w, hn::Add(bw, pad)), t = boffset;
      BOCST_UNROLL
      for (int k = 0; k < 3; ++k) {
        const V m = hn::Set(d, b.normal[k]);
        own = hn::NegMulAdd(n[k], hn::Sub(middle[k], hn::Add(hn::Load(d, kOctantCorner[k] + i), half)), own);
        t = hn::MulAdd(m, delta[k], t);
        r = hn::MulAdd(hn::Abs(hn::NegMulAdd(along, n[k], m)), h[k], r);
      }
      t = hn::NegMulAdd(along, own, t);
      apart = hn::Or(apart, hn::Gt(hn::Abs(t), r));
    }
    std::uint8_t bits[8] = {};
    hn::StoreMaskBits(d, hn::Not(apart), bits);
    result = static_cast<std::uint8_t>(result | bits[0] << i);
  }
  return result;
}

void PlaceTriangles(RawTriangles& raw, std::size_t count, const PackPlacement& place, TrianglePack& pack) {
  const hn::CappedTag<double, 8> dd;
  const hn::Rebind<float, decltype(dd)> df;
  pack.count = count;
  // Whole vectors are read: copies of the first triangle change no maximum.
  const std::size_t whole = (count + 7) / 8 * 8;
  for (auto& row : raw.xyz) {
    for (std::size_t i = count; i < whole; ++i) row[i] = row[0];
  }
  auto size = hn::Zero(df);
  for (std::size_t i = 0; i < whole; i += hn::Lanes(dd)) {
    BOCST_UNROLL
    for (std::size_t k = 0; k < 3; ++k) {
      BOCST_UNROLL
      for (std::size_t c = 0; c < 3; ++c) {
        auto x =
            hn::MulAdd(hn::Set(dd, place.linear[c][0]), hn::Load(dd, raw.xyz[3 * k] + i), hn::Set(dd, place.offset[c]));
        x = hn::MulAdd(hn::Set(dd, place.linear[c][1]), hn::Load(dd, raw.xyz[3 * k + 1] + i), x);
        x = hn::MulAdd(hn::Set(dd, place.linear[c][2]), hn::Load(dd, raw.xyz[3 * k + 2] + i), x);
        const auto f = hn::DemoteTo(df, x);
        hn::Store(f, df, pack.xyz[3 * k + c] + i);
        size = hn::Max(size, hn::Abs(f));
      }
    }
  }
  pack.size = hn::GetLane(hn::MaxOfLanes(df, size));
}

std::size_t TouchingPairs(const TrianglePack& rows, const TrianglePack& lanes, float slack, PackPair* pairs) {
  const D d;
  const float size = (rows.size > lanes.size ? rows.size : lanes.size) * 1.0001f;
  const V reach = hn::Set(d, 32 * 0x1p-24f * size + slack);
  std::size_t found = 0;
  // The rows' boxes, once for all lanes.
  alignas(64) float lows[3][TrianglePack::kCapacity], highs[3][TrianglePack::kCapacity];
  for (std::size_t i = 0; i < rows.count; i += hn::Lanes(d)) {
    BOCST_UNROLL
    for (int c = 0; c < 3; ++c) {
      const V a = hn::Load(d, rows.xyz[c] + i), b = hn::Load(d, rows.xyz[3 + c] + i),
              e = hn::Load(d, rows.xyz[6 + c] + i);
      hn::Store(hn::Sub(min3(a, b, e), reach), d, lows[c] + i);
      hn::Store(hn::Add(max3(a, b, e), reach), d, highs[c] + i);
    }
  }
  for (std::size_t i = 0; i < lanes.count; i += hn::Lanes(d)) {
    Vec3 q[3], f[3];
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      q[k] = {hn::Load(d, lanes.xyz[3 * k] + i), hn::Load(d, lanes.xyz[3 * k + 1] + i),
              hn::Load(d, lanes.xyz[3 * k + 2] + i)};
    }
    const Vec3 qmin{min3(q[0].x, q[1].x, q[2].x), min3(q[0].y, q[1].y, q[2].y), min3(q[0].z, q[1].z, q[2].z)};
    const Vec3 qmax{max3(q[0].x, q[1].x, q[2].x), max3(q[0].y, q[1].y, q[2].y), max3(q[0].z, q[1].z, q[2].z)};
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) f[k] = sub(q[(k + 1) % 3], q[k]);
    const Vec3 m = cross(f[0], f[1]);
    const V fsize = hn::Add(norm1(f[0]), norm1(f[1]));
    // The products of a normal are at most the product of the edges' sizes.
    const V mpad = hn::Mul(reach, hn::Add(norm1(m), hn::Mul(norm1(f[0]), norm1(f[1]))));

    // Rows that reach into the box of these lanes.
    const V low[3] = {hn::MinOfLanes(d, qmin.x), hn::MinOfLanes(d, qmin.y), hn::MinOfLanes(d, qmin.z)};
    const V high[3] = {hn::MaxOfLanes(d, qmax.x), hn::MaxOfLanes(d, qmax.y), hn::MaxOfLanes(d, qmax.z)};
    std::uint64_t near_rows = 0;
    for (std::size_t row = 0; row < rows.count; row += hn::Lanes(d)) {
      M in = hn::And(hn::Le(low[0], hn::Load(d, highs[0] + row)), hn::Ge(high[0], hn::Load(d, lows[0] + row)));
      in = hn::And(in,
                   hn::And(hn::Le(low[1], hn::Load(d, highs[1] + row)), hn::Ge(high[1], hn::Load(d, lows[1] + row))));
      in = hn::And(in,
                   hn::And(hn::Le(low[2], hn::Load(d, highs[2] + row)), hn::Ge(high[2], hn::Load(d, lows[2] + row))));
      std::uint8_t bits[8] = {};
      hn::StoreMaskBits(d, in, bits);
      near_rows |= std::uint64_t{bits[0]} << row;
    }
    near_rows &= (std::uint64_t{1} << rows.count) - 1;

    for (; near_rows != 0; near_rows &= near_rows - 1) {
      const auto row = static_cast<std::size_t>(__builtin_ctzll(near_rows));
      M near = hn::And(hn::Le(qmin.x, hn::Set(d, highs[0][row])), hn::Ge(qmax.x, hn::Set(d, lows[0][row])));
      near =
          hn::And(near, hn::And(hn::Le(qmin.y, hn::Set(d, highs[1][row])), hn::Ge(qmax.y, hn::Set(d, lows[1][row]))));
      near =
          hn::And(near, hn::And(hn::Le(qmin.z, hn::Set(d, highs[2][row])), hn::Ge(qmax.z, hn::Set(d, lows[2][row]))));
      if (hn::AllFalse(d, near)) continue;

      Vec3 p[3];
      BOCST_UNROLL
      for (int k = 0; k < 3; ++k) {
        p[k] = {hn::Set(d, rows.xyz[3 * k][row]), hn::Set(d, rows.xyz[3 * k + 1][row]),
                hn::Set(d, rows.xyz[3 * k + 2][row])};
      }
      const Vec3 e[3] = {sub(p[1], p[0]), sub(p[2], p[1]), sub(p[0], p[2])};
      const Vec3 n = cross(e[0], e[1]);
      const V npad = hn::Mul(reach, hn::Add(norm1(n), hn::Mul(norm1(e[0]), norm1(e[1]))));
      const V n0 = dot(n, sub(q[0], p[0])), n1 = dot(n, sub(q[1], p[0])), n2 = dot(n, sub(q[2], p[0]));
      near = hn::And(near, hn::Le(min3(n0, n1, n2), npad));
      near = hn::And(near, hn::Ge(max3(n0, n1, n2), hn::Neg(npad)));
      const V m0 = dot(m, sub(p[0], q[0])), m1 = dot(m, sub(p[1], q[0])), m2 = dot(m, sub(p[2], q[0]));
      near = hn::And(near, hn::Le(min3(m0, m1, m2), mpad));
      near = hn::And(near, hn::Ge(max3(m0, m1, m2), hn::Neg(mpad)));
      if (hn::AllFalse(d, near)) continue;

      const V esize = hn::Add(norm1(e[0]), norm1(e[1]));
      const V epad = hn::Mul(hn::Mul(reach, hn::Set(d, 2.0f)), hn::Mul(esize, fsize));
      BOCST_UNROLL
      for (int a = 0; a < 3; ++a) {
        BOCST_UNROLL
        for (int b = 0; b < 3; ++b) {
          // Both ends of each edge project to one point: two values a side.
          const Vec3 axis = cross(e[a], f[b]);
          const Vec3 from = q[b];
          const V s0 = dot(axis, sub(p[a], from)), s1 = dot(axis, sub(p[(a + 2) % 3], from));
          const V t1 = dot(axis, sub(q[(b + 2) % 3], from)), zero = hn::Zero(d);
          const M before = hn::Lt(hn::Add(hn::Max(s0, s1), epad), hn::Min(t1, zero));
          const M after = hn::Gt(hn::Sub(hn::Min(s0, s1), epad), hn::Max(t1, zero));
          near = hn::AndNot(hn::Or(before, after), near);
        }
      }
      std::uint8_t bits[8] = {};
      hn::StoreMaskBits(d, near, bits);
      for (std::size_t k = 0; k < hn::Lanes(d) && i + k < lanes.count; ++k) {
        if (bits[0] >> k & 1) pairs[found++] = {static_cast<std::uint8_t>(row), static_cast<std::uint8_t>(i + k)};
      }
    }
  }
  return found;
}

}  // namespace bocst::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bocst::query {

HWY_EXPORT(OverlappingOctants);
HWY_EXPORT(PlaceTriangles);
HWY_EXPORT(TouchingPairs);

std::uint8_t overlappingOctants(const oracle::OctantBounds& octants, const OneVolume& volume) {
  return HWY_DYNAMIC_DISPATCH(OverlappingOctants)(octants, volume);
}

void placeTriangles(RawTriangles& raw, std::size_t count, const PackPlacement& place, TrianglePack& pack) {
  HWY_DYNAMIC_DISPATCH(PlaceTriangles)(raw, count, place, pack);
}

std::size_t touchingPairs(const TrianglePack& rows, const TrianglePack& lanes, float slack, PackPair* pairs) {
  return HWY_DYNAMIC_DISPATCH(TouchingPairs)(rows, lanes, slack, pairs);
}

}  // namespace bocst::query
#endif
