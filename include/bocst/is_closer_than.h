// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/export.h>
#include <bocst/model.h>

namespace bocst {

/// True if the distance between two geometries at the poses X_W1 and X_W2 (world from geometry) is at most `distance`,
/// in the world's length unit. Stops once the answer is known, so it mostly takes less time than fcl::distance. The
/// answer is `fcl::distance(...) <= distance` of the same geometries, up to the error of distances (<bocst/fcl.h>):
/// FCL's own distance of two BVHModels may be off by more. 0 tests for contact. Solids and shapes include their inside.
///
/// Pairs are those of bocst::collide (<bocst/fcl.h>); o1 and o2 may be in either order. The surface of a model with
/// conservative answers is the set of its cells' spheres. Options::margin has no effect here. The answer is false if
/// one of the two is an empty model or is not occupied (CollisionGeometry::isOccupied()).
///
/// Thread rule: as collide(); any number of queries may run at the same time.
/// @throws std::invalid_argument for a null pointer, a partner that is not supported, a pose that is not rigid, or a
/// distance that is negative, NaN or infinite; std::logic_error if neither geometry is a Model.
template <typename S>
BOCST_EXPORT bool isCloserThan(const fcl::CollisionGeometry<S>* o1, const fcl::Transform3<S>& X_W1,
                               const fcl::CollisionGeometry<S>* o2, const fcl::Transform3<S>& X_W2, S distance);

extern template BOCST_EXPORT bool isCloserThan<float>(const fcl::CollisionGeometry<float>*,
                                                      const fcl::Transform3<float>&,
                                                      const fcl::CollisionGeometry<float>*,
                                                      const fcl::Transform3<float>&, float);
extern template BOCST_EXPORT bool isCloserThan<double>(const fcl::CollisionGeometry<double>*,
                                                       const fcl::Transform3<double>&,
                                                       const fcl::CollisionGeometry<double>*,
                                                       const fcl::Transform3<double>&, double);

}  // namespace bocst
