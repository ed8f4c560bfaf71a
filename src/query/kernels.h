// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>

#include "oracle/oracle.h"

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
  float pad;               ///< Covers all rounding, see separatedOctants().
};

/// Bit o is set unless octant o is surely separated from the volume, by one of eight axes: the faces of both boxes, the
/// slab normal of the octant and that of the volume. No edge axes: with slabs they gain nothing.
///
/// Every axis projects with sums of at most 24 terms, each rounded at most 4 times and, with Q = |center|_1 + |half|_1
/// + |slab_offset| + slab_half + 4, at most Q in size; so an error is at most 96 Q 2^-24 and volumes must be given with
/// pad >= 128 Q 2^-24, to which the caller adds what its own coordinates are off by.
std::uint8_t overlappingOctants(const oracle::OctantBounds& octants, const OneVolume& volume);

/// Corners of up to kCapacity triangles as structure of arrays, in one frame, near the origin.
struct TrianglePack {
  static constexpr std::size_t kCapacity = 32;
  alignas(64) float xyz[9][kCapacity];  ///< Coordinate c of corner k at [3 * k + c].
  std::size_t count = 0;
  float size = 0;  ///< Largest coordinate, in absolute value.
};

/// Corners as given, to be placed: coordinate c of corner k at [3 * k + c].
struct RawTriangles {
  alignas(64) double xyz[9][TrianglePack::kCapacity];
};

/// Corners are linear * v + offset: computed in double, rounded once.
struct PackPlacement {
  double linear[3][3];
  double offset[3];
};

/// Fills the pack with `count` triangles, 1 to kCapacity. What is in `raw` beyond is overwritten.
void placeTriangles(RawTriangles& raw, std::size_t count, const PackPlacement& place, TrianglePack& pack);

/// Two triangles that may touch, as positions in their packs.
struct PackPair {
  std::uint8_t row, lane;
};

/// Writes the pairs (a triangle of rows, a triangle of lanes) that are not surely apart, by their boxes, their planes
/// and their edges' cross products; at most rows.count * lanes.count. Returns how many. `slack` is a distance that
/// still counts as touching: what the caller's coordinates are off by.
///
/// With M the larger size of the packs and u = 2^-24: corners are rounded by u M; a plane's equation by 16 u M times
/// the sizes of its products before they cancel; an edge axis likewise. The pads are 32 u M times those sizes.
std::size_t touchingPairs(const TrianglePack& rows, const TrianglePack& lanes, float slack, PackPair* pairs);

}  // namespace bocst::query
