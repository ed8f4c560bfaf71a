// SPDX-License-Identifier: BSD-3-Clause
// The float tests of a query never part what touches: against points of the volumes and against FCL's triangle test, on
// every instruction set that the dispatch can choose.
#include <fcl/narrowphase/detail/traversal/collision/intersect.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <numeric>
#include <set>

#include "every_target.h"
#include "geometry/overlap_kernels.h"
#include "geometry/triangle.h"
#include "geometry/volume.h"
#include "meshes.h"
#include "oracle/reference.h"
#include "query/collide/tree_steps.h"
#include "query/distance/distance_kernels.h"
#include "query/leaf/large_triangles.h"
#include "query/leaf/unpack.h"
#include "tree/bulk.h"
#include "tree/packed_triangles.h"

namespace bocst::query {
namespace {

using Eigen::Vector3d;
using EveryTarget = test::EveryTarget;

// Random bounds of an octant, and points of the surface that they allow.
bounds::NodeBounds randomBounds(std::mt19937_64& g) {
  bounds::NodeBounds b;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto x = static_cast<std::uint8_t>(g() % 256), y = static_cast<std::uint8_t>(g() % 256);
    b.lo[k] = std::min(x, y);
    b.hi[k] = std::max(x, y);
  }
  if (g() % 4 != 0) {
    const Eigen::Vector3d n = test::randomDirection(g) * 127;
    for (std::size_t k = 0; k < 3; ++k) b.normal[k] = static_cast<std::int8_t>(std::round(n[static_cast<int>(k)]));
    b.slab_center = static_cast<std::int8_t>(static_cast<int>(g() % 81) - 40);
    b.slab_half = static_cast<std::uint8_t>(g() % 80);
  }
  return b;
}

bool randomPoint(std::mt19937_64& g, const bounds::NodeBounds& b, const Eigen::Vector3d& corner, double side,
                 Eigen::Vector3d& p) {
  std::uniform_real_distribution<double> u(0, 1);
  for (int i = 0; i < 20; ++i) {
    double along = 0;
    for (int k = 0; k < 3; ++k) {
      const auto s = static_cast<std::size_t>(k);
      // Extreme points matter most.
      const double f = g() % 3 == 0 ? 0 : g() % 2 ? 1 : u(g);
      const double x = (b.lo[s] + f * (b.hi[s] - b.lo[s])) / 255;
      p[k] = corner[k] + x * side;
      along += b.normal[s] * (x - 0.5);
    }
    if (std::abs(along - b.slab_center) <= b.slab_half / 2.0) return true;
  }
  return false;
}

// The volume in a cell of side 1 at the origin.
Volume decoded(const bounds::NodeBounds& b) {
  Volume v;
  Vector3d n, box_middle;
  for (int k = 0; k < 3; ++k) {
    const auto s = static_cast<std::size_t>(k);
    v.half[k] = static_cast<float>((b.hi[s] - b.lo[s]) / 510.0);
    box_middle[k] = (b.hi[s] + b.lo[s]) / 510.0;
    v.center[k] = box_middle[k];
    n[k] = b.normal[s] / 127.0;
    v.normal[k] = static_cast<float>(n[k]);
  }
  v.slab_offset = static_cast<float>(b.slab_center / 127.0 - n.dot(box_middle - Vector3d::Constant(0.5)));
  v.slab_half = static_cast<float>(b.slab_half / 254.0);
  return v;
}

TEST_P(EveryTarget, NoOctantIsLostThatSharesAPoint) {
  std::mt19937_64 g(2);
  std::uniform_real_distribution<double> u(-1, 1);
  int shared = 0, parted = 0;
  for (int round = 0; round < 20000; ++round) {
    bounds::OctantBounds octants;
    for (int o = 0; o < 8; ++o) octants.set(o, randomBounds(g));
    // A volume of another tree, its own cell at the origin with side 1, placed so that a point of it is a point of
    // ours.
    const bounds::NodeBounds other = randomBounds(g);
    const Volume v = decoded(other);
    SimilarityTransform to;
    to.rotation = test::randomRotation(g);
    to.scale = std::pow(10.0, 3 * u(g));
    const double side = std::pow(10.0, 3 * u(g));
    const Eigen::Vector3d corner = Eigen::Vector3d(u(g), u(g), u(g)) * std::pow(10.0, 4 * u(g));
    const int o = static_cast<int>(g() % 8);
    Eigen::Vector3d mine, theirs;
    const Eigen::Vector3d octant_corner = corner + side * Eigen::Vector3d(o & 1, o >> 1 & 1, o >> 2 & 1);
    if (!randomPoint(g, octants.get(o), octant_corner, side, mine)) continue;
    if (!randomPoint(g, other, Eigen::Vector3d::Zero(), 1, theirs)) continue;
    to.translation = mine - to.scale * (to.rotation * theirs);
    to.tolerance = 1e-13 * corner.norm();
    to.ready();
    ++shared;
    const double at[3] = {corner[0], corner[1], corner[2]};
    const unsigned mask = overlappingOctants(octants, seenFrom(v, to, at, side));
    ASSERT_TRUE(mask >> o & 1) << "round " << round;
    parted += mask != 255;
  }
  EXPECT_GT(shared, 5000);
  EXPECT_GT(parted, shared / 2) << "a test that parts nothing proves nothing";
}

// A box with axes of its own, and points of it: extreme ones matter most.
OrientedVolume randomBox(std::mt19937_64& g) {
  std::uniform_real_distribution<double> u(0, 1);
  OrientedVolume v;
  v.axes = test::randomRotation(g);
  v.center = 3 * u(g) * test::randomDirection(g);
  for (int k = 0; k < 3; ++k) v.half[k] = g() % 4 == 0 ? 0 : u(g);
  return v;
}
Vector3d randomPoint(std::mt19937_64& g, const OrientedVolume& v) {
  std::uniform_real_distribution<double> u(-1, 1);
  Vector3d x;
  for (int k = 0; k < 3; ++k) x[k] = v.half[k] * (g() % 3 == 0 ? u(g) : g() % 2 ? 1 : -1);
  return v.center + v.axes * x;
}

TEST_P(EveryTarget, NoOrientedBoxIsLostThatSharesAPoint) {
  std::mt19937_64 g(21);
  std::uniform_real_distribution<double> u(-1, 1);
  int parted = 0;
  constexpr int kRounds = 20000;
  for (int round = 0; round < kRounds; ++round) {
    OrientedBoxes boxes;
    OrientedVolume volumes[8];
    float size = 0;
    for (int i = 0; i < 8; ++i) {
      volumes[i] = randomBox(g);
      float sum = 0;
      for (int k = 0; k < 3; ++k) {
        boxes.center[k][i] = static_cast<float>(volumes[i].center[k]);
        boxes.half[k][i] = static_cast<float>(volumes[i].half[k]);
        sum += std::abs(boxes.center[k][i]) + boxes.half[k][i];
        for (int j = 0; j < 3; ++j) boxes.axes[j][k][i] = static_cast<float>(volumes[i].axes(k, j));
      }
      size = std::max(size, sum);
    }
    const auto i = static_cast<std::size_t>(g() % 8);
    SimilarityTransform to;
    to.rotation = test::randomRotation(g);
    to.scale = std::pow(10.0, 2 * u(g));
    const double unit = std::pow(10.0, 3 * u(g)), corner[3] = {100 * u(g), 100 * u(g), 100 * u(g)};
    const Vector3d touched = unit * randomPoint(g, volumes[i]) + Vector3d(corner[0], corner[1], corner[2]);
    OneVolume seen;
    OrientedVolume other = randomBox(g);
    PlacedVolume placed_other;
    // Volumes with a slab, with axes of their own, and the latter once placed are seen alike.
    if (round % 3 == 0) {
      const bounds::NodeBounds b = randomBounds(g);
      const Volume v = decoded(b);
      Vector3d point;
      if (!randomPoint(g, b, Vector3d::Zero(), 1, point)) continue;
      to.translation = touched - to.scale * (to.rotation * point);
      to.tolerance = 1e-13 * (touched.norm() + to.translation.norm());
      to.ready();
      seen = seenFrom(v, to, corner, unit);
    } else {
      to.translation = touched - to.scale * (to.rotation * randomPoint(g, other));
      to.tolerance = 1e-13 * (touched.norm() + to.translation.norm());
      to.ready();
      placed_other = placed(other, to);
      seen = round % 3 == 1 ? seenFrom(other, to, corner, unit) : seenFrom(placed_other, to, corner, unit);
    }
    seen.rounding_margin += size * to.rounding_margin;
    const unsigned mask = overlappingBoxes(boxes, seen);
    ASSERT_TRUE(mask >> i & 1) << "round " << round;
    parted += mask != 255;
  }
  EXPECT_GT(parted, kRounds / 2) << "a test that parts nothing proves nothing";
}

TEST(BoxAbout, HoldsATriangleAndNoMore) {
  std::mt19937_64 g(22);
  std::uniform_real_distribution<double> u(-1, 1);
  for (int round = 0; round < 20000; ++round) {
    const double size = std::pow(10.0, 6 * u(g)), away = round % 2 ? 0 : 1e3 * size;
    Corners c;
    for (Vector3d& corner : c) corner = size * Vector3d(u(g), u(g), u(g)) + away * Vector3d(1, -0.7, 0.3);
    if (round % 5 == 1) c[2] = c[0];
    if (round % 5 == 2) c[2] = c[0] + u(g) * (c[1] - c[0]);
    if (round % 50 == 3) c[1] = c[2] = c[0];
    const OrientedVolume box = boxAbout(c);
    ASSERT_LT((box.axes.transpose() * box.axes - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff(), 1e-14) << round;
    const double rounding = 1e-13 * (size + away);
    for (const Vector3d& corner : c) {
      const Vector3d x = box.axes.transpose() * (corner - box.center);
      ASSERT_LE((x.cwiseAbs() - box.half).maxCoeff(), 0) << round;
    }
    // As thin as the triangle is flat, and no larger than twice the triangle in its plane.
    ASSERT_LT(box.half[2], 10 * rounding + 1e-6 * size) << round;
    const double area = (c[1] - c[0]).cross(c[2] - c[0]).norm();
    ASSERT_LE(4 * box.half[0] * box.half[1], area * (1 + 1e-5) + 1e-5 * size * size + 40 * size * rounding) << round;
  }
}

TEST_P(EveryTarget, NoOctantIsLostThatSharesAPointInFramesOfTheRoots) {
  std::mt19937_64 g(12);
  std::uniform_real_distribution<double> u(-1, 1);
  int shared = 0, parted = 0;
  for (int round = 0; round < 60000; ++round) {
    // Two cells at any depth of two trees, placed so that a point of an octant of one is one of an octant of the other.
    CellOctants cells[2];
    Eigen::Vector3d points[2];
    int octants[2];
    bool found = true;
    for (int side = 0; side < 2 && found; ++side) {
      CellOctants& c = cells[side];
      c.cell.level = 1 + static_cast<int>(g() % 14);
      for (auto& x : c.cell.at) x = static_cast<std::uint32_t>(g() % (1u << (c.cell.level - 1)));
      for (int o = 0; o < 8; ++o) c.octants.set(o, randomBounds(g));
      octants[side] = static_cast<int>(g() % 8);
      const lattice::Cell octant = c.cell.octant(octants[side]);
      const auto corner = octant.corner();
      found = randomPoint(g, c.octants.get(octants[side]), Eigen::Vector3d(corner[0], corner[1], corner[2]),
                          octant.side(), points[side]);
    }
    if (!found) continue;
    SimilarityTransform to;
    to.rotation = test::randomRotation(g);
    to.scale = std::pow(2.0, 10 * u(g));
    if (round % 3 == 0) {
      // The middles of the roots coincide, so that only sizes are left to round.
      const Eigen::Vector3d middle = Eigen::Vector3d::Constant(lattice::kMiddle);
      const Eigen::Vector3d v = points[0] - middle, w = points[1] - middle;
      const double scale = v.norm() / w.norm();
      if (PairFrames::fits(scale)) {
        to.scale = scale;
        to.rotation = test::turnOnto(w, v) * Eigen::AngleAxisd(3 * u(g), w.normalized()).toRotationMatrix();
      }
    }
    if (round % 8 == 1) {
      to.rotation += 1e-4 * Eigen::Matrix3d::NullaryExpr([&] { return u(g); });
      to.orthogonality_error =
          (to.rotation.transpose() * to.rotation - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
    }
    to.translation = points[0] - to.scale * (to.rotation * points[1]);
    if (round % 8 == 5) {
      to.tolerance = std::pow(10.0, 3 * u(g));
      to.translation += 0.999 * to.tolerance * test::randomDirection(g);
    }
    to.ready();
    ASSERT_TRUE(PairFrames::fits(to.scale));
    const PairFrames frames(to);
    ++shared;
    for (int own = 0; own < 2; ++own) {
      const unsigned mask = overlappingOctants(frames, own, cells[own], cells[1 - own], octants[1 - own]);
      ASSERT_TRUE(mask >> octants[own] & 1) << "round " << round << " side " << own;
      parted += mask != 255;
    }
  }
  EXPECT_GT(shared, 5000);
  EXPECT_GT(parted, shared) << "a test that parts nothing proves nothing";
}

void put(TrianglePack& pack, std::size_t i, const Corners& t) {
  for (std::size_t k = 0; k < 3; ++k) {
    for (std::size_t c = 0; c < 3; ++c) {
      const auto f = static_cast<float>(t[k][static_cast<int>(c)]);
      pack.xyz[3 * k + c][i] = f;
      pack.size = std::max(pack.size, std::abs(f));
    }
  }
}

// Makes one triangle in `often` a sliver, and half and a quarter as many a segment and a point.
template <typename Triangle>
void degenerateAtTimes(std::mt19937_64& g, Triangle& t, unsigned often) {
  if (g() % often == 0) t[2] = t[1] + 1e-9 * (t[2] - t[1]);
  if (g() % (2 * often) == 0) t[1] = t[0];
  if (g() % (4 * often) == 0) t[1] = t[2] = t[0];
}

// Three corners of a triangle with `point` at a corner, on an edge or inside.
void aroundPoint(std::mt19937_64& g, const Eigen::Vector3d& point, double size, Corners& t) {
  std::uniform_real_distribution<double> u(-1, 1);
  for (auto& v : t) v = size * Eigen::Vector3d(u(g), u(g), u(g));
  if (g() % 3 == 0) {
    // Along an axis of the octants, as floors and walls are.
    const auto axis = static_cast<int>(g() % 3);
    for (auto& v : t) v[axis] = t[0][axis];
  }
  degenerateAtTimes(g, t, 8);
  const double a = g() % 3 == 0 ? 0 : std::abs(u(g)), b = g() % 3 == 0 ? 0 : (1 - a) * std::abs(u(g));
  const Eigen::Vector3d at = t[0] + a * (t[1] - t[0]) + b * (t[2] - t[0]);
  for (auto& v : t) v += point - at;
}

TEST_P(EveryTarget, NoTriangleIsLostThatMeetsAnOctant) {
  std::mt19937_64 g(36);
  std::uniform_real_distribution<double> u(-1, 1);
  constexpr double kMiddle = LargeTriangles::kMiddle;
  std::size_t others = 0, seen = 0, needless = 0;
  for (int round = 0; round < 4000; ++round) {
    CellOctants c;
    c.cell.level = 1 + static_cast<int>(g() % 14);
    for (auto& x : c.cell.at) x = static_cast<std::uint32_t>(g() % (1u << (c.cell.level - 1)));
    for (int o = 0; o < 8; ++o) c.octants.set(o, randomBounds(g));
    c.octants.set(0, bounds::NodeBounds());  // one has points for sure
    const int own = static_cast<int>(g() % 2);
    SimilarityTransform to;
    to.rotation = test::randomRotation(g);
    to.scale = std::pow(2.0, 10 * u(g));
    to.translation = Eigen::Vector3d(u(g), u(g), u(g)) * kMiddle;
    to.ready();
    const PairFrames frames(to);
    const auto unit = static_cast<double>(frames.side[own].unit);
    // Triangles through a point of an octant.
    const std::size_t count = 1 + g() % LargeTriangles::kCapacity;
    std::vector<int> octant;
    std::vector<std::array<Eigen::Vector3d, 3>> corners;
    while (corners.size() < count) {
      const int o = static_cast<int>(g() % 8);
      const lattice::Cell cell = c.cell.octant(o);
      const auto corner = cell.corner();
      Eigen::Vector3d point;
      const Eigen::Vector3d at(corner[0], corner[1], corner[2]);
      if (!randomPoint(g, c.octants.get(o), at, cell.side(), point)) continue;
      Corners t;
      aroundPoint(g, point, cell.side() * std::pow(10.0, 1.5 + 3 * u(g)), t);
      corners.push_back({t[0], t[1], t[2]});
      octant.push_back(o);
    }
    RawTriangles raw, placed;
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t k = 0; k < 3; ++k) {
        for (std::size_t x = 0; x < 3; ++x) raw.xyz[3 * k + x][i] = corners[i][k][static_cast<int>(x)];
      }
    }
    const PackTransform place = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {-kMiddle, -kMiddle, -kMiddle}};
    TrianglePack pack;
    placeTriangles(raw, count, place, pack);
    const std::uint32_t all = ~0u >> (32 - count), first = all & static_cast<std::uint32_t>(g());
    TriangleBounds bounds;
    boundTriangles(raw, first, place, unit, 2 * kMiddle * unit, placed, bounds);
    boundTriangles(raw, all & ~first, place, unit, 2 * kMiddle * unit, placed, bounds);
    std::uint32_t found[8];
    octantsMeeting(frames, own, c, bounds, count, found);
    for (std::size_t i = 0; i < count; ++i) {
      for (int o = 0; o < 8; ++o) {
        const bool is_met = found[o] >> i & 1;
        if (o == octant[i]) {
          ASSERT_TRUE(is_met) << "round " << round << " octant " << o;
          continue;
        }
        // The whole octant, by the reference of the oracle: what it says is free may not be found too often.
        const lattice::Cell cell = c.cell.octant(o);
        const bool free = !oracle::triangleMeetsCube(corners[i].data(), oracle::centerOf(cell), cell.side() / 2.0 + 2);
        ++others;
        seen += free;
        needless += free && is_met;
      }
    }
    if (count < 32) {
      for (const std::uint32_t f : found) ASSERT_EQ(f >> count, 0u);
    }
  }
  EXPECT_GT(seen, others / 10);
  EXPECT_LT(needless, seen / 10) << "a test that lets everything through proves nothing";
}

