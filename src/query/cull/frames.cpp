// SPDX-License-Identifier: BSD-3-Clause
#include "query/cull/frames.h"

#include <algorithm>
#include <cmath>

namespace bocst::query {

bool PairFrames::isFine(const SimilarityTransform& one_in_zero, std::size_t triangles_of_smaller) {
  const double q0 = lattice::kMiddle, q1 = q0 * one_in_zero.scale, all = one_in_zero.translation.norm() + q0 + q1;
  // By measurement. Bounds in double take three times as long; but float cannot tell which triangles are the nearest
  // of those within the rounding margin, 320 u `all`.
  constexpr double kMostTriangles = 0x1p25, kLeast = 0x1p6, kMost = 0x1p13;
  const double most = std::clamp(kMostTriangles / static_cast<double>(triangles_of_smaller + 1), kLeast, kMost);
  return all <= most * std::min(q0, q1);  // false for NaN
}

double placeSides(const SimilarityTransform& one_in_zero, SideFrame& zero, SideFrame& one) {
  const Eigen::Vector3d middle = Eigen::Vector3d::Constant(lattice::kMiddle);
  const Eigen::Matrix3d& r = one_in_zero.rotation;
  const Eigen::Vector3d t = one_in_zero * middle - middle, back = -(r.transpose() * t);
  for (int j = 0; j < 3; ++j) {
    for (int k = 0; k < 3; ++k) zero.to_other[j][k] = one.to_other[k][j] = static_cast<float>(r(k, j));
    zero.shift[j] = static_cast<float>(back[j]);
    one.shift[j] = static_cast<float>(t[j]);
  }
  zero.unit = 1;
  one.unit = static_cast<float>(one_in_zero.scale);
  return t.norm();
}

PairFrames::PairFrames(const SimilarityTransform& one_in_zero) {
  const double q0 = lattice::kMiddle, q1 = q0 * one_in_zero.scale;
  const double between = placeSides(one_in_zero, side[0], side[1]);
  for (Side& s : side) {
    for (int j = 0; j < 3; ++j) {
      for (int k = 0; k < 3; ++k) s.abs_to_other[j][k] = std::abs(s.to_other[j][k]);
    }
  }
  const double size = between + std::sqrt(3.0) * (q0 + q1),
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
