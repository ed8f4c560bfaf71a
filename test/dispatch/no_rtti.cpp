// SPDX-License-Identifier: BSD-3-Clause
//
// A program that is compiled with -fno-rtti, as FCL's headers allow, and derives a geometry of its own, which so has no
// type information. Exits with 0 if FCL's answers about it are right.

#include <fcl/geometry/shape/box.h>
#include <fcl/geometry/shape/sphere.h>
#include <fcl/narrowphase/collision.h>
#include <fcl/narrowphase/continuous_collision.h>
#include <fcl/narrowphase/distance.h>

namespace {

struct Ball : fcl::Sphere<double> {
  using fcl::Sphere<double>::Sphere;
};

bool collide(const fcl::CollisionGeometry<double>& a, const fcl::CollisionGeometry<double>& b,
             const fcl::Transform3<double>& X_WB) {
  fcl::CollisionResult<double> result;
  const auto X_WA = fcl::Transform3<double>::Identity();
  return fcl::collide<double>(&a, X_WA, &b, X_WB, fcl::CollisionRequest<double>(), result) == 1;
}

}  // namespace

int main() {
  const Ball ball(1);
  const fcl::Box<double> box(1, 1, 1);
  const auto X_WA = fcl::Transform3<double>::Identity();
  fcl::Transform3<double> X_WB = X_WA;
  if (!collide(ball, box, X_WB) || !collide(box, ball, X_WB)) return 1;
  X_WB.translation() << 3, 0, 0;
  if (collide(ball, box, X_WB) || collide(box, ball, X_WB)) return 1;
  fcl::DistanceResult<double> distance;
  const double gap = fcl::distance<double>(&ball, X_WA, &box, X_WB, fcl::DistanceRequest<double>(), distance);
  if (gap < 1.49 || gap > 1.51) return 1;
  fcl::ContinuousCollisionResult<double> result;
  fcl::continuousCollide<double>(&ball, X_WA, X_WA, &box, X_WB, X_WA, fcl::ContinuousCollisionRequest<double>(),
                                 result);
  return result.is_collide ? 0 : 1;
}
