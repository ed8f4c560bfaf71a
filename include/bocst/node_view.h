// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>

namespace bocst {

class Mesh;

/// One resident node with the fields of the paper (3.1): parent, children, object, n, radius, center; plus its cell. It
/// is a copy: it stays valid after the node has been dropped.
struct NodeView {
  /// Not a node: the id of the root's parent.
  static constexpr std::uint32_t kNone = 0xffffffffu;

  /// Up to eight node ids, in octant order.
  struct Children {
    std::array<std::uint32_t, 8> ids{};  ///< Only the first `count` are used.
    std::uint32_t count = 0;             ///< 0 to 8.

    const std::uint32_t* begin() const { return ids.data(); }         ///< For range-for.
    const std::uint32_t* end() const { return ids.data() + count; }   ///< For range-for.
    std::size_t size() const { return count; }                        ///< 0 to 8.
    bool empty() const { return count == 0; }                         ///< True on the frontier.
    std::uint32_t operator[](std::size_t i) const { return ids[i]; }  ///< 0 <= i < size().
  };

  std::uint32_t id = 0;          ///< Unique among the nodes of one visit(); the root is 0.
  std::uint32_t parent = kNone;  ///< The parent's id.
  Children children;             ///< Ids of the resident children; empty on the frontier.
  const Mesh* object = nullptr;  ///< The mesh of this node; null after releaseMesh(). Not a copy: valid while the
                                 ///< model or another owner keeps that mesh.
  int n = 0;                     ///< 2^n is the side of the node's cube, in lattice units (negative below one unit).
  double radius = 0;             ///< Of the sphere about the node's actual region, in the mesh's length unit.
  Eigen::Vector3d center;        ///< Of that sphere, in the mesh's frame.

  int level = 1;                        ///< 1 is the root.
  std::array<std::uint32_t, 3> cell{};  ///< Integer coordinates among the 2^(level-1) cells of an axis.
  /// False for a node that exact answers build below a cell. Then center and radius are those of a box about some
  /// triangles; level is that of the cell above it plus its depth below that cell; n follows from level; cell is not
  /// set.
  bool is_cell = true;
};

}  // namespace bocst
