// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

namespace bocst {

/// A point of each connected component of a surface: vertices at the same place are one.
std::vector<Eigen::Vector3d> pointOfEachComponent(const std::vector<Eigen::Vector3d>& vertices,
                                                  const std::vector<Mesh::Indices>& triangles);

/// What a watertight mesh encloses: the points about which its surface winds. So pieces may overlap, and a piece turned
/// inside out within another is a cavity. Immutable; 12 to 40 bytes a triangle.
class Solid {
 public:
  /// Watertight: each edge (vertices at the same place are one, triangles without three places do not count) is run
  /// through as often in one direction as in the other.
  /// @throws std::invalid_argument naming the first edge where that is not so.
  explicit Solid(std::shared_ptr<const Mesh> mesh);

  /// True if the point (in the mesh's frame), whose coordinates may be off by `tolerance`, is inside. True also where
  /// rounding leaves that open.
  bool mayContain(const Eigen::Vector3d& point, double tolerance) const;

  std::size_t bytes() const;

 private:
  bool windsAbout(const Eigen::Vector3d& point) const;
  void fillColumns();
  std::array<std::uint32_t, 4> columnsOf(const Mesh::Indices& triangle) const;
  std::uint32_t column(double position, int axis) const;

  std::shared_ptr<const Mesh> mesh_;
  double rounding_ = 0;  // above what computing with these coordinates can be off by
  // Triangles by columns along z: ids_[first_[c]] to ids_[first_[c + 1]] are those over column c = y * count_[0] + x.
  std::array<std::uint32_t, 2> count_{1, 1};
  std::vector<std::uint32_t> first_, ids_;
};

}  // namespace bocst
