// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "geometry/overlap_kernels.h"
#include "query/cull/frames.h"
#include "tree/block.h"

// What a distance query computes in float, eight at once: bounds only, never the answer.

namespace bocst::query {

/// Fills the frame with the octants of a block of side `own`.
void fillFrame(const PairFrames& geometry, int own, const tree::Block& block, Frame& frame);
/// Fills lane 0 of the frame with the root of side `own`.
void fillFrame(const PairFrames& geometry, int own, const bounds::NodeBounds& root, Frame& frame);

/// Eight boxes and slabs of one side, along the axes of its frame, as Frame has them at [0].
struct LaneVolumes {
  alignas(64) float center[3][8];
  float half[3][8], normal[3][8], slab_center[8], slab_half[8];
};
/// Fills the frame with lanes of side `own`.
void fillFrame(const PairFrames& geometry, int own, const LaneVolumes& lanes, Frame& frame);

/// The leaves of a side with conservative answers: cells of this side, cut off where the actual regions end.
struct LeafCells {
  std::int32_t side;                   ///< Lattice units.
  std::array<std::int32_t, 3> extent;  ///< Where the actual regions end, see Lattice.
};
/// What bytes and an oracle round is a smaller part of a leaf's cell.
constexpr float kPartOfCell = 1.0f / 16;

/// The same frames of such a side, but the boxes and slabs bound the centres of the leaves' spheres instead of the
/// surface. The cell of each leaf meets the surface in the node's box and slab, so these say which cells are leaves:
/// boxes of whole cells, without rounding; and slabs that are thicker by half a cell on either side.
void fillCenters(const PairFrames& geometry, int own, const tree::Block& block, const LeafCells& leaves, Frame& frame);
void fillCenters(const PairFrames& geometry, int own, const bounds::NodeBounds& root, const LeafCells& leaves,
                 Frame& frame);

/// A direction in the frames of both sides, of unit length or zero.
struct FrameDirection {
  float in[2][3] = {};
};

/// How far eight lanes are from a node of the other side, in lattice units of side 0.
struct LaneGaps {
  alignas(64) float at_least[8];
  alignas(64) float at_most[8];  ///< Some point of the one is no farther from some point of the other.
};

/// Along the faces of both boxes, both slabs' normals, the line of the middles and `direction`, which should be where
/// the nearest points are expected. The lanes are those of frame f, side `own`; the node is lane `lane` of frame y.
///
/// With M and u as at PairFrames, a gap along a direction of unit length: the way between centres is off by 59 u M and
/// its sum by 7; each of two reaches by 72, as the slab test's; the two spellings of the direction by 16: 226 u M,
/// which is less than 2 * slab_rounding_margin. That is taken off, and 8 u of the gap for the direction's length.
void laneGaps(const PairFrames& geometry, int own, const Frame& f, const Frame& y, std::size_t lane,
              const FrameDirection& direction, LaneGaps& gaps);

/// Raises at_least of eight lanes beside a leaf of the other side to the gap of the nearest of its
/// triangles, whose bounds are in the frame of the lanes, at most a pack of them: where these are large, the leaf's
/// volume says little.
///
/// Along the axes, the triangle's normal and those of its edges in its plane. With M and u as at PairFrames, a gap
/// along an axis of unit sum is off by 45 u M: a centre by 9, an extent and a slab's offset by 11, sums by 8, a bound
/// by 1, the slab's normal by 16; such an axis is no shorter than 0.57. 2 * slab_rounding_margin, 320 u M, is taken
/// off, and 64 u of the gap because axes are at right angles but for rounding.
void triangleGaps(const PairFrames& geometry, const Frame& f, const TriangleBounds& triangles, std::size_t count,
                  LaneGaps& gaps);

/// Two triangles that may be the nearest.
struct NearPair {
  float at_least;  ///< They are no nearer than this.
  std::uint8_t row, lane;
};

/// Writes the pairs (a triangle of rows, a triangle of lanes) that may be less than `cutoff` apart, at most rows.count
/// * lanes.count of them; unless `all` are wanted, only those that may be the nearest. Returns how many. `direction` is
/// a unit vector from rows to lanes, where the nearest points are expected, or zero.
///
/// A triangle pair is at least as far apart as along any direction: those of both normals and that between the nearest
/// points of their edges, found by sloppy arithmetic, are looked at; one of them is exact but for rounding. Nine edge
/// pairs find vertices too. With M the larger size of the packs and u = 2^-24, corners are off by u M and a corner's
/// projection on a unit vector by 7 u M more: 18 u M for a gap; 32 u M is taken off.
std::size_t nearPairs(const TrianglePack& rows, const TrianglePack& lanes, const float direction[3], float cutoff,
                      bool all, NearPair* pairs);

}  // namespace bocst::query
