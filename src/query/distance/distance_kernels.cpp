// SPDX-License-Identifier: BSD-3-Clause
#include "query/distance/distance_kernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/distance/distance_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "query/cull/frames-inl.h"
#include "simd/vectors-inl.h"

HWY_BEFORE_NAMESPACE();
namespace bocst::query::HWY_NAMESPACE {

void FillFrame(const PairFrames& geometry, int own, const tree::Block& block, Frame& frame) {
  decodeBlock(geometry, own, block, frame);
}

void FillRootFrame(const PairFrames& geometry, int own, const bounds::NodeBounds& root, Frame& frame) {
  decodeRoot(geometry, own, root, frame);
}

void FillLanes(const PairFrames& geometry, int own, const LaneVolumes& lanes, Frame& frame) {
  const D d;
  for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
    V c[3], h[3], n[3];
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      c[k] = hn::Load(d, lanes.center[k] + i);
      h[k] = hn::Load(d, lanes.half[k] + i);
      n[k] = hn::Load(d, lanes.normal[k] + i);
    }
    storeLanes(geometry.side[own], c, h, n, hn::Load(d, lanes.slab_center + i), hn::Load(d, lanes.slab_half + i), i,
               frame);
  }
}

// Of octants of sides `length`, the first with its corner at `corner`: lattice units, from the corner of the root.
HWY_INLINE void decodeCenters(const PairFrames::Side& g, const bounds::OctantBounds& octants,
                              const std::int32_t (&corner)[3], std::int32_t length, const LeafCells& leaves, Frame& f) {
  const D d;
  const float cells = static_cast<float>(length / leaves.side);
  const V cells_per_step = hn::Set(d, cells * (1.0f / bounds::kBoxSteps)), part = hn::Set(d, kPartOfCell),
          last = hn::Set(d, cells - 1), side = hn::Set(d, static_cast<float>(leaves.side)),
          half_unit = hn::Set(d, 0.5f * g.unit), half_cell = hn::Mul(side, half_unit);
  for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
    V c[3], h[3], n[3], offset, slab_half;
    const auto octant_side = static_cast<float>(length);
    codec::decodeSlab(octants, i, codec::cellSlabUnit(octant_side * g.unit), offset, slab_half);
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      const V end = hn::Set(d, static_cast<float>(leaves.extent[static_cast<std::size_t>(k)] - lattice::kMiddle));
      const V from = hn::MulAdd(hn::Load(d, kOctantCorner[k] + i), hn::Set(d, octant_side),
                                hn::Set(d, static_cast<float>(corner[k] - lattice::kMiddle)));
      const V lo = hn::Mul(fromBytes(d, octants.lo[k] + i), cells_per_step),
              hi = hn::Mul(fromBytes(d, octants.hi[k] + i), cells_per_step);
      const V first_cell = hn::Min(hn::Max(hn::Floor(hn::Sub(lo, part)), hn::Zero(d)), last);
      const V last_cell = hn::Max(hn::Min(hn::Sub(hn::Ceil(hn::Add(hi, part)), hn::Set(d, 1.0f)), last), first_cell);
      // Whole numbers: twice the middle of a cell's part inside the regions.
      const auto twiceMiddle = [&](V cell) HWY_ATTR {
        const V low = hn::MulAdd(cell, side, from);
        return hn::Add(low, hn::Min(hn::Add(low, side), end));
      };
      const V least = twiceMiddle(first_cell), most = twiceMiddle(last_cell);
      c[k] = hn::Mul(hn::Mul(hn::Add(least, most), hn::Set(d, 0.5f)), half_unit);
      h[k] = hn::Mul(hn::Mul(hn::Sub(most, least), hn::Set(d, 0.5f)), half_unit);
      n[k] = codec::decodeNormal(octants, k, i);
      // The slab is given from the octant's middle and wanted from its box's.
      const V middle = hn::Mul(hn::MulAdd(from, hn::Set(d, 2.0f), hn::Set(d, octant_side)), half_unit);
      offset = hn::NegMulAdd(n[k], hn::Sub(c[k], middle), offset);
      slab_half = hn::MulAdd(hn::Abs(n[k]), half_cell, slab_half);
    }
    storeLanes(g, c, h, n, offset, slab_half, i, f);
  }
}

