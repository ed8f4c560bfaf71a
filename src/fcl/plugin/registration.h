// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// clang-format off
#include "fcl/plugin/fcl_tables.h"  // Before any other header of FCL: it declares what FCL then finds declared.
// clang-format on

#include <bocst/fcl.h>

#include <iostream>
#include <limits>
#include <typeinfo>

#include "fcl/adapters/models.h"
#include "fcl/collide/collide_pair.h"
#include "fcl/plugin/libfcl.h"
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
  // No dynamic_cast, which takes as long as FCL does for a far pair, and ends a program whose classes have no RTTI.
  return &typeid(*geometry) == &typeid(Sentinel<S>);
}

/// FCL's own words for a slot that nobody fills: fcl::TriangleP has our node type too.
template <typename S>
void warnAsFcl(const char* query, const fcl::CollisionGeometry<S>* o1, const fcl::CollisionGeometry<S>* o2) {
  std::cerr << "Warning: " << query << " function between node type " << o1->getNodeType() << " and node type "
            << o2->getNodeType() << " is not supported\n";
}

/// The collision query where a Model may be among the two; where there is none, what foreign() says.
template <typename S, typename Foreign>
std::size_t collideOr(const Foreign& foreign, const fcl::CollisionGeometry<S>* o1, const fcl::Transform3<S>& X_W1,
                      const fcl::CollisionGeometry<S>* o2, const fcl::Transform3<S>& X_W2,
                      const BroughtSolver<S>& solver, const fcl::CollisionRequest<S>& request,
                      fcl::CollisionResult<S>& result) {
  switch (kindOf<S>("collide", o1, o2)) {
    case PairKind::kForeign:
      return foreign();
    case PairKind::kNothing:
      return result.numContacts();
    case PairKind::kModel:
      break;
  }
  if (request.num_max_contacts > 0) return collidePair<S>(o1, X_W1, o2, X_W2, solver, request, result);
  std::cerr << "Warning: should stop early as num_max_contact is 0 !\n";
  return 0;
}

// What stands in FCL's tables.

template <typename S, typename Solver>
std::size_t collideEntry(const fcl::CollisionGeometry<S>* o1, const fcl::Transform3<S>& X_W1,
                         const fcl::CollisionGeometry<S>* o2, const fcl::Transform3<S>& X_W2, const Solver* solver,
                         const fcl::CollisionRequest<S>& request, fcl::CollisionResult<S>& result) {
  const auto foreign = [&]() -> std::size_t {
    if (isSentinel<S>(o1)) return Sentinel<S>::kReached;
    warnAsFcl<S>("collision", o1, o2);
    return 0;
  };
  return collideOr<S>(foreign, o1, X_W1, o2, X_W2, solver, request, result);
}

template <typename S, typename Solver>
S distanceEntry(const fcl::CollisionGeometry<S>* o1, const fcl::Transform3<S>& X_W1,
                const fcl::CollisionGeometry<S>* o2, const fcl::Transform3<S>& X_W2, const Solver*,
                const fcl::DistanceRequest<S>& request, fcl::DistanceResult<S>& result) {
  const PairKind kind = kindOf<S>("distance", o1, o2);
  if (kind == PairKind::kNothing) return result.min_distance;
  if (kind == PairKind::kModel) return distancePair<S>(o1, X_W1, o2, X_W2, request, result);
  if (isSentinel<S>(o1)) return Sentinel<S>::kReached;
  warnAsFcl<S>("distance", o1, o2);
  return std::numeric_limits<S>::max();
}

/// In double only, as libfcl has none in float.
template <typename Solver>
double advancementEntry(const fcl::CollisionGeometry<double>* o1, const fcl::MotionBase<double>* motion1,
                        const fcl::CollisionGeometry<double>* o2, const fcl::MotionBase<double>* motion2, const Solver*,
                        const fcl::ContinuousCollisionRequest<double>& request,
                        fcl::ContinuousCollisionResult<double>& result) {
  if (kindOf<double>("continuousCollide", o1, o2) != PairKind::kForeign) {
    return continuousPair<double>(o1, motion1, o2, motion2, request, result);
  }
  warnAsFcl<double>("collision", o1, o2);
  return -1;
}

constexpr bool isBvh(int node_type) { return node_type >= fcl::BV_AABB && node_type <= fcl::BV_KDOP24; }
constexpr bool isFclShape(int node_type) { return node_type >= fcl::GEOM_BOX && node_type <= fcl::GEOM_HALFSPACE; }

/// One of FCL's tables: `entry` where has(row, column); elsewhere FCL says that it does not support the pair.
template <typename Entry, typename Has>
void fillTable(Entry (&matrix)[fcl::NODE_COUNT][fcl::NODE_COUNT], Entry entry, Has&& has) {
  for (int row = 0; row < fcl::NODE_COUNT; ++row) {
    for (int column = 0; column < fcl::NODE_COUNT; ++column) matrix[row][column] = has(row, column) ? entry : nullptr;
  }
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

/// In double.
void registerContinuous();

}  // namespace bocst::fcl_adapter

namespace fcl::detail {
// These tables in double lead to libfcl's queries (collide_double.cpp, continuous_double.cpp); for others FCL's
// constructor is compiled.
template <>
CollisionFunctionMatrix<GJKSolver_libccd<double>>::CollisionFunctionMatrix();
template <>
CollisionFunctionMatrix<GJKSolver_indep<double>>::CollisionFunctionMatrix();
template <>
ConservativeAdvancementFunctionMatrix<GJKSolver_libccd<double>>::ConservativeAdvancementFunctionMatrix();
template <>
ConservativeAdvancementFunctionMatrix<GJKSolver_indep<double>>::ConservativeAdvancementFunctionMatrix();
}  // namespace fcl::detail
