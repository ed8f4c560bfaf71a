// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <vector>

// A ball with a wavy surface, so that it is not convex: rings times segments of two triangles each.
struct WavyBall {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<Eigen::Vector3i> triangles;

  WavyBall(double radius, int rings) {
    const int segments = 2 * rings;
    for (int i = 0; i <= rings; ++i) {
      for (int j = 0; j < segments; ++j) {
        const double u = M_PI * i / rings, v = 2 * M_PI * j / segments;
        const double r = radius * (1 + 0.2 * std::sin(3 * u) * std::sin(4 * v));
        vertices.emplace_back(r * std::sin(u) * std::cos(v), r * std::sin(u) * std::sin(v), r * std::cos(u));
      }
    }
    for (int i = 0; i < rings; ++i) {
      for (int j = 0; j < segments; ++j) {
        const int a = i * segments + j, b = i * segments + (j + 1) % segments;
        triangles.emplace_back(a, a + segments, b);
        triangles.emplace_back(b, a + segments, b + segments);
      }
    }
  }
};
