// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>

namespace bocst::query {

/// Two boxes a and b, each in its own frame, and how near they may come. All in one length unit.
struct PoseBoxes {
  double middle_a[3], middle_b[3];
  double half_a[3], half_b[3];
  double along_b[3];          ///< How far b reaches along its own axes, which need not be quite orthogonal.
  double radius_sum;          ///< From the middle of a to its corners, and from b's origin to those of b, at most.
  double allowed;             ///< A gap that is no larger parts nothing.
  double allowed_per_length;  ///< It grows so with the length of the translation.
};

/// Bounds on the sums of fcl_adapter::isSurelyRigid() for poses that findNearPoses() settles, and the largest entry of
/// R^T R - I that they leave, rounded up.
constexpr double kPoseStretch = 1e-4, kPoseShear = 1e-8, kPoseSkew = 2e-4;

/// Writes to near[] the numbers k of the poses of b in the frame of a that it cannot settle, in their order, and
/// returns how many: those whose boxes are not surely apart by more than what is allowed, those that are not surely
/// rigid (by the bounds above), and those whose last row is not 0 0 0 1.
/// Pose k is the 16 numbers from X_AB + 16 * k on, row after row if `rows`, else column after column.
///
/// Boxes are apart by the spheres about them, or along the six axes of both. Those of b are the columns of R.
template <typename S>
std::size_t findNearPoses(const PoseBoxes& boxes, const S* X_AB, bool rows, std::size_t count, std::uint32_t* near);

}  // namespace bocst::query