PackRegion everywhere() {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  return {{-kInfinity, -kInfinity, -kInfinity}, {kInfinity, kInfinity, kInfinity}, {0, 0, 0}, -kInfinity, kInfinity};
}

void takeCorners(const TrianglePack& pack, std::size_t i, Corners& t) {
  for (std::size_t k = 0; k < 9; ++k) t[k / 3][static_cast<int>(k % 3)] = static_cast<double>(pack.xyz[k][i]);
}

// How many pairs had a bound, and how many a close one.
struct BoundedPairs {
  std::size_t all = 0, close = 0;
};

// Where pairs clearly cut each other, their bounds along a direction hold, and none is left out that begins before the
// cut.
void expectBoundsAlong(std::mt19937_64& g, const TrianglePack& rows, const TrianglePack& lanes, float tolerance,
                       const PackSlabs* slabs, BoundedPairs& bounded) {
  const Eigen::Vector3f along = test::randomDirection(g).cast<float>() * static_cast<float>(1 + g() % 3);
  const Eigen::Vector3d direction = along.cast<double>();
  const auto size = static_cast<double>(std::max(rows.size, lanes.size));
  const double computed = 1e-9 * size * direction.norm();  // what the reference may be off by
  const auto ask = [&](float most, PackPair* found) {
    const PackCut cut = {{along[0], along[1], along[2]}, most};
    return touchingPairs(rows, ~0u >> (32 - rows.count), lanes, everywhere(), tolerance, 0, false, found, slabs, &cut);
  };
  PackPair found[TrianglePack::kCapacity * TrianglePack::kCapacity];
  const std::size_t count = ask(std::numeric_limits<float>::infinity(), found);
  std::map<std::pair<int, int>, double> begins;
  for (std::size_t k = 0; k < count; ++k) {
    Corners p, q;
    takeCorners(rows, found[k].row, p);
    takeCorners(lanes, found[k].lane, q);
    const auto begin = nearEndOfCut(p, q, direction, 1e-9 * size);
    if (!begin.has_value()) continue;
    const auto least = static_cast<double>(found[k].least);
    ASSERT_LE(least, *begin + computed);
    ++bounded.all;
    bounded.close += least > *begin - 1e-3 * size;
    begins[{found[k].row, found[k].lane}] = *begin;
  }
  if (begins.empty()) return;
  const auto most = static_cast<float>(std::next(begins.begin(), static_cast<int>(g() % begins.size()))->second);
  const std::size_t fewer = ask(most, found);
  for (std::size_t k = 0; k < fewer; ++k) begins.erase({found[k].row, found[k].lane});
  for (const auto& left_out : begins) {
    ASSERT_GT(left_out.second, static_cast<double>(most) - 1e-6 * static_cast<double>(std::abs(most)) - computed);
  }
}

