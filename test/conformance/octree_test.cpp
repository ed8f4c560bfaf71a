// SPDX-License-Identifier: BSD-3-Clause
// fcl::OcTree as a partner: against FCL's own mesh query where that is right, and against all boxes and triangles.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <vector>

#include "conformance/octrees.h"
#include "conformance/reference.h"

namespace bocst {
namespace {

using Eigen::Vector3d;
using test::cloud;
using test::gap;
using test::Raw;

template <typename S>
class OcTrees : public testing::Test {};
TYPED_TEST_SUITE(OcTrees, test::Scalars);

template <typename S>
fcl::CollisionResult<S> ask(const fcl::CollisionGeometry<S>& a, const fcl::Transform3<S>& X,
                            const fcl::CollisionGeometry<S>& b, const fcl::Transform3<S>& Y, fcl::GJKSolverType solver,
                            bool contacts = false, std::size_t most = 1000000) {
  fcl::CollisionRequest<S> request(most, contacts);
  request.gjk_solver_type = solver;
  fcl::CollisionResult<S> result;
  fcl::collide(&a, X, &b, Y, request, result);
  return result;
}

TYPED_TEST(OcTrees, ContactsNameTheirCells) {
  using S = TypeParam;
  const Raw raw = test::torus(12);
  const auto octree = cloud<S>(3, 300);
  const Model<S> model(raw.mesh());
  std::mt19937_64 g(4);
  std::size_t found = 0, all = 0;
  for (int i = 0; i < 10; ++i) {
    const auto X = test::pose<S>(test::randomRotation(g), {0, 0, 0});
    const auto Y = test::pose<S>(test::randomRotation(g), test::randomDirection(g) * 0.8);
    const auto ours = ask<S>(model, X, *octree, Y, fcl::GST_LIBCCD, true);
    const auto turned = ask<S>(*octree, Y, model, X, fcl::GST_LIBCCD, true);
    std::map<std::pair<std::intptr_t, std::intptr_t>, fcl::Vector3<S>> normals;
    for (std::size_t k = 0; k < turned.numContacts(); ++k) {
      const auto& c = turned.getContact(k);
      ASSERT_EQ(c.o1, octree.get());
      normals[{c.b1, c.b2}] = c.normal;
    }
    for (std::size_t k = 0; k < ours.numContacts(); ++k) {
      const auto& c = ours.getContact(k);
      ASSERT_EQ(c.o1, &model);
      ASSERT_EQ(c.o2, octree.get());
      ASSERT_EQ(c.normal, -(normals[{c.b2, c.b1}]));
      ASSERT_GE(c.penetration_depth, 0);
      fcl::AABB<S> cell;
      const fcl::Vector3<S> in_octree = Y.inverse(Eigen::Isometry) * c.pos;
      const auto* node = octree->getNodeByQueryCellId(c.b2, in_octree, &cell);
      ++all;
      if (node == nullptr) continue;  // on the border of two cells FCL may look at the wrong one
      ++found;
      ASSERT_TRUE(octree->isNodeOccupied(node));
      ASSERT_LT(cell.distance(fcl::AABB<S>(in_octree)), 1e-5);
      // Moved back by the depth, the triangle is off the cell.
      const Vector3d away = -c.normal.template cast<double>() * static_cast<double>(c.penetration_depth + S(1e-5));
      auto Z = X;
      Z.translation() += away.template cast<S>();
      const auto middle = cell.center();
      const S side = cell.width();
      ASSERT_GT(gap<S>(raw, static_cast<std::size_t>(c.b1), Z, {middle[0], middle[1], middle[2], side, 0, 0}, Y), 0);
    }
  }
  EXPECT_GT(all, 100u);
  EXPECT_GT(found, all * 9 / 10);
}

TEST(OcTreesDouble, CostsEqualFcls) {
  const Raw raw = test::torus(12);
  const auto theirs = test::bvh<fcl::OBBRSSd>(raw);
  const auto octree = cloud<double>(5, 200);
  Modeld model(raw.mesh());
  std::mt19937_64 g(6);
  for (const double density : {1.0, 0.5, 0.0}) {  // occupied, uncertain, free
    model.cost_density = theirs->cost_density = density;
    for (int i = 0; i < 4; ++i) {
      const auto X = test::pose<double>(test::randomRotation(g), {0, 0, 0});
      const auto Y = test::pose<double>(test::randomRotation(g), test::randomDirection(g) * 0.8);
      const auto cost = [&](const fcl::CollisionGeometryd& a, const auto& XA, const fcl::CollisionGeometryd& b,
                            const auto& XB, bool approximate) {
        const fcl::CollisionRequestd request(2, false, 1000000, true, approximate);
        fcl::CollisionResultd result;
        fcl::collide(&a, XA, &b, XB, request, result);
        std::vector<fcl::CostSourced> sources;
        result.getCostSources(sources);
        double total = 0;
        for (const auto& s : sources) total += s.total_cost;
        EXPECT_EQ(result.numContacts(), density == 1 ? 2u : 0u);
        return std::make_pair(sources.size(), total);
      };
      const auto ours = cost(model, X, *octree, Y, false), reference = cost(*octree, Y, *theirs, X, false);
      EXPECT_EQ(ours.first > 0, density > 0);
      EXPECT_NEAR(static_cast<double>(ours.first), static_cast<double>(reference.first), 0.01 * ours.first);
      EXPECT_NEAR(ours.second, reference.second, 1e-3 * ours.second);
      const auto rough = cost(*octree, Y, model, X, true);
      EXPECT_EQ(rough.first > 0, density > 0);
      EXPECT_GE(rough.second, 0);
    }
  }
}

TEST(OcTreesDouble, UncertainCellsCostButMakeNoContacts) {
  const auto map = std::make_shared<octomap::OcTree>(0.1);
  map->setNodeValue(octomap::point3d(0.05f, 0.05f, 0.05f), 0)->setLogOdds(0);
  map->setNodeValue(octomap::point3d(0.25f, 0.05f, 0.05f), 0)->setLogOdds(3);
  map->updateInnerOccupancy();
  fcl::OcTreed octree{std::shared_ptr<const octomap::OcTree>(map)};
  octree.setOccupancyThres(0.8);
  octree.setFreeThres(0.2);
  const Modeld model(test::box({0, 0, 0}, {0.3, 0.09, 0.09}).mesh());
  const auto I = test::pose<double>(Eigen::Matrix3d::Identity(), {0, 0, 0});
  const fcl::CollisionRequestd request(1000, true, 1000, true, false);
  fcl::CollisionResultd result;
  fcl::collide<double>(&model, I, &octree, I, request, result);
  ASSERT_GT(result.numContacts(), 0u);
  for (std::size_t i = 0; i < result.numContacts(); ++i) EXPECT_GT(result.getContact(i).pos.x(), 0.19) << i;
  std::vector<fcl::CostSourced> sources;
  result.getCostSources(sources);
  EXPECT_TRUE(std::any_of(sources.begin(), sources.end(), [](const auto& c) { return c.aabb_max.x() < 0.11; }));
  EXPECT_TRUE(std::any_of(sources.begin(), sources.end(), [](const auto& c) { return c.aabb_min.x() > 0.19; }));
}

// The box about the mesh costs where it meets a cell. FCL computes that for all cells, but keeps what nobody has seen.
TEST(OcTreesDouble, ApproximateCostsAreFclsAndThoseOfAllCells) {
  const Raw raw = test::torus(12);
  const auto theirs = test::bvh<fcl::AABBd>(raw);  // whose box about the mesh is ours
  const auto map = test::cloudMap(13, 150);
  const auto octree = cloud<double>(map);
  const auto map_threshold = octree->getOccupancyThres();
  Modeld model(raw.mesh());
  const Eigen::AlignedBox3d& bounds = model.mesh()->bounds();
  std::mt19937_64 g(14);
  for (const double density : {1.0, 0.5}) {  // occupied, uncertain
    model.cost_density = theirs->cost_density = density;
    for (int i = 0; i < 6; ++i) {
      const auto X = test::pose<double>(test::randomRotation(g), {0, 0, 0});
      const auto Y = test::pose<double>(test::randomRotation(g), test::randomDirection(g) * 0.8);
      const auto ask = [&](const fcl::CollisionGeometryd& a, const auto& XA, const fcl::CollisionGeometryd& b,
                           const auto& XB) {
        fcl::CollisionResultd result;
        fcl::collide(&a, XA, &b, XB, fcl::CollisionRequestd(2, false, 1000000, true, true), result);
        std::vector<fcl::CostSourced> sources;
        result.getCostSources(sources);
        return sources;
      };
      const auto ours = ask(model, X, *octree, Y), turned = ask(*octree, Y, model, X);
      const auto reference = ask(*octree, Y, *theirs, X);
      ASSERT_EQ(ours.size(), turned.size());
      ASSERT_GT(reference.size(), 0u);
      double unseen = 0, total = 0, expected = 0;
      for (const auto& s : reference) {
        ASSERT_NEAR(s.cost_density, map_threshold * density, 1e-12);
        unseen += s.total_cost;
        ASSERT_TRUE(std::any_of(ours.begin(), ours.end(), [&](const fcl::CostSourced& o) {
          return o.aabb_min.isApprox(s.aabb_min, 1e-9) && o.aabb_max.isApprox(s.aabb_max, 1e-9) &&
                 std::abs(o.total_cost - s.total_cost) <= 1e-9 * s.total_cost;
        }));
      }
      for (const auto& s : ours) total += s.total_cost;
      // And of each cell that is occupied or uncertain, its box in the world and that of the mesh's box.
      Vector3d corners[8];
      Eigen::AlignedBox3d about_mesh;
      for (int k = 0; k < 8; ++k) {
        corners[k] = X * bounds.corner(static_cast<Eigen::AlignedBox3d::CornerType>(k));
        about_mesh.extend(corners[k]);
      }
      std::size_t cells = 0;
      for (auto leaf = map->begin_leafs(); leaf != map->end_leafs(); ++leaf) {
        if (octree->isNodeFree(&*leaf)) continue;
        const Vector3d center(leaf.getX(), leaf.getY(), leaf.getZ()), half = Vector3d::Constant(leaf.getSize() / 2);
        const double occupancy = leaf->getOccupancy();
        Vector3d c[8];
        for (int k = 0; k < 8; ++k) c[k] = Y.inverse(Eigen::Isometry) * corners[k] - center;
        if (!query::BoxShape(half).gap({c, 8}, 0).isTouching()) continue;
        const Vector3d reach = Y.linear().cwiseAbs() * half, middle = Y * center;
        const Eigen::AlignedBox3d shared = about_mesh.intersection({middle - reach, middle + reach});
        expected += shared.volume() * occupancy * density;
        ++cells;
      }
      EXPECT_EQ(ours.size(), reference.size() + cells);
      EXPECT_NEAR(total, unseen + expected, 1e-6 * total);
      ASSERT_GT(cells, 5u);
    }
  }
}

TYPED_TEST(OcTrees, EmptyOnesAreNowhere) {
  using S = TypeParam;
  const fcl::OcTree<S> octree(S(0.1));
  const Model<S> model(test::torus(12).mesh());
  const auto I = test::pose<S>(Eigen::Matrix3d::Identity(), {0, 0, 0});
  EXPECT_FALSE(test::touching<S>(model, I, octree, I));
  EXPECT_FALSE(test::touching<S>(octree, I, model, I));
  fcl::DistanceRequest<S> request;
  fcl::DistanceResult<S> result;
  EXPECT_EQ(fcl::distance(&octree, I, &model, I, request, result), std::numeric_limits<S>::max());
  // Nothing in it is known, which costs where costs are asked for.
  for (const bool costs : {false, true}) {
    const fcl::CollisionRequest<S> collision(1, false, 10, costs);
    fcl::CollisionResult<S> none;
    EXPECT_EQ(fcl::collide(&model, I, &octree, I, collision, none), 0u);
    std::vector<fcl::CostSource<S>> sources;
    none.getCostSources(sources);
    EXPECT_EQ(sources.empty(), !costs);
  }
}

// Near the threshold, and for extreme thresholds.
TYPED_TEST(OcTrees, OccupancyIsFcls) {
  using S = TypeParam;
  const Raw raw = test::box({-0.02, -0.02, -0.02}, {0.02, 0.02, 0.02});
  const Model<S> model(raw.mesh());
  const auto I = test::pose<S>(Eigen::Matrix3d::Identity(), {0, 0, 0});
  for (const double log_odds : {-30.0, -3.0, 0.0, 0.5, 8.0, 30.0, 40.0}) {
    const auto map = std::make_shared<octomap::OcTree>(0.1);
    std::vector<octomap::point3d> places;
    for (int k = -12; k <= 12; ++k) {
      const double off = k == 0 ? 0 : std::copysign(std::pow(10.0, std::abs(k) % 6 - 5), k);
      places.emplace_back(0.2f * static_cast<float>(k) + 0.05f, 0.05f, 0.05f);
      map->setNodeValue(places.back(), 0)
          ->setLogOdds(static_cast<float>(log_odds + off));  // beyond octomap's own limits
    }
    map->updateInnerOccupancy();
    fcl::OcTree<S> octree{std::shared_ptr<const octomap::OcTree>(map)};
    octree.setOccupancyThres(static_cast<S>(1 - 1 / (1 + std::exp(log_odds))));
    for (const octomap::point3d& place : places) {
      const auto X = test::pose<S>(Eigen::Matrix3d::Identity(), {place.x(), place.y(), place.z()});
      ASSERT_EQ(test::touching<S>(model, X, octree, I), octree.isNodeOccupied(map->search(place)))
          << log_odds << " at " << place.x();
    }
  }
}

}  // namespace
}  // namespace bocst
