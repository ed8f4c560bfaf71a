// SPDX-License-Identifier: BSD-3-Clause
// One body for every oracle: grey sets against the padded double reference and against exact integers, bounds against
// points of the surface, lists against all triangles.
#include "oracle/oracle.h"

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <numeric>
#include <random>

#include "oracle/cpu/kernels.h"
#include "oracle/gl/device_oracle.h"
#include "sanitized.h"
#include "surfaces.h"

namespace bocst::oracle {
namespace {

using lattice::Cell;
using lattice::Lattice;

// Is p, in lattice units, inside the bounds of the octant?
bool contains(const bounds::NodeBounds& b, const Cell& cell, const Eigen::Vector3d& p, double relative = 1e-6) {
  const double side = cell.side(), tolerance = side * relative + 1e-9;
  const Eigen::Vector3d center = centerOf(cell);
  double along = 0;
  for (int k = 0; k < 3; ++k) {
    const double x = p[k] - (center[k] - side / 2);
    if (x < b.lo[static_cast<std::size_t>(k)] * side / 255 - tolerance) return false;
    if (x > b.hi[static_cast<std::size_t>(k)] * side / 255 + tolerance) return false;
    along += b.normal[static_cast<std::size_t>(k)] * (p[k] - center[k]) / side;
  }
  return std::abs(along - b.slab_center) <= b.slab_half / 2.0 + 127 * relative;
}

class EveryOracle : public testing::TestWithParam<OracleKind> {
 protected:
  std::shared_ptr<Oracle> oracle_ = makeOracle(GetParam());
  // No test body is passed by the CPU in place of a device.
  void TearDown() override {
    const auto* device = dynamic_cast<gl::DeviceOracle*>(oracle_.get());
    if (device == nullptr) return;
    EXPECT_EQ(device->leftToCpu(), 0u);
  }
};

// Expands all grey cells level by level and checks each answer.
void checkMesh(Oracle& oracle, const Surface& here, int levels, std::size_t most_cells) {
  const Surface surface = residentOn(oracle, here);
  std::mt19937_64 g(1);
  std::uniform_real_distribution<double> u(0, 1);
  std::vector<ExpansionRequest> level{rootOf(surface)};
  std::vector<std::vector<std::uint32_t>> lists;  // that `level` points to
  for (int l = 1; l <= levels; ++l) {
    if (level.size() > most_cells) {
      std::shuffle(level.begin(), level.end(), g);
      level.resize(most_cells);
    }
    const std::vector<ExpansionRequest> answers = ask(oracle, level);
    std::vector<ExpansionRequest> next;
    std::vector<std::vector<std::uint32_t>> next_lists;
    for (const ExpansionRequest& e : answers) {
      for (int o = 0; o < 8; ++o) {
        const Cell octant = e.cell.octant(o);
        const bool grey = e.grey >> o & 1;
        ASSERT_EQ(grey, referenceGrey(surface, octant)) << "level " << octant.level << " octant " << o;
        std::vector<std::uint32_t> list(e.listBegin(o), e.listEnd(o));
        if (!grey) {
          ASSERT_TRUE(list.empty());
          continue;
        }
        for (std::uint32_t t = 0; t < surface.mesh->triangleCount(); ++t) {
          const auto c = surface.corners(t);
          if (!triangleMeetsCube(c.data(), centerOf(octant), octant.side() / 2.0)) continue;
          ASSERT_NE(std::find(list.begin(), list.end(), t), list.end()) << "triangle " << t << " is not listed";
          for (int i = 0; i < 40; ++i) {
            double a = u(g), b = u(g);
            if (a + b > 1) a = 1 - a, b = 1 - b;
            if (i < 3) a = i == 1, b = i == 2;
            const Eigen::Vector3d p = c[0] + a * (c[1] - c[0]) + b * (c[2] - c[0]);
            if ((p - centerOf(octant)).cwiseAbs().maxCoeff() > octant.side() / 2.0) continue;
            ASSERT_TRUE(contains(e.octants.get(o), octant, p)) << "triangle " << t << " level " << octant.level;
            ASSERT_TRUE(contains(e.own, e.cell, p)) << "triangle " << t << " level " << octant.level;
          }
        }
        next.push_back(requestFor(surface, octant, list.data(), list.size()));
        next_lists.push_back(std::move(list));
      }
    }
    lists.swap(next_lists);
    level.swap(next);
  }
}

TEST_P(EveryOracle, RealShape) { checkMesh(*oracle_, surfaceOf(test::torus(24)), 6, 40); }

TEST_P(EveryOracle, OctreeAndDimensions) {
  checkMesh(*oracle_, surfaceOf(test::torus(12), Subdivision::kOctree), 5, 30);
  for (const double d : {514.0, 768.0, 1023.0}) {
    checkMesh(*oracle_, surfaceOf(test::torus(12), Subdivision::kBono, d), 5, 30);
  }
}

TEST_P(EveryOracle, Adversarial) { checkMesh(*oracle_, surfaceOf(test::adversarial()), 10, 60); }

TEST_P(EveryOracle, Soup) { checkMesh(*oracle_, surfaceOf(test::soup(600, 5)), 8, 40); }

TEST_P(EveryOracle, AnyScaleAndPlace) {
  for (const double scale : {1e-6, 1e6}) {
    for (const double away : {0.0, 1e6}) {
      test::Raw raw = test::torus(8);
      raw.scale(scale).move(Eigen::Vector3d::Constant(scale * away));
      checkMesh(*oracle_, surfaceOf(raw), 5, 20);
    }
  }
}

TEST_P(EveryOracle, OddBatches) {
  const Surface a = residentOn(*oracle_, surfaceOf(test::torus(16)));
  const Surface b = residentOn(*oracle_, surfaceOf(test::adversarial()));
  for (const std::size_t size : {std::size_t{1}, std::size_t{2}, std::size_t{3}, std::size_t{63}, std::size_t{1001}}) {
    std::vector<ExpansionRequest> batch(size);
    for (std::size_t i = 0; i < size; ++i) {
      batch[i].surface = i % 3 ? &a : &b;
      batch[i].count = batch[i].surface->mesh->triangleCount();
      if (i % 2) batch[i].cell = Cell{}.octant(static_cast<int>(i % 8));
    }
    const std::vector<ExpansionRequest> answers = ask(*oracle_, batch);
    for (std::size_t i = 0; i < size; i += 97) {
      for (int o = 0; o < 8; ++o) {
        EXPECT_EQ(answers[i].grey >> o & 1, referenceGrey(*answers[i].surface, answers[i].cell.octant(o)));
      }
    }
  }
}

/// A mesh whose lattice unit is 1: two triangles pin its bounds to the whole cube; more are to be added.
test::Raw pinnedToCube() {
  test::Raw raw;
  for (const double x : {0.0, 65536.0}) raw.addTriangle({x, x, x}, {x, x, x}, {x, x, x});
  return raw;
}

// Triangles with integer corners against cells: whether they touch is decided exactly, in 128-bit integers.
__extension__ typedef __int128 Int;
struct IntVec {
  Int x[3];
};

bool touchesExactly(const IntVec v[3], const Int center[3], Int half) {
  IntVec w[3];
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) w[i].x[k] = v[i].x[k] - center[k];
  }
  const auto apart = [&](const Int axis[3]) {
    Int lo = 0, hi = 0, r = 0;
    for (int i = 0; i < 3; ++i) {
      const Int d = axis[0] * w[i].x[0] + axis[1] * w[i].x[1] + axis[2] * w[i].x[2];
      lo = i == 0 || d < lo ? d : lo;
      hi = i == 0 || d > hi ? d : hi;
    }
    for (int k = 0; k < 3; ++k) r += half * (axis[k] < 0 ? -axis[k] : axis[k]);
    return lo > r || hi < -r;
  };
  Int e[3][3];
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) e[i][k] = w[(i + 1) % 3].x[k] - w[i].x[k];
  }
  const auto cross = [](const Int a[3], const Int b[3], Int c[3]) {
    for (int k = 0; k < 3; ++k) c[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
  };
  Int n[3];
  cross(e[0], e[1], n);
  if (apart(n)) return false;
  for (int k = 0; k < 3; ++k) {
    const Int unit[3] = {k == 0, k == 1, k == 2};
    if (apart(unit)) return false;
    for (int i = 0; i < 3; ++i) {
      Int a[3];
      cross(e[i], unit, a);
      if (apart(a)) return false;
    }
  }
  return true;
}

