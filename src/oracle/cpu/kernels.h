// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>

namespace bocst::oracle {

/// Corners of triangles as structure of arrays, coordinate c of corner k at xyz[3 * k + c], in the cell's own
/// coordinates: centre 0, half side 1. Rounded once from double.
struct LocalTriangles {
  static constexpr std::size_t kCapacity = 512;  ///< Also the alignment unit: kernels read whole vectors.
  alignas(64) float xyz[9][kCapacity];
};

/// For each of the first `count` triangles: bit o of masks[i] is set unless triangle i surely misses octant o.
///
/// The 13-axis separating test of all eight octants, for a vector of triangles a step, in float. With u = 2^-24 and
/// M = max(1, largest coordinate of the triangle): a margin of 16 u M on the half side covers the rounding of corners
/// (1 M), of edges, products and differences (4 (M + 1/2)) and of the radius (3/2), 8.5 M u at most; 24 u on the sizes
/// of the products in the plane equation before they cancel covers normal (4), point (1), product (1), sums (5).
/// Chosen at run time for the machine's instruction set; all choices keep these bounds, with or without fused
/// multiply-add.
/// `tolerance` is a distance that still counts as touching, for corners that are off by more than one rounding.
///
/// Coordinate c of corner k of triangle i is at xyz[(3 * k + c) * stride + i]; stride is a multiple of 8, xyz aligned
/// to as many floats.
void octantMasks(const float* xyz, std::size_t stride, std::size_t count, float tolerance, std::uint8_t* masks);
inline void octantMasks(const LocalTriangles& triangles, std::size_t count, float tolerance, std::uint8_t* masks) {
  octantMasks(triangles.xyz[0], LocalTriangles::kCapacity, count, tolerance, masks);
}

/// The instruction set in use, for people.
const char* instructionSet();

}  // namespace bocst::oracle
