// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>

#include "bounds/node_bounds.h"
#include "lattice/lattice.h"
#include "oracle/device_walks.h"

/// The tables that the compute shaders share with each other and with the host. The shaders get these numbers, and
/// those of the codec of node bounds, under the same names.
namespace bocst::oracle::gl::layout {

inline std::uint32_t narrow(std::uint64_t n) { return static_cast<std::uint32_t>(n); }

constexpr std::uint32_t kGroup = 128;        ///< Invocations of a work group.
constexpr std::uint32_t kAll = 0xffffffffu;  ///< As a list: the triangles of the mesh, in order.

// Per cell, in words. Maxima of values that are never negative start at 0, so a cleared table is an empty one.
constexpr std::uint32_t kGrey = 0;              ///< Octants that a triangle surely meets.
constexpr std::uint32_t kBoxOnly = 1;           ///< Octants with a part that only its box bounds: no slab.
constexpr std::uint32_t kCounts = 2;            ///< 8: lengths of the octants' lists.
constexpr std::uint32_t kNext = kCounts + 8;    ///< 8: where the next triangle of each list goes.
constexpr std::uint32_t kIds = kNext + 8;       ///< Sum of the numbers of its triangles, each plus one.
constexpr std::uint32_t kOctants = kIds + 1;    ///< 8 times kOctantWords.
constexpr std::uint32_t kBox = 0;               ///< 3 times kBoxSteps - lo, 3 times hi, in steps of the octant's box.
constexpr std::uint32_t kTensor = kBox + 6;     ///< Sum of area * normal * normal^T: xx yy zz xy yz zx, as fixed point.
constexpr std::uint32_t kNormal = kTensor + 6;  ///< The slab's, in bytes.
constexpr std::uint32_t kSlab = kNormal + 1;  ///< How far the surface reaches along -normal and normal, see kSlabShift.
constexpr std::uint32_t kOctantWords = kSlab + 2;
constexpr std::uint32_t kStateWords = kOctants + 8 * kOctantWords;

/// A place t along a normal, in slab units of the octant, is (t + kSlabShift) * kSlabScale: |t| <= kNormalLength *
/// sqrt(3) / 2 and a little, so it is positive, and within float's 24 bits.
constexpr std::uint32_t kSlabShift = 512, kSlabScale = 8192;
static_assert(bounds::kCellSlabSteps == bounds::kNormalLength && kSlabShift > 2 * bounds::kNormalLength);
static_assert(2 * kSlabShift * kSlabScale <= 1u << 24);

/// What is answered about a cell, as bytes.
struct CellAnswer {
  bounds::OctantBounds octants;
  bounds::NodeBounds own;
  std::uint8_t grey;
};
static_assert(sizeof(CellAnswer) % 4 == 0, "whole words");
constexpr std::uint32_t kLoBytes = offsetof(CellAnswer, octants) + offsetof(bounds::OctantBounds, lo);
constexpr std::uint32_t kHiBytes = offsetof(CellAnswer, octants) + offsetof(bounds::OctantBounds, hi);
constexpr std::uint32_t kNormalBytes = offsetof(CellAnswer, octants) + offsetof(bounds::OctantBounds, normal);
constexpr std::uint32_t kSlabCenterBytes = offsetof(CellAnswer, octants) + offsetof(bounds::OctantBounds, slab_center);
constexpr std::uint32_t kSlabHalfBytes = offsetof(CellAnswer, octants) + offsetof(bounds::OctantBounds, slab_half);
constexpr std::uint32_t kOwnLoBytes = offsetof(CellAnswer, own) + offsetof(bounds::NodeBounds, lo);
constexpr std::uint32_t kOwnHiBytes = offsetof(CellAnswer, own) + offsetof(bounds::NodeBounds, hi);
constexpr std::uint32_t kOwnSlabHalfBytes = offsetof(CellAnswer, own) + offsetof(bounds::NodeBounds, slab_half);
constexpr std::uint32_t kGreyBytes = offsetof(CellAnswer, grey);

// The answer, in words: a header, a row per cell, then the ids of lists that the host wants.
constexpr std::uint32_t kListWords = 0;  ///< Header: words taken from the room for lists.
constexpr std::uint32_t kIdWords = 1;    ///< Header: words taken from the room for ids.
constexpr std::uint32_t kFailed = 2;     ///< Header: bits of what a pass found undone by those before it, see below.
constexpr std::uint32_t kGroups = 3;     ///< Header: the work groups that ran, of each pass.
constexpr std::uint32_t kPassCount = 7;
constexpr std::uint32_t kHeader = kGroups + kPassCount;
constexpr std::uint32_t kBoundsWords = sizeof(CellAnswer) / 4;  ///< At the beginning of a row.
constexpr std::uint32_t kRowSizes = kBoundsWords;               ///< 8: lengths of the octants' lists.
constexpr std::uint32_t kRowList = kRowSizes + 8;               ///< Where octant 0's list begins; the others follow.
constexpr std::uint32_t kRowIds = kRowList + 1;                 ///< Where the ids begin, likewise.
constexpr std::uint32_t kRowSum = kRowIds + 1;                  ///< As kIds.
constexpr std::uint32_t kRowCheck = kRowSum + 1;                ///< Of the cell and the batch, see check().
constexpr std::uint32_t kRow = kRowCheck + 1;

// What a driver leaves out must not be read as "white". So each pass counts its work groups; each word of masks has the
// number of its batch, so that who reads it sees whether it was written; a list that is not full is seen when it is
// packed; rows say which cell and batch they answer; and the batch's number stands behind the last id.
constexpr std::uint32_t kMasksFailed = 1, kListsFailed = 2;  ///< In kFailed.
constexpr std::uint32_t kMostBatches = 1u << 24;             ///< Batches have numbers below that.

/// A cell to expand, as the shaders see it.
struct Cell {
  float center[3];  ///< Lattice units.
  float half_side;
  std::uint32_t first_pair, list, exists, ids_up_to;
  std::uint32_t indices, vertices, exact;  ///< Where its mesh begins, see DeviceMesh.
  std::uint32_t batch;
};
static_assert(sizeof(Cell) == 48, "std430 pads to 16 bytes");

// A walk over pairs of trees (pairs.glsl). Of each pair it is asked, in words:
constexpr std::uint32_t kPairRotation = 0, kPairShift = 9, kPairUnit = 12, kPairMargin = 13, kPairTolerance = 14,
                        kPairNotSmaller = 15;            ///< As of DeviceWalks::Pair.
constexpr std::uint32_t kPairTrees = 16;                 ///< 2 times kTreeWords:
constexpr std::uint32_t kTreeBegin = 0, kTreeStamp = 1;  ///< where its table is, the stamp of its words,
constexpr std::uint32_t kTreeUsed = 2;                   ///< where the bits of its blocks go,
constexpr std::uint32_t kTreeWanted = 3;                 ///< and those of its octants that must grow,
constexpr std::uint32_t kTreeBlocks = 4, kTreeRoot = 5, kTreeDeepest = 6,
                        kTreeExtent = 7;  ///< as of DeviceWalks::Tree.
constexpr std::uint32_t kTreeWords = 10;
constexpr std::uint32_t kPairBatch = kPairTrees + 2 * kTreeWords;  ///< The number of the batch.
constexpr std::uint32_t kPairWords = kPairBatch + 1;
// The answer: a row per pair (the batch's number above 8 bits of DeviceWalks::Found; its check), then each tree's bits.
constexpr std::uint32_t kPairAnswer = 2;
constexpr std::uint32_t kWalkGroup = 64;              ///< Invocations of a walk.
constexpr std::uint32_t kWalkPairs = kWalkGroup / 8;  ///< Pairs of nodes that it takes in a step.
constexpr std::uint32_t kDeferredRoom = 64;  ///< For pairs of nodes of a walk that wait for nodes. A walk ends before a
                                             ///< step could need more.
constexpr std::uint32_t kMostWanted = 16;    ///< So many of them, those that overlap most, get their nodes next.
static_assert(kDeferredRoom <= kWalkGroup && kMostWanted <= kDeferredRoom,
              "each has an invocation when they are sorted");
constexpr std::uint32_t kMostSteps = 1u << 12;  ///< Of a walk: longer ones are the host's, as a watchdog may look.
constexpr std::uint32_t kWalkStack = 256;       ///< Pairs of nodes that a walk keeps; as above.

/// What answers say of a question that they belong to; the shaders have the same.
constexpr std::uint32_t kCheckFactor = 0x9e3779b1u;
inline std::uint32_t check(const std::uint32_t* words, std::size_t count) {
  std::uint32_t sum = 0, factor = 1;
  // From the last: products that need not wait for each other.
  for (std::size_t i = count; i-- > 0; factor *= kCheckFactor) sum += words[i] * factor;
  return sum;
}
inline std::uint32_t check(const Cell& cell) {
  std::uint32_t words[sizeof(Cell) / 4];
  std::memcpy(words, &cell, sizeof(cell));
  return check(words, std::size(words));
}

/// All of these as constants of the shaders' language.
std::string constants();

}  // namespace bocst::oracle::gl::layout
