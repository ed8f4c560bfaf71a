// SPDX-License-Identifier: BSD-3-Clause
#include "fcl/adapters/validate.h"

#include <cmath>
#include <cstring>
#include <sstream>
#include <stdexcept>
#include <string>
#include <type_traits>

namespace bocst::fcl_adapter {
namespace {

[[noreturn]] void refuse(const char* query, const char* argument, const std::string& what) {
  throw std::invalid_argument(std::string("bocst::") + query + ": " + argument + " " + what);
}

template <typename T>
std::string text(const T& value) {
  static const Eigen::IOFormat format(Eigen::StreamPrecision, Eigen::DontAlignCols, ", ", "; ", "", "", "(", ")");
  std::ostringstream out;
  if constexpr (std::is_arithmetic_v<T>) {
    out << value;
  } else {
    out << value.format(format);
  }
  return out.str();
}

/// Copied as a number: to read an enum that holds none of its values is undefined behaviour.
template <typename Enum>
void checkEnum(const char* query, const char* argument, const Enum& value, int count) {
  std::underlying_type_t<Enum> number;
  std::memcpy(&number, &value, sizeof number);
  if (static_cast<unsigned>(number) >= static_cast<unsigned>(count)) {
    refuse(query, argument, "is " + std::to_string(static_cast<int>(number)) + ", which is none of FCL's values");
  }
}

}  // namespace

void refuseUnlessRigid(const char* query, const char* argument, const Eigen::Isometry3d& X) {
  if (!X.translation().allFinite()) {
    refuse(query, argument, "has the translation " + text(X.translation().transpose()) + ", which is not finite");
  }
  const Eigen::Matrix3d R = X.linear();
  const auto refuseRotation = [&](const std::string& what) {
    refuse(query, argument, "has the rotation " + text(R) + ", " + what);
  };
  if (!R.allFinite()) refuseRotation("which is not finite");
  const double error = orthogonalityError(R);
  if (!(error <= kMaxOrthogonalityError)) {
    refuseRotation("whose product with its transpose is off the identity by " + text(error) + "; at most " +
                   text(kMaxOrthogonalityError) + " is allowed");
  }
  if (R.determinant() < 0) refuseRotation("which is a reflection");
}

void checkTolerance(const char* query, const char* argument, double tolerance) {
  if (!(tolerance >= 0) || !std::isfinite(tolerance)) {
    refuse(query, argument, "is " + text(tolerance) + ", not a finite number of at least 0");
  }
}

template <typename S>
void refuseUnlessSound(const fcl::CollisionRequest<S>& request) {
  checkTolerance("collide", "request.gjk_tolerance", static_cast<double>(request.gjk_tolerance));
  checkEnum("collide", "request.gjk_solver_type", request.gjk_solver_type, 2);
  if (request.enable_cached_gjk_guess && !request.cached_gjk_guess.allFinite()) {
    refuse("collide", "request.cached_gjk_guess",
           "is " + text(request.cached_gjk_guess.transpose()) + ", which is not finite");
  }
}

template <typename S>
void checkRequest(const fcl::DistanceRequest<S>& request, const fcl::DistanceResult<S>& result) {
  checkTolerance("distance", "request.rel_err", static_cast<double>(request.rel_err));
  checkTolerance("distance", "request.abs_err", static_cast<double>(request.abs_err));
  checkTolerance("distance", "request.distance_tolerance", static_cast<double>(request.distance_tolerance));
  checkEnum("distance", "request.gjk_solver_type", request.gjk_solver_type, 2);
  if (std::isnan(result.min_distance)) refuse("distance", "result.min_distance", "is nan");
}

template <typename S>
void checkRequest(const fcl::ContinuousCollisionRequest<S>& request) {
  checkTolerance("continuousCollide", "request.toc_err", static_cast<double>(request.toc_err));
  checkEnum("continuousCollide", "request.ccd_motion_type", request.ccd_motion_type, 4);
  checkEnum("continuousCollide", "request.ccd_solver_type", request.ccd_solver_type, 4);
  checkEnum("continuousCollide", "request.gjk_solver_type", request.gjk_solver_type, 2);
}

template void refuseUnlessSound<float>(const fcl::CollisionRequest<float>&);
template void refuseUnlessSound<double>(const fcl::CollisionRequest<double>&);
template void checkRequest<float>(const fcl::DistanceRequest<float>&, const fcl::DistanceResult<float>&);
template void checkRequest<double>(const fcl::DistanceRequest<double>&, const fcl::DistanceResult<double>&);
template void checkRequest<float>(const fcl::ContinuousCollisionRequest<float>&);
template void checkRequest<double>(const fcl::ContinuousCollisionRequest<double>&);

}  // namespace bocst::fcl_adapter
