// SPDX-License-Identifier: BSD-3-Clause
#include "fcl/queries/collide_pair.h"

#include <fcl/config.h>
#include <fcl/geometry/bvh/BVH_model.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <type_traits>
#include <vector>

#include "fcl/adapters/models.h"
#include "fcl/adapters/pair.h"
#include "fcl/adapters/validate.h"
#include "fcl/queries/collide_bodies.h"
#include "fcl/queries/collide_query.h"
#include "fcl/queries/collide_row.h"
#include "fcl/queries/grow_together.h"
#include "fcl/queries/inside.h"
#include "fcl/queries/inside_contact.h"
#include "fcl/queries/mesh_collector.h"
#include "fcl/queries/query_scope.h"
#include "log/assert.h"
#include "query/collide/pair_walk.h"
#include "query/collide/sphere_walk.h"
#include "query/collide/tree_walk.h"
#include "query/cull/crossing.h"
#include "query/cull/far_apart.h"
#include "query/distance/distance_walk.h"
#include "query/sides/box_side.h"

namespace bocst::fcl_adapter {
namespace {

using query::SimilarityTransform;
using query::TreeSide;

/// What is within the margin touches: the walk's tolerance, in units of side A, is so much more. Positions may be off
/// by the tolerance before. `culling_margin`: the margin, or what CollideQuery::cullingMargin() has for slabs.
template <typename S>
SimilarityTransform withMargin(SimilarityTransform b_in_a, const TreeSide& a, const CollideQuery<S>& q,
                               double culling_margin) {
  const double per_unit = 1 / a.tree().surface().lattice.unit();
  b_in_a.margin = std::max(q.margin * per_unit - b_in_a.tolerance, 0.0);
  b_in_a.tolerance += culling_margin * per_unit;
  return b_in_a;
}

/// Are two meshes, and the spheres of their cells, apart because their distance exceeds the range of a walk's floats? A
/// walk would overflow, or lose the distance in its tolerance. Most queries compare one number.
template <typename S>
bool isOutOfSight(const CollideQuery<S>& q, const SimilarityTransform& b_in_a, double size_a, double size_b) {
  if (b_in_a.tolerance < 1e15) return false;
  const Eigen::Vector3d half_way =
      q.X_W1.translation().template cast<double>() / 2 - q.X_W2.translation().template cast<double>() / 2;
  return half_way.cwiseAbs().maxCoeff() > 8 * (size_a + size_b) + q.margin;
}

// Is a surface so long and thin that the float walk's rounding, which is a part of its length, is as wide as it is? The
// walk in double parts what that one cannot; of two such surfaces, along the axes of oriented boxes.
bool isNeedle(const tree::Tree& tree) {
  constexpr float kThin = 0x1p-12f;
  return tree.outline().read([](const tree::Outline::Reader& box) {
    const float x = box.half(0), y = box.half(1), z = box.half(2);
    const float most = std::max({x, y, z}), least = std::min({x, y, z}), middle = x + y + z - most - least;
    return middle < kThin * most;
  });
}

/// Not with float: FCL may see contacts of slivers that oriented boxes separate.
template <typename S>
constexpr bool kUsesBoxes = std::is_same<S, double>::value;

/// A yes-or-no walk of a query with a margin. Beside a margin that is much larger than nodes and triangles, these
/// separate nothing: so if the walks over blocks and oriented boxes get as long as a search for the distance usually
/// takes, that is asked whether anything is near enough to be tested. walk_blocks(most_steps) returns a query::WalkEnd.
/// near.margin > 0: the margin exceeds rounding, so the distance of two triangles alone decides whether they touch.
template <typename S, typename WalkBlocks>
void walkWithinMargin(const TreeSide& a, const TreeSide& b, const SimilarityTransform& near,
                      MeshCollector<S>& collector, WalkBlocks&& walk_blocks) {
  constexpr std::size_t kFewSteps = 64, kMostSteps = 4096;
  constexpr double kAnyWillDo = 1e300;
  const bool boxes = kUsesBoxes<S> && a.tree().knownBoxes() != nullptr && b.tree().knownBoxes() != nullptr;
  if (!walk_blocks(boxes ? kFewSteps : kMostSteps).gave_up) return;
  if (boxes) {
    const query::BoxSide boxes_a(a), boxes_b(b);
    query::PairWalk<query::BoxSide, query::BoxSide> walk(boxes_a, boxes_b, near, collector);
    walk.run(kMostSteps);
    if (!walk.gaveUp()) return;
  }
  // What the search computes is off by less than this; so are the lengths of the tolerance.
  constexpr double kRounding = 1e-12;
  const double below = near.tolerance * (1 + kRounding) + kRounding * 2 * lattice::kMiddle * (1 + near.scale);
  const query::Nearest nearest = query::findNearest(a, b, near, {below, kAnyWillDo, kAnyWillDo});
  if (!std::isfinite(nearest.distance)) return;
  // Else the distance and the margin are the same up to rounding.
  const bool meets =
      collector.triangles(static_cast<std::uint32_t>(nearest.a), static_cast<std::uint32_t>(nearest.b), false);
  if (!meets) walk_blocks(~std::size_t{0});
}

/// What a query wants: contacts, or only whether there is one.
enum class Wanted { kContacts, kVerdict };

/// Adds contacts to the result. True where only a verdict is wanted and probes prove contact; then there may be none.
template <typename S>
bool collideTrees(const CollideQuery<S>& q, const TreeSide& a, const TreeSide& b, Wanted wanted) {
  const std::size_t before = q.result.numContacts();
  tree::Tree &tree_a = a.tree(), &tree_b = b.tree();
  const auto [b_in_a, magnitude] = relate<S>(q, a, b);
  if (isOutOfSight(q, b_in_a, magnitudeOf(tree_a.surface().bounds), magnitudeOf(tree_b.surface().bounds))) return false;
  const auto isProved = [&, &b_in_a = b_in_a] {
    if (wanted != Wanted::kVerdict) return false;
    const Interior *of_a = tree_a.interior(a.now()), *of_b = tree_b.interior(b.now());
    return of_a != nullptr && of_b != nullptr && query::surelyCross(*of_a, *of_b, b_in_a);
  };
  const auto walkFor = [&, &b_in_a = b_in_a, magnitude = magnitude](const CollideQuery<S>& of, auto&& with_collector) {
    const Triangles<S> t1(q.swapped ? tree_b : tree_a), t2(q.swapped ? tree_a : tree_b);
    MeshCollector<S> collector(of, tree_a, t1, t2, magnitude);
    collector.setFrame(tree_a.surface().lattice, b_in_a.tolerance + q.margin / tree_a.surface().lattice.unit());
    with_collector(collector);
    collector.finish();
  };
  const auto walk = [&](auto&& with_collector) { walkFor(q, with_collector); };
  // TreeWalk widens slabs by itself; oriented boxes and spheres need no more than the margin.
  const SimilarityTransform near = withMargin(b_in_a, a, q, q.margin);
  const auto walkBoxes = [&](MeshCollector<S>& collector, std::size_t most_steps) {
    const query::BoxSide boxes_a(a), boxes_b(b);
    query::PairWalk<query::BoxSide, query::BoxSide> boxes(boxes_a, boxes_b, near, collector);
    const bool met = boxes.run(most_steps);
    return query::WalkEnd{met, boxes.steps(), boxes.gaveUp()};
  };
  constexpr std::size_t kAll = ~std::size_t{0};
  // Of slivers, a walk for contacts over blocks may take thousands of times as long as one over boxes to find nothing.
  const auto boxesPartAll = [&] {
    if (q.endsAtFirst() || q.request.enable_cost || query::Turns::favourBoxes(a, b)) return false;
    if (!query::BoxSide::fits(a) || !query::BoxSide::fits(b)) return false;
    if (tree_a.boxPrice() + tree_b.boxPrice() > 0 || !query::BoxSide::build(a) || !query::BoxSide::build(b))
      return false;
    const fcl::CollisionRequest<S> request;
    fcl::CollisionResult<S> result;
    query::WalkEnd end{};
    walkFor({q, request, result, q.margin, q.is_distance},
            [&](MeshCollector<S>& collector) { end = walkBoxes(collector, query::Turns::kShort); });
    return !end.met && !end.gave_up;
  };
  if (query::TreeWalk::fits(a, b, near) && !isNeedle(tree_a) && !isNeedle(tree_b)) {
    query::TreeWalk trees(a, b, near);
    if (!trees.isNeedless() && !(kUsesBoxes<S> && (query::knownBoxesApart(a, b, near) || boxesPartAll()))) {
      if (isProved()) return true;
      std::size_t steps = 0;
      walk([&](auto& collector) {
        if (near.margin > 0 && collector.endsAtFirst()) {
          walkWithinMargin(a, b, near, collector, [&](std::size_t most) { return trees.run(collector, most); });
        } else if (kUsesBoxes<S> && collector.endsAtFirst()) {
          trees.runByTurns(collector);
        } else if (kUsesBoxes<S> && query::Turns::favourBoxes(a, b)) {
          walkBoxes(collector, kAll);
        } else {
          steps = trees.run(collector, kAll).steps;
        }
      });
      // Walks for a verdict have taken turns with oriented boxes; a walk for contacts that found none pays for them.
      if (kUsesBoxes<S> && !q.endsAtFirst() && q.result.numContacts() == before) trees.payForBoxes(steps);
    }
  } else if (kUsesBoxes<S> && isNeedle(tree_a) && isNeedle(tree_b) && query::BoxSide::fits(a) &&
             query::BoxSide::fits(b)) {
    walk([&](auto& collector) { walkBoxes(collector, kAll); });
  } else if (query::SphereWalk::fits(a, b)) {
    query::SphereWalk spheres(a, b, near);
    if (!spheres.isNeedless()) {
      if (isProved()) return true;
      walk([&](auto& collector) { spheres.run(collector); });
    }
  } else if (query::TreeWalk::fitsCells(a, b, near)) {
    query::TreeWalk trees(a, b, near);
    if (!trees.isNeedless()) walk([&](auto& collector) { trees.run(collector); });
  } else {
    const bool spheres = a.isConservative() || b.isConservative();
    const SimilarityTransform wide = withMargin(b_in_a, a, q, q.cullingMargin(spheres));
    walk([&](auto& collector) {
      const auto walk_blocks = [&](std::size_t most) {
        query::PairWalk<TreeSide, TreeSide> blocks(a, b, wide, collector);
        const bool met = blocks.run(most);
        return query::WalkEnd{met, blocks.steps(), blocks.gaveUp()};
      };
      // Of a mesh that is much larger than its details, these share a unit of the lattice, and blocks part nothing.
      constexpr query::Turns::Limits kLimits = {64, 1024, 1024, 1};
      if (!spheres && near.margin > 0 && collector.endsAtFirst()) {
        walkWithinMargin(a, b, near, collector, walk_blocks);
      } else if (spheres || !kUsesBoxes<S> || !query::BoxSide::fits(a) || !query::BoxSide::fits(b)) {
        walk_blocks(~std::size_t{0});
      } else if (collector.endsAtFirst()) {
        query::walkByTurns(a, b, near, collector, kLimits, walk_blocks);
      } else if (tree_a.knownBoxes() != nullptr && tree_b.knownBoxes() != nullptr) {
        walkBoxes(collector, kAll);
      } else {
        const query::Turns turns(a, b, tree::Tree::Search::kYesOrNo, kLimits);
        turns.tookOverBlocks(walk_blocks(~std::size_t{0}).steps, false);
      }
    });
  }
  if (q.mayBeInside(before) && (contains<S>(tree_a, q.X_WA(), tree_b, q.X_WB(), magnitude) ||
                                contains<S>(tree_b, q.X_WB(), tree_a, q.X_WA(), magnitude))) {
    addInside(q, a, b, b_in_a);
  }
  return false;
}

template <typename S>
void collideBvh(const CollideQuery<S>& q, tree::Tree& tree, const BvhSide& b) {
  const std::size_t before = q.result.numContacts();
  const QueryScope scope(tree);
  const TreeSide& a = scope.a();
  const auto [b_in_a, magnitude] = relate<S>(q, a, b);
  const oracle::Surface& surface = tree.surface();
  if (isOutOfSight(q, b_in_a, magnitudeOf(surface.bounds), b.magnitude())) return;
  const Triangles<S> of_model(tree), of_partner(b);
  MeshCollector<S> collector(q, tree, q.swapped ? of_partner : of_model, q.swapped ? of_model : of_partner, magnitude);
  collector.setFrame(surface.lattice, b_in_a.tolerance + q.margin / surface.lattice.unit());
  query::PairWalk<TreeSide, BvhSide>(a, b, withMargin(b_in_a, a, q, q.cullingMargin(a.isConservative())), collector)
      .run();
  collector.finish();
  if (q.mayBeInside(before) && contains<S>(tree, q.X_WA(), b, q.X_WB(), magnitude)) addInside(q, a, b, b_in_a);
}

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

// Is the second to be side A? Without a choice, only where the first is no model.
template <typename S>
bool turnsRound(const Models<S>& models, const fcl::Transform3<S>& X_W1, const fcl::Transform3<S>& X_W2) {
  if (!models.areTwo()) return models.first == nullptr;
  return walksTurned(treeOf(*models.first), X_W1, treeOf(*models.second), X_W2);
}

// Are two models so far apart that nothing need be locked? For poses that are surely rigid. False where branches are
// due to be dropped, since only a query that holds the locks drops them, at its end.
template <typename S>
bool areFarApart(const Models<S>& models, const fcl::Transform3<S>& X_W1, const fcl::Transform3<S>& X_W2,
                 double margin) {
  static_assert(kSurelyRigidError <= 2e-5, "what query::areFarApart() allows for");
  const tree::Tree &tree1 = treeOf(*models.first), &tree2 = treeOf(*models.second);
  if (!query::areFarApart(tree1.outline(), X_W1.matrix().data(), tree2.outline(), X_W2.matrix().data(), margin)) {
    return false;
  }
  if (!tree1.hasDecay() && !tree2.hasDecay()) return true;
  // The system's clock need not be read twice.
  const std::int64_t now1 = tree1.now(), now2 = tree1.options().clock || tree2.options().clock ? tree2.now() : now1;
  return !(tree1.hasDecay() && tree1.isPruneDue(now1)) && !(tree2.hasDecay() && tree2.isPruneDue(now2));
}

template <typename S>
std::size_t answer(const CollideQuery<S>& q, const Models<S>& models, const BroughtSolver<S>& solver) {
  if (q.request.isSatisfied(q.result)) return q.result.numContacts();
  if (!q.occupied() && (q.o1->isFree() || q.o2->isFree() || !q.request.enable_cost)) return q.result.numContacts();
  const Model<S>*a = models.first, *b = models.second;
  q.inCallersOrder(a, b);
  if (b != nullptr) {
    const QueryScope scope(treeOf(*a), treeOf(*b));
    collideTrees(q, scope.a(), scope.b(), Wanted::kContacts);
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
                        fcl::CollisionResult<S>& result, std::optional<double> margin) {
  const Models<S> models(o1, o2);
  const bool are_rigid = areSurelyRigid(X_W1, X_W2);
  if (!are_rigid) {
    checkPose("collide", "tf1", X_W1);
    checkPose("collide", "tf2", X_W2);
  }
  checkRequest(request);
  const double m = margin ? *margin : marginOf(models.first, models.second);
  // Most of a planner's pairs end here.
  if (are_rigid && models.areTwo() && areFarApart(models, X_W1, X_W2, m)) return result.numContacts();
  return answer(
      CollideQuery<S>{{o1, X_W1, o2, X_W2, turnsRound(models, X_W1, X_W2)}, request, result, m, margin.has_value()},
      models, solver);
}

namespace {

// Yes or no for two occupied models.
template <typename S>
bool touchAt(const Models<S>& models, const fcl::Transform3<S>& X_W1, const fcl::Transform3<S>& X_W2, double margin) {
  static const fcl::CollisionRequest<S> request;
  thread_local fcl::CollisionResult<S> result;
  result.clear();
  const CollideQuery<S> q{
      {models.first, X_W1, models.second, X_W2, turnsRound(models, X_W1, X_W2)}, request, result, margin};
  const QueryScope scope(treeOf(*models.first), treeOf(*models.second));
  const TreeSide &a = q.swapped ? scope.b() : scope.a(), &b = q.swapped ? scope.a() : scope.b();
  if (collideTrees(q, a, b, Wanted::kVerdict)) return true;
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
    thread_local std::vector<PosedPair<S>> pairs;
    pairs.clear();
    for (std::size_t k = 0; k < count; ++k) pairs.push_back({&a, identity, &b, X_AB[k]});
    spheres = &growTogether(pairs);
  }
  for (std::size_t k = 0; k < count; ++k) {
    const Spheres found = spheres != nullptr ? (*spheres)[k] : Spheres::kUnknown;
    hit[k] = found == Spheres::kMeet;
    if (found == Spheres::kMeet || (found == Spheres::kApart && !may_be_inside)) continue;
    if (isSurelyRigid(X_AB[k]) && areFarApart(models, identity, X_AB[k], margin)) continue;
    hit[k] = touchAt(models, identity, X_AB[k], margin);
  }
}

#define BOCST_INSTANTIATE(S)                                                                                           \
  template void collideRow(const Model<S>&, const Model<S>&, const fcl::Transform3<S>*, std::size_t, std::uint8_t*);   \
  template bool touch(const Model<S>&, const fcl::Transform3<S>&, const Model<S>&, const fcl::Transform3<S>&);         \
  template std::size_t collidePair(const fcl::CollisionGeometry<S>*, const fcl::Transform3<S>&,                        \
                                   const fcl::CollisionGeometry<S>*, const fcl::Transform3<S>&,                        \
                                   const BroughtSolver<S>&, const fcl::CollisionRequest<S>&, fcl::CollisionResult<S>&, \
                                   std::optional<double>);
BOCST_INSTANTIATE(float)
BOCST_INSTANTIATE(double)
#undef BOCST_INSTANTIATE

}  // namespace bocst::fcl_adapter
