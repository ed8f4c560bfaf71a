// SPDX-License-Identifier: BSD-3-Clause
//
// A plugin whose initialiser starts a thread that asks FCL about two balls, and waits for it. The dynamic linker holds
// its lock meanwhile, so the query must not wait for that lock. planner() returns 0 if FCL's answer was right.

#include <fcl/geometry/shape/sphere.h>
#include <fcl/narrowphase/collision.h>

#include <thread>

namespace {

std::size_t found = 0;

const bool asked = [] {
  std::thread([] {
    const fcl::Sphere<double> a(1), b(1);
    fcl::Transform3<double> X_WB = fcl::Transform3<double>::Identity();
    X_WB.translation() << 1, 0, 0;
    fcl::CollisionResult<double> result;
    found = fcl::collide<double>(&a, fcl::Transform3<double>::Identity(), &b, X_WB, fcl::CollisionRequest<double>(),
                                 result);
  }).join();
  return true;
}();

}  // namespace

extern "C" __attribute__((visibility("default"))) int planner() { return asked && found == 1 ? 0 : 1; }
