// SPDX-License-Identifier: BSD-3-Clause
// Fills frames and compares them, once for each instruction set; see Highway's -inl.h headers.
#if defined(BOCST_CULL_FRAMES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BOCST_CULL_FRAMES_INL_H
#undef BOCST_CULL_FRAMES_INL_H
#else
#define BOCST_CULL_FRAMES_INL_H
#endif

#include "bounds/decode-inl.h"
#include "query/cull/frames.h"
#include "simd/octants-inl.h"
#include "tree/block.h"

HWY_BEFORE_NAMESPACE();
namespace bocst::query::HWY_NAMESPACE {

namespace codec = bounds::HWY_NAMESPACE;

// Writes some lanes, along the axes of their own side and of the other.
HWY_INLINE void storeLanes(const PairFrames::Side& g, const V (&c)[3], const V (&h)[3], const V (&n)[3], V slab_center,
                           V slab_half, std::size_t i, Frame& f) {
  const D d;
  BOCST_UNROLL
  for (int j = 0; j < 3; ++j) {
    V cj = hn::Set(d, g.shift[j]), hj = hn::Zero(d), nj = hn::Zero(d);
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      const V r = hn::Set(d, g.to_other[j][k]);
      cj = hn::MulAdd(r, c[k], cj);
      nj = hn::MulAdd(r, n[k], nj);
      hj = hn::MulAdd(hn::Set(d, g.abs_to_other[j][k]), h[k], hj);
    }
    hn::Store(c[j], d, f.center[0][j] + i);
    hn::Store(h[j], d, f.half[0][j] + i);
    hn::Store(n[j], d, f.normal[0][j] + i);
    hn::Store(cj, d, f.center[1][j] + i);
    hn::Store(hj, d, f.half[1][j] + i);
    hn::Store(nj, d, f.normal[1][j] + i);
  }
  hn::Store(slab_center, d, f.slab_center + i);
  hn::Store(slab_half, d, f.slab_half + i);
}

// Writes the volumes of eight octants of sides `length`, of which the first has its corner at `corner`, in such sides,
// from the middle of the root.
HWY_INLINE void decode(const PairFrames::Side& g, const bounds::OctantBounds& octants, const float (&corner)[3],
                       float length, Frame& f) {
  const D d;
  const V half_step = hn::Set(d, codec::halfStep(length)), side = hn::Set(d, length),
          half_side = hn::Set(d, -0.5f * length);
  for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
    V c[3], h[3], n[3], offset, slab_half;
    codec::decodeSlab(octants, i, codec::cellSlabUnit(length), offset, slab_half);
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      V from_middle;
      codec::decodeBox(octants, k, i, half_side, half_step, from_middle, h[k]);
      const V middle = hn::Add(hn::Set(d, corner[k] + 0.5f), hn::Load(d, kOctantCorner[k] + i));
      c[k] = hn::MulAdd(middle, side, from_middle);
      n[k] = codec::decodeNormal(octants, k, i);
      // The slab is given from the octant's middle and wanted from its box's.
      offset = hn::NegMulAdd(n[k], from_middle, offset);
    }
    storeLanes(g, c, h, n, offset, slab_half, i, f);
  }
}

// Writes the volumes of a loose block. Whole numbers and powers of two are exact: a middle is off by 9 u Q.
HWY_INLINE void decodeLoose(const PairFrames::Side& g, const bounds::LooseFrame& frame,
                            const bounds::OctantBounds& octants, Frame& f) {
  const D d;
  const float slab_unit = codec::looseSlabUnit(static_cast<float>(frame.longest()) * g.unit);
  V corner[3], half_step[3];
  BOCST_UNROLL
  for (std::size_t k = 0; k < 3; ++k) {
    corner[k] = hn::Set(d, static_cast<float>(frame.origin[k] - lattice::kMiddle) * g.unit);
    half_step[k] = hn::Set(d, codec::halfStep(static_cast<float>(frame.side(k)) * g.unit));
  }
  for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
    V c[3], h[3], n[3], slab_center, slab_half;
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      codec::decodeBox(octants, k, i, corner[k], half_step[k], c[k], h[k]);
      n[k] = codec::decodeNormal(octants, k, i);
    }
    codec::decodeSlab(octants, i, slab_unit, slab_center, slab_half);
    storeLanes(g, c, h, n, slab_center, slab_half, i, f);
  }
}

template <typename Position>
HWY_INLINE void decodeCell(const PairFrames& g, int own, int level, const Position& at,
                           const bounds::OctantBounds& octants, Frame& f) {
  const int middle = 1 << (level - 1);
  float corner[3];
  BOCST_UNROLL
  for (int k = 0; k < 3; ++k) corner[k] = static_cast<float>(2 * static_cast<int>(at[k]) - middle);
  const int side = 1 << (lattice::kMaxLevel - 1 - level);
  decode(g.side[own], octants, corner, static_cast<float>(side) * g.side[own].unit, f);
}

