// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "geometry/volume.h"

namespace bocst::query {

/// The volumes of eight octants as both sides of a pair see them: [0] along the axes of their own side and [1] along
/// those of the other, in lattice units of side 0 about the middle of each side's root. Structure of arrays: lane o is
/// octant o.
struct alignas(64) Frame {
  float center[2][3][8];  ///< Middle of the box.
  float half[2][3][8];    ///< Half extents of the box [0] or of what holds it [1].
  float normal[2][3][8];  ///< Of the slab, about unit length; zero: no slab.
  float slab_center[8];   ///< Middle of the slab along normal, from center.
  float slab_half[8];
};

/// The spheres of eight octants as both sides of a pair see them, as in Frame.
struct alignas(64) SphereFrame {
  float center[2][3][8];
  float radius[8];
};

/// What the spheres of a tree's cells depend on beside their places.
struct CellTree {
  std::uint32_t extent[3];  ///< Where the actual regions end.
  std::uint32_t deepest;    ///< The level of the leaves.
};

/// From the frame of a side to that of the other, in float: coordinates are in lattice units of side 0 about the middle
/// of each side's root.
struct SideFrame {
  float unit;            ///< A lattice unit, in those of side 0.
  float shift[3];        ///< Coordinates in the other frame are to_other * own coordinates + shift.
  float to_other[3][3];  ///< Rows.
};

/// Sets the frames of both sides; returns how far the middles of their roots are apart.
double placeSides(const SimilarityTransform& one_in_zero, SideFrame& zero, SideFrame& one);

/// From the frame of each of two trees to that of the other, in float, and the rounding margins that this needs.
///
/// With u = 2^-24 and M = |t| + sqrt(3) (Q0 + Q1), Q half a root's side, no coordinate is larger than M. A centre is
/// off by 9 u Q in its own frame (an octant's by 6: bytes to units 4, corner 2; a loose lane's by 9: unit 1, origin 1,
/// bytes to units 2 and product 1 of twice the length, sum 1) and by 14 u M in the other (that turned, rotation 1, sums
/// 4); an extent by 7 u M. Two centres, two extents and the comparison: 48 u M, which `rounding_margin` takes. Along a
/// normal (length below 1.01, off by 10 u an entry) the way between centres is off by 48 u M, 18 by the normal and 9 by
/// sums; offsets 11; the radius 38 by the normals and 15 by sums: 139 u M; `slab_rounding_margin` takes 160. Added to
/// both are the tolerance and 4 M (8 M for slabs) times the orthogonality error.
///
/// What sees octants in their own frame only, along axes whose entries' sizes sum up to 1, is off by less: see
/// octantsMeeting().
struct PairFrames {
  explicit PairFrames(const SimilarityTransform& one_in_zero);

  /// Beyond these, one side's rounding is too coarse for the other's nodes.
  static bool fits(double scale) { return scale >= 0x1p-10 && scale <= 0x1p10; }

  /// True if bounds of distances in float are worth it: the rounding margin is a small part of the smaller side, which
  /// has so many triangles. Else many of these are equally near, as far as float can tell.
  static bool isFine(const SimilarityTransform& one_in_zero, std::size_t triangles_of_smaller);

  struct Side : SideFrame {
    float abs_to_other[3][3];
    float rounding_margin;  ///< Of tests in the octants' own frame: 128 u Q, and the same.
  };
  Side side[2];
  float rounding_margin, slab_rounding_margin;
};

}  // namespace bocst::query
