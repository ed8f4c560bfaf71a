// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/overlap_kernels.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "geometry/overlap_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "bounds/decode-inl.h"
#include "simd/octants-inl.h"
#include "simd/vectors-inl.h"

HWY_BEFORE_NAMESPACE();
namespace bocst::query::HWY_NAMESPACE {

namespace codec = bounds::HWY_NAMESPACE;

// A vector of octants' boxes: middles, half extents, and the displacements from the middles to the volume's center.
struct Boxes {
  V middle[3], half[3], delta[3];
};

// The octants that are apart from the volume along an axis of theirs or of its box.
HWY_INLINE M apartByFaces(const Boxes& boxes, const OneVolume& b) {
  const D d;
  const V rounding_margin = hn::Set(d, b.rounding_margin);
  M apart = hn::MaskFromVec(hn::Zero(d));
  BOCST_UNROLL
  for (int k = 0; k < 3; ++k) {
    V r = hn::Add(boxes.half[k], rounding_margin);
    BOCST_UNROLL
    for (int j = 0; j < 3; ++j) r = hn::MulAdd(hn::Abs(hn::Set(d, b.axes[j][k])), hn::Set(d, b.half[j]), r);
    apart = hn::Or(apart, hn::Gt(hn::Abs(boxes.delta[k]), r));
  }
  BOCST_UNROLL
  for (int j = 0; j < 3; ++j) {
    V t = hn::Zero(d), r = hn::Add(hn::Set(d, b.half[j]), rounding_margin);
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      const V a = hn::Set(d, b.axes[j][k]);
      t = hn::MulAdd(a, boxes.delta[k], t);
      r = hn::MulAdd(hn::Abs(a), boxes.half[k], r);
    }
    apart = hn::Or(apart, hn::Gt(hn::Abs(t), r));
  }
  return apart;
}

// A vector of octants' slabs: z is within `half` of `center` along the normal n, counted from the point `from`. For z
// in a box with |m.z - offset| <= w, any a gives n.z in a * offset +- (|a| w + |n - a m| over the box); `along` is n.m
// with the volume's normal m, which is the best a.
struct Slabs {
  V normal[3], along, center, half, from[3];
};

HWY_INLINE M apartAlongOctantNormal(const Slabs& slabs, const OneVolume& b) {
  const D d;
  const V bw = hn::Set(d, b.slab_half), rounding_margin = hn::Set(d, b.rounding_margin);
  V t = hn::MulSub(slabs.along, hn::Set(d, b.slab_offset), slabs.center);
  V r = hn::MulAdd(hn::Abs(slabs.along), bw, hn::Add(slabs.half, rounding_margin)), rest[3];
  BOCST_UNROLL
  for (int k = 0; k < 3; ++k) {
    t = hn::MulAdd(slabs.normal[k], hn::Sub(hn::Set(d, b.center[k]), slabs.from[k]), t);
    rest[k] = hn::NegMulAdd(slabs.along, hn::Set(d, b.normal[k]), slabs.normal[k]);
  }
  BOCST_UNROLL
  for (int j = 0; j < 3; ++j) {
    V p = hn::Mul(rest[0], hn::Set(d, b.axes[j][0]));
    p = hn::MulAdd(rest[1], hn::Set(d, b.axes[j][1]), p);
    p = hn::MulAdd(rest[2], hn::Set(d, b.axes[j][2]), p);
    r = hn::MulAdd(hn::Abs(p), hn::Set(d, b.half[j]), r);
  }
  return hn::Gt(hn::Abs(t), r);
}

// `own`: the centers of the octants' slabs, counted from the middles of their boxes.
HWY_INLINE M apartAlongVolumeNormal(const Boxes& boxes, const Slabs& slabs, V own, const OneVolume& b) {
  const D d;
  const V bw = hn::Set(d, b.slab_half), rounding_margin = hn::Set(d, b.rounding_margin);
  V r = hn::MulAdd(hn::Abs(slabs.along), slabs.half, hn::Add(bw, rounding_margin)), t = hn::Set(d, b.slab_offset);
  BOCST_UNROLL
  for (int k = 0; k < 3; ++k) {
    const V m = hn::Set(d, b.normal[k]);
    t = hn::MulAdd(m, boxes.delta[k], t);
    r = hn::MulAdd(hn::Abs(hn::NegMulAdd(slabs.along, slabs.normal[k], m)), boxes.half[k], r);
  }
  return hn::Gt(hn::Abs(hn::NegMulAdd(slabs.along, own, t)), r);
}

// kLoose: the boxes lie in one frame, slabs count from the middle of the box; else each lies in an octant of its own,
// of side 1, and slabs count from the middle of that.
template <bool kLoose>
HWY_INLINE std::uint8_t overlapping(const bounds::OctantBounds& octants, const float (&half_step)[3], float slab_unit,
                                    const OneVolume& b) {
  const D d;
  std::uint8_t result = 0;
  for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
    Boxes boxes;
    Slabs slabs;
    slabs.along = hn::Zero(d);
    codec::decodeSlab(octants, i, slab_unit, slabs.center, slabs.half);
    V own = slabs.center;
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      const V corner = kLoose ? hn::Zero(d) : hn::Load(d, kOctantCorner[k] + i);
      codec::decodeBox(octants, k, i, corner, hn::Set(d, half_step[k]), boxes.middle[k], boxes.half[k]);
      boxes.delta[k] = hn::Sub(hn::Set(d, b.center[k]), boxes.middle[k]);
      slabs.normal[k] = codec::decodeNormal(octants, k, i);
      slabs.along = hn::MulAdd(slabs.normal[k], hn::Set(d, b.normal[k]), slabs.along);
      slabs.from[k] = kLoose ? boxes.middle[k] : hn::Add(corner, hn::Set(d, 0.5f));
      if (!kLoose) own = hn::NegMulAdd(slabs.normal[k], hn::Sub(boxes.middle[k], slabs.from[k]), own);
    }
    M apart = apartByFaces(boxes, b);
    apart = hn::Or(apart, apartAlongOctantNormal(slabs, b));
    apart = hn::Or(apart, apartAlongVolumeNormal(boxes, slabs, own, b));
    result = static_cast<std::uint8_t>(result | bitsOf(D(), hn::Not(apart)) << i);
  }
  return result;
}