TEST_P(EveryOracle, NothingMissedAgainstIntegers) {
  // Corners on a grid of 2^-8 units, many of them on faces, edges and corners of cells.
  std::mt19937_64 g(9);
  constexpr int kFine = 8;
  const auto triangles = static_cast<std::uint32_t>(test::repetitions(400));
  std::uint64_t touching = 0;
  for (int round = 0; round < 12; ++round) {
    const int level = 3 + round;  // of the octants
    const std::int64_t side = std::int64_t{1} << (lattice::kMaxLevel - level + kFine);
    const std::int64_t whole = std::int64_t{1} << (lattice::kBits + kFine);
    test::Raw raw = pinnedToCube();
    const std::int64_t middle = whole / 2;
    std::vector<IntVec> corners;
    for (std::uint32_t t = 0; t < triangles; ++t) {
      for (int k = 0; k < 3; ++k) {
        IntVec v;
        for (int c = 0; c < 3; ++c) {
          const std::int64_t step = g() % 3 == 0 ? side : g() % 2 ? side / 2 : 1;
          const auto span = static_cast<std::uint64_t>(4 * side / step + 1);
          v.x[c] = middle - 2 * side + static_cast<std::int64_t>(g() % span) * step;
        }
        corners.push_back(v);
        raw.vertices.emplace_back(std::ldexp(static_cast<double>(v.x[0]), -kFine),
                                  std::ldexp(static_cast<double>(v.x[1]), -kFine),
                                  std::ldexp(static_cast<double>(v.x[2]), -kFine));
      }
      raw.triangles.emplace_back(raw.vertices.size() - 3, raw.vertices.size() - 2, raw.vertices.size() - 1);
    }
    const Surface surface = residentOn(*oracle_, surfaceOf(raw));
    ASSERT_EQ(surface.lattice.unit(), 1);
    std::vector<std::uint32_t> ids(triangles);
    std::iota(ids.begin(), ids.end(), 2u);
    std::vector<ExpansionRequest> batch;
    for (std::uint32_t t = 0; t < triangles; ++t) {
      for (int o = 0; o < 8; ++o) {  // the eight cells of the level above about the middle
        const std::uint32_t at = 1u << (level - 3);
        const Cell cell{level - 1, {at - (o & 1), at - (o >> 1 & 1), at - (o >> 2 & 1)}};
        batch.push_back(requestFor(surface, cell, &ids[t], 1));
      }
    }
    const std::vector<ExpansionRequest> answers = ask(*oracle_, batch);
    for (const ExpansionRequest& e : answers) {
      const std::size_t t = *e.ids - 2;
      for (int o = 0; o < 8; ++o) {
        const auto corner = e.cell.octant(o).corner();
        Int center[3];
        for (int k = 0; k < 3; ++k) center[k] = (Int{corner[k]} << kFine) + side / 2;
        const bool exact = touchesExactly(&corners[3 * t], center, side / 2);
        touching += exact;
        if (exact) {
          ASSERT_TRUE(e.grey >> o & 1) << "level " << level << " triangle " << t << " octant " << o;
        }
      }
    }
  }
  EXPECT_GT(touching, 25 * triangles);
}

