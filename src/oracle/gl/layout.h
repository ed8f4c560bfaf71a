// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "bounds/node_bounds.h"

/// The tables that the compute shaders share with each other and with the host. The shaders get these numbers, and
/// those of the codec of node bounds, under the same names.
namespace bocst::oracle::gl::layout {

constexpr std::uint32_t kGroup = 128;        ///< Invocations of a work group.
constexpr std::uint32_t kAll = 0xffffffffu;  ///< As a list: the triangles of the mesh, in order.

// Per cell, in words. Maxima of values that are never negative start at 0, so a cleared table is an empty one.
constexpr std::uint32_t kGrey = 0;              ///< Octants that a triangle surely meets.
constexpr std::uint32_t kLoose = 1;             ///< Octants with a part that only its box bounds: no slab.
constexpr std::uint32_t kCounts = 2;            ///< 8: lengths of the octants' lists.
constexpr std::uint32_t kNext = kCounts + 8;    ///< 8: where the next triangle of each list goes.
constexpr std::uint32_t kOctants = kNext + 8;   ///< 8 times kOctantWords.
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
constexpr std::uint32_t kHeader = 2;
constexpr std::uint32_t kBoundsWords = sizeof(CellAnswer) / 4;  ///< At the beginning of a row.
constexpr std::uint32_t kRowSizes = kBoundsWords;               ///< 8: lengths of the octants' lists.
constexpr std::uint32_t kRowList = kRowSizes + 8;               ///< Where octant 0's list begins; the others follow.
constexpr std::uint32_t kRowIds = kRowList + 1;                 ///< Where the ids begin, likewise.
constexpr std::uint32_t kRow = kRowIds + 1;

/// All of these as constants of the shaders' language.
std::string constants();

}  // namespace bocst::oracle::gl::layout