TEST_P(EveryTarget, NoPairIsLostThatFclFinds) {
  std::mt19937_64 g(3);
  std::uniform_real_distribution<double> u(-1, 1);
  std::uint64_t hits = 0, candidates = 0, pairs = 0, certain = 0;
  BoundedPairs bounded;
  for (int round = 0; round < 400; ++round) {
    const double scale = std::pow(10.0, 6 * u(g));
    TrianglePack a, b;
    a.count = 1 + g() % 32;
    b.count = 1 + g() % 32;
    std::vector<std::array<Eigen::Vector3d, 3>> ta(a.count), tb(b.count);
    const auto make = [&](std::array<Eigen::Vector3d, 3>& t) {
      const Eigen::Vector3d c(u(g), u(g), u(g));
      const double size = std::pow(10.0, u(g));
      for (auto& v : t) v = (c + size * Eigen::Vector3d(u(g), u(g), u(g))) * scale;
      degenerateAtTimes(g, t, 8);
    };
    for (std::size_t i = 0; i < a.count; ++i) {
      make(ta[i]);
      Corners t = {ta[i][0], ta[i][1], ta[i][2]};
      put(a, i, t);
    }
    for (std::size_t i = 0; i < b.count; ++i) {
      make(tb[i]);
      // Touches a triangle of the other side exactly: by a corner, or moved onto its plane.
      if (g() % 2) {
        const auto& other = ta[g() % a.count];
        const double s = std::abs(u(g)), t = (1 - s) * std::abs(u(g));
        const Eigen::Vector3d p =
            g() % 2 ? other[g() % 3]
                    : Eigen::Vector3d(other[0] + s * (other[1] - other[0]) + t * (other[2] - other[0]));
        const Eigen::Vector3d d = p - tb[i][g() % 3];
        for (auto& v : tb[i]) v += d;
      }
      Corners t = {tb[i][0], tb[i][1], tb[i][2]};
      put(b, i, t);
    }
    PackPair found[TrianglePack::kCapacity * TrianglePack::kCapacity];
    const std::size_t count = touchingPairs(a, ~0u >> (32 - a.count), b, everywhere(), 0, 0, false, found);
    std::map<std::pair<int, int>, bool> set;
    for (std::size_t k = 0; k < count; ++k) set[{found[k].row, found[k].lane}] = found[k].certain;
    ASSERT_EQ(set.size(), count);
    candidates += count;
    ASSERT_NO_FATAL_FAILURE(expectBoundsAlong(g, a, b, 0, nullptr, bounded)) << "round " << round;
    // Where one pair will do, a certain one if there is any, else the same as before.
    PackPair one[TrianglePack::kCapacity * TrianglePack::kCapacity];
    const std::size_t fewer = touchingPairs(a, ~0u >> (32 - a.count), b, everywhere(), 0, 0, true, one);
    if (std::any_of(set.begin(), set.end(), [](const auto& pair) { return pair.second; })) {
      ASSERT_EQ(fewer, 1u) << "round " << round;
      ASSERT_TRUE(one[0].certain) << "round " << round;
    } else {
      ASSERT_EQ(fewer, count) << "round " << round;
    }
    for (std::size_t k = 0; k < fewer; ++k) {
      const auto at = set.find({one[k].row, one[k].lane});
      ASSERT_TRUE(at != set.end() && at->second == one[k].certain) << "round " << round;
    }
    for (std::size_t i = 0; i < a.count; ++i) {
      for (std::size_t j = 0; j < b.count; ++j) {
        ++pairs;
        const Corners p = {ta[i][0], ta[i][1], ta[i][2]}, q = {tb[j][0], tb[j][1], tb[j][2]};
        const auto at = set.find({static_cast<int>(i), static_cast<int>(j)});
        const bool is_certain = at != set.end() && at->second;
        certain += is_certain;
        if (isDegenerate(p) || isDegenerate(q)) {
          ASSERT_FALSE(is_certain) << "round " << round;
          Eigen::Vector3d on_p, on_q;
          if (nearestPoints(p, q, on_p, on_q) > 1e-13 * scale) continue;
        } else if (!fcl::detail::Intersect<double>::intersect_Triangle(p[0], p[1], p[2], q[0], q[1], q[2])) {
          ASSERT_FALSE(is_certain) << "round " << round;
          continue;
        }
        ++hits;
        ASSERT_TRUE(at != set.end()) << "round " << round;
      }
    }
  }
  EXPECT_GT(hits, 3000u);
  EXPECT_GT(bounded.all, 1000u);
  EXPECT_GT(bounded.close, bounded.all / 2);
  EXPECT_LT(candidates, hits + pairs / 25) << "a filter that lets everything through proves nothing";
  EXPECT_GT(certain, hits / 2) << "what is never certain is never wrong";
}

