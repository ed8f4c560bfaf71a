// SPDX-License-Identifier: BSD-3-Clause
// Many poses of conservative models with a device: what they need grows in few batches, and answers are the CPU's.
#include <bocst/bocst.h>
#include <bocst/collide_poses.h>
#include <bocst/scene.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <memory>
#include <random>
#include <thread>
#include <vector>

#include "meshes.h"
#include "oracle/gl/compute_oracle.h"

namespace bocst {
namespace {

using test::Raw;
using Transforms = std::vector<fcl::Transform3d, Eigen::aligned_allocator<fcl::Transform3d>>;

Transforms randomPoses(std::size_t count, double spread) {
  std::mt19937_64 g(9);
  std::normal_distribution<double> n;
  std::uniform_real_distribution<double> u(-spread, spread);
  Transforms poses(count, fcl::Transform3d::Identity());
  for (fcl::Transform3d& X : poses) {
    Eigen::Vector4d q;
    for (int k = 0; k < 4; ++k) q[k] = n(g);
    X.linear() = Eigen::Quaterniond(q.normalized()).toRotationMatrix();
    for (int k = 0; k < 3; ++k) X.translation()[k] = u(g);
  }
  return poses;
}

Options optionsOf(OracleKind oracle, bool solid = false) {
  Options options;
  options.answer = Answer::kConservative;
  options.depth = 6;
  options.oracle = oracle;
  options.solid = solid;
  options.ttl = std::chrono::milliseconds(0);  // a device in software may take longer than the default
  return options;
}

// Each oracle, and `compute` once more with all walks on the device, which a software renderer would not be given.
struct Param {
  OracleKind oracle;
  bool walks_there;
};

class GrowTogether : public testing::TestWithParam<Param> {
 protected:
  void SetUp() override {
    setWalksAll(GetParam().walks_there);
    walked_before_ = walked();
  }
  void TearDown() override {
    setWalksAll(false);
    // Else the choice is the oracle's, by what it measured.
    EXPECT_TRUE(walked() > walked_before_ || !GetParam().walks_there);
  }

 private:
  void setWalksAll(bool all) {
    if (GetParam().oracle != OracleKind::kCompute) return;
    compute_ = std::dynamic_pointer_cast<oracle::gl::ComputeOracle>(oracle::makeOracle(OracleKind::kCompute));
    ASSERT_NE(compute_, nullptr);
    compute_->setWalksAll(all);
  }
  std::uint64_t walked() const { return compute_ != nullptr ? compute_->walked() : 0; }

