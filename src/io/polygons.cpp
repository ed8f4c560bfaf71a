// SPDX-License-Identifier: BSD-3-Clause
#include "io/polygons.h"

#include <cmath>

#include "io/cut_polygon.h"

namespace bocst::io {
namespace {

/// The polygon's corners in the coordinate plane where its area is largest, counter-clockwise, scaled by a power of two
/// to sizes of about 1; empty if it has no area or a corner is not finite.
std::vector<Eigen::Vector2d> flatten(const Polygons& polygons, const std::uint32_t* corner, std::size_t n) {
  double largest = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector3d& p = polygons.vertices[corner[i]];
    if (!p.allFinite()) return {};  // the mesh will refuse it
    largest = std::max(largest, p.cwiseAbs().maxCoeff());
  }
  int exponent = 0;
  std::frexp(largest, &exponent);
  const auto scaled = [&](std::size_t i) {
    return Eigen::Vector3d(
        polygons.vertices[corner[i]].unaryExpr([exponent](double x) { return std::ldexp(x, -exponent); }));
  };
  const Eigen::Vector3d origin = scaled(0);
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  for (std::size_t i = 1; i + 1 < n; ++i) normal += (scaled(i) - origin).cross(scaled(i + 1) - origin);
  Eigen::Index drop = 0;
  normal.cwiseAbs().maxCoeff(&drop);
  std::vector<Eigen::Vector2d> flat;
  if (!(std::abs(normal[drop]) > 0)) return flat;
  const Eigen::Index x = normal[drop] > 0 ? (drop + 1) % 3 : (drop + 2) % 3;
  const Eigen::Index y = normal[drop] > 0 ? (drop + 2) % 3 : (drop + 1) % 3;
  flat.reserve(n);
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector3d p = scaled(i);
    flat.emplace_back(p[x], p[y]);
  }
  return flat;
}

}  // namespace

void Polygons::addStrip(const std::uint32_t* corner, std::size_t n) {
  for (std::size_t i = 0; i + 2 < n; ++i) {
    const std::uint32_t a = corner[i + i % 2];  // every other triangle turns the other way
    const std::uint32_t b = corner[i + 1 - i % 2];
    const std::uint32_t c = corner[i + 2];
    if (a != b && b != c && c != a) addTriangle(a, b, c);
  }
}

std::vector<Mesh::Indices> triangulate(const Polygons& polygons) {
  std::vector<Mesh::Indices> triangles;
  triangles.reserve(polygons.ends.size());
  std::size_t begin = 0;
  for (const std::size_t end : polygons.ends) {
    const std::uint32_t* corner = polygons.corners.data() + begin;
    const std::size_t n = end - begin;
    begin = end;
    if (n == 3) triangles.push_back({corner[0], corner[1], corner[2]});
    if (n <= 3) continue;
    for (const CornerTriple& t : cutPolygon(flatten(polygons, corner, n), n)) {
      triangles.push_back({corner[t[0]], corner[t[1]], corner[t[2]]});
    }
  }
  return triangles;
}

}  // namespace bocst::io
