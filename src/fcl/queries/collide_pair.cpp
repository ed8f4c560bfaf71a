// SPDX-License-Identifier: BSD-3-Clause
#include "fcl/queries/collide_pair.h"

#include <fcl/config.h>
#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/math/geometry.h>
#include <fcl/narrowphase/detail/traversal/collision/intersect.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <shared_mutex>
#include <stdexcept>
#include <string>
#include <type_traits>

#include "fcl/adapters/pair.h"
#include "fcl/plugin/dispatch.h"
#include "fcl/queries/collide_octree.h"
#include "fcl/queries/collide_query.h"
#include "fcl/queries/collide_shape.h"
#include "fcl/queries/inside.h"
#include "fcl/queries/inside_contact.h"
#include "geometry/triangle.h"
#include "query/collide/pair_walk.h"
#include "query/collide/tree_walk.h"
#include "query/leaf/pair_set.h"

namespace bocst::fcl_adapter {
namespace {

using query::Corners;
using query::SimilarityTransform;
using query::TreeSide;

/// A vertex may lie in two cache lines.
template <typename Vertex>
void prefetchVertex(const Vertex& v) {
  __builtin_prefetch(&v[0]);
  __builtin_prefetch(&v[2]);
}

/// The triangles of one side as FCL computes with them: corners in S, in the geometry's frame.
template <typename S>
class ModelTriangles {
 public:
  explicit ModelTriangles(const tree::Tree& tree) : mesh_(tree.surface().mesh.get()) {}
  fcl::Vector3<S> corner(std::uint32_t t, int k) const {
    return mesh_->vertex(mesh_->indices(t)[static_cast<std::size_t>(k)]).template cast<S>();
  }
  /// Triangle t is about to be asked for, and now its corners.
  void prefetch(std::uint32_t t) const { __builtin_prefetch(&mesh_->indices(t)); }
  void prefetchCorners(std::uint32_t t) const {
    for (const std::uint32_t v : mesh_->indices(t)) prefetchVertex(mesh_->vertex(v));
  }

 private:
  const Mesh* mesh_;  // null where the host has none: conservative answers ask for no triangle
};

template <typename BV>
class BvhTriangles {
 public:
  explicit BvhTriangles(const fcl::BVHModel<BV>& bvh) : bvh_(bvh) {}
  const fcl::Vector3<typename BV::S>& corner(std::uint32_t t, int k) const {
    return bvh_.vertices[bvh_.tri_indices[t][static_cast<std::size_t>(k)]];
  }
  void prefetch(std::uint32_t t) const { __builtin_prefetch(&bvh_.tri_indices[t]); }
  void prefetchCorners(std::uint32_t t) const {
    for (int k = 0; k < 3; ++k) prefetchVertex(corner(t, k));
  }

 private:
  const fcl::BVHModel<BV>& bvh_;
};

/// Turns the pairs of a walk into contacts and cost sources. Side A of the walk is the caller's first geometry, or,
/// when `swapped`, the second.
template <typename S, typename Triangles1, typename Triangles2>
class Collector : public query::Visitor {
 public:
  Collector(const CollideQuery<S>& q, const Triangles1& t1, const Triangles2& t2, bool swapped, double magnitude)
      : q_(q),
        t1_(t1),
        t2_(t2),
        swapped_(swapped),
        magnitude_(magnitude),
        margin_(q.margin),
        seen_(scratch().seen),
        seen_cells_(scratch().seen_cells),
        pairs_(scratch().pairs),
        now_(&scratch().found[0]),
        later_(&scratch().found[1]) {
    // A boolean query ends at the first contact, so it meets no pair twice.
    left_ = q.contactsLeft();
    once_ = q.request.num_max_contacts > 1 || q.request.enable_cost;
    if (once_) {
      seen_.clear();
      seen_cells_.clear();
    }
    now_->count = later_->count = 0;
  }

  /// Where cells lie in the world: from the lattice frame of side A.
  void setFrame(const Eigen::Vector3d& origin, double unit) {
    origin_ = origin;
    unit_ = unit;
  }

