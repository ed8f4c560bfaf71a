// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "oracle/surface.h"

namespace bocst::tree {

/// Oriented boxes about the triangles of a long and thin surface, in a binary tree with a triangle in each leaf: such
/// triangles may be as long as the surface, and no boxes along the lattice's axes separate them.
class BoxTree {
 public:
  /// All lengths are lattice units.
  struct Node {
    Eigen::Vector3d center;
    Eigen::Matrix3d axes;  ///< Columns: unit axes.
    Eigen::Vector3d half;
    std::uint32_t second;  ///< The second child; the first one is the next node. 0: a leaf.
    std::uint32_t triangle;
  };

  explicit BoxTree(const oracle::Surface& surface);

  /// The first is the root.
  const std::vector<Node>& nodes() const { return nodes_; }
  std::size_t bytes() const { return bytesOf(nodes_.size() / 2 + 1); }
  static constexpr std::size_t bytesOf(std::size_t triangles) { return (2 * triangles - 1) * sizeof(Node); }

 private:
  struct Item {
    Eigen::Vector3d corner[3], middle;
    std::uint32_t triangle;
  };

  struct Frame;

  void add(Item* begin, Item* end);

  std::vector<Node> nodes_;
};

}  // namespace bocst::tree
