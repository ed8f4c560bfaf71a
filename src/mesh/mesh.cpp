// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/mesh.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>
#include <type_traits>

namespace bocst {
namespace {

constexpr std::size_t kMaxTriangles = std::size_t{1} << 28;
constexpr std::size_t kMaxVertices = std::numeric_limits<std::uint32_t>::max();
// Squares and cubes of coordinates appear in the exact test: they must stay finite.
constexpr double kMaxCoordinate = 1e75;

[[noreturn]] void bad(const std::string& what) { throw std::invalid_argument("bocst::Mesh: " + what); }

[[noreturn]] void badIndex(std::size_t triangle, std::size_t index, std::size_t vertices) {
  bad("triangle " + std::to_string(triangle) + " has vertex index " + std::to_string(index) + ", but there are " +
      std::to_string(vertices) + " vertices");
}

std::string coordinates(const Eigen::Vector3d& v) {
  return "(" + std::to_string(v.x()) + ", " + std::to_string(v.y()) + ", " + std::to_string(v.z()) + ")";
}

}  // namespace

Mesh::Mesh(std::vector<Eigen::Vector3d> vertices, const std::vector<fcl::Triangle>& triangles)
    : vertices_(std::move(vertices)), triangles_(triangles.size()) {
  // FCL's accessor is a call into its library; its triangle is three indices and nothing else.
  static_assert(sizeof(fcl::Triangle) == 3 * sizeof(std::size_t) && std::is_trivially_copyable<fcl::Triangle>::value);
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    std::size_t corners[3];
    std::memcpy(corners, &triangles[t], sizeof(corners));
    if ((corners[0] | corners[1] | corners[2]) > kMaxVertices) {
      const std::size_t i = *std::max_element(corners, corners + 3);
      badIndex(t, i, vertices_.size());
    }
    for (std::size_t k = 0; k < 3; ++k) triangles_[t][k] = static_cast<std::uint32_t>(corners[k]);
  }
  validate();
}

std::shared_ptr<const Mesh> Mesh::fromIndices(std::vector<Eigen::Vector3d> vertices, std::vector<Indices> triangles) {
  std::shared_ptr<Mesh> mesh(new Mesh);
  mesh->vertices_ = std::move(vertices);
  mesh->triangles_ = std::move(triangles);
  mesh->validate();
  return mesh;
}

void Mesh::validate() {
  const std::size_t count = vertices_.size();
  if (triangles_.empty()) bad("no triangles");
  if (triangles_.size() > kMaxTriangles) bad("more than 2^28 triangles");
  if (count > kMaxVertices) bad("more than 2^32 - 1 vertices");
  // A vertex that no triangle uses is kept, but is no part of the surface.
  std::vector<std::uint8_t> used(count, 0);
  for (std::size_t t = 0; t < triangles_.size(); ++t) {
    for (const std::uint32_t i : triangles_[t]) {
      if (i >= count) badIndex(t, i, count);
      used[i] = 1;
    }
  }
  double lo[3], hi[3];
  std::fill_n(lo, 3, std::numeric_limits<double>::max());
  std::fill_n(hi, 3, -std::numeric_limits<double>::max());
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector3d& v = vertices_[i];
    // One comparison a coordinate finds NaN, infinities and what is too large.
    if (!(std::abs(v[0]) <= kMaxCoordinate && std::abs(v[1]) <= kMaxCoordinate && std::abs(v[2]) <= kMaxCoordinate)) {
      bad("vertex " + std::to_string(i) + " is " + coordinates(v));
    }
    if (!used[i]) continue;
    for (int k = 0; k < 3; ++k) {
      lo[k] = std::min(lo[k], v[k]);
      hi[k] = std::max(hi[k], v[k]);
    }
  }
  bounds_ = Eigen::AlignedBox3d(Eigen::Vector3d(lo), Eigen::Vector3d(hi));
}

std::size_t Mesh::bytes() const {
  return vertices_.capacity() * sizeof(Eigen::Vector3d) + triangles_.capacity() * sizeof(Indices);
}

}  // namespace bocst
