// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

#include "tree/outline.h"

namespace bocst::query {

/// Are two oriented boxes surely farther apart than `margin`? Those that are far apart are found, not all: along the
/// line of their middles and their own axes. `rotation` and `translation` place b's frame in a's.
///
/// A rotation whose entries of R^T R - 1 reach 1e-3 changes positions by 3e-3 of their size and lengths by half of
/// that; rounding in float is far less. So a gap counts beyond 5e-3 of all sizes.
template <typename S>
bool areFarApart(const tree::Outline::Reader& a, const tree::Outline::Reader& b, const S (&rotation)[3][3],
                 const S (&translation)[3], double margin) {
  using Vector = double[3];
  double R[3][3];
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) R[r][c] = static_cast<double>(rotation[r][c]);
  }
  const auto dot = [](const Vector& x, const Vector& y) { return x[0] * y[0] + x[1] * y[1] + x[2] * y[2]; };
  // How far a box reaches from its middle along d, in its own frame.
  const auto extent = [](const tree::Outline::Reader& box, const Vector& d) {
    double sum = 0;
#pragma GCC unroll 3
    for (std::size_t k = 0; k < 3; ++k) {
      sum += box.half(k) * std::abs(box.axis(k, 0) * d[0] + box.axis(k, 1) * d[1] + box.axis(k, 2) * d[2]);
    }
    return sum;
  };
  const auto inB = [&R](const Vector& d, Vector& to) {
#pragma GCC unroll 3
    for (int c = 0; c < 3; ++c) to[c] = R[0][c] * d[0] + R[1][c] * d[1] + R[2][c] * d[2];
  };
  Vector way, turned;
#pragma GCC unroll 3
  for (std::size_t r = 0; r < 3; ++r) {
    way[r] = R[r][0] * b.center(0) + R[r][1] * b.center(1) + R[r][2] * b.center(2) +
             static_cast<double>(translation[r]) - a.center(r);
  }
  const double squared = dot(way, way), length = std::sqrt(squared);
  // Squares of less underflow. Not true of what is not a number.
  if (!(length > 1e-120)) return false;
  const double least = margin + 5e-3 * (length + 2 * (a.reach() + b.reach()));
  inB(way, turned);
  if (squared - extent(a, way) - extent(b, turned) > least * length) return true;
  for (std::size_t k = 0; k < 3; ++k) {
    const Vector of_a = {a.axis(k, 0), a.axis(k, 1), a.axis(k, 2)};
    inB(of_a, turned);
    if (std::abs(dot(of_a, way)) - a.half(k) - extent(b, turned) > least) return true;
    const Vector of_b = {b.axis(k, 0), b.axis(k, 1), b.axis(k, 2)};
    for (int r = 0; r < 3; ++r) turned[r] = dot(R[r], of_b);
    if (std::abs(dot(turned, way)) - b.half(k) - extent(a, turned) > least) return true;
  }
  return false;
}

}  // namespace bocst::query