std::uint8_t OverlappingOctants(const bounds::OctantBounds& octants, const OneVolume& volume) {
  const float half_step = codec::halfStep(1);
  return overlapping<false>(octants, {half_step, half_step, half_step}, codec::cellSlabUnit(1), volume);
}

std::uint8_t OverlappingLanes(const bounds::LooseFrame& frame, const bounds::OctantBounds& lanes,
                              const OneVolume& volume) {
  const double unit = frame.longest() / 2;
  float half_step[3];
  for (std::size_t k = 0; k < 3; ++k) half_step[k] = codec::halfStep(static_cast<float>(frame.side(k) / unit));
  return overlapping<true>(lanes, half_step, codec::looseSlabUnit(2), volume);
}

std::uint8_t OverlappingBoxes(const OrientedBoxes& boxes, const OneVolume& b) {
  const D d;
  const V rounding_margin = hn::Set(d, b.rounding_margin);
  std::uint8_t result = 0;
  for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
    V delta[3], slab_t = hn::Set(d, b.slab_offset), slab_r = hn::Add(hn::Set(d, b.slab_half), rounding_margin);
    V face_t[3], face_r[3];
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      delta[k] = hn::Sub(hn::Set(d, b.center[k]), hn::Load(d, boxes.center[k] + i));
      slab_t = hn::MulAdd(hn::Set(d, b.normal[k]), delta[k], slab_t);
      face_t[k] = hn::Zero(d);
      face_r[k] = hn::Add(hn::Set(d, b.half[k]), rounding_margin);
    }
    M apart = hn::MaskFromVec(hn::Zero(d));
    BOCST_UNROLL
    for (int j = 0; j < 3; ++j) {
      V axis[3];
      const V half = hn::Load(d, boxes.half[j] + i);
      V t = hn::Zero(d), r = hn::Add(half, rounding_margin), along_normal = hn::Zero(d);
      BOCST_UNROLL
      for (int c = 0; c < 3; ++c) {
        axis[c] = hn::Load(d, boxes.axes[j][c] + i);
        t = hn::MulAdd(axis[c], delta[c], t);
        along_normal = hn::MulAdd(axis[c], hn::Set(d, b.normal[c]), along_normal);
      }
      slab_r = hn::MulAdd(hn::Abs(along_normal), half, slab_r);
      BOCST_UNROLL
      for (int k = 0; k < 3; ++k) {
        V along = hn::Mul(axis[0], hn::Set(d, b.axes[k][0]));
        along = hn::MulAdd(axis[1], hn::Set(d, b.axes[k][1]), along);
        along = hn::Abs(hn::MulAdd(axis[2], hn::Set(d, b.axes[k][2]), along));
        r = hn::MulAdd(along, hn::Set(d, b.half[k]), r);
        face_r[k] = hn::MulAdd(along, half, face_r[k]);
      }
      apart = hn::Or(apart, hn::Gt(hn::Abs(t), r));
    }
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      BOCST_UNROLL
      for (int c = 0; c < 3; ++c) face_t[k] = hn::MulAdd(hn::Set(d, b.axes[k][c]), delta[c], face_t[k]);
      apart = hn::Or(apart, hn::Gt(hn::Abs(face_t[k]), face_r[k]));
    }
    apart = hn::Or(apart, hn::Gt(hn::Abs(slab_t), slab_r));
    result = static_cast<std::uint8_t>(result | bitsOf(d, hn::Not(apart)) << i);
  }
  return result;
}