// Two triangles that touch, all but touch or just part, each in its own frame, as LeafPairs makes packs of them.
template <typename S>
void certainMeansThatFclSaysSo() {
  std::mt19937_64 g(33);
  std::uniform_real_distribution<double> u(-1, 1);
  using Exact = fcl::detail::Intersect<S>;
  int certain = 0, met = 0, apart = 0, deep = 0, wide = 0;
  for (int round = 0; round < 60000; ++round) {
    const double size = std::pow(10.0, u(g)), far = std::pow(10.0, 4 * std::abs(u(g)));
    fcl::Vector3<S> p[3], q[3];
    const Eigen::Vector3d at = far * Eigen::Vector3d(u(g), u(g), u(g));
    Corners t;
    for (auto& v : t) v = at + size * Eigen::Vector3d(u(g), u(g), u(g));
    degenerateAtTimes(g, t, 16);
    for (int k = 0; k < 3; ++k) p[k] = t[k].cast<S>();
    for (auto& v : t) v = size * Eigen::Vector3d(u(g), u(g), u(g));
    degenerateAtTimes(g, t, 16);
    for (int k = 0; k < 3; ++k) q[k] = t[k].cast<S>();
    // A corner, a point of an edge or one of the inside of both at one place, but for a gap.
    const auto pointOf = [&](const fcl::Vector3<S>(&c)[3]) {
      const double a = g() % 3 == 0 ? 0 : std::abs(u(g)), b = g() % 3 == 0 ? 0 : (1 - a) * std::abs(u(g));
      const int k = static_cast<int>(g() % 3);
      const Eigen::Vector3d x = c[k].template cast<double>(), y = c[(k + 1) % 3].template cast<double>(),
                            z = c[(k + 2) % 3].template cast<double>();
      return Eigen::Vector3d(x + a * (y - x) + b * (z - x));
    };
    const fcl::Matrix3<S> R = test::randomRotation(g).cast<S>();
    // Packs are about the middles of leaves, which are larger, now and then far larger, than the triangle.
    const double away = round % 3 == 0 ? size * std::pow(10.0, 5 * std::abs(u(g))) : 0;
    const Eigen::Vector3d gap =
        test::randomDirection(g) * (g() % 2 == 0 && away > 0 ? 2e-5 * away : size * std::pow(10.0, -8 + 8 * u(g)));
    const fcl::Vector3<S> T = (pointOf(p) + gap - R.template cast<double>() * pointOf(q)).template cast<S>();
    if (round % 8 == 0) {
      // An edge along one of the other.
      q[1] = q[0] + R.transpose() * (p[1] - p[0]) * static_cast<S>(1 + u(g));
    }
    const double magnitude = T.template cast<double>().norm() + 2 * (far + 2 * size);
    SimilarityTransform to;
    to.rotation = R.template cast<double>();
    to.translation = T.template cast<double>();
    Corners pd, qd;
    Eigen::Vector3d middle_p = Eigen::Vector3d::Zero(), middle_q = middle_p;
    for (int k = 0; k < 3; ++k) {
      pd[k] = p[k].template cast<double>();
      qd[k] = q[k].template cast<double>();
      middle_p += pd[k] / 3;
      middle_q += qd[k] / 3;
    }
    TrianglePack a, b, moved;
    a.count = b.count = 1;
    middle_p += away * test::randomDirection(g);
    middle_q += away * test::randomDirection(g);
    for (auto& v : pd) v -= middle_p;
    for (auto& v : qd) v -= middle_q;
    put(a, 0, pd);
    put(b, 0, qd);
    PackMotion motion;
    const Eigen::Vector3d offset = to * middle_q - middle_p;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) motion.linear[r][c] = static_cast<float>(to.rotation(r, c));
      motion.offset[r] = static_cast<float>(offset[r]);
    }
    moveTriangles(b, 1, motion, moved);
    const auto tolerance = static_cast<float>(magnitude * 32 * static_cast<double>(std::numeric_limits<S>::epsilon()));
    PackPair found[1];
    const std::size_t count = touchingPairs(a, 1, moved, everywhere(), tolerance, 0, false, found);
    const bool meet = Exact::intersect_Triangle(p[0], p[1], p[2], q[0], q[1], q[2], R, T);
    const bool degenerate = isDegenerate(pd) || isDegenerate(qd);
    if (count == 1 && found[0].certain) {
      ASSERT_TRUE(meet && !degenerate) << "round " << round;
      ++certain;
    }
    if (meet && !degenerate) {
      ASSERT_EQ(count, 1u) << "round " << round;
    }
    met += meet;
    apart += !meet;

    TrianglePairs pair;
    ContactPoint touch;
    for (int k = 0; k < 3; ++k) {
      pd[k] = p[k].template cast<double>();
      qd[k] = to * q[k].template cast<double>().eval();
    }
    pair.put(0, pd, qd);
    pair.count = 1;
    const PenetrationVerdicts parted = trianglePenetrations(pair, static_cast<double>(tolerance), &touch);
    if (parted.meet != 0) {
      ASSERT_TRUE(meet) << "round " << round;
    }
    if (parted.apart != 0) {
      ASSERT_TRUE(!meet || degenerate) << "round " << round;
    }
    deep += parted.meet == 1;
    wide += parted.apart == 1;
  }
  EXPECT_GT(apart, 5000);
  EXPECT_GT(certain, met / 10);
  EXPECT_GT(deep, met / 4);
  EXPECT_GT(wide, apart / 4);
}

TEST_P(EveryTarget, CertainMeansThatFclSaysSo) {
  certainMeansThatFclSaysSo<double>();
  certainMeansThatFclSaysSo<float>();
}

// A triangle without area has no plane, so only edges part it from another that its line's plane cuts.
TEST_P(EveryTarget, TrianglesWithoutAreaArePartedByEdges) {
  std::mt19937_64 g(37);
  std::uniform_real_distribution<double> u(-1, 1);
  const auto vector = [&] { return Eigen::Vector3d(u(g), u(g), u(g)); };
  int apart = 0;
  for (int round = 0; round < 20000; ++round) {
    Corners p, q;
    for (auto& v : p) v = vector();
    for (auto& v : q) v = vector();
    q[2] = q[0] + std::abs(u(g)) * (q[1] - q[0]);
    const double distance = 1e-3;
    if (!areApart(p, q, distance)) continue;
    ++apart;
    TrianglePack a, b;
    a.count = b.count = 1;
    put(a, 0, p);
    put(b, 0, q);
    PackPair found[1];
    ASSERT_EQ(touchingPairs(a, 1, b, everywhere(), 0, 0, false, found), 0u) << round;
    ASSERT_EQ(touchingPairs(b, 1, a, everywhere(), 0, 0, false, found), 0u) << round;
  }
  EXPECT_GT(apart, 10000);
}

// Large triangles, which are placed in double, beside small ones, often in touch with them: what FCL finds is found,
// and what is certain FCL finds.
template <typename S>
void noPairIsLostBesideLargeTriangles() {
  using Exact = fcl::detail::Intersect<S>;
  std::mt19937_64 g(39);
  std::uniform_real_distribution<double> u(-1, 1);
  const auto vector = [&] { return Eigen::Vector3d(u(g), u(g), u(g)); };
  const auto rounded = [](const Eigen::Vector3d& v) -> Eigen::Vector3d {
    return v.template cast<S>().template cast<double>();
  };
  const PackTransform identity = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {0, 0, 0}};
  std::size_t pairs = 0, met = 0, certain = 0, found_free = 0, free = 0;
  BoundedPairs bounded;
  for (int round = 0; round < 1500; ++round) {
    const double scale = std::pow(10.0, 3 * u(g)), large_size = std::pow(10.0, 3 * std::abs(u(g)));
    TrianglePack small;
    small.count = 1 + g() % TrianglePack::kCapacity;
    const std::size_t large = 1 + g() % TrianglePack::kCapacity;
    const Eigen::Vector3d middle = scale * large_size * vector();
    std::vector<Corners> p(large), q(small.count);
    for (std::size_t i = 0; i < small.count; ++i) {
      const Eigen::Vector3d at = vector();
      for (auto& v : q[i]) v = rounded(scale * (at + 0.3 * vector()));
      degenerateAtTimes(g, q[i], 8);
      put(small, i, q[i]);
    }
    RawTriangles raw{}, placed{};
    for (std::size_t i = 0; i < large; ++i) {
      for (auto& v : p[i]) v = scale * large_size * vector();
      degenerateAtTimes(g, p[i], 6);
      if (g() % 3 == 0) p[i][2] = p[i][1] + std::pow(10.0, -6 * std::abs(u(g))) * (p[i][2] - p[i][1]);
      // Through a point of a small one, or close to it.
      const Corners& other = q[g() % small.count];
      const double a = std::abs(u(g)), b = (1 - a) * std::abs(u(g));
      const Eigen::Vector3d on =
          g() % 3 == 0 ? other[g() % 3]
                       : Eigen::Vector3d(other[0] + a * (other[1] - other[0]) + b * (other[2] - other[0]));
      const double c = std::abs(u(g)), e = (1 - c) * std::abs(u(g));
      const Eigen::Vector3d through = p[i][0] + c * (p[i][1] - p[i][0]) + e * (p[i][2] - p[i][0]);
      const Eigen::Vector3d off = g() % 2 == 0
                                      ? Eigen::Vector3d::Zero()
                                      : Eigen::Vector3d(scale * std::pow(10.0, -6 * std::abs(u(g))) * vector());
      for (auto& v : p[i]) v = rounded(v + on - through + off);
      for (std::size_t k = 0; k < 3; ++k) {
        for (std::size_t x = 0; x < 3; ++x) {
          raw.xyz[3 * k + x][i] = p[i][static_cast<int>(k)][static_cast<int>(x)] + middle[static_cast<int>(x)];
        }
      }
    }
    const std::uint32_t all = ~0u >> (32 - large), which = g() % 2 == 0 ? all : all & static_cast<std::uint32_t>(g());
    TriangleBounds bounds;
    boundTriangles(raw, all, identity, 1 / scale, 1e6, placed, bounds);
    TrianglePack rows;
    PackSlabs slabs;
    takeRows(placed, bounds, which, {middle[0], middle[1], middle[2]}, rows, slabs);
    std::vector<std::size_t> taken;
    for (std::size_t i = 0; i < large; ++i) {
      if (which >> i & 1) taken.push_back(i);
    }
    ASSERT_EQ(rows.count, taken.size());
    if (taken.empty()) continue;
    // What adding the middle rounds, and what FCL's test does.
    const double magnitude = 4 * scale * large_size + 2 * scale;
    const auto tolerance = static_cast<float>(magnitude * 32 * static_cast<double>(std::numeric_limits<S>::epsilon()));
    PackPair found[TrianglePack::kCapacity * TrianglePack::kCapacity];
    const std::size_t count =
        touchingPairs(rows, ~0u >> (32 - rows.count), small, everywhere(), tolerance, 0, false, found, &slabs);
    std::map<std::pair<std::size_t, std::size_t>, bool> set;
    for (std::size_t k = 0; k < count; ++k) set[{found[k].row, found[k].lane}] = found[k].certain;
    ASSERT_EQ(set.size(), count);
    ASSERT_NO_FATAL_FAILURE(expectBoundsAlong(g, rows, small, tolerance, &slabs, bounded)) << "round " << round;
    for (std::size_t r = 0; r < rows.count; ++r) {
      for (std::size_t j = 0; j < small.count; ++j) {
        const Corners &a = p[taken[r]], &b = q[j];
        const auto at = set.find({r, j});
        const bool is_found = at != set.end(), is_certain = is_found && at->second;
        ++pairs;
        certain += is_certain;
        if (isDegenerate(a) || isDegenerate(b)) {
          ASSERT_FALSE(is_certain) << "round " << round;
          Eigen::Vector3d on_a, on_b;
          const double distance = nearestPoints(a, b, on_a, on_b);
          if (distance <= static_cast<double>(tolerance) / 2) {
            ASSERT_TRUE(is_found) << "round " << round;
          }
          free += distance > 1e-3 * scale;
          found_free += distance > 1e-3 * scale && is_found;
          continue;
        }
        using Vector = fcl::Vector3<S>;
        const auto s = [](const Eigen::Vector3d& v) -> Vector { return v.template cast<S>(); };
        const bool meet = Exact::intersect_Triangle(s(a[0]), s(a[1]), s(a[2]), s(b[0]), s(b[1]), s(b[2]));
        met += meet;
        if (is_certain) {
          ASSERT_TRUE(meet) << "round " << round;
        }
        if (meet) {
          ASSERT_TRUE(is_found) << "round " << round;
        }
      }
    }
  }
  EXPECT_GT(pairs, 100000u);
  EXPECT_GT(met, 5000u);
  EXPECT_GT(certain, met / 6);
  EXPECT_LT(found_free, free / 20) << "a test that lets everything through proves nothing";
  EXPECT_GT(bounded.all, 1000u);
  EXPECT_GT(bounded.close, bounded.all / 2);
}

