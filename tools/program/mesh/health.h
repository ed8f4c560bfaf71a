// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>

#include <cstddef>

namespace bocst::program {

/// What is well with a mesh as a surface, and what is not. Vertices with equal coordinates count as one, so meshes
/// whose triangles keep their own corners are judged by their shape.
struct Health {
  std::size_t components = 0;            ///< Pieces; triangles that share a vertex are in one piece.
  std::size_t open_edges = 0;            ///< Edges of one triangle.
  std::size_t non_manifold_edges = 0;    ///< Edges of more than two triangles.
  std::size_t flipped_edges = 0;         ///< Edges of two triangles that run along it in the same direction.
  std::size_t degenerate_triangles = 0;  ///< Without area, up to rounding; those with three corners keep their edges.
  std::size_t duplicate_triangles = 0;   ///< The corners of a triangle before, in any order.
  std::size_t repeated_vertices = 0;     ///< The coordinates of a vertex before.
  std::size_t unused_vertices = 0;       ///< In no triangle.
  double area = 0;                       ///< Square of the mesh's length unit.
  double volume = 0;                     ///< Signed; only where watertight() and oriented(). Negative: inside out.

  bool watertight() const { return open_edges == 0 && non_manifold_edges == 0; }
  bool oriented() const { return flipped_edges == 0; }
};

Health healthOf(const Mesh& mesh);

}  // namespace bocst::program
