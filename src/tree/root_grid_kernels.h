// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>

// The passes over all vertices and triangles that make a RootGrid. Chosen at run time for the machine's instruction
// set.

namespace bocst::tree {

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

/// Bit i % 8 of bits[i / 8] is 1 where values[i] is another value than this. count: a multiple of 8.
void bitsOfOthers(const std::uint32_t* values, std::size_t count, std::uint32_t value, std::uint8_t* bits);

/// back[i] = first + i - from[i], modulo 2^32 and then as a signed number, no less than 0 and no more than 65535. Whole
/// vectors of eight are read and written. Returns whether any is 65535, one beyond the last perhaps.
bool stepsBack(const std::uint32_t* from, std::uint32_t first, std::size_t count, std::uint16_t* back);

}  // namespace bocst::tree
