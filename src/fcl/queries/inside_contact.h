// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <limits>

#include "fcl/adapters/pair.h"
#include "fcl/queries/collide_query.h"
#include "query/distance/distance_walk.h"

namespace bocst::fcl_adapter {

/// The contact of what is inside with the solid around it: no surfaces meet. With contacts asked for, it is about the
/// places where the surfaces are nearest; the way out is at least so long.
template <typename S, typename B>
void addInside(const CollideQuery<S>& q, const query::TreeSide& a, const B& b, const query::SimilarityTransform& b_in_a,
               bool swapped) {
  fcl::Contact<S> c;
  c.o1 = q.o1;
  c.o2 = q.o2;
  c.b1 = c.b2 = fcl::Contact<S>::NONE;
  c.normal.setConstant(std::numeric_limits<S>::quiet_NaN());
  c.pos = c.normal;
  c.penetration_depth = std::numeric_limits<S>::quiet_NaN();
  if (q.request.enable_contact) {
    const lattice::Lattice& lattice = a.tree().surface().lattice;
    query::Nearest n = query::DistanceWalk<query::TreeSide, B>(a, b, b_in_a).run({});
    if (swapped) std::swap(n.on_a, n.on_b);
    const Eigen::Isometry3d X_WA = isometryOf<S>(swapped ? q.X_W2 : q.X_W1);
    const Eigen::Vector3d displacement = n.on_a - n.on_b;
    const Eigen::Vector3d normal =
        n.distance > 0 ? Eigen::Vector3d(displacement / n.distance) : Eigen::Vector3d::UnitX();
    c.normal = (X_WA.linear() * normal).template cast<S>();
    c.pos = (X_WA * Eigen::Vector3d(lattice.origin() + lattice.unit() / 2 * (n.on_a + n.on_b))).template cast<S>();
    c.penetration_depth = static_cast<S>(n.distance * lattice.unit() + q.margin);
  }
  q.result.addContact(c);
}

}  // namespace bocst::fcl_adapter
