// SPDX-License-Identifier: BSD-3-Clause
// A BVHModel beside a model: its nodes as a side of walks, and answers where these are long.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <set>
#include <type_traits>
#include <utility>
#include <vector>

#include "conformance/reference.h"
#include "fcl/adapters/bvh_side.h"
#include "geometry/triangle.h"
#include "query/collide/cell_tree.h"
#include "query/distance/side_frames.h"

namespace bocst {
namespace {

using Eigen::Vector3d;
using fcl_adapter::BvhSide;
using test::Raw;

template <typename S>
class BvhPartner : public testing::Test {};
TYPED_TEST_SUITE(BvhPartner, test::Scalars);

// n triangles along a line and in a heap, some of them equal, and one far away, which FCL makes a node of its own.
Raw strip(std::size_t n, std::mt19937_64& g) {
  std::uniform_real_distribution<double> u(-1, 1);
  Raw raw;
  for (std::size_t i = 0; i < n; ++i) {
    const Vector3d at = i % 3 == 0 ? Vector3d::Zero() : Vector3d(double(i + 1 == n ? 100 * n : i), u(g), u(g));
    raw.addTriangle(at, at + Vector3d(u(g), u(g), u(g)), i % 7 == 0 ? at : Vector3d(at + Vector3d(u(g), u(g), u(g))));
  }
  return raw;
}

bool holds(const query::OrientedVolume& box, const Vector3d& x) {
  const Vector3d in_box = box.axes.transpose() * (x - box.center);
  return (in_box.cwiseAbs() - box.half).maxCoeff() <= 0;
}

bool holds(const query::Volume& v, const Vector3d& x) {
  double along = -double(v.slab_offset);
  for (int k = 0; k < 3; ++k) {
    if (std::abs(x[k] - v.center[k]) > double(v.half[k])) return false;
    along += double(v.normal[k]) * (x[k] - v.center[k]);
  }
  return std::abs(along) <= double(v.slab_half);
}

template <typename BV>
void checkNodes(std::size_t count) {
  std::mt19937_64 g(count);
  const Raw raw = strip(count, g);
  const auto bvh = test::bvh<BV>(raw);
  const BvhSide side("collide", *bvh);
  std::multiset<std::uint32_t> seen;
  std::vector<int> stack = {side.root()};
  while (!stack.empty()) {
    const int node = stack.back();
    stack.pop_back();
    if (side.state(node) == query::State::kInner) {
      const unsigned lanes = side.lanes(node);
      query::Volume volumes[8];
      side.laneVolumes(node, volumes);
      std::size_t below = 0;
      side.pushLanes(node, lanes, [&](int child, int lane) {
        below += side.triangleCount(child);
        stack.push_back(child);
        if (side.state(child) != query::State::kLeaf) return;
        const auto triangles = side.triangles(child);
        for (std::size_t i = 0; i < triangles.count; ++i) {
          for (const Vector3d& corner : side.corners(triangles.ids[i])) {
            EXPECT_TRUE(holds(side.volume(child), corner));
            EXPECT_TRUE(holds(volumes[lane], corner));
          }
        }
      });
      EXPECT_EQ(below, side.triangleCount(node));
      EXPECT_GT(side.triangleCount(node), 8U);
      continue;
    }
    const auto triangles = side.triangles(node);
    EXPECT_EQ(triangles.count, side.triangleCount(node));
    for (std::size_t i = 0; i < triangles.count; ++i) seen.insert(triangles.ids[i]);
  }
  ASSERT_EQ(seen.size(), count);
  EXPECT_EQ(std::set<std::uint32_t>(seen.begin(), seen.end()).size(), count);
}

TYPED_TEST(BvhPartner, LeavesHaveEachTriangleOnce) {
  using S = TypeParam;
  for (const std::size_t count : {1, 2, 7, 8, 9, 15, 16, 17, 64, 65, 1000}) {
    SCOPED_TRACE(count);
    checkNodes<fcl::AABB<S>>(count);
    checkNodes<fcl::OBB<S>>(count);
    checkNodes<fcl::RSS<S>>(count);
    checkNodes<fcl::kIOS<S>>(count);
    checkNodes<fcl::OBBRSS<S>>(count);
    checkNodes<fcl::KDOP<S, 24>>(count);
  }
}

// For distances, nodes become upright boxes and slabs in float.
TYPED_TEST(BvhPartner, FramesHoldTheTrianglesOfTheirNodes) {
  using S = TypeParam;
  std::mt19937_64 g(11);
  const Raw raw = strip(400, g);
  const auto bvh = test::bvh<fcl::OBBRSS<S>>(raw);
  const BvhSide side("distance", *bvh);
  using Frames = query::SideFrames<BvhSide>;
  const query::PairFrames geometry{query::SimilarityTransform()};
  auto frames = std::make_unique<Frames>();
  frames->start(side, geometry, 1);
  const double unit = Frames::unitOf(side);
  const Vector3d middle = Frames::originOf(side) + unit * Vector3d::Constant(lattice::kMiddle);
  const auto check = [&](const query::Frame& f, std::size_t lane, const Vector3d& corner) {
    const Vector3d x = (corner - middle) / unit;
    constexpr double kRounding = 0x1p-20 * lattice::kMiddle;
    double along = -double(f.slab_center[lane]);
    for (int k = 0; k < 3; ++k) {
      const double from_center = x[k] - double(f.center[0][k][lane]);
      EXPECT_LE(std::abs(from_center), double(f.half[0][k][lane]) + kRounding);
      along += double(f.normal[0][k][lane]) * from_center;
    }
    EXPECT_LE(std::abs(along), double(f.slab_half[lane]) + kRounding);
  };
  const auto checkLeaves = [&](auto&& self, int node, const query::Frame& f, std::size_t lane) -> void {
    if (side.state(node) == query::State::kInner) {
      side.children(node, [&](int child) { self(self, child, f, lane); });
      return;
    }
    const auto triangles = side.triangles(node);
    for (std::size_t i = 0; i < triangles.count; ++i) {
      for (const Vector3d& corner : side.corners(triangles.ids[i])) check(f, lane, corner);
    }
  };
  std::vector<int> stack = {side.root()};
  while (!stack.empty()) {
    const int node = stack.back();
    stack.pop_back();
    std::size_t lane = 0;
    const query::Frame own = frames->of(side, node, lane);
    checkLeaves(checkLeaves, node, own, lane);
    if (side.state(node) == query::State::kLeaf) continue;
    const query::Frame lanes = frames->ofLanes(side, node);
    side.pushLanes(node, side.lanes(node), [&](int child, int i) {
      checkLeaves(checkLeaves, child, lanes, static_cast<std::size_t>(i));
      stack.push_back(child);
    });
  }
}

// Triangles much larger than all of the other mesh, a small angle apart, so that the boxes of their leaves say
// little.
Raw fan(int count, std::mt19937_64& g) {
  std::uniform_real_distribution<double> u(0, 0.2);
  Raw raw;
  for (int i = 0; i < count; ++i) {
    const double angle = 6.2 * i / count, next = angle + 0.2;
    const Vector3d tip(0, 0, u(g));
    raw.addTriangle(tip, Vector3d(30 * std::cos(angle), 30 * std::sin(angle), u(g)),
                    Vector3d(30 * std::cos(next), 30 * std::sin(next), u(g)));
  }
  return raw;
}

template <typename S>
void checkFan(const Raw& fine, const Raw& large, double lift, int& hits, int& misses, std::mt19937_64& g) {
  const auto bvh_fine = test::bvh<fcl::OBBRSS<S>>(fine), bvh_large = test::bvh<fcl::OBBRSS<S>>(large);
  const Model<S> model_fine(fine.mesh()), model_large(large.mesh());
  const auto I = fcl::Transform3<S>::Identity();
  std::uniform_real_distribution<double> u(-1, 1);
  for (int i = 0; i < 40; ++i) {
    const auto X =
        test::pose<S>(test::randomRotation(g), Vector3d(4 * u(g), 4 * u(g), lift + 0.3 * u(g)).cast<double>());
    const bool expected = test::touching<S>(*bvh_fine, X, *bvh_large, I);
    ++(expected ? hits : misses);
    ASSERT_EQ(test::touching<S>(model_fine, X, *bvh_large, I), expected) << i;
    ASSERT_EQ(test::touching<S>(*bvh_large, I, model_fine, X), expected) << i;
    ASSERT_EQ(test::touching<S>(*bvh_fine, X, model_large, I), expected) << i;
    ASSERT_EQ(test::touching<S>(model_large, I, *bvh_fine, X), expected) << i;
    const test::Pairs pairs = test::pairs<S>(model_fine, X, model_large, I);
    EXPECT_EQ(pairs.empty(), !expected);
    ASSERT_EQ(test::pairs<S>(model_fine, X, *bvh_large, I), pairs) << i;
    ASSERT_EQ(test::pairs<S>(*bvh_fine, X, model_large, I), pairs) << i;
  }
}

TYPED_TEST(BvhPartner, SmallNodesBesideLargeTriangles) {
  std::mt19937_64 g(5);
  const Raw fine = test::torus(60);
  int hits = 0, misses = 0;
  for (const double lift : {0.0, 0.8, 1.2, 1.4}) checkFan<TypeParam>(fine, fan(300, g), lift, hits, misses, g);
  EXPECT_GT(hits, 30);
  EXPECT_GT(misses, 30);
}

// FCL's distances are too large where edges are parallel, so the reference is every pair of triangles.
double leastDistance(const Raw& a, const Raw& b, const Eigen::Isometry3d& X_AB) {
  double least = std::numeric_limits<double>::infinity();
  Vector3d p, q;
  for (const fcl::Triangle& t : a.triangles) {
    for (const fcl::Triangle& u : b.triangles) {
      query::Corners of_a, of_b;
      for (std::size_t k = 0; k < 3; ++k) {
        of_a[k] = a.vertices[t[k]];
        of_b[k] = X_AB * b.vertices[u[k]];
      }
      least = std::min(least, query::nearestPoints(of_a, of_b, p, q));
    }
  }
  return least;
}

template <typename BV>
void checkDistances(const Raw& ra, const Raw& rb) {
  using S = typename BV::S;
  const auto bvh = test::bvh<BV>(rb);
  const Model<S> model(ra.mesh());
  const auto I = fcl::Transform3<S>::Identity();
  std::mt19937_64 g(7);
  std::uniform_real_distribution<double> u(-1, 1);
  int apart = 0;
  for (int i = 0; i < 24; ++i) {
    // In float the same pose for both.
    const auto X = test::pose<S>(test::randomRotation(g), Vector3d(u(g), u(g), u(g)) * (i % 3 == 0 ? 30 : 4));
    Eigen::Isometry3d Y = Eigen::Isometry3d::Identity();
    Y.linear() = X.linear().template cast<double>();
    Y.translation() = X.translation().template cast<double>();
    const double expected = leastDistance(ra, rb, Y);
    if (expected > 0) ++apart;
    const double rounding = 64 * double(std::numeric_limits<S>::epsilon()) * 40;
    ASSERT_NEAR(double(test::distance<S>(model, I, *bvh, X)), expected, rounding) << i;
    ASSERT_NEAR(double(test::distance<S>(*bvh, X, model, I)), expected, rounding) << i;
    fcl::DistanceRequest<S> request(true);
    fcl::DistanceResult<S> result;
    fcl::distance<S>(&model, I, bvh.get(), X, request, result);
    if (expected > 0) {
      const double between = double((result.nearest_points[0] - result.nearest_points[1]).norm());
      EXPECT_NEAR(between, expected, 4 * rounding);
    }
    EXPECT_TRUE(isCloserThan<S>(&model, I, bvh.get(), X, S(expected * 1.001 + 1e-3)));
    if (expected > 1e-2) {
      EXPECT_FALSE(isCloserThan<S>(&model, I, bvh.get(), X, S(expected * 0.999)));
    }
  }
  EXPECT_GT(apart, 8);
}

TYPED_TEST(BvhPartner, DistancesAreThoseOfTheNearestTriangles) {
  using S = TypeParam;
  std::mt19937_64 g(9);
  const Raw torus = test::torus(12), large = fan(24, g), line = strip(60, g);
  for (const Raw* a : {&torus, &large, &line}) {
    for (const Raw* b : {&torus, &large, &line}) {
      if (b == a) continue;
      checkDistances<fcl::OBBRSS<S>>(*a, *b);
      checkDistances<fcl::AABB<S>>(*a, *b);
      checkDistances<fcl::RSS<S>>(*a, *b);
      checkDistances<fcl::KDOP<S, 16>>(*a, *b);
    }
  }
}

// Blocks separate nothing here; queries pay for oriented boxes, and later ones use them.
TEST(BvhPartnerDouble, FlatFacesOnOneAnother) {
  const Raw ra = test::plate(30), rb = test::plate(23);
  const auto bvh = test::bvh<fcl::OBBRSSd>(rb);
  Modeld model(ra.mesh());
  std::mt19937_64 g(3);
  const auto X = test::pose<double>(test::randomRotation(g), Vector3d(0.3, 0.2, 0.1));
  const auto above = [&](double gap) {
    fcl::Transform3d in_a = fcl::Transform3d::Identity();
    in_a.linear() = Eigen::AngleAxisd(0.3, Vector3d::UnitZ()).toRotationMatrix();
    in_a.translation() = Vector3d(0.013, 0.021, gap);
    return fcl::Transform3d(X * in_a);
  };
  // So many bytes a triangle do the boxes take, see design.md.
  const std::size_t boxes = 100 * ra.triangles.size();
  model.buildTree();
  const std::size_t before = model.statistics().resident_bytes;
  for (int i = 0; i < 100; ++i) {
    ASSERT_NEAR(test::distance<double>(model, X, *bvh, above(1e-4)), 1e-4, 1e-14) << i;
    ASSERT_FALSE(test::touching<double>(model, X, *bvh, above(1e-9))) << i;
    ASSERT_FALSE(test::touching<double>(*bvh, above(1e-9), model, X)) << i;
    ASSERT_TRUE(test::pairs<double>(model, X, *bvh, above(1e-9)).empty()) << i;
    ASSERT_TRUE(test::touching<double>(model, X, *bvh, X)) << i;
  }
  EXPECT_GT(model.statistics().resident_bytes, before + boxes);
  // Requests for contacts alone do so, too.
  Modeld asked_for_contacts(ra.mesh());
  asked_for_contacts.buildTree();
  for (int i = 0; i < 100; ++i) {
    ASSERT_TRUE(test::pairs<double>(asked_for_contacts, X, *bvh, above(1e-9)).empty()) << i;
  }
  EXPECT_GT(asked_for_contacts.statistics().resident_bytes, before + boxes);
  const Modeld other(rb.mesh());
  const test::Pairs pairs = test::pairs<double>(model, X, other, X);
  EXPECT_EQ(test::pairs<double>(model, X, *bvh, X), pairs);
  EXPECT_EQ(test::pairs<double>(asked_for_contacts, X, *bvh, X), pairs);
}

// A model that decays must not keep its branches because the BVHModel beside it is far.
// Places a plate and some triangles so that a cell's sphere just meets, or just misses, the inside of a triangle, and
// compares the contacts with all pairs of a cell and a triangle.
template <typename BV>
void checkCells(Subdivision subdivision, int depth, std::mt19937_64& g) {
  using S = typename BV::S;
  std::uniform_real_distribution<double> u(0, 1);
  const test::CellTree cells(test::torus(12, 0.2), subdivision, depth);
  const lattice::Lattice& lattice = cells.whole->surface().lattice;
  Options options;
  options.answer = Answer::kConservative;
  options.subdivision = subdivision;
  options.depth = depth;
  const Model<S> model(cells.mesh, options);

  Raw raw = test::plate(6);
  raw.add(test::soup(30, 65));
  const Eigen::Matrix3d turn = test::randomRotation(g), R = test::randomRotation(g);
  for (Vector3d& v : raw.vertices) v = turn * v;
  const auto bvh = test::bvh<BV>(raw);
  const auto cornersOf = [&](std::size_t t, const fcl::Transform3<S>& X) {
    const auto at = [&](std::size_t k) -> Vector3d {
      return X.template cast<double>() * raw.vertices[raw.triangles[t][k]].template cast<S>().template cast<double>();
    };
    return query::Corners{at(0), at(1), at(2)};
  };
  const auto sphereOf = [&](const query::CellLeaf& leaf) {
    return query::Sphere{lattice.origin() + lattice.unit() * leaf.sphere.center, lattice.unit() * leaf.sphere.radius};
  };
  const query::Sphere ball = sphereOf(cells.leaves[g() % cells.leaves.size()]);
  const std::size_t nearest = g() % raw.triangles.size();
  const query::Corners c = cornersOf(nearest, test::pose<S>(R, {0, 0, 0}));
  const Vector3d normal = (c[1] - c[0]).cross(c[2] - c[0]).normalized();
  const double gaps[] = {-0.001, -0.01, -0.05, 0.001};
  const Vector3d at = ball.center + ball.radius * (1 + gaps[g() % 4]) * normal - (c[0] + c[1] + c[2]) / 3;
  const auto I = fcl::Transform3<S>(fcl::Transform3<S>::Identity());
  const auto X = test::pose<S>(R, at);

  const fcl::CollisionRequest<S> request(1000000, false);
  fcl::CollisionResult<S> result, reversed;
  fcl::collide(&model, I, bvh.get(), X, request, result);
  fcl::collide(bvh.get(), X, &model, I, request, reversed);
  std::set<std::pair<std::intptr_t, std::intptr_t>> pairs, turned;
  for (std::size_t i = 0; i < result.numContacts(); ++i) {
    pairs.emplace(result.getContact(i).b1, result.getContact(i).b2);
  }
  for (std::size_t i = 0; i < reversed.numContacts(); ++i) {
    turned.emplace(reversed.getContact(i).b2, reversed.getContact(i).b1);
  }
  ASSERT_EQ(pairs, turned);
  const double rounding = std::is_same<S, double>::value ? 1e-11 : 1e-4;
  for (const query::CellLeaf& leaf : cells.leaves) {
    const query::Sphere s = sphereOf(leaf);
    for (std::size_t t = 0; t < raw.triangles.size(); ++t) {
      const double gap = (query::closestPoint(s.center, cornersOf(t, X)) - s.center).norm() - s.radius;
      if (std::abs(gap) < rounding) continue;
      ASSERT_EQ(pairs.count({static_cast<std::intptr_t>(leaf.id), static_cast<std::intptr_t>(t)}), gap < 0)
          << "cell " << leaf.id << " triangle " << t << " gap " << gap << " of radius " << s.radius;
    }
  }
}

TYPED_TEST(BvhPartner, CellsTouchTheTrianglesThatTheirSpheresMeet) {
  using S = TypeParam;
  std::mt19937_64 g(66);
  for (int i = 0; i < 8; ++i) {
    for (const Subdivision subdivision : {Subdivision::kOctree, Subdivision::kBono}) {
      for (int depth = 2; depth <= 6; ++depth) {
        SCOPED_TRACE(testing::Message() << "depth " << depth << " round " << i);
        checkCells<fcl::OBBRSS<S>>(subdivision, depth, g);
        checkCells<fcl::AABB<S>>(subdivision, depth, g);
        if (this->HasFatalFailure()) return;
      }
    }
  }
}

TYPED_TEST(BvhPartner, FarPartnersDoNotKeepBranches) {
  using S = TypeParam;
  const Raw raw = test::torus(40);
  auto now = std::make_shared<std::atomic<int>>(0);
  Options options;
  options.ttl = std::chrono::seconds(1);
  options.clock = [now] { return Clock::time_point(std::chrono::seconds(now->load())); };
  const Model<S> model(raw.mesh(), options);
  const auto bvh = test::bvh<fcl::OBBRSS<S>>(raw);
  const auto I = fcl::Transform3<S>::Identity();
  ASSERT_TRUE(test::touching<S>(model, I, *bvh, I));
  const std::size_t before = model.statistics().resident_nodes;
  ASSERT_GT(before, 1U);
  auto far = I;
  far.translation()[0] = S(50);
  for (int i = 0; i < 10; ++i) {
    now->fetch_add(1);
    ASSERT_FALSE(test::touching<S>(model, I, *bvh, far));
  }
  EXPECT_LT(model.statistics().resident_nodes, before);
}

}  // namespace
}  // namespace bocst