void FillCenters(const PairFrames& geometry, int own, const tree::Block& block, const LeafCells& leaves, Frame& frame) {
  const std::int32_t length = 1 << (lattice::kMaxLevel - 1 - block.shape);
  const std::int32_t corner[3] = {2 * block.at[0] * length, 2 * block.at[1] * length, 2 * block.at[2] * length};
  decodeCenters(geometry.side[own], block.octants, corner, length, leaves, frame);
}

void FillRootCenters(const PairFrames& geometry, int own, const bounds::NodeBounds& bounds, const LeafCells& leaves,
                     Frame& frame) {
  bounds::OctantBounds root;
  root.fill(bounds);
  const std::int32_t corner[3] = {0, 0, 0};
  decodeCenters(geometry.side[own], root, corner, 2 * lattice::kMiddle, leaves, frame);
}

struct Interval {
  V lo, hi;
};

// How far box AND slab reach along a direction, from the box's middle. All in the frame in which the box is upright.
HWY_INLINE Interval intervalAlong(const Vec3& direction, const Vec3& half, const Vec3& normal, V slab_center,
                                  V slab_half) {
  const V box = dot(abs(direction), half), a = dot(direction, normal), middle = hn::Mul(a, slab_center);
  const Vec3 rest{hn::NegMulAdd(a, normal.x, direction.x), hn::NegMulAdd(a, normal.y, direction.y),
                  hn::NegMulAdd(a, normal.z, direction.z)};
  const V extent = hn::MulAdd(hn::Abs(a), slab_half, dot(abs(rest), half));
  return {hn::Max(hn::Neg(box), hn::Sub(middle, extent)), hn::Min(box, hn::Add(middle, extent))};
}

HWY_INLINE Vec3 turned(const float (&matrix)[3][3], const Vec3& v) {
  const D d;
  const auto row = [&](int j) {
    return hn::MulAdd(hn::Set(d, matrix[j][0]), v.x,
                      hn::MulAdd(hn::Set(d, matrix[j][1]), v.y, hn::Mul(hn::Set(d, matrix[j][2]), v.z)));
  };
  return {row(0), row(1), row(2)};
}

// The gap between two reaches whose middles are `apart` along their direction, from the first to the second.
HWY_INLINE V gapOf(V apart, const Interval& x, const Interval& y) {
  return hn::Max(hn::Sub(hn::Add(apart, y.lo), x.hi), hn::Sub(hn::Sub(x.lo, apart), y.hi));
}

// Displacements from the middles of the octants from i on of f to that of the node in lane l of y, along the axes of
// the octants' side, and how far the boxes are apart at least.
struct BoxGaps {
  Vec3 displacement;
  V at_least;
};

HWY_INLINE BoxGaps boxGaps(const Frame& f, std::size_t i, const Frame& y, std::size_t l) {
  const D d;
  Vec3 displacement[2];  // along the axes of [0] the octants' side
  V squares[2];
  BOCST_UNROLL
  for (int s = 0; s < 2; ++s) {
    V w[3], gap[3];
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      w[k] = hn::Sub(hn::Set(d, y.center[1 - s][k][l]), hn::Load(d, f.center[s][k] + i));
      const V extent = hn::Add(hn::Load(d, f.half[s][k] + i), hn::Set(d, y.half[1 - s][k][l]));
      gap[k] = hn::Max(hn::Sub(hn::Abs(w[k]), extent), hn::Zero(d));
    }
    displacement[s] = {w[0], w[1], w[2]};
    // On three axes at right angles gaps add up as the sides of a box.
    squares[s] = hn::MulAdd(gap[0], gap[0], hn::MulAdd(gap[1], gap[1], hn::Mul(gap[2], gap[2])));
  }
  return {displacement[0], hn::Sqrt(hn::Max(squares[0], squares[1]))};
}

