// SPDX-License-Identifier: BSD-3-Clause
#include "fcl/plugin/registration.h"

// FCL's constructor would compile all of FCL's queries into this library.
template <>
fcl::detail::CollisionFunctionMatrix<fcl::detail::GJKSolver_libccd<double>>::CollisionFunctionMatrix() {
  bocst::fcl_adapter::fillTable(collision_matrix, &bocst::fcl_adapter::collideEntry<double, GJKSolver_libccd<double>>);
}
template <>
fcl::detail::CollisionFunctionMatrix<fcl::detail::GJKSolver_indep<double>>::CollisionFunctionMatrix() {
  bocst::fcl_adapter::fillTable(collision_matrix, &bocst::fcl_adapter::collideEntry<double, GJKSolver_indep<double>>);
}

BOCST_FCL_COLLIDE_SOLVER(, double, GJKSolver_libccd)
BOCST_FCL_COLLIDE_SOLVER(, double, GJKSolver_indep)
// Not fcl::collide<double>: libfcl's own is what checkDispatch() has to see.

template void bocst::fcl_adapter::registerCollide<double>();
