// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "bounds/loose_frame.h"
#include "oracle/surface.h"
#include "tree/block.h"

namespace bocst::tree {

/// Builds the blocks below a node at once, for exact answers: each triangle goes to one lane, by the middle of its box,
/// and nothing is clipped at octants, so lanes may overlap and no triangle is listed twice. Lanes of at most
/// kMaxLeafTriangles are leaves, the others have a block.
///
/// Threads: one build at a time for each object.
class BulkBuilder {
 public:
  struct Lane {
    std::uint32_t begin, count;  ///< Of ids().
    std::uint32_t block;         ///< Number of its block among blocks(), or kNone: a leaf.
  };
  static constexpr std::uint32_t kNone = 0xffffffffu;

  struct Block {
    bounds::LooseFrame frame;
    std::uint32_t lanes = 0;  ///< The first so many are in use.
    Lane lane[8];
    bounds::LooseBounds bounds[8];
  };

  /// The surface of a node: a box, and a slab along `normal` (bytes, of length about 127; zero: none).
  struct Own {
    Eigen::AlignedBox3d box;  ///< Lattice units.
    std::int8_t normal[3] = {0, 0, 0};
    double least = 0, most = 0;  ///< normal . p, of points p in lattice units.
  };

  /// Sorts those of `count` triangles that meet `region` (lattice units), and makes the blocks over them; none where
  /// they fit a leaf.
  void build(const oracle::Surface& surface, const std::uint32_t* ids, std::size_t count,
             const Eigen::AlignedBox3d& region);

  /// The same for all triangles of the surface.
  void buildAll(const oracle::Surface& surface);

  const std::vector<std::uint32_t>& ids() const { return ids_; }
  /// Parents come before their children; the first is the node's.
  const std::vector<Block>& blocks() const { return blocks_; }
  const Own& own() const { return own_; }

 private:
  struct Item {
    float lo[4], hi[4];  // the box in the region; the last entries are the triangle's bits, and any
  };
  struct Piece {
    std::uint32_t begin, count;
  };
  struct Bounds {
    float lo[4], hi[4];
    float normal[3];
  };
  struct Key {
    std::uint32_t code, id;
  };

  void addItem(const Eigen::Array4f& a, const Eigen::Array4f& b, const Eigen::Array4f& c, std::uint32_t id);
  void sortItems();
  void finish();
  std::uint32_t addBlock(Piece piece);
  std::uint32_t split(Piece piece);
  void fillRows(const oracle::Surface& surface, bool all);
  void boundBlocks();
  Bounds boundsOf(Piece piece) const;

  std::vector<Item> items_, items_room_;
  std::vector<Key> keys_, keys_room_;
  std::vector<std::uint32_t> ids_;
  std::vector<float> places_;  // of vertices, four floats each
  std::vector<float> rows_;    // nine rows of corners
  std::vector<Bounds> block_bounds_;
  std::vector<Block> blocks_;
  Own own_;
  Eigen::Vector3d base_;         // of the float coordinates, whole lattice units
  Eigen::Array4f least_, most_;  // the region
  float size_ = 0;               // largest float coordinate, in absolute value
  bool sorted_ = false;          // keys_ are those of items_
};

}  // namespace bocst::tree