/// A multiple of 2^-20, so that sums about a place of a lattice are exact.
double fine(double x) { return std::ldexp(std::round(std::ldexp(x, 20)), -20); }

/// A long sliver with p on one of its edges, exactly: up to `reach` along each axis, and so thin that its normal is
/// mostly the rounding of what cancels.
void sliverThrough(const Eigen::Vector3d& p, double reach, std::mt19937_64& g, Eigen::Vector3d (&corners)[3]) {
  std::uniform_real_distribution<double> u(-1, 1);
  Eigen::Vector3d way;
  for (int k = 0; k < 3; ++k) way[k] = fine(reach * u(g));
  corners[0] = p + way;
  corners[1] = p - way;
  const double along = u(g), thick = std::ldexp(1, -static_cast<int>(g() % 16));
  for (int k = 0; k < 3; ++k) corners[2][k] = p[k] + fine(along * way[k]) + fine(thick * u(g));
}

/// A corner of the cell, or now and then a place inside.
Eigen::Vector3d placeIn(const Cell& cell, std::mt19937_64& g) {
  Eigen::Vector3d p;
  const bool corner = g() % 4 != 0;
  for (int k = 0; k < 3; ++k) {
    const double part = corner ? static_cast<double>(g() % 2) : static_cast<double>(g() % 9) / 8;
    p[k] = cell.corner()[static_cast<std::size_t>(k)] + part * cell.side();
  }
  return p;
}