// The larger of `best` and the gap along the normal n, which may be shorter than one by what its bytes round; no normal
// gives no gap.
HWY_INLINE V orAlongNormal(V best, const Vec3& n, V apart, const Interval& x, const Interval& y) {
  const D d;
  const V norm = hn::Max(hn::Sqrt(dot(n, n)), hn::Set(d, 0.5f)), gap = hn::Div(gapOf(apart, x, y), norm);
  return hn::IfThenElse(hn::Gt(dot(n, n), hn::Zero(d)), hn::Max(best, gap), best);
}

void LaneGapsOf(const PairFrames& g, int own, const Frame& f, const Frame& y, std::size_t l,
                const FrameDirection& along, LaneGaps& gaps) {
  const D d;
  const int other = 1 - own;
  const Vec3 y_half = broadcast(y.half[0][0][l], y.half[0][1][l], y.half[0][2][l]);
  const Vec3 y_normal = broadcast(y.normal[0][0][l], y.normal[0][1][l], y.normal[0][2][l]);
  const Vec3 y_normal_there = broadcast(y.normal[1][0][l], y.normal[1][1][l], y.normal[1][2][l]);
  const V y_slab_center = hn::Set(d, y.slab_center[l]), y_slab_half = hn::Set(d, y.slab_half[l]);
  const Interval y_slab{hn::Sub(y_slab_center, y_slab_half), hn::Add(y_slab_center, y_slab_half)};
  const auto ofNode = [&](const Vec3& direction)
                          HWY_ATTR { return intervalAlong(direction, y_half, y_normal, y_slab_center, y_slab_half); };
  const Vec3 along_own = broadcast(along.in[own][0], along.in[own][1], along.in[own][2]);
  const Interval y_along = ofNode(broadcast(along.in[other][0], along.in[other][1], along.in[other][2]));
  const V y_radius = hn::Sqrt(dot(y_half, y_half)), rounding_margin = hn::Set(d, 2 * g.slab_rounding_margin);
  for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
    const Vec3 half = load(f.half[0], i), normal = load(f.normal[0], i);
    const V slab_center = hn::Load(d, f.slab_center + i), slab_half = hn::Load(d, f.slab_half + i);
    const Interval slab{hn::Sub(slab_center, slab_half), hn::Add(slab_center, slab_half)};
    const auto ofOctants = [&](const Vec3& direction)
                               HWY_ATTR { return intervalAlong(direction, half, normal, slab_center, slab_half); };
    const BoxGaps boxes = boxGaps(f, i, y, l);
    const Vec3& w = boxes.displacement;
    V best = hn::Max(boxes.at_least, gapOf(dot(along_own, w), ofOctants(along_own), y_along));

    const V length = hn::Sqrt(dot(w, w)), inverse = hn::Div(hn::Set(d, 1.0f), hn::Max(length, hn::Set(d, 1e-12f)));
    const Vec3 line = scaled(w, inverse), line_other = turned(g.side[own].to_other, line);
    best = hn::Max(best, gapOf(dot(line, w), ofOctants(line), ofNode(line_other)));

    best = orAlongNormal(best, normal, dot(normal, w), slab, ofNode(load(f.normal[1], i)));
    best = orAlongNormal(best, y_normal_there, dot(y_normal_there, w), ofOctants(y_normal_there), y_slab);
    best = hn::Sub(hn::Mul(best, hn::Set(d, 1 - 16 * 0x1p-24f)), rounding_margin);
    hn::Store(hn::Max(best, hn::Zero(d)), d, gaps.at_least + i);
    const V most = hn::Add(length, hn::Add(hn::Sqrt(dot(half, half)), y_radius));
    hn::Store(hn::MulAdd(most, hn::Set(d, 1 + 16 * 0x1p-24f), rounding_margin), d, gaps.at_most + i);
  }
}

// The square of the distance of boxes.
HWY_INLINE V squareOfGap(const Vec3& low, const Vec3& high, const Vec3& lo, const Vec3& hi) {
  const V zero = hn::Zero(D());
  const V x = hn::Max(hn::Max(hn::Sub(low.x, hi.x), hn::Sub(lo.x, high.x)), zero);
  const V y = hn::Max(hn::Max(hn::Sub(low.y, hi.y), hn::Sub(lo.y, high.y)), zero);
  const V z = hn::Max(hn::Max(hn::Sub(low.z, hi.z), hn::Sub(lo.z, high.z)), zero);
  return hn::MulAdd(x, x, hn::MulAdd(y, y, hn::Mul(z, z)));
}

