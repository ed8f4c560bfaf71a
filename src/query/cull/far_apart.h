// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cmath>

#include "tree/outline.h"

namespace bocst::query {

/// Are two oriented boxes surely farther apart than `margin`? Those that are far apart are found, not all: along the
/// line of their middles and their own axes. `rotation` and `translation` place b's frame in a's; all in float, whose
/// range ends where sizes are not within 1e-15 to 1e15: these are never far apart.
///
/// A rotation whose entries of R^T R - 1 reach 1e-3 changes positions by 3e-3 of their size and lengths by half of
/// that; rounding in float is far less. So a gap counts beyond 5e-3 of all sizes.
template <typename S>
bool areFarApart(const tree::Outline::Box& a, const tree::Outline::Box& b, const S (&rotation)[3][3],
                 const S (&translation)[3], double margin) {
  using V4 = Eigen::Array4f;
  const auto load = [](const float(&x)[4]) { return V4(Eigen::Map<const V4, Eigen::Aligned16>(x)); };
  const auto sum = [](const V4& x) { return x[0] + x[1] + x[2]; };
  V4 columns[3], rows[3], at;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) columns[c][r] = rows[r][c] = static_cast<float>(rotation[r][c]);
    columns[r][3] = rows[r][3] = 0;
    at[r] = static_cast<float>(translation[r]);
  }
  at[3] = 0;
  const auto combined = [](const V4(&v)[3], const V4& by) { return V4(v[0] * by[0] + v[1] * by[1] + v[2] * by[2]); };
  const V4 axes_a[3] = {load(a.axes[0]), load(a.axes[1]), load(a.axes[2])},
           axes_b[3] = {load(b.axes[0]), load(b.axes[1]), load(b.axes[2])}, half_a = load(a.half),
           half_b = load(b.half);
  const V4 way = combined(columns, load(b.center)) + at - load(a.center);
  // How far the boxes reach along a direction of a's frame, in sum.
  const auto extent = [&](const V4& d) {
    return sum(combined(axes_a, d).abs() * half_a + combined(axes_b, combined(rows, d)).abs() * half_b);
  };
  const float squared = sum(way * way), length = std::sqrt(squared);
  if (!(length > 1e-15f && squared < 1e30f)) return false;
  const float least = static_cast<float>(margin) * 1.001f + 5e-3f * (length + 2 * (a.reach[0] + b.reach[0]));
  if (squared - extent(way) > least * length) return true;
  for (int k = 0; k < 3; ++k) {
    const V4 of_a(axes_a[0][k], axes_a[1][k], axes_a[2][k], 0);
    if (std::abs(sum(of_a * way)) - extent(of_a) > least) return true;
    const V4 of_b = combined(columns, V4(axes_b[0][k], axes_b[1][k], axes_b[2][k], 0));
    if (std::abs(sum(of_b * way)) - extent(of_b) > least) return true;
  }
  return false;
}

}  // namespace bocst::query
