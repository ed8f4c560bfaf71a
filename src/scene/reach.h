// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <limits>

// What is added to boxes of objects, so that nothing that may be called a contact is outside.

namespace bocst::scene {

/// Boxes of rotations that are off by more are boxes along the axes of the world, so that all axes are at right angles.
constexpr double kFineError = 1e-5;

/// An object that is larger or farther away gets no box and counts as overlapping everything, because its half extents
/// do not fit a float.
constexpr double kUnboxedSize = 1e12;

/// What may be called a contact farther than the boxes are apart: FCL computes relative poses in S (64 roundings of
/// everything that is added up); where rotations are off by an orthogonality error, lengths along them are, of either
/// object, and walks tolerate four times that share of the frames' distance and of both sizes twice over; and the box
/// is in float, with axes that are off by as much (see nearLanes()).
///
/// A box's reach is its bounds' and: per_place times what the coordinates of its pose's translation add up to, and its
/// size; per_error times the orthogonality error, times the size of the largest object and its own; per_displacement
/// times what the coordinates of its centre from the scene's origin add up to, and its radius; and `least`, as smaller
/// numbers lose digits as floats.
struct ReachFactors {
  double per_place, per_error, per_displacement, least;
};
template <typename S>
constexpr ReachFactors reachFactors() {
  return {64 * static_cast<double>(std::numeric_limits<S>::epsilon()), 128, 128 * 0x1p-24, 1e-30};
}

}  // namespace bocst::scene