/// A cell of the level in the middle half of the root, so that what passes it may be long on both sides.
Cell cellNearMiddle(int level, std::mt19937_64& g) {
  Cell cell{level, {}};
  const std::uint32_t quarter = 1u << (level - 3);
  for (std::uint32_t& at : cell.at) at = quarter + static_cast<std::uint32_t>(g() % (2 * quarter));
  return cell;
}

TEST(Reference, LongSliversThroughCellsAreSeen) {
  std::mt19937_64 g(12);
  for (int i = 0; i < 40000; ++i) {
    const Cell cell = cellNearMiddle(4 + i % (lattice::kMaxLevel - 3), g);
    Eigen::Vector3d corners[3];
    sliverThrough(placeIn(cell, g), i % 2 == 0 ? 16000 : 2 * cell.side(), g, corners);
    ASSERT_TRUE(triangleMeetsCube(corners, centerOf(cell), cell.side() / 2.0)) << "level " << cell.level;
  }
}

std::vector<Eigen::Vector3d> clipped(std::vector<Eigen::Vector3d> polygon, const Eigen::AlignedBox3d& box) {
  for (int face = 0; face < 6 && !polygon.empty(); ++face) {
    const int k = face % 3;
    const auto inside = [&](const Eigen::Vector3d& p) { return face < 3 ? p[k] - box.min()[k] : box.max()[k] - p[k]; };
    std::vector<Eigen::Vector3d> next;
    for (std::size_t i = 0; i < polygon.size(); ++i) {
      const Eigen::Vector3d &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
      const double da = inside(a), db = inside(b);
      if (da >= 0) next.push_back(a);
      if ((da > 0 && db < 0) || (da < 0 && db > 0)) next.push_back(a + da / (da - db) * (b - a));
    }
    polygon.swap(next);
  }
  return polygon;
}

Eigen::AlignedBox3d boxOf(const Cell& cell) {
  const Eigen::Vector3d half = Eigen::Vector3d::Constant(cell.side() / 2.0);
  return {centerOf(cell) - half, centerOf(cell) + half};
}

Cell parentOf(const Cell& octant) { return {octant.level - 1, {octant.at[0] / 2, octant.at[1] / 2, octant.at[2] / 2}}; }
int indexOf(const Cell& octant) {
  return static_cast<int>((octant.at[0] & 1) | (octant.at[1] & 1) << 1 | (octant.at[2] & 1) << 2);
}

/// Asks for each cell with one triangle, the first with that of id 2. The answers point into `ids`.
std::vector<ExpansionRequest> askOneByOne(Oracle& oracle, const Surface& surface, const std::vector<Cell>& cells,
                                          std::vector<std::uint32_t>& ids) {
  ids.resize(cells.size());
  std::iota(ids.begin(), ids.end(), 2u);
  std::vector<ExpansionRequest> batch;
  for (std::size_t i = 0; i < cells.size(); ++i) batch.push_back(requestFor(surface, cells[i], &ids[i], 1));
  return ask(oracle, std::move(batch));
}

