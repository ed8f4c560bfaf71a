// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/reference.h"

#include <algorithm>
#include <cmath>

#include "lattice/lattice.h"

namespace bocst::oracle {
namespace {

constexpr double kUlp = 0x1p-53;
constexpr double kBoxRoundingMargin = 16 * kUlp * (1 << lattice::kBits);
constexpr double kPlaneRoundingMargin = 32 * kUlp;

}  // namespace

bool triangleMeetsCube(const Eigen::Vector3d corners[3], const Eigen::Vector3d& center, double half) {
  const double h = half + kBoxRoundingMargin;
  const Eigen::Vector3d v[3] = {corners[0] - center, corners[1] - center, corners[2] - center};
  for (int k = 0; k < 3; ++k) {
    if (std::min({v[0][k], v[1][k], v[2][k]}) > h || std::max({v[0][k], v[1][k], v[2][k]}) < -h) return false;
  }
  const Eigen::Vector3d e[3] = {corners[1] - corners[0], corners[2] - corners[1], corners[0] - corners[2]};

  // Plane: the sizes of the products before they cancel bound the rounding error of the normal.
  Eigen::Vector3d n, size;
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    const double a = e[0][i] * e[1][j], b = e[0][j] * e[1][i];
    n[k] = a - b;
    size[k] = std::abs(a) + std::abs(b);
  }
  // Sums in the order that shaders/decide.glsl has, too.
  const double width = (std::abs(n[0]) + std::abs(n[1])) + std::abs(n[2]);
  const double products =
      (size[0] * (std::abs(v[0][0]) + h) + size[1] * (std::abs(v[0][1]) + h)) + size[2] * (std::abs(v[0][2]) + h);
  const double along = (n[0] * v[0][0] + n[1] * v[0][1]) + n[2] * v[0][2];
  if (std::abs(along) > h * width + kPlaneRoundingMargin * products) return false;

  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d& a = v[i];            // both ends of the edge project to the same value
    const Eigen::Vector3d& b = v[(i + 2) % 3];  // the corner across
    for (int k = 0; k < 3; ++k) {
      const int p = (k + 1) % 3, q = (k + 2) % 3;
      const double ep = e[i][p], eq = e[i][q];
      const double s = ep * a[q] - eq * a[p], t = ep * b[q] - eq * b[p];
      const double r = h * (std::abs(ep) + std::abs(eq));
      if (std::min(s, t) > r || std::max(s, t) < -r) return false;
    }
  }
  return true;
}

}  // namespace bocst::oracle
