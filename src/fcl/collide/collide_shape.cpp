// SPDX-License-Identifier: BSD-3-Clause
#include <fcl/geometry/shape/utility.h>

#include <functional>

#include "fcl/collide/collide_bodies.h"
#include "fcl/collide/convex_collision.h"

namespace bocst::fcl_adapter {
namespace {

/// The side of a single shape, see ConvexCollector.
template <typename S>
class ShapeSide : public query::ConvexSide {
 public:
  ShapeSide(const query::ConvexShape& body, const fcl::ShapeBase<S>& shape, const fcl::Transform3<S>& X_WS, S density)
      : ConvexSide(body), shape_(shape), X_WS_(X_WS), density_(density) {}

  bool fclOverlaps(Node, const NarrowPhase<S>& narrow_phase, const fcl::Vector3<S> (&corners)[3],
                   const fcl::Transform3<S>& X_WM) const {
    return narrow_phase.fclOverlaps(shape_, X_WS_, corners, X_WM);
  }
  bool occupied(Node) const { return true; }
  S density(Node) const { return density_; }
  fcl::AABB<S> worldBox(Node) const {
    return withShape(shape_, [this](const auto& s) {
      fcl::AABB<S> box;
      fcl::computeBV(s, X_WS_, box);
      return box;
    });
  }

 private:
  const fcl::ShapeBase<S>& shape_;
  const fcl::Transform3<S>& X_WS_;
  const S density_;
};

}  // namespace

template <typename S>
void collideShape(const CollideQuery<S>& q, tree::Tree& tree, const BroughtSolver<S>& brought) {
  const auto& shape = static_cast<const fcl::ShapeBase<S>&>(*q.b());
  const auto collide_with = [&](const NarrowPhase<S>& narrow_phase) {
    collideConvex(q, tree, narrow_phase, [&](const ConvexFrame<S>& frame, bool, auto&& f) {
      withConvexShape(shape, frame.region(), [&](const query::ConvexShape& body) {
        f(ShapeSide<S>(body, shape, q.X_WB(), q.o1->cost_density * q.o2->cost_density));
      });
    });
  };
  withNarrowPhase<S>(brought, q.request, std::ref(collide_with));
}

template void collideShape<float>(const CollideQuery<float>&, tree::Tree&, const BroughtSolver<float>&);
template void collideShape<double>(const CollideQuery<double>&, tree::Tree&, const BroughtSolver<double>&);

}  // namespace bocst::fcl_adapter