void PlaceTriangles(RawTriangles& raw, std::size_t count, const PackTransform& place, TrianglePack& pack) {
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

// The normal of triangles with these edges, not of unit length; of those that are all but segments, a direction across
// the segment, so that bounds along it and across both are close.
template <typename VD>
HWY_INLINE Vec3Of<VD> acrossTriangle(const Vec3Of<VD> (&e)[3]) {
  const hn::DFromV<VD> dd;
  const Vec3Of<VD> normal = cross(e[0], e[1]);
  const VD square[3] = {dot(e[0], e[0]), dot(e[1], e[1]), dot(e[2], e[2])};
  const VD longest = max3(square[0], square[1], square[2]);
  const auto is_segment = hn::Le(dot(normal, normal), hn::Mul(hn::Set(dd, 1e-18), hn::Mul(longest, longest)));
  if (hn::AllFalse(dd, is_segment)) return normal;
  const auto first = hn::Eq(square[0], longest), second = hn::Eq(square[1], longest);
  const Vec3Of<VD> along = choose(first, e[0], choose(second, e[1], e[2]));
  const VD x = hn::Abs(along.x), y = hn::Abs(along.y), z = hn::Abs(along.z), none = hn::Zero(dd);
  // Across the axis that it is the least along, too.
  const Vec3Of<VD> by_x{none, along.z, hn::Neg(along.y)}, by_y{hn::Neg(along.z), none, along.x},
      by_z{along.y, hn::Neg(along.x), none};
  const Vec3Of<VD> across = choose(hn::And(hn::Le(x, y), hn::Le(x, z)), by_x, choose(hn::Le(y, z), by_y, by_z));
  return choose(is_segment, across, normal);
}

void BoundTriangles(const RawTriangles& raw, std::uint32_t which, const PackTransform& place, double unit, double far,
                    RawTriangles& placed, TriangleBounds& bounds) {
  const hn::CappedTag<double, 8> dd;
  const hn::Rebind<float, decltype(dd)> df;
  using VD = hn::Vec<decltype(dd)>;
  const VD most = hn::Set(dd, far), least = hn::Set(dd, -far), scale = hn::Set(dd, unit);
  const auto put = [&](VD x, float* to)
                       HWY_ATTR { hn::Store(hn::DemoteTo(df, hn::Min(hn::Max(x, least), most)), df, to); };
  const std::uint32_t lanes = (1u << hn::Lanes(dd)) - 1;
  for (std::size_t i = 0; i < TriangleBounds::kCapacity; i += hn::Lanes(dd)) {
    if ((which >> i & lanes) == 0) continue;
    Vec3Of<VD> v[3];
    BOCST_UNROLL
    for (std::size_t k = 0; k < 3; ++k) {
      const VD from[3] = {hn::Load(dd, raw.xyz[3 * k] + i), hn::Load(dd, raw.xyz[3 * k + 1] + i),
                          hn::Load(dd, raw.xyz[3 * k + 2] + i)};
      VD at[3];
      BOCST_UNROLL
      for (std::size_t c = 0; c < 3; ++c) {
        at[c] = hn::MulAdd(hn::Set(dd, place.linear[c][0]), from[0], hn::Set(dd, place.offset[c]));
        at[c] = hn::MulAdd(hn::Set(dd, place.linear[c][1]), from[1], at[c]);
        at[c] = hn::MulAdd(hn::Set(dd, place.linear[c][2]), from[2], at[c]);
        hn::Store(at[c], dd, placed.xyz[3 * k + c] + i);
      }
      v[k] = scaled(Vec3Of<VD>{at[0], at[1], at[2]}, scale);
    }
    put(min3(v[0].x, v[1].x, v[2].x), bounds.low[0] + i);
    put(min3(v[0].y, v[1].y, v[2].y), bounds.low[1] + i);
    put(min3(v[0].z, v[1].z, v[2].z), bounds.low[2] + i);
    put(max3(v[0].x, v[1].x, v[2].x), bounds.high[0] + i);
    put(max3(v[0].y, v[1].y, v[2].y), bounds.high[1] + i);
    put(max3(v[0].z, v[1].z, v[2].z), bounds.high[2] + i);

    // A direction as floats of unit sum, and as these are in double.
    const auto direction = [&](Vec3Of<VD> along, float(*to)[TriangleBounds::kCapacity]) HWY_ATTR {
      const VD size = hn::Add(hn::Add(hn::Abs(along.x), hn::Abs(along.y)), hn::Abs(along.z));
      const auto is = hn::And(hn::Gt(size, hn::Set(dd, 1e-100)), hn::Lt(size, hn::Set(dd, 1e100)));
      const VD by = hn::IfThenElseZero(is, hn::Div(hn::Set(dd, 1.0), size));
      const Vec3Of<VD> n = scaled(along, by);
      const auto x = hn::DemoteTo(df, n.x), y = hn::DemoteTo(df, n.y), z = hn::DemoteTo(df, n.z);
      hn::Store(x, df, to[0] + i);
      hn::Store(y, df, to[1] + i);
      hn::Store(z, df, to[2] + i);
      return Vec3Of<VD>{hn::PromoteTo(dd, x), hn::PromoteTo(dd, y), hn::PromoteTo(dd, z)};
    };
    const Vec3Of<VD> e[3] = {sub(v[1], v[0]), sub(v[2], v[1]), sub(v[0], v[2])};
    const Vec3Of<VD> across = acrossTriangle(e), n = direction(across, bounds.normal);
    const VD n0 = dot(n, v[0]), n1 = dot(n, v[1]), n2 = dot(n, v[2]);
    put(min3(n0, n1, n2), bounds.normal_low + i);
    put(max3(n0, n1, n2), bounds.normal_high + i);
    BOCST_UNROLL
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3Of<VD> out = direction(cross(e[k], across), bounds.edge[k]);
      put(max3(dot(out, v[0]), dot(out, v[1]), dot(out, v[2])), bounds.edge_high[k] + i);
    }
  }
}

std::uint32_t TrianglesWithin(const TrianglePack& pack, const PackRegion& region) {
  const D d;
  std::uint32_t result = 0;
  for (std::size_t i = 0; i < pack.count; i += hn::Lanes(d)) {
    const Vec3 v[3] = {corner(pack, 0, i), corner(pack, 1, i), corner(pack, 2, i)};
    const Vec3 lo = min3(v), hi = max3(v), n = broadcast(region.normal[0], region.normal[1], region.normal[2]);
    const V along[3] = {dot(n, v[0]), dot(n, v[1]), dot(n, v[2])};
    M in = hn::And(hn::Le(lo.x, hn::Set(d, region.high[0])), hn::Ge(hi.x, hn::Set(d, region.low[0])));
    in = hn::And(in, hn::And(hn::Le(lo.y, hn::Set(d, region.high[1])), hn::Ge(hi.y, hn::Set(d, region.low[1]))));
    in = hn::And(in, hn::And(hn::Le(lo.z, hn::Set(d, region.high[2])), hn::Ge(hi.z, hn::Set(d, region.low[2]))));
    in = hn::And(in, hn::And(hn::Le(min3(along[0], along[1], along[2]), hn::Set(d, region.slab_high)),
                             hn::Ge(max3(along[0], along[1], along[2]), hn::Set(d, region.slab_low))));
    result |= bitsOf(D(), in) << i;
  }
  return pack.count < 32 ? result & ((1u << pack.count) - 1) : result;
}

void MoveTriangles(const TrianglePack& pack, std::uint32_t which, const PackMotion& motion, TrianglePack& moved) {
  const D d;
  moved.count = 0;
  for (std::size_t i = 0; i < pack.count; i += hn::Lanes(d)) {
    // Those wanted to the front. (Highway's Compress may be slow: with AVX2 it copies its table at each use.)
    alignas(32) std::int32_t from[8] = {};
    std::size_t count = 0;
    for (std::uint32_t left = which >> i & ((1u << hn::Lanes(d)) - 1); left != 0; left &= left - 1) {
      from[count++] = __builtin_ctz(left);
    }
    if (count == 0) continue;
    const auto order = hn::SetTableIndices(d, from);
    BOCST_UNROLL
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3 v = corner(pack, k, i);
      BOCST_UNROLL
      for (std::size_t c = 0; c < 3; ++c) {
        V x = hn::MulAdd(hn::Set(d, motion.linear[c][0]), v.x, hn::Set(d, motion.offset[c]));
        x = hn::MulAdd(hn::Set(d, motion.linear[c][1]), v.y, x);
        x = hn::MulAdd(hn::Set(d, motion.linear[c][2]), v.z, x);
        // Whole vectors are written, but never beyond the place where they were read.
        hn::StoreU(hn::TableLookupLanes(x, order), d, moved.xyz[3 * k + c] + moved.count);
      }
    }
    moved.count += count;
  }
  float square = 0, offset = 0;
  for (int c = 0; c < 3; ++c) {
    const float(&r)[3] = motion.linear[c];
    square = std::max(square, r[0] * r[0] + r[1] * r[1] + r[2] * r[2]);
    offset = std::max(offset, std::abs(motion.offset[c]));
  }
  moved.size = (std::sqrt(3 * square) * pack.size + offset) * 1.0001f;
}

