// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>

#include <Eigen/Core>
#include <array>
#include <vector>

namespace bocst::program {

/// A triangle and a sphere about it.
struct BoundedTriangle {
  std::array<Eigen::Vector3d, 3> corner;
  Eigen::Vector3d center;
  double radius = 0;
};

std::vector<BoundedTriangle> boundedTriangles(const Mesh& mesh);

/// True if the point of the triangle's plane is inside it. `normal` need not be a unit vector.
bool isInside(const BoundedTriangle& t, const Eigen::Vector3d& normal, const Eigen::Vector3d& p);

Eigen::Vector3d closestOnTriangle(const Eigen::Vector3d& p, const BoundedTriangle& t);

/// 64 directions spread over the sphere (a Fibonacci lattice).
const std::array<Eigen::Vector3d, 64>& directions();

}  // namespace bocst::program