TEST_P(EveryOracle, LongSliversThroughDeepCells) {
  std::mt19937_64 g(13);
  for (const int level : {4, 8, 12, 15, 16}) {
    test::Raw raw = pinnedToCube();
    constexpr std::uint32_t kCount = 600;
    std::vector<Cell> octants, parents;
    std::vector<Eigen::Vector3d> places;
    for (std::uint32_t t = 0; t < kCount; ++t) {
      octants.push_back(cellNearMiddle(level + 1, g));
      parents.push_back(parentOf(octants.back()));
      places.push_back(placeIn(octants.back(), g));
      Eigen::Vector3d corners[3];
      sliverThrough(places.back(), t % 2 == 0 ? 16000 : std::min(16000u, 6 * octants.back().side()), g, corners);
      raw.addTriangle(corners[0], corners[1], corners[2]);
    }
    const Surface surface = residentOn(*oracle_, surfaceOf(raw));
    ASSERT_EQ(surface.lattice.unit(), 1);
    std::vector<std::uint32_t> ids;
    const std::vector<ExpansionRequest> answers = askOneByOne(*oracle_, surface, parents, ids);
    for (std::uint32_t t = 0; t < kCount; ++t) {
      const int o = indexOf(octants[t]);
      ASSERT_TRUE(answers[t].grey >> o & 1) << "level " << level << " triangle " << t;
      ASSERT_TRUE(contains(answers[t].octants.get(o), octants[t], places[t])) << "level " << level << " triangle " << t;
      ASSERT_TRUE(contains(answers[t].own, answers[t].cell, places[t])) << "level " << level << " triangle " << t;
      for (int octant = 0; octant < 8; ++octant) {
        if ((answers[t].grey >> octant & 1) == 0) continue;
        const Cell cell = answers[t].cell.octant(octant);
        const std::vector<Eigen::Vector3d> triangle = {surface.corner(t + 2, 0), surface.corner(t + 2, 1),
                                                       surface.corner(t + 2, 2)};
        for (const Eigen::Vector3d& p : clipped(triangle, boxOf(cell))) {
          ASSERT_TRUE(contains(answers[t].octants.get(octant), cell, p)) << "level " << level << " triangle " << t;
        }
      }
    }
  }
}

// In float a coordinate beside a whole byte, or beside half a step of a slab, is on either side of it.
TEST_P(EveryOracle, BoundsHoldWhatLiesBesideWholeBytes) {
  std::mt19937_64 g(16);
  std::uniform_real_distribution<double> u(-1e-9, 1e-9);
  for (const int level : {1, 9}) {
    test::Raw triangles = pinnedToCube();
    std::vector<Cell> octants, parents;
    for (int i = 0; i < 500; ++i) {
      const Cell cell = level == 1 ? Cell{} : cellNearMiddle(level, g), octant = cell.octant(static_cast<int>(g() % 8));
      octants.push_back(octant);
      parents.push_back(cell);
      const double side = octant.side();
      Eigen::Vector3d corners[3];
      for (Eigen::Vector3d& p : corners) {
        for (int k = 0; k < 3; ++k) {
          p[k] =
              octant.corner()[static_cast<std::size_t>(k)] + side * (static_cast<double>(1 + g() % 254) / 255 + u(g));
        }
      }
      if (i % 2 == 0) {
        const int k = static_cast<int>(g() % 3);
        const double steps = static_cast<double>(g() % 240) / 2 - 60;
        for (Eigen::Vector3d& p : corners) p[k] = centerOf(octant)[k] + side * (steps / 127 + u(g));
      }
      triangles.addTriangle(corners[0], corners[1], corners[2]);
    }
    const Surface surface = residentOn(*oracle_, surfaceOf(triangles));
    ASSERT_EQ(surface.lattice.unit(), 1);
    std::vector<std::uint32_t> ids;
    const std::vector<ExpansionRequest> answers = askOneByOne(*oracle_, surface, parents, ids);
    for (std::uint32_t i = 0; i < octants.size(); ++i) {
      const int o = indexOf(octants[i]);
      ASSERT_TRUE(answers[i].grey >> o & 1);
      for (int k = 0; k < 3; ++k) {
        const Eigen::Vector3d p = surface.corner(i + 2, k);
        ASSERT_TRUE(contains(answers[i].octants.get(o), octants[i], p, 1e-13))
            << "triangle " << i << " level " << level;
        ASSERT_TRUE(contains(answers[i].own, answers[i].cell, p, 1e-13)) << "triangle " << i << " level " << level;
      }
    }
  }
}

