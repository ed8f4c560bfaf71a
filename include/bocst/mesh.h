// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/export.h>
#include <fcl/math/triangle.h>

#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

namespace bocst {

/// A triangle mesh: validated once, immutable, meant to be shared (`std::shared_ptr<const Mesh>`) by any number of
/// models and threads. Coordinates are doubles in the mesh's own frame, in any length unit.
///
/// Degenerate triangles are valid: they are treated as the segment or the point that they are. Vertices that no
/// triangle uses are kept, but bounds() ignores them.
class BOCST_EXPORT Mesh {
 public:
  /// The three vertex indices of a triangle, as stored: 12 bytes.
  using Indices = std::array<std::uint32_t, 3>;

  /// @throws std::invalid_argument for no triangles, more than 2^28 triangles or 2^32 - 1 vertices, a bad index, a
  /// coordinate that is NaN, infinite or larger than 1e75 in magnitude. It names the first bad vertex or triangle.
  Mesh(std::vector<Eigen::Vector3d> vertices, const std::vector<fcl::Triangle>& triangles);

  Mesh(const Mesh&) = default;  ///< Shares the triangles. There is no move: a mesh always has triangles.
  Mesh& operator=(const Mesh&) = delete;

  /// The same from 32-bit indices. The vectors are moved, not copied.
  static std::shared_ptr<const Mesh> fromIndices(std::vector<Eigen::Vector3d> vertices, std::vector<Indices> triangles);

  /// The same from plain arrays: x, y, z of each vertex and three indices of each triangle. The arrays are copied. For
  /// meshes of shape_msgs, geometric_shapes, NumPy and similar types. @throws std::invalid_argument for a null array
  /// with a count above 0, too.
  static std::shared_ptr<const Mesh> fromArrays(const double* vertices, std::size_t vertex_count,
                                                const std::uint32_t* triangles, std::size_t triangle_count);
  /// The same from float coordinates.
  static std::shared_ptr<const Mesh> fromArrays(const float* vertices, std::size_t vertex_count,
                                                const std::uint32_t* triangles, std::size_t triangle_count);

  /// A copy with each vertex moved along the line from the mean of all vertices: its distance d from the mean becomes
  /// scale * d + padding. This is what geometric_shapes does (MoveIt's link scale and padding). Both meshes share the
  /// indices. The result is not an offset of the surface; for an offset, use Options::margin.
  /// @throws std::invalid_argument for a scale that is not above 0, or a number that is not finite, or when a vertex
  /// would have a coordinate larger than 1e75 in magnitude.
  std::shared_ptr<const Mesh> scaledAndPadded(double scale, double padding) const;

  /// A mesh with the same triangles and other vertex positions. Both meshes share the indices.
  /// @throws std::invalid_argument if the number is not vertexCount(), or for a bad vertex, naming the first one.
  std::shared_ptr<const Mesh> withVertices(std::vector<Eigen::Vector3d> vertices) const;

  std::size_t vertexCount() const { return vertices_.size(); }      ///< Including unused vertices.
  std::size_t triangleCount() const { return triangles_->size(); }  ///< At least 1.

  /// Vertex i, 0 <= i < vertexCount(), in the mesh's frame.
  const Eigen::Vector3d& vertex(std::size_t i) const { return vertices_[i]; }

  /// Triangle t, 0 <= t < triangleCount(), in FCL's type.
  fcl::Triangle triangle(std::size_t t) const {
    const Indices& i = indices(t);
    return fcl::Triangle(i[0], i[1], i[2]);
  }
  const Indices& indices(std::size_t t) const { return (*triangles_)[t]; }  ///< Triangle t as stored.

  const std::vector<Eigen::Vector3d>& vertices() const { return vertices_; }  ///< In the mesh's frame.
  const std::vector<Indices>& triangles() const { return *triangles_; }       ///< As stored.

  /// The axis-aligned bounding box of all triangles, in the mesh's frame.
  const Eigen::AlignedBox3d& bounds() const { return bounds_; }

  /// Heap bytes that this mesh holds, including shared indices.
  std::size_t bytes() const;

 private:
  Mesh(std::vector<Eigen::Vector3d> vertices, std::shared_ptr<const std::vector<Indices>> triangles);
  void validate(const std::vector<fcl::Triangle>* given);

  std::vector<Eigen::Vector3d> vertices_;
  std::shared_ptr<const std::vector<Indices>> triangles_;
  Eigen::AlignedBox3d bounds_;
};

}  // namespace bocst
