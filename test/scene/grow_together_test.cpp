// SPDX-License-Identifier: BSD-3-Clause
// Many poses of conservative models with a device: what they need grows in few batches, and answers are the CPU's.
#include <bocst/bocst.h>
#include <bocst/collide_poses.h>
#include <bocst/scene.h>
#include <gtest/gtest.h>

#include <memory>
#include <random>
#include <vector>

#include "meshes.h"

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
  return options;
}

class GrowTogether : public testing::TestWithParam<OracleKind> {};

TEST_P(GrowTogether, PosesOfAPair) {
  const auto mesh_a = test::torus(30).mesh(), mesh_b = test::box({-0.1, 0.2, 0.3}, {0.4, 0.6, 0.4}).mesh();
  const Transforms X = randomPoses(400, 1.6);
  for (const bool solid : {false, true}) {
    const Modeld a(mesh_a, optionsOf(GetParam(), solid)), b(mesh_b, optionsOf(GetParam(), solid));
    const Modeld one_a(mesh_a, optionsOf(GetParam(), solid)), one_b(mesh_b, optionsOf(GetParam(), solid));
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

// A mesh so large that the other's lattice is lost in its rounding; and a model with itself.
TEST_P(GrowTogether, AnySizes) {
  Raw huge;
  huge.vertices = {{-1e30, -1e30, 0}, {1e30, -1e30, 0}, {0, 1e30, 0}};
  huge.triangles.emplace_back(0, 1, 2);
  const auto small = test::torus(12).mesh();
  const Modeld a(huge.mesh(), optionsOf(GetParam())), b(small, optionsOf(GetParam()));
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

TEST_P(GrowTogether, StatesOfAScene) {
  const auto mesh = test::torus(24).mesh(), bar = test::box({-0.2, -0.1, -0.9}, {0.2, 0.1, 0.9}).mesh();
  const Transforms X = randomPoses(3 * 130, 1.5);
  std::vector<std::shared_ptr<Modeld>> models, of_states;
  const auto makeScene = [&](OracleKind oracle, std::vector<std::shared_ptr<Modeld>>& made) {
    auto scene = std::make_unique<Scened>();
    for (int i = 0; i < 5; ++i) {
      made.push_back(std::make_shared<Modeld>(i % 2 == 0 ? mesh : bar, optionsOf(oracle)));
      if (i < 3) {
        scene->addMoving(made.back());
      } else {
        fcl::Transform3d X_WG = fcl::Transform3d::Identity();
        X_WG.translation()[0] = i - 2;
        scene->addFixed(made.back(), X_WG);
      }
    }
    return scene;
  };
  const auto batchesOf = [](const std::vector<std::shared_ptr<Modeld>>& made) {
    std::uint64_t batches = 0;
    for (const auto& model : made) batches += model->statistics().oracle_batches;
    return batches;
  };
  const std::size_t states = X.size() / 3;
  std::vector<std::uint8_t> hits(states), of_cpu(states), one_by_one;
  makeScene(GetParam(), models)->collisions(X.data(), states, hits.data());
  {
    std::vector<std::shared_ptr<Modeld>> cpu_models;
    makeScene(OracleKind::kCpu, cpu_models)->collisions(X.data(), states, of_cpu.data());
  }
  const auto scene = makeScene(GetParam(), of_states);
  for (std::size_t k = 0; k < states; ++k) one_by_one.push_back(scene->collides(X.data() + 3 * k));
  EXPECT_EQ(hits, of_cpu);
  EXPECT_EQ(hits, one_by_one);
  EXPECT_GT(batchesOf(of_states), 100u);
  EXPECT_LT(batchesOf(models), batchesOf(of_states) / 2);
}

INSTANTIATE_TEST_SUITE_P(Oracles, GrowTogether, testing::Values(OracleKind::kCompute, OracleKind::kOcclusion),
                         [](const auto& p) { return p.param == OracleKind::kCompute ? "compute" : "occlusion"; });

}  // namespace
}  // namespace bocst
