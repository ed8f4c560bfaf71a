// SPDX-License-Identifier: BSD-3-Clause
#include "fcl/queries/collide_pair.h"

#include <fcl/config.h>
#include <fcl/geometry/bvh/BVH_model.h>

#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

#include "fcl/adapters/models.h"
#include "fcl/adapters/pair.h"
#include "fcl/adapters/validate.h"
#include "fcl/queries/collide_bodies.h"
#include "fcl/queries/collide_query.h"
#include "fcl/queries/collide_row.h"
#include "fcl/queries/collide_trees.h"
#include "fcl/queries/grow_together.h"
#include "fcl/queries/inside.h"
#include "fcl/queries/inside_contact.h"
#include "fcl/queries/mesh_collector.h"
#include "fcl/queries/query_scope.h"
#include "log/assert.h"
#include "query/collide/pair_walk.h"
#include "thread/of_thread.h"

namespace bocst::fcl_adapter {
namespace {

using query::BoxSide;
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

/// A collision query of a model, side A, and a BVHModel, while the tree's query lock is held.
template <typename S>
class BvhCollision {
 public:
  BvhCollision(const CollideQuery<S>& q, const TreeSide& a, const BvhSide& b)
      : q_(q),
        a_(a),
        b_(b),
        relative_(relate<S>(q, a, b)),
        to_a_(withMargin(relative_.b_in_a, a, q, q.cullingMargin(a.isConservative()))) {}

  /// Adds contacts to the result.
  void run() const {
    tree::Tree& tree = a_.tree();
    if (isOutOfSight(q_, relative_.b_in_a, magnitudeOf(tree.surface().bounds), b_.magnitude())) return;
    const std::size_t before = q_.result.numContacts();
    walk(before);
    if (q_.mayBeInside(before) && contains<S>(tree, q_.X_WA(), b_, q_.X_WB(), relative_.magnitude)) {
      addInside(q_, a_, b_, relative_.b_in_a);
    }
  }

 private:
  static constexpr query::Turns::Limits kLimits = {256, 1024, 1024, 1}, kLimitsOfContacts = {1024, 1024, 1024, 1};

  // Between flat faces and beside slivers, oriented boxes separate what blocks do not, as with two models, see
  // TreesCollision.
  void walk(std::size_t contacts_before) const {
    const bool uses_boxes = std::is_same<S, double>::value && !(q_.margin > 0) && BoxSide::fits(a_);
    // Once boxes are built, they soon tell that flat parts are apart.
    const WalkInOrder in_order =
        prepareWalkInOrder(q_, {&a_.tree()}, uses_boxes && query::Turns::arePaid(a_, b_),
                           [this](const CollideQuery<S>& any) { BvhCollision<S>(any, a_, b_).walk(0); });
    if (in_order == WalkInOrder::kNothingTouches) return;

    std::size_t steps = 0;
    collect(q_, [&](MeshCollector<S>& collector) {
      if (in_order == WalkInOrder::kReady && walkInOrder(collector, steps)) return;
      const auto walk_blocks = [&](std::size_t most) {
        return query::PairWalk<TreeSide, BvhSide>(a_, b_, to_a_, collector).run(most);
      };
      if (to_a_.margin > 0 && !a_.isConservative() && collector.endsAtFirst()) {
        walkWithinMargin(a_, b_, relative_.b_in_a, to_a_, collector, kMostNodePairs, walk_blocks);
      } else if (uses_boxes && (collector.endsAtFirst() || query::Turns::arePaid(a_, b_))) {
        const auto& limits = collector.endsAtFirst() ? kLimits : kLimitsOfContacts;
        query::walkByTurns(a_, b_, to_a_, collector, limits, walk_blocks);
      } else {
        steps += walk_blocks(query::kNoLimit).steps;
      }
    });
    // A walk for a verdict pays for boxes itself, a walk for contacts where it found none.
    if (uses_boxes && !q_.endsAtFirst() && q_.result.numContacts() == contacts_before) {
      query::Turns(a_, b_, tree::Tree::Search::kYesOrNo, kLimits).tookOverBlocks(steps, true);
    }
  }

  // False where it gave up, later than two models do: by position takes longer here.
  bool walkInOrder(MeshCollector<S>& collector, std::size_t& steps) const {
    const TreeSide a(a_.tree(), a_.now());  // the root may be another one than a_ has seen
    if (query::outlinesHardlyOverlap(a, b_.volume(b_.root()), to_a_)) return false;

    collector.beginInOrder();
    const query::WalkEnd end =
        query::PairWalk<TreeSide, BvhSide>(a, b_, to_a_, collector).runInOrder(q_.mostLeafPairs(128));
    steps = end.steps;
    collector.endInOrder(end.gave_up);
    return !end.gave_up;
  }

  // Calls f(collector), and hands what was collected to the query's result.
  template <typename F>
  void collect(const CollideQuery<S>& q, F&& f) const {
    const Triangles<S> of_model(a_.tree()), of_partner(b_);
    MeshCollector<S> collector(q, a_.tree(), q.swapped ? of_partner : of_model, q.swapped ? of_model : of_partner,
                               relative_.magnitude);
    const lattice::Lattice& lattice = a_.tree().surface().lattice;
    collector.setFrame(lattice, relative_.b_in_a.tolerance + q.margin / lattice.unit());
    f(collector);
    collector.finish();
  }

  const CollideQuery<S>& q_;
  const TreeSide& a_;
  const BvhSide& b_;
  const RelativeSides relative_;
  const query::SimilarityTransform to_a_;
};

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
  const Interior *of_a = treeOf(a).interior(scope.a().now()), *of_b = treeOf(b).interior(scope.b().now());
  if (of_a == nullptr || of_b == nullptr) return false;
  const OrderedPair<S> pair{&a, X_WA, &b, X_WB, false};
  return query::surelyCross(*of_a, *of_b, relate<S>(pair, scope.a(), scope.b()).b_in_a);
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