  std::shared_ptr<oracle::gl::ComputeOracle> compute_;
  std::uint64_t walked_before_ = 0;
};

TEST_P(GrowTogether, PosesOfAPair) {
  const auto mesh_a = test::torus(30).mesh(), mesh_b = test::box({-0.1, 0.2, 0.3}, {0.4, 0.6, 0.4}).mesh();
  const Transforms X = randomPoses(400, 1.6);
  for (const bool solid : {false, true}) {
    const Modeld a(mesh_a, optionsOf(GetParam().oracle, solid)), b(mesh_b, optionsOf(GetParam().oracle, solid));
    const Modeld one_a(mesh_a, optionsOf(GetParam().oracle, solid)), one_b(mesh_b, optionsOf(GetParam().oracle, solid));
    const Modeld cpu_a(mesh_a, optionsOf(OracleKind::kCpu, solid)), cpu_b(mesh_b, optionsOf(OracleKind::kCpu, solid));
    std::vector<std::uint8_t> hits(X.size()), of_cpu(X.size()), one_by_one;
    collidePoses(a, b, X.data(), X.size(), hits.data());
    collidePoses(cpu_a, cpu_b, X.data(), X.size(), of_cpu.data());
    for (const fcl::Transform3d& X_AB : X) {
      fcl::CollisionResultd result;
      fcl::collide(&one_a, fcl::Transform3d(fcl::Transform3d::Identity()), &one_b, X_AB, fcl::CollisionRequestd(),
                   result);
      one_by_one.push_back(result.isCollision());
    }
    EXPECT_EQ(hits, of_cpu);
    EXPECT_EQ(hits, one_by_one);
    const auto together = a.statistics().oracle_batches, alone = one_a.statistics().oracle_batches;
    EXPECT_GT(alone, 30u);
    EXPECT_LT(together, alone / 2);
  }
}

// Threads that walk and grow the same two trees.
TEST_P(GrowTogether, PosesInThreads) {
  const auto mesh_a = test::torus(24).mesh(), mesh_b = test::box({-0.1, 0.2, 0.3}, {0.4, 0.6, 0.4}).mesh();
  const Transforms X = randomPoses(1500, 1.3);
  const Modeld a(mesh_a, optionsOf(GetParam().oracle)), b(mesh_b, optionsOf(GetParam().oracle));
  const Modeld cpu_a(mesh_a, optionsOf(OracleKind::kCpu)), cpu_b(mesh_b, optionsOf(OracleKind::kCpu));
  std::vector<std::uint8_t> hits(X.size()), of_cpu(X.size());
  collidePoses(a, b, X.data(), X.size(), hits.data(), 4);
  collidePoses(cpu_a, cpu_b, X.data(), X.size(), of_cpu.data());
  EXPECT_EQ(hits, of_cpu);
}

// A mesh so large that the other's lattice is lost in its rounding; and a model with itself.
TEST_P(GrowTogether, AnySizes) {
  Raw huge;
  huge.addTriangle({-1e30, -1e30, 0}, {1e30, -1e30, 0}, {0, 1e30, 0});
  const auto small = test::torus(12).mesh();
  const Modeld a(huge.mesh(), optionsOf(GetParam().oracle)), b(small, optionsOf(GetParam().oracle));
  const Transforms X = randomPoses(40, 0.3);
  std::vector<std::uint8_t> hits(X.size()), of_cpu(X.size());
  collidePoses(a, b, X.data(), X.size(), hits.data());
  EXPECT_EQ(hits, std::vector<std::uint8_t>(X.size(), 1));
  collidePoses(b, a, X.data(), X.size(), hits.data());
  EXPECT_EQ(hits, std::vector<std::uint8_t>(X.size(), 1));
  const Transforms far = randomPoses(40, 3);
  const Modeld cpu(small, optionsOf(OracleKind::kCpu));
  collidePoses(b, b, far.data(), far.size(), hits.data());
  collidePoses(cpu, cpu, far.data(), far.size(), of_cpu.data());
  EXPECT_EQ(hits, of_cpu);
}

// Depths, subdivisions, dimensions, margins and sizes that differ between the two.
TEST_P(GrowTogether, AnyOptions) {
  std::mt19937_64 g(17);
  const auto oneOf = [&g](const auto&... values) { return std::array{values...}[g() % sizeof...(values)]; };
  for (int i = 0; i < 24; ++i) {
    const double size = oneOf(1e-3, 0.05, 0.5, 1.0, 20.0, 1e4);
    Raw first = test::torus(18), second = test::torus(11);
    for (Eigen::Vector3d& v : second.vertices) v = size * v + Eigen::Vector3d(0.1, 0, 0);
    Options options[2];
    for (Options& o : options) {
      o = optionsOf(OracleKind::kCpu, oneOf(false, false, true));
      o.depth = oneOf(1, 2, 3, 4, 5, 6);
      o.subdivision = oneOf(Subdivision::kOctree, Subdivision::kBono);
      o.dimension = oneOf(0.0, 0.0, 7.0, 150.0);
      o.margin = oneOf(0.0, 0.0, 0.02);
    }
    const auto mesh_a = first.mesh(), mesh_b = second.mesh();
    const Modeld cpu_a(mesh_a, options[0]), cpu_b(mesh_b, options[1]);
    for (Options& o : options) o.oracle = GetParam().oracle;
    const Modeld a(mesh_a, options[0]), b(mesh_b, options[1]);
    const Transforms X = randomPoses(40, 1.4 * std::max(1.0, size));
    std::vector<std::uint8_t> hits(X.size()), of_cpu(X.size());
    collidePoses(a, b, X.data(), X.size(), hits.data());
    collidePoses(cpu_a, cpu_b, X.data(), X.size(), of_cpu.data());
    EXPECT_EQ(hits, of_cpu) << i;
  }
}

TEST_P(GrowTogether, StatesOfAScene) {
  const auto mesh = test::torus(24).mesh(), bar = test::box({-0.2, -0.1, -0.9}, {0.2, 0.1, 0.9}).mesh();
  const Transforms X = randomPoses(3 * 130, 1.5);
  std::vector<std::shared_ptr<Modeld>> models, of_states;
  const auto makeScene = [&](OracleKind oracle, std::vector<std::shared_ptr<Modeld>>& made) {
    auto scene = std::make_unique<Scened>();
    std::vector<Id> ids;
    for (int i = 0; i < 5; ++i) {
      made.push_back(std::make_shared<Modeld>(i % 2 == 0 ? mesh : bar, optionsOf(oracle)));
      if (i < 3) {
        ids.push_back(scene->addMoving(made.back()));
      } else {
        fcl::Transform3d X_WG = fcl::Transform3d::Identity();
        X_WG.translation()[0] = i - 2;
        ids.push_back(scene->addFixed(made.back(), X_WG));
      }
    }
    // Of a pair that may touch, contacts are none of the state's.
    scene->ignore(ids[0], ids[3]);
    scene->ignore(ids[1], ids[2]);
    return scene;
  };
  const auto batchesOf = [](const std::vector<std::shared_ptr<Modeld>>& made) {
    std::uint64_t batches = 0;
    for (const auto& model : made) batches += model->statistics().oracle_batches;
    return batches;
  };
  const std::size_t states = X.size() / 3;
  std::vector<std::uint8_t> hits(states), of_cpu(states), one_by_one;
  makeScene(GetParam().oracle, models)->collisions(X.data(), states, hits.data());
  {
    std::vector<std::shared_ptr<Modeld>> cpu_models;
    makeScene(OracleKind::kCpu, cpu_models)->collisions(X.data(), states, of_cpu.data());
  }
  const auto scene = makeScene(GetParam().oracle, of_states);
  for (std::size_t k = 0; k < states; ++k) one_by_one.push_back(scene->collides(X.data() + 3 * k));
  EXPECT_EQ(hits, of_cpu);
  EXPECT_EQ(hits, one_by_one);
  EXPECT_GT(batchesOf(of_states), 100u);
  EXPECT_LT(batchesOf(models), batchesOf(of_states) / 2);
}

// A device that is lost while batches are under way.
TEST(GrowTogetherOnDevices, ThatAreLostMeanwhile) {
  const auto mesh_a = test::torus(60).mesh(), mesh_b = test::torus(40, 0.3).mesh();
  const Transforms X = randomPoses(1200, 1.3);
  const Modeld cpu_a(mesh_a, optionsOf(OracleKind::kCpu)), cpu_b(mesh_b, optionsOf(OracleKind::kCpu));
  std::vector<std::uint8_t> hits(X.size()), of_cpu(X.size());
  collidePoses(cpu_a, cpu_b, X.data(), X.size(), of_cpu.data());
  for (int i = 0; i < 12; ++i) {
    const OracleKind kind = i % 2 == 0 ? OracleKind::kCompute : OracleKind::kOcclusion;
    const auto device = std::dynamic_pointer_cast<oracle::gl::DeviceOracle>(oracle::makeOracle(kind));
    ASSERT_NE(device, nullptr);
    const Modeld a(mesh_a, optionsOf(kind)), b(mesh_b, optionsOf(kind));
    std::thread loses([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(4 * i));
      device->thread().lose("a test says so");
    });
    collidePoses(a, b, X.data(), X.size(), hits.data());
    loses.join();
    EXPECT_EQ(hits, of_cpu) << i;
  }
}

// All walks are the device's.
class WalksOnTheDevice : public testing::Test {
 protected:
  void SetUp() override {
    compute = std::dynamic_pointer_cast<oracle::gl::ComputeOracle>(oracle::makeOracle(OracleKind::kCompute));
    ASSERT_NE(compute, nullptr);
    compute->setWalksAll(true);
  }
  void TearDown() override { compute->setWalksAll(false); }

