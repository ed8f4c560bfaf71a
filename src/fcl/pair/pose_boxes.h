// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/model.h>

#include "fcl/adapters/models.h"
#include "fcl/adapters/pair.h"
#include "query/cull/near_poses.h"
#include "tree/tree.h"

namespace bocst::fcl_adapter {

/// The boxes of two models' surfaces, for many poses of b in the frame of a: most of a planner's poses need no more.
/// To be made and asked while the query locks of both trees are held.
///
/// The axes of b are the columns u of R: as entries of R^T R are off the identity's by 1e-3 at most, along u box b
/// reaches no farther than along_b, and margins are no longer than 1.001 times what they are. FCL's test, and that of
/// the boxes, are off by no more than roundingOf() each.
template <typename S>
query::PoseBoxes boxesOf(const Model<S>& a, const Model<S>& b) {
  // Not Tree::bounds(), which takes the lock that is held: behind a writer that waits, it would wait for ever.
  const Eigen::AlignedBox3d box_a = treeOf(a).queryBox(), box_b = treeOf(b).queryBox();
  const Eigen::Vector3d middle_a = box_a.center(), middle_b = box_b.center();
  const Eigen::Vector3d to_a = (box_a.max() - middle_a).cwiseMax(middle_a - box_a.min()),
                        to_b = (box_b.max() - middle_b).cwiseMax(middle_b - box_b.min());
  const double margin = 1.001 * marginOf(&a, &b);
  query::PoseBoxes boxes;
  // However b is turned, it is no farther from its origin than this.
  boxes.radius_sum = to_a.norm() + 1.002 * (middle_b.norm() + to_b.norm());
  // Conservative answers allow for an orthogonality error, see relate(); no length there is more than one here.
  const double skew = treeOf(a).conservative() || treeOf(b).conservative() ? 4 * query::kPoseSkew : 0;
  boxes.allowed_per_length = 1.001 * (2 * roundingOf<S>(1) + skew);
  boxes.allowed = margin + boxes.allowed_per_length * 2 * (magnitudeOf(box_a) + magnitudeOf(box_b));
  for (int i = 0; i < 3; ++i) {
    boxes.middle_a[i] = middle_a[i];
    boxes.middle_b[i] = middle_b[i];
    boxes.half_a[i] = to_a[i];
    boxes.half_b[i] = to_b[i];
    boxes.along_b[i] = 1.001 * to_b[i] + 0.001 * to_b.sum();
  }
  return boxes;
}

}  // namespace bocst::fcl_adapter