void TakeRows(const RawTriangles& placed, const TriangleBounds& bounds, std::uint32_t which, const double (&middle)[3],
              TrianglePack& rows, PackSlabs& slabs) {
  const hn::CappedTag<double, 8> dd;
  const hn::Rebind<float, decltype(dd)> df;
  using VD = hn::Vec<decltype(dd)>;
  rows.count = 0;
  auto size = hn::Zero(df);
  for (std::size_t i = 0; i < TrianglePack::kCapacity; i += hn::Lanes(dd)) {
    const std::uint32_t wanted = which >> i & ((1u << hn::Lanes(dd)) - 1);
    if (wanted == 0) continue;
    alignas(32) std::int32_t from[8];
    std::fill_n(from, 8, __builtin_ctz(wanted));
    std::size_t count = 0;
    for (std::uint32_t left = wanted; left != 0; left &= left - 1) from[count++] = __builtin_ctz(left);
    const auto order = hn::SetTableIndices(df, from);
    // Whole vectors are written, but never beyond the place where they were read.
    const auto put = [&](hn::Vec<decltype(df)> x, float* to)
                         HWY_ATTR { hn::StoreU(hn::TableLookupLanes(x, order), df, to + rows.count); };
    // To unit length: a margin is a length.
    VD normal[3], square = hn::Set(dd, 1e-100);
    BOCST_UNROLL
    for (std::size_t c = 0; c < 3; ++c) {
      normal[c] = hn::PromoteTo(dd, hn::Load(df, bounds.normal[c] + i));
      square = hn::MulAdd(normal[c], normal[c], square);
    }
    const VD per_length = hn::Div(hn::Set(dd, 1.0), hn::Sqrt(square));
    BOCST_UNROLL
    for (std::size_t c = 0; c < 3; ++c) {
      const auto n = hn::DemoteTo(df, hn::Mul(normal[c], per_length));
      put(n, slabs.normal[c]);
      normal[c] = hn::PromoteTo(dd, n);
    }
    VD height[3];
    BOCST_UNROLL
    for (std::size_t k = 0; k < 3; ++k) {
      height[k] = hn::Zero(dd);
      BOCST_UNROLL
      for (std::size_t c = 0; c < 3; ++c) {
        const VD x = hn::Sub(hn::Load(dd, placed.xyz[3 * k + c] + i), hn::Set(dd, middle[c]));
        height[k] = hn::MulAdd(normal[c], x, height[k]);
        const auto at = hn::TableLookupLanes(hn::DemoteTo(df, x), order);
        size = hn::Max(size, hn::Abs(at));
        hn::StoreU(at, df, rows.xyz[3 * k + c] + rows.count);
      }
    }
    const VD low = min3(height[0], height[1], height[2]), high = max3(height[0], height[1], height[2]);
    const VD at = hn::Mul(hn::Set(dd, 0.5), hn::Add(low, high)), half = hn::Mul(hn::Set(dd, 0.5), hn::Sub(high, low));
    put(hn::DemoteTo(df, at), slabs.middle);
    put(hn::DemoteTo(df, hn::Mul(hn::Set(dd, 1 + 0x1p-22), half)), slabs.half);
    rows.count += count;
  }
  rows.size = hn::GetLane(hn::MaxOfLanes(df, size));
}

// The corner of a triangle that is alone on its side of a plane, and its edges; `above` as the corners are over it.
struct Fork {
  Vec3 corner, edge[2];
  V above, above_ends[2];  // the corner's height, and those of the edges' other ends
};

HWY_INLINE Fork forkOf(const Vec3 (&t)[3], V above0, V above1, V above2) {
  const V zero = hn::Zero(D());
  const M below = hn::Lt(above0, zero);
  const M other1 = hn::Xor(below, hn::Lt(above1, zero)), other2 = hn::Xor(below, hn::Lt(above2, zero));
  const M alone1 = hn::AndNot(other2, other1), alone2 = hn::AndNot(other1, other2);
  const Vec3 corner = choose(alone1, t[1], choose(alone2, t[2], t[0]));
  // The others: that after it comes in place 0 or 1 of two, either will do.
  return {corner,
          {sub(choose(alone1, t[0], t[1]), corner), sub(choose(alone2, t[0], t[2]), corner)},
          hn::IfThenElse(alone1, above1, hn::IfThenElse(alone2, above2, above0)),
          {hn::IfThenElse(alone1, above0, above1), hn::IfThenElse(alone2, above0, above2)}};
}

// Triangles of a pack, those wanted one after the other, and their boxes as far as they matter.
struct PickedRows {
  alignas(64) float xyz[9][TrianglePack::kCapacity];
  alignas(64) float low[3][TrianglePack::kCapacity], high[3][TrianglePack::kCapacity];
  PackSlabs slabs;
  std::uint8_t row[TrianglePack::kCapacity];
  std::size_t count = 0;
};

