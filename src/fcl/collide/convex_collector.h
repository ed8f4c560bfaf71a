// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/math/bv/AABB.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <numeric>
#include <tuple>
#include <vector>

#include "fcl/adapters/narrow_phase.h"
#include "fcl/collide/collide_query.h"
#include "fcl/collide/contact_order.h"
#include "fcl/pair/convex_frame.h"
#include "query/leaf/pair_set.h"
#include "query/sides/convex_side.h"
#include "query/sides/visitor.h"
#include "thread/of_thread.h"

namespace bocst::fcl_adapter {

/// Turns what a walk of a model and solid bodies finds into contacts and cost sources. Partner is the side of the
/// bodies, and knows them as FCL does:
///   bool fclOverlaps(node, narrow_phase, corners, X_WM)  FCL's test of the body and a triangle of the model
///   fcl::AABB<S> worldBox(node), S density(node)   for cost sources
///   bool occupied(node)                            it makes contacts, and not only costs: all do unless costs are
///                                                  asked for
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
        start_mode_(startMode(q, by_ids)),
        mode_(start_mode_),
        s_(scratch()),
        cut_(order_.startCut()) {
    s_.seen.clear();
    s_.found.clear();
    s_.of_leaf.clear();
    if (wantsFew()) s_.first.start(q.contactsLeft());
  }

  /// Bodies within so much of the surface, or of its cells' spheres, are to be visited.
  double tolerance(bool spheres) const { return tolerance_ + q_.cullingMargin(spheres); }

  bool endsAtFirst() const override { return mode_ == Mode::kAny; }
  const query::Cut* cut() const override { return wantsFew() ? &cut_ : nullptr; }

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
  void beginInOrder() { mode_ = Mode::kInOrder; }
  void endInOrder(bool gave_up) {
    if (!gave_up) return;
    mode_ = start_mode_;
    s_.found.clear();
    s_.of_leaf.clear();
  }

  bool triangle(std::uint32_t t, const Node& b) override {
    if (mode_ == Mode::kAny) return addTriangle(t, b);
    if (mode_ == Mode::kInOrder) {
      s_.of_leaf.push_back(placed(0, {t, {Eigen::Vector3d::Zero(), 0}}, b));
      return false;
    }
    const double place = mode_ == Mode::kFirst ? order_.placeOf(t, greatestOf(b)) : 0;
    const Found found = placed(place, {t, {Eigen::Vector3d::Zero(), 0}}, b);
    if (mode_ == Mode::kFirst && !s_.first.wants(found)) return false;
    if (!s_.seen.insert(partner_.id(b), t)) return false;
    if (mode_ == Mode::kFirst) {
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
    if (mode_ == Mode::kAny) return addCell(a, b);
    const Found found = placed(static_cast<double>(a.id), a, b);
    if (mode_ == Mode::kAll) {
      s_.found.push_back(found);
    } else if (s_.first.wants(found)) {
      s_.first.add(found);
      if (s_.first.isFull()) cut_.last_cell = static_cast<std::uint64_t>(s_.first.last().place);
    }
    return false;
  }

  /// To be called at the end of the walk: as in MeshCollector, contacts are sorted by their ids, and few are
  /// chosen by ContactOrder. `cells`: those are what it found.
  void finish(bool cells) {
    if (mode_ == Mode::kFirst) s_.found = s_.first.sort();
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
  /// What is done with what a walk finds, as in MeshCollector. Only kAll is for requests with costs.
  enum class Mode { kAny, kAll, kFirst, kInOrder };

  static Mode startMode(const CollideQuery<S>& q, bool by_ids) {
    if (by_ids) return Mode::kAll;
    if (q.endsAtFirst()) return Mode::kAny;
    const std::size_t left = q.contactsLeft();
    return left == 0 || left > CollideQuery<S>::kMostOfFew ? Mode::kAll : Mode::kFirst;
  }
  bool wantsFew() const { return mode_ == Mode::kFirst || mode_ == Mode::kInOrder; }

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
    if (!touches(found)) return;
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
  const bool costs_;
  const Mode start_mode_;
  Mode mode_;
  Scratch& s_;
  query::Cut cut_;
  Node body_{};  // of which `greatest_` is known
  bool has_body_ = false;
  double greatest_ = 0;
  query::GapFinder gaps_;
};

}  // namespace bocst::fcl_adapter
