// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/math/bv/AABB.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <numeric>
#include <tuple>
#include <type_traits>
#include <vector>

#include "fcl/adapters/narrow_phase.h"
#include "fcl/queries/collide_query.h"
#include "fcl/queries/contact_order.h"
#include "fcl/queries/convex_frame.h"
#include "fcl/queries/inside.h"
#include "fcl/queries/inside_contact.h"
#include "fcl/queries/query_scope.h"
#include "query/collide/pair_walk.h"
#include "query/leaf/pair_set.h"
#include "query/sides/convex_side.h"
#include "query/sides/visitor.h"
#include "thread/of_thread.h"

namespace bocst::fcl_adapter {

/// Turns what a walk of a model and solid bodies finds into contacts and cost sources. Partner is the side of the
/// bodies, and knows them as FCL does:
///   bool fclOverlaps(node, narrow_phase, corners, X_WM)  FCL's test of the body and a triangle of the model
///   fcl::AABB<S> worldBox(node), S density(node)   for cost sources
///   bool occupied(node)                            it makes contacts, and not only costs
///
/// A triangle touches a body when they meet or are no farther apart than the margin, in double, or when FCL's test, in
/// S and with the solver's tolerance, says so.
template <typename S, typename Partner>
class ConvexCollector final : public query::ConvexVisitor<typename Partner::Node> {
 public:
  using Node = typename Partner::Node;

  /// `costs`: of each contact. `by_ids`: those with the smallest ids are wanted, however few.
  ConvexCollector(const CollideQuery<S>& q, const Partner& partner, const ConvexFrame<S>& frame,
                  const tree::Tree& model, const NarrowPhase<S>& narrow_phase, bool costs, bool by_ids)
      : q_(q),
        order_(model),
        partner_(partner),
        frame_(frame),
        surface_(model.surface()),
        narrow_phase_(narrow_phase),
        X_WM_(q.X_WA()),
        X_WB_(q.X_WB().template cast<double>()),
        b_in_a_(frame.toLattice(surface_.lattice, 0)),
        tolerance_(frame.rounding() + (q.is_distance ? 0 : narrow_phase.tolerance())),
        costs_(costs),
        ends_at_first_(q.endsAtFirst()),
        is_cut_(!ends_at_first_ && !by_ids && q.contactsLeft() > 0 && q.contactsLeft() <= CollideQuery<S>::kMostOfFew),
        s_(scratch()),
        cut_(order_.startCut()) {
    s_.seen.clear();
    s_.found.clear();
    s_.of_leaf.clear();
    if (is_cut_) s_.first.start(q.contactsLeft());
  }

  /// Bodies within so much of the surface, or of its cells' spheres, are to be visited.
  double tolerance(bool spheres) const { return tolerance_ + q_.cullingMargin(spheres); }

  bool endsAtFirst() const override { return ends_at_first_; }
  const query::Cut* cut() const override { return is_cut_ ? &cut_ : nullptr; }

  /// Cost sources of the bodies below a node that the box about the model meets, as FCL's approximate costs are.
  void addApproximateCosts(const Node& b) const {
    const Eigen::AlignedBox3d box = surface_.mesh->bounds();
    Eigen::Vector3d corners[8];
    Eigen::AlignedBox3d in_world;
    for (int k = 0; k < 8; ++k) {
      corners[k] = frame_ * box.corner(static_cast<Eigen::AlignedBox3d::CornerType>(k));
      in_world.extend(X_WB_ * corners[k]);
    }
    addApproximateCosts(b, {corners, 8},
                        fcl::AABB<S>(in_world.min().template cast<S>(), in_world.max().template cast<S>()));
  }

  /// As MeshCollector has it.
  void beginInOrder() { in_order_ = true; }
  void endInOrder(bool gave_up) {
    if (!gave_up) return;
    in_order_ = false;
    s_.found.clear();
    s_.of_leaf.clear();
  }

