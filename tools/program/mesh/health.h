// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace bocst::program {

/// An edge that is not between two triangles that agree.
struct FaultyEdge {
  std::array<std::uint32_t, 2> vertices;  ///< Of several with the same coordinates, the first.
  std::vector<std::uint32_t> triangles;   ///< All that have this edge.
};

/// Where a mesh is faulty: the first of each kind.
struct Faults {
  static constexpr std::size_t kMost = 100000;  ///< Of a kind.

  std::vector<FaultyEdge> open_edges, non_manifold_edges, flipped_edges;
  std::vector<std::uint32_t> degenerate_triangles, duplicate_triangles;
  std::vector<std::uint32_t> repeated_vertices, unused_vertices;
};

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

  Faults faults;  ///< Where; counts above are of all.

  bool watertight() const { return open_edges == 0 && non_manifold_edges == 0; }
  bool oriented() const { return flipped_edges == 0; }
};

Health healthOf(const Mesh& mesh);

/// Calls f(name, number of all, the first ones) for each kind of fault.
template <typename F>
void forEachFault(const Health& health, F&& f) {
  f("open edges", health.open_edges, health.faults.open_edges);
  f("non-manifold edges", health.non_manifold_edges, health.faults.non_manifold_edges);
  f("flipped edges", health.flipped_edges, health.faults.flipped_edges);
  f("degenerate triangles", health.degenerate_triangles, health.faults.degenerate_triangles);
  f("duplicate triangles", health.duplicate_triangles, health.faults.duplicate_triangles);
  f("repeated vertices", health.repeated_vertices, health.faults.repeated_vertices);
  f("unused vertices", health.unused_vertices, health.faults.unused_vertices);
}

/// What is to be marked where faults are shown: pairs of vertices, those of faulty edges and of the edges of degenerate
/// and duplicate triangles.
std::vector<std::pair<std::size_t, std::size_t>> faultLines(const Faults& faults, const Mesh& mesh);

}  // namespace bocst::program
