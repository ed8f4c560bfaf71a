// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>

#include <array>
#include <cstddef>
#include <cstdint>

#include "lattice/limits.h"

namespace bocst::tree {

/// Coordinate c of corner k of triangles, one row for each (k, c) at [3 * k + c]; whole vectors of 16 may be read.
struct CornerRows {
  const float* row[9];
};

/// The last entries are not used.
struct TriangleBox {
  float lo[4], hi[4];
};

/// Box of the corners of some triangles, and twice the sum of their areas as vectors along their normals.
struct PieceBounds {
  float lo[4], hi[4];  ///< The last entries are not used.
  float normal[3];
};

/// Pieces of the triangles, and rows of the middles and half the sides of their boxes: coordinate c of piece i at
/// [c * stride + i]. Whole vectors of 16 may be read of these; boxes beyond the last piece have negative sides.
struct BoundedPieces {
  const std::array<std::uint32_t, 2>* piece;  ///< The first triangle, and how many.
  std::size_t count, stride;
  const float *center, *half;
};

/// The triangle `id`, and where the middle of its box lies along a Z-order curve.
struct SortKey {
  std::uint32_t code, id;
};

/// Where cells of the curve lie: 2^bits along each axis from `corner` on, 1 / scale long.
struct CurveCells {
  float corner[3];
  float scale;
  int bits;  ///< 10 at most.
};

/// Keys of `count` triangles; `places` has four floats for each vertex, the last of them any number.
void curveKeys(const Mesh::Indices* indices, std::size_t count, const float* places, const CurveCells& cells,
               SortKey* keys);

/// Fills `ids` with the triangles in the order of `count` keys, and `boxes` with their boxes.
void boxTriangles(const Mesh::Indices* indices, const float* places, const SortKey* keys, std::size_t count,
                  std::uint32_t* ids, TriangleBox* boxes);

/// Fills row r of corners at rows + r * stride with the triangles `ids`; whole vectors of 4 may be written.
void gatherCorners(const Mesh::Indices* indices, const float* places, const std::uint32_t* ids, std::size_t count,
                   float* rows, std::size_t stride);

/// Bounds of triangles begin to begin + count - 1. Normals are turned towards the side of the first that has one, since
/// neighbours need not agree on which side is out.
PieceBounds boundPiece(const CornerRows& corners, std::size_t begin, std::size_t count);

/// The least and the most of n . p over the corners p of triangles begin to begin + count - 1.
void extremesAlong(const CornerRows& corners, std::size_t begin, std::size_t count, const float (&n)[3], float& least,
                   float& most);

/// A grid on which corners are counted in steps: whole lattice units from the mesh's, and a power of two.
struct LeafGrid {
  float origin[3];
  float step;
};

/// Coordinate c of corner k of triangle i, in steps, at [3 * k + c][i]; whole vectors are written.
using CornerSteps = std::uint16_t[9][kMaxLeafTriangles + 16];

/// Puts the corners of triangles begin to begin + count - 1, at most kMaxLeafTriangles, on a grid of their own, with
/// `base` the lattice point that they are counted from. False where they would have less than 9 bits on the finest one.
bool stepsOnGrid(const CornerRows& corners, std::size_t begin, std::size_t count, const float (&base)[3],
                 LeafGrid& grid, CornerSteps& steps);

/// Corners of stepsOnGrid() are at most so large, so float rounds them by a quarter of the least step.
constexpr float kMostOnGrid = 33000, kLeastStep = 0x1p-7f;

/// The most of n . p over the corners p of all pieces. Pieces that cannot reach so far are spared.
float farthestAlong(const CornerRows& corners, const BoundedPieces& pieces, const float (&n)[3]);

}  // namespace bocst::tree
