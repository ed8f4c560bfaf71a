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

#include "log/number_text.h"
#include "mesh/limits.h"
#include "mesh/scan.h"

namespace bocst {
namespace {

constexpr std::size_t kMaxTriangles = std::size_t{1} << 28;
constexpr std::size_t kMaxVertices = std::numeric_limits<std::uint32_t>::max();

[[noreturn]] void bad(const std::string& what) { throw std::invalid_argument("bocst::Mesh: " + what); }

[[noreturn]] void badIndex(std::size_t triangle, std::size_t index, std::size_t vertices) {
  bad("triangle " + std::to_string(triangle) + " has vertex index " + std::to_string(index) + ", but there are " +
      std::to_string(vertices) + " vertices");
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

[[noreturn]] void badVertex(const std::vector<Eigen::Vector3d>& vertices) {
  const auto good = [](const Eigen::Vector3d& v) {
    // One comparison a coordinate finds NaN, infinities and what is too large.
    return std::abs(v[0]) <= kMostCoordinate && std::abs(v[1]) <= kMostCoordinate && std::abs(v[2]) <= kMostCoordinate;
  };
  const auto v = std::find_if_not(vertices.begin(), vertices.end(), good);
  bad("vertex " + std::to_string(v - vertices.begin()) + " is " + pointText(*v) +
      "; coordinates must be finite and at most 1e75 in magnitude");
}

/// The box of points, and for each of its faces, lower ones first, one that lies there.
struct Extremes {
  Eigen::AlignedBox3d box;
  std::array<std::uint32_t, 6> at{};
};

Extremes extremesOf(const std::vector<Eigen::Vector3d>& vertices) {
  constexpr std::size_t kBlock = 512;  // few enough to look through again
  Eigen::Vector3d lo = Eigen::Vector3d::Constant(std::numeric_limits<double>::max()), hi = -lo;
  std::array<std::size_t, 6> block{};
  for (std::size_t begin = 0; begin < vertices.size(); begin += kBlock) {
    const Eigen::Vector3d lo_before = lo, hi_before = hi;
    const std::size_t count = std::min(kBlock, vertices.size() - begin);
    if (!widenByPoints(vertices[begin].data(), count, kMostCoordinate, lo.data(), hi.data())) badVertex(vertices);
    for (int k = 0; k < 3; ++k) {
      if (lo[k] < lo_before[k]) block[k] = begin;
      if (hi[k] > hi_before[k]) block[3 + k] = begin;
    }
  }
  Extremes e{{lo, hi}, {}};
  if (vertices.empty()) return e;
  for (int face = 0; face < 6; ++face) {
    const int k = face % 3;
    const double extreme = face < 3 ? lo[k] : hi[k];
    std::size_t i = block[face];
    while (vertices[i][k] != extreme) ++i;
    e.at[face] = static_cast<std::uint32_t>(i);
  }
  return e;
}

struct IndexScan {
  std::uint32_t largest = 0;
  bool uses_all = false;  ///< All of the wanted are among the indices.
};

IndexScan scanIndices(const std::vector<Mesh::Indices>& triangles, std::array<std::uint32_t, 6> wanted) {
  constexpr std::size_t kChunk = 1024;  // triangles that stay in the nearest cache while they are looked through
  IndexScan scan;
  std::size_t left = wanted.size();
  for (std::size_t begin = 0; begin < triangles.size(); begin += kChunk) {
    const std::uint32_t* const indices = triangles[begin].data();
    const std::size_t count = 3 * std::min(kChunk, triangles.size() - begin);
    scan.largest = std::max(scan.largest, largest(indices, count));
    for (std::size_t w = left; w-- > 0;) {
      if (contains(indices, count, wanted[w])) wanted[w] = wanted[--left];
    }
  }
  scan.uses_all = left == 0;
  return scan;
}

Eigen::AlignedBox3d boundsOfUsed(const std::vector<Eigen::Vector3d>& vertices,
                                 const std::vector<Mesh::Indices>& triangles) {
  Eigen::AlignedBox3d box;
  for (const Mesh::Indices& t : triangles) {
    for (const std::uint32_t i : t) box.extend(vertices[i]);
  }
  return box;
}

}  // namespace

Mesh::Mesh(std::vector<Eigen::Vector3d> vertices, std::shared_ptr<const std::vector<Indices>> triangles)
    : vertices_(std::move(vertices)), triangles_(std::move(triangles)) {}

Mesh::Mesh(std::vector<Eigen::Vector3d> vertices, const std::vector<fcl::Triangle>& triangles)
    : Mesh(std::move(vertices),
           std::make_shared<const std::vector<Indices>>(NarrowIterator(triangles.data()),
                                                        NarrowIterator(triangles.data() + triangles.size()))) {
  validate(&triangles);
}

std::shared_ptr<const Mesh> Mesh::fromIndices(std::vector<Eigen::Vector3d> vertices, std::vector<Indices> triangles) {
  std::shared_ptr<Mesh> mesh(
      new Mesh(std::move(vertices), std::make_shared<const std::vector<Indices>>(std::move(triangles))));
  mesh->validate(nullptr);
  return mesh;
}

namespace {

template <typename S>
std::shared_ptr<const Mesh> fromArraysOf(const S* vertices, std::size_t vertex_count, const std::uint32_t* triangles,
                                         std::size_t triangle_count) {
  if (vertices == nullptr && vertex_count > 0) bad("the array of vertices is null");
  if (triangles == nullptr && triangle_count > 0) bad("the array of triangles is null");
  std::vector<Eigen::Vector3d> points(vertex_count);
  for (std::size_t i = 0; i < vertex_count; ++i) {
    for (int k = 0; k < 3; ++k) points[i][k] = static_cast<double>(vertices[3 * i + static_cast<std::size_t>(k)]);
  }
  std::vector<Mesh::Indices> indices(triangle_count);
  for (std::size_t t = 0; t < triangle_count; ++t) {
    indices[t] = {triangles[3 * t], triangles[3 * t + 1], triangles[3 * t + 2]};
  }
  return Mesh::fromIndices(std::move(points), std::move(indices));
}

}  // namespace

std::shared_ptr<const Mesh> Mesh::fromArrays(const double* vertices, std::size_t vertex_count,
                                             const std::uint32_t* triangles, std::size_t triangle_count) {
  return fromArraysOf(vertices, vertex_count, triangles, triangle_count);
}

std::shared_ptr<const Mesh> Mesh::fromArrays(const float* vertices, std::size_t vertex_count,
                                             const std::uint32_t* triangles, std::size_t triangle_count) {
  return fromArraysOf(vertices, vertex_count, triangles, triangle_count);
}

std::shared_ptr<const Mesh> Mesh::scaledAndPadded(double scale, double padding) const {
  if (!(scale > 0) || !std::isfinite(scale)) bad("the scale is " + numberText(scale) + ", not above 0");
  if (!std::isfinite(padding)) bad("the padding is " + numberText(padding));
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& v : vertices_) mean += v / static_cast<double>(vertices_.size());
  std::vector<Eigen::Vector3d> moved(vertices_);
  for (Eigen::Vector3d& v : moved) {
    const Eigen::Vector3d away = v - mean;
    const double length = away.norm();
    if (length > 0) v = mean + (scale + padding / length) * away;
  }
  return withVertices(std::move(moved));
}

std::shared_ptr<const Mesh> Mesh::withVertices(std::vector<Eigen::Vector3d> vertices) const {
  if (vertices.size() != vertexCount()) {
    bad(std::to_string(vertices.size()) + " vertices, but the triangles are of a mesh with " +
        std::to_string(vertexCount()));
  }
  std::shared_ptr<Mesh> mesh(new Mesh(std::move(vertices), triangles_));
  mesh->validate(nullptr);
  return mesh;
}

void Mesh::validate(const std::vector<fcl::Triangle>* given) {
  const std::size_t count = vertices_.size();
  if (triangles_->empty()) bad("no triangles");
  if (triangles_->size() > kMaxTriangles) bad("more than 2^28 triangles");
  if (count > kMaxVertices) bad("more than 2^32 - 1 vertices");
  const Extremes all = extremesOf(vertices_);
  const IndexScan scan = scanIndices(*triangles_, all.at);
  if (scan.largest >= count) {
    for (std::size_t t = 0; t < triangles_->size(); ++t) {
      for (std::size_t k = 0; k < 3; ++k) {
        // What 32 bits cannot say was made the largest of them, which is never an index.
        if (indices(t)[k] >= count) badIndex(t, given ? (*given)[t][k] : indices(t)[k], count);
      }
    }
  }
  // A vertex that no triangle uses is kept, but is no part of the surface. Most meshes use those of the extremes.
  bounds_ = scan.uses_all ? all.box : boundsOfUsed(vertices_, *triangles_);
}

std::size_t Mesh::bytes() const {
  return vertices_.capacity() * sizeof(Eigen::Vector3d) + triangles_->capacity() * sizeof(Indices);
}

}  // namespace bocst
