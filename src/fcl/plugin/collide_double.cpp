// SPDX-License-Identifier: BSD-3-Clause
#include "fcl/plugin/registration.h"

BOCST_FCL_COLLIDE_SOLVER(, double, GJKSolver_libccd)
BOCST_FCL_COLLIDE_SOLVER(, double, GJKSolver_indep)
// Not fcl::collide<double>: libfcl's own is what checkDispatch() has to see.

template void bocst::fcl_adapter::registerCollide<double>();
