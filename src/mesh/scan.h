// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>

namespace bocst {

/// Widens lo and hi by `count` points, three coordinates each. False when a coordinate is NaN or larger than `most` in
/// size; lo and hi then say nothing.
bool widenByPoints(const double* points, std::size_t count, double most, double lo[3], double hi[3]);

/// The largest of the values; 0 of none.
std::uint32_t largest(const std::uint32_t* values, std::size_t count);

bool contains(const std::uint32_t* values, std::size_t count, std::uint32_t value);

}  // namespace bocst
