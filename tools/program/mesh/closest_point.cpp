// SPDX-License-Identifier: BSD-3-Clause
#include "mesh/closest_point.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>

namespace bocst::program {

using Eigen::Vector3d;

namespace {

Vector3d closestOnSegment(const Vector3d& p, const Vector3d& a, const Vector3d& b) {
  const Vector3d ab = b - a;
  const double length2 = ab.squaredNorm();
  if (!(length2 > 0)) return a;
  return a + std::clamp((p - a).dot(ab) / length2, 0.0, 1.0) * ab;
}

}  // namespace

std::vector<BoundedTriangle> boundedTriangles(const Mesh& mesh) {
  std::vector<BoundedTriangle> triangles;
  triangles.reserve(mesh.triangleCount());
  for (const Mesh::Indices& indices : mesh.triangles()) {
    BoundedTriangle t;
    Eigen::AlignedBox3d box;
    for (std::size_t i = 0; i < 3; ++i) {
      t.corner[i] = mesh.vertex(indices[i]);
      box.extend(t.corner[i]);
    }
    t.center = box.center();
    for (const Vector3d& p : t.corner) t.radius = std::max(t.radius, (p - t.center).norm());
    triangles.push_back(t);
  }
  return triangles;
}

bool isInside(const BoundedTriangle& t, const Vector3d& normal, const Vector3d& p) {
  for (int i = 0; i < 3; ++i) {
    const Vector3d& a = t.corner[i];
    if ((t.corner[(i + 1) % 3] - a).cross(p - a).dot(normal) < 0) return false;
  }
  return true;
}

Vector3d closestOnTriangle(const Vector3d& p, const BoundedTriangle& t) {
  const Vector3d normal = (t.corner[1] - t.corner[0]).cross(t.corner[2] - t.corner[0]);
  const double square = normal.squaredNorm();
  if (square > 0) {
    const Vector3d q = p - (p - t.corner[0]).dot(normal) / square * normal;
    if (isInside(t, normal, q)) return q;
  }
  Vector3d best = closestOnSegment(p, t.corner[0], t.corner[1]);
  for (int i = 1; i < 3; ++i) {
    const Vector3d q = closestOnSegment(p, t.corner[i], t.corner[(i + 1) % 3]);
    if ((q - p).squaredNorm() < (best - p).squaredNorm()) best = q;
  }
  return best;
}

const std::array<Vector3d, 64>& directions() {
  static const std::array<Vector3d, 64> all = [] {
    std::array<Vector3d, 64> d;
    const double golden_angle = M_PI * (3 - std::sqrt(5.0));
    for (std::size_t i = 0; i < d.size(); ++i) {
      const double z = 1 - (2 * static_cast<double>(i) + 1) / static_cast<double>(d.size());
      const double r = std::sqrt(1 - z * z);
      const double angle = golden_angle * static_cast<double>(i);
      d[i] = Vector3d(r * std::cos(angle), r * std::sin(angle), z);
    }
    return d;
  }();
  return all;
}

}  // namespace bocst::program
