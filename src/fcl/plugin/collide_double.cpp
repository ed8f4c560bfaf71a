// SPDX-License-Identifier: BSD-3-Clause
#include <fcl/config.h>

#include "fcl/plugin/registration.h"

namespace {

using bocst::fcl_adapter::isBvh;
using bocst::fcl_adapter::isFclShape;

// The pairs of FCL's own table: a shape before a mesh is turned round before it is looked at.
bool fclCollides(int row, int column) {
  const bool of_shapes = isFclShape(column), of_octree = FCL_HAVE_OCTOMAP && column == fcl::GEOM_OCTREE;
  if (isBvh(row)) return of_shapes || of_octree || row == column;
  if (isFclShape(row)) return of_shapes || of_octree;
  return FCL_HAVE_OCTOMAP && row == fcl::GEOM_OCTREE && (of_shapes || of_octree || isBvh(column));
}

}  // namespace

// FCL's constructors would compile all of FCL's queries into this library.
template <>
fcl::detail::CollisionFunctionMatrix<fcl::detail::GJKSolver_libccd<double>>::CollisionFunctionMatrix() {
  bocst::fcl_adapter::fillTable(collision_matrix, &bocst::fcl_adapter::libfcl::collide<GJKSolver_libccd<double>>,
                                fclCollides);
}
template <>
fcl::detail::CollisionFunctionMatrix<fcl::detail::GJKSolver_indep<double>>::CollisionFunctionMatrix() {
  bocst::fcl_adapter::fillTable(collision_matrix, &bocst::fcl_adapter::libfcl::collide<GJKSolver_indep<double>>,
                                fclCollides);
}

BOCST_FCL_COLLIDE_SOLVER(, double, GJKSolver_libccd)
BOCST_FCL_COLLIDE_SOLVER(, double, GJKSolver_indep)
// Not fcl::collide<double>: libfcl's own is what checkDispatch() has to see.

template void bocst::fcl_adapter::registerCollide<double>();
