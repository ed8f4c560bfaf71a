// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "scene/bounds.h"
#include "scene/boxes.h"

// Finds for rows of poses, several at a time, whether they are rigid, how far they move objects, and where the objects'
// boxes are. A pose is sixteen numbers of S, the matrix of an fcl::Transform3 column after column; its last row is not
// read. A state is a pose of each moving object in a row. Chosen at run time for the machine's instruction set.

namespace bocst::scene {

/// At most this many poses are read together; arrays of one number a moving object have room for whole such groups.
constexpr std::size_t kPosesAtOnce = 4;
constexpr std::size_t roomFor(std::size_t moving) { return (moving + kPosesAtOnce - 1) / kPosesAtOnce * kPosesAtOnce; }

/// The bounds of moving objects (see Bounds), a number each. An object without a box has no limit to its size.
struct BoundsRows {
  std::size_t moving = 0;
  std::vector<double> center[3], axes[3][3], half[3];  ///< axes[k][j]: coordinate j of axis k.
  std::vector<double> reach, radius, size;
};
BoundsRows rowsOf(const std::vector<Bounds>& bounds);

/// Goes through states until one has a pose that is not surely rigid (fcl_adapter::isSurelyRigid()), and returns how
/// many were before it. Raises deviations[i] to |shear| + stretch^2 / 4 of moving object i's poses in these
/// (fcl_adapter::RigidSums).
template <typename S>
std::size_t rigidStates(const S* poses, std::size_t states, std::size_t moving, double* deviations);

/// Writes to path[k * roomFor(moving) + i] how far points of moving object i have moved until state k, at most, and to
/// place[i] the largest sum of the sizes of a translation's coordinates.
///
/// From one pose to the next, a point at c + x of the centre c moves by (Y - X) c + (R_Y - R_X) x. For rotations the
/// norm of R_Y - R_X is 1/sqrt(2) of its Frobenius norm. Where they are off by an orthogonality error, it is more by
/// less than 4 of it: that is not in `path`. Sums of roundings are far below the millionth that is added.
template <typename S>
void measurePaths(const S* poses, std::size_t states, const BoundsRows& bounds, double* path, double* place);

/// What boxes are made of beside poses and bounds.
struct Placing {
  const double* orthogonality_errors;  ///< Of each moving object's pose, at most.
  const double* reach;                 ///< Of its box, where it is not 0; else it follows from the pose.
  double origin[3];                    ///< Coordinates of boxes count from here.
  double largest;                      ///< World's.
};

/// Sets the lanes of moving objects in groups to their boxes in a state; as World::boxAt(). Writes those that need that
/// function to `others`, and returns how many.
template <typename S>
std::size_t placeBoxes(const S* state, const BoundsRows& bounds, const Placing& placing, BoxGroup* groups,
                       std::uint32_t* others);

}  // namespace bocst::scene
