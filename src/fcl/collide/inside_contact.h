// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "fcl/adapters/pair.h"
#include "fcl/collide/collide_query.h"
#include "query/distance/distance_walk.h"

namespace bocst::fcl_adapter {

/// The contact of what is inside with the solid around it: no surfaces meet. With contacts asked for, it is about the
/// places where the surfaces are nearest; the way out is at least so long.
template <typename S, typename B>
void addInside(const CollideQuery<S>& q, const query::TreeSide& a, const B& b,
               const query::SimilarityTransform& b_in_a) {
  constexpr std::intptr_t kNone = fcl::Contact<S>::NONE;
  if (!q.request.enable_contact) {
    q.addContact(kNone, kNone, nullptr);
    return;
  }
  const lattice::Lattice& lattice = a.tree().surface().lattice;
  query::Nearest n = query::DistanceWalk<query::TreeSide, B>(a, b, b_in_a).run({});
  q.inCallersOrder(n.on_a, n.on_b);
  const Eigen::Isometry3d X_WA = isometryOf<S>(q.X_WA());
  const Eigen::Vector3d displacement = n.on_a - n.on_b;
  query::ContactPoint contact;
  contact.normal =
      X_WA.linear() * (n.distance > 0 ? Eigen::Vector3d(displacement / n.distance) : Eigen::Vector3d::UnitX());
  contact.point = X_WA * Eigen::Vector3d(lattice.origin() + lattice.unit() / 2 * (n.on_a + n.on_b));
  contact.depth = n.distance * lattice.unit() + q.margin;
  q.addContact(kNone, kNone, &contact);
}

}  // namespace bocst::fcl_adapter
