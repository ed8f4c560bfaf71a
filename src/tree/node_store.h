// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "bounds/node_bounds.h"
#include "memory/pool.h"
#include "tree/block.h"
#include "tree/triangle_lists.h"

namespace bocst::tree {

/// The resident nodes of a tree. What walks read of a block, what growth and decay know of it, and when a query last
/// used it are apart, so that walks have few cache lines to read. Threads: as Pool.
struct NodeStore {
  memory::Pool<Block, 5> blocks;
  memory::Pool<BlockRecord, 5> records;                         ///< Of each block.
  mutable memory::Pool<std::atomic<std::int64_t>, 5> last_use;  ///< Of each block, in ns of the model's clock.
  TriangleLists lists;
  bounds::NodeBounds root_bounds;

  /// Appends a block of the children of `node`, last used now; returns its index. Blocks come after those of their
  /// parents. @throws std::length_error beyond 2^29 blocks, std::bad_alloc.
  std::uint32_t append(NodeRef node, std::uint8_t grey, std::int64_t now);

  /// Tighter bounds of a node than its parent's block holds. Blocks that readers see are not written to, so this waits
  /// for refit().
  void addRefit(NodeRef node, const bounds::NodeBounds& bounds);
  bool hasRefits() const { return refits_wait_.load(std::memory_order_relaxed); }
  /// Applies these, up to the root. When nobody else looks.
  void refit();

  /// All but the root's bounds goes.
  void clear();
  void swap(NodeStore& other);
  std::size_t bytes() const { return blocks.bytes() + records.bytes() + last_use.bytes() + lists.bytes(); }

 private:
  struct Refit {
    NodeRef node;
    bounds::NodeBounds bounds;
  };
  std::vector<Refit> refits_;
  std::atomic<bool> refits_wait_{false};
};

}  // namespace bocst::tree
