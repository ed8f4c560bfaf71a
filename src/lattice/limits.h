// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>

namespace bocst {

/// Exact answers test the triangles of a node with at most so many rather than expanding it. Kernels hold one leaf in a
/// pack and have a bit for each of its triangles, so their masks' type is LeafMask.
constexpr std::size_t kMaxLeafTriangles = 32;
using LeafMask = std::uint32_t;
static_assert(8 * sizeof(LeafMask) >= kMaxLeafTriangles, "a bit for each triangle of a leaf");
static_assert(kMaxLeafTriangles % 16 == 0, "kernels fill whole vectors of floats of any instruction set");

}  // namespace bocst
