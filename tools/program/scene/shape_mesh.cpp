// SPDX-License-Identifier: BSD-3-Clause
#include "scene/shape_mesh.h"

#include <cmath>
#include <cstdint>
#include <vector>

namespace bocst::program {
namespace {

struct Surface {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<Mesh::Indices> triangles;
};

Surface boxOf(const Eigen::Vector3d& size) {
  Surface box;
  for (unsigned i = 0; i < 8; ++i) {
    const Eigen::Vector3d corner(i & 1u ? 0.5 : -0.5, i & 2u ? 0.5 : -0.5, i & 4u ? 0.5 : -0.5);
    box.vertices.push_back(corner.cwiseProduct(size));
  }
  box.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                   {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return box;
}

/// A profile turned about z; from bottom to top, (distance from the axis, z), both ends on the axis.
Surface turned(const std::vector<Eigen::Vector2d>& profile) {
  constexpr std::uint32_t kSides = 32;
  Surface surface;
  for (const Eigen::Vector2d& p : profile) {
    for (std::uint32_t i = 0; i < kSides; ++i) {
      const double angle = 2 * M_PI * i / kSides;
      surface.vertices.emplace_back(p.x() * std::cos(angle), p.x() * std::sin(angle), p.y());
    }
  }
  for (std::uint32_t ring = 0; ring + 1 < profile.size(); ++ring) {
    for (std::uint32_t i = 0; i < kSides; ++i) {
      const std::uint32_t a = ring * kSides + i, b = ring * kSides + (i + 1) % kSides;
      // At the axis a ring is a point.
      if (profile[ring].x() > 0) surface.triangles.push_back({a, b, b + kSides});
      if (profile[ring + 1].x() > 0) surface.triangles.push_back({a, b + kSides, a + kSides});
    }
  }
  return surface;
}

/// Two half balls with a straight part of this length between them.
Surface capsuleOf(double radius, double length) {
  constexpr int kRings = 8;
  std::vector<Eigen::Vector2d> profile;  // without a straight part the two equators are one ring
  for (const double side : {-1.0, 1.0}) {
    for (int i = side > 0 && length == 0 ? 1 : 0; i <= kRings; ++i) {
      const bool pole = i == (side < 0 ? 0 : kRings);
      const double angle = M_PI / 2 * (side < 0 ? i - kRings : i) / kRings;
      profile.emplace_back(pole ? 0 : radius * std::cos(angle), side * length / 2 + radius * std::sin(angle));
    }
  }
  return turned(profile);
}

Surface surfaceOf(const Shape& shape) {
  const double radius = shape.size[0], half = shape.size[1] / 2;
  switch (shape.kind) {
    case Shape::Kind::kMesh:
      return {shape.mesh->vertices(), shape.mesh->triangles()};
    case Shape::Kind::kSphere:
      return capsuleOf(radius, 0);
    case Shape::Kind::kCylinder:
      return turned({{0, -half}, {radius, -half}, {radius, half}, {0, half}});
    case Shape::Kind::kCapsule:
      return capsuleOf(radius, shape.size[1]);
    default:
      return boxOf(shape.size);
  }
}

}  // namespace

std::shared_ptr<const Mesh> meshOf(const Part& part) {
  Surface all;
  for (const PlacedShape& placed : part.shapes) {
    const Surface surface = surfaceOf(placed.shape);
    const auto first = static_cast<std::uint32_t>(all.vertices.size());
    for (const Eigen::Vector3d& v : surface.vertices) all.vertices.push_back(placed.X_PS * v);
    for (const Mesh::Indices& t : surface.triangles)
      all.triangles.push_back({first + t[0], first + t[1], first + t[2]});
  }
  return Mesh::fromIndices(std::move(all.vertices), std::move(all.triangles));
}

}  // namespace bocst::program