TEST_P(EveryTarget, NoPairIsLostBesideLargeTriangles) {
  noPairIsLostBesideLargeTriangles<double>();
  noPairIsLostBesideLargeTriangles<float>();
}

// With a margin, a pair is found where its distance is no longer, and certain only there.
TEST_P(EveryTarget, PairsWithinAMarginAreFound) {
  std::mt19937_64 g(38);
  std::uniform_real_distribution<double> u(-1, 1);
  const auto vector = [&] { return Eigen::Vector3d(u(g), u(g), u(g)); };
  int certain = 0, within = 0, left_out = 0;
  for (int round = 0; round < 30000; ++round) {
    const double size = std::pow(10.0, 3 * u(g));
    Corners p, q;
    const Eigen::Vector3d way = 2 * vector();
    for (auto& v : p) v = size * vector();
    for (auto& v : q) v = size * (way + vector());
    degenerateAtTimes(g, p, 8);
    degenerateAtTimes(g, q, 8);
    for (Corners* t : {&p, &q}) {
      for (auto& v : *t) v = v.cast<float>().cast<double>();
    }
    Eigen::Vector3d on_p, on_q;
    const double distance = nearestPoints(p, q, on_p, on_q);
    // Often by a hair to either side of the distance.
    const double margin =
        round % 2 ? distance * (1 + std::pow(10.0, -3 + 2 * u(g)) * (g() % 2 ? 1 : -1)) : size * std::abs(u(g));
    TrianglePack a, b;
    a.count = b.count = 1;
    put(a, 0, p);
    put(b, 0, q);
    PackPair found[1];
    const std::size_t count = touchingPairs(a, 1, b, everywhere(), static_cast<float>(margin * 1.001),
                                            static_cast<float>(margin * 0.9999), false, found);
    if (distance <= margin) {
      ASSERT_EQ(count, 1u) << round;
    }
    if (count == 1 && found[0].certain) {
      ASSERT_LE(distance, margin) << round;
      ++certain;
    }
    within += distance <= margin;
    left_out += count == 0;
  }
  EXPECT_GT(certain, 3000);
  EXPECT_GT(within, certain);
  EXPECT_GT(left_out, 8000);
}

TEST_P(EveryTarget, NoTriangleIsLostThatReachesIntoARegion) {
  std::mt19937_64 g(34);
  std::uniform_real_distribution<double> u(-1, 1);
  std::size_t within = 0, lost = 0;
  for (int round = 0; round < 3000; ++round) {
    const double scale = std::pow(10.0, 6 * u(g));
    TrianglePack pack;
    pack.count = 1 + g() % TrianglePack::kCapacity;
    std::vector<Eigen::Vector3d> points;  // one of each triangle, as given
    for (std::size_t i = 0; i < pack.count; ++i) {
      Corners t;
      const Eigen::Vector3d c(u(g), u(g), u(g));
      for (auto& v : t) v = (c + 0.3 * Eigen::Vector3d(u(g), u(g), u(g))) * scale;
      degenerateAtTimes(g, t, 8);
      put(pack, i, t);
      // Corners are what touches a region first.
      points.push_back(g() % 2 ? t[g() % 3] : Eigen::Vector3d((t[0] + t[1] + t[2]) / 3));
    }
    // A box and a slab about the point of one triangle, which may lie on their ends.
    const Eigen::Vector3d x = points[g() % pack.count], n = test::randomDirection(g);
    const double size = pack.size, rounding_margin = 32 * 0x1p-24 * size;
    PackRegion region;
    const auto bound = [&](double at, int sign) {
      return static_cast<float>(at + sign * ((g() % 2 ? 0 : std::abs(u(g)) * 0.5 * scale) + rounding_margin));
    };
    for (int k = 0; k < 3; ++k) {
      region.low[k] = bound(x[k], -1);
      region.high[k] = bound(x[k], 1);
      region.normal[k] = static_cast<float>(n[k]);
    }
    region.slab_low = bound(n.dot(x), -1);
    region.slab_high = bound(n.dot(x), 1);
    const std::uint32_t mask = trianglesWithin(pack, region);
    for (std::size_t i = 0; i < pack.count; ++i) {
      bool in = n.dot(points[i]) >= region.slab_low + rounding_margin &&
                n.dot(points[i]) <= region.slab_high - rounding_margin;
      for (int k = 0; k < 3; ++k) {
        in = in && points[i][k] >= region.low[k] + rounding_margin && points[i][k] <= region.high[k] - rounding_margin;
      }
      in = in || points[i] == x;
      if (in) {
        ASSERT_TRUE(mask >> i & 1) << "round " << round;
      }
      within += in;
      lost += !(mask >> i & 1);
    }
    ASSERT_EQ(static_cast<std::uint64_t>(mask) >> pack.count, 0u);
  }
  EXPECT_GT(within, 3000u);
  EXPECT_GT(lost, within) << "a test that leaves nothing out proves nothing";
}

TEST_P(EveryTarget, MovedTrianglesAreWhereTheyBelong) {
  std::mt19937_64 g(35);
  std::uniform_real_distribution<double> u(-1, 1);
  for (int round = 0; round < 3000; ++round) {
    const double scale = std::pow(10.0, 4 * u(g));
    TrianglePack pack, moved;
    pack.count = 1 + g() % TrianglePack::kCapacity;
    std::vector<std::array<Eigen::Vector3d, 3>> given(pack.count);
    for (std::size_t i = 0; i < pack.count; ++i) {
      for (auto& v : given[i]) v = scale * Eigen::Vector3d(u(g), u(g), u(g));
      put(pack, i, {given[i][0], given[i][1], given[i][2]});
    }
    const Eigen::Matrix3d linear = test::randomRotation(g) * std::pow(10.0, 2 * u(g));
    const Eigen::Vector3d offset = Eigen::Vector3d(u(g), u(g), u(g)) * std::pow(10.0, 4 * u(g));
    PackMotion motion;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) motion.linear[r][c] = static_cast<float>(linear(r, c));
      motion.offset[r] = static_cast<float>(offset[r]);
    }
    const auto which = static_cast<std::uint32_t>(g() & (~0u >> (32 - pack.count)));
    moveTriangles(pack, which, motion, moved);
    std::size_t at = 0;
    for (std::size_t i = 0; i < pack.count; ++i) {
      if (!(which >> i & 1)) continue;
      ASSERT_LT(at, moved.count);
      for (std::size_t k = 0; k < 3; ++k) {
        const Eigen::Vector3d x = linear * given[i][k] + offset;
        for (std::size_t c = 0; c < 3; ++c) {
          const double y = x[static_cast<int>(c)];
          ASSERT_NEAR(static_cast<double>(moved.xyz[3 * k + c][at]), y, 6 * 0x1p-24 * moved.size) << "round " << round;
          ASSERT_LE(std::abs(y), static_cast<double>(moved.size) * (1 + 1e-6));
        }
      }
      ++at;
    }
    ASSERT_EQ(at, moved.count);
  }
}