void TriangleGaps(const PairFrames& g, const Frame& f, const TriangleBounds& b, std::size_t count, LaneGaps& gaps) {
  const D d;
  const V zero = hn::Zero(d), margin = hn::Set(d, 2 * g.slab_rounding_margin);
  for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
    const Vec3 center = load(f.center[0], i), half = load(f.half[0], i), normal = load(f.normal[0], i);
    const Vec3 low = sub(center, half),
               high{hn::Add(center.x, half.x), hn::Add(center.y, half.y), hn::Add(center.z, half.z)};
    const V slab_center = hn::Load(d, f.slab_center + i), slab_half = hn::Load(d, f.slab_half + i);
    V nearest = hn::Set(d, 1e30f);
    for (std::size_t t = 0; t < count; ++t) {
      const auto along = [&](const float(&axis)[3][TriangleBounds::kCapacity], V& at) HWY_ATTR {
        const Vec3 n = broadcast(axis[0][t], axis[1][t], axis[2][t]);
        at = dot(n, center);
        return intervalAlong(n, half, normal, slab_center, slab_half);
      };
      const auto inverseLength = [&](const float(&axis)[3][TriangleBounds::kCapacity]) HWY_ATTR {
        const float square = axis[0][t] * axis[0][t] + axis[1][t] * axis[1][t] + axis[2][t] * axis[2][t];
        return hn::Div(hn::Set(d, 1.0f), hn::Sqrt(hn::Set(d, square < 0.25f ? 1.0f : square)));
      };
      V at;
      const Interval over = along(b.normal, at);
      const V across =
          hn::Mul(inverseLength(b.normal), hn::Max(hn::Sub(hn::Sub(hn::Set(d, b.normal_low[t]), at), over.hi),
                                                   hn::Sub(hn::Add(at, over.lo), hn::Set(d, b.normal_high[t]))));
      V beside = zero;
      BOCST_UNROLL
      for (int e = 0; e < 3; ++e) {
        const Interval reach = along(b.edge[e], at);
        const V gap = hn::Sub(hn::Add(at, reach.lo), hn::Set(d, b.edge_high[e][t]));
        beside = hn::Max(beside, hn::Mul(inverseLength(b.edge[e]), gap));
      }
      const V over_plane = hn::Max(across, zero);
      const V square = hn::MulAdd(over_plane, over_plane, hn::Mul(beside, beside));
      const V of_boxes = squareOfGap(low, high, broadcast(b.low[0][t], b.low[1][t], b.low[2][t]),
                                     broadcast(b.high[0][t], b.high[1][t], b.high[2][t]));
      nearest = hn::Min(nearest, hn::Max(square, of_boxes));
    }
    const V gap = hn::Sub(hn::Mul(hn::Sqrt(nearest), hn::Set(d, 1 - 64 * 0x1p-24f)), margin);
    hn::Store(hn::Max(hn::Load(d, gaps.at_least + i), gap), d, gaps.at_least + i);
  }
}

// The largest gap along a direction between two triangles whose corners lie at `p` and `q` along it, times its length.
HWY_INLINE V gapAlong(V p0, V p1, V p2, V q0, V q1, V q2) {
  return hn::Max(hn::Sub(min3(q0, q1, q2), max3(p0, p1, p2)), hn::Sub(min3(p0, p1, p2), max3(q0, q1, q2)));
}

HWY_INLINE V clampToUnit(V x) {
  const D d;
  return hn::Min(hn::Max(x, hn::Zero(d)), hn::Set(d, 1.0f));
}

// The rows' boxes and how far they reach along a direction, once for all lanes.
struct RowBoxes {
  alignas(64) float low[3][TrianglePack::kCapacity], high[3][TrianglePack::kCapacity];
  alignas(64) float extent[TrianglePack::kCapacity];
};

