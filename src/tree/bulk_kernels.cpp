// SPDX-License-Identifier: BSD-3-Clause
#include "tree/bulk_kernels.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "simd/float4.h"
#include "simd/unroll.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tree/bulk_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace bocst::tree::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using D = hn::CappedTag<float, 16>;
using V = hn::Vec<D>;

PieceBounds BoundPiece(const CornerRows& c, std::size_t begin, std::size_t count) {
  const D d;
  V total[3] = {hn::Zero(d), hn::Zero(d), hn::Zero(d)}, first[3] = {hn::Zero(d), hn::Zero(d), hn::Zero(d)};
  V lo[3], hi[3];
  for (std::size_t k = 0; k < 3; ++k) lo[k] = hi[k] = hn::Set(d, c.row[k][begin]);
  bool found = false;
  for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
    V n[3], p[3], e[3], f[3];
    const auto in = hn::FirstN(d, count - i);
    for (std::size_t k = 0; k < 3; ++k) {
      p[k] = hn::LoadU(d, c.row[k] + begin + i);
      const V q = hn::LoadU(d, c.row[3 + k] + begin + i), r = hn::LoadU(d, c.row[6 + k] + begin + i);
      lo[k] = hn::IfThenElse(in, hn::Min(lo[k], hn::Min(p[k], hn::Min(q, r))), lo[k]);
      hi[k] = hn::IfThenElse(in, hn::Max(hi[k], hn::Max(p[k], hn::Max(q, r))), hi[k]);
      e[k] = hn::Sub(q, p[k]);
      f[k] = hn::Sub(r, p[k]);
    }
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t a = (k + 1) % 3, b = (k + 2) % 3;
      n[k] = hn::IfThenElseZero(in, hn::NegMulAdd(e[b], f[a], hn::Mul(e[a], f[b])));
    }
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
  PieceBounds b{};
  for (std::size_t k = 0; k < 3; ++k) {
    b.lo[k] = hn::GetLane(hn::MinOfLanes(d, lo[k]));
    b.hi[k] = hn::GetLane(hn::MaxOfLanes(d, hi[k]));
    b.normal[k] = hn::GetLane(hn::SumOfLanes(d, total[k]));
  }
  return b;
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

bool StepsOnGrid(const CornerRows& c, std::size_t begin, std::size_t count, const float (&base)[3], LeafGrid& grid,
                 CornerSteps& steps) {
  constexpr float kMost = 65535, kFewest = 512;
  const D d;
  V lo[3], hi[3];
  BOCST_UNROLL
  for (std::size_t x = 0; x < 3; ++x) lo[x] = hi[x] = hn::Set(d, c.row[x][begin]);
  for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
    const auto in = hn::FirstN(d, count - i);
    BOCST_UNROLL
    for (std::size_t k = 0; k < 9; ++k) {
      const V p = hn::LoadU(d, c.row[k] + begin + i);
      lo[k % 3] = hn::IfThenElse(in, hn::Min(lo[k % 3], p), lo[k % 3]);
      hi[k % 3] = hn::IfThenElse(in, hn::Max(hi[k % 3], p), hi[k % 3]);
    }
  }
  float from[3], extent = 0;
  BOCST_UNROLL
  for (std::size_t x = 0; x < 3; ++x) {
    // The surface lies in the lattice, but for rounding.
    grid.origin[x] = std::min(std::max(std::floor(hn::GetLane(hn::MinOfLanes(d, lo[x]))) + base[x], 0.0f), kMost);
    from[x] = grid.origin[x] - base[x];
    extent = std::max(extent, hn::GetLane(hn::MaxOfLanes(d, hi[x])) - from[x]);
  }
  if (!(extent >= kFewest * kLeastStep)) return false;
  // The least power of two with which kMost steps reach.
  std::uint32_t bits;
  const float least = std::max(extent / kMost, kLeastStep);
  std::memcpy(&bits, &least, sizeof(bits));
  bits = (bits + 0x7fffff) & 0x7f800000;
  std::memcpy(&grid.step, &bits, sizeof(bits));
  const hn::RebindToSigned<D> di;
  const hn::Rebind<std::uint16_t, D> du;
  const V per = hn::Set(d, 1 / grid.step);
  for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
    BOCST_UNROLL
    for (std::size_t k = 0; k < 9; ++k) {
      const V first = hn::Set(d, from[k % 3]);
      const V exact = hn::Mul(hn::Sub(hn::LoadU(d, c.row[k] + begin + i), first), per);
      const V step = hn::Min(hn::Max(hn::Add(exact, hn::Set(d, 0.5f)), hn::Zero(d)), hn::Set(d, kMost));
      hn::StoreU(hn::DemoteTo(du, hn::ConvertTo(di, step)), du, steps[k] + i);
    }
  }
  return true;
}

