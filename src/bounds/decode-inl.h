// SPDX-License-Identifier: BSD-3-Clause
// Decodes the bounds of eight nodes, once for each instruction set; see Highway's -inl.h headers. Lanes i and up, as
// many as a vector has; lengths come out in the unit of what is given.
#if defined(BOCST_BOUNDS_DECODE_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BOCST_BOUNDS_DECODE_INL_H
#undef BOCST_BOUNDS_DECODE_INL_H
#else
#define BOCST_BOUNDS_DECODE_INL_H
#endif

#include "bounds/node_bounds.h"
#include "simd/octants-inl.h"

HWY_BEFORE_NAMESPACE();
namespace bocst::bounds::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using query::HWY_NAMESPACE::D;
using query::HWY_NAMESPACE::fromBytes;
using query::HWY_NAMESPACE::V;

/// Half a step of a box, and the unit of a slab, in a frame of this side. Of a loose frame, its slabs' unit is that of
/// the longest side.
HWY_INLINE float halfStep(float side) { return side * (0.5f / kBoxSteps); }
HWY_INLINE float cellSlabUnit(float side) { return side * (1.0f / kCellSlabSteps); }
HWY_INLINE float looseSlabUnit(float longest_side) { return longest_side * (1.0f / kLooseSlabSteps); }

/// Along one axis: the middles of the boxes, where the frames' corners are at `corner`, and half their extents.
HWY_INLINE void decodeBox(const OctantBounds& b, int axis, std::size_t i, V corner, V half_step, V& middle, V& half) {
  const D d;
  const V lo = fromBytes(d, b.lo[axis] + i), hi = fromBytes(d, b.hi[axis] + i);
  middle = hn::MulAdd(hn::Add(lo, hi), half_step, corner);
  half = hn::Mul(hn::Sub(hi, lo), half_step);
}

/// Coordinate `axis` of the slabs' normals, of about unit length.
HWY_INLINE V decodeNormal(const OctantBounds& b, int axis, std::size_t i) {
  const D d;
  return hn::Mul(fromBytes(d, b.normal[axis] + i), hn::Set(d, 1.0f / kNormalLength));
}

/// The middles of the slabs along the normals, from where the frame's slabs count from, and half their thicknesses.
HWY_INLINE void decodeSlab(const OctantBounds& b, std::size_t i, float unit, V& center, V& half) {
  const D d;
  center = hn::Mul(fromBytes(d, b.slab_center + i), hn::Set(d, unit));
  half = hn::Mul(fromBytes(d, b.slab_half + i), hn::Set(d, unit / 2));
}

}  // namespace bocst::bounds::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
