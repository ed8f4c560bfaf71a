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
/// A degenerate triangle is legal: it is the segment or the point that it is. Vertices that no triangle uses are kept
/// and do not count for bounds().
class BOCST_EXPORT Mesh {
 public:
  /// The three vertex indices of a triangle, as stored: 12 bytes.
  using Indices = std::array<std::uint32_t, 3>;

  /// @throws std::invalid_argument naming the first bad vertex or triangle: no triangles, more than 2^28 triangles or
  /// 2^32 - 1 vertices, an index out of range, a coordinate that is NaN, infinite or larger than 1e75 in size.
  Mesh(std::vector<Eigen::Vector3d> vertices, const std::vector<fcl::Triangle>& triangles);

  Mesh(const Mesh&) = default;  ///< Shares the triangles. There is no moving: a mesh is never without them.
  Mesh& operator=(const Mesh&) = delete;

  /// The same from 32-bit indices, which are moved in rather than copied.
  static std::shared_ptr<const Mesh> fromIndices(std::vector<Eigen::Vector3d> vertices, std::vector<Indices> triangles);

  /// The same from plain arrays: x, y, z of each vertex, and three indices of each triangle; they are copied. For
  /// meshes of shape_msgs, geometric_shapes, numpy and the like.
  static std::shared_ptr<const Mesh> fromArrays(const double* vertices, std::size_t vertex_count,
                                                const std::uint32_t* triangles, std::size_t triangle_count);
  /// The same from floats.
  static std::shared_ptr<const Mesh> fromArrays(const float* vertices, std::size_t vertex_count,
                                                const std::uint32_t* triangles, std::size_t triangle_count);

  /// Each vertex moved away from the mean of all vertices: to `scale` times its distance from there, plus `padding`. So
  /// geometric_shapes (MoveIt's link scale and padding) does; both meshes share the indices. It is no offset of the
  /// surface: where that is meant, ask for Options::margin.
  /// @throws std::invalid_argument for a scale that is not above 0, or numbers that are not finite.
  std::shared_ptr<const Mesh> scaledAndPadded(double scale, double padding) const;

  /// The same triangles between other vertices; both meshes share the indices.
  /// @throws std::invalid_argument naming the first bad vertex, or for another number of vertices than vertexCount().
  std::shared_ptr<const Mesh> withVertices(std::vector<Eigen::Vector3d> vertices) const;

  std::size_t vertexCount() const { return vertices_.size(); }      ///< Unused ones included.
  std::size_t triangleCount() const { return triangles_->size(); }  ///< At least 1.

  /// Vertex i, 0 <= i < vertexCount(), in the mesh's frame.
  const Eigen::Vector3d& vertex(std::size_t i) const { return vertices_[i]; }

  /// Triangle t, 0 <= t < triangleCount(), in FCL's type.
  fcl::Triangle triangle(std::size_t t) const {
    const Indices& i = indices(t);
    return fcl::Triangle(i[0], i[1], i[2]);
  }
  const Indices& indices(std::size_t t) const { return (*triangles_)[t]; }  ///< The same as stored.

  const std::vector<Eigen::Vector3d>& vertices() const { return vertices_; }  ///< In the mesh's frame.
  const std::vector<Indices>& triangles() const { return *triangles_; }       ///< As stored.

  /// The axis-aligned box of all triangles, in the mesh's frame.
  const Eigen::AlignedBox3d& bounds() const { return bounds_; }

  /// Heap bytes that this mesh holds, those of shared indices included.
  std::size_t bytes() const;

 private:
  Mesh(std::vector<Eigen::Vector3d> vertices, std::shared_ptr<const std::vector<Indices>> triangles);
  void validate(const std::vector<fcl::Triangle>* given);

  std::vector<Eigen::Vector3d> vertices_;
  std::shared_ptr<const std::vector<Indices>> triangles_;
  Eigen::AlignedBox3d bounds_;
};

}  // namespace bocst
