// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

namespace bocst::oracle {

class DeviceResource;

/// The resident nodes of a sphere-tree as a device walks them: for each block kWords words.
namespace node_table {
constexpr std::uint32_t kPlace = 0;     ///< Bits 0 to 15: the expanded cell's x; 16 to 31: its y.
constexpr std::uint32_t kShape = 1;     ///< Bits 0 to 15: its z; 16 to 23: its level; 24 to 31: its grey octants.
constexpr std::uint32_t kChildren = 2;  ///< 8: the block of each octant, or kNone.
constexpr std::uint32_t kStamp = 10;    ///< Number of the upload, by the oracle; a block with another did not arrive.
constexpr std::uint32_t kWords = 11;
constexpr std::uint32_t kNone = 0xffffffffu;
}  // namespace node_table

/// Pairs of sphere-trees at poses, for a walk over their resident nodes.
struct DeviceWalks {
  struct Tree {
    std::shared_ptr<const DeviceResource> nodes;  ///< As Oracle::uploadNodes() gave.
    std::uint32_t blocks = 0;                     ///< Of its table.
    std::uint32_t root = node_table::kNone;       ///< The block of the root.
    std::uint32_t deepest = 1;                    ///< The level of its leaves.
    std::uint32_t extent[3] = {0, 0, 0};          ///< Where its actual regions end, in lattice units.
    std::vector<std::uint32_t> used;              ///< Answered: of each block that a walk visited, a bit.
    std::vector<std::uint32_t> wanted;  ///< Answered: bit 8 b + o: octant o of block b has to be expanded; bit 8 *
                                        ///< blocks: the root has to be.
  };
  struct Pair {
    std::uint32_t tree[2] = {0, 0};  ///< Of `trees`.
    float rotation[3][3] = {};       ///< Rows: p_0 = rotation * p_1 + shift, for points p_i in lattice units ...
    float shift[3] = {0, 0, 0};      ///< ... of tree i from the middle of its root, those of tree 1 times `unit`.
    float unit = 1;                  ///< A lattice unit of tree 1, in those of tree 0.
    float rounding_margin = 0;       ///< Distances within this of the sum of the radii are kDoubt (SphereFrames).
    float tolerance = 0;
    std::int32_t not_smaller = 0;  ///< Tree 0's node is expanded if tree 1's is deeper by at least this many levels.
  };
  enum Found : std::uint8_t {
    kMeet = 1,     ///< The spheres of leaves meet.
    kDoubt = 2,    ///< Some leaves are too close to call in float.
    kGrows = 4,    ///< A node is not resident; `wanted` has what must be, unless the walk has kMeet.
    kUndone = 8,   ///< The walk was too long, or the device did not do it.
    kInvalid = 16  ///< The table is not what was uploaded. Never answered.
  };
  std::vector<Tree> trees;
  std::vector<Pair> pairs;
  std::vector<std::uint8_t> found;  ///< Answered: bits of Found; 0: all spheres of leaves are apart.
};

}  // namespace bocst::oracle
