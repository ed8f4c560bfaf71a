// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

namespace bocst {

/// Exact answers test the triangles of a node that has at most this many instead of expanding it. Kernels hold one leaf
/// in a pack.
constexpr std::size_t kMaxLeafTriangles = 32;
static_assert(kMaxLeafTriangles <= 32, "a mask has a bit of a std::uint32_t for each triangle of a leaf");
static_assert(kMaxLeafTriangles % 16 == 0, "kernels fill whole vectors of floats of any instruction set");

}  // namespace bocst
