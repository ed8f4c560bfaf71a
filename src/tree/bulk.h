// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "bounds/loose_frame.h"
#include "memory/huge_pages.h"
#include "oracle/surface.h"
#include "tree/block.h"
#include "tree/bulk_kernels.h"
#include "tree/outline.h"
#include "tree/packed_triangles.h"
#include "tree/support_table.h"

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
    std::uint32_t lanes = 0;  ///< How many are in use; these come first.
    Lane lane[8];
    bounds::NodeBounds bounds[8];
  };

  /// The surface of a node: a box, and a slab along `normal` (bytes as of NodeBounds; zero: none).
  struct Own {
    Eigen::AlignedBox3d box;  ///< Lattice units.
    std::int8_t normal[3] = {0, 0, 0};
    double least = 0, most = 0;  ///< normal . p, of points p in lattice units.
  };

  /// Makes the blocks over those of `count` triangles that meet `region` (lattice units); none where they fit a leaf.
  /// Boxes are divided by the surface area heuristic.
  void build(const oracle::Surface& surface, const std::uint32_t* ids, std::size_t count,
             const Eigen::AlignedBox3d& region);

  /// The same for all triangles of a larger surface, which are first sorted along a Z-order curve. Clusters of
  /// neighbours along the curve are divided by the heuristic, and in pieces of few triangles the triangles themselves.
  /// @throws std::length_error for less than kLeastToSort triangles, or more than kMostToSort vertices.
  void buildAll(const oracle::Surface& surface);
  static constexpr std::size_t kLeastToSort = 4096, kMostToSort = std::size_t{1} << 29;

  /// Packs the corners of a leaf, triangles begin to begin + count - 1 of ids(); see PackedTriangles::pack().
  std::size_t pack(std::uint32_t begin, std::uint32_t count, PackedTriangles::Words& words) const;

  /// Lowers all supports to those of the triangles that were built.
  void findSupports(SupportTable& supports) const;

  /// A box along the principal axes of their vertices or along those of the frame, which is smaller.
  Outline::Box findOutline(const lattice::Lattice& lattice) const;

  const std::vector<std::uint32_t>& ids() const { return ids_; }
  /// Parents come before their children; the first is the node's.
  const std::vector<Block>& blocks() const { return blocks_; }
  const Own& own() const { return own_; }

 private:
  struct Cluster {
    TriangleBox box;
    std::uint32_t begin, count;  ///< Of the sorted triangles.
  };
  struct Piece {
    std::uint32_t begin, count;       ///< Of ids().
    std::uint32_t cluster, clusters;  ///< Of cluster_order_; none where order_ has its triangles.
  };
  // What is divided, one by one.
  struct Clusters {
    const Cluster* clusters;
    const TriangleBox& boxOf(std::uint32_t i) const { return clusters[i].box; }
    std::uint32_t trianglesOf(std::uint32_t i) const { return clusters[i].count; }
  };
  struct Triangles {
    const TriangleBox* boxes;
    const TriangleBox& boxOf(std::uint32_t i) const { return boxes[i]; }
    std::uint32_t trianglesOf(std::uint32_t) const { return 1; }
  };
  struct Half {
    std::uint32_t items, triangles;  ///< Of the first part.
  };
  struct SupportPiece {
    std::uint32_t begin, count;  ///< Of ids().
    PieceBounds bounds;
  };

  void makeRoom(std::size_t triangles, std::size_t places, std::size_t clusters);
  void sortKeys(int bits);
  void cluster(std::uint32_t begin, std::uint32_t count);
  void addCluster(std::uint32_t begin, std::uint32_t count);
  void divide();
  std::uint32_t addBlock(const Piece& piece);
  void layOut(Piece& piece);
  Piece takeHalf(Piece& piece);
  template <typename Items>
  Half split(std::uint32_t* order, std::uint32_t items, std::uint32_t count, Items all_items);
  void finish(const Mesh::Indices* indices, const std::uint32_t* numbers);
  CornerRows rows() const;
  template <typename F>
  void withSupportPieces(F&& f) const;
  Eigen::Matrix3d principalAxes() const;
  PieceBounds boundsOf(std::uint32_t begin, std::uint32_t count) const;
  void boundBlocks();

  // Where what is below lies, for `count_` triangles.
  std::unique_ptr<std::byte[]> few_pages_;
  memory::HugePages huge_pages_;
  std::byte* memory_ = nullptr;
  std::size_t room_ = 0, count_ = 0, place_count_ = 0;
  std::uint32_t cluster_count_ = 0;
  float* places_;  // four each: of vertices, or of corners
  SortKey *keys_, *keys_room_;
  std::uint32_t* given_;                    // triangles, before they are divided
  TriangleBox* items_;                      // and their boxes in the region
  std::uint32_t* cluster_order_;            // of the clusters in the blocks
  Cluster* clusters_;                       // of sorted triangles
  std::uint32_t *order_, *order_room_;      // of the items in the blocks
  std::uint8_t* bins_;                      // of the items of a piece
  float* rows_;                             // nine rows of corners
  std::vector<Mesh::Indices> own_corners_;  // places of the corners where each triangle has its own

  std::vector<std::uint32_t> ids_;
  std::vector<PieceBounds> block_bounds_;
  std::vector<SupportPiece> support_pieces_;  // pieces that supports are sought by
  std::vector<Block> blocks_;
  Own own_;
  Eigen::Vector3d base_;         // of the float coordinates, whole lattice units
  Eigen::Array4f least_, most_;  // the region
  float size_ = 0;               // largest float coordinate, in absolute value
};

}  // namespace bocst::tree