  bool endsAtFirst() const override { return q_.endsAtFirst(); }

  bool triangles(std::uint32_t a, std::uint32_t b, bool certain) override {
    if (swapped_) std::swap(a, b);
    if (once_ && !seen_.insert(a, b)) return false;
    if (certain && !needsCorners()) return add(a, b, nullptr);
    later_->add(a, b, certain);
    t1_.prefetch(a);
    t2_.prefetch(b);
    // Several at once are cheaper, but the last contact that is asked for is not to be missed.
    if (now_->count + later_->count >= left_) {
      finish();
    } else if (later_->count == Found::kCapacity) {
      turn();
    } else {
      return false;
    }
    return q_.request.isSatisfied(q_.result);
  }

  /// To be called at the end of the walk.
  void finish() {
    if (now_->count + later_->count == 0) return;
    turn();
    turn();
  }

  bool cells(const query::CellLeaf& a, const query::CellLeaf& b) override {
    return addSpheres(a.id, a.sphere, b.id, b.sphere);
  }

  bool cellOfA(const query::CellLeaf& a, std::uint32_t b, const Eigen::Vector3d& point) override {
    if (once_ && !seen_cells_.insert(a.id, b)) return false;
    return addSpheres(a.id, a.sphere, b, {point, 0});
  }

  bool cellOfB(std::uint32_t a, const query::CellLeaf& b, const Eigen::Vector3d& point) override {
    if (once_ && !seen_cells_.insert(b.id, a)) return false;
    return addSpheres(a, {point, 0}, b.id, b.sphere);
  }

 private:
  static constexpr double kEpsilon = static_cast<double>(std::numeric_limits<S>::epsilon());
  // In float, FCL's axes between slivers' all but parallel edges are rubbish, and it may say that they meet.
  static constexpr bool kTrustsApart = std::is_same<S, double>::value;

  // A triangle so narrow, of its length, is a segment or a point but for rounding in S, or so small that products of
  // four lengths vanish in S.
  static constexpr double kNarrow = std::is_same<S, double>::value ? 1e-14 : 45 * kEpsilon;
  static constexpr double kSmallest = std::is_same<S, double>::value ? 1e-70 : 1e-8;
  static bool isSliver(const Corners& t) {
    return query::isDegenerate(t, kNarrow) ||
           std::max((t[1] - t[0]).cwiseAbs().maxCoeff(), (t[2] - t[0]).cwiseAbs().maxCoeff()) < kSmallest;
  }

  // What distances near 0 may be off by.
  double rounding() const { return magnitude_ * 16 * kEpsilon; }

  // Of triangles that certainly meet.
  bool needsCorners() const { return q_.request.enable_contact || q_.request.enable_cost || margin_ > 0; }

  // Most queries that miss never come here.
  void place() {
    fcl::relativeTransform(q_.X_W1.linear(), q_.X_W1.translation(), q_.X_W2.linear(), q_.X_W2.translation(), R_12_,
                           p_12_);
    place_.linear() = R_12_.template cast<double>();
    place_.translation() = p_12_.template cast<double>();
    placed_ = true;
  }

  // Pairs that are still to be looked at, several at once.
  struct Found {
    static constexpr std::size_t kCapacity = query::TrianglePairs::kCapacity;

    void add(std::uint32_t a, std::uint32_t b, bool is_certain) {
      ids[count][0] = a;
      ids[count][1] = b;
      certain[count++] = is_certain;
    }

    std::uint32_t ids[kCapacity][2];
    bool certain[kCapacity];
    std::size_t count = 0;
  };
  // Kept by the thread between queries.
  struct Scratch {
    query::PairSet<std::uint32_t> seen;
    query::PairSet<std::uint64_t> seen_cells;
    query::TrianglePairs pairs;
    Found found[2];
  };
  static Scratch& scratch() {
    thread_local Scratch scratch;
    return scratch;
  }

