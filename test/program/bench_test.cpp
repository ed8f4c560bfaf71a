// SPDX-License-Identifier: BSD-3-Clause
// What `bench` is made of.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "bench/bench_report.h"
#include "bench/heap.h"
#include "mesh/health.h"
#include "mesh/subdivide.h"
#include "meshes.h"
#include "pairs/query_pair.h"
#include "pairs/sliding_path.h"

namespace bocst {
namespace {

using program::BenchReport;
using program::BocstPair;
using program::FclPair;
using program::HandedOver;
using program::MeshArrays;
using program::Scalar;
using Unit = program::BenchRow::Unit;

std::unique_ptr<BocstPair> modelsOf(const Mesh& a, const Mesh& b) {
  return program::makeBocstPair(HandedOver(a), HandedOver(b), Options{});
}

std::unique_ptr<FclPair> fclOf(const Mesh& a, const Mesh& b, Scalar scalar = Scalar::kDouble) {
  return program::buildFclPair(program::FclTree::kObbRss, scalar, MeshArrays(a, scalar), MeshArrays(b, scalar));
}

double radiusOf(const Mesh& mesh) { return mesh.bounds().sizes().norm() / 2; }

TEST(Subdivide, KeepsTheSurface) {
  for (const test::Raw& raw : {test::torus(24), test::box({0, 0, 0}, {1, 2, 3}), test::soup(50, 3)}) {
    const std::shared_ptr<const Mesh> mesh = raw.mesh();
    const std::shared_ptr<const Mesh> fine = program::subdivided(mesh, 2);
    EXPECT_EQ(fine->triangleCount(), 16 * mesh->triangleCount());
    const program::Health before = program::healthOf(*mesh), after = program::healthOf(*fine);
    EXPECT_NEAR(after.area, before.area, 1e-12 * before.area);
    EXPECT_EQ(after.components, before.components);
    EXPECT_EQ(after.watertight(), before.watertight());
    EXPECT_EQ(after.repeated_vertices, before.repeated_vertices);
    EXPECT_EQ(after.open_edges, 4 * before.open_edges);
    EXPECT_TRUE(fine->bounds().isApprox(mesh->bounds()));
  }
}

TEST(Subdivide, GivesEachEdgeOneVertex) {
  const std::shared_ptr<const Mesh> cube = test::box({0, 0, 0}, {1, 1, 1}).mesh();
  const std::shared_ptr<const Mesh> fine = program::subdivided(*cube);
  EXPECT_EQ(fine->vertexCount(), 8u + 18u);  // 12 edges and 6 diagonals
  for (std::size_t i = 0; i < cube->vertexCount(); ++i) EXPECT_EQ(fine->vertex(i), cube->vertex(i));
  EXPECT_EQ(program::subdivided(cube, 0), cube);
}

TEST(Subdivide, TakesTrianglesWithRepeatedCorners) {
  const std::shared_ptr<const Mesh> mesh = test::Raw{{{0, 0, 0}, {1, 0, 0}}, {{0, 1, 1}, {0, 0, 0}}}.mesh();
  const std::shared_ptr<const Mesh> fine = program::subdivided(*mesh);
  EXPECT_EQ(fine->triangleCount(), 8u);
  EXPECT_TRUE(fine->bounds().isApprox(mesh->bounds()));
}

class SlidingPath : public ::testing::TestWithParam<double> {
 protected:
  SlidingPath() {
    test::Raw small = test::torus(20);
    for (Eigen::Vector3d& v : small.vertices) v = GetParam() * v + Eigen::Vector3d(5, -7, 2);
    mesh_b_ = small.mesh();
  }

