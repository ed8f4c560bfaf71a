// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/geometry/collision_geometry.h>
#include <fcl/narrowphase/gjk_solver_type.h>

/// Whether FCL's continuousCollideConservativeAdvancement finds a contact of `a`, which rests at the origin, and `b`,
/// which moves along x from `begin` to `end`. A source of its own: without <bocst/fcl.h>, FCL's whole table of pairs is
/// compiled where it is called.
bool advances(const fcl::CollisionGeometry<double>& a, const fcl::CollisionGeometry<double>& b, double begin,
              double end, fcl::GJKSolverType solver);
