// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/export.h>
#include <bocst/model.h>

namespace bocst {

/// Are two geometries at the poses X_W1 and X_W2 (world from geometry) no farther apart than `distance`, a length in
/// the world's unit? Ends as soon as that is known, so it takes far less time than fcl::distance. The answer is
/// `fcl::distance(...) <= distance` up to rounding: 0 asks whether they touch. Solids and shapes count their insides.
///
/// Pairs are those of bocst::collide (<bocst/fcl.h>), and o1 and o2 may be in either order. For a model with
/// conservative answers the spheres of its cells are its surface. Options::margin does not count here.
///
/// Threads: as collide(); any number of queries at the same time.
/// @throws std::invalid_argument for a pose that is none, or a distance that is negative, NaN or infinite;
/// std::logic_error where neither geometry is a Model.
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