// How far the boxes of pieces i, i + 1, ... reach.
HWY_INLINE V reachOf(const BoundedPieces& pieces, std::size_t i, const float (&n)[3]) {
  const D d;
  V reach = hn::Zero(d);
  for (std::size_t c = 0; c < 3; ++c) {
    const V along = hn::Set(d, n[c]);
    reach = hn::MulAdd(along, hn::LoadU(d, pieces.center + c * pieces.stride + i), reach);
    reach = hn::MulAdd(hn::Abs(along), hn::LoadU(d, pieces.half + c * pieces.stride + i), reach);
  }
  return reach;
}

float FarthestAlong(const CornerRows& c, const BoundedPieces& pieces, const float (&n)[3]) {
  const D d;
  const hn::RebindToUnsigned<D> du;
  // The piece whose box reaches farthest sets a mark that few others come near.
  V farthest = hn::Set(d, -std::numeric_limits<float>::infinity());
  auto where = hn::Zero(du);
  for (std::size_t i = 0; i < pieces.count; i += hn::Lanes(d)) {
    const V reach = reachOf(pieces, i, n);
    const auto is_farther = hn::Gt(reach, farthest);
    farthest = hn::IfThenElse(is_farther, reach, farthest);
    where = hn::IfThenElse(hn::RebindMask(du, is_farther), hn::Iota(du, static_cast<std::uint32_t>(i)), where);
  }
  HWY_ALIGN float reaches[HWY_MAX_BYTES / sizeof(float)];
  HWY_ALIGN std::uint32_t places[HWY_MAX_BYTES / sizeof(float)];
  hn::Store(farthest, d, reaches);
  hn::Store(where, du, places);
  const std::size_t first = places[std::max_element(reaches, reaches + hn::Lanes(d)) - reaches];
  float least, most;
  ExtremesAlong(c, pieces.piece[first][0], pieces.piece[first][1], n, least, most);
  for (std::size_t i = 0; i < pieces.count; i += hn::Lanes(d)) {
    const V reach = reachOf(pieces, i, n);
    if (hn::AllFalse(d, hn::Gt(reach, hn::Set(d, most)))) continue;
    hn::Store(reach, d, reaches);
    for (std::size_t k = 0; k < hn::Lanes(d); ++k) {
      if (!(reaches[k] > most) || i + k == first) continue;
      float extent;
      ExtremesAlong(c, pieces.piece[i + k][0], pieces.piece[i + k][1], n, least, extent);
      most = std::max(most, extent);
    }
  }
  return most;
}

}  // namespace bocst::tree::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bocst::tree {

HWY_EXPORT(BoundPiece);
HWY_EXPORT(ExtremesAlong);
HWY_EXPORT(StepsOnGrid);
HWY_EXPORT(FarthestAlong);

// Reading corners one by one, each as one vector of four, takes less time than gathering coordinates in wider vectors.
namespace {

using simd::Float4;
using simd::Int4;

Float4 all(float x) { return Float4{x, x, x, x}; }
Float4 least(Float4 a, Float4 b) { return a < b ? a : b; }
Float4 most(Float4 a, Float4 b) { return a > b ? a : b; }
Float4 placeOf(const float* places, std::uint32_t vertex) { return simd::load(places + 4 * std::size_t{vertex}); }

/// Every third bit of numbers below 2^10.
Int4 spread(Int4 x) {
  x = (x | x << 16) & 0x030000ff;
  x = (x | x << 8) & 0x0300f00f;
  x = (x | x << 4) & 0x030c30c3;
  return (x | x << 2) & 0x09249249;
}

}  // namespace

