// SPDX-License-Identifier: BSD-3-Clause
#include "mesh/interior.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "mesh/solid.h"
#include "mesh/weld.h"
#include "meshes.h"

namespace bocst {
namespace {

using Eigen::Vector3d;
using test::Raw;
using test::turnedOver;
using test::unwelded;

struct Case {
  const char* name;
  Raw raw;
};

Raw turned(const Raw& raw, unsigned seed) {
  std::mt19937_64 g(seed);
  const Eigen::Matrix3d R = test::randomRotation(g);
  Raw result = raw;
  for (Vector3d& v : result.vertices) v = R * v + Vector3d(3, -2, 1);
  return result;
}

/// Solid between the two.
Raw shell() {
  return test::box({-1, -1, -1}, {1, 1, 1}).add(turnedOver(test::box({-0.7, -0.7, -0.7}, {0.7, 0.7, 0.7})));
}

/// Of triangles as long as it is.
Raw pipe(std::size_t sides) {
  Raw raw;
  const std::size_t top = 2 * sides, bottom = top + 1;
  for (std::size_t k = 0; k < sides; ++k) {
    const double angle = 2 * M_PI * static_cast<double>(k) / static_cast<double>(sides);
    for (const double z : {-2.0, 2.0}) raw.vertices.push_back({std::cos(angle), std::sin(angle), z});
    const std::size_t a = 2 * k, b = 2 * ((k + 1) % sides);
    raw.triangles.emplace_back(a, b, b + 1);
    raw.triangles.emplace_back(a, b + 1, a + 1);
    raw.triangles.emplace_back(bottom, b, a);
    raw.triangles.emplace_back(top, a + 1, b + 1);
  }
  raw.vertices.push_back({0, 0, 2});
  raw.vertices.push_back({0, 0, -2});
  return raw;
}

/// With triangles that are a point and a segment.
Raw withDegenerates(Raw raw) {
  const fcl::Triangle t = raw.triangles[0];
  raw.triangles.emplace_back(t[0], t[0], t[0]);
  raw.triangles.emplace_back(t[0], t[1], t[1]);
  return raw;
}

/// Each triangle as three, one of which is hardly more than an edge.
Raw withSlivers(const Raw& raw) {
  Raw result;
  result.vertices = raw.vertices;
  for (const auto& t : raw.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Vector3d &a = raw.vertices[t[k]], &b = raw.vertices[t[(k + 1) % 3]], &c = raw.vertices[t[(k + 2) % 3]];
      if (k == 0) result.vertices.push_back(0.3 * a + 0.7 * b + 1e-13 * (c - a));
      result.triangles.emplace_back(t[k], t[(k + 1) % 3], result.vertices.size() - 1);
    }
  }
  return result;
}

/// The faces of its cavity are 0.03 cells from ends of cells: what is off by kAllowed may be beyond them.
Raw cavityBesideCells() {
  const double cell = 1 / 15.5;
  const Vector3d from = Vector3d::Constant((5 - 0.25 + 0.03) * cell),
                 to = Vector3d::Constant((11 - 0.25 - 0.03) * cell);
  return test::box({0, 0, 0}, {1, 1, 1}).add(turnedOver(test::box(from, to)));
}

std::vector<Case> closedMeshes() {
  return {{"box", test::box({-1, -2, -0.5}, {1, 2, 0.5})},
          {"turned box", turned(test::box({-1, -2, -0.5}, {1, 2, 0.5}), 1)},
          {"small torus", test::torus(9, 0.3)},
          {"torus", test::torus(40)},
          {"large torus", turned(test::torus(80), 12)},
          {"turned torus", turned(test::torus(40, 0.2), 2)},
          {"torus without common vertices", unwelded(turned(test::torus(20), 3))},
          {"torus with degenerate triangles", withDegenerates(test::torus(20))},
          {"shell", turned(shell(), 4)},
          {"cavity beside the ends of cells", cavityBesideCells()},
          {"long", test::box({-10, -0.1, -0.2}, {10, 0.1, 0.2})},
          {"two apart", turned(test::torus(12).add(test::box({3, 0, 0}, {4, 1, 1})), 6)},
          {"pipe", turned(pipe(50), 9)},
          {"box with slivers", withSlivers(turned(test::box({0, 0, 0}, {1, 1, 2}), 10))},
          {"small", turned(test::torus(20), 7).scale(1e-20)}};
}

lattice::Lattice latticeOf(const Mesh& mesh) { return lattice::Lattice(mesh.bounds(), Options().subdivision, 0); }

/// Where a point of a cell is, in the mesh's frame; `at` within the cell from 0 to 1, and by kAllowed beyond.
Vector3d pointIn(const Interior& grid, const lattice::Lattice& lattice, const Vector3d& cell, const Vector3d& at) {
  Vector3d p;
  for (int k = 0; k < 3; ++k) p[k] = grid.low[k] + (cell[k] + at[k]) / grid.cells_per_unit[k];
  return p * lattice.unit() + lattice.origin();
}

bool has(const std::vector<std::uint32_t>& cells, int bits, const Vector3d& cell) {
  const auto x = static_cast<unsigned>(cell.x()), y = static_cast<unsigned>(cell.y()),
             z = static_cast<unsigned>(cell.z());
  const unsigned number = (z << bits | y) << bits | x;
  return (cells[number / 32] >> number % 32 & 1) != 0;
}

// Solid counts turns about a point, with the triangles' directions; here the crossings of a line, without.
TEST(Interior, CellsAreWhollyInsideOrOutside) {
  std::mt19937_64 g(1);
  std::uniform_real_distribution<double> u(-Interior::kAllowed, 1 + Interior::kAllowed);
  for (const Case& c : closedMeshes()) {
    SCOPED_TRACE(c.name);
    const auto mesh = c.raw.mesh();
    const lattice::Lattice lattice = latticeOf(*mesh);
    const Interior grid(*mesh, lattice);
    ASSERT_NE(grid.bits, 0);
    const Solid solid(mesh);
    const int side = 1 << grid.bits;
    // What is beyond the grid is outside.
    for (int k = 0; k < 3; ++k) {
      const double from = (lattice.toLattice(mesh->bounds().min())[k] - grid.low[k]) * grid.cells_per_unit[k],
                   to = (lattice.toLattice(mesh->bounds().max())[k] - grid.low[k]) * grid.cells_per_unit[k];
      EXPECT_GT(from, Interior::kAllowed);
      EXPECT_LT(to, side - Interior::kAllowed);
    }
    std::size_t inside = 0, outside = 0;
    for (int z = 0; z < side; ++z) {
      for (int y = 0; y < side; ++y) {
        for (int x = 0; x < side; ++x) {
          const Vector3d cell(x, y, z);
          const bool is_inside = has(grid.inside, grid.bits, cell), is_outside = has(grid.outside, grid.bits, cell);
          ASSERT_FALSE(is_inside && is_outside);
          if (!is_inside && !is_outside) continue;
          (is_inside ? inside : outside) += 1;
          for (int n = 0; n < 6; ++n) {
            const Vector3d at = n == 0 ? Vector3d(0.5, 0.5, 0.5) : Vector3d(u(g), u(g), u(g));
            ASSERT_EQ(solid.mayContain(pointIn(grid, lattice, cell, at), 0), is_inside)
                << "cell " << cell.transpose() << " at " << at.transpose();
          }
        }
      }
    }
    EXPECT_GT(inside, 0u);
    EXPECT_EQ(grid.bytes(), Interior::mostBytesOf(mesh->triangleCount()));
    // What is near the surface is less than half of the grid.
    if (side >= 32) {
      EXPECT_GT(inside + outside, static_cast<std::size_t>(side * side * side / 2));
    }
  }
}

// The number of cells does not tell whether lines along y or z would have found the same.
TEST(Interior, MostOfABoxIsInside) {
  const auto mesh = turned(test::box({0, 0, 0}, {1, 1, 1}), 8).mesh();
  const Interior grid(*mesh, latticeOf(*mesh));
  std::size_t inside = 0;
  for (const std::uint32_t row : grid.inside) inside += static_cast<std::size_t>(__builtin_popcount(row));
  const Vector3d size = mesh->bounds().sizes();
  const double share = static_cast<double>(inside) / 4096, expected = 1 / size.prod();
  EXPECT_EQ(grid.bits, 4);
  EXPECT_GT(share, 0.45 * expected);
  EXPECT_LT(share, expected);
}

// Faces along x as well as others.
TEST(Interior, MostOfAPyramidIsInside) {
  Raw pyramid;
  pyramid.vertices = {{0, 0, 0}, {1, 1, 0}, {0, 1, 0}, {1, 0, 0}, {0.5, 0.5, 1}};
  for (const auto& [a, b, c] :
       {std::array<std::size_t, 3>{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {0, 3, 2}, {3, 1, 2}})
    pyramid.triangles.emplace_back(a, b, c);
  const auto mesh = pyramid.mesh();
  const Interior grid(*mesh, latticeOf(*mesh));
  std::size_t inside = 0;
  for (const std::uint32_t cells : grid.inside) inside += static_cast<std::size_t>(__builtin_popcount(cells));
  EXPECT_GT(inside, 4096u / 3 / 2);
  EXPECT_LT(inside, 4096u / 3);
}

TEST(Interior, OfASurfaceThatIsNotClosedThereIsNoGrid) {
  Raw open = test::torus(12);
  open.triangles.pop_back();
  Raw fin = test::box({0, 0, 0}, {1, 1, 1});
  fin.vertices.push_back({2, 2, 2});
  fin.triangles.emplace_back(0, 1, fin.vertices.size() - 1);
  // Each vertex is the lesser one of an even number of the edges that have one triangle.
  Raw pyramid;
  pyramid.vertices = {{0, 0, 0}, {1, 1, 0}, {0, 1, 0}, {1, 0, 0}, {0.5, 0.5, 1}};
  for (const std::size_t corner : {0, 1}) {
    pyramid.triangles.emplace_back(corner, corner == 0 ? 2 : 3, 4);
    pyramid.triangles.emplace_back(corner == 0 ? 2 : 3, 1 - corner, 4);
  }
  for (const Raw& raw : {open, fin, pyramid, test::soup(40, 1)}) {
    const auto mesh = raw.mesh();
    EXPECT_EQ(Interior(*mesh, latticeOf(*mesh)).bits, 0);
  }
}

TEST(Interior, VerticesThatNoTriangleUsesMayBeAnywhere) {
  Raw raw = test::torus(12);
  const auto mesh = raw.mesh();
  raw.vertices.push_back({1e75, -1e75, 1e75});
  const auto with_more = raw.mesh();
  const Interior a(*mesh, latticeOf(*mesh)), b(*with_more, latticeOf(*with_more));
  EXPECT_NE(a.bits, 0);
  EXPECT_EQ(a.inside, b.inside);
  EXPECT_EQ(a.outside, b.outside);
}

// Their boxes hold many rows of the grid each, so it would take much longer than the price says.
TEST(Interior, OfManyLongTrianglesThereIsNoGrid) {
  const auto mesh = turned(pipe(20000), 11).mesh();
  EXPECT_EQ(Interior(*mesh, latticeOf(*mesh)).bits, 0);
}

TEST(Interior, OfAFlatSurfaceThereIsNoGrid) {
  const auto mesh = test::box({0, 0, 0}, {1, 1, 1e-9}).mesh();
  EXPECT_EQ(Interior(*mesh, latticeOf(*mesh)).bits, 0);
}

TEST(Interior, LargeMeshesHaveFinerGrids) {
  for (const auto& [n, bits] : {std::pair<std::size_t, int>{12, 4}, {40, 5}, {64, 6}}) {
    const auto mesh = test::torus(n).mesh();
    EXPECT_EQ(Interior(*mesh, latticeOf(*mesh)).bits, bits) << mesh->triangleCount();
  }
}

// Each triangle twice: nothing is inside, as each line crosses the surface twice where it crosses it.
TEST(Interior, TwoSheetsAtOnePlaceEncloseNothing) {
  const auto mesh = test::torus(12).add(turnedOver(test::torus(12))).mesh();
  EXPECT_EQ(Interior(*mesh, latticeOf(*mesh)).bits, 0);
}

TEST(Interior, ProbesAreSpreadOverTheLargestComponent) {
  // The small torus has more triangles, but less area.
  const auto mesh = test::torus(30).scale(0.1).add(test::box({3, 3, 3}, {5, 5, 5})).mesh();
  const lattice::Lattice lattice = latticeOf(*mesh);
  const Interior interior(*mesh, lattice);
  std::set<std::array<bool, 3>> corners;
  for (std::size_t i = 0; i < Interior::kProbes; ++i) {
    Vector3d p;
    for (int k = 0; k < 3; ++k) p[k] = static_cast<double>(interior.probes[k][i]) + lattice::kMiddle;
    p = p * lattice.unit() + lattice.origin();
    // On the box: within its rounding, and on a face.
    const Vector3d from_middle = (p - Vector3d(4, 4, 4)).cwiseAbs();
    EXPECT_NEAR(from_middle.maxCoeff(), 1, 1e-5);
    corners.insert({p.x() > 4, p.y() > 4, p.z() > 4});
  }
  EXPECT_EQ(corners.size(), 8u);
}

TEST(Interior, ASurfaceWithoutAreaHasOneProbe) {
  Raw line;
  line.addTriangle({0, 0, 0}, {1, 2, 3}, {2, 4, 6});
  const auto mesh = line.mesh();
  const Interior interior(*mesh, latticeOf(*mesh));
  for (std::size_t i = 0; i < Interior::kProbes; ++i) {
    for (int k = 0; k < 3; ++k) EXPECT_EQ(interior.probes[k][i], interior.probes[k][0]);
  }
}

TEST(Weld, AThirdCornerJoinsTheComponentOfTheOthers) {
  Raw strip;
  strip.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, -1, 0}};
  strip.triangles.emplace_back(0, 1, 2);
  strip.triangles.emplace_back(0, 1, 3);
  const auto mesh = strip.mesh();
  EXPECT_EQ(componentOfEachVertex(weld(mesh->vertices()), mesh->triangles()), std::vector<std::uint32_t>(4, 0));
}

TEST(Weld, ComponentsAreJoinedAtCommonPlaces) {
  const Raw raw = unwelded(test::torus(8)).add(unwelded(test::box({5, 5, 5}, {6, 6, 6})));
  const auto mesh = raw.mesh();
  const auto component = componentOfEachVertex(weld(mesh->vertices()), mesh->triangles());
  EXPECT_EQ(std::set<std::uint32_t>(component.begin(), component.end()).size(), 2u);
}

}  // namespace
}  // namespace bocst