  // Looks at the pairs found before the last ones, whose corners are fetched: the walk goes on until they are there.
  void turn() {
    for (std::size_t i = 0; i < later_->count; ++i) {
      t1_.prefetchCorners(later_->ids[i][0]);
      t2_.prefetchCorners(later_->ids[i][1]);
    }
    if (now_->count != 0) decidePairs();
    std::swap(now_, later_);
    later_->count = 0;
  }

  void decidePairs() {
    getCorners();
    if (now_->count == 1 && !now_->certain[0] && !q_.request.enable_contact) return decide(0, nullptr);
    query::ContactPoint contacts[Found::kCapacity];
    const query::PenetrationVerdicts verdicts = query::trianglePenetrations(pairs_, 2 * rounding(), contacts);
    for (std::size_t i = 0; i < now_->count; ++i) {
      const bool meet = now_->certain[i] || (verdicts.meet >> i & 1);
      if (meet && margin_ == 0) {
        addMet(i, &contacts[i]);
      } else if (margin_ > 0 || !kTrustsApart || !(verdicts.apart >> i & 1)) {
        decide(i, &contacts[i]);
      }
    }
  }

  void getCorners() {
    if (!placed_) place();
    pairs_.count = now_->count;
    for (std::size_t i = 0; i < now_->count; ++i) {
      Corners p, q;
      for (int k = 0; k < 3; ++k) {
        p[k] = t1_.corner(now_->ids[i][0], k).template cast<double>();
        q[k] = place_ * t2_.corner(now_->ids[i][1], k).template cast<double>().eval();
      }
      pairs_.put(i, p, q);
    }
  }

  // FCL's test, and what it leaves open. `contact` is how the pair is parted, or null where nobody asks.
  void decide(std::size_t i, const query::ContactPoint* contact) {
    if (now_->certain[i] && margin_ == 0) return addMet(i, contact);
    const std::uint32_t a = now_->ids[i][0], b = now_->ids[i][1];
    Corners p, q;
    pairs_.get(i, p, q);
    const bool sliver = !now_->certain[i] && (isSliver(p) || isSliver(q));
    // FCL's axes do not separate segments and points from everything.
    const bool degenerate = sliver && (query::isDegenerate(p) || query::isDegenerate(q));
    const bool meet =
        now_->certain[i] || (!degenerate && fcl::detail::Intersect<S>::intersect_Triangle(
                                                t1_.corner(a, 0), t1_.corner(a, 1), t1_.corner(a, 2), t2_.corner(b, 0),
                                                t2_.corner(b, 1), t2_.corner(b, 2), R_12_, p_12_));
    if (!sliver && margin_ == 0) return meet ? addMet(i, contact) : void();
    Eigen::Vector3d on_p, on_q;
    const double distance = query::nearestPoints(p, q, on_p, on_q);
    // Of slivers, its axes are rounding, and may part what touches.
    if (!meet && distance > (sliver ? std::max(margin_, rounding()) : margin_)) return;
    if (contact == nullptr) return addMet(i, nullptr);
    if (distance > rounding()) {
      const query::ContactPoint gap{(on_q - on_p) / distance, (on_p + on_q) / 2, std::max(margin_ - distance, 0.0)};
      return addMet(i, &gap);
    }
    query::ContactPoint deeper = *contact;
    deeper.depth += margin_;
    addMet(i, &deeper);
  }

  void addMet(std::size_t i, const query::ContactPoint* contact) {
    const std::uint32_t a = now_->ids[i][0], b = now_->ids[i][1];
    if (q_.request.enable_cost) addCost(a, b);
    if (contact == nullptr || !q_.request.enable_contact) {
      add(a, b, nullptr);
      return;
    }
    const fcl::Transform3<double> X_W1 = q_.X_W1.template cast<double>();
    const query::ContactPoint in_world{X_W1.linear() * contact->normal, X_W1 * contact->point, contact->depth};
    add(a, b, &in_world);
  }

