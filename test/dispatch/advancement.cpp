// SPDX-License-Identifier: BSD-3-Clause
#include "advancement.h"

#ifdef WITH_HEADER
#include <bocst/bocst.h>
#endif
#include <fcl/math/motion/translation_motion.h>
#include <fcl/narrowphase/continuous_collision.h>

bool advances(const fcl::CollisionGeometry<double>& a, const fcl::CollisionGeometry<double>& b, double begin,
              double end, fcl::GJKSolverType solver) {
  const auto at = [](double x) { return fcl::Transform3d(Eigen::Translation3d(x, 0, 0)); };
  const fcl::TranslationMotiond still(at(0), at(0)), moving(at(begin), at(end));
  fcl::ContinuousCollisionRequestd request;
  request.gjk_solver_type = solver;
  fcl::ContinuousCollisionResultd result;
  result.is_collide = begin < end;  // The query must set it.
  fcl::continuousCollideConservativeAdvancement<double>(&a, &still, &b, &moving, request, result);
  return result.is_collide;
}
