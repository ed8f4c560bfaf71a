// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace bocst {

/// A snapshot of a model's memory and of its work so far. Counters never decrease, but start again at 0 when the
/// model gets another mesh (setMesh, beginModel); they are exact if no query runs.
struct Statistics {
  std::size_t resident_nodes = 0;  ///< Nodes of the tree: cells and groups of triangles; 1 if only the root is left.
  std::size_t resident_bytes = 0;  ///< Heap bytes of the tree: nodes, triangle lists, bookkeeping; not the mesh.
  std::vector<std::size_t> nodes_per_level;  ///< [0] is level 1 (the root), as in the paper's tables.
  std::uint64_t expansions = 0;              ///< Nodes expanded so far.
  std::uint64_t oracle_batches = 0;          ///< Batches of expansions that included this model. The grid of the root's
                                             ///< first levels counts as one batch.
  std::uint64_t oracle_cells = 0;            ///< Cells that the oracle tested (eight octants per plain expansion), and
                                             ///< those of the grid's levels.
  std::uint64_t expanded_octants = 0;        ///< Octants of expanded nodes that have an actual region; the paper makes
                                             ///< an occlusion query for each (5.4), from up to three sides. With exact
                                             ///< answers also groups of triangles.
  std::uint64_t built_triangles = 0;  ///< Triangles that exact answers have sorted into the tree so far. Between two
                                      ///< times at which only the root is resident, without Model::buildTree(): at
                                      ///< most 1.125 times the mesh's triangles, plus those that one query grows
                                      ///< (with Options::build_ahead: those of all growth by parts plus the mesh's).
  std::uint64_t pruned_nodes = 0;     ///< Nodes dropped by ttl, budget, prune() or updateVertices().
  std::size_t mesh_bytes = 0;         ///< Heap bytes of the mesh (other models may share them; 0 after releaseMesh(),
                                      ///< except while queries need it) and of the data for `solid`.
  std::size_t device_bytes = 0;  ///< Bytes on a GPU: the mesh (other models may share it) and triangle lists. The lists
                                 ///< of a batch that two models expanded together are counted for each of them. 0 with
                                 ///< the CPU oracle.
};

}  // namespace bocst
