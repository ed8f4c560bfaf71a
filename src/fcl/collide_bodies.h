// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/math/bv/AABB.h>

#include <algorithm>
#include <limits>
#include <type_traits>

#include "fcl/body_pair.h"
#include "fcl/inside.h"
#include "fcl/inside_contact.h"
#include "fcl/narrow_phase.h"
#include "fcl/question.h"
#include "query/pair_set.h"
#include "query/pair_walk.h"
#include "query/visitor.h"

namespace bocst::fcl_room {

/// Turns what a walk of a model and solid bodies finds into contacts and cost sources. Partner is the side of the
/// bodies, and knows them as FCL does:
///   bool touch(node, narrow_phase, corners, X_WM)  FCL's test of the body and a triangle of the model
///   fcl::AABB<S> worldBox(node), S density(node)   for cost sources
///   bool occupied(node)                            it makes contacts, and not only costs
///
/// A triangle touches a body when they meet or are no farther apart than the margin, in double, or when FCL's test, in
/// S and with the solver's tolerance, says so.
template <typename S, typename Partner>
class BodyCollector final : public query::BodyVisitor<typename Partner::Node> {
 public:
  using Node = typename Partner::Node;

  /// `swapped`: the partner is the caller's first geometry.
  BodyCollector(const Question<S>& q, const Partner& partner, const BodyFrame<S>& frame, const oracle::Surface& surface,
                const NarrowPhase<S>& narrow_phase, bool swapped, bool costs)
      : q_(q),
        partner_(partner),
        frame_(frame),
        surface_(surface),
        narrow_phase_(narrow_phase),
        X_WM_(swapped ? q.X_W2 : q.X_W1),
        X_WB_((swapped ? q.X_W1 : q.X_W2).template cast<double>()),
        slack_(frame.rounding() + narrow_phase.reach()),
        swapped_(swapped),
        costs_(costs),
        once_(q.request.num_max_contacts > 1 || costs),
        seen_(pairs()) {
    if (once_) seen_.clear();
  }

  /// Bodies within so much of the surface, or of its cells' spheres, are to be visited.
  double slack(bool spheres) const { return slack_ + q_.cullingMargin(spheres); }

  bool endsAtFirst() const override { return q_.endsAtFirst(); }

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

  bool triangle(std::uint32_t t, const Node& b) override {
    const auto& i = surface_.mesh->indices(t);
    const Eigen::Vector3d corners[3] = {frame_ * surface_.mesh->vertex(i[0]), frame_ * surface_.mesh->vertex(i[1]),
                                        frame_ * surface_.mesh->vertex(i[2])};
    const query::Points points{corners, 3};
    const double near = std::max(slack_, q_.margin);
    const query::Gap gap = partner_.gap(b, points, near);
    if (gap.atLeast > near) return false;
    if (once_ && !seen_.insert(partner_.name(b), t)) return false;

    if (!gap.touches() && gap.atLeast > q_.margin) {
      fcl::Vector3<S> c[3];
      for (std::size_t k = 0; k < 3; ++k) c[k] = surface_.mesh->vertex(i[k]).template cast<S>();
      if (!partner_.touch(b, narrow_phase_, c, X_WM_)) return false;
    }
    if (costs_) {
      const fcl::Vector3<S> p = X_WM_ * surface_.mesh->vertex(i[0]).template cast<S>();
      const fcl::Vector3<S> r = X_WM_ * surface_.mesh->vertex(i[1]).template cast<S>();
      const fcl::Vector3<S> s = X_WM_ * surface_.mesh->vertex(i[2]).template cast<S>();
      addCost(fcl::AABB<S>(p, r, s), b);
    }
    if (!q_.request.enable_contact) return add(t, b, nullptr);
    // With a margin the way must be known, and of what is nearly in touch it is not.
    query::Touch touch;
    if (gap.touches() || (q_.margin > 0 && gap.distance <= frame_.rounding())) {
      touch = partner_.part(b, points, gap);
      touch.depth += q_.margin;
    } else {
      touch = bridge(gap, points, b);
      touch.depth = std::max(q_.margin - gap.distance, 0.0);
    }
    touch = inWorld(touch);
    return add(t, b, &touch);
  }

  bool cell(const query::CellLeaf& a, const Node& b) override {
    const lattice::Lattice& lattice = surface_.lattice;
    const Eigen::Vector3d in_model = lattice.origin() + lattice.unit() * a.sphere.center, center = frame_ * in_model;
    const double radius = lattice.unit() * a.sphere.radius;
    if (costs_) {
      const fcl::Vector3<S> c = (X_WB_ * center).template cast<S>();
      const fcl::Vector3<S> r = fcl::Vector3<S>::Constant(static_cast<S>(radius));
      addCost(fcl::AABB<S>(c - r, c + r), b);
    }
    if (!q_.request.enable_contact) return add(a.id, b, nullptr);
    const query::Touch touch = inWorld(partBall(center, radius, b));
    return add(a.id, b, &touch);
  }

 private:
  static query::PairSet<std::uint64_t>& pairs() {
    thread_local query::PairSet<std::uint64_t> set;
    return set;
  }