// Kernels in float cannot tell that these triangles miss the octants on one side of the middle; the test that decides
// can.
TEST_P(EveryOracle, WhiteOctantsListNothing) {
  std::mt19937_64 g(17);
  constexpr std::uint32_t kCount = 200;
  test::Raw triangles = pinnedToCube();
  std::vector<Cell> cells;
  for (std::uint32_t i = 0; i < kCount; ++i) {
    cells.push_back(cellNearMiddle(8, g));
    const int k = static_cast<int>(g() % 3);
    const double off = (g() % 2 ? 1e-8 : -1e-8) * cells.back().side();
    Eigen::Vector3d corners[3];
    for (Eigen::Vector3d& p : corners) {
      p = placeIn(cells.back(), g);
      p[k] = centerOf(cells.back())[k] + off;
    }
    triangles.addTriangle(corners[0], corners[1], corners[2]);
  }
  const Surface surface = residentOn(*oracle_, surfaceOf(triangles));
  std::vector<std::uint32_t> ids;
  for (const ExpansionRequest& e : askOneByOne(*oracle_, surface, cells, ids)) {
    int grey = 0;
    for (int o = 0; o < 8; ++o) {
      ASSERT_EQ(e.grey >> o & 1, meets(surface, *e.ids, e.cell.octant(o))) << *e.ids;
      ASSERT_EQ(e.listSize(o), e.grey >> o & 1) << *e.ids;
      grey += e.grey >> o & 1;
    }
    ASSERT_LE(grey, 4);
  }
}

