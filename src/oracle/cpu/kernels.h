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

/// out[3 * i + k] = (in[3 * i + k] - origin[k]) * scale, rounded down, no less than 1 and no more than `most`.
void quantise(const double* in, std::size_t count, const double* origin, double scale, std::int16_t most,
              std::int16_t* out);

/// Where a triangle's box, widened by one step on each side, lies in a grid of 2^bits cells along each axis over 2^15
/// steps: in the low 3 * bits bits the number of the cell of its minimum corner (x, then y, then z from low to high);
/// above them a bit an axis, set where its maximum corner is in the next cell, and kGridSpanLarge of these, where it is
/// farther away. The upper half means nothing.
using GridSpan = std::uint64_t;
constexpr int kGridSpanBits = 15;
constexpr std::uint32_t kGridSpanLarge = 1u << 6;

/// The spans of `count` triangles between vertices that quantise() made, no more than 2^15 - 2; one value after the
/// last vertex is read, too. out: room for a multiple of 8. bits: 1 to 5.
void gridSpans(const std::int16_t* vertices, const std::uint32_t* indices, std::size_t count, int bits, GridSpan* out);

/// Bit i % 8 of bits[i / 8]: is values[i] another value than this? count: a multiple of 8.
void bitsOfOthers(const std::uint32_t* values, std::size_t count, std::uint32_t value, std::uint8_t* bits);

/// back[i] = first + i - from[i], modulo 2^32 and then as a signed number, no less than 0 and no more than 65535. Whole
/// vectors of eight are read and written. Returns whether any is 65535, one beyond the last perhaps.
bool stepsBack(const std::uint32_t* from, std::uint32_t first, std::size_t count, std::uint16_t* back);

/// The instruction set in use, for people.
const char* instructionSet();

}  // namespace bocst::oracle
