// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>

#include <array>
#include <memory>

#include "lattice/lattice.h"

namespace bocst::oracle {

class DeviceResource;

/// What an oracle is asked about: a mesh, seen on its lattice. A Surface is made with a mesh, whose size it keeps.
struct Surface {
  std::shared_ptr<const Mesh> mesh;  ///< Null when only the device has it.
  lattice::Lattice lattice;
  std::shared_ptr<const DeviceResource> device = nullptr;  ///< What Oracle::makeResident() gave.
  std::size_t triangle_count = mesh->triangleCount();
  Eigen::AlignedBox3d bounds = mesh->bounds();  ///< In the mesh's frame.

  /// The bounds in lattice units.
  Eigen::AlignedBox3d latticeBounds() const {
    return {lattice.toLattice(bounds.min()), lattice.toLattice(bounds.max())};
  }
  /// Corner k of triangle t, in lattice units.
  Eigen::Vector3d corner(std::uint32_t t, int k) const { return lattice.toLattice(mesh->vertex(mesh->indices(t)[k])); }
  std::array<Eigen::Vector3d, 3> corners(std::uint32_t t) const { return {corner(t, 0), corner(t, 1), corner(t, 2)}; }
};

}  // namespace bocst::oracle
