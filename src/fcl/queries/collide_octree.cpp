// SPDX-License-Identifier: BSD-3-Clause
#include "fcl/queries/collide_octree.h"

#include "fcl/adapters/octree_side.h"

#if FCL_HAVE_OCTOMAP

#include "fcl/queries/collide_convex.h"

namespace bocst::fcl_adapter {

template <typename S>
void collideOcTree(const CollideQuery<S>& q, tree::Tree& tree, bool swapped, const BroughtSolver<S>& brought) {
  const auto& octree = static_cast<const fcl::OcTree<S>&>(*(swapped ? q.o1 : q.o2));
  const fcl::Transform3<S>& X_WO = swapped ? q.X_W1 : q.X_W2;
  const S density = (swapped ? q.o2 : q.o1)->cost_density;
  withNarrowPhase<S>(brought, q.request, [&](const NarrowPhase<S>& narrow_phase) {
    collideConvex(q, tree, swapped, narrow_phase, [&](const ConvexFrame<S>&, bool costs, auto&& f) {
      const OcTreeSide<S> side(octree, X_WO, density, costs);
      if (!side.empty()) f(side);
    });
  });
}

template void collideOcTree<float>(const CollideQuery<float>&, tree::Tree&, bool, const BroughtSolver<float>&);
template void collideOcTree<double>(const CollideQuery<double>&, tree::Tree&, bool, const BroughtSolver<double>&);

}  // namespace bocst::fcl_adapter

#endif  // FCL_HAVE_OCTOMAP
