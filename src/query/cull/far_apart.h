// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "geometry/volume.h"
#include "query/sides/side.h"
#include "tree/outline.h"

namespace bocst::query {

/// True if two outlines are surely farther apart than `margin`, along the line of their centers, one of their own axes
/// or a product of these (Gottschalk et al., OBBTree, 1996). X_WA and X_WB place the frames of a and b in the world: 16
/// numbers, column after column; the last row is not read. All in float, whose range ends where sizes are not within
/// 1e-15 to 1e15: these are never far apart.
///
/// The poses must be rigid but for 2e-5, the largest entry of R^T R - I. A gap counts beyond 2e-4 of all sizes, see
/// share/doc/rounding.md.
template <typename S>
bool areFarApart(const tree::Outline& a, const S* X_WA, const tree::Outline& b, const S* X_WB, double margin);
template <typename S>
bool areFarApart(const tree::Outline& a, const S* X_WA, const tree::Outline::Box& b, const S* X_WB, double margin);

/// False if they overlap along each of their own axes by more than what areFarApart() allows for.
template <typename S>
bool mayBeApart(const tree::Outline& a, const S* X_WA, const tree::Outline& b, const S* X_WB);

/// True if the outlines of two models are surely apart, by boxesApart(). Of flat parts close to each other, which
/// blocks separate only near their leaves, and which are not far apart: a gap counts beyond 1e-6 of all sizes. Takes
/// ten times as long as mayBeApart().
bool outlinesApart(const TreeSide& a, const TreeSide& b, const SimilarityTransform& b_in_a);

/// True if the outlines overlap by little along a face's normal, as those of a part that lies on another.
bool outlinesHardlyOverlap(const TreeSide& a, const TreeSide& b, const SimilarityTransform& b_in_a);
/// The same beside the box of another partner, in its frame.
bool outlinesHardlyOverlap(const TreeSide& a, const OrientedVolume& b, const SimilarityTransform& b_in_a);

/// True if the outlines are about equal, in size and place: of a part and its copy.
bool outlinesCoincide(const TreeSide& a, const TreeSide& b, const SimilarityTransform& b_in_a);

}  // namespace bocst::query
