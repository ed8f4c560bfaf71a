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

template <typename Solver>
std::size_t collide(const fcl::CollisionGeometry<double>* o1, const fcl::Transform3<double>& X_W1,
                    const fcl::CollisionGeometry<double>* o2, const fcl::Transform3<double>& X_W2, const Solver* solver,
                    const fcl::CollisionRequest<double>& request, fcl::CollisionResult<double>& result) {
  using namespace bocst::fcl_adapter;
  const auto foreign = [&]() -> std::size_t {
    if (isSentinel<double>(o1)) return Sentinel<double>::kReached;
    return libfcl::collide<Solver>(o1, X_W1, o2, X_W2, solver, request, result);
  };
  if (solver != nullptr) return collideOr<double>(foreign, o1, X_W1, o2, X_W2, solver, request, result);
  const Solver standard;  // FCL's for null, whatever the request asks for
  return collideOr<double>(foreign, o1, X_W1, o2, X_W2, &standard, request, result);
}

}  // namespace

#define BOCST_OWN_COLLIDE(Solver)                                                                                    \
  template <>                                                                                                        \
  std::size_t fcl::collide<double, fcl::detail::Solver<double>>(                                                     \
      const CollisionGeometry<double>* o1, const Transform3<double>& X_W1, const CollisionGeometry<double>* o2,      \
      const Transform3<double>& X_W2, const detail::Solver<double>* solver, const CollisionRequest<double>& request, \
      CollisionResult<double>& result) {                                                                             \
    return ::collide(o1, X_W1, o2, X_W2, solver, request, result);                                                   \
  }
BOCST_OWN_COLLIDE(GJKSolver_libccd)
BOCST_OWN_COLLIDE(GJKSolver_indep)
#undef BOCST_OWN_COLLIDE

// Read by code that compiled FCL's collide itself. FCL's constructors would compile all of FCL's queries into this
// library.
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

BOCST_FCL_TABLE(Collision, GJKSolver_libccd<double>)
BOCST_FCL_TABLE(Collision, GJKSolver_indep<double>)
BOCST_FCL_COLLIDE_OBJECTS(, double, GJKSolver_libccd)
BOCST_FCL_COLLIDE_OBJECTS(, double, GJKSolver_indep)
// Not fcl::collide<double>: libfcl's own is what checkDispatch() has to see.

template void bocst::fcl_adapter::registerCollide<double>();
