// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/math/motion/interp_motion.h>
#include <fcl/math/motion/screw_motion.h>
#include <fcl/math/motion/spline_motion.h>
#include <fcl/math/motion/translation_motion.h>
#include <fcl/narrowphase/continuous_collision_request.h>

#include <memory>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <typeinfo>
#include <utility>

#include "fcl/adapters/models.h"
#include "fcl/adapters/pair.h"
#include "fcl/adapters/validate.h"
#include "geometry/motion.h"

// FCL's motions, as the walks know them. Nothing here writes to a motion, so threads may share one that nobody else
// integrates.

namespace bocst::fcl_adapter {

/// Where a motion begins. Asks a copy: integrate() writes to its motion.
template <typename S, typename M>
Eigen::Isometry3d beginOf(M motion) {
  motion.integrate(0);
  fcl::Transform3<S> X;
  motion.getCurrentTransform(X);
  return isometryOf<S>(X);
}

template <typename S>
query::AxisMotion read(const fcl::TranslationMotion<S>& m) {
  return {beginOf<S>(m), m.getVelocity().template cast<double>()};
}

template <typename S>
query::AxisMotion read(const fcl::InterpMotion<S>& m) {
  const Eigen::Isometry3d begin = beginOf<S>(m);
  return {begin, m.getLinearVelocity().template cast<double>(),
          -(begin.linear() * m.getReferencePoint().template cast<double>()), m.getAngularAxis().template cast<double>(),
          static_cast<double>(m.getAngularVelocity())};
}

template <typename S>
query::AxisMotion read(const fcl::ScrewMotion<S>& m) {
  const Eigen::Vector3d axis = m.getAxis().template cast<double>();
  // Without a turn, FCL's axis is no unit vector; this is how its integrate() moves then.
  const Eigen::Vector3d velocity = axis * static_cast<double>(m.getLinearVelocity());
  if (m.getAngularVelocity() == 0) return {beginOf<S>(m), velocity};
  const Eigen::Isometry3d begin = beginOf<S>(m);
  return {begin, velocity, begin.translation() - m.getAxisOrigin().template cast<double>(), axis,
          static_cast<double>(m.getAngularVelocity())};
}

/// Gives access to the points, which are protected members. No object of it is made.
template <typename S>
struct SplineView : fcl::SplineMotion<S> {
  static query::SplineMotion read(const fcl::SplineMotion<S>& m) {
    query::SplineMotion::Points positions, rotations;
    for (std::size_t i = 0; i < 4; ++i) {
      positions[i] = (m.*&SplineView::Td)[i].template cast<double>();
      rotations[i] = (m.*&SplineView::Rd)[i].template cast<double>();
    }
    return {positions, rotations};
  }
};

template <typename S>
query::SplineMotion read(const fcl::SplineMotion<S>& m) {
  return SplineView<S>::read(m);
}

/// The motion as a Known<S>, if that is what it is. (FCL's InterpMotion<float> and ScrewMotion<float> are abstract.)
template <typename Known, typename S>
std::unique_ptr<query::Motion> readAs(const fcl::MotionBase<S>& motion) {
  if constexpr (!std::is_abstract_v<Known>) {
    if (typeid(motion) == typeid(Known)) {
      auto m = read<S>(static_cast<const Known&>(motion));
      return std::make_unique<decltype(m)>(std::move(m));
    }
  }
  return nullptr;
}

/// @throws std::invalid_argument that names the argument when it is none of FCL's own, since nobody else says how fast
/// it can get, or has no rigid poses.
template <typename S>
std::unique_ptr<query::Motion> motionOf(const char* argument, const fcl::MotionBase<S>* motion) {
  const auto bad = [argument](const std::string& what) {
    throw std::invalid_argument(std::string("bocst::continuousCollide: ") + argument + " " + what);
  };
  if (motion == nullptr) bad("is null");
  std::unique_ptr<query::Motion> m = readAs<fcl::TranslationMotion<S>>(*motion);
  if (!m) m = readAs<fcl::InterpMotion<S>>(*motion);
  if (!m) m = readAs<fcl::ScrewMotion<S>>(*motion);
  if (!m) m = readAs<fcl::SplineMotion<S>>(*motion);
  if (!m) {
    bad("is none of fcl's TranslationMotion, InterpMotion, ScrewMotion and SplineMotion, but " +
        typeName(typeid(*motion)));
  }
  for (const double time : {0.0, 1.0}) refuseUnlessRigid("continuousCollide", argument, m->at(time));
  return m;
}

/// The pose at a time from 0 to 1.
template <typename S>
fcl::Transform3<S> poseAt(const query::Motion& motion, double time) {
  return motion.at(time).cast<S>();
}

/// From one pose to another. FCL 0.7 makes an InterpMotion with an unset reference point and a SplineMotion with unset
/// points; here the reference point is the body's origin, and the spline is the straight one.
/// @throws std::invalid_argument where the two are farther apart than the largest number.
template <typename S>
std::unique_ptr<query::Motion> motionOf(const fcl::Transform3<S>& begin, const fcl::Transform3<S>& end,
                                        fcl::CCDMotionType type) {
  const Eigen::Isometry3d X = isometryOf<S>(begin), Y = isometryOf<S>(end);
  if (!(Y.translation() - X.translation()).allFinite()) {
    throw std::invalid_argument("bocst: the begin and the end of a motion are farther apart than the largest number");
  }
  switch (type) {
    case fcl::CCDM_TRANS:
      return std::make_unique<query::AxisMotion>(query::translation(X, Y));
    case fcl::CCDM_LINEAR:
      return std::make_unique<query::AxisMotion>(query::interpolation(X, Y));
    case fcl::CCDM_SCREW:
      return std::make_unique<query::AxisMotion>(query::screw(X, Y));
    case fcl::CCDM_SPLINE:
      return std::make_unique<query::SplineMotion>(query::spline(X, Y));
  }
  throw std::invalid_argument("bocst: the motion type " + std::to_string(static_cast<int>(type)) +
                              " is none of fcl::CCDMotionType");
}

}  // namespace bocst::fcl_adapter