TEST_P(EveryTarget, PackedCornersAreWhereTheMeshHasThem) {
  std::mt19937_64 g(36);
  std::uniform_real_distribution<double> u(-1, 1);
  int too_small = 0;
  for (int round = 0; round < 300; ++round) {
    // A few triangles of a mesh that may be far larger than they are, and may be points.
    test::Raw raw;
    const double size = std::pow(10.0, 3 * u(g)), part = round % 10 == 0 ? 0 : std::pow(10.0, 2 * u(g) - 2);
    const std::size_t count = 1 + g() % TrianglePack::kCapacity;
    const Eigen::Vector3d at = size * 0.5 * Eigen::Vector3d(u(g), u(g), u(g));
    raw.addTriangle(size * Eigen::Vector3d(-1, -1, -1), size * Eigen::Vector3d(1, 1, 1),
                    size * Eigen::Vector3d(1, -1, 0));
    const bool is_strip = round % 2 == 1;
    std::array<Eigen::Vector3d, 3> v;
    for (std::size_t i = 0; i < count; ++i) {
      std::rotate(v.begin(), v.begin() + 1, v.end());
      for (std::size_t k = is_strip && i > 0 ? 2 : 0; k < 3; ++k) {
        v[k] = at + size * part * 0.5 * Eigen::Vector3d(u(g), u(g), u(g));
      }
      raw.addTriangle(v[0], v[1], v[2]);
    }
    const auto mesh = raw.mesh();
    const oracle::Surface surface{mesh, lattice::Lattice(mesh->bounds(), Subdivision::kBono, 0)};
    std::vector<std::uint32_t> ids(count);
    std::iota(ids.begin(), ids.end(), 1u);
    std::shuffle(ids.begin(), ids.end(), g);
    Eigen::AlignedBox3d box;
    for (const std::uint32_t t : ids) {
      for (int k = 0; k < 3; ++k) box.extend(surface.corner(t, k));
    }
    tree::BulkBuilder bulk;
    bulk.build(surface, ids.data(), count, surface.latticeBounds());
    ASSERT_EQ(bulk.ids(), ids);
    tree::PackedTriangles::Words words;
    const std::size_t word_count = bulk.pack(0, static_cast<std::uint32_t>(count), words);
    if (word_count == 0) {
      EXPECT_LT(box.sizes().maxCoeff(), 4.1) << "a leaf that is large enough is not packed";
      ++too_small;
      continue;
    }
    const tree::PackedTriangles packed(words.data(), count);
    ASSERT_EQ(packed.words(), word_count);
    EXPECT_LE(packed.places, is_strip ? count + 2 : 3 * count);
    EXPECT_GT(box.sizes().maxCoeff(), 2.9);
    EXPECT_LE(static_cast<double>(packed.step), std::max((box.sizes().maxCoeff() + 1) / 32767, 0x1p-7));
    const Eigen::Vector3d center = box.center();
    const double scale = std::pow(2.0, 10 * u(g));
    for (const Eigen::Matrix3d& linear :
         {Eigen::Matrix3d(Eigen::Matrix3d::Identity()), Eigen::Matrix3d(scale * test::randomRotation(g))}) {
      const bool turns = !linear.isIdentity(0);
      const Eigen::Vector3d origin(packed.origin[0], packed.origin[1], packed.origin[2]);
      const Eigen::Vector3d offset = linear * (origin - center);
      PackMotion motion;
      for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 3; ++c) motion.linear[r][c] = static_cast<float>(linear(r, c));
        motion.offset[r] = static_cast<float>(offset[r]);
      }
      TrianglePack pack{};
      unpackTriangles(packed, motion, pack);
      ASSERT_EQ(pack.count, count);
      const double reach = std::sqrt(3.0) * scale * 65535 * static_cast<double>(packed.step) + offset.norm();
      const double error =
          turns ? scale * static_cast<double>(packingError(packed)) + 6 * 0x1p-24 * reach
                : static_cast<double>(packed.step * tree::PackedTriangles::kError + 2 * 0x1p-24f * pack.size);
      for (std::size_t i = 0; i < count; ++i) {
        for (std::size_t k = 0; k < 3; ++k) {
          const Eigen::Vector3d x = linear * (surface.corner(ids[i], static_cast<int>(k)) - center);
          for (std::size_t c = 0; c < 3; ++c) {
            const auto y = static_cast<double>(pack.xyz[3 * k + c][i]);
            ASSERT_NEAR(y, x[static_cast<int>(c)], error * (1 + 1e-6)) << "round " << round;
            ASSERT_LE(std::abs(y), static_cast<double>(pack.size));
          }
        }
      }
      // Whole vectors are read: what is beyond the last triangle must be as harmless as it is.
      for (std::size_t i = count; i < (count + 7) / 8 * 8; ++i) {
        for (const auto& row : pack.xyz) ASSERT_LE(std::abs(row[i]), pack.size);
      }
    }
  }
  EXPECT_GT(too_small, 20);
  EXPECT_LT(too_small, 150);
}

// Makes it the block of some cell, which is returned, with some octants.
lattice::Cell fillRandomly(std::mt19937_64& g, tree::Block& block) {
  lattice::Cell cell;
  cell.level = 1 + static_cast<int>(g() % 14);
  for (auto& x : cell.at) x = static_cast<std::uint32_t>(g() % (1u << (cell.level - 1)));
  block.setCell(cell);
  for (int o = 0; o < 8; ++o) block.octants.set(o, randomBounds(g));
  return cell;
}

TEST_P(EveryTarget, GapsOfOctantsHoldTheDistancesOfTheirPoints) {
  std::mt19937_64 g(21);
  std::uniform_real_distribution<double> u(-1, 1);
  int compared = 0, close = 0;
  for (int round = 0; round < 20000; ++round) {
    tree::Block blocks[2];
    Eigen::Vector3d points[2];
    int octants[2];
    bool found = true;
    for (int side = 0; side < 2 && found; ++side) {
      const lattice::Cell cell = fillRandomly(g, blocks[side]);
      octants[side] = static_cast<int>(g() % 8);
      const lattice::Cell octant = cell.octant(octants[side]);
      const auto corner = octant.corner();
      found = randomPoint(g, blocks[side].octants.get(octants[side]), Eigen::Vector3d(corner[0], corner[1], corner[2]),
                          octant.side(), points[side]);
    }
    if (!found) continue;
    SimilarityTransform to;
    to.rotation = test::randomRotation(g);
    to.scale = std::pow(2.0, 10 * u(g));
    const Eigen::Vector3d displacement = test::randomDirection(g) * std::pow(10.0, 3 + 3 * u(g));
    to.translation = points[0] + displacement - to.scale * (to.rotation * points[1]);
    to.ready();
    const PairFrames geometry(to);
    const double distance = (to * points[1] - points[0]).norm(), rounding = 1e-12 * geometry.rounding_margin * 0x1p24;
    FrameDirection expected;
    if (round % 3 != 0) {
      const Eigen::Vector3d d = round % 3 == 1 ? Eigen::Vector3d(displacement.normalized()) : test::randomDirection(g);
      const Eigen::Vector3d back = to.rotation.transpose() * d;
      for (int k = 0; k < 3; ++k) {
        expected.in[0][k] = static_cast<float>(d[k]);
        expected.in[1][k] = static_cast<float>(back[k]);
      }
    }
    Frame frames[2];
    for (int side = 0; side < 2; ++side) fillFrame(geometry, side, blocks[side], frames[side]);
    for (int own = 0; own < 2; ++own) {
      LaneGaps gaps;
      laneGaps(geometry, own, frames[own], frames[1 - own], static_cast<std::size_t>(octants[1 - own]), expected, gaps);
      ASSERT_LE(gaps.at_least[octants[own]], distance + rounding) << "round " << round << " side " << own;
      ASSERT_GE(gaps.at_most[octants[own]], distance - rounding) << "round " << round << " side " << own;
      ++compared;
      close += gaps.at_least[octants[own]] > 0.5 * distance;
    }
  }
  EXPECT_GT(compared, 10000);
  EXPECT_GT(close, compared / 10) << "bounds of nothing prove nothing";
}

// The triangles lie in the frame of the octants' side. Some are segments or points, some are as large as all of it.
TEST_P(EveryTarget, GapsToTrianglesAreNoMoreThanTheDistancesOfPoints) {
  std::mt19937_64 g(24);
  std::uniform_real_distribution<double> u(-1, 1);
  int compared = 0, close = 0;
  for (int round = 0; round < 20000; ++round) {
    const int own = static_cast<int>(g() % 2);
    tree::Block block;
    const lattice::Cell cell = fillRandomly(g, block);
    const int o = static_cast<int>(g() % 8);
    const auto corner = cell.octant(o).corner();
    Eigen::Vector3d point;
    if (!randomPoint(g, block.octants.get(o), Eigen::Vector3d(corner[0], corner[1], corner[2]), cell.octant(o).side(),
                     point)) {
      continue;
    }
    SimilarityTransform to;
    to.rotation = test::randomRotation(g);
    to.scale = std::pow(2.0, 9 * u(g));
    to.translation = test::randomDirection(g) * 3e4;
    to.ready();
    const PairFrames geometry(to);
    const auto unit = static_cast<double>(geometry.side[own].unit);

    const std::size_t count = 1 + g() % TriangleBounds::kCapacity;
    RawTriangles raw{}, placed;
    double distance = std::numeric_limits<double>::infinity();
    const Eigen::Vector3d middle = point + test::randomDirection(g) * std::pow(10.0, 2 + 2.5 * u(g));
    for (std::size_t t = 0; t < count; ++t) {
      Corners corners;
      const double size = std::pow(10.0, 2.5 + 2 * u(g));
      for (Eigen::Vector3d& c : corners) c = middle + size * Eigen::Vector3d(u(g), u(g), u(g));
      if (t % 7 == 5) corners[2] = corners[0] + u(g) * (corners[1] - corners[0]);
      if (t % 11 == 6) corners[1] = corners[2] = corners[0];
      distance = std::min(distance, (closestPoint(point, corners) - point).norm());
      for (std::size_t k = 0; k < 9; ++k) raw.xyz[k][t] = corners[k / 3][static_cast<Eigen::Index>(k % 3)];
    }
    PackTransform place{};
    for (int k = 0; k < 3; ++k) place.linear[k][k] = 1, place.offset[k] = -lattice::kMiddle;
    TriangleBounds bounds;
    boundTriangles(raw, ~0u >> (TriangleBounds::kCapacity - count), place, unit, 1e30, placed, bounds);

    Frame frame;
    fillFrame(geometry, own, block, frame);
    LaneGaps gaps{};
    triangleGaps(geometry, frame, bounds, count, gaps);
    ASSERT_LE(gaps.at_least[o], unit * distance) << "round " << round;
    for (int i = 0; i < 8; ++i) ASSERT_LT(gaps.at_least[i], 1e9f);
    ++compared;
    close += gaps.at_least[o] > 0.5 * unit * distance;
  }
  EXPECT_GT(compared, 10000);
  EXPECT_GT(close, compared / 10) << "bounds of nothing prove nothing";
}