  bool addSpheres(std::uint64_t id_a, query::Sphere a, std::uint64_t id_b, query::Sphere b) {
    if (swapped_) {
      std::swap(id_a, id_b);
      std::swap(a, b);
    }
    const fcl::Transform3<double> X_WA = (swapped_ ? q_.X_W2 : q_.X_W1).template cast<double>();
    for (query::Sphere* s : {&a, &b}) {
      s->center = X_WA * Eigen::Vector3d(origin_ + unit_ * s->center);
      s->radius *= unit_;
    }
    if (q_.request.enable_cost) {
      addCost(boxOf(a), boxOf(b));
    }
    if (!q_.request.enable_contact) return add(id_a, id_b, nullptr);
    query::ContactPoint contact;
    const Eigen::Vector3d displacement = b.center - a.center;
    const double distance = displacement.norm();
    if (distance > 0) contact.normal = displacement / distance;
    const double overlap = a.radius + b.radius - distance;  // negative: a gap, within the margin
    contact.depth = std::max(overlap + margin_, 0.0);
    contact.point = a.center + contact.normal * (a.radius - overlap / 2);
    return add(id_a, id_b, &contact);
  }

  static fcl::AABB<S> boxOf(const query::Sphere& s) {
    const Eigen::Vector3d r = Eigen::Vector3d::Constant(s.radius);
    return fcl::AABB<S>((s.center - r).template cast<S>(), (s.center + r).template cast<S>());
  }

  void addCost(std::uint32_t a, std::uint32_t b) {
    addCost(fcl::AABB<S>(q_.X_W1 * t1_.corner(a, 0), q_.X_W1 * t1_.corner(a, 1), q_.X_W1 * t1_.corner(a, 2)),
            fcl::AABB<S>(q_.X_W2 * t2_.corner(b, 0), q_.X_W2 * t2_.corner(b, 1), q_.X_W2 * t2_.corner(b, 2)));
  }

  void addCost(const fcl::AABB<S>& a, const fcl::AABB<S>& b) {
    q_.addCost(a, b, q_.o1->cost_density * q_.o2->cost_density);
  }

  bool add(std::uint64_t b1, std::uint64_t b2, const query::ContactPoint* contact) {
    const bool ends = q_.addContact(static_cast<std::intptr_t>(b1), static_cast<std::intptr_t>(b2), contact);
    left_ = q_.contactsLeft();
    return ends;
  }