HWY_INLINE void boundRows(const TrianglePack& rows, const Vec3& along, RowBoxes& boxes) {
  const D d;
  for (std::size_t i = 0; i < rows.count; i += hn::Lanes(d)) {
    const Vec3 p[3] = {corner(rows, 0, i), corner(rows, 1, i), corner(rows, 2, i)};
    store(min3(p), boxes.low, i);
    store(max3(p), boxes.high, i);
    hn::Store(max3(dot(along, p[0]), dot(along, p[1]), dot(along, p[2])), d, boxes.extent + i);
  }
}

// Bit r: row r comes nearer than `far` to the box about all lanes, and along the direction.
HWY_INLINE std::uint64_t nearRows(const RowBoxes& boxes, std::size_t count, const Vec3& lanes_low,
                                  const Vec3& lanes_high, V lanes_along, V far, V far_squared) {
  const D d;
  const Vec3 low{hn::MinOfLanes(d, lanes_low.x), hn::MinOfLanes(d, lanes_low.y), hn::MinOfLanes(d, lanes_low.z)};
  const Vec3 high{hn::MaxOfLanes(d, lanes_high.x), hn::MaxOfLanes(d, lanes_high.y), hn::MaxOfLanes(d, lanes_high.z)};
  const V lowest = hn::MinOfLanes(d, lanes_along);
  std::uint64_t rows = 0;
  for (std::size_t row = 0; row < count; row += hn::Lanes(d)) {
    const V square = squareOfGap(low, high, load(boxes.low, row), load(boxes.high, row));
    const M in = hn::And(hn::Lt(square, far_squared), hn::Lt(hn::Sub(lowest, hn::Load(d, boxes.extent + row)), far));
    rows |= std::uint64_t{bitsOf(d, in)} << row;
  }
  return rows & ((std::uint64_t{1} << count) - 1);
}

// A vector of triangles and what does not depend on their partners.
struct Lanes {
  Vec3 corner[3], edge[3], normal;
  V edge_squared[3], normal_inverse, above[3];  // along the normal
};

HWY_INLINE Lanes lanesOf(const TrianglePack& pack, std::size_t i, V tiny) {
  const D d;
  Lanes t;
  BOCST_UNROLL
  for (std::size_t k = 0; k < 3; ++k) t.corner[k] = corner(pack, k, i);
  t.edge[0] = sub(t.corner[1], t.corner[0]), t.edge[1] = sub(t.corner[2], t.corner[1]),
  t.edge[2] = sub(t.corner[0], t.corner[2]);
  t.normal = cross(t.edge[0], t.edge[1]);
  t.normal_inverse = hn::Div(hn::Set(d, 1.0f), hn::Max(hn::Sqrt(dot(t.normal, t.normal)), tiny));
  BOCST_UNROLL
  for (int k = 0; k < 3; ++k) t.edge_squared[k] = dot(t.edge[k], t.edge[k]), t.above[k] = dot(t.normal, t.corner[k]);
  return t;
}

// How far the triangle p, with edges e, and those of the lanes are apart along either normal.
HWY_INLINE V gapAlongNormals(const Vec3 (&p)[3], const Vec3 (&e)[3], const Lanes& q, V tiny) {
  const Vec3 n = cross(e[0], e[1]), &m = q.normal;
  const V n_inverse = hn::Div(hn::Set(D(), 1.0f), hn::Max(hn::Sqrt(dot(n, n)), tiny));
  const V along_n =
      gapAlong(dot(n, p[0]), dot(n, p[1]), dot(n, p[2]), dot(n, q.corner[0]), dot(n, q.corner[1]), dot(n, q.corner[2]));
  const V along_m = gapAlong(dot(m, p[0]), dot(m, p[1]), dot(m, p[2]), q.above[0], q.above[1], q.above[2]);
  return hn::Max(hn::Mul(along_n, n_inverse), hn::Mul(along_m, q.normal_inverse));
}

// Where an edge of p and one of the lanes' triangles are nearest: the displacement, and its square.
struct NearestEdges {
  Vec3 line;
  V square;
};

