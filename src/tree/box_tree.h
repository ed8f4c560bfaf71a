// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "oracle/surface.h"

namespace bocst::tree {

/// Oriented boxes about the triangles of a surface, in a binary tree with a few triangles in each leaf: for triangles
/// that no boxes along the lattice's axes separate, such as those of long and thin surfaces.
class BoxTree {
 public:
  /// All lengths are lattice units.
  struct Node {
    Eigen::Vector3d center;
    Eigen::Matrix3d axes;  ///< Columns: unit axes.
    Eigen::Vector3d half;
    std::uint32_t second;  ///< The second child; the first one is the next node. 0: a leaf.
    std::uint32_t begin;   ///< Of a leaf's triangles.
    std::uint32_t count;   ///< Of them; 0 if it is no leaf.
  };

  explicit BoxTree(const oracle::Surface& surface);

  /// The first is the root.
  const std::vector<Node>& nodes() const { return nodes_; }
  /// The triangles of the leaves, one leaf after the other.
  const std::vector<std::uint32_t>& triangles() const { return triangles_; }
  std::size_t bytes() const { return bytesOf(triangles_.size()); }
  static constexpr std::size_t bytesOf(std::size_t triangles) {
    return triangles * sizeof(std::uint32_t) + mostNodes(triangles) * sizeof(Node);
  }
  static constexpr std::size_t kMostInLeaf = 4;

 private:
  struct Item {
    Eigen::Vector3d corner[3], middle;
    std::uint32_t triangle;
  };

  // The smallest node that is divided has kMostInLeaf + 1 triangles, which become two leaves.
  static constexpr std::size_t mostNodes(std::size_t triangles) {
    return std::max<std::size_t>(1, 4 * triangles / (kMostInLeaf + 1));
  }

  struct Frame;

  void add(Item* begin, Item* end);

  std::vector<Node> nodes_;
  std::vector<std::uint32_t> triangles_;
};

}  // namespace bocst::tree
