// SPDX-License-Identifier: BSD-3-Clause
#include "fcl/queries/scene_pair.h"

#include "fcl/adapters/pair.h"
#include "fcl/queries/query_scope.h"
#include "query/collide/sphere_walk.h"
#include "query/collide/tree_walk.h"

namespace bocst::fcl_adapter {

template <typename S>
bool hullsApart(const Model<S>& a, const fcl::Transform3<S>& X_WA, const Model<S>& b, const fcl::Transform3<S>& X_WB,
                double gap) {
  const QueryScope scope(treeOf(a), treeOf(b));
  const OrderedPair<S> pair{&a, X_WA, &b, X_WB, false};
  query::SimilarityTransform b_in_a = relate<S>(pair, scope.a(), scope.b()).b_in_a;
  const bool spheres = query::SphereWalk::fits(scope.a(), scope.b());
  if (!spheres && !query::TreeWalk::fits(scope.a(), scope.b(), b_in_a)) return false;
  b_in_a.tolerance += (marginOf(&a, &b) + gap) / unitOf(scope.a());
  if (spheres) return query::SphereWalk(scope.a(), scope.b(), b_in_a).areBoxesApart();
  return query::TreeWalk(scope.a(), scope.b(), b_in_a).isNeedless();
}

template <typename S>
std::unique_ptr<Model<S>> modelOfBvh(const fcl::CollisionGeometry<S>& geometry) {
  bvhSideOf<S>("Scene", &geometry);  // throws unless it is a finished mesh
  std::unique_ptr<Model<S>> model;
  withBvh<S>("Scene", &geometry, [&](const auto& bvh) { model = std::make_unique<Model<S>>(bvh); });
  model->threshold_occupied = geometry.threshold_occupied;
  model->cost_density = geometry.cost_density;
  return model;
}

template std::unique_ptr<Model<float>> modelOfBvh<float>(const fcl::CollisionGeometry<float>&);
template std::unique_ptr<Model<double>> modelOfBvh<double>(const fcl::CollisionGeometry<double>&);
template bool hullsApart<float>(const Model<float>&, const fcl::Transform3<float>&, const Model<float>&,
                                const fcl::Transform3<float>&, double);
template bool hullsApart<double>(const Model<double>&, const fcl::Transform3<double>&, const Model<double>&,
                                 const fcl::Transform3<double>&, double);

}  // namespace bocst::fcl_adapter