  bool triangle(std::uint32_t t, const Node& b) override {
    if (ends_at_first_) return addTriangle(t, b);
    if (in_order_) {
      if (partner_.occupied(b)) s_.of_leaf.push_back(placed(0, {t, {Eigen::Vector3d::Zero(), 0}}, b));
      return false;
    }
    const double place = is_cut_ ? order_.placeOf(t, greatestOf(b)) : 0;
    const Found found = placed(place, {t, {Eigen::Vector3d::Zero(), 0}}, b);
    if (is_cut_ && !s_.first.wants(found)) return false;
    if (!s_.seen.insert(partner_.id(b), t)) return false;
    if (is_cut_) {
      addFirst(found);
    } else {
      s_.found.push_back(found);
    }
    return false;
  }

  bool endLeaves() override {
    std::sort(s_.of_leaf.begin(), s_.of_leaf.end());
    for (const Found& found : s_.of_leaf) {
      if (s_.found.size() == q_.contactsLeft()) break;
      if (touches(found)) s_.found.push_back(found);
    }
    s_.of_leaf.clear();
    return s_.found.size() == q_.contactsLeft();
  }

  bool cell(const query::CellLeaf& a, const Node& b) override {
    if (ends_at_first_) return addCell(a, b);
    const Found found = placed(static_cast<double>(a.id), a, b);
    if (!is_cut_) {
      s_.found.push_back(found);
    } else if (partner_.occupied(b) && s_.first.wants(found)) {
      s_.first.add(found);
      if (s_.first.isFull()) cut_.last_cell = static_cast<std::uint64_t>(s_.first.last().place);
    }
    return false;
  }

  /// To be called at the end of the walk: as in MeshCollector, contacts are sorted by their ids, and few are
  /// chosen by ContactOrder. `cells`: those are what it found.
  void finish(bool cells) {
    if (is_cut_ && !in_order_) s_.found = s_.first.sort();
    s_.order.resize(s_.found.size());
    std::iota(s_.order.begin(), s_.order.end(), 0u);
    std::sort(s_.order.begin(), s_.order.end(), [this](std::uint32_t i, std::uint32_t j) {
      const Found &f = s_.found[i], &g = s_.found[j];
      return std::tie(f.b1, f.b2) < std::tie(g.b1, g.b2);
    });
    for (const std::uint32_t i : s_.order) {
      const Found& f = s_.found[i];
      if (cells ? addCell(f.leaf, f.body) : addTriangle(static_cast<std::uint32_t>(f.leaf.id), f.body)) return;
    }
  }

 private:
  struct Found {
    double place;          // see ContactOrder
    std::intptr_t b1, b2;  // as the caller gets them
    query::CellLeaf leaf;  // of a triangle, its id alone
    Node body;

    bool operator<(const Found& other) const {
      return std::tie(place, b1, b2) < std::tie(other.place, other.b1, other.b2);
    }
  };
  using FirstFound = FirstItems<Found>;
  // Kept by the thread between queries.
  struct Scratch {
    query::PairSet<std::uint64_t> seen;
    FirstFound first;
    std::vector<Found> found, of_leaf;
    std::vector<std::uint32_t> order;  // of what was found, which is too large to be moved about
  };
  static Scratch& scratch() { return thread::ofThread<Scratch>(); }

  Found placed(double place, const query::CellLeaf& a, const Node& b) const {
    auto b1 = static_cast<std::intptr_t>(a.id), b2 = static_cast<std::intptr_t>(partner_.id(b));
    q_.inCallersOrder(b1, b2);
    return {place, b1, b2, a, b};
  }

  // Only the first contacts, a given number of them, are wanted: adds this one if it is one so far.
  void addFirst(const Found& found) {
    if (!partner_.occupied(found.body) || !touches(found)) return;
    s_.first.add(found);
    if (s_.first.isFull()) order_.setCut(s_.first.last().place, near() / surface_.lattice.unit(), cut_);
  }

