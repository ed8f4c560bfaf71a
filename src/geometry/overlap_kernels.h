// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>

#include "bounds/loose_frame.h"
#include "lattice/limits.h"

namespace bocst::query {

/// One node's volume seen from the eight octants of another: box AND slab, in coordinates with the minimum corner of
/// the other's cell at the origin and the side of its octants as unit.
struct OneVolume {
  float center[3];         ///< Of the box.
  const float (*axes)[3];  ///< axes[j]: unit vector of box axis j.
  float half[3];           ///< Half extents along axes[j].
  float normal[3];         ///< Of the slab, about unit length; zero: no slab.
  float slab_offset;       ///< Middle of the slab along normal, from center.
  float slab_half;         ///< Half its thickness.
  float rounding_margin;   ///< Covers all rounding, see overlappingOctants().
};

/// Bit o is set unless octant o is surely separated from the volume, by one of eight axes: the faces of both boxes, the
/// slab normal of the octant and that of the volume. No edge axes: with slabs they gain nothing.
///
/// Every axis projects with sums of at most 24 terms, each rounded at most 4 times and, with Q = |center|_1 + |half|_1
/// + |slab_offset| + slab_half + 4, at most Q in size; so an error is at most 96 Q 2^-24 and volumes must be given with
/// rounding margin >= 128 Q 2^-24, to which the caller adds what its own coordinates are off by.
std::uint8_t overlappingOctants(const bounds::OctantBounds& octants, const OneVolume& volume);

/// The same for the lanes of a loose block; the volume is given with the frame's origin at the origin and half its
/// longest side as unit.
std::uint8_t overlappingLanes(const bounds::LooseFrame& frame, const bounds::OctantBounds& lanes,
                              const OneVolume& volume);

/// Eight boxes with axes of their own, in one frame: coordinate or axis first, lane last.
struct OrientedBoxes {
  alignas(64) float center[3][8];
  float half[3][8];     ///< Half extents along the axes.
  float axes[3][3][8];  ///< axes[j][k]: entry k of unit axis j.
};

/// Bit i is set unless box i is surely separated from the volume, by one of seven axes: the faces of both boxes and the
/// slab normal of the volume, given in the frame of the boxes. Rounding margins as for overlappingOctants(), Q with the
/// largest |center|_1 + |half|_1 of the boxes in place of 4.
std::uint8_t overlappingBoxes(const OrientedBoxes& boxes, const OneVolume& volume);

/// Corners of up to kCapacity triangles as structure of arrays, in one frame, near the origin.
struct TrianglePack {
  static constexpr std::size_t kCapacity = kMaxLeafTriangles;
  alignas(64) float xyz[9][kCapacity];  ///< Coordinate c of corner k at [3 * k + c].
  std::size_t count = 0;
  float size = 0;  ///< Largest coordinate, in absolute value.
};

/// Corners as given, to be placed: coordinate c of corner k at [3 * k + c].
struct RawTriangles {
  alignas(64) double xyz[9][TrianglePack::kCapacity];
};

/// Corners are linear * v + offset: computed in double, rounded once.
struct PackTransform {
  double linear[3][3];
  double offset[3];
};

/// Fills the pack with `count` triangles, 1 to kCapacity. What is in `raw` beyond is overwritten.
void placeTriangles(RawTriangles& raw, std::size_t count, const PackTransform& place, TrianglePack& pack);

/// Where up to TrianglePack::kCapacity triangles are, for tests against boxes that are not larger than them: between
/// two bounds along each axis, along their normals, and behind their edges in their planes.
///
/// Directions are rounded to float first and the bounds computed along what they are then, so whatever a direction is,
/// its bounds hold. The sum of its entries' sizes is 1, or 0 where there is none.
struct TriangleBounds {
  static constexpr std::size_t kCapacity = TrianglePack::kCapacity;
  alignas(64) float low[3][kCapacity], high[3][kCapacity];
  float normal[3][kCapacity], normal_low[kCapacity], normal_high[kCapacity];
  float edge[3][3][kCapacity], edge_high[3][kCapacity];  ///< [edge]: out of the triangle; [axis].
};

/// Places those triangles in `which`, in double, and finds the bounds of what is placed, times `unit`, cut off at
/// `far`. Others may be overwritten by what `raw` has in their places.
void boundTriangles(const RawTriangles& raw, std::uint32_t which, const PackTransform& place, double unit, double far,
                    RawTriangles& placed, TriangleBounds& bounds);

/// Where triangles of a pack can meet those of another leaf: a box and a slab, all in the pack's frame and padded.
struct PackRegion {
  float low[3], high[3];
  float normal[3];            ///< Of the slab; zero: no slab.
  float slab_low, slab_high;  ///< Along normal.
};

/// Bit i is set unless triangle i is surely outside of the region.
std::uint32_t trianglesWithin(const TrianglePack& pack, const PackRegion& region);

/// Corners are linear * v + offset, in float.
struct PackMotion {
  float linear[3][3];
  float offset[3];
};

/// Fills `moved` with the triangles of `pack` in `which`, in that order. With s the largest sum of squares in a row of
/// linear, rooted, its size is at least B = sqrt(3) s pack.size + |offset|, and corners are off by no more than 6 u B:
/// the coordinates given, linear, offset and three sums of products.
void moveTriangles(const TrianglePack& pack, std::uint32_t which, const PackMotion& motion, TrianglePack& moved);

/// Two triangles that may touch, as positions in their packs.
struct PackPair {
  std::uint8_t row, lane;
  bool certain;  ///< They surely meet.
  float least;   ///< See touchingPairs().
};

/// Only pairs that may touch in a point whose coordinate along this direction, of any length, is at most so large are
/// wanted. In the frame of the packs.
struct PackCut {
  float direction[3];
  float most;
};

/// What bounds each triangle of a pack along a direction of its own, in the pack's frame. Computed in double: in float,
/// a plane through corners far away is known less well.
struct PackSlabs {
  alignas(64) float normal[3][TrianglePack::kCapacity];                  ///< Of unit length, but for rounding, or zero.
  float middle[TrianglePack::kCapacity], half[TrianglePack::kCapacity];  ///< Along normal; half covers its rounding.
};

/// Fills `rows` with the placed triangles in `which`, in that order, about `middle`, and `slabs` with theirs along the
/// normals of `bounds`. Coordinates are rounded once.
void takeRows(const RawTriangles& placed, const TriangleBounds& bounds, std::uint32_t which, const double (&middle)[3],
              TrianglePack& rows, PackSlabs& slabs);

/// Writes the pairs (a triangle of rows, of those in `which`, and a triangle of lanes) that are not surely apart, by
/// their boxes, their planes and where they cut the line of both planes; at most rows.count * lanes.count. Returns how
/// many. What the rows have outside of the box of `region` is not looked at. `tolerance` is a distance that still
/// counts as touching: what the caller's coordinates are off by. What is no farther apart than `margin` is certain to
/// touch; two corners are looked at for that. `one_will_do`: if a pair is found that is certain to touch, it alone is
/// written. `slabs`, if not null, are those of the rows, and take the place of their planes.
///
/// With M the larger size of the packs and u = 2^-24, corners are off by 6 u M along each axis.
///
/// Boxes and planes part alone: along a plane's normal, corners and the dot products' rounding are off by 34 u M times
/// its length, and the equation by 12 u M times the sizes of its products before they cancel. The rounding margin is 64
/// u M + tolerance times those sizes.
///
/// Else a pair is certain to meet, or to be apart, when it is however the corners of both were moved, by s = 25 u M +
/// tolerance in sum. Let E and F be the longest edges, each more than 64 s, G the longer, W no less than a way between
/// corners. Determinants of two edges of one triangle and a way change by s (4 E W + E^2) to first order, those of an
/// edge of each and a way by s (2 G W + E F), and both by less than a tenth more; rounding is 42 u times the three
/// lengths. Where the former are more, all corners are on known sides of the other's plane; so are the ends of the
/// intervals in which the two cut the line of both planes to each other, by the latter.
///
/// With slabs, corners of lanes are on known sides where they are off the slab by 12 u m + tolerance, m the size of the
/// lanes. A pair is certain to meet only where the former hold for the row, too, with the tolerance for s, and its
/// normal is no less than 1e-3 E^2.
///
/// `cut`: not null only if the margin is 0. Then `least` is a lower bound, along its direction, of all points in which
/// the two touch, and pairs beyond it are left out. An edge with ends at heights g > 0 and h < 0 from a plane, both
/// off by less than e, crosses it at g / (g
/// - h) of its length, off by less than e / (g - h).
std::size_t touchingPairs(const TrianglePack& rows, std::uint32_t which, const TrianglePack& lanes,
                          const PackRegion& region, float tolerance, float margin, bool one_will_do, PackPair* pairs,
                          const PackSlabs* slabs = nullptr, const PackCut* cut = nullptr);

}  // namespace bocst::query
