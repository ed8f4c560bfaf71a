// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>

namespace bocst::tree {

/// Coordinate c of corner k of triangles, one row for each (k, c) at [3 * k + c]; whole vectors of 16 may be read.
struct CornerRows {
  const float* row[9];
};

/// Adds up twice the areas of triangles begin to begin + count - 1, as vectors along their normals; each is turned
/// towards the side of the first that has one, since neighbours need not agree on which side is out.
void sumNormals(const CornerRows& corners, std::size_t begin, std::size_t count, float (&sum)[3]);

/// The least and the most of n . p over the corners p of triangles begin to begin + count - 1.
void extremesAlong(const CornerRows& corners, std::size_t begin, std::size_t count, const float (&n)[3], float& least,
                   float& most);

}  // namespace bocst::tree