HWY_INLINE void pickRows(const TrianglePack& rows, const PackSlabs* slabs, std::uint32_t which,
                         const PackRegion& region, V extent, PickedRows& picked) {
  const D d;
  for (std::size_t i = 0; i < rows.count; i += hn::Lanes(d)) {
    const std::uint32_t wanted = which >> i & ((1u << hn::Lanes(d)) - 1);
    if (wanted == 0) continue;
    alignas(32) std::int32_t from[8] = {};
    std::size_t count = 0;
    for (std::uint32_t left = wanted; left != 0; left &= left - 1) {
      const int lane = __builtin_ctz(left);
      picked.row[picked.count + count] = static_cast<std::uint8_t>(i + static_cast<std::size_t>(lane));
      from[count++] = lane;
    }
    const auto order = hn::SetTableIndices(d, from);
    // Whole vectors are written, but never beyond the place where they were read.
    const auto pick = [&](const float* row, float* to) HWY_ATTR {
      hn::StoreU(hn::TableLookupLanes(hn::Load(d, row + i), order), d, to + picked.count);
    };
    BOCST_UNROLL
    for (std::size_t k = 0; k < 9; ++k) pick(rows.xyz[k], picked.xyz[k]);
    if (slabs != nullptr) {
      BOCST_UNROLL
      for (std::size_t k = 0; k < 3; ++k) pick(slabs->normal[k], picked.slabs.normal[k]);
      pick(slabs->middle, picked.slabs.middle);
      pick(slabs->half, picked.slabs.half);
    }
    picked.count += count;
  }
  for (std::size_t i = 0; i < picked.count; i += hn::Lanes(d)) {
    BOCST_UNROLL
    for (int c = 0; c < 3; ++c) {
      const V a = hn::Load(d, picked.xyz[c] + i), b = hn::Load(d, picked.xyz[3 + c] + i),
              e = hn::Load(d, picked.xyz[6 + c] + i);
      const V low = hn::Max(min3(a, b, e), hn::Set(d, region.low[c]));
      const V high = hn::Min(max3(a, b, e), hn::Set(d, region.high[c]));
      hn::Store(hn::Sub(low, extent), d, picked.low[c] + i);
      hn::Store(hn::Add(high, extent), d, picked.high[c] + i);
    }
  }
}

// What counts as apart. Along an axis that is a product of edges, a gap counts beyond per_size times the sizes of what
// it was computed from and, with a margin, per_length times its length.
struct Limits {
  V per_size, per_length, beside_slab;
  V through_slab, tolerance;  // for what is certain to meet, where a margin is no tolerance
  float moved;                // what two corners may be off by in sum, that tolerance included
  float margin;               // corners no farther apart touch for sure; 0 where there is no margin

  V along(const Vec3& axis, V sizes) const {
    const V rounding = hn::MulAdd(per_size, sizes, hn::Set(D(), 1e-30f));  // products have lost bits below
    if (!(margin > 0)) return rounding;
    const V length = hn::Add(hn::Sqrt(dot(axis, axis)), hn::Set(D(), 2e-19f));  // squares have lost bits below
    return hn::MulAdd(per_length, length, rounding);
  }
};

HWY_INLINE Limits limitsOf(float size, float lane_size, float tolerance, float margin) {
  const float u = 0x1p-24f, rounding = 64 * u * size;
  // The tolerance is a length. Where it is what FCL rounds, which is no axis of ours, it counts with the sizes.
  const float sure_margin = std::max(margin - rounding, 0.0f);
  const float rest = sure_margin > 0 ? tolerance - margin : tolerance;
  return {hn::Set(D(), sure_margin > 0 ? rounding : rounding + tolerance),
          hn::Set(D(), tolerance),
          hn::Set(D(), 12 * u * lane_size + tolerance),
          hn::Set(D(), 12 * u * lane_size + rest),
          hn::Set(D(), rest),
          25 * u * size + rest,
          sure_margin};
}

// Which of the lanes' triangles meet the box of each picked row from j on, and its slab, if rows have these: eight bits
// a row. One pair in three or four does.
template <bool kSlabs>
HWY_INLINE std::uint64_t meetingBoxes(const Vec3 (&lanes)[3], std::uint32_t filled, const PickedRows& picked,
                                      std::size_t j, const Limits& limits) {
  const D d;
  const Vec3 low = min3(lanes), high = max3(lanes);
  std::uint64_t meeting = 0;
  const std::size_t end = std::min(hn::Lanes(d), picked.count - j);
  for (std::size_t r = 0; r < end; ++r) {
    M near =
        hn::And(hn::Le(low.x, hn::Set(d, picked.high[0][j + r])), hn::Ge(high.x, hn::Set(d, picked.low[0][j + r])));
    near = hn::And(near, hn::And(hn::Le(low.y, hn::Set(d, picked.high[1][j + r])),
                                 hn::Ge(high.y, hn::Set(d, picked.low[1][j + r]))));
    near = hn::And(near, hn::And(hn::Le(low.z, hn::Set(d, picked.high[2][j + r])),
                                 hn::Ge(high.z, hn::Set(d, picked.low[2][j + r]))));
    if constexpr (kSlabs) {
      const PackSlabs& slabs = picked.slabs;
      const Vec3 n = broadcast(slabs.normal[0][j + r], slabs.normal[1][j + r], slabs.normal[2][j + r]);
      const V middle = hn::Set(d, slabs.middle[j + r]),
              half = hn::Add(hn::Set(d, slabs.half[j + r]), limits.beside_slab);
      const V h[3] = {dot(n, lanes[0]), dot(n, lanes[1]), dot(n, lanes[2])};
      near = hn::And(near, hn::And(hn::Le(hn::Sub(min3(h[0], h[1], h[2]), middle), half),
                                   hn::Le(hn::Sub(middle, max3(h[0], h[1], h[2])), half)));
    }
    meeting |= std::uint64_t{bitsOf(D(), near) & filled} << 8 * r;
  }
  return meeting;
}

// A vector of triangles: their edges, normals, longest edges, and how far a determinant with the normal may be off.
struct Plane {
  Vec3 edge[3], normal;
  V longest, rounding_margin;
};

HWY_INLINE Plane planeOf(const Vec3 (&t)[3], const Limits& limits) {
  Plane p;
  p.edge[0] = sub(t[1], t[0]), p.edge[1] = sub(t[2], t[1]), p.edge[2] = sub(t[0], t[2]);
  p.normal = cross(p.edge[0], p.edge[1]);
  p.longest = hn::Sqrt(max3(dot(p.edge[0], p.edge[0]), dot(p.edge[1], p.edge[1]), dot(p.edge[2], p.edge[2])));
  // The products of a normal are at most the product of the edges' sizes.
  p.rounding_margin = limits.along(p.normal, hn::MulAdd(norm1(p.edge[0]), norm1(p.edge[1]), norm1(p.normal)));
  return p;
}

// How far triangles reach to the nearer side of a plane, from their corners' heights above it.
HWY_INLINE V reachAcross(V h0, V h1, V h2) { return hn::Min(max3(h0, h1, h2), hn::Neg(min3(h0, h1, h2))); }

