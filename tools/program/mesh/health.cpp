// SPDX-License-Identifier: BSD-3-Clause
#include "mesh/health.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cstdint>
#include <numeric>
#include <tuple>
#include <utility>
#include <vector>

namespace bocst::program {
namespace {

using Id = std::uint32_t;

/// For each vertex the first one with the same coordinates.
std::vector<Id> firstOfEqual(const std::vector<Eigen::Vector3d>& vertices) {
  const auto key = [&](Id i) { return std::make_tuple(vertices[i].x(), vertices[i].y(), vertices[i].z()); };
  std::vector<Id> order(vertices.size());
  std::iota(order.begin(), order.end(), Id{0});
  std::sort(order.begin(), order.end(),
            [&](Id a, Id b) { return std::make_pair(key(a), a) < std::make_pair(key(b), b); });
  std::vector<Id> first(vertices.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    first[order[i]] = i > 0 && key(order[i]) == key(order[i - 1]) ? first[order[i - 1]] : order[i];
  }
  return first;
}

/// An edge of a triangle; backwards when the triangle runs from the larger id to the smaller.
struct Edge {
  Id a, b;
  Id triangle;
  bool backwards;
};

template <typename T>
void note(std::size_t& count, std::vector<T>& list, T fault) {
  ++count;
  if (list.size() < Faults::kMost) list.push_back(std::move(fault));
}

void countEdges(std::vector<Edge>& edges, Health& health) {
  std::sort(edges.begin(), edges.end(), [](const Edge& x, const Edge& y) {
    return std::tie(x.a, x.b, x.triangle) < std::tie(y.a, y.b, y.triangle);
  });
  for (std::size_t i = 0; i < edges.size();) {
    std::size_t end = i + 1;
    while (end < edges.size() && edges[end].a == edges[i].a && edges[end].b == edges[i].b) ++end;
    const bool open = end - i == 1, crowded = end - i > 2;
    if (open || crowded || edges[i].backwards == edges[i + 1].backwards) {
      FaultyEdge fault{{edges[i].a, edges[i].b}, {}};
      for (std::size_t k = i; k < end; ++k) fault.triangles.push_back(edges[k].triangle);
      Faults& faults = health.faults;
      if (open) {
        note(health.open_edges, faults.open_edges, std::move(fault));
      } else if (crowded) {
        note(health.non_manifold_edges, faults.non_manifold_edges, std::move(fault));
      } else {
        note(health.flipped_edges, faults.flipped_edges, std::move(fault));
      }
    }
    i = end;
  }
}

void countDuplicates(std::vector<std::array<Id, 3>> triangles, Health& health) {
  for (std::array<Id, 3>& t : triangles) std::sort(t.begin(), t.end());
  std::vector<Id> order(triangles.size());
  std::iota(order.begin(), order.end(), Id{0});
  std::sort(order.begin(), order.end(),
            [&](Id a, Id b) { return std::tie(triangles[a], a) < std::tie(triangles[b], b); });
  for (std::size_t i = 1; i < order.size(); ++i) {
    if (triangles[order[i]] != triangles[order[i - 1]]) continue;
    note(health.duplicate_triangles, health.faults.duplicate_triangles, order[i]);
  }
  std::sort(health.faults.duplicate_triangles.begin(), health.faults.duplicate_triangles.end());
}

std::size_t countComponents(const std::vector<std::array<Id, 3>>& triangles, std::size_t vertices) {
  std::vector<Id> parent(vertices);
  std::iota(parent.begin(), parent.end(), Id{0});
  const auto root = [&parent](Id i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  for (const auto& t : triangles) {
    parent[root(t[1])] = root(t[0]);
    parent[root(t[2])] = root(t[0]);
  }
  std::vector<bool> seen(vertices);
  std::size_t count = 0;
  for (const auto& t : triangles) {
    const Id r = root(t[0]);
    count += !seen[r];
    seen[r] = true;
  }
  return count;
}

}  // namespace

Health healthOf(const Mesh& mesh) {
  Health health;
  const std::vector<Id> first = firstOfEqual(mesh.vertices());
  for (Id i = 0; i < first.size(); ++i) {
    if (first[i] != i) note(health.repeated_vertices, health.faults.repeated_vertices, i);
  }

  std::vector<bool> used(mesh.vertexCount());
  std::vector<std::array<Id, 3>> triangles;
  std::vector<Edge> edges;
  triangles.reserve(mesh.triangleCount());
  edges.reserve(3 * mesh.triangleCount());
  double volume6 = 0;
  const Eigen::Vector3d middle = mesh.bounds().center();
  for (const Mesh::Indices& t : mesh.triangles()) {
    for (const Id i : t) used[i] = true;
    const std::array<Id, 3> c = {first[t[0]], first[t[1]], first[t[2]]};
    triangles.push_back(c);
    const Eigen::Vector3d p = mesh.vertex(c[0]) - middle, q = mesh.vertex(c[1]) - middle,
                          r = mesh.vertex(c[2]) - middle;
    const double area2 = (q - p).cross(r - p).norm();
    health.area += area2 / 2;
    volume6 += p.dot(q.cross(r));
    // The limit that exact answers have, too (share/doc/guarantees.md).
    const Id triangle = static_cast<Id>(triangles.size() - 1);
    if (!(area2 > 1e-14 * (q - p).norm() * (r - p).norm())) {
      note(health.degenerate_triangles, health.faults.degenerate_triangles, triangle);
    }
    if (c[0] == c[1] || c[1] == c[2] || c[2] == c[0]) continue;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [a, b] = std::minmax(c[k], c[(k + 1) % 3]);
      edges.push_back({a, b, triangle, c[k] > c[(k + 1) % 3]});
    }
  }
  for (Id i = 0; i < used.size(); ++i) {
    if (!used[i]) note(health.unused_vertices, health.faults.unused_vertices, i);
  }
  health.components = countComponents(triangles, mesh.vertexCount());
  countDuplicates(std::move(triangles), health);
  countEdges(edges, health);
  if (health.watertight() && health.oriented()) health.volume = volume6 / 6;
  return health;
}

std::vector<std::pair<std::size_t, std::size_t>> faultLines(const Faults& faults, const Mesh& mesh) {
  std::vector<std::pair<std::size_t, std::size_t>> lines;
  for (const auto* edges : {&faults.open_edges, &faults.non_manifold_edges, &faults.flipped_edges}) {
    for (const FaultyEdge& edge : *edges) lines.emplace_back(edge.vertices[0], edge.vertices[1]);
  }
  for (const auto* triangles : {&faults.degenerate_triangles, &faults.duplicate_triangles}) {
    for (const std::uint32_t t : *triangles) {
      const Mesh::Indices& corners = mesh.triangles()[t];
      for (std::size_t k = 0; k < 3; ++k) lines.emplace_back(corners[k], corners[(k + 1) % 3]);
    }
  }
  return lines;
}

}  // namespace bocst::program
