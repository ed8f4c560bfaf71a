// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace bocst {

/// A snapshot of what a model holds and has done. The counters only grow; they are exact when no query is running.
struct Statistics {
  std::size_t resident_nodes = 0;  ///< Cells and lanes of triangles in memory; 1 when the model is at rest.
  std::size_t resident_bytes = 0;  ///< Heap bytes of the tree: nodes, triangle lists, bookkeeping; not the mesh.
  std::vector<std::size_t> nodes_per_level;  ///< [0] is level 1 (the root), as the paper's tables count.
  std::uint64_t expansions = 0;              ///< Nodes expanded so far.
  std::uint64_t oracle_batches = 0;          ///< Expansion batches this model took part in.
  std::uint64_t oracle_cells = 0;            ///< Cells the oracle was asked about (eight octants a plain expansion).
  std::uint64_t expanded_octants = 0;        ///< Octants of expanded nodes that have an actual region; the paper makes
                                             ///< an occlusion query for each (5.4), from up to three sides.
  std::uint64_t built_triangles = 0;  ///< Triangles that exact answers have sorted into the tree so far; from one
                                      ///< time that the model is its root to the next at most 1.25 times as many
                                      ///< as it has, and what one growth sorts.
  std::uint64_t pruned_nodes = 0;     ///< Nodes dropped by ttl, budget, prune() or updateVertices().
  std::size_t mesh_bytes = 0;         ///< Heap bytes of the mesh, which other models may share and which are 0 after
                                      ///< releaseMesh(), and of `solid`.
  std::size_t device_bytes = 0;  ///< Bytes on a GPU: the mesh, which other models may share, and triangle lists; what
                                 ///< was grown together for two models counts for both. 0 with the CPU oracle.
};

}  // namespace bocst