// The centre of the sphere about each leaf that meets the surface, wherever the actual regions end.
TEST_P(EveryTarget, FramesOfCentersHoldThoseOfAllLeaves) {
  std::mt19937_64 g(23);
  int compared = 0, tight = 0;
  for (int round = 0; round < 20000; ++round) {
    tree::Block block;
    const lattice::Cell cell = fillRandomly(g, block);
    const int o = static_cast<int>(g() % 8);
    const lattice::Cell octant = cell.octant(o);
    const Eigen::Vector3d corner(octant.corner()[0], octant.corner()[1], octant.corner()[2]);
    LeafCells leaves{};
    leaves.side = static_cast<std::int32_t>(octant.side() >> g() % (lattice::kMaxLevel - octant.level + 1));
    for (std::size_t k = 0; k < 3; ++k) {
      leaves.extent[k] =
          g() % 2 ? 1 << lattice::kBits : static_cast<std::int32_t>(octant.corner()[k] + 1 + g() % octant.side());
    }
    Eigen::Vector3d surface, center;
    if (!randomPoint(g, block.octants.get(o), corner, octant.side(), surface)) continue;
    bool exists = true;
    for (int k = 0; k < 3; ++k) {
      const double side = leaves.side, end = leaves.extent[static_cast<std::size_t>(k)];
      // At the end of a cell, either may be the leaf.
      double at = std::floor((surface[k] - corner[k]) / side);
      if (at * side == surface[k] - corner[k] && at > 0 && g() % 2) --at;
      const double low = corner[k] + side * std::min(at, octant.side() / side - 1);
      exists = exists && low < end && surface[k] <= end;
      center[k] = (low + std::min(low + side, end)) / 2 - lattice::kMiddle;
    }
    if (!exists) continue;
    SimilarityTransform to;
    to.ready();
    Frame f;
    fillCenters(PairFrames(to), 0, block, leaves, f);
    double along = -static_cast<double>(f.slab_center[o]);
    bool is_tight = true;
    for (int k = 0; k < 3; ++k) {
      const double displacement = center[k] - double{f.center[0][k][o]}, half = double{f.half[0][k][o]};
      ASSERT_LE(std::abs(displacement), half) << round;
      const double box = (block.octants.hi[k][o] - block.octants.lo[k][o]) / 255.0 * octant.side();
      is_tight = is_tight && 2 * half <= box + 1.2 * leaves.side;
      along += double{f.normal[0][k][o]} * displacement;
    }
    ASSERT_LE(std::abs(along), double{f.slab_half[o]} + 1e-2) << round;
    ++compared;
    tight += is_tight;
  }
  EXPECT_GT(compared, 4000);
  EXPECT_EQ(tight, compared);
}

TEST_P(EveryTarget, NoPairIsLostThatIsNearest) {
  std::mt19937_64 g(22);
  std::uniform_real_distribution<double> u(-1, 1);
  std::size_t nearer = 0, ties = 0, others = 0, candidates = 0, pairs = 0, tight = 0;
  for (int round = 0; round < 600; ++round) {
    const double scale = std::pow(10.0, 6 * u(g));
    TrianglePack a, b;
    a.count = 1 + g() % 32;
    b.count = 1 + g() % 32;
    std::vector<std::array<Eigen::Vector3d, 3>> ta(a.count), tb(b.count);
    const Eigen::Vector3d apart = test::randomDirection(g) * std::pow(10.0, 2 * u(g));
    const auto make = [&](std::array<Eigen::Vector3d, 3>& t, const Eigen::Vector3d& about) {
      const Eigen::Vector3d c = about + Eigen::Vector3d(u(g), u(g), u(g));
      const double size = std::pow(10.0, u(g));
      for (auto& v : t) v = (c + size * Eigen::Vector3d(u(g), u(g), u(g))) * scale;
      degenerateAtTimes(g, t, 8);
    };
    // Neighbours that share a corner or an edge are as near as each other.
    const auto makeAll = [&](std::vector<std::array<Eigen::Vector3d, 3>>& all, const Eigen::Vector3d& about) {
      for (std::size_t i = 0; i < all.size(); ++i) {
        make(all[i], about);
        if (i > 0 && g() % 2) all[i][0] = all[i - 1][2];
        if (i > 0 && g() % 3 == 0) all[i][1] = all[i - 1][1];
      }
    };
    makeAll(ta, Eigen::Vector3d::Zero());
    makeAll(tb, apart);
    for (std::size_t i = 0; i < a.count; ++i) put(a, i, {ta[i][0], ta[i][1], ta[i][2]});
    for (std::size_t i = 0; i < b.count; ++i) put(b, i, {tb[i][0], tb[i][1], tb[i][2]});
    std::vector<double> distances;
    Eigen::Vector3d on_p, on_q, displacement = Eigen::Vector3d::Zero();
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < a.count; ++i) {
      for (std::size_t j = 0; j < b.count; ++j) {
        distances.push_back(nearestPoints({ta[i][0], ta[i][1], ta[i][2]}, {tb[j][0], tb[j][1], tb[j][2]}, on_p, on_q));
        if (!(distances.back() < least)) continue;
        least = distances.back();
        displacement = on_q - on_p;
      }
    }
    if (round % 3 == 0) displacement = test::randomDirection(g);
    if (displacement.norm() > 0) displacement.normalize();
    if (round % 4 == 0) displacement.setZero();
    const float expected[3] = {static_cast<float>(displacement[0]), static_cast<float>(displacement[1]),
                               static_cast<float>(displacement[2])};
    const double factors[] = {0.5, 1, 1.0001, 2, std::numeric_limits<double>::infinity()};
    const auto cutoff = static_cast<float>(std::max(least, 1e-3 * scale) * factors[round % 5]);
    static NearPair found[TrianglePack::kCapacity * TrianglePack::kCapacity];
    const std::size_t count = nearPairs(a, b, expected, cutoff, false, found);
    std::map<std::pair<std::size_t, std::size_t>, double> bounds;
    for (std::size_t k = 0; k < count; ++k) bounds[{found[k].row, found[k].lane}] = found[k].at_least;
    ASSERT_EQ(bounds.size(), count);
    pairs += distances.size();
    candidates += count;
    const double size = std::max(a.size, b.size);
    for (const auto& [pair, bound] : bounds) {
      ASSERT_LT(pair.first, a.count);
      ASSERT_LT(pair.second, b.count);
      const double distance = distances[pair.first * b.count + pair.second];
      ASSERT_LE(bound, distance * (1 + 1e-12)) << "round " << round;
      tight += bound >= distance - 1e-4 * size;
    }
    for (std::size_t k = 0; k < distances.size(); ++k) {
      if (!(distances[k] < cutoff) || distances[k] > least * (1 + 1e-13)) continue;
      ++nearer;
      ties += distances[k] != least;
      ASSERT_TRUE(bounds.count({k / b.count, k % b.count})) << "round " << round;
    }
    const std::size_t all = nearPairs(a, b, expected, cutoff, true, found);
    std::set<std::pair<std::size_t, std::size_t>> listed;
    for (std::size_t k = 0; k < all; ++k) listed.insert({found[k].row, found[k].lane});
    for (std::size_t k = 0; k < distances.size(); ++k) {
      if (!(distances[k] < cutoff)) continue;
      ASSERT_TRUE(listed.count({k / b.count, k % b.count})) << "round " << round;
      others += distances[k] > least;
    }
  }
  EXPECT_GT(others, 400u) << "not the nearest, but near";
  EXPECT_GT(nearer, 400u);
  EXPECT_GT(ties, 3u);
  EXPECT_LT(candidates, pairs / 5) << "a filter that lets everything through proves nothing";
  EXPECT_GT(tight, candidates * 8 / 10);
}

