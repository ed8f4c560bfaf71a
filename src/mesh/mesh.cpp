// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/mesh.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iterator>
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

// FCL's accessor is a call into its library; its triangle is three indices and nothing else.
static_assert(sizeof(fcl::Triangle) == 3 * sizeof(std::size_t) && std::is_trivially_copyable<fcl::Triangle>::value);

/// Reads FCL's triangles as 32-bit indices, so that a vector is written once.
class NarrowIterator {
 public:
  using iterator_category = std::forward_iterator_tag;
  using value_type = Mesh::Indices;
  using difference_type = std::ptrdiff_t;
  using pointer = const value_type*;
  using reference = value_type;

  explicit NarrowIterator(const fcl::Triangle* at) : at_(at) {}
  value_type operator*() const {
    std::size_t wide[3];
    std::memcpy(wide, at_, sizeof(wide));
    value_type narrow;
    for (std::size_t k = 0; k < 3; ++k) narrow[k] = static_cast<std::uint32_t>(std::min(wide[k], kMaxVertices));
    return narrow;
  }
  NarrowIterator& operator++() {
    ++at_;
    return *this;
  }
  bool operator==(NarrowIterator other) const { return at_ == other.at_; }
  bool operator!=(NarrowIterator other) const { return at_ != other.at_; }

 private:
  const fcl::Triangle* at_;
};

}  // namespace

Mesh::Mesh(std::vector<Eigen::Vector3d> vertices, const std::vector<fcl::Triangle>& triangles)
    : vertices_(std::move(vertices)),
      triangles_(NarrowIterator(triangles.data()), NarrowIterator(triangles.data() + triangles.size())) {
  validate(&triangles);
}

std::shared_ptr<const Mesh> Mesh::fromIndices(std::vector<Eigen::Vector3d> vertices, std::vector<Indices> triangles) {
  std::shared_ptr<Mesh> mesh(new Mesh);
  mesh->vertices_ = std::move(vertices);
  mesh->triangles_ = std::move(triangles);
  mesh->validate(nullptr);
  return mesh;
}

void Mesh::validate(const std::vector<fcl::Triangle>* given) {
  const std::size_t count = vertices_.size();
  if (triangles_.empty()) bad("no triangles");
  if (triangles_.size() > kMaxTriangles) bad("more than 2^28 triangles");
  if (count > kMaxVertices) bad("more than 2^32 - 1 vertices");
  // A vertex that no triangle uses is kept, but is no part of the surface. One place more for indices out of range: to
  // look once at the end is faster than to branch each time.
  std::vector<std::uint8_t> used(count + 1, 0);
  std::uint8_t* const mark = used.data();
  const Indices* const end = triangles_.data() + triangles_.size();
  for (const Indices* t = triangles_.data(); t != end; ++t) {
    for (std::size_t k = 0; k < 3; ++k) mark[std::min<std::size_t>((*t)[k], count)] = 1;
  }
  if (used[count]) {
    for (std::size_t t = 0; t < triangles_.size(); ++t) {
      for (std::size_t k = 0; k < 3; ++k) {
        // What 32 bits cannot say was made the largest of them, which is never an index.
        if (triangles_[t][k] >= count) badIndex(t, given ? (*given)[t][k] : triangles_[t][k], count);
      }
    }
  }
  Eigen::Vector3d lo = Eigen::Vector3d::Constant(std::numeric_limits<double>::max()), hi = -lo;
  const Eigen::Vector3d* const vertices = vertices_.data();
  for (std::size_t i = 0; i < count; ++i) {
    const double* v = vertices[i].data();
    // One comparison a coordinate finds NaN, infinities and what is too large.
    if (!(std::abs(v[0]) <= kMaxCoordinate) | !(std::abs(v[1]) <= kMaxCoordinate) |
        !(std::abs(v[2]) <= kMaxCoordinate)) {
      bad("vertex " + std::to_string(i) + " is " + coordinates(vertices_[i]));
    }
    if (!mark[i]) continue;
    lo = lo.cwiseMin(vertices[i]);
    hi = hi.cwiseMax(vertices[i]);
  }
  bounds_ = Eigen::AlignedBox3d(lo, hi);
}

std::size_t Mesh::bytes() const {
  return vertices_.capacity() * sizeof(Eigen::Vector3d) + triangles_.capacity() * sizeof(Indices);
}

}  // namespace bocst