HWY_INLINE void decodeBlock(const PairFrames& g, int own, const tree::Block& block, Frame& f) {
  if (block.isLoose()) {
    decodeLoose(g.side[own], block.frame(), block.octants, f);
  } else {
    decodeCell(g, own, block.shape, block.at, block.octants, f);
  }
}

HWY_INLINE void decodeRoot(const PairFrames& g, int own, const bounds::NodeBounds& bounds, Frame& f) {
  bounds::OctantBounds root;
  root.fill(bounds);
  const float corner[3] = {-0.5f, -0.5f, -0.5f};
  decode(g.side[own], root, corner, 2 * static_cast<float>(lattice::kMiddle) * g.side[own].unit, f);
}

// Writes the centres of some spheres, in their own frame and in the other.
HWY_INLINE void turnSpheres(const SideFrame& g, const V (&c)[3], std::size_t i, SphereFrame& f) {
  const D d;
  BOCST_UNROLL
  for (int j = 0; j < 3; ++j) {
    V cj = hn::Set(d, g.shift[j]);
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) cj = hn::MulAdd(hn::Set(d, g.to_other[j][k]), c[k], cj);
    hn::Store(c[j], d, f.center[0][j] + i);
    hn::Store(cj, d, f.center[1][j] + i);
  }
}

// Writes the spheres of the octants of a cell, as TreeSide::sphere() has them. Whole lattice units are exact.
template <typename Position>
HWY_INLINE void decodeSpheres(const SideFrame& g, const CellTree& tree, int level, const Position& at, SphereFrame& f) {
  constexpr float kHalfDiagonal = 0.8660254f;   // of a cube of side 1
  constexpr float kClippedFactor = 1.4142136f;  // see TreeSide::sphere()
  const D d;
  const std::int32_t length = 1 << (lattice::kMaxLevel - 1 - level);
  std::int32_t corner[3], end[3];  // of the first octant and of the regions, from the middle of the root
  bool whole = true;
  BOCST_UNROLL
  for (int k = 0; k < 3; ++k) {
    corner[k] = static_cast<std::int32_t>(at[k]) * (2 * length) - lattice::kMiddle;
    end[k] = static_cast<std::int32_t>(tree.extent[k]) - lattice::kMiddle;
    whole &= corner[k] + 2 * length <= end[k];
  }
  const V size = hn::Set(d, static_cast<float>(length)), half_unit = hn::Set(d, 0.5f * g.unit);
  V c[3];
  if (whole) {
    const V radius = hn::Set(d, static_cast<float>(length) * g.unit * kHalfDiagonal);
    for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
      BOCST_UNROLL
      for (int k = 0; k < 3; ++k) {
        const V twice = hn::MulAdd(hn::Load(d, kOctantCorner[k] + i), hn::Set(d, static_cast<float>(2 * length)),
                                   hn::Set(d, static_cast<float>(2 * corner[k] + length)));
        c[k] = hn::Mul(twice, half_unit);
      }
      turnSpheres(g, c, i, f);
      hn::Store(radius, d, f.radius + i);
    }
    return;
  }
  const bool leaves = static_cast<std::uint32_t>(level) + 1 >= tree.deepest;
  const V of_clipped = hn::Set(d, leaves ? 1.0f : kClippedFactor);
  for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
    V squared = hn::Zero(d), least = size;
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      const V low = hn::MulAdd(hn::Load(d, kOctantCorner[k] + i), size, hn::Set(d, static_cast<float>(corner[k])));
      const V high = hn::Min(hn::Add(low, size), hn::Set(d, static_cast<float>(end[k]))), extent = hn::Sub(high, low);
      least = hn::Min(least, extent);
      squared = hn::MulAdd(extent, extent, squared);
      c[k] = hn::Mul(hn::Add(low, high), half_unit);
    }
    const V factor = hn::IfThenElse(hn::Lt(least, size), of_clipped, hn::Set(d, 1.0f));
    turnSpheres(g, c, i, f);
    hn::Store(hn::Mul(hn::Mul(hn::Sqrt(squared), half_unit), factor), d, f.radius + i);
  }
}

// The octants from i on of frame f beside the volume in lane l of frame y, of the other side: displacements from the
// octants' middles to the volume's along the axes of [0] the octants' side, and by how much the boxes overlap along the
// axis where that is least; below 0 they are apart.
struct FaceGaps {
  V displacement[2][3], least;
};