  static constexpr std::size_t kFrames = 400;
  const std::shared_ptr<const Mesh> mesh_a_ = test::torus(30).mesh();
  std::shared_ptr<const Mesh> mesh_b_;
};

INSTANTIATE_TEST_SUITE_P(Sizes, SlidingPath, ::testing::Values(1.0, 0.05, 20.0));

TEST_P(SlidingPath, StaysAtTheSurface) {
  const auto fcl = fclOf(*mesh_a_, *mesh_b_);
  const auto path = program::slidingPath(*mesh_a_, *mesh_b_, *modelsOf(*mesh_a_, *mesh_b_), 3, kFrames);
  ASSERT_EQ(path.size(), kFrames);
  std::size_t hits = 0, near = 0;
  for (const Eigen::Isometry3d& X_AB : path) {
    const bool hit = fcl->touch(X_AB);
    hits += hit;
    near += hit || fcl->distance(X_AB) < 0.1 * std::min(radiusOf(*mesh_a_), radiusOf(*mesh_b_));
  }
  EXPECT_GT(hits, kFrames / 5);
  EXPECT_LT(hits, kFrames);
  EXPECT_GT(near, kFrames * 2 / 3);
}

TEST_P(SlidingPath, IsSmooth) {
  const auto path = program::slidingPath(*mesh_a_, *mesh_b_, *modelsOf(*mesh_a_, *mesh_b_), 3, kFrames);
  const double smaller = std::min(radiusOf(*mesh_a_), radiusOf(*mesh_b_));
  const auto middle = [&](const Eigen::Isometry3d& X_AB) { return X_AB * mesh_b_->bounds().center(); };
  for (std::size_t i = 1; i < path.size(); ++i) {
    // In the frame of the larger mesh, about which the smaller one moves.
    const bool a_is_larger = radiusOf(*mesh_a_) >= radiusOf(*mesh_b_);
    const Eigen::Vector3d center = mesh_a_->bounds().center();
    const double step = a_is_larger ? (middle(path[i]) - middle(path[i - 1])).norm()
                                    : (path[i].inverse() * center - path[i - 1].inverse() * center).norm();
    EXPECT_LT(step, 0.1 * smaller) << "frame " << i;
    EXPECT_LT(Eigen::AngleAxisd(path[i].linear().transpose() * path[i - 1].linear()).angle(), 0.01) << "frame " << i;
  }
}

TEST_P(SlidingPath, FollowsFromTheSeed) {
  const auto make = [&](std::uint64_t seed) {
    return program::slidingPath(*mesh_a_, *mesh_b_, *modelsOf(*mesh_a_, *mesh_b_), seed, 10);
  };
  EXPECT_TRUE(make(1)[9].isApprox(make(1)[9], 0));
  EXPECT_FALSE(make(1)[9].isApprox(make(2)[9], 1e-3));
}

/// The same answers after A moved, whoever brings it there.
void expectEqualAfterWaves(Scalar scalar) {
  const std::shared_ptr<const Mesh> mesh = test::torus(40).mesh();
  MeshArrays moved(*mesh, scalar);
  const auto bocst = program::makeBocstPair(scalar, moved, moved, Options{});
  const auto rebuilt = fclOf(*mesh, *mesh, scalar), replaced = fclOf(*mesh, *mesh, scalar),
             updated = fclOf(*mesh, *mesh, scalar);
  std::mt19937_64 g(4);
  std::size_t hits = 0;
  for (int frame = 0; frame < 6; ++frame) {
    for (std::size_t i = 0; i < moved.vertices.size(); ++i) {
      const Eigen::Vector3d& v = mesh->vertex(i);
      moved.vertices[i] = v + 0.1 * Eigen::Vector3d(std::sin(3 * v.y() + frame), std::cos(2 * v.z() + frame), 0);
      if (scalar == Scalar::kFloat) moved.vertices[i] = moved.vertices[i].cast<float>().cast<double>();
    }
    bocst->updateA(moved.vertices);
    rebuilt->rebuildA(moved);
    replaced->refitA(moved.vertices, FclPair::Refit::kNewPositions);
    updated->refitA(moved.vertices, FclPair::Refit::kBothPositions);
    for (int i = 0; i < 30; ++i) {
      Eigen::Isometry3d X_AB = Eigen::Isometry3d::Identity();
      X_AB.linear() = test::randomRotation(g).cast<float>().cast<double>();
      X_AB.translation() = (radiusOf(*mesh) * (0.5 + 0.05 * i) * test::randomDirection(g)).cast<float>().cast<double>();
      const bool expected = rebuilt->touch(X_AB);
      hits += expected;
      EXPECT_EQ(bocst->touch(X_AB), expected);
      EXPECT_EQ(replaced->touch(X_AB), expected);
      EXPECT_EQ(updated->touch(X_AB), expected);
    }
  }
  EXPECT_GT(hits, 20u);
  EXPECT_LT(hits, 160u);
}

TEST(MovedVertices, AreTheSameForAllInDouble) { expectEqualAfterWaves(Scalar::kDouble); }
TEST(MovedVertices, AreTheSameForAllInFloat) { expectEqualAfterWaves(Scalar::kFloat); }

TEST(Contacts, AreCountedAsTheyAreListed) {
  const std::shared_ptr<const Mesh> mesh = test::torus(30).mesh();
  Eigen::Isometry3d X_AB = Eigen::Isometry3d::Identity();
  X_AB.translation() = Eigen::Vector3d(0.5, 0.3, 0.2);
  const auto pair = modelsOf(*mesh, *mesh);
  EXPECT_GT(pair->countContacts(X_AB), 10u);
  EXPECT_EQ(pair->countContacts(X_AB), pair->contacts(X_AB).size());
  EXPECT_GE(fclOf(*mesh, *mesh)->countContacts(X_AB), pair->countContacts(X_AB));  // FCL may list a pair twice
}

TEST(Heap, TellsWhatIsHeld) {
  const auto before = program::heapBytes();
#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  ASSERT_TRUE(before);
  for (const std::size_t size : {std::size_t{100000}, std::size_t{10000000}}) {  // from the heap, and mapped
    std::vector<char> held(size);
    EXPECT_GE(*program::heapBytes(), *before + size);
    EXPECT_LT(*program::heapBytes(), *before + size + 100000);
  }
  EXPECT_LT(*program::heapBytes(), *before + 50000);
#else
  EXPECT_FALSE(before) << "such an allocator does not tell";
#endif
}

TEST(BenchReport, SaysHowManyTimesBetter) {
  BenchReport report;
  report.begin("warm");
  report.compare("query_median", "query, median", Unit::kMicroseconds, 2, 10);
  report.compare("rate", "rate", Unit::kQueriesPerSecond, 10, 2);
  report.figure("alone", "alone", Unit::kFrames, 7);
  EXPECT_EQ(report.csv(),
            "scenario,row,unit,bocst,fcl,ratio\nwarm,query_median,us,2,10,5\nwarm,rate,queries/s,10,2,5\n"
            "warm,alone,frames,7,,\n");
  const program::Json json = report.json({{"a", "x"}});
  EXPECT_EQ(json.at("a"), "x");
  EXPECT_EQ(json.at("ratio").at("query_median"), 5);
  EXPECT_TRUE(json.at("ratio").at("first_answer").is_null());
  EXPECT_EQ(json.at("microseconds").size(), 1u);
  EXPECT_TRUE(json.at("rows").at(2).at("fcl").is_null());
}

TEST(BenchReport, HasTheFiguresOfTimes) {
  BenchReport report;
  report.compareTimes("query", "query", {1, 2, 6}, {30, 10, 20});
  const program::Json ratio = report.json(program::Json::object()).at("ratio");
  EXPECT_DOUBLE_EQ(ratio.at("query_median"), 10);
  EXPECT_DOUBLE_EQ(ratio.at("query_mean"), 20.0 / 3);
  EXPECT_DOUBLE_EQ(ratio.at("query_p95"), 29.0 / 5.6);
}

TEST(BenchReport, ComplainsAboutDifferentAnswers) {
  BenchReport report;
  report.begin("warm");
  report.verdicts({true, false}, {true, false});
  EXPECT_NO_THROW(report.check());
  EXPECT_EQ(report.json(program::Json::object()).at("verdicts").at("equal"), true);
  report.begin("moving");
  Eigen::Isometry3d X_AB = Eigen::Isometry3d::Identity();
  X_AB.translation() = Eigen::Vector3d(1, 2, 3);
  report.verdicts({true, true}, {true, false}, {Eigen::Isometry3d::Identity(), X_AB});
  try {
    report.check();
    FAIL() << "no complaint";
  } catch (const std::runtime_error& e) {
    EXPECT_NE(std::string(e.what()).find("verdicts of moving (only bocst finds a contact at --pose 1,2,3,1,0,0,0)"),
              std::string::npos)
        << e.what();
    EXPECT_EQ(std::string(e.what()).find("warm"), std::string::npos) << e.what();
  }
  const program::Json verdicts = report.json(program::Json::object()).at("verdicts");
  EXPECT_EQ(verdicts.at("equal"), false);
  EXPECT_NE(verdicts.at("bocst"), verdicts.at("fcl"));
}

}  // namespace
}  // namespace bocst
