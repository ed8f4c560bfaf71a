// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace bocst::io {

/// What a reader returns: vertices and polygons, before triangulation.
struct Polygons {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<std::uint32_t> corners;  ///< All polygons' vertex indices, one after the other.
  std::vector<std::size_t> ends;       ///< Where each polygon's corners end.

  void addTriangle(std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    corners.insert(corners.end(), {a, b, c});
    ends.push_back(corners.size());
  }

  /// The triangles of a strip; those with a repeated corner only tie two parts together and are left out.
  void addStrip(const std::uint32_t* corner, std::size_t n);
};

/// Cuts every polygon of n corners into n - 2 triangles between its corners, in O(n log n) whatever the polygon. Of a
/// polygon that does not cross itself (concave, with holes joined to the outline by pairs of equal edges, with repeated
/// or collinear corners) they cover the inside once. Polygons of fewer than three corners are points and lines, which
/// are left out.
std::vector<Mesh::Indices> triangulate(const Polygons& polygons);

}  // namespace bocst::io
