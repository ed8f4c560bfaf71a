// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace bocst::io {

/// What a reader brings home: vertices and polygons, before triangulation.
struct Polygons {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<std::uint32_t> corners;  ///< All polygons' vertex indices, one after the other.
  std::vector<std::size_t> ends;       ///< Where each polygon's corners end.
};

namespace detail {

/// Twice the signed area of the triangle.
inline double area2(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

/// The polygon's corners in the coordinate plane it is seen best from, turning left; empty when it has no area.
inline std::vector<Eigen::Vector2d> flatten(const Polygons& polygons, const std::uint32_t* corner, std::size_t n) {
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  const Eigen::Vector3d& origin = polygons.vertices[corner[0]];
  for (std::size_t i = 1; i + 1 < n; ++i) {
    normal += (polygons.vertices[corner[i]] - origin).cross(polygons.vertices[corner[i + 1]] - origin);
  }
  Eigen::Index drop = 0;
  normal.cwiseAbs().maxCoeff(&drop);
  std::vector<Eigen::Vector2d> flat;
  if (!(std::abs(normal[drop]) > 0)) return flat;
  const Eigen::Index x = normal[drop] > 0 ? (drop + 1) % 3 : (drop + 2) % 3;
  const Eigen::Index y = normal[drop] > 0 ? (drop + 2) % 3 : (drop + 1) % 3;
  for (std::size_t i = 0; i < n; ++i) {
    flat.emplace_back(polygons.vertices[corner[i]][x] - origin[x], polygons.vertices[corner[i]][y] - origin[y]);
  }
  return flat;
}

/// May the triangle at ring[i] be cut off? Only if it turns left and no other corner lies in it.
inline bool isEar(const std::vector<Eigen::Vector2d>& flat, const std::vector<std::size_t>& ring, std::size_t i) {
  const std::size_t n = ring.size();
  const Eigen::Vector2d& a = flat[ring[(i + n - 1) % n]];
  const Eigen::Vector2d& b = flat[ring[i]];
  const Eigen::Vector2d& c = flat[ring[(i + 1) % n]];
  if (!(area2(a, b, c) > 0)) return false;
  for (const std::size_t k : ring) {
    const Eigen::Vector2d& p = flat[k];
    if (p == a || p == b || p == c) continue;
    if (area2(a, b, p) >= 0 && area2(b, c, p) >= 0 && area2(c, a, p) >= 0) return false;
  }
  return true;
}

}  // namespace detail

/// Cuts every polygon into triangles by clipping ears, so that concave ones keep their outline; polygons of fewer than
/// three corners are points and lines, which are left out.
inline std::vector<Mesh::Indices> triangulate(const Polygons& polygons) {
  std::vector<Mesh::Indices> triangles;
  triangles.reserve(polygons.ends.size());
  std::size_t begin = 0;
  for (const std::size_t end : polygons.ends) {
    const std::uint32_t* corner = polygons.corners.data() + begin;
    const std::size_t n = end - begin;
    begin = end;
    if (n == 3) triangles.push_back({corner[0], corner[1], corner[2]});
    if (n <= 3) continue;
    const std::vector<Eigen::Vector2d> flat = detail::flatten(polygons, corner, n);
    std::vector<std::size_t> ring(n);
    for (std::size_t i = 0; i < n; ++i) ring[i] = i;
    while (ring.size() > 2) {
      const std::size_t m = ring.size();
      std::size_t ear = 1;  // where nothing is an ear (no area, crossing edges), a fan is as good as anything
      for (std::size_t i = 0; i < m && !flat.empty() && m > 3; ++i) {
        if (detail::isEar(flat, ring, (i + 1) % m)) {
          ear = (i + 1) % m;
          break;
        }
      }
      triangles.push_back({corner[ring[(ear + m - 1) % m]], corner[ring[ear]], corner[ring[(ear + 1) % m]]});
      ring.erase(ring.begin() + static_cast<std::ptrdiff_t>(ear));
    }
  }
  return triangles;
}

}  // namespace bocst::io