  std::array<Eigen::Vector3d, 3> cornersOf(std::uint32_t t) const {
    const auto& i = surface_.mesh->indices(t);
    return {frame_ * surface_.mesh->vertex(i[0]), frame_ * surface_.mesh->vertex(i[1]),
            frame_ * surface_.mesh->vertex(i[2])};
  }

  // See Cut. Most pairs have the body of the pair before.
  double greatestOf(const Node& b) {
    if (!has_body_ || !(b == body_)) greatest_ = cut_.greatestOf(partner_.volume(b), b_in_a_);
    has_body_ = true;
    body_ = b;
    return greatest_;
  }

  // What is farther apart does not touch.
  double near() const { return std::max(tolerance_, q_.margin); }

  bool touches(const Found& found) {
    query::SeparationResult gap;
    const auto t = static_cast<std::uint32_t>(found.leaf.id);
    return touches(t, cornersOf(t).data(), found.body, gap);
  }

  // True if a triangle touches a body. Sets the gap between them.
  bool touches(std::uint32_t t, const Eigen::Vector3d* corners, const Node& b, query::SeparationResult& gap) {
    gap = gaps_.gap(partner_, b, {corners, 3}, near());
    if (gap.at_least > near()) return false;
    if (gap.isTouching() || gap.at_least <= q_.margin) return true;
    if (q_.is_distance) return false;
    const auto& i = surface_.mesh->indices(t);
    fcl::Vector3<S> c[3];
    for (std::size_t k = 0; k < 3; ++k) c[k] = surface_.mesh->vertex(i[k]).template cast<S>();
    return partner_.fclOverlaps(b, narrow_phase_, c, X_WM_);
  }

  // True when nothing more is asked for.
  bool addTriangle(std::uint32_t t, const Node& b) {
    const std::array<Eigen::Vector3d, 3> corners = cornersOf(t);
    const query::PointSet points{corners.data(), 3};
    query::SeparationResult gap;
    if (!touches(t, corners.data(), b, gap)) return false;
    const auto& i = surface_.mesh->indices(t);
    if (costs_) {
      const fcl::Vector3<S> p = X_WM_ * surface_.mesh->vertex(i[0]).template cast<S>();
      const fcl::Vector3<S> r = X_WM_ * surface_.mesh->vertex(i[1]).template cast<S>();
      const fcl::Vector3<S> s = X_WM_ * surface_.mesh->vertex(i[2]).template cast<S>();
      addCost(fcl::AABB<S>(p, r, s), b);
    }
    if (!q_.request.enable_contact) return add(t, b, nullptr);
    // With a margin the direction is needed, and nearest points closer than the rounding give none.
    query::ContactPoint contact;
    if (gap.isTouching() || (q_.margin > 0 && gap.distance <= frame_.rounding())) {
      contact = partner_.penetration(b, points, gap);
      contact.depth += q_.margin;
    } else {
      contact = bridge(gap, points, b);
      contact.depth = std::max(q_.margin - gap.distance, 0.0);
    }
    contact = inWorld(contact);
    return add(t, b, &contact);
  }

  bool addCell(const query::CellLeaf& a, const Node& b) {
    const lattice::Lattice& lattice = surface_.lattice;
    const Eigen::Vector3d in_model = lattice.origin() + lattice.unit() * a.sphere.center, center = frame_ * in_model;
    const double radius = lattice.unit() * a.sphere.radius;
    if (costs_) {
      const fcl::Vector3<S> c = (X_WB_ * center).template cast<S>();
      const fcl::Vector3<S> r = fcl::Vector3<S>::Constant(static_cast<S>(radius));
      addCost(fcl::AABB<S>(c - r, c + r), b);
    }
    if (!q_.request.enable_contact) return add(a.id, b, nullptr);
    const query::ContactPoint contact = inWorld(ballPenetration(center, radius, b));
    return add(a.id, b, &contact);
  }