// Bit k: whether triangles p and q of lane k may meet, and whether they surely do.
struct PairBits {
  std::uint32_t possible, certain;
};

// A vector of one PackCut.
struct Ahead {
  Vec3 direction;
  V rounding_margin;  // of coordinates along it
  V most;
};

HWY_INLINE Ahead aheadOf(const PackCut& cut, float size, const Limits& limits) {
  const D d;
  const Vec3 way = broadcast(cut.direction[0], cut.direction[1], cut.direction[2]);
  return {way, hn::Mul(norm1(way), hn::Set(d, limits.moved + 16 * 0x1p-24f * size)), hn::Set(d, cut.most)};
}

// A lower bound of where a triangle meets another: that of its corners and, where these are clearly on both sides of
// the other's plane, that of its cut. Heights are off by less than `off`.
HWY_INLINE V leastOfCut(const Vec3 (&t)[3], const Fork& fork, M is_cut, V off, const Ahead& ahead) {
  const D d;
  const Vec3& direction = ahead.direction;
  V least = hn::Set(d, std::numeric_limits<float>::infinity());
  BOCST_UNROLL
  for (int e = 0; e < 2; ++e) {
    const V way = dot(direction, fork.edge[e]), drop = hn::Sub(fork.above, fork.above_ends[e]);
    const V at = hn::Div(hn::Mul(way, fork.above), drop);
    least = hn::Min(least, hn::Sub(at, hn::Abs(hn::Div(hn::Mul(way, off), drop))));
  }
  least = hn::Add(dot(direction, fork.corner), least);
  const V of_corners = min3(dot(direction, t[0]), dot(direction, t[1]), dot(direction, t[2]));
  return hn::Sub(hn::IfThenElse(is_cut, hn::Max(least, of_corners), of_corners), ahead.rounding_margin);
}

// Where p and q are apart along a cross product of their edges. w: the corners of q from p[0] on. Any axis will do,
// however computed: with u = 2^-24, corners are off by 25 u of the size and the tolerance, what w and the two products
// round is below 16 u times the sum of the axis's entries; the limits have 64 u of the size and the tolerance.
HWY_INLINE M apartByEdges(const Plane& of_p, const Plane& of_q, const Vec3 (&w)[3], const Limits& limits, M asked) {
  const D d;
  const V zero = hn::Zero(d);
  M apart = hn::MaskFromVec(zero);
  for (int a = 0; a < 3 && !hn::AllFalse(d, hn::AndNot(apart, asked)); ++a) {
    BOCST_UNROLL
    for (int b = 0; b < 3; ++b) {
      const Vec3 axis = cross(of_p.edge[a], of_q.edge[b]);
      const V p1 = dot(axis, of_p.edge[0]), p2 = hn::Neg(dot(axis, of_p.edge[2]));
      const V q0 = dot(axis, w[0]), q1 = dot(axis, w[1]), q2 = dot(axis, w[2]);
      const V gap =
          hn::Max(hn::Sub(min3(q0, q1, q2), max3(zero, p1, p2)), hn::Sub(min3(zero, p1, p2), max3(q0, q1, q2)));
      apart = hn::Or(apart, hn::Gt(gap, limits.along(axis, norm1(axis))));
    }
  }
  return apart;
}

// The square of the least distance between corners.
HWY_INLINE V squareBetweenCorners(const Vec3 (&p)[3], const Vec3 (&q)[3]) {
  V least = hn::Set(D(), std::numeric_limits<float>::infinity());
  for (int i = 0; i < 3; ++i) {
    BOCST_UNROLL
    for (int j = 0; j < 3; ++j) {
      const Vec3 displacement = sub(q[j], p[i]);
      least = hn::Min(least, dot(displacement, displacement));
    }
  }
  return least;
}

// A vector of PackSlabs.
struct SlabLanes {
  Vec3 normal;
  V middle, half;
};

