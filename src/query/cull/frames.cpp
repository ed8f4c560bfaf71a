// SPDX-License-Identifier: BSD-3-Clause
#include "query/cull/frames.h"

#include <algorithm>
#include <cmath>

namespace bocst::query {

bool PairFrames::isFine(const SimilarityTransform& one_in_zero) {
  const double q0 = lattice::kMiddle, q1 = q0 * one_in_zero.scale;
  // False for NaN.
  return fits(one_in_zero.scale) && (one_in_zero.translation.norm() + q0 + q1) * 0x1p-9 <= std::min(q0, q1);
}

PairFrames::PairFrames(const SimilarityTransform& one_in_zero) {
  const double q0 = lattice::kMiddle, q1 = q0 * one_in_zero.scale;
  const Eigen::Matrix3d& r = one_in_zero.rotation;
  // Where the middle of side 1's root is, from that of side 0's.
  const Eigen::Vector3d t = one_in_zero * Eigen::Vector3d::Constant(q0) - Eigen::Vector3d::Constant(q0);
  const Eigen::Vector3d back = -(r.transpose() * t);
  for (int j = 0; j < 3; ++j) {
    for (int k = 0; k < 3; ++k) {
      side[0].to_other[j][k] = side[1].to_other[k][j] = static_cast<float>(r(k, j));
      side[0].abs_to_other[j][k] = side[1].abs_to_other[k][j] = static_cast<float>(std::abs(r(k, j)));
    }
    side[0].shift[j] = static_cast<float>(back[j]);
    side[1].shift[j] = static_cast<float>(t[j]);
  }
  side[0].unit = 1;
  side[1].unit = static_cast<float>(one_in_zero.scale);
  const double size = t.norm() + std::sqrt(3.0) * (q0 + q1),
               orthogonality_error = 4 * size * one_in_zero.orthogonality_error;
  rounding_margin = static_cast<float>((48 * 0x1p-24 * size + orthogonality_error + one_in_zero.tolerance) * 1.0001);
  side[0].rounding_margin =
      static_cast<float>((128 * 0x1p-24 * q0 + orthogonality_error + one_in_zero.tolerance) * 1.0001);
  side[1].rounding_margin =
      static_cast<float>((128 * 0x1p-24 * q1 + orthogonality_error + one_in_zero.tolerance) * 1.0001);
  slab_rounding_margin =
      static_cast<float>((160 * 0x1p-24 * size + 2 * orthogonality_error + 1.02 * one_in_zero.tolerance) * 1.0001);
}

}  // namespace bocst::query
