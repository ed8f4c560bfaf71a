// SPDX-License-Identifier: BSD-3-Clause
#include "tree/bulk_kernels.h"

#include <algorithm>
#include <cstring>
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

using DI = hn::Rebind<std::int32_t, D>;
using VI = hn::Vec<DI>;

// Every third bit of numbers below 2^10.
HWY_INLINE VI spread(VI x) {
  const DI di;
  x = hn::And(hn::Or(x, hn::ShiftLeft<16>(x)), hn::Set(di, 0x030000ff));
  x = hn::And(hn::Or(x, hn::ShiftLeft<8>(x)), hn::Set(di, 0x0300f00f));
  x = hn::And(hn::Or(x, hn::ShiftLeft<4>(x)), hn::Set(di, 0x030c30c3));
  return hn::And(hn::Or(x, hn::ShiftLeft<2>(x)), hn::Set(di, 0x09249249));
}

// The last vector ends with the last triangle, and overlaps the one before it.
template <typename F>
HWY_INLINE void overAll(std::size_t count, F&& f) {
  const std::size_t lanes = hn::Lanes(D());
  for (std::size_t i = 0; i + lanes < count; i += lanes) f(i);
  f(count - lanes);
}

void CurveKeys(const Mesh::Indices* indices, std::size_t count, const float* places, const CurveCells& cells,
               SortKey* keys) {
  const D d;
  const DI di;
  const V scale = hn::Set(d, cells.scale / 2), zero = hn::Zero(d),
          last = hn::Set(d, static_cast<float>((1 << cells.bits) - 1));
  const auto* const all = reinterpret_cast<const std::int32_t*>(indices);
  overAll(count, [&](std::size_t i) HWY_ATTR {
    VI v[3];
    hn::LoadInterleaved3(di, all + 3 * i, v[0], v[1], v[2]);
    for (VI& x : v) x = hn::ShiftLeft<2>(x);
    VI code = hn::Zero(di);
    for (int c = 0; c < 3; ++c) {
      const V p = hn::GatherIndex(d, places + c, v[0]), q = hn::GatherIndex(d, places + c, v[1]),
              r = hn::GatherIndex(d, places + c, v[2]);
      const V twice = hn::Add(hn::Min(hn::Min(p, q), r), hn::Max(hn::Max(p, q), r));
      const V cell = hn::Min(hn::Max(hn::Mul(hn::Sub(twice, hn::Set(d, 2 * cells.corner[c])), scale), zero), last);
      const VI bits = spread(hn::ConvertTo(di, cell));
      code = hn::Or(code, c == 0 ? bits : c == 1 ? hn::ShiftLeft<1>(bits) : hn::ShiftLeft<2>(bits));
    }
    hn::StoreInterleaved2(code, hn::Iota(di, static_cast<std::int32_t>(i)), di,
                          reinterpret_cast<std::int32_t*>(keys + i));
  });
}

void BoxTriangles(const Mesh::Indices* indices, const float* places, const SortKey* keys, std::size_t count,
                  std::uint32_t* ids, TriangleBox* boxes) {
  const D d;
  const DI di;
  const auto* const all = reinterpret_cast<const std::int32_t*>(indices);
  overAll(count, [&](std::size_t i) HWY_ATTR {
    VI code, id;
    hn::LoadInterleaved2(di, reinterpret_cast<const std::int32_t*>(keys + i), code, id);
    hn::StoreU(id, di, reinterpret_cast<std::int32_t*>(ids + i));
    const VI at = hn::Add(id, hn::ShiftLeft<1>(id));
    VI v[3];
    for (std::size_t k = 0; k < 3; ++k) v[k] = hn::ShiftLeft<2>(hn::GatherIndex(di, all + k, at));
    V lo[3], hi[3];
    for (std::size_t c = 0; c < 3; ++c) {
      const V p = hn::GatherIndex(d, places + c, v[0]), q = hn::GatherIndex(d, places + c, v[1]),
              r = hn::GatherIndex(d, places + c, v[2]);
      lo[c] = hn::Min(hn::Min(p, q), r);
      hi[c] = hn::Max(hn::Max(p, q), r);
    }
    // A box is as long as two of what is interleaved.
    HWY_ALIGN float los[4 * HWY_MAX_BYTES / sizeof(float)], his[4 * HWY_MAX_BYTES / sizeof(float)];
    hn::StoreInterleaved4(lo[0], lo[1], lo[2], lo[2], d, los);
    hn::StoreInterleaved4(hi[0], hi[1], hi[2], hi[2], d, his);
    for (std::size_t k = 0; k < hn::Lanes(d); ++k) {
      std::memcpy(boxes[i + k].lo, los + 4 * k, sizeof(boxes->lo));
      std::memcpy(boxes[i + k].hi, his + 4 * k, sizeof(boxes->hi));
    }
  });
}

void GatherCorners(const Mesh::Indices* indices, const float* places, const std::uint32_t* ids, std::size_t count,
                   float* rows, std::size_t stride) {
  const D d;
  const DI di;
  const auto* const all = reinterpret_cast<const std::int32_t*>(indices);
  for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
    const auto* const from = reinterpret_cast<const std::int32_t*>(ids + i);
    const VI id = count - i >= hn::Lanes(d) ? hn::LoadU(di, from) : hn::MaskedLoad(hn::FirstN(di, count - i), di, from);
    const VI at = hn::Add(id, hn::ShiftLeft<1>(id));
    for (std::size_t k = 0; k < 3; ++k) {
      const VI v = hn::ShiftLeft<2>(hn::GatherIndex(di, all + k, at));
      for (std::size_t c = 0; c < 3; ++c) {
        hn::StoreU(hn::GatherIndex(d, places + c, v), d, rows + (3 * k + c) * stride + i);
      }
    }
  }
}

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

HWY_EXPORT(CurveKeys);
HWY_EXPORT(BoxTriangles);
HWY_EXPORT(GatherCorners);
HWY_EXPORT(BoundPiece);
HWY_EXPORT(ExtremesAlong);
HWY_EXPORT(FarthestAlong);

void curveKeys(const Mesh::Indices* indices, std::size_t count, const float* places, const CurveCells& cells,
               SortKey* keys) {
  HWY_DYNAMIC_DISPATCH(CurveKeys)(indices, count, places, cells, keys);
}

void boxTriangles(const Mesh::Indices* indices, const float* places, const SortKey* keys, std::size_t count,
                  std::uint32_t* ids, TriangleBox* boxes) {
  HWY_DYNAMIC_DISPATCH(BoxTriangles)(indices, places, keys, count, ids, boxes);
}

void gatherCorners(const Mesh::Indices* indices, const float* places, const std::uint32_t* ids, std::size_t count,
                   float* rows, std::size_t stride) {
  HWY_DYNAMIC_DISPATCH(GatherCorners)(indices, places, ids, count, rows, stride);
}

PieceBounds boundPiece(const CornerRows& corners, std::size_t begin, std::size_t count) {
  return HWY_DYNAMIC_DISPATCH(BoundPiece)(corners, begin, count);
}

void extremesAlong(const CornerRows& corners, std::size_t begin, std::size_t count, const float (&n)[3], float& least,
                   float& most) {
  HWY_DYNAMIC_DISPATCH(ExtremesAlong)(corners, begin, count, n, least, most);
}

float farthestAlong(const CornerRows& corners, const BoundedPieces& pieces, const float (&n)[3]) {
  return HWY_DYNAMIC_DISPATCH(FarthestAlong)(corners, pieces, n);
}

}  // namespace bocst::tree
#endif
