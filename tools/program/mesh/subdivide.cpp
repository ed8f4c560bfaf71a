// SPDX-License-Identifier: BSD-3-Clause
#include "mesh/subdivide.h"

#include <algorithm>
#include <cstdint>
#include <tuple>
#include <utility>
#include <vector>

namespace bocst::program {
namespace {

/// The k-th edge of triangle t goes from its k-th corner to the next: `at` is 3 t + k.
struct DividedEdge {
  std::uint32_t low, high;  ///< Its vertices.
  std::uint32_t at;
};

std::vector<DividedEdge> edgesOf(const Mesh& mesh) {
  std::vector<DividedEdge> edges;
  edges.reserve(3 * mesh.triangleCount());
  for (const Mesh::Indices& t : mesh.triangles()) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [low, high] = std::minmax(t[k], t[(k + 1) % 3]);
      edges.push_back({low, high, static_cast<std::uint32_t>(edges.size())});
    }
  }
  return edges;
}

/// For each edge, the first one between the same vertices.
std::vector<std::uint32_t> firstOfEach(std::vector<DividedEdge> edges) {
  // A map of the edges is many times slower on meshes of millions.
  std::sort(edges.begin(), edges.end(), [](const DividedEdge& a, const DividedEdge& b) {
    return std::tie(a.low, a.high, a.at) < std::tie(b.low, b.high, b.at);
  });
  std::vector<std::uint32_t> first(edges.size());
  for (std::size_t i = 0; i < edges.size(); ++i) {
    const DividedEdge& e = edges[i];
    const bool same = i > 0 && edges[i - 1].low == e.low && edges[i - 1].high == e.high;
    first[e.at] = same ? first[edges[i - 1].at] : e.at;
  }
  return first;
}

}  // namespace

std::shared_ptr<const Mesh> subdivided(const Mesh& mesh) {
  std::vector<DividedEdge> edges = edgesOf(mesh);
  std::vector<Eigen::Vector3d> vertices = mesh.vertices();
  std::vector<std::uint32_t> middles = firstOfEach(edges);
  for (const DividedEdge& e : edges) {
    std::uint32_t& middle = middles[e.at];
    if (middle == e.at) {
      middle = static_cast<std::uint32_t>(vertices.size());
      vertices.push_back((mesh.vertex(e.low) + mesh.vertex(e.high)) / 2);
    } else {
      middle = middles[middle];  // an earlier edge's, which has its vertex by now
    }
  }
  std::vector<Mesh::Indices> triangles;
  triangles.reserve(4 * mesh.triangleCount());
  for (std::size_t i = 0; i < mesh.triangleCount(); ++i) {
    const Mesh::Indices& t = mesh.indices(i);
    const std::uint32_t ab = middles[3 * i], bc = middles[3 * i + 1], ca = middles[3 * i + 2];
    for (const Mesh::Indices& part : {Mesh::Indices{t[0], ab, ca}, {ab, t[1], bc}, {ca, bc, t[2]}, {ab, bc, ca}}) {
      triangles.push_back(part);
    }
  }
  return Mesh::fromIndices(std::move(vertices), std::move(triangles));
}

std::shared_ptr<const Mesh> subdivided(std::shared_ptr<const Mesh> mesh, std::size_t times) {
  for (std::size_t i = 0; i < times; ++i) mesh = subdivided(*mesh);
  return mesh;
}

}  // namespace bocst::program
