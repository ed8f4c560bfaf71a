// SPDX-License-Identifier: BSD-3-Clause
#include "fcl/plugin/registration.h"

BOCST_FCL_TABLE(Distance, GJKSolver_libccd<double>)
BOCST_FCL_TABLE(Distance, GJKSolver_indep<double>)
BOCST_FCL_DISTANCE_SOLVER(, double, GJKSolver_libccd)
BOCST_FCL_DISTANCE_SOLVER(, double, GJKSolver_indep)
BOCST_FCL_DISTANCE(, double)

template void bocst::fcl_adapter::registerDistance<double>();
