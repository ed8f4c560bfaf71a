// SPDX-License-Identifier: BSD-3-Clause
#include "fcl/queries/scene_pair.h"

#include "fcl/adapters/pair.h"
#include "query/collide/tree_walk.h"

namespace bocst::fcl_adapter {

template <typename S>
bool hullsApart(const Model<S>& a, const fcl::Transform3<S>& X_WA, const Model<S>& b, const fcl::Transform3<S>& X_WB,
                double gap) {
  bool apart = false;
  const double more = marginOf(&a, &b) + gap;
  betweenTrees(
      X_WA, a.tree(), X_WB, b.tree(),
      [&](const query::TreeSide& side_a, const query::TreeSide& side_b, query::SimilarityTransform b_in_a, double) {
        if (!query::TreeWalk::fits(side_a, side_b, b_in_a)) return;
        b_in_a.tolerance += more / side_a.tree().surface().lattice.unit();
        apart = query::TreeWalk(side_a, side_b, b_in_a).isNeedless();
      });
  return apart;
}

template bool hullsApart<float>(const Model<float>&, const fcl::Transform3<float>&, const Model<float>&,
                                const fcl::Transform3<float>&, double);
template bool hullsApart<double>(const Model<double>&, const fcl::Transform3<double>&, const Model<double>&,
                                 const fcl::Transform3<double>&, double);

}  // namespace bocst::fcl_adapter