// Flat pieces of surface, both sides of each, many in planes between octants: boxes and slabs are as thin as bytes
// allow.
TEST(CpuOracle, BoundsAreHardlyLargerThanTheSurface) {
  const auto oracle = makeOracle(OracleKind::kCpu);
  std::mt19937_64 g(18);
  test::Raw triangles = pinnedToCube();
  constexpr std::uint32_t kCount = 1000;
  std::vector<Cell> cells;
  for (std::uint32_t i = 0; i < kCount; ++i) {
    cells.push_back(cellNearMiddle(3 + static_cast<int>(g() % 6), g));
    Eigen::Vector3d corners[3];
    for (Eigen::Vector3d& p : corners) {
      for (int k = 0; k < 3; ++k) {
        p[k] = centerOf(cells.back())[k] + cells.back().side() * (static_cast<double>(g() % 33) - 16) / 16;
      }
    }
    if (i % 2 == 0) {
      const int k = static_cast<int>(g() % 3);
      corners[1][k] = corners[2][k] = corners[0][k] = i % 4 == 0 ? centerOf(cells.back())[k] : corners[0][k];
    }
    triangles.addTriangle(corners[0], corners[1], corners[2]);
    triangles.addTriangle(corners[0], corners[2], corners[1]);
  }
  const Surface surface = surfaceOf(triangles);
  ASSERT_EQ(surface.lattice.unit(), 1);
  std::vector<std::uint32_t> ids(2 * kCount);
  std::iota(ids.begin(), ids.end(), 2u);
  std::vector<ExpansionRequest> batch;
  for (std::uint32_t i = 0; i < kCount; ++i) batch.push_back(requestFor(surface, cells[i], &ids[2 * i], 2));
  std::size_t slabs = 0;
  const auto expectThin = [&](const bounds::NodeBounds& b, const Cell& cell,
                              const std::vector<Eigen::Vector3d>& corners) {
    // Clipping is outwards by little.
    const double side = cell.side(), off = 0x1p-12 * side;
    const Eigen::AlignedBox3d box = boxOf(cell);
    const auto outer = clipped(corners, {box.min().array() - off, box.max().array() + off});
    const auto inner = clipped(corners, box);
    ASSERT_FALSE(outer.empty());
    Eigen::AlignedBox3d bounds;
    for (const Eigen::Vector3d& p : outer) bounds.extend(p);
    for (int k = 0; k < 3; ++k) {
      const auto c = static_cast<std::size_t>(k);
      EXPECT_GE(box.min()[k] + b.lo[c] * side / 255, std::max(bounds.min()[k], box.min()[k]) - 1.01 * side / 255 - off);
      EXPECT_LE(box.min()[k] + b.hi[c] * side / 255, std::min(bounds.max()[k], box.max()[k]) + 1.01 * side / 255 + off);
    }
    Eigen::Vector3d area = Eigen::Vector3d::Zero();
    for (std::size_t i = 2; i < inner.size(); ++i) area += (inner[i - 1] - inner[0]).cross(inner[i] - inner[0]) / 2;
    if (area.norm() < 0.01 * side * side) return;
    ++slabs;
    const Eigen::Vector3d normal(b.normal[0], b.normal[1], b.normal[2]);
    EXPECT_GT(std::abs(normal.dot(area)), 126 * area.norm());
    EXPECT_LE(b.slab_half, 8);
  };
  const std::vector<ExpansionRequest> answers = ask(*oracle, batch);
  for (std::uint32_t i = 0; i < kCount && !HasFailure(); ++i) {
    SCOPED_TRACE(testing::Message() << "triangle " << i);
    const std::uint32_t t = ids[2 * i];
    const auto at = surface.corners(t);
    const std::vector<Eigen::Vector3d> corners(at.begin(), at.end());
    for (int o = 0; o < 8; ++o) {
      if (answers[i].grey >> o & 1) expectThin(answers[i].octants.get(o), cells[i].octant(o), corners);
    }
    if (answers[i].grey != 0) expectThin(answers[i].own, cells[i], corners);
  }
  EXPECT_GT(slabs, 1000u);
}

const char* nameOf(OracleKind kind) {
  return kind == OracleKind::kCpu ? "cpu" : kind == OracleKind::kOcclusion ? "occlusion" : "compute";
}

INSTANTIATE_TEST_SUITE_P(All, EveryOracle,
                         testing::Values(OracleKind::kCpu, OracleKind::kOcclusion, OracleKind::kCompute),
                         [](const auto& kind) { return std::string(nameOf(kind.param)); });

// A triangle beside an octant, parted from it by less than the tolerance, is still taken to meet it.
void checkTolerance() {
  std::mt19937_64 g(14);
  std::uniform_real_distribution<double> u(-1, 1);
  for (const double tolerance : {1e-3, 0.05, 0.4}) {
    constexpr std::size_t kCount = LocalTriangles::kCapacity;
    static LocalTriangles triangles;
    std::array<int, kCount> octants;
    for (std::size_t i = 0; i < kCount; ++i) {
      octants[i] = static_cast<int>(g() % 8);
      // A point of the octant's surface, and a way out that leads straight away from all of the octant.
      Eigen::Vector3d p, out = Eigen::Vector3d::Zero();
      while (out.isZero()) {
        for (int k = 0; k < 3; ++k) {
          const bool at_end = g() % 4 != 0, upper = g() % 2 != 0;
          p[k] = ((octants[i] >> k & 1) != 0 ? 0.5 : -0.5) + (at_end ? (upper ? 0.5 : -0.5) : u(g) / 2);
          out[k] = at_end ? (upper ? 1 : -1) * (1.01 + u(g)) : 0;
        }
      }
      out.normalize();
      const Eigen::Vector3d a = out.unitOrthogonal(), b = out.cross(a);
      // Across the way out, about the point; or with a corner there and the others farther out.
      const bool across = g() % 2 != 0;
      for (std::size_t k = 0; k < 3; ++k) {
        const double angle = 2.1 * static_cast<double>(k) + 0.5 * u(g), reach = 1.01 + u(g);
        Eigen::Vector3d v = p + 0.99 * tolerance * out;
        if (across || k > 0) v += reach * (std::cos(angle) * a + std::sin(angle) * b);
        if (!across && k > 0) v += (1 + u(g)) * out;
        for (std::size_t c = 0; c < 3; ++c) triangles.xyz[3 * k + c][i] = static_cast<float>(v[static_cast<int>(c)]);
      }
    }
    std::array<std::uint8_t, kCount> masks, without;
    octantMasks(triangles, kCount, static_cast<float>(tolerance), masks.data());
    octantMasks(triangles, kCount, 0, without.data());
    int kept_without = 0;
    for (std::size_t i = 0; i < kCount; ++i) {
      ASSERT_TRUE(masks[i] >> octants[i] & 1) << instructionSet() << " triangle " << i << " tolerance " << tolerance;
      kept_without += without[i] >> octants[i] & 1;
    }
    EXPECT_EQ(kept_without, 0) << instructionSet() << " tolerance " << tolerance;
  }
}