  /// The contact of points just outside the body: along the line between the nearest points, of depth 0.
  query::ContactPoint bridge(const query::SeparationResult& gap, const query::PointSet& points, const Node& b) const {
    const Eigen::Vector3d displacement = gap.on_points - gap.on_body;
    query::ContactPoint contact;
    // Displacements this short are rounding: the penetration has the normal.
    const double size = gap.on_points.norm() + gap.on_body.norm();
    contact.normal =
        displacement.norm() > 1e-12 * size ? displacement.normalized() : partner_.penetration(b, points, gap).normal;
    contact.point = (gap.on_points + gap.on_body) / 2;
    return contact;
  }

  query::ContactPoint ballPenetration(const Eigen::Vector3d& center, double radius, const Node& b) const {
    const query::PointSet point{&center, 1};
    const query::SeparationResult gap = partner_.gap(b, point, std::numeric_limits<double>::infinity());
    query::ContactPoint contact;
    if (gap.isTouching()) {
      contact = partner_.penetration(b, point, gap);
      contact.depth += radius + q_.margin;
      contact.point -= contact.normal * (radius / 2);
    } else {
      const double overlap = radius - gap.distance;  // negative: a gap, within the margin
      contact.normal = (center - gap.on_body).normalized();
      contact.depth = std::max(overlap + q_.margin, 0.0);
      contact.point = gap.on_body - contact.normal * (overlap / 2);
    }
    return contact;
  }

  query::ContactPoint inWorld(query::ContactPoint contact) const {
    contact.normal = X_WB_.linear() * contact.normal;
    contact.point = X_WB_ * contact.point;
    return contact;
  }

  void addApproximateCosts(const Node& b, const query::PointSet& box, const fcl::AABB<S>& in_world) const {
    if (!partner_.gap(b, box, 0).isTouching()) return;
    if (partner_.state(b) == query::State::kLeaf) return addCost(in_world, b);
    partner_.children(b, [&](const Node& c) { addApproximateCosts(c, box, in_world); });
  }

  void addCost(const fcl::AABB<S>& box, const Node& b) const {
    q_.addCost(box, partner_.worldBox(b), partner_.density(b));
  }

  // `contact` has the normal from the body to the model.
  bool add(std::uint64_t id, const Node& b, const query::ContactPoint* contact) const {
    if (!partner_.occupied(b)) return q_.request.isSatisfied(q_.result);
    auto id1 = static_cast<std::intptr_t>(id), id2 = static_cast<std::intptr_t>(partner_.id(b));
    q_.inCallersOrder(id1, id2);
    if (contact == nullptr) return q_.addContact(id1, id2, nullptr);
    query::ContactPoint turned = *contact;
    if (!q_.swapped) turned.normal = -turned.normal;
    return q_.addContact(id1, id2, &turned);
  }