// slab: of p, or null. ahead: null, or `begin` is set.
template <typename Slab>
HWY_INLINE PairBits testPairs(const Vec3 (&p)[3], const Vec3 (&q)[3], const Slab* slab, const Limits& limits,
                              bool one_will_do, M pairs, const Ahead* ahead, V& begin) {
  constexpr bool kSlab = std::is_same<Slab, SlabLanes>::value;
  const D d;
  const float u = 0x1p-24f;
  const V tiny = hn::Set(d, 1e-30f);  // products below have lost bits
  const Plane of_p = planeOf(p, limits), of_q = planeOf(q, limits);
  const Vec3 &n = of_p.normal, &m = of_q.normal;
  const Vec3 w[3] = {sub(q[0], p[0]), sub(q[1], p[0]), sub(q[2], p[0])};
  V n0, n1, n2, n_rounding_margin;
  if constexpr (kSlab) {
    n0 = hn::Sub(dot(slab->normal, q[0]), slab->middle), n1 = hn::Sub(dot(slab->normal, q[1]), slab->middle),
    n2 = hn::Sub(dot(slab->normal, q[2]), slab->middle);
    n_rounding_margin = hn::Add(slab->half, limits.beside_slab);
  } else {
    n0 = dot(n, w[0]), n1 = dot(n, w[1]), n2 = dot(n, w[2]);
    n_rounding_margin = of_p.rounding_margin;
  }
  const V m0 = dot(m, sub(p[0], q[0])), m1 = dot(m, sub(p[1], q[0])), m2 = dot(m, sub(p[2], q[0]));
  const V by_n = reachAcross(n0, n1, n2), by_m = reachAcross(m0, m1, m2);
  const M planes = hn::And(hn::Ge(by_n, hn::Neg(n_rounding_margin)), hn::Ge(by_m, hn::Neg(of_q.rounding_margin)));
  const M near = hn::And(pairs, planes);
  if (hn::AllFalse(d, near)) return {0, 0};

  // How far the determinants below may be off: those with a plane's normal, and those of an edge of each.
  const V span = hn::Add(of_p.longest, hn::Sqrt(max3(dot(w[0], w[0]), dot(w[1], w[1]), dot(w[2], w[2]))));
  const V span4 = hn::Mul(hn::Set(d, 4.0f), span), moves = hn::Set(d, 1.125f * limits.moved),
          rounds = hn::Set(d, 42 * u);
  const auto offNormal = [&](V longest) HWY_ATTR {
    return hn::MulAdd(hn::Mul(longest, hn::MulAdd(rounds, longest, moves)), hn::Add(span4, longest), tiny);
  };
  const V longer = hn::Max(of_p.longest, of_q.longest), shorter = hn::Min(of_p.longest, of_q.longest);
  const V edges_off =
      hn::MulAdd(hn::Mul(longer, hn::MulAdd(rounds, shorter, moves)), hn::Add(hn::Add(span, span), shorter), tiny);
  V n_off;
  if constexpr (kSlab) {
    n_off = hn::Add(slab->half, limits.through_slab);
  } else {
    n_off = offNormal(of_p.longest);
  }
  const V m_off = offNormal(of_q.longest);
  const M long_enough = hn::Gt(shorter, hn::Set(d, 64 * limits.moved));
  const M clear_n = hn::And(long_enough, hn::Gt(min3(hn::Abs(n0), hn::Abs(n1), hn::Abs(n2)), n_off));
  const M clear_m = hn::And(long_enough, hn::Gt(min3(hn::Abs(m0), hn::Abs(m1), hn::Abs(m2)), m_off));
  const M clear = hn::And(clear_n, clear_m);
  // Each cuts the other's plane with the edges from its corner that is alone on its side, in an interval of the line of
  // both planes. The determinant of two such edges says where an end of the one lies to an end of the other; the
  // intervals share no point when all ends of the one lie to one side of all of the other.
  const Fork fp = forkOf(p, m0, m1, m2), fq = forkOf(q, n0, n1, n2);
  const Vec3 between = sub(fq.corner, fp.corner), c0 = cross(between, fp.edge[0]), c1 = cross(between, fp.edge[1]);
  const V d00 = dot(c0, fq.edge[0]), d01 = dot(c0, fq.edge[1]), d10 = dot(c1, fq.edge[0]), d11 = dot(c1, fq.edge[1]);
  const V low = hn::Min(hn::Min(d00, d01), hn::Min(d10, d11)), high = hn::Max(hn::Max(d00, d01), hn::Max(d10, d11));
  const M beside = hn::Or(hn::Gt(low, edges_off), hn::Lt(high, hn::Neg(edges_off)));
  const M across = hn::And(hn::Lt(low, hn::Neg(edges_off)), hn::Gt(high, edges_off));
  const M cut_by_n = hn::Gt(by_n, hn::Zero(d)), cut_by_m = hn::Gt(by_m, hn::Zero(d));
  const M cut = hn::And(cut_by_n, cut_by_m);
  // With a margin, what shares no point may touch.
  M possible = limits.margin > 0 ? near : hn::AndNot(hn::And(clear, hn::Or(hn::Not(cut), beside)), near);
  M certain = hn::And(hn::And(near, clear), hn::And(cut, across));
  if constexpr (kSlab) {
    // The heights stay what they are however the corners of q are moved by the tolerance; those of p move its plane.
    const V least = hn::Sub(min3(hn::Abs(n0), hn::Abs(n1), hn::Abs(n2)), n_off), size = norm1(n);
    const V moved = hn::Mul(hn::Mul(limits.tolerance, of_p.longest), hn::Add(span4, of_p.longest));
    certain = hn::And(certain, hn::Gt(hn::Mul(least, size), hn::Add(moved, moved)));
    certain = hn::And(certain, hn::Gt(size, hn::Mul(hn::Set(d, 1e-3f), hn::Mul(of_p.longest, of_p.longest))));
  }
  if (limits.margin > 0) {
    certain =
        hn::Or(certain, hn::And(near, hn::Le(squareBetweenCorners(p, q), hn::Set(d, limits.margin * limits.margin))));
  }
  if (ahead != nullptr) {
    begin = hn::Max(leastOfCut(p, fp, hn::And(clear_m, cut_by_m), m_off, *ahead),
                    leastOfCut(q, fq, hn::And(clear_n, cut_by_n), n_off, *ahead));
    possible = hn::And(possible, hn::Le(begin, ahead->most));
  }
  const M doubtful = hn::AndNot(certain, possible);
  if (!hn::AllFalse(d, doubtful) && (!one_will_do || hn::AllFalse(d, certain))) {
    possible = hn::AndNot(hn::And(doubtful, apartByEdges(of_p, of_q, w, limits, doubtful)), possible);
  }
  return {bitsOf(D(), possible), bitsOf(D(), certain)};
}

