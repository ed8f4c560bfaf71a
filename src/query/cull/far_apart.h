// SPDX-License-Identifier: BSD-3-Clause
#pragma once

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
bool areFarApart(const tree::Outline::Reader& a, const tree::Outline::Reader& b, const S (&rotation)[3][3],
                 const S (&translation)[3], double margin) {
  using Vector = float[3];
  float R[3][3];
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) R[r][c] = static_cast<float>(rotation[r][c]);
  }
  const auto dot = [](const Vector& x, const Vector& y) { return x[0] * y[0] + x[1] * y[1] + x[2] * y[2]; };
  // How far a box reaches from its middle along d, in its own frame.
  const auto extent = [](const tree::Outline::Reader& box, const Vector& d) {
    float sum = 0;
#pragma GCC unroll 3
    for (std::size_t k = 0; k < 3; ++k) {
      sum += box.half(k) * std::abs(box.axis(0, k) * d[0] + box.axis(1, k) * d[1] + box.axis(2, k) * d[2]);
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
             static_cast<float>(translation[r]) - a.center(r);
  }
  const float squared = dot(way, way), length = std::sqrt(squared);
  if (!(length > 1e-15f && squared < 1e30f)) return false;
  const float least = static_cast<float>(margin) * 1.001f + 5e-3f * (length + 2 * (a.reach() + b.reach()));
  inB(way, turned);
  if (squared - extent(a, way) - extent(b, turned) > least * length) return true;
  for (std::size_t k = 0; k < 3; ++k) {
    const Vector of_a = {a.axis(0, k), a.axis(1, k), a.axis(2, k)};
    inB(of_a, turned);
    if (std::abs(dot(of_a, way)) - extent(a, of_a) - extent(b, turned) > least) return true;
    const Vector axis_b = {b.axis(0, k), b.axis(1, k), b.axis(2, k)};
    const Vector of_b = {dot(R[0], axis_b), dot(R[1], axis_b), dot(R[2], axis_b)};
    if (std::abs(dot(of_b, way)) - extent(a, of_b) - b.half(k) * 1.01f > least) return true;
  }
  return false;
}

}  // namespace bocst::query
