// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

// Rows of poses, several at a time: are they rigid, and how far do they move objects? A pose is sixteen numbers of S,
// the matrix of an fcl::Transform3 column after column; its last row is not read. A state is `moving` poses in a row.
// Chosen at run time for the machine's instruction set.

namespace bocst::scene {

/// So many poses are read together at most; arrays of one number a moving object have room for whole such groups.
constexpr std::size_t kPosesAtOnce = 4;
constexpr std::size_t roomFor(std::size_t moving) { return (moving + kPosesAtOnce - 1) / kPosesAtOnce * kPosesAtOnce; }

/// Goes through states until one has a pose that is not surely rigid (fcl_adapter::isSurelyRigid()), and returns how
/// many were before it. Raises deviations[i] to |shear| + stretch^2 / 4 of moving object i's poses in these
/// (fcl_adapter::RigidSums).
template <typename S>
std::size_t rigidStates(const S* poses, std::size_t states, std::size_t moving, double* deviations);

/// What measurePaths() knows of objects and says of them, a number each.
struct PathRow {
  const double* center[3];  ///< In the object's frame.
  const double* radius;     ///< About it.
  double* path;   ///< [k * roomFor(moving) + i]: how far points of moving object i have moved until state k, at most.
  double* place;  ///< The largest sum of the sizes of a translation's coordinates.
};

/// From one pose to the next, a point at c + x of the centre c moves by (Y - X) c + (R_Y - R_X) x. For rotations the
/// norm of R_Y - R_X is 1/sqrt(2) of its Frobenius norm. Where they are off by an orthogonality error, it is more by
/// less than 4 of it: that is not in `path`. Sums of roundings are far below the millionth that is added.
template <typename S>
void measurePaths(const S* poses, std::size_t states, std::size_t moving, const PathRow& row);

}  // namespace bocst::scene
