// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/model.h>

#include <cmath>
#include <limits>

#include "fcl/adapters/pair.h"
#include "tree/tree.h"

namespace bocst::fcl_adapter {

/// The boxes of two models' surfaces, for many poses of b in the frame of a: most of a planner's poses need no more.
/// To be made and asked while the query locks of both trees are held.
template <typename S>
class PoseBoxes {
 public:
  PoseBoxes(const Model<S>& a, const Model<S>& b) : margin_(1.001 * marginOf(&a, &b)) {
    // Spheres of conservative answers stick out of the boxes.
    if (a.tree().conservative() || b.tree().conservative()) margin_ = std::numeric_limits<double>::infinity();
    const Eigen::AlignedBox3d box_a = a.tree().bounds(), box_b = b.tree().bounds();
    size_ = 2 * (magnitudeOf(box_a) + magnitudeOf(box_b));
    const Eigen::Vector3d middle_a = box_a.center(), middle_b = box_b.center();
    const Eigen::Vector3d to_a = (box_a.max() - middle_a).cwiseMax(middle_a - box_a.min()),
                          to_b = (box_b.max() - middle_b).cwiseMax(middle_b - box_b.min());
    // However b is turned, it is no farther from its origin than this.
    reach_ = to_a.norm() + 1.002 * (middle_b.norm() + to_b.norm());
    for (int i = 0; i < 3; ++i) {
      middle_a_[i] = middle_a[i];
      middle_b_[i] = middle_b[i];
      half_a_[i] = to_a[i];
      half_b_[i] = to_b[i];
      along_b_[i] = 1.001 * to_b[i] + 0.001 * to_b.sum();
    }
  }

  /// Are the surfaces farther apart than their margins, by the spheres about the boxes or the six axes of these? The
  /// axes of b are the columns u of R, which need not be quite orthogonal: as entries of R^T R are off the identity's
  /// by 1e-3 at most, along u box b reaches no farther than along_b_, and margins are no longer than 1.001 times what
  /// they are. FCL's test, and this one, are off by no more than roundingOf() each.
  bool areApart(const fcl::Transform3<S>& X_AB) const {
    const S* m = X_AB.matrix().data();  // columns of four
    double R[3][3], turned[3][3], d[3], lengths = 0, squares = 0;
    for (int i = 0; i < 3; ++i) {
      d[i] = static_cast<double>(m[12 + i]);
      lengths += std::abs(d[i]);
      d[i] -= middle_a_[i];
      squares += d[i] * d[i];
    }
    const double allowed = margin_ + 1.001 * 2 * roundingOf<S>(lengths + size_), far = reach_ + allowed;
    // Most of a planner's poses end here.
    if (squares > far * far) return true;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        R[i][j] = static_cast<double>(m[4 * j + i]);
        turned[i][j] = std::abs(R[i][j]);
      }
    }
    bool apart = false;
    for (int i = 0; i < 3; ++i) {
      d[i] += R[i][0] * middle_b_[0] + R[i][1] * middle_b_[1] + R[i][2] * middle_b_[2];
      const double b = turned[i][0] * half_b_[0] + turned[i][1] * half_b_[1] + turned[i][2] * half_b_[2];
      apart |= std::abs(d[i]) > half_a_[i] + b + allowed;
    }
    for (int j = 0; j < 3; ++j) {
      const double along = d[0] * R[0][j] + d[1] * R[1][j] + d[2] * R[2][j];
      const double a = half_a_[0] * turned[0][j] + half_a_[1] * turned[1][j] + half_a_[2] * turned[2][j];
      apart |= std::abs(along) > a + along_b_[j] + allowed;
    }
    return apart;
  }

 private:
  double margin_, size_, reach_;
  double middle_a_[3], middle_b_[3], half_a_[3], half_b_[3], along_b_[3];
};

}  // namespace bocst::fcl_adapter
