// SPDX-License-Identifier: BSD-3-Clause
#include "fcl/collide/collide_pair.h"

#include <fcl/config.h>

#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

#include "fcl/adapters/models.h"
#include "fcl/adapters/pair.h"
#include "fcl/adapters/validate.h"
#include "fcl/collide/bvh_collision.h"
#include "fcl/collide/collide_bodies.h"
#include "fcl/collide/collide_query.h"
#include "fcl/collide/collide_row.h"
#include "fcl/collide/trees_collision.h"
#include "fcl/pair/grow_together.h"
#include "fcl/pair/query_scope.h"
#include "log/assert.h"
#include "thread/of_thread.h"

namespace bocst::fcl_adapter {
namespace {

using query::TreeSide;

/// The models among two geometries, of which one at least is one.
template <typename S>
struct Models {
  Models(const fcl::CollisionGeometry<S>* o1, const fcl::CollisionGeometry<S>* o2)
      : first(asModel<S>(o1)), second(asModel<S>(o2)) {
    BOCST_ASSERT(first != nullptr || second != nullptr);
  }
  bool areTwo() const { return first != nullptr && second != nullptr; }
  const Model<S>*first, *second;
};

// True if the second is to be side A. Without a choice, only where the first is no model.
template <typename S>
bool turnsRound(const Models<S>& models, const fcl::Transform3<S>& X_W1, const fcl::Transform3<S>& X_W2) {
  if (!models.areTwo()) return models.first == nullptr;
  return walksTurned(treeOf(*models.first), X_W1, treeOf(*models.second), X_W2);
}

template <typename S>
void collideBvh(const CollideQuery<S>& q, tree::Tree& tree, const BvhSide& b) {
  if (areFarApart(tree, q.X_WA(), b, q.X_WB(), q.margin)) return;
  const QueryScope scope(tree);
  BvhCollision<S>(q, scope.a(), b).run();
}

template <typename S>
std::size_t answer(const CollideQuery<S>& q, const Models<S>& models, const BroughtSolver<S>& solver) {
  if (q.request.isSatisfied(q.result)) return q.result.numContacts();
  if (!q.occupied() && (q.o1->isFree() || q.o2->isFree() || !q.request.enable_cost)) return q.result.numContacts();
  const Model<S>*a = models.first, *b = models.second;
  q.inCallersOrder(a, b);
  if (b != nullptr) {
    const QueryScope scope(treeOf(*a), treeOf(*b));
    TreesCollision<S>(q, scope.a(), scope.b()).run(TreesCollision<S>::Wanted::kContacts);
  } else if (isShape(q.b())) {
    collideShape(q, treeOf(*a), solver);
#if FCL_HAVE_OCTOMAP
  } else if (q.b()->getNodeType() == fcl::GEOM_OCTREE) {
    collideOcTree(q, treeOf(*a), solver);
#endif
  } else {
    collideBvh(q, treeOf(*a), bvhSideOf<S>("collide", q.b()));
  }
  return q.result.numContacts();
}

}  // namespace

template <typename S>
std::size_t collidePair(const fcl::CollisionGeometry<S>* o1, const fcl::Transform3<S>& X_W1,
                        const fcl::CollisionGeometry<S>* o2, const fcl::Transform3<S>& X_W2,
                        const BroughtSolver<S>& solver, const fcl::CollisionRequest<S>& request,
                        fcl::CollisionResult<S>& result, const std::optional<double>& margin) {
  const Models<S> models(o1, o2);
  const bool are_rigid = areSurelyRigid(X_W1, X_W2);
  if (!are_rigid) {
    checkPose("collide", "tf1", X_W1);
    checkPose("collide", "tf2", X_W2);
  }
  checkRequest(request);
  const double m = margin ? *margin : marginOf(models.first, models.second);
  // Most of a planner's pairs end here.
  query::Hulls hulls = query::Hulls::kUnknown;
  if (are_rigid && models.areTwo() &&
      areFarApart(treeOf(*models.first), X_W1, treeOf(*models.second), X_W2, m, hulls)) {
    return result.numContacts();
  }
  const OrderedPair<S> pair{o1, X_W1, o2, X_W2, turnsRound(models, X_W1, X_W2)};
  return answer(CollideQuery<S>{pair, request, result, m, margin.has_value(), hulls}, models, solver);
}

namespace {

// Yes or no for two occupied models.
template <typename S>
bool touchAt(const Models<S>& models, const fcl::Transform3<S>& X_W1, const fcl::Transform3<S>& X_W2, double margin,
             query::Hulls hulls = query::Hulls::kUnknown) {
  static const fcl::CollisionRequest<S> request;
  struct Scratch {
    fcl::CollisionResult<S> result;
  };
  fcl::CollisionResult<S>& result = thread::ofThread<Scratch>().result;
  result.clear();
  const OrderedPair<S> pair{models.first, X_W1, models.second, X_W2, turnsRound(models, X_W1, X_W2)};
  const CollideQuery<S> q{pair, request, result, margin, false, hulls};
  const QueryScope scope(treeOf(*models.first), treeOf(*models.second));
  const TreeSide &a = q.swapped ? scope.b() : scope.a(), &b = q.swapped ? scope.a() : scope.b();
  if (TreesCollision<S>(q, a, b).run(TreesCollision<S>::Wanted::kVerdict)) return true;
  if (!result.isCollision()) return false;
  a.tree().payInterior(a.now());
  b.tree().payInterior(b.now());
  return true;
}

}  // namespace

template <typename S>
bool touch(const Model<S>& a, const fcl::Transform3<S>& X_WA, const Model<S>& b, const fcl::Transform3<S>& X_WB) {
  return a.isOccupied() && b.isOccupied() && touchAt(Models<S>(&a, &b), X_WA, X_WB, marginOf(&a, &b));
}

template <typename S>
bool surelyTouch(const Model<S>& a, const fcl::Transform3<S>& X_WA, const Model<S>& b, const fcl::Transform3<S>& X_WB) {
  if (!a.isOccupied() || !b.isOccupied()) return false;
  const QueryScope scope(treeOf(a), treeOf(b));
  const OrderedPair<S> pair{&a, X_WA, &b, X_WB, false};
  return query::surelyCross(scope.a(), scope.b(), relate<S>(pair, scope.a(), scope.b()).b_in_a);
}

template <typename S>
void collideRow(const Model<S>& a, const Model<S>& b, const fcl::Transform3<S>* X_AB, std::size_t count,
                std::uint8_t* hit) {
  static const fcl::Transform3<S> identity = fcl::Transform3<S>::Identity();
  std::fill(hit, hit + count, std::uint8_t{0});
  if (!a.isOccupied() || !b.isOccupied()) return;
  const Models<S> models(&a, &b);
  const double margin = marginOf(&a, &b);
  // Of solids whose surfaces are apart, one may still be inside the other.
  const bool may_be_inside = treeOf(a).options().solid || treeOf(b).options().solid;
  const std::vector<Spheres>* spheres = nullptr;
  if (growsTogether(a, b)) {
    struct Scratch {
      std::vector<PosedPair<S>> pairs;
    };
    std::vector<PosedPair<S>>& pairs = thread::ofThread<Scratch>().pairs;
    pairs.clear();
    for (std::size_t k = 0; k < count; ++k) pairs.push_back({&a, identity, &b, X_AB[k]});
    spheres = &growTogether(pairs);
  }
  for (std::size_t k = 0; k < count; ++k) {
    const Spheres found = spheres != nullptr ? (*spheres)[k] : Spheres::kUnknown;
    hit[k] = found == Spheres::kMeet;
    if (found == Spheres::kMeet || (found == Spheres::kApart && !may_be_inside)) continue;
    query::Hulls hulls = query::Hulls::kUnknown;
    if (isSurelyRigid(X_AB[k]) && areFarApart(treeOf(a), identity, treeOf(b), X_AB[k], margin, hulls)) continue;
    hit[k] = touchAt(models, identity, X_AB[k], margin, hulls);
  }
}

#define BOCST_INSTANTIATE(S)                                                                                           \
  template void collideRow(const Model<S>&, const Model<S>&, const fcl::Transform3<S>*, std::size_t, std::uint8_t*);   \
  template bool touch(const Model<S>&, const fcl::Transform3<S>&, const Model<S>&, const fcl::Transform3<S>&);         \
  template bool surelyTouch(const Model<S>&, const fcl::Transform3<S>&, const Model<S>&, const fcl::Transform3<S>&);   \
  template std::size_t collidePair(const fcl::CollisionGeometry<S>*, const fcl::Transform3<S>&,                        \
                                   const fcl::CollisionGeometry<S>*, const fcl::Transform3<S>&,                        \
                                   const BroughtSolver<S>&, const fcl::CollisionRequest<S>&, fcl::CollisionResult<S>&, \
                                   const std::optional<double>&);
BOCST_INSTANTIATE(float)
BOCST_INSTANTIATE(double)
#undef BOCST_INSTANTIATE

}  // namespace bocst::fcl_adapter