void curveKeys(const Mesh::Indices* indices, std::size_t count, const float* places, const CurveCells& cells,
               SortKey* keys) {
  const Float4 corner{2 * cells.corner[0], 2 * cells.corner[1], 2 * cells.corner[2], 0};
  const Float4 scale = all(cells.scale / 2), last = all(static_cast<float>((1 << cells.bits) - 1));
  for (std::size_t i = 0; i < count; ++i) {
    const Mesh::Indices& v = indices[i];
    const Float4 p = placeOf(places, v[0]), q = placeOf(places, v[1]), r = placeOf(places, v[2]);
    const Float4 twice = least(least(p, q), r) + most(most(p, q), r);
    const Float4 cell = least(most((twice - corner) * scale, all(0)), last);
    const Int4 bits = spread(__builtin_convertvector(cell, Int4));
    keys[i] = {static_cast<std::uint32_t>(bits[0] | bits[1] << 1 | bits[2] << 2), static_cast<std::uint32_t>(i)};
  }
}

void boxTriangles(const Mesh::Indices* indices, const float* places, const SortKey* keys, std::size_t count,
                  std::uint32_t* ids, TriangleBox* boxes) {
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t id = keys[i].id;
    const Mesh::Indices& v = indices[id];
    const Float4 p = placeOf(places, v[0]), q = placeOf(places, v[1]), r = placeOf(places, v[2]);
    const Float4 lo = least(least(p, q), r), hi = most(most(p, q), r);
    ids[i] = id;
    std::memcpy(boxes[i].lo, &lo, sizeof lo);
    std::memcpy(boxes[i].hi, &hi, sizeof hi);
  }
}

void gatherCorners(const Mesh::Indices* indices, const float* places, const std::uint32_t* ids, std::size_t count,
                   float* rows, std::size_t stride) {
  for (std::size_t i = 0; i < count; i += 4) {
    const Mesh::Indices* of[4];
    for (std::size_t t = 0; t < 4; ++t) of[t] = &indices[ids[std::min(i + t, count - 1)]];
    for (std::size_t k = 0; k < 3; ++k) {
      Float4 a = placeOf(places, (*of[0])[k]), b = placeOf(places, (*of[1])[k]), c = placeOf(places, (*of[2])[k]),
             d = placeOf(places, (*of[3])[k]);
      simd::transpose(a, b, c, d);
      const Float4 coordinates[3] = {a, b, c};
      for (std::size_t x = 0; x < 3; ++x) {
        std::memcpy(rows + (3 * k + x) * stride + i, &coordinates[x], sizeof(Float4));
      }
    }
  }
}

PieceBounds boundPiece(const CornerRows& corners, std::size_t begin, std::size_t count) {
  return HWY_DYNAMIC_DISPATCH(BoundPiece)(corners, begin, count);
}

void extremesAlong(const CornerRows& corners, std::size_t begin, std::size_t count, const float (&n)[3], float& least,
                   float& most) {
  HWY_DYNAMIC_DISPATCH(ExtremesAlong)(corners, begin, count, n, least, most);
}

bool stepsOnGrid(const CornerRows& corners, std::size_t begin, std::size_t count, const float (&base)[3],
                 LeafGrid& grid, CornerSteps& steps) {
  return HWY_DYNAMIC_DISPATCH(StepsOnGrid)(corners, begin, count, base, grid, steps);
}

float farthestAlong(const CornerRows& corners, const BoundedPieces& pieces, const float (&n)[3]) {
  return HWY_DYNAMIC_DISPATCH(FarthestAlong)(corners, pieces, n);
}

}  // namespace bocst::tree
#endif