TEST(Kernels, EveryInstructionSetAgreesOnGreySets) {
  const Surface surface = surfaceOf(test::soup(500, 3));
  ExpansionRequest root = rootOf(surface);
  std::vector<std::uint8_t> greys;
  int targets = 0;
  const std::int64_t all = hwy::SupportedTargets() & HWY_TARGETS;
  for (std::int64_t left = all; left != 0; left &= left - 1) {
    hwy::SetSupportedTargetsForTest(left & -left);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    ++targets;
    for (int o = 0; o < 8; ++o) {
      root.cell = Cell{}.octant(o);
      const ExpansionRequest e = ask(*makeOracle(OracleKind::kCpu), {root})[0];
      if (targets == 1) {
        greys.push_back(e.grey);
      } else {
        EXPECT_EQ(greys[static_cast<std::size_t>(o)], e.grey) << instructionSet();
      }
    }
    checkMesh(*makeOracle(OracleKind::kCpu), surfaceOf(test::adversarial()), 6, 30);
    checkTolerance();
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  EXPECT_GE(targets, 1);
}

TEST(MakeOracle, SaysWhyNot) {
  EXPECT_EQ(makeOracle(OracleKind::kAuto)->name(), "cpu");
  for (const OracleInfo& info : availableOracles()) {
    if (info.why_not.empty()) {
      EXPECT_EQ(makeOracle(info.kind)->name(), info.name);
    } else {
      try {
        makeOracle(info.kind);
        ADD_FAILURE() << info.name;
      } catch (const OracleError& e) {
        EXPECT_NE(std::string(e.what()).find(info.why_not), std::string::npos);
      }
    }
  }
  setenv("BOCST_ORACLE", "cpu", 1);
  EXPECT_EQ(makeOracle(OracleKind::kAuto)->name(), "cpu");
  for (const char* bad : {"7", "gpu", "sampled", "-1"}) {
    setenv("BOCST_ORACLE", bad, 1);
    EXPECT_THROW(makeOracle(OracleKind::kAuto), OracleError) << bad;
    EXPECT_EQ(makeOracle(OracleKind::kCpu)->name(), "cpu");
  }
  setenv("BOCST_ORACLE", "", 1);
  EXPECT_EQ(makeOracle(OracleKind::kAuto)->name(), "cpu") << "as if it were not set";
  // Any index is understood, but there are not so many devices; what is no index is named as such.
  for (const auto& [value, is_index] : {std::pair("9999", true), std::pair("12345", false), std::pair("1a", false)}) {
    setenv("BOCST_ORACLE", value, 1);
    try {
      makeOracle(OracleKind::kAuto);
      ADD_FAILURE() << value;
    } catch (const OracleError& e) {
      EXPECT_EQ(std::string(e.what()).find("not one of") == std::string::npos, is_index) << e.what();
    }
  }
  unsetenv("BOCST_ORACLE");
}

}  // namespace
}  // namespace bocst::oracle