HWY_INLINE FaceGaps faceGaps(const Frame& f, std::size_t i, const Frame& y, std::size_t l, V rounding_margin) {
  const D d;
  FaceGaps gaps;
  V extent[2][3];
  BOCST_UNROLL
  for (int s = 0; s < 2; ++s) {
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      gaps.displacement[s][k] = hn::Sub(hn::Set(d, y.center[1 - s][k][l]), hn::Load(d, f.center[s][k] + i));
      const V both = hn::Add(hn::Load(d, f.half[s][k] + i), hn::Set(d, y.half[1 - s][k][l]));
      extent[s][k] = hn::Sub(both, hn::Abs(gaps.displacement[s][k]));
    }
  }
  gaps.least = hn::Add(hn::Min(hn::Min(hn::Min(extent[0][0], extent[0][1]), hn::Min(extent[0][2], extent[1][0])),
                               hn::Min(extent[1][1], extent[1][2])),
                       rounding_margin);
  return gaps;
}

// By how much the octants from i on overlap the volume along the slab normal of either, the lesser; below 0 they are
// apart. For z in a box with |m.z - offset| <= w, any a gives n.z in a * offset +- (|a| w + |n - a m| over the box).
HWY_INLINE V slabOverlap(const Frame& f, std::size_t i, const Frame& y, std::size_t l, const V (&displacement)[2][3],
                         V rounding_margin) {
  const D d;
  const V x_center = hn::Load(d, f.slab_center + i), x_half = hn::Load(d, f.slab_half + i);
  const V y_center = hn::Set(d, y.slab_center[l]), y_half = hn::Set(d, y.slab_half[l]);
  V n[3], m[3], along = hn::Zero(d);
  BOCST_UNROLL
  for (int k = 0; k < 3; ++k) {
    n[k] = hn::Load(d, f.normal[1][k] + i);
    m[k] = hn::Set(d, y.normal[0][k][l]);
    along = hn::MulAdd(n[k], m[k], along);
  }
  const V abs_along = hn::Abs(along);
  V t = hn::MulSub(along, y_center, x_center), r = hn::MulAdd(abs_along, y_half, hn::Add(x_half, rounding_margin));
  BOCST_UNROLL
  for (int k = 0; k < 3; ++k) {
    t = hn::MulAdd(n[k], displacement[1][k], t);
    r = hn::MulAdd(hn::Set(d, y.half[0][k][l]), hn::Abs(hn::NegMulAdd(along, m[k], n[k])), r);
  }
  const V first = hn::Sub(r, hn::Abs(t));
  t = hn::NegMulAdd(along, x_center, y_center);
  r = hn::MulAdd(abs_along, x_half, hn::Add(y_half, rounding_margin));
  BOCST_UNROLL
  for (int k = 0; k < 3; ++k) {
    const V mk = hn::Set(d, y.normal[1][k][l]);
    t = hn::MulAdd(mk, displacement[0][k], t);
    r = hn::MulAdd(hn::Load(d, f.half[0][k] + i), hn::Abs(hn::NegMulAdd(along, hn::Load(d, f.normal[0][k] + i), mk)),
                   r);
  }
  return hn::Min(first, hn::Sub(r, hn::Abs(t)));
}

// Bit o is set unless octant o of frame f is surely apart from the volume in lane l of frame y, of the other side, by
// one of eight axes: the faces of both boxes and both slab normals. No edge axes: with slabs they gain nothing. Bits of
// octants that are not in `octants` are 0. `order`, unless null: see StepGroup; the overlap is the least of all axes.
HWY_INLINE unsigned overlapping(const PairFrames& g, const Frame& f, const Frame& y, std::size_t l, unsigned octants,
                                std::uint32_t* order) {
  const D d;
  const hn::RebindToUnsigned<D> du;
  const V rounding_margin = hn::Set(d, g.rounding_margin), slab_rounding_margin = hn::Set(d, g.slab_rounding_margin);
  unsigned result = 0;
  for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
    const FaceGaps gaps = faceGaps(f, i, y, l, rounding_margin);
    const V least = hn::Min(gaps.least, slabOverlap(f, i, y, l, gaps.displacement, slab_rounding_margin));
    const M apart = hn::Lt(least, hn::Zero(d));
    const M left = hn::AndNot(apart, maskOf(d, octants >> i));
    if (order != nullptr) {
      const auto depth =
          hn::Or(hn::And(hn::BitCast(du, least), hn::Set(du, ~7u)), hn::Iota(du, static_cast<std::uint32_t>(i)));
      hn::StoreU(depth, du, order + i);
    }
    result |= bitsOf(d, left) << i;
  }
  return result;
}

}  // namespace bocst::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