  const CollideQuery<S>& q_;
  const ContactOrder order_;
  const Partner& partner_;
  const ConvexFrame<S>& frame_;
  const oracle::Surface& surface_;
  const NarrowPhase<S>& narrow_phase_;
  const fcl::Transform3<S>& X_WM_;
  const fcl::Transform3<double> X_WB_;
  const query::SimilarityTransform b_in_a_;
  const double tolerance_;
  const bool costs_, ends_at_first_, is_cut_;
  bool in_order_ = false;
  Scratch& s_;
  query::Cut cut_;
  Node body_{};  // of which `greatest_` is known
  bool has_body_ = false;
  double greatest_ = 0;
  query::GapFinder gaps_;
};

/// The collision of a model, side A, and the bodies of a partner: with_partner(frame, costs, f) makes the partner's
/// side, with what has no contacts but costs or without, and calls f with it.
template <typename S, typename F>
void collideConvex(const CollideQuery<S>& q, tree::Tree& tree, const NarrowPhase<S>& narrow_phase, F&& with_partner) {
  // As FCL does for meshes: contacts first, and then the costs of the box about the mesh.
  const bool approximate = q.request.enable_cost && q.request.use_approximate_cost;
  fcl::CollisionRequest<S> request(q.request);
  request.enable_cost = q.request.enable_cost && !approximate;
  const CollideQuery<S> first{q, request, q.result, q.margin, q.is_distance};
  const std::size_t before = q.result.numContacts();
  const QueryScope scope(tree);
  const query::TreeSide& a = scope.a();
  const oracle::Surface& surface = tree.surface();
  const ConvexFrame<S> frame(q.X_WA(), q.X_WB(), surface);
  const auto with_collector = [&](bool costs, auto&& f) {
    with_partner(frame, costs, [&](const auto& partner) {
      using Partner = std::remove_cv_t<std::remove_reference_t<decltype(partner)>>;
      ConvexCollector<S, Partner> collector(first, partner, frame, tree, narrow_phase, request.enable_cost,
                                            q.request.enable_cost);
      f(partner, collector);
    });
  };
  const auto isOutOfSight = [&](const auto& partner) {
    const query::Sphere ball = partner.sphere(partner.root());
    const double size = surface.bounds.diagonal().norm();
    if (frame.rounding() < 1e15 * size) return false;
    const Eigen::Vector3d half_way = (frame * surface.bounds.center()) / 2 - ball.center / 2;
    return half_way.cwiseAbs().maxCoeff() > 8 * (size + ball.radius) + q.margin;
  };
  if (q.occupied() || request.enable_cost) {
    with_collector(request.enable_cost, [&](const auto& partner, auto& collector) {
      using Partner = std::remove_cv_t<std::remove_reference_t<decltype(partner)>>;
      // What is farther away than can be computed with touches nothing.
      if (isOutOfSight(partner)) return;
      const query::SimilarityTransform b_in_a =
          frame.toLattice(surface.lattice, collector.tolerance(a.isConservative()));
      const auto walk_blocks = [&](std::size_t most) {
        return query::PairWalk<query::TreeSide, Partner>(a, partner, b_in_a, collector).run(most);
      };
      if constexpr (Partner::kHasCubes) {
        const auto verdict = [&](const CollideQuery<S>& any) {
          ConvexCollector<S, Partner> of_any(any, partner, frame, tree, narrow_phase, false, false);
          query::PairWalk<query::TreeSide, Partner>(a, partner, b_in_a, of_any).run();
        };
        const WalkInOrder in_order = prepareWalkInOrder(q, {&tree}, false, verdict);
        if (in_order == WalkInOrder::kNothingTouches) return;
        if (in_order == WalkInOrder::kReady) {
          const query::TreeSide whole(tree, a.now());  // the root may be another one than `a` has seen
          collector.beginInOrder();
          const query::WalkEnd end = query::PairWalk<query::TreeSide, Partner>(whole, partner, b_in_a, collector)
                                         .runInOrder(q.mostLeafPairs(128));
          collector.endInOrder(end.gave_up);
          if (!end.gave_up) return collector.finish(false);
        }
      }
      // Boxes as in TreesCollision.
      if constexpr (std::is_same_v<S, double> && std::is_base_of_v<query::ConvexSide, Partner>) {
        if (query::fitsBoxes(a) && (collector.endsAtFirst() || query::Turns::arePaid(a, partner))) {
          constexpr query::Turns::Limits kLimits = {128, 1024, 256, 1}, kLimitsOfContacts = {1024, 1024, 1024, 1};
          query::walkByTurns(a, partner, b_in_a, collector, collector.endsAtFirst() ? kLimits : kLimitsOfContacts,
                             walk_blocks);
        } else {
          walk_blocks(query::kNoLimit);
        }
      } else {
        walk_blocks(query::kNoLimit);
      }
      collector.finish(a.isConservative());
    });
  }
  if (tree.solid() != nullptr && q.mayBeInside(before)) {
    with_partner(frame, false, [&](const auto& partner) {
      if (contains(a, frame, partner)) addInside(q, a, partner, frame.toLattice(surface.lattice, 0));
    });
  }
  if (approximate) {
    with_collector(true, [](const auto& partner, auto& collector) { collector.addApproximateCosts(partner.root()); });
  }
}

}  // namespace bocst::fcl_adapter