HWY_INLINE NearestEdges nearestEdges(const Vec3 (&p)[3], const Vec3 (&e)[3], const Lanes& q, V tiny) {
  const D d;
  const V zero = hn::Zero(d);
  NearestEdges nearest{{zero, zero, zero}, hn::Set(d, 3e38f)};
  BOCST_UNROLL
  for (int a = 0; a < 3; ++a) {
    const V ee = dot(e[a], e[a]), ee_inverse = hn::Div(hn::Set(d, 1.0f), hn::Max(ee, tiny));
    BOCST_UNROLL
    for (int b = 0; b < 3; ++b) {
      const Vec3 r = sub(p[a], q.corner[b]), &f = q.edge[b];
      const V er = dot(e[a], r), fr = dot(f, r), ef = dot(e[a], f), ff = q.edge_squared[b];
      const V det = hn::Max(hn::MulSub(ee, ff, hn::Mul(ef, ef)), tiny);
      V s = clampToUnit(hn::Div(hn::MulSub(ef, fr, hn::Mul(er, ff)), det));
      const V t = clampToUnit(hn::Div(hn::MulAdd(ef, s, fr), hn::Max(ff, tiny)));
      s = clampToUnit(hn::Mul(hn::MulSub(ef, t, er), ee_inverse));
      const Vec3 between{hn::NegMulAdd(s, e[a].x, hn::MulSub(t, f.x, r.x)),
                         hn::NegMulAdd(s, e[a].y, hn::MulSub(t, f.y, r.y)),
                         hn::NegMulAdd(s, e[a].z, hn::MulSub(t, f.z, r.z))};
      const V square = dot(between, between);
      const M better = hn::Lt(square, nearest.square);
      nearest.square = hn::IfThenElse(better, square, nearest.square);
      nearest.line = choose(better, between, nearest.line);
    }
  }
  return nearest;
}

std::size_t NearPairs(const TrianglePack& rows, const TrianglePack& lanes, const float direction[3], float cutoff,
                      bool all, NearPair* pairs) {
  const D d;
  const float size = (rows.size > lanes.size ? rows.size : lanes.size) * 1.0001f;
  const V rounding_margin = hn::Set(d, 32 * 0x1p-24f * size), zero = hn::Zero(d), tiny = hn::Set(d, 1e-12f);
  const V more = hn::Set(d, 1 + 16 * 0x1p-24f), huge = hn::Set(d, 3e38f);
  V far = hn::MulAdd(hn::Set(d, cutoff), more, rounding_margin), far_squared = hn::Mul(far, hn::Mul(far, more));
  const Vec3 along = broadcast(direction[0], direction[1], direction[2]);
  RowBoxes boxes;
  boundRows(rows, along, boxes);
  std::size_t found = 0;
  for (std::size_t i = 0; i < lanes.count; i += hn::Lanes(d)) {
    const Lanes q = lanesOf(lanes, i, tiny);
    const Vec3 low = min3(q.corner), high = max3(q.corner);
    const V q_along = min3(dot(along, q.corner[0]), dot(along, q.corner[1]), dot(along, q.corner[2]));
    const M is_triangle = hn::FirstN(d, lanes.count - i);
    std::uint64_t near_rows = nearRows(boxes, rows.count, low, high, q_along, far, far_squared);
    for (; near_rows != 0; near_rows &= near_rows - 1) {
      const auto row = static_cast<std::size_t>(__builtin_ctzll(near_rows));
      const Vec3 row_low = broadcast(boxes.low[0][row], boxes.low[1][row], boxes.low[2][row]);
      const Vec3 row_high = broadcast(boxes.high[0][row], boxes.high[1][row], boxes.high[2][row]);
      M near = hn::And(hn::Lt(squareOfGap(low, high, row_low, row_high), far_squared),
                       hn::And(hn::Lt(hn::Sub(q_along, hn::Set(d, boxes.extent[row])), far), is_triangle));
      if (hn::AllFalse(d, near)) continue;

      Vec3 p[3];
      BOCST_UNROLL
      for (int k = 0; k < 3; ++k) {
        p[k] = broadcast(rows.xyz[3 * k][row], rows.xyz[3 * k + 1][row], rows.xyz[3 * k + 2][row]);
      }
      const Vec3 e[3] = {sub(p[1], p[0]), sub(p[2], p[1]), sub(p[0], p[2])};
      V at_least = gapAlongNormals(p, e, q, tiny);
      near = hn::And(near, hn::Lt(at_least, far));
      if (hn::AllFalse(d, near)) continue;

      const NearestEdges nearest = nearestEdges(p, e, q, tiny);
      const Vec3& line = nearest.line;
      const V gap = gapAlong(dot(line, p[0]), dot(line, p[1]), dot(line, p[2]), dot(line, q.corner[0]),
                             dot(line, q.corner[1]), dot(line, q.corner[2]));
      at_least = hn::Max(at_least, hn::Div(gap, hn::Max(hn::Sqrt(nearest.square), tiny)));
      near = hn::And(near, hn::Lt(at_least, far));
      const unsigned bits = bitsOf(d, near);
      if (bits == 0) continue;
      // The edges are no farther apart than where they were found, so nothing farther is of interest any more.
      if (!all) {
        const V least_square = hn::MinOfLanes(d, hn::IfThenElse(near, nearest.square, huge));
        far = hn::Min(far, hn::MulAdd(hn::Sqrt(least_square), more, hn::Add(rounding_margin, rounding_margin)));
        far_squared = hn::Mul(far, hn::Mul(far, more));
      }
      alignas(64) float least[8];
      hn::Store(hn::Max(hn::Sub(hn::Mul(at_least, hn::Set(d, 1 - 16 * 0x1p-24f)), rounding_margin), zero), d, least);
      for (std::size_t k = 0; k < hn::Lanes(d); ++k) {
        if (bits >> k & 1) {
          pairs[found++] = {least[k], static_cast<std::uint8_t>(row), static_cast<std::uint8_t>(i + k)};
        }
      }
    }
  }
  return found;
}

}  // namespace bocst::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bocst::query {

