// SPDX-License-Identifier: BSD-3-Clause
#include "io/cut_polygon.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace bocst::io {
namespace {

using PointSet = std::vector<std::array<std::int64_t, 2>>;

__extension__ typedef __int128 Wide;

Wide area2(const std::array<std::int64_t, 2>& a, const std::array<std::int64_t, 2>& b,
           const std::array<std::int64_t, 2>& c) {
  return static_cast<Wide>(b[0] - a[0]) * (c[1] - a[1]) - static_cast<Wide>(b[1] - a[1]) * (c[0] - a[0]);
}

std::vector<CornerTriple> cut(const PointSet& points) {
  std::vector<Eigen::Vector2d> flat;
  for (const auto& p : points) flat.emplace_back(static_cast<double>(p[0]), static_cast<double>(p[1]));
  return cutPolygon(flat, flat.size());
}

/// Every edge of the ring belongs to one triangle, every other edge to two that agree about it.
void expectTriangulation(const std::vector<CornerTriple>& triangles, std::size_t n) {
  ASSERT_EQ(triangles.size(), n - 2);
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> open;
  for (std::uint32_t i = 0; i < n; ++i) --open[{i, (i + 1) % n}];
  for (const CornerTriple& t : triangles) {
    for (int k = 0; k < 3; ++k) {
      ASSERT_LT(t[k], n);
      ++open[{t[k], t[(k + 1) % 3]}];
    }
  }
  for (const auto& [edge, count] : open) {
    const auto back = open.find({edge.second, edge.first});
    ASSERT_EQ(count, back == open.end() ? 0 : back->second) << edge.first << " " << edge.second;
  }
}

/// Of a polygon that does not cross itself: triangles that all turn left and follow the ring cover its inside once.
void expectCovered(const PointSet& points, const std::string& what) {
  SCOPED_TRACE(what + ", " + std::to_string(points.size()) + " corners");
  const std::vector<CornerTriple> triangles = cut(points);
  expectTriangulation(triangles, points.size());
  for (const CornerTriple& t : triangles) ASSERT_GE(area2(points[t[0]], points[t[1]], points[t[2]]), 0);
}

/// A linear map with integer entries, area kept in sign, so that edges lie in any direction.
PointSet sheared(PointSet points, std::mt19937& random) {
  std::uniform_int_distribution<std::int64_t> entry(-9, 9);
  std::array<std::int64_t, 4> m{};
  while (m[0] * m[3] - m[1] * m[2] <= 0) {
    for (std::int64_t& e : m) e = entry(random);
  }
  for (auto& p : points) p = {m[0] * p[0] + m[1] * p[1], m[2] * p[0] + m[3] * p[1]};
  return points;
}

/// The outline of a random set of unit squares that hang together, gone around along a random tree of their
/// neighbourhood: all that a polygon may be which does not cross itself, with slits of no width between squares that
/// are no neighbours in the tree, holes tied to the outline, corners that touch, and corners on straight lines.
/// With `room`, squares are apart and joined by corridors: nothing touches.
PointSet treeOutline(std::mt19937& random, std::size_t squares, bool room) {
  using Square = std::array<std::int64_t, 2>;
  const std::array<Square, 4> steps{{{1, 0}, {0, 1}, {-1, 0}, {0, -1}}};
  std::set<std::pair<Square, Square>> doors;
  std::set<Square> members{{0, 0}};
  std::vector<Square> order{{0, 0}};
  while (order.size() < squares) {
    const Square from = order[std::uniform_int_distribution<std::size_t>(0, order.size() - 1)(random)];
    const Square& step = steps[random() % 4];
    const Square to{from[0] + step[0], from[1] + step[1]};
    if (!members.insert(to).second) continue;
    order.push_back(to);
    doors.insert({from, to});
    doors.insert({to, from});
  }
  // Side k of a square faces step k; its corners go around to the left: from corner k to corner k + 1.
  const std::array<Square, 4> corners{{{1, -1}, {1, 1}, {-1, 1}, {-1, -1}}};
  const auto corner = [&](const Square& s, int k) {
    const std::int64_t pitch = room ? 3 : 2;
    return Square{pitch * s[0] + corners[k % 4][0], pitch * s[1] + corners[k % 4][1]};
  };
  PointSet outline;
  Square square{0, 0};
  int side = 0;
  const auto neighbour = [&] { return Square{square[0] + steps[side][0], square[1] + steps[side][1]}; };
  while (doors.count({square, neighbour()}) != 0 && side < 3) ++side;
  const Square first_square = square;
  const int first_side = side;
  do {
    if (doors.count({square, neighbour()}) != 0) {
      if (room) outline.push_back(corner(square, side));
      square = neighbour();
      side = (side + 3) % 4;  // the side after the door on its other side
    } else {
      outline.push_back(corner(square, side));
      side = (side + 1) % 4;
    }
  } while (square != first_square || side != first_side);
  return outline;
}

TEST(CutPolygon, OrientationIsExact) {
  // Three points within 2^-50 of a line, against integers.
  std::mt19937 random(1);
  std::uniform_int_distribution<std::int64_t> large(-(std::int64_t{1} << 50), std::int64_t{1} << 50);
  std::uniform_int_distribution<std::int64_t> small(-2, 2);
  std::array<int, 3> seen{};
  for (int i = 0; i < 100000; ++i) {
    const std::array<std::int64_t, 2> a{large(random) / 3, large(random) / 3};
    const std::array<std::int64_t, 2> b{large(random) / 3, large(random) / 3};
    const std::array<std::int64_t, 2> c{(a[0] + b[0]) / 2 + small(random), (a[1] + b[1]) / 2 + small(random)};
    const Wide exact = area2(a, b, c);
    const int sign = (exact > 0) - (exact < 0);
    const auto point = [](const auto& p) {
      return Eigen::Vector2d(std::ldexp(static_cast<double>(p[0]), -50), std::ldexp(static_cast<double>(p[1]), -50));
    };
    ASSERT_EQ(orientation(point(a), point(b), point(c)), sign) << i;
    ++seen[static_cast<std::size_t>(sign + 1)];
  }
  for (const int count : seen) EXPECT_GT(count, 100);
}

TEST(CutPolygon, OutlinesWithSlitsHolesAndTouchingCorners) {
  std::mt19937 random(2);
  for (int i = 0; i < 3000; ++i) {
    const std::size_t squares = 1 + static_cast<std::size_t>(random() % (i % 100 == 0 ? 2000 : 40));
    const PointSet outline = treeOutline(random, squares, i % 4 == 3);
    expectCovered(outline, "as it is");
    PointSet turned = sheared(outline, random);
    std::rotate(turned.begin(), turned.begin() + static_cast<std::ptrdiff_t>(random() % turned.size()), turned.end());
    expectCovered(turned, "sheared");
    // Repeated corners, and one in the middle of each edge.
    PointSet more;
    for (std::size_t k = 0; k < turned.size(); ++k) {
      const auto& p = turned[k];
      const auto& q = turned[(k + 1) % turned.size()];
      more.push_back({2 * p[0], 2 * p[1]});
      if (random() % 3 == 0) more.push_back(more.back());
      if (random() % 3 == 0) more.push_back({p[0] + q[0], p[1] + q[1]});
    }
    expectCovered(more, "with corners that turn nowhere");
    if (HasFatalFailure()) FAIL() << i;
  }
}

TEST(CutPolygon, StarsCombsAndSpirals) {
  std::mt19937 random(3);
  for (const int n : {4, 5, 7, 10, 100, 3000}) {
    for (int i = 0; i < (n > 1000 ? 3 : 100); ++i) {
      PointSet star;
      for (int k = 0; k < n; ++k) {
        const double r = 1e9 * std::uniform_real_distribution<>(0.1, 1)(random);
        star.push_back({std::llround(r * std::cos(2 * M_PI * k / n)), std::llround(r * std::sin(2 * M_PI * k / n))});
      }
      expectCovered(star, "star");
      PointSet comb;
      for (int k = 0; k < n; ++k) comb.push_back({2 * (n - k), k % 2 * (3 + static_cast<int>(random() % 100))});
      comb.push_back({0, -1});
      comb.push_back({2 * n, -1});
      expectCovered(sheared(comb, random), "comb");
      PointSet spiral;
      for (int k = 0; k < n; ++k) {
        const double r = 1e6 * (k + 1);
        spiral.push_back({std::llround(r * std::cos(M_PI / 8 * k)), std::llround(r * std::sin(M_PI / 8 * k))});
      }
      for (int k = n; k-- > 0;) {
        const double r = 1e6 * (k + 1) - 4e6;
        spiral.push_back({std::llround(r * std::cos(M_PI / 8 * k)), std::llround(r * std::sin(M_PI / 8 * k))});
      }
      spiral.erase(spiral.end() - 8, spiral.end());
      if (n > 10) expectCovered(PointSet(spiral.begin(), spiral.end()), "spiral");
    }
  }
}

TEST(CutPolygon, WhatCrossesItselfIsCutSomehow) {
  std::mt19937 random(4);
  for (int i = 0; i < 2000; ++i) {
    const int size = 1 + static_cast<int>(random() % 20);
    PointSet points(4 + random() % (i % 100 == 0 ? 5000 : 60));
    for (auto& p : points) p = {static_cast<int>(random() % 20) % size, static_cast<int>(random() % 20) % size};
    expectTriangulation(cut(points), points.size());
  }
  // Cubic or quadratic effort would not end here.
  PointSet points(100000);
  for (auto& p : points) p = {static_cast<int>(random() % 100000), static_cast<int>(random() % 100000)};
  EXPECT_EQ(cut(points).size(), points.size() - 2);
  for (std::size_t k = 0; k < points.size(); ++k) points[k] = {k % 2 ? 1000000 : 0, static_cast<int>(random() % 1000)};
  EXPECT_EQ(cut(points).size(), points.size() - 2);
  EXPECT_EQ(cutPolygon({}, 6).size(), 4u);
}

}  // namespace
}  // namespace bocst::io