  /// Of points that are just off the body: the way between the nearest ones, of no depth.
  query::Touch bridge(const query::Gap& gap, const query::Points& points, const Node& b) const {
    const Eigen::Vector3d way = gap.on_points - gap.on_body;
    query::Touch touch;
    // The shortest ways are rounding, and lead anywhere.
    const double size = gap.on_points.norm() + gap.on_body.norm();
    touch.normal = way.norm() > 1e-12 * size ? way.normalized() : partner_.part(b, points, gap).normal;
    touch.point = (gap.on_points + gap.on_body) / 2;
    return touch;
  }

  query::Touch partBall(const Eigen::Vector3d& center, double radius, const Node& b) const {
    const query::Points point{&center, 1};
    const query::Gap gap = partner_.gap(b, point, std::numeric_limits<double>::infinity());
    query::Touch touch;
    if (gap.touches()) {
      touch = partner_.part(b, point, gap);
      touch.depth += radius + q_.margin;
      touch.point -= touch.normal * (radius / 2);
    } else {
      const double overlap = radius - gap.distance;  // negative: a gap, within the margin
      touch.normal = (center - gap.on_body).normalized();
      touch.depth = std::max(overlap + q_.margin, 0.0);
      touch.point = gap.on_body - touch.normal * (overlap / 2);
    }
    return touch;
  }

  query::Touch inWorld(query::Touch touch) const {
    touch.normal = X_WB_.linear() * touch.normal;
    touch.point = X_WB_ * touch.point;
    return touch;
  }

  void addApproximateCosts(const Node& b, const query::Points& box, const fcl::AABB<S>& in_world) const {
    if (!partner_.gap(b, box, 0).touches()) return;
    if (partner_.state(b) == query::State::kLeaf) return addCost(in_world, b);
    partner_.children(b, [&](const Node& c) { addApproximateCosts(c, box, in_world); });
  }

  void addCost(const fcl::AABB<S>& box, const Node& b) const {
    q_.addCost(box, partner_.worldBox(b), partner_.density(b));
  }

  // `touch` has the normal from the body to the model.
  bool add(std::uint64_t id, const Node& b, const query::Touch* touch) const {
    if (!partner_.occupied(b)) return q_.request.isSatisfied(q_.result);
    const std::intptr_t model = static_cast<std::intptr_t>(id), body = static_cast<std::intptr_t>(partner_.name(b));
    if (swapped_ || touch == nullptr) return q_.addContact(swapped_ ? body : model, swapped_ ? model : body, touch);
    query::Touch turned = *touch;
    turned.normal = -turned.normal;
    return q_.addContact(model, body, &turned);
  }

  const Question<S>& q_;
  const Partner& partner_;
  const BodyFrame<S>& frame_;
  const oracle::Surface& surface_;
  const NarrowPhase<S>& narrow_phase_;
  const fcl::Transform3<S>& X_WM_;
  const fcl::Transform3<double> X_WB_;
  const double slack_;
  const bool swapped_, costs_, once_;
  query::PairSet<std::uint64_t>& seen_;
};

/// The collision of a model and the bodies of a partner, the first geometry when `swapped`: with_partner(frame,
/// costs, f) makes the partner's side, with what has no contacts but costs or without, and calls f with it.
template <typename S, typename F>
void collideBodies(const Question<S>& q, tree::Tree& tree, bool swapped, const NarrowPhase<S>& narrow_phase,
                   F&& with_partner) {
  // As FCL does for meshes: contacts first, and then the costs of the box about the mesh.
  const bool approximate = q.request.enable_cost && q.request.use_approximate_cost;
  fcl::CollisionRequest<S> request(q.request);
  request.enable_cost = q.request.enable_cost && !approximate;
  const Question<S> first{q.o1, q.o2, q.X_W1, q.X_W2, request, q.result, q.margin};
  const std::size_t before = q.result.numContacts();
  std::int64_t now;
  {
    const Look look(tree, nullptr);
    const query::TreeSide a(tree);
    now = a.now();
    const oracle::Surface& surface = tree.surface();
    const BodyFrame<S> frame(swapped ? q.X_W2 : q.X_W1, swapped ? q.X_W1 : q.X_W2, surface);
    const auto with_collector = [&](bool costs, auto&& f) {
      with_partner(frame, costs, [&](const auto& partner) {
        using Partner = std::remove_cv_t<std::remove_reference_t<decltype(partner)>>;
        BodyCollector<S, Partner> collector(first, partner, frame, surface, narrow_phase, swapped, request.enable_cost);
        f(partner, collector);
      });
    };
    if (q.occupied() || request.enable_cost) {
      with_collector(request.enable_cost, [&](const auto& partner, auto& collector) {
        using Partner = std::remove_cv_t<std::remove_reference_t<decltype(partner)>>;
        using Visitor = query::BodyVisitor<typename Partner::Node>;
        const query::Placement b_in_a = frame.toLattice(surface.lattice, collector.slack(a.cells()));
        query::PairWalk<query::TreeSide, Partner, Visitor>(a, partner, b_in_a, collector).run();
      });
    }
    if (tree.solid() != nullptr && q.mayBeInside(before)) {
      with_partner(frame, false, [&](const auto& partner) {
        if (!holds(a, frame, partner)) return;
        addInside(q, a, partner, frame.toLattice(surface.lattice, 0), swapped);
      });
    }
    if (approximate) {
      with_collector(true, [](const auto& partner, auto& collector) { collector.addApproximateCosts(partner.root()); });
    }
  }
  tree.afterQuery(now);
}

}  // namespace bocst::fcl_room