  const CollideQuery<S>& q_;
  const Triangles1& t1_;
  const Triangles2& t2_;
  const bool swapped_;
  const double magnitude_;  // of positions in the frame of the first geometry
  const double margin_;
  query::PairSet<std::uint32_t>& seen_;
  query::PairSet<std::uint64_t>& seen_cells_;
  query::TrianglePairs& pairs_;
  Found *now_, *later_;
  fcl::Transform3<double> place_ = fcl::Transform3<double>::Identity();  // the same in double
  fcl::Matrix3<S> R_12_;
  fcl::Vector3<S> p_12_;
  bool placed_ = false;  // R_12_ and p_12_ are set
  bool once_;
  std::size_t left_;  // contacts that are still asked for
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
  double unit_ = 1;
};

/// What is within the margin touches: the walk's tolerance, in units of side A, is so much more.
template <typename S>
SimilarityTransform withMargin(SimilarityTransform b_in_a, const TreeSide& a, const CollideQuery<S>& q, bool spheres) {
  b_in_a.tolerance += q.cullingMargin(spheres) / a.tree().surface().lattice.unit();
  return b_in_a;
}

/// Are two meshes, and the spheres of their cells, apart because one of them is farther away than floats can say? Most
/// queries compare one number. What is beyond would overflow in a walk, or be lost in its tolerance.
template <typename S>
bool isOutOfSight(const CollideQuery<S>& q, const SimilarityTransform& b_in_a, double size_a, double size_b) {
  if (b_in_a.tolerance < 1e15) return false;
  const Eigen::Vector3d half_way =
      q.X_W1.translation().template cast<double>() / 2 - q.X_W2.translation().template cast<double>() / 2;
  return half_way.cwiseAbs().maxCoeff() > 8 * (size_a + size_b) + q.margin;
}

// Is the second to be side A? The same whichever the caller names first; by address only where the poses are equal, so
// that what a query grows does not depend on where models happen to lie.
template <typename S>
bool turnsRound(const CollideQuery<S>& q, const tree::Tree& tree1, const tree::Tree& tree2) {
  const S *x1 = q.X_W1.matrix().data(), *x2 = q.X_W2.matrix().data();
  const auto differ = std::mismatch(x1, x1 + 16, x2);
  return differ.first == x1 + 16 ? std::less<const tree::Tree*>()(&tree2, &tree1) : *differ.second < *differ.first;
}

template <typename S>
void collideModels(const CollideQuery<S>& q, tree::Tree& tree1, tree::Tree& tree2) {
  const std::size_t before = q.result.numContacts();
  // Conservative verdicts must not depend on the argument order, so the walk has an order of its own.
  const bool swapped = (tree1.conservative() || tree2.conservative()) && turnsRound(q, tree1, tree2);
  const auto walk = [&](const TreeSide& a, double magnitude, auto&& with_collector) {
    const oracle::Surface& s = a.tree().surface();
    const ModelTriangles<S> t1(tree1), t2(tree2);
    Collector<S, ModelTriangles<S>, ModelTriangles<S>> collector(q, t1, t2, swapped, magnitude);
    collector.setFrame(s.lattice.origin(), s.lattice.unit());
    with_collector(collector);
    collector.finish();
  };
  const auto run = [&](const TreeSide& a, const TreeSide& b, const SimilarityTransform& b_in_a, double magnitude) {
    if (isOutOfSight(q, b_in_a, magnitudeOf(a.tree().surface().bounds), magnitudeOf(b.tree().surface().bounds))) return;
    if (q.margin == 0 && query::TreeWalk::fits(a, b, b_in_a)) {
      query::TreeWalk trees(a, b, b_in_a);
      if (!trees.isNeedless()) walk(a, magnitude, [&](auto& collector) { trees.run(collector); });
    } else {
      const SimilarityTransform near = withMargin(b_in_a, a, q, a.isConservative() || b.isConservative());
      walk(a, magnitude, [&](auto& collector) { query::PairWalk<TreeSide, TreeSide>(a, b, near, collector).run(); });
    }
    if (q.mayBeInside(before) && (contains<S>(tree1, q.X_W1, tree2, q.X_W2, magnitude) ||
                                  contains<S>(tree2, q.X_W2, tree1, q.X_W1, magnitude))) {
      addInside(q, a, b, b_in_a, swapped);
    }
  };
  if (swapped) {
    betweenTrees(q.X_W2, tree2, q.X_W1, tree1, run);
  } else {
    betweenTrees(q.X_W1, tree1, q.X_W2, tree2, run);
  }
}

template <typename BV>
void collideBvh(const CollideQuery<typename BV::S>& q, tree::Tree& tree, const fcl::BVHModel<BV>& bvh, bool swapped) {
  using S = typename BV::S;
  const std::size_t before = q.result.numContacts();
  const auto run = [&](const TreeSide& a, const BvhSide<BV>& b, const SimilarityTransform& b_in_a, double magnitude) {
    const oracle::Surface& s = tree.surface();
    if (isOutOfSight(q, b_in_a, magnitudeOf(s.bounds), b.magnitude())) return;
    const ModelTriangles<S> model(tree);
    const BvhTriangles<BV> partner(bvh);
    const auto walk = [&](auto&& collector) {
      collector.setFrame(s.lattice.origin(), s.lattice.unit());
      query::PairWalk<TreeSide, BvhSide<BV>>(a, b, withMargin(b_in_a, a, q, a.isConservative()), collector).run();
      collector.finish();
    };
    if (swapped) {
      walk(Collector<S, BvhTriangles<BV>, ModelTriangles<S>>(q, partner, model, true, magnitude));
    } else {
      walk(Collector<S, ModelTriangles<S>, BvhTriangles<BV>>(q, model, partner, false, magnitude));
    }
    if (q.mayBeInside(before) && contains(tree, swapped ? q.X_W2 : q.X_W1, bvh, swapped ? q.X_W1 : q.X_W2, magnitude)) {
      addInside(q, a, b, b_in_a, swapped);
    }
  };
  betweenTreeAndBvh(swapped ? q.X_W2 : q.X_W1, tree, swapped ? q.X_W1 : q.X_W2, bvh, run);
}

/// The models among two geometries, of which one at least is one.
template <typename S>
struct Models {
  Models(const fcl::CollisionGeometry<S>* o1, const fcl::CollisionGeometry<S>* o2)
      : first(asModel<S>(o1)), second(asModel<S>(o2)) {
    if (first == nullptr && second == nullptr) {
      throw std::logic_error("bocst::collide: neither geometry is a bocst::Model");
    }
  }
  const Model<S>*first, *second;
};

template <typename S>
std::size_t answer(const CollideQuery<S>& q, const Models<S>& models, const BroughtSolver<S>& solver) {
  if (q.request.isSatisfied(q.result)) return q.result.numContacts();
  if (!q.occupied() && (q.o1->isFree() || q.o2->isFree() || !q.request.enable_cost)) return q.result.numContacts();
  if (models.first != nullptr && models.second != nullptr) {
    collideModels(q, models.first->tree(), models.second->tree());
    return q.result.numContacts();
  }
  const bool swapped = models.first == nullptr;
  const fcl::CollisionGeometry<S>* partner = swapped ? q.o1 : q.o2;
  tree::Tree& tree = (swapped ? models.second : models.first)->tree();
  if (isShape(partner)) {
    collideShape(q, tree, swapped, solver);
#if FCL_HAVE_OCTOMAP
  } else if (partner->getNodeType() == fcl::GEOM_OCTREE) {
    collideOcTree(q, tree, swapped, solver);
#endif
  } else {
    withBvh<S>("collide", partner, [&](const auto& bvh) { collideBvh(q, tree, bvh, swapped); });
  }
  return q.result.numContacts();
}

}  // namespace

template <typename S>
std::size_t collidePair(const fcl::CollisionGeometry<S>* o1, const fcl::Transform3<S>& X_W1,
                        const fcl::CollisionGeometry<S>* o2, const fcl::Transform3<S>& X_W2,
                        const BroughtSolver<S>& solver, const fcl::CollisionRequest<S>& request,
                        fcl::CollisionResult<S>& result) {
  const Models<S> models(o1, o2);
  const double margin = marginOf(models.first, models.second);
  return answer(CollideQuery<S>{o1, o2, X_W1, X_W2, request, result, margin}, models, solver);
}

template <typename S>
std::size_t collidePair(const fcl::CollisionGeometry<S>* o1, const fcl::Transform3<S>& X_W1,
                        const fcl::CollisionGeometry<S>* o2, const fcl::Transform3<S>& X_W2,
                        const fcl::CollisionRequest<S>& request, fcl::CollisionResult<S>& result, double margin) {
  return answer(CollideQuery<S>{o1, o2, X_W1, X_W2, request, result, margin}, Models<S>(o1, o2), BroughtSolver<S>());
}

#define BOCST_INSTANTIATE(S)                                                                                          \
  template std::size_t collidePair(                                                                                   \
      const fcl::CollisionGeometry<S>*, const fcl::Transform3<S>&, const fcl::CollisionGeometry<S>*,                  \
      const fcl::Transform3<S>&, const BroughtSolver<S>&, const fcl::CollisionRequest<S>&, fcl::CollisionResult<S>&); \
  template std::size_t collidePair(const fcl::CollisionGeometry<S>*, const fcl::Transform3<S>&,                       \
                                   const fcl::CollisionGeometry<S>*, const fcl::Transform3<S>&,                       \
                                   const fcl::CollisionRequest<S>&, fcl::CollisionResult<S>&, double);
BOCST_INSTANTIATE(float)
BOCST_INSTANTIATE(double)

}  // namespace bocst::fcl_adapter
