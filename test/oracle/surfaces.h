// SPDX-License-Identifier: BSD-3-Clause
// What the tests of the oracles share.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "meshes.h"
#include "oracle/oracle.h"
#include "oracle/reference.h"

namespace bocst::oracle {

inline Surface surfaceOf(const std::shared_ptr<const Mesh>& mesh, Subdivision s = Subdivision::kBono,
                         double dimension = 0) {
  return {mesh, lattice::Lattice(mesh->bounds(), s, dimension)};
}
inline Surface surfaceOf(const test::Raw& raw, Subdivision s = Subdivision::kBono, double dimension = 0) {
  return surfaceOf(raw.mesh(), s, dimension);
}

/// Where the oracle works.
inline Surface residentOn(Oracle& oracle, Surface surface) {
  surface.device = oracle.makeResident(surface);
  EXPECT_EQ(surface.device != nullptr, oracle.kind() != OracleKind::kCpu);
  return surface;
}

inline bool meets(const Surface& surface, std::uint32_t t, const lattice::Cell& cell, double more = 0) {
  return triangleMeetsCube(surface.corners(t).data(), centerOf(cell), cell.side() / 2.0 + more);
}

inline bool referenceGrey(const Surface& surface, const lattice::Cell& cell) {
  if (!surface.lattice.exists(cell)) return false;
  for (std::uint32_t t = 0; t < surface.mesh->triangleCount(); ++t) {
    if (meets(surface, t, cell)) return true;
  }
  return false;
}

/// The question about all of a mesh.
inline ExpansionRequest rootOf(const Surface& surface) {
  ExpansionRequest root;
  root.surface = &surface;
  root.count = surface.triangle_count;
  return root;
}

/// The cell of a level in which a point is; of the root cube's far faces, the last one.
inline lattice::Cell cellAbout(const Eigen::Vector3d& p, int level) {
  lattice::Cell cell;
  cell.level = level;
  for (std::size_t k = 0; k < 3; ++k) {
    cell.at[k] = std::min(static_cast<std::uint32_t>(p[static_cast<int>(k)] / cell.side()), (1u << (level - 1)) - 1);
  }
  return cell;
}

/// The question about `count` triangles and a cell; the ids must outlive it.
inline ExpansionRequest requestFor(const Surface& surface, const lattice::Cell& cell, const std::uint32_t* ids,
                                   std::size_t count) {
  ExpansionRequest e;
  e.surface = &surface;
  e.cell = cell;
  e.ids = ids;
  e.count = count;
  return e;
}

inline std::vector<ExpansionRequest> ask(Oracle& oracle, std::vector<ExpansionRequest> batch) {
  oracle.submit(batch);
  oracle.wait(batch);
  return batch;
}

}  // namespace bocst::oracle