// The least overlap along the seventeen axes, one by one.
double leastOverlap(const Corners& p, const Corners& q) {
  const Eigen::Vector3d e[3] = {p[1] - p[0], p[2] - p[1], p[0] - p[2]}, f[3] = {q[1] - q[0], q[2] - q[1], q[0] - q[2]};
  const Eigen::Vector3d n = e[0].cross(e[1]), m = f[0].cross(f[1]);
  std::vector<Eigen::Vector3d> axes = {n, m};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) axes.push_back(e[i].cross(f[j]));
    axes.push_back(e[i].cross(n));
    axes.push_back(f[i].cross(m));
  }
  double least = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector3d& axis : axes) {
    if (axis.norm() < 1e-9) continue;
    const Eigen::Vector3d along = axis.normalized();
    double lo[2] = {1e300, 1e300}, hi[2] = {-1e300, -1e300};
    for (int k = 0; k < 3; ++k) {
      lo[0] = std::min(lo[0], along.dot(p[k]));
      hi[0] = std::max(hi[0], along.dot(p[k]));
      lo[1] = std::min(lo[1], along.dot(q[k]));
      hi[1] = std::max(hi[1], along.dot(q[k]));
    }
    least = std::min({least, hi[0] - lo[1], hi[1] - lo[0]});
  }
  return least;
}

TEST_P(EveryTarget, MovingByDepthParts) {
  std::mt19937_64 g(6);
  std::uniform_real_distribution<double> u(-1, 1);
  int tried = 0, slivers = 0;
  for (int round = 0; round < 20000; round += static_cast<int>(TrianglePairs::kCapacity)) {
    using Exact = fcl::detail::Intersect<double>;
    Corners p[TrianglePairs::kCapacity], q[TrianglePairs::kCapacity];
    TrianglePairs pairs;
    pairs.count = 1 + g() % TrianglePairs::kCapacity;
    for (std::size_t i = 0; i < pairs.count; ++i) {
      for (int k = 0; k < 3; ++k) {
        p[i][k] = Eigen::Vector3d(u(g), u(g), u(g));
        q[i][k] = Eigen::Vector3d(u(g), u(g), u(g));
      }
      degenerateAtTimes(g, p[i], 16);
      if (g() % 16 == 0) {
        // In one plane, or an edge along one of the other.
        for (int k = 0; k < 3; ++k) q[i][k] = p[i][0] + u(g) * (p[i][1] - p[i][0]) + u(g) * (p[i][2] - p[i][0]);
      } else if (g() % 16 == 0) {
        q[i][1] = q[i][0] + u(g) * (p[i][1] - p[i][0]);
      }
      pairs.put(i, p[i], q[i]);
    }
    ContactPoint touches[TrianglePairs::kCapacity];
    trianglePenetrations(pairs, 0, touches);
    for (std::size_t i = 0; i < pairs.count; ++i) {
      const ContactPoint& touch = touches[i];
      if (!Exact::intersect_Triangle(p[i][0], p[i][1], p[i][2], q[i][0], q[i][1], q[i][2])) continue;
      const ContactPoint alone = trianglePenetration(p[i], q[i]);
      EXPECT_EQ(alone.depth, touch.depth);
      EXPECT_EQ(alone.normal, touch.normal);
      EXPECT_EQ(alone.point, touch.point);
      EXPECT_NEAR(touch.normal.norm(), 1, 1e-12);
      EXPECT_GE(touch.depth, 0);
      EXPECT_LE(touch.depth, std::max(0.0, leastOverlap(p[i], q[i])) + 1e-9);
      if (isDegenerate(p[i])) continue;
      ++tried;
      slivers += (p[i][2] - p[i][1]).norm() < 1e-6;
      const auto meets = [&](double by) {
        const Eigen::Vector3d d = by * touch.normal;
        return Exact::intersect_Triangle(p[i][0], p[i][1], p[i][2], q[i][0] + d, q[i][1] + d, q[i][2] + d);
      };
      EXPECT_FALSE(meets(touch.depth + 1e-9));
      if (touch.depth > 1e-6) {
        EXPECT_TRUE(meets(touch.depth * 0.999));
      }
      if (touch.depth < 1e-12) continue;  // in one plane, the middle of the boxes' overlap is the point
      EXPECT_LT((closestPoint(touch.point, p[i]) - touch.point).norm(), 1e-9) << "the point is on both triangles";
      EXPECT_LT((closestPoint(touch.point, q[i]) - touch.point).norm(), 1e-9);
    }
  }
  EXPECT_GT(tried, 500);
  EXPECT_GT(slivers, 5);
}

// Edges at right angles have equal overlaps along several axes; beside triangles without area, more axes are tried.
TEST_P(EveryTarget, PenetrationsDoNotDependOnNeighbours) {
  std::mt19937_64 g(7);
  std::uniform_int_distribution<int> step(-2, 2);
  int areas = 0;
  for (int round = 0; round < 2000; ++round) {
    const Eigen::Matrix3d R = test::randomRotation(g);
    const auto corner = [&] { return Eigen::Vector3d(R * Eigen::Vector3d(step(g), step(g), step(g))); };
    const Corners p = {corner(), corner(), corner()}, q = {corner(), corner(), corner()};
    const Corners flat = {p[0], p[1], p[1]};
    ContactPoint touches[2][TrianglePairs::kCapacity];
    PenetrationVerdicts verdicts[2];
    const std::size_t at = g() % TrianglePairs::kCapacity;
    for (const bool with_flat : {false, true}) {
      TrianglePairs pairs;
      pairs.count = TrianglePairs::kCapacity;
      for (std::size_t i = 0; i < pairs.count; ++i) pairs.put(i, with_flat && i != at ? flat : p, q);
      verdicts[with_flat] = trianglePenetrations(pairs, 1e-12, touches[with_flat]);
    }
    areas += !isDegenerate(p) && !isDegenerate(q);
    ASSERT_EQ(touches[0][at].depth, touches[1][at].depth);
    ASSERT_EQ(touches[0][at].normal, touches[1][at].normal);
    if ((verdicts[0].apart >> at & 1) == 0) {
      ASSERT_EQ(touches[0][at].point, touches[1][at].point);
    }
    ASSERT_EQ(verdicts[0].meet >> at & 1, verdicts[1].meet >> at & 1);
    ASSERT_EQ(verdicts[0].apart >> at & 1, verdicts[1].apart >> at & 1);
  }
  EXPECT_GT(areas, 1000);
}

INSTANTIATE_TEST_SUITE_P(Targets, EveryTarget, testing::ValuesIn(test::EveryTarget::targets()),
                         test::EveryTarget::name);

// Properties of what contacts are made of.

TEST(NearestPoints, NoTwoPointsAreNearer) {
  std::mt19937_64 g(32);
  std::uniform_real_distribution<double> u(-1, 1);
  const auto pointOf = [&](const Corners& t) {
    double a = std::abs(u(g)), b = std::abs(u(g));
    if (a + b > 1) a = 1 - a, b = 1 - b;
    return Eigen::Vector3d(t[0] + a * (t[1] - t[0]) + b * (t[2] - t[0]));
  };
  for (int round = 0; round < 5000; ++round) {
    Corners p, q;
    for (Eigen::Vector3d* t : {p.data(), q.data()}) {
      for (int k = 0; k < 3; ++k) t[k] = Eigen::Vector3d(u(g), u(g), u(g));
      degenerateAtTimes(g, t, 4);
    }
    // FCL's own triangle distance misses the nearest points of parallel edges.
    if (round % 3 == 0) q[1] = q[0] + (1 + 0.5 * u(g)) * (p[1] - p[0]);
    if (round % 6 == 0) q[1] += 1e-7 * Eigen::Vector3d(u(g), u(g), u(g));
    Eigen::Vector3d on_p, on_q;
    const double distance = nearestPoints(p, q, on_p, on_q);
    EXPECT_LT((closestPoint(on_p, p) - on_p).norm(), 1e-12);
    EXPECT_LT((closestPoint(on_q, q) - on_q).norm(), 1e-12);
    EXPECT_NEAR((on_p - on_q).norm(), distance, 1e-12);
    for (int i = 0; i < 20; ++i) {
      const Eigen::Vector3d x = pointOf(p), y = pointOf(q);
      EXPECT_LE(distance, (x - y).norm() + 1e-12) << "round " << round;
      EXPECT_LE(distance, (closestPoint(x, q) - x).norm() + 1e-12) << "round " << round;
      EXPECT_LE(distance, (closestPoint(y, p) - y).norm() + 1e-12) << "round " << round;
    }
  }
}

TEST(ClosestPoint, IsNoFurtherThanAnyOtherPoint) {
  std::mt19937_64 g(7);
  std::uniform_real_distribution<double> u(-1, 1);
  for (int round = 0; round < 3000; ++round) {
    Corners t;
    for (auto& v : t) v = Eigen::Vector3d(u(g), u(g), u(g));
    if (round % 5 == 0) t[1] = t[0];
    if (round % 7 == 0) t[2] = t[0];
    const Eigen::Vector3d x = 2 * Eigen::Vector3d(u(g), u(g), u(g)), c = closestPoint(x, t);
    for (int i = 0; i < 50; ++i) {
      double a = std::abs(u(g)), b = std::abs(u(g));
      if (a + b > 1) a = 1 - a, b = 1 - b;
      EXPECT_LE((c - x).norm(), (t[0] + a * (t[1] - t[0]) + b * (t[2] - t[0]) - x).norm() + 1e-12);
    }
  }
}

}  // namespace
}  // namespace bocst::query
