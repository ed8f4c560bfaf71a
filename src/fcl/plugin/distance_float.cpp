// SPDX-License-Identifier: BSD-3-Clause
#include "fcl/plugin/registration.h"

BOCST_FCL_DISTANCE_SOLVER(, float, GJKSolver_libccd)
BOCST_FCL_DISTANCE_SOLVER(, float, GJKSolver_indep)
BOCST_FCL_DISTANCE(, float)

template void bocst::fcl_adapter::registerDistance<float>();