HWY_EXPORT(FillFrame);
HWY_EXPORT(FillRootFrame);
HWY_EXPORT(FillLanes);
HWY_EXPORT(FillCenters);
HWY_EXPORT(FillRootCenters);
HWY_EXPORT(LaneGapsOf);
HWY_EXPORT(TriangleGaps);
HWY_EXPORT(NearPairs);

void fillFrame(const PairFrames& geometry, int own, const tree::Block& block, Frame& frame) {
  HWY_DYNAMIC_DISPATCH(FillFrame)(geometry, own, block, frame);
}

void fillFrame(const PairFrames& geometry, int own, const bounds::NodeBounds& root, Frame& frame) {
  HWY_DYNAMIC_DISPATCH(FillRootFrame)(geometry, own, root, frame);
}

void fillFrame(const PairFrames& geometry, int own, const LaneVolumes& lanes, Frame& frame) {
  HWY_DYNAMIC_DISPATCH(FillLanes)(geometry, own, lanes, frame);
}

void fillCenters(const PairFrames& geometry, int own, const tree::Block& block, const LeafCells& leaves, Frame& frame) {
  HWY_DYNAMIC_DISPATCH(FillCenters)(geometry, own, block, leaves, frame);
}

void fillCenters(const PairFrames& geometry, int own, const bounds::NodeBounds& root, const LeafCells& leaves,
                 Frame& frame) {
  HWY_DYNAMIC_DISPATCH(FillRootCenters)(geometry, own, root, leaves, frame);
}

void laneGaps(const PairFrames& geometry, int own, const Frame& f, const Frame& y, std::size_t lane,
              const FrameDirection& direction, LaneGaps& gaps) {
  HWY_DYNAMIC_DISPATCH(LaneGapsOf)(geometry, own, f, y, lane, direction, gaps);
}

void triangleGaps(const PairFrames& geometry, const Frame& f, const TriangleBounds& triangles, std::size_t count,
                  LaneGaps& gaps) {
  HWY_DYNAMIC_DISPATCH(TriangleGaps)(geometry, f, triangles, count, gaps);
}

std::size_t nearPairs(const TrianglePack& rows, const TrianglePack& lanes, const float direction[3], float cutoff,
                      bool all, NearPair* pairs) {
  return HWY_DYNAMIC_DISPATCH(NearPairs)(rows, lanes, direction, cutoff, all, pairs);
}

}  // namespace bocst::query
#endif
