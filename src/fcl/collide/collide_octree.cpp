// SPDX-License-Identifier: BSD-3-Clause
#include <functional>

#include "fcl/adapters/octree_side.h"
#include "fcl/collide/collide_bodies.h"

#if FCL_HAVE_OCTOMAP

#include "fcl/collide/convex_collision.h"

namespace bocst::fcl_adapter {

template <typename S>
void collideOcTree(const CollideQuery<S>& q, tree::Tree& tree, const BroughtSolver<S>& brought) {
  const auto& octree = static_cast<const fcl::OcTree<S>&>(*q.b());
  const auto collide_with = [&](const NarrowPhase<S>& narrow_phase) {
    collideConvex(q, tree, narrow_phase, [&](const ConvexFrame<S>&, bool costs, auto&& f) {
      const OcTreeSide<S> side(octree, q.X_WB(), q.a()->cost_density, costs);
      if (!side.empty()) f(side);
    });
  };
  withNarrowPhase<S>(brought, q.request, std::ref(collide_with));
}

template void collideOcTree<float>(const CollideQuery<float>&, tree::Tree&, const BroughtSolver<float>&);
template void collideOcTree<double>(const CollideQuery<double>&, tree::Tree&, const BroughtSolver<double>&);

}  // namespace bocst::fcl_adapter

#endif  // FCL_HAVE_OCTOMAP
