// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// clang-format off
#include "fcl/plugin/fcl_tables.h"  // Before any other header of FCL: it declares what FCL then finds declared.
// clang-format on

#include <bocst/fcl.h>

#include <algorithm>
#include <iostream>
#include <iterator>
#include <limits>
#include <type_traits>

#include "fcl/adapters/models.h"
#include "fcl/plugin/libfcl.h"
#include "fcl/queries/collide_pair.h"
#include "fcl/queries/distance_pair.h"

namespace bocst::fcl_adapter {

/// What checkDispatch() asks about: no shape, only a way to see whether a query arrives.
template <typename S>
class Sentinel final : public fcl::CollisionGeometry<S> {
 public:
  /// The answer of every query that arrives; exact in float.
  static constexpr int kReached = 0xb0c57;

  void computeLocalAABB() override {}
  fcl::NODE_TYPE getNodeType() const override { return fcl::GEOM_TRIANGLE; }
};

template <typename S>
bool isSentinel(const fcl::CollisionGeometry<S>* geometry) {
  return dynamic_cast<const Sentinel<S>*>(geometry) != nullptr;
}

/// FCL's own words for a slot that nobody fills: fcl::TriangleP has our node type too.
template <typename S>
void warnAsFcl(const char* query, const fcl::CollisionGeometry<S>* o1, const fcl::CollisionGeometry<S>* o2) {
  std::cerr << "Warning: " << query << " function between node type " << o1->getNodeType() << " and node type "
            << o2->getNodeType() << " is not supported\n";
}

// What stands in FCL's tables.

template <typename S, typename Solver>
std::size_t collideEntry(const fcl::CollisionGeometry<S>* o1, const fcl::Transform3<S>& X_W1,
                         const fcl::CollisionGeometry<S>* o2, const fcl::Transform3<S>& X_W2, const Solver* solver,
                         const fcl::CollisionRequest<S>& request, fcl::CollisionResult<S>& result) {
  const PairKind kind = kindOf<S>(o1, o2);
  if (kind == PairKind::kNothing) return 0;
  if (kind == PairKind::kModel) return collidePair<S>(o1, X_W1, o2, X_W2, solver, request, result);
  if (isSentinel<S>(o1)) return Sentinel<S>::kReached;
  if constexpr (std::is_same<S, double>::value) {
    return libfcl::collide<Solver>(o1, X_W1, o2, X_W2, solver, request, result);
  } else {
    warnAsFcl<S>("collision", o1, o2);
    return 0;
  }
}

template <typename S, typename Solver>
S distanceEntry(const fcl::CollisionGeometry<S>* o1, const fcl::Transform3<S>& X_W1,
                const fcl::CollisionGeometry<S>* o2, const fcl::Transform3<S>& X_W2, const Solver*,
                const fcl::DistanceRequest<S>& request, fcl::DistanceResult<S>& result) {
  const PairKind kind = kindOf<S>(o1, o2);
  if (kind == PairKind::kNothing) return result.min_distance;
  if (kind == PairKind::kModel) return distancePair<S>(o1, X_W1, o2, X_W2, request, result);
  if (isSentinel<S>(o1)) return Sentinel<S>::kReached;
  warnAsFcl<S>("distance", o1, o2);
  return std::numeric_limits<S>::max();
}

/// All of one of FCL's tables.
template <typename Entry>
void fillTable(Entry (&matrix)[fcl::NODE_COUNT][fcl::NODE_COUNT], Entry entry) {
  for (auto& row : matrix) std::fill(std::begin(row), std::end(row), entry);
}

/// The row and the column of Model's node type in one of FCL's tables.
template <typename Entry>
void fillSlots(Entry (&matrix)[fcl::NODE_COUNT][fcl::NODE_COUNT], Entry entry) {
  for (int other = 0; other < fcl::NODE_COUNT; ++other) {
    matrix[fcl::GEOM_TRIANGLE][other] = entry;
    matrix[other][fcl::GEOM_TRIANGLE] = entry;
  }
}

// Each is compiled where its table is, in the .cpp file beside this that is named after it.

template <typename S>
void registerCollide() {
  using Libccd = fcl::detail::GJKSolver_libccd<S>;
  using Indep = fcl::detail::GJKSolver_indep<S>;
  fillSlots(fcl::getCollisionFunctionLookTable<Libccd>().collision_matrix, &collideEntry<S, Libccd>);
  fillSlots(fcl::getCollisionFunctionLookTable<Indep>().collision_matrix, &collideEntry<S, Indep>);
}
extern template void registerCollide<float>();
extern template void registerCollide<double>();

template <typename S>
void registerDistance() {
  using Libccd = fcl::detail::GJKSolver_libccd<S>;
  using Indep = fcl::detail::GJKSolver_indep<S>;
  fillSlots(fcl::getDistanceFunctionLookTable<Libccd>().distance_matrix, &distanceEntry<S, Libccd>);
  fillSlots(fcl::getDistanceFunctionLookTable<Indep>().distance_matrix, &distanceEntry<S, Indep>);
}
extern template void registerDistance<float>();
extern template void registerDistance<double>();

}  // namespace bocst::fcl_adapter

namespace fcl::detail {
// Tables in double lead to libfcl's queries (collide_double.cpp); for other scalars FCL's constructor is compiled.
template <>
CollisionFunctionMatrix<GJKSolver_libccd<double>>::CollisionFunctionMatrix();
template <>
CollisionFunctionMatrix<GJKSolver_indep<double>>::CollisionFunctionMatrix();
}  // namespace fcl::detail
