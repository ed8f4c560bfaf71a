// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/common/types.h>
#include <fcl/narrowphase/collision_request.h>
#include <fcl/narrowphase/continuous_collision_request.h>
#include <fcl/narrowphase/distance_request.h>
#include <fcl/narrowphase/distance_result.h>

#include <Eigen/Geometry>
#include <cstring>

// Arguments that are not a pose, a tolerance or an option are refused: a query must not answer "free" for them. Each
// check throws std::invalid_argument that names the query, the argument and its value.

namespace bocst::fcl_adapter {

/// A rotation R is refused where an entry of R^T R - I is larger. Rotations of floats that were multiplied some
/// thousand times stay below; what a walk allows for grows with it (SimilarityTransform::orthogonality_error).
constexpr double kMaxOrthogonalityError = 1e-3;

/// No entry of R^T R - I is larger where isSurelyRigid() says so.
constexpr double kSurelyRigidError = 2e-5;

/// Sums that tell rotations from other matrices. The singular values are 1 + e; products of three e are left out.
template <typename Number>
struct RigidSums {
  Number stretch;  ///< 2 sum e + sum e^2: the sum of the squares of all entries, minus 3
  Number shear;    ///< 2 sum e^2 - (sum e)^2: the same sum minus twice the determinant, minus 1
};

/// `m(i)` is entry i of a pose's matrix, column after column; a Number may be a vector of several poses' numbers. Both
/// are NaN for a translation that is not finite.
template <typename Number, typename Matrix>
RigidSums<Number> rigidSumsOf(const Matrix& m) {
  const Number a0 = m(0), a1 = m(1), a2 = m(2), b0 = m(4), b1 = m(5), b2 = m(6), c0 = m(8), c1 = m(9), c2 = m(10);
  const Number x = m(12), y = m(13), z = m(14);
  // x - x is 0, or NaN.
  const Number squares = (a0 * a0 + a1 * a1 + a2 * a2) + (b0 * b0 + b1 * b1 + b2 * b2) + (c0 * c0 + c1 * c1 + c2 * c2) +
                         ((x - x) + (y - y) + (z - z));
  const Number determinant = a0 * (b1 * c2 - b2 * c1) + a1 * (b2 * c0 - b0 * c2) + a2 * (b0 * c1 - b1 * c0);
  return {squares - 3.0, squares - 2.0 * determinant - 1.0};
}

constexpr double kSurelyRigidStretch = 1e-5, kSurelyRigidShear = 1e-10;

/// True if a pose is surely rigid. Seldom false where it is. With these bounds no |e| is above 8e-6, and the
/// determinant is positive, so R is no reflection.
template <typename Number>
auto isSurelyRigid(const RigidSums<Number>& sums) {
  return (sums.stretch <= kSurelyRigidStretch) & (sums.stretch >= -kSurelyRigidStretch) &
         (sums.shear <= kSurelyRigidShear);
}

template <typename S>
bool isSurelyRigid(const fcl::Transform3<S>& X) {
  const S* m = X.matrix().data();
  return isSurelyRigid(rigidSumsOf<double>([m](int i) { return static_cast<double>(m[i]); }));
}

/// Of two poses in the time of one, a lane each.
using Two = double __attribute__((vector_size(16)));
template <typename S>
RigidSums<Two> rigidSumsOf(const fcl::Transform3<S>& X, const fcl::Transform3<S>& Y) {
  const S *m = X.matrix().data(), *n = Y.matrix().data();
  return rigidSumsOf<Two>([m, n](int i) { return Two{static_cast<double>(m[i]), static_cast<double>(n[i])}; });
}

template <typename S>
bool areSurelyRigid(const fcl::Transform3<S>& X, const fcl::Transform3<S>& Y) {
  const auto rigid = isSurelyRigid(rigidSumsOf(X, Y));
  return (rigid[0] & rigid[1]) != 0;
}

/// The largest entry of R^T R - I, where I is the identity.
inline double orthogonalityError(const Eigen::Matrix3d& R) {
  return (R.transpose() * R - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
}
template <typename S>
double orthogonalityErrorOf(const fcl::Transform3<S>& X) {
  return orthogonalityError(X.linear().template cast<double>());
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
void refuseUnlessSound(const fcl::CollisionRequest<S>& request);

template <typename S>
void checkRequest(const fcl::CollisionRequest<S>& request) {
  unsigned solver;  // Copied as a number: to read an enum that holds none of its values is undefined behaviour.
  static_assert(sizeof solver == sizeof request.gjk_solver_type);
  std::memcpy(&solver, &request.gjk_solver_type, sizeof solver);
  const bool sound = request.gjk_tolerance >= 0 && request.gjk_tolerance <= 1 && solver <= 1;
  if (__builtin_expect(!sound || request.enable_cached_gjk_guess, 0)) refuseUnlessSound(request);
}
template <typename S>
void checkRequest(const fcl::DistanceRequest<S>& request, const fcl::DistanceResult<S>& result);
template <typename S>
void checkRequest(const fcl::ContinuousCollisionRequest<S>& request);

/// @throws std::invalid_argument unless it is finite and at least 0.
void checkTolerance(const char* query, const char* argument, double tolerance);

}  // namespace bocst::fcl_adapter
