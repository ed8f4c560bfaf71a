// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cstdint>
#include <random>
#include <vector>

#include "geometry/triangle.h"
#include "query/sides/side.h"

namespace bocst::test {

struct HandTriangle {
  query::Corners corners = {};
};

/// A small tree made by hand, as a side of a walk: a binary tree of boxes over rows of triangles. Nodes may be asleep:
/// these have to be grown before their children are there, which is counted.
class HandTree : public query::CompleteSide {
 public:
  using Node = int;
  static constexpr bool kBodies = false;
  static constexpr bool kNodesContainSurface = true;

  /// The triangles in their order, `leaf_size` in a leaf.
  explicit HandTree(std::vector<HandTriangle> triangles, std::size_t leaf_size = 1) : triangles_(std::move(triangles)) {
    add(0, triangles_.size(), leaf_size);
  }

  /// Lets all inner nodes sleep that are at least so many levels below the root.
  void sleepFrom(int level) {
    for (Entry& e : nodes_) e.asleep = !e.children.empty() && e.level >= level;
  }
  /// The nodes that were grown, in their order; those of one batch follow each other.
  const std::vector<Node>& grown() const { return grown_; }
  std::size_t size() const { return nodes_.size(); }
  std::size_t triangles() const { return triangles_.size(); }
  const Eigen::AlignedBox3d& box(Node n) const { return at(n).box; }
  const query::Corners& corners(std::uint32_t t) const { return triangles_[t].corners; }

  Node root() const { return 0; }
  query::State state(Node n) const {
    if (at(n).children.empty()) return query::State::kLeaf;
    return at(n).asleep ? query::State::kGrows : query::State::kInner;
  }
  void grow(Node n, std::vector<tree::Tree::Growth>&) const {
    if (!at(n).asleep) return;  // two pairs may ask for the same node
    at(n).asleep = false;
    grown_.push_back(n);
  }
  double size(Node n) const { return at(n).box.diagonal().squaredNorm() / 4; }
  query::Volume volume(Node n) const {
    query::Volume v{};
    for (int k = 0; k < 3; ++k) {
      v.center[k] = at(n).box.center()[k];
      v.half[k] = static_cast<float>(at(n).box.diagonal()[k] / 2);  // what asks allows for the rounding
    }
    return v;
  }
  query::Sphere sphere(Node n) const { return {at(n).box.center(), at(n).box.diagonal().norm() / 2}; }

  template <typename F>
  void children(Node n, F&& f) const {
    for (const Node child : at(n).children) f(child);
  }
  template <typename OtherVolume, typename F>
  void overlappingChildren(Node n, OtherVolume& other, const query::SimilarityTransform& to, F&& f) const {
    children(n, [&](Node child) {
      if (!query::boxesApart(query::oriented(volume(child)), query::oriented(other), to)) f(child);
    });
  }

  std::size_t meshTriangles() const { return triangles_.size(); }
  std::size_t triangleCount(Node n) const { return at(n).end - at(n).begin; }
  struct Numbers {
    std::size_t begin;
    std::uint32_t operator[](std::size_t i) const { return static_cast<std::uint32_t>(begin + i); }
  };
  struct Triangles {
    Numbers ids;
    std::size_t count;
  };
  Triangles triangles(Node n) const { return {{at(n).begin}, at(n).end - at(n).begin}; }
  void prefetch(std::uint32_t) const {}
  void prefetchCorners(std::uint32_t) const {}
  const Eigen::Vector3d& vertex(std::uint32_t t, int k) const { return triangles_[t].corners[k]; }
  Eigen::Vector3d origin() const { return Eigen::Vector3d::Zero(); }
  double inverseUnit() const { return 1; }

 private:
  struct Entry {
    Eigen::AlignedBox3d box;
    std::vector<Node> children;
    std::size_t begin = 0, end = 0;
    int level = 0;
    mutable bool asleep = false;
  };

  const Entry& at(Node n) const { return nodes_[static_cast<std::size_t>(n)]; }

  Node add(std::size_t begin, std::size_t end, std::size_t leaf_size, int level = 0) {
    const auto n = static_cast<Node>(nodes_.size());
    Entry e;
    e.begin = begin;
    e.end = end;
    e.level = level;
    for (std::size_t t = begin; t < end; ++t) {
      for (const Eigen::Vector3d& x : triangles_[t].corners) e.box.extend(x);
    }
    nodes_.push_back(e);
    if (end - begin > leaf_size) {
      const std::size_t middle = begin + (end - begin) / 2;
      for (const auto& [from, to] : {std::pair{begin, middle}, std::pair{middle, end}}) {
        const Node child = add(from, to, leaf_size, level + 1);
        nodes_[static_cast<std::size_t>(n)].children.push_back(child);
      }
    }
    return n;
  }

  std::vector<HandTriangle> triangles_;
  std::vector<Entry> nodes_;
  mutable std::vector<Node> grown_;
};

/// A row of triangles along x, one a unit, in the plane z = `height`: triangle i is in x from i to i + 0.8.
inline std::vector<HandTriangle> row(std::size_t count, double height = 0) {
  std::vector<HandTriangle> triangles(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double x = static_cast<double>(i);
    query::Corners& c = triangles[i].corners;
    c[0] = {x, 0, height};
    c[1] = {x + 0.8, 0, height};
    c[2] = {x, 0.8, height};
  }
  return triangles;
}

/// Triangles anywhere in a cube of side `size` about the origin, each about 1 large, sorted along x.
inline std::vector<HandTriangle> cloud(std::mt19937_64& g, std::size_t count, double size) {
  std::uniform_real_distribution<double> u(0, 1);
  std::vector<HandTriangle> triangles(count);
  for (HandTriangle& t : triangles) {
    const Eigen::Vector3d at = size * Eigen::Vector3d(u(g) - 0.5, u(g) - 0.5, u(g) - 0.5);
    for (Eigen::Vector3d& x : t.corners) x = at + Eigen::Vector3d(u(g), u(g), u(g));
  }
  std::sort(triangles.begin(), triangles.end(),
            [](const HandTriangle& a, const HandTriangle& b) { return a.corners[0].x() < b.corners[0].x(); });
  return triangles;
}

/// The distance of two triangles, the second placed.
inline double distanceOf(const query::Corners& a, const query::Corners& b, const query::SimilarityTransform& b_in_a) {
  const query::Corners placed = {b_in_a * b[0], b_in_a * b[1], b_in_a * b[2]};
  Eigen::Vector3d on_a, on_b;
  return query::nearestPoints(a, placed, on_a, on_b);
}

}  // namespace bocst::test