  std::shared_ptr<oracle::gl::ComputeOracle> compute;
};

// Its table of nodes has all that grew: else the host would look at some, and the device again at the others.
TEST_F(WalksOnTheDevice, WalkSettledPosesOnce) {
  const auto mesh = test::torus(30).mesh();
  const Modeld a(mesh, optionsOf(OracleKind::kCompute)), b(mesh, optionsOf(OracleKind::kCompute));
  const Transforms X = randomPoses(1500, 1.5);
  std::vector<std::uint8_t> hits(X.size());
  collidePoses(a, b, X.data(), X.size(), hits.data());
  const std::uint64_t first = compute->walked();
  collidePoses(a, b, X.data(), X.size(), hits.data());
  EXPECT_LE(compute->walked() - first, X.size());
}

TEST_F(WalksOnTheDevice, GrowAboutWhatSingleQueriesNeed) {
  const auto mesh = test::torus(30).mesh();
  const Modeld a(mesh, optionsOf(OracleKind::kCompute)), b(mesh, optionsOf(OracleKind::kCompute));
  const Modeld cpu_a(mesh, optionsOf(OracleKind::kCpu)), cpu_b(mesh, optionsOf(OracleKind::kCpu));
  const Transforms X = randomPoses(400, 1.5);
  std::vector<std::uint8_t> hits(X.size());
  collidePoses(a, b, X.data(), X.size(), hits.data());
  collidePoses(cpu_a, cpu_b, X.data(), X.size(), hits.data());
  EXPECT_LT(a.statistics().resident_nodes, 1.5 * static_cast<double>(cpu_a.statistics().resident_nodes));
}

// Near misses of faces need thousands of nodes, more than a walk gets in all its rounds on the device.
TEST_F(WalksOnTheDevice, EndWhereMuchMustGrow) {
  const auto mesh = test::box({-1, -1, -0.01}, {1, 1, 0}).mesh();
  Options options = optionsOf(OracleKind::kCompute);
  options.depth = 7;
  const Modeld a(mesh, options), b(mesh, options);
  options.oracle = OracleKind::kCpu;
  const Modeld cpu_a(mesh, options), cpu_b(mesh, options);
  Transforms X = randomPoses(12, 0.002);
  for (std::size_t i = 0; i < X.size(); ++i) {
    X[i].linear().setIdentity();
    X[i].translation()[2] += 0.02 + 0.012 * static_cast<double>(i);
  }
  std::vector<std::uint8_t> hits(X.size()), of_cpu(X.size());
  collidePoses(a, b, X.data(), X.size(), hits.data());
  collidePoses(cpu_a, cpu_b, X.data(), X.size(), of_cpu.data());
  EXPECT_EQ(hits, of_cpu);
  const auto met = std::count(of_cpu.begin(), of_cpu.end(), 1);
  EXPECT_GT(met, 0);
  EXPECT_LT(met, static_cast<std::ptrdiff_t>(X.size()));
}

// A model beside which nothing happens keeps what walks on the device came to.
TEST_F(WalksOnTheDevice, KeepBranches) {
  auto now = std::make_shared<Clock::time_point>();
  Options options = optionsOf(OracleKind::kCompute);
  options.clock = [now] { return *now; };
  options.ttl = std::chrono::seconds(2);
  const auto mesh = test::torus(30).mesh();
  Modeld a(mesh, options), b(mesh, options);
  const Transforms X = randomPoses(60, 1.5);
  std::vector<std::uint8_t> hits(X.size());
  collidePoses(a, b, X.data(), X.size(), hits.data());
  const std::size_t grown = a.statistics().resident_nodes, device = a.statistics().device_bytes;
  const auto expansions = a.statistics().expansions;
  EXPECT_GT(grown, 100u);
  for (int i = 0; i < 5; ++i) {
    *now += std::chrono::milliseconds(1500);
    collidePoses(a, b, X.data(), X.size(), hits.data());
  }
  // Branches that only the first walks needed may go; none has to grow again.
  EXPECT_EQ(a.statistics().expansions, expansions);
  for (int i = 0; i < 8; ++i) {
    *now += std::chrono::seconds(10);
    a.prune(*now);
  }
  EXPECT_EQ(a.statistics().resident_nodes, 1u);
  EXPECT_LT(a.statistics().device_bytes, device);  // the table went, too
}

INSTANTIATE_TEST_SUITE_P(Oracles, GrowTogether,
                         testing::Values(Param{OracleKind::kCompute, false}, Param{OracleKind::kCompute, true},
                                         Param{OracleKind::kOcclusion, false}),
                         [](const auto& p) {
                           if (p.param.oracle == OracleKind::kOcclusion) return "occlusion";
                           return p.param.walks_there ? "compute_walks" : "compute";
                         });

}  // namespace
}  // namespace bocst
