// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/common/types.h>
#include <fcl/narrowphase/collision_request.h>
#include <fcl/narrowphase/continuous_collision_request.h>
#include <fcl/narrowphase/distance_request.h>
#include <fcl/narrowphase/distance_result.h>

#include <Eigen/Geometry>
#include <cmath>

// What is no pose, no tolerance and no option is refused: nothing answers "free" to nonsense. Each function throws
// std::invalid_argument that names the query, the argument and its value.

namespace bocst::fcl_adapter {

/// A rotation R is refused where an entry of R^T R - 1 is larger. Rotations of floats that were multiplied some
/// thousand times stay below; what a walk allows for grows with it (SimilarityTransform::orthogonality_error).
constexpr double kMaxOrthogonalityError = 1e-3;

/// Is the pose rigid for sure? Seldom false where it is. With singular values s of R, the sum of s^2 is 3 and their
/// product is 1 for rotations only, as the geometric mean of s^2 is below the arithmetic one. For s = 1 + e the sum of
/// s^2 minus twice their product, minus 1, is 2 sum e^2 - (sum e)^2 up to third order; with both bounds below,
/// sum e^2 < 1e-8, so no entry of R^T R - 1 is larger than 3e-4.
template <typename S>
bool isSurelyRigid(const fcl::Transform3<S>& X) {
  const S* m = X.matrix().data();  // columns of four
  const double a0 = m[0], a1 = m[1], a2 = m[2], b0 = m[4], b1 = m[5], b2 = m[6], c0 = m[8], c1 = m[9], c2 = m[10];
  const double squares = (a0 * a0 + a1 * a1 + a2 * a2) + (b0 * b0 + b1 * b1 + b2 * b2) + (c0 * c0 + c1 * c1 + c2 * c2);
  const double determinant = a0 * (b1 * c2 - b2 * c1) + a1 * (b2 * c0 - b0 * c2) + a2 * (b0 * c1 - b1 * c0);
  // x - x is 0, and NaN for what is not finite.
  const double nothing = (m[12] - m[12]) + (m[13] - m[13]) + (m[14] - m[14]);
  const double stretch = std::abs(squares - 3 + nothing), shear = squares - 2 * determinant - 1;
  return (stretch <= 1e-4) & (shear <= 1e-8);
}

/// @throws std::invalid_argument unless the translation is finite and the rotation is one, see kMaxOrthogonalityError.
void refuseUnlessRigid(const char* query, const char* argument, const Eigen::Isometry3d& X);

template <typename S>
void checkPose(const char* query, const char* argument, const fcl::Transform3<S>& X) {
  if (__builtin_expect(isSurelyRigid(X), 1)) return;
  Eigen::Isometry3d in_double = Eigen::Isometry3d::Identity();
  in_double.linear() = X.linear().template cast<double>();
  in_double.translation() = X.translation().template cast<double>();
  refuseUnlessRigid(query, argument, in_double);
}

template <typename S>
void checkRequest(const fcl::CollisionRequest<S>& request);
template <typename S>
void checkRequest(const fcl::DistanceRequest<S>& request, const fcl::DistanceResult<S>& result);
template <typename S>
void checkRequest(const fcl::ContinuousCollisionRequest<S>& request);

/// Of a solver that the caller brought.
void checkTolerance(const char* query, const char* argument, double tolerance);

}  // namespace bocst::fcl_adapter
