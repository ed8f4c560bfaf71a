// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>

#include <cstddef>
#include <cstdint>
#include <vector>

namespace bocst::program {

/// A mesh as a page shows it: corners on a grid of 2^16 steps over a cube about the middle of its bounds.
struct DisplayMesh {
  std::vector<std::uint16_t> positions;  ///< x, y, z of each vertex.
  std::vector<std::uint32_t> indices;    ///< Three a triangle.

  std::size_t triangles() const { return indices.size() / 3; }
};

/// The side of that cube: the largest extent, or 1 for a mesh without extent.
double displaySize(const Mesh& mesh);

/// The finest mesh of at most `limit` triangles that joining all vertices of a cell of 2^-k of the cube gives.
/// Triangles that this turns into a segment or a point are left out.
DisplayMesh displayMesh(const Mesh& mesh, std::size_t limit);

}  // namespace bocst::program