template <bool kSlabs>
HWY_INLINE std::size_t touching(const TrianglePack& rows, std::uint32_t which, const TrianglePack& lanes,
                                const PackRegion& region, float tolerance, float margin, bool one_will_do,
                                PackPair* pairs, const PackSlabs* slabs, const PackCut* cut) {
  const D d;
  const hn::RebindToSigned<D> di;
  constexpr std::size_t kMost = hn::MaxLanes(D());
  const float size = std::max(rows.size, lanes.size) * 1.0001f;
  const Limits limits = limitsOf(size, lanes.size, tolerance, margin);
  const V extent = hn::Set(d, 64 * 0x1p-24f * size + tolerance);
  Ahead along;
  if (cut != nullptr) along = aheadOf(*cut, size, limits);
  const Ahead* const ahead = cut == nullptr ? nullptr : &along;
  std::size_t found = 0;
  PickedRows picked;
  pickRows(rows, slabs, which, region, extent, picked);
  for (std::size_t i = 0; i < lanes.count; i += hn::Lanes(d)) {
    const std::uint32_t filled = lanes.count - i < hn::Lanes(d) ? (1u << (lanes.count - i)) - 1 : 0xff;
    const Vec3 lane_corner[3] = {corner(lanes, 0, i), corner(lanes, 1, i), corner(lanes, 2, i)};
    for (std::size_t j = 0; j < picked.count; j += hn::Lanes(d)) {
      // Pairs whose boxes meet are gathered before what costs more.
      std::uint64_t meeting = meetingBoxes<kSlabs>(lane_corner, filled, picked, j, limits);
      if (meeting == 0) continue;
      alignas(64) std::int32_t which_pair[kMost * 8 + kMost];
      std::size_t count = 0;
      for (; meeting != 0; meeting &= meeting - 1) which_pair[count++] = __builtin_ctzll(meeting);
      hn::StoreU(hn::Zero(di), di, which_pair + count);
      for (std::size_t at = 0; at < count; at += hn::Lanes(d)) {
        const auto pair = hn::Load(di, which_pair + at);
        const auto row = hn::IndicesFromVec(d, hn::ShiftRight<3>(pair));
        const auto lane = hn::IndicesFromVec(d, hn::And(pair, hn::Set(di, 7)));
        Vec3 p[3], q[3];
        BOCST_UNROLL
        for (std::size_t k = 0; k < 3; ++k) {
          p[k] = {hn::TableLookupLanes(hn::Load(d, picked.xyz[3 * k] + j), row),
                  hn::TableLookupLanes(hn::Load(d, picked.xyz[3 * k + 1] + j), row),
                  hn::TableLookupLanes(hn::Load(d, picked.xyz[3 * k + 2] + j), row)};
          q[k] = {hn::TableLookupLanes(lane_corner[k].x, lane), hn::TableLookupLanes(lane_corner[k].y, lane),
                  hn::TableLookupLanes(lane_corner[k].z, lane)};
        }
        PairBits bits;
        V bound = hn::Zero(d);
        if constexpr (kSlabs) {
          const auto slabRow = [&](const float* from)
                                   HWY_ATTR { return hn::TableLookupLanes(hn::Load(d, from + j), row); };
          const PackSlabs& of = picked.slabs;
          const SlabLanes slab{{slabRow(of.normal[0]), slabRow(of.normal[1]), slabRow(of.normal[2])},
                               slabRow(of.middle),
                               slabRow(of.half)};
          bits = testPairs(p, q, &slab, limits, one_will_do, hn::FirstN(d, count - at), ahead, bound);
        } else {
          bits = testPairs(p, q, static_cast<const void*>(nullptr), limits, one_will_do, hn::FirstN(d, count - at),
                           ahead, bound);
        }
        alignas(64) float least[kMost];
        hn::Store(bound, d, least);
        const auto pairAt = [&](std::size_t in) HWY_ATTR {
          const auto met = static_cast<std::size_t>(which_pair[at + in]);
          return PackPair{picked.row[j + met / 8], static_cast<std::uint8_t>(i + met % 8),
                          (bits.certain >> in & 1) != 0, least[in]};
        };
        const std::uint32_t certain = bits.possible & bits.certain;
        if (one_will_do && certain != 0) {
          pairs[0] = pairAt(static_cast<std::size_t>(__builtin_ctz(certain)));
          return 1;
        }
        for (std::uint32_t k = bits.possible; k != 0; k &= k - 1) {
          pairs[found++] = pairAt(static_cast<std::size_t>(__builtin_ctz(k)));
        }
      }
    }
  }
  return found;
}

std::size_t TouchingPairs(const TrianglePack& rows, std::uint32_t which, const TrianglePack& lanes,
                          const PackRegion& region, float tolerance, float margin, bool one_will_do, PackPair* pairs,
                          const PackSlabs* slabs, const PackCut* cut) {
  return slabs == nullptr
             ? touching<false>(rows, which, lanes, region, tolerance, margin, one_will_do, pairs, slabs, cut)
             : touching<true>(rows, which, lanes, region, tolerance, margin, one_will_do, pairs, slabs, cut);
}

}  // namespace bocst::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bocst::query {

HWY_EXPORT(OverlappingOctants);
HWY_EXPORT(OverlappingLanes);
HWY_EXPORT(OverlappingBoxes);
HWY_EXPORT(PlaceTriangles);
HWY_EXPORT(BoundTriangles);
HWY_EXPORT(TrianglesWithin);
HWY_EXPORT(MoveTriangles);
HWY_EXPORT(TakeRows);
HWY_EXPORT(TouchingPairs);

std::uint8_t overlappingLanes(const bounds::LooseFrame& frame, const bounds::OctantBounds& lanes,
                              const OneVolume& volume) {
  return HWY_DYNAMIC_DISPATCH(OverlappingLanes)(frame, lanes, volume);
}

std::uint8_t overlappingOctants(const bounds::OctantBounds& octants, const OneVolume& volume) {
  return HWY_DYNAMIC_DISPATCH(OverlappingOctants)(octants, volume);
}

std::uint8_t overlappingBoxes(const OrientedBoxes& boxes, const OneVolume& volume) {
  return HWY_DYNAMIC_DISPATCH(OverlappingBoxes)(boxes, volume);
}

void placeTriangles(RawTriangles& raw, std::size_t count, const PackTransform& place, TrianglePack& pack) {
  HWY_DYNAMIC_DISPATCH(PlaceTriangles)(raw, count, place, pack);
}

void boundTriangles(const RawTriangles& raw, std::uint32_t which, const PackTransform& place, double unit, double far,
                    RawTriangles& placed, TriangleBounds& bounds) {
  HWY_DYNAMIC_DISPATCH(BoundTriangles)(raw, which, place, unit, far, placed, bounds);
}

std::uint32_t trianglesWithin(const TrianglePack& pack, const PackRegion& region) {
  return HWY_DYNAMIC_DISPATCH(TrianglesWithin)(pack, region);
}

void moveTriangles(const TrianglePack& pack, std::uint32_t which, const PackMotion& motion, TrianglePack& moved) {
  HWY_DYNAMIC_DISPATCH(MoveTriangles)(pack, which, motion, moved);
}

void takeRows(const RawTriangles& placed, const TriangleBounds& bounds, std::uint32_t which, const double (&middle)[3],
              TrianglePack& rows, PackSlabs& slabs) {
  HWY_DYNAMIC_DISPATCH(TakeRows)(placed, bounds, which, middle, rows, slabs);
}

std::size_t touchingPairs(const TrianglePack& rows, std::uint32_t which, const TrianglePack& lanes,
                          const PackRegion& region, float tolerance, float margin, bool one_will_do, PackPair* pairs,
                          const PackSlabs* slabs, const PackCut* cut) {
  return HWY_DYNAMIC_DISPATCH(TouchingPairs)(rows, which, lanes, region, tolerance, margin, one_will_do, pairs, slabs,
                                             cut);
}

}  // namespace bocst::query
#endif
