// SPDX-License-Identifier: BSD-3-Clause
// Models whose oracle is on a device: the same verdicts as with the CPU's, also when the mesh or the device goes.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>

#include "conformance/reference.h"
#include "fcl/adapters/models.h"
#include "oracle/gl/device_oracle.h"
#include "thread_group.h"
#include "tree/tree.h"

namespace bocst {
namespace {

using test::Raw;

Options with(OracleKind oracle, Answer answer = Answer::kExact, int depth = 6) {
  Options o;
  o.oracle = oracle;
  o.answer = answer;
  o.depth = depth;
  return o;
}

oracle::gl::DeviceOracle& deviceOf(const Modeld& model) {
  return dynamic_cast<oracle::gl::DeviceOracle&>(const_cast<oracle::Oracle&>(fcl_adapter::treeOf(model).oracle()));
}

const fcl::Transform3d kIdentity = fcl::Transform3d::Identity();

std::vector<fcl::Transform3d> poses(int count, double far) {
  std::mt19937_64 g(4);
  std::uniform_real_distribution<double> u(0, 1);
  std::vector<fcl::Transform3d> all;
  for (int i = 0; i < count; ++i) {
    all.push_back(test::pose<double>(test::randomRotation(g), test::randomDirection(g) * far * u(g)));
  }
  return all;
}

class OnDevice : public testing::TestWithParam<OracleKind> {};

TEST_P(OnDevice, ExactAnswersAreThoseOfTheCpu) {
  const Raw ra = test::torus(50), rb = test::torus(23, 0.3);
  const Modeld a(ra.mesh(), with(GetParam())), b(rb.mesh(), with(GetParam()));
  const Modeld c(ra.mesh(), with(OracleKind::kCpu)), d(rb.mesh(), with(OracleKind::kCpu));
  int hits = 0;
  for (const auto& X : poses(80, 2.2)) {
    const test::Pairs expected = test::pairs<double>(c, kIdentity, d, X);
    hits += !expected.empty();
    ASSERT_EQ(test::touching<double>(a, kIdentity, b, X), !expected.empty());
    ASSERT_EQ(test::pairs<double>(a, kIdentity, b, X), expected);
    // Models of different oracles in one pair.
    ASSERT_EQ(test::pairs<double>(a, kIdentity, d, X), expected);
    ASSERT_EQ(test::touching<double>(d, X, a, kIdentity), !expected.empty());
  }
  EXPECT_GT(hits, 20);
  EXPECT_LT(hits, 75);
  EXPECT_EQ(deviceOf(a).leftToCpu(), 0u);
}

// What is a leaf at once, and what division only copies: leaves of any number of triangles.
TEST_P(OnDevice, SmallAndDenseMeshesAnswerAsOnTheCpu) {
  Raw dense;
  for (std::size_t i = 0; i < 700; ++i) {
    const double z = 1e-4 * static_cast<double>(i);
    dense.vertices.insert(dense.vertices.end(), {{-1, -1, z}, {1, -1, -z}, {0, 1.5, z}});
    dense.triangles.emplace_back(3 * i, 3 * i + 1, 3 * i + 2);
  }
  const Raw few = test::box({-0.4, -0.5, -0.6}, {0.4, 0.5, 0.6}), many = test::torus(20);
  std::size_t found = 0;
  for (const Raw* raw : std::vector<const Raw*>{&few, &dense}) {
    for (const Raw* partner : std::vector<const Raw*>{&few, &many, &dense}) {
      if (raw == &dense && partner == &dense) continue;
      const Modeld a(raw->mesh(), with(GetParam())), b(partner->mesh(), with(GetParam()));
      const Modeld c(raw->mesh(), with(OracleKind::kCpu)), d(partner->mesh(), with(OracleKind::kCpu));
      for (const auto& X : poses(4, 1)) {
        const test::Pairs expected = test::pairs<double>(c, kIdentity, d, X);
        ASSERT_EQ(test::pairs<double>(a, kIdentity, b, X), expected);
        ASSERT_EQ(test::pairs<double>(b, X, a, kIdentity), test::pairs<double>(d, X, c, kIdentity));
        found += expected.size();
      }
    }
  }
  EXPECT_GT(found, 2000u);
  // So small that no cell parts them, in a face of the box.
  Raw cluster;
  constexpr std::size_t kCluster = 600;  // more than the host takes from a device
  for (std::size_t i = 0; i < kCluster; ++i) {
    const double y = 1e-9 * static_cast<double>(i);
    cluster.vertices.insert(cluster.vertices.end(), {{0.4 - 1e-8, y, 0}, {0.4 + 1e-8, y, 0}, {0.4, y, 1e-8}});
    cluster.triangles.emplace_back(3 * i, 3 * i + 1, 3 * i + 2);
  }
  cluster.addTriangle({3, 3, 3}, {3, 4, 3}, {4, 3, 3});
  const Modeld a(cluster.mesh(), with(GetParam())), b(few.mesh(), with(GetParam()));
  const Modeld c(cluster.mesh(), with(OracleKind::kCpu)), d(few.mesh(), with(OracleKind::kCpu));
  const test::Pairs expected = test::pairs<double>(c, kIdentity, d, kIdentity);
  EXPECT_GE(expected.size(), kCluster);
  for (int i = 0; i < 3; ++i) ASSERT_EQ(test::pairs<double>(a, kIdentity, b, kIdentity), expected);
}

TEST_P(OnDevice, WhatFitsALeafIsNotDivided) {
  Raw fan;
  for (std::size_t i = 0; i < kMaxLeafTriangles; ++i) {
    const double z = 0.01 * static_cast<double>(i);
    fan.vertices.insert(fan.vertices.end(), {{-1, -1, z}, {1, -1, z}, {0, 1, z}});
    fan.triangles.emplace_back(3 * i, 3 * i + 1, 3 * i + 2);
  }
  const Modeld a(fan.mesh(), with(GetParam())), b(test::torus(12).mesh(), with(GetParam()));
  EXPECT_TRUE(test::touching<double>(a, kIdentity, b, kIdentity));
  EXPECT_EQ(a.statistics().resident_nodes, 1u);
  EXPECT_EQ(a.statistics().expansions, 0u);
}

TEST_P(OnDevice, ConservativeVerdictsAreThoseOfTheCpu) {
  const Raw ra = test::torus(30), rb = test::torus(23, 0.3);
  for (const Subdivision s : {Subdivision::kOctree, Subdivision::kBono}) {
    for (const int depth : {3, 5, 7}) {
      Options device = with(GetParam(), Answer::kConservative, depth), cpu = device;
      device.subdivision = cpu.subdivision = s;
      cpu.oracle = OracleKind::kCpu;
      const Modeld a(ra.mesh(), device), b(rb.mesh(), device), c(ra.mesh(), cpu), d(rb.mesh(), cpu);
      for (const auto& X : poses(40, 2.6)) {
        ASSERT_EQ(test::touching<double>(a, kIdentity, b, X), test::touching<double>(c, kIdentity, d, X));
      }
    }
  }
}

TEST_P(OnDevice, CompleteTreesAreThoseOfTheCpu) {
  for (const Raw& raw : {test::torus(30), test::adversarial()}) {
    Modeld a(raw.mesh(), with(GetParam())), c(raw.mesh(), with(OracleKind::kCpu));
    a.expandAll(6);
    c.expandAll(6);
    EXPECT_EQ(a.statistics().nodes_per_level, c.statistics().nodes_per_level);
  }
}

TEST_P(OnDevice, BranchesThatWentGrowAgain) {
  const Raw raw = test::torus(60);
  for (const Answer answer : {Answer::kExact, Answer::kConservative}) {
    Options options = with(GetParam(), answer, 7);
    auto now = std::chrono::steady_clock::time_point();
    options.clock = [&now] { return now; };
    options.memory_budget = 60000;
    Modeld a(raw.mesh(), options), b(raw.mesh(), options);
    Options cpu = with(OracleKind::kCpu, answer, 7);
    const Modeld c(raw.mesh(), cpu), d(raw.mesh(), cpu);
    for (const auto& X : poses(60, 2.2)) {
      now += std::chrono::milliseconds(700);
      ASSERT_EQ(test::touching<double>(a, kIdentity, b, X), test::touching<double>(c, kIdentity, d, X))
          << static_cast<int>(answer);
    }
    EXPECT_GT(a.statistics().pruned_nodes, 0u);
    now += std::chrono::hours(1);
    for (int level = 0; level < 20; ++level, now += std::chrono::seconds(3)) a.prune(now);
    EXPECT_EQ(a.statistics().resident_nodes, 1u);
    EXPECT_TRUE(test::touching<double>(a, kIdentity, b, kIdentity));
  }
}

TEST_P(OnDevice, MovedVerticesAreSeen) {
  Raw raw = test::torus(30);
  Modeld a(raw.mesh(), with(GetParam())), b(raw.mesh(), with(GetParam()));
  const auto X = test::pose<double>(Eigen::Matrix3d::Identity(), {1.5, 0, 0});
  EXPECT_TRUE(test::touching<double>(a, kIdentity, b, X));
  raw.move({0, 0, 10});
  a.updateVertices(raw.vertices);
  EXPECT_FALSE(test::touching<double>(a, kIdentity, b, X));
  const auto up = test::pose<double>(Eigen::Matrix3d::Identity(), {1.5, 0, 10});
  EXPECT_TRUE(test::touching<double>(a, kIdentity, b, up));
}

TEST_P(OnDevice, ALostDeviceChangesNoAnswer) {
  const Raw raw = test::torus(50);
  for (const Answer answer : {Answer::kExact, Answer::kConservative}) {
    const Modeld a(raw.mesh(), with(GetParam(), answer)), b(raw.mesh(), with(GetParam(), answer));
    const Modeld c(raw.mesh(), with(OracleKind::kCpu, answer)), d(raw.mesh(), with(OracleKind::kCpu, answer));
    int i = 0;
    for (const auto& X : poses(30, 2.2)) {
      if (i++ == 1) deviceOf(a).thread().lose("a test says so");
      ASSERT_EQ(test::touching<double>(a, kIdentity, b, X), test::touching<double>(c, kIdentity, d, X));
    }
    EXPECT_GT(deviceOf(a).leftToCpu(), 0u);
    // Later models get a new context.
    const Modeld e(raw.mesh(), with(GetParam(), answer));
    EXPECT_FALSE(deviceOf(e).thread().isLost());
  }
}

TEST_P(OnDevice, AChildAfterForkAnswers) {
  const Raw raw = test::torus(40);
  const Modeld a(raw.mesh(), with(GetParam())), b(raw.mesh(), with(GetParam()));
  const auto all = poses(20, 2.2);
  std::vector<bool> expected;
  for (std::size_t i = 0; i < 5; ++i) expected.push_back(test::touching<double>(a, kIdentity, b, all[i]));
  const pid_t child = fork();
  if (child == 0) {
    alarm(60);
    const Modeld c(raw.mesh(), with(OracleKind::kCpu)), d(raw.mesh(), with(OracleKind::kCpu));
    for (const auto& X : all) {
      if (test::touching<double>(a, kIdentity, b, X) != test::touching<double>(c, kIdentity, d, X)) _exit(1);
    }
    _exit(0);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
}

/// Two models whose mesh was released, and two with the same mesh on the CPU.
struct Released {
  Raw raw = test::torus(60);
  std::chrono::steady_clock::time_point now = Clock::now();
  Modeld a, b;
  const Modeld c, d;

  Released(OracleKind kind, Answer answer)
      : a(raw.mesh(), options(kind, answer)),
        b(raw.mesh(), options(kind, answer)),
        c(raw.mesh(), host(answer)),
        d(raw.mesh(), host(answer)) {
    a.releaseMesh();
    b.releaseMesh();
  }

  // With a budget, so that the contact whose depth is a signed distance is chosen as with a device.
  static Options host(Answer answer) {
    Options o = with(OracleKind::kCpu, answer, 6);
    o.memory_budget = std::size_t{1} << 30;
    return o;
  }

  Options options(OracleKind kind, Answer answer) {
    Options o = with(kind, answer, 6);
    o.clock = [this] { return now; };
    return o;
  }

  void rest() {
    now += std::chrono::hours(1);
    for (int level = 0; level < 20; ++level, now += std::chrono::seconds(3)) {
      a.prune(now);
      b.prune(now);
    }
  }
};

TEST_P(OnDevice, AReleasedMeshComesBackForQueriesAndGoesAtRest) {
  for (const Answer answer : {Answer::kExact, Answer::kConservative}) {
    Released r(GetParam(), answer);
    const bool is_exact = answer == Answer::kExact, returns = is_exact || GetParam() == OracleKind::kOcclusion;
    const auto bvh = test::bvh<fcl::OBBRSSd>(r.raw);
    const fcl::Sphered ball(0.7);
    const Modeld large(test::torus(12).scale(3).mesh(), with(OracleKind::kCpu, answer, 6));
    int hits = 0;
    for (int round = 0; round < 2; ++round) {
      EXPECT_EQ(r.a.mesh(), nullptr);
      EXPECT_EQ(r.a.statistics().mesh_bytes, 0u);
      EXPECT_FALSE(
          test::touching<double>(r.a, kIdentity, r.b, test::pose<double>(Eigen::Matrix3d::Identity(), {9, 0, 0})));
      EXPECT_EQ(r.a.statistics().mesh_bytes, 0u) << "far pairs need no mesh";
      r.a.buildTree();
      EXPECT_EQ(r.a.statistics().mesh_bytes, 0u) << "a model on a device gains nothing by it";
      for (const auto& X : poses(15, 2.4)) {
        const bool expected = test::touching<double>(r.c, kIdentity, r.d, X);
        hits += expected;
        // Beside models that have theirs, first, as one query brings back both.
        ASSERT_EQ(test::touching<double>(r.a, kIdentity, r.d, X), expected);
        ASSERT_EQ(test::touching<double>(large, kIdentity, r.b, X), test::touching<double>(large, kIdentity, r.d, X));
        ASSERT_EQ(test::touching<double>(r.a, kIdentity, r.b, X), expected);
        ASSERT_EQ(test::touching<double>(r.b, X, r.a, kIdentity), expected);
        ASSERT_EQ(test::touching<double>(r.a, kIdentity, *bvh, X), test::touching<double>(r.c, kIdentity, *bvh, X));
        ASSERT_EQ(test::touching<double>(ball, X, r.b, kIdentity), test::touching<double>(ball, X, r.d, kIdentity));
        if (is_exact) {
          ASSERT_EQ(test::pairs<double>(r.a, kIdentity, r.b, X), test::pairs<double>(r.c, kIdentity, r.d, X));
        }
        fcl::DistanceRequestd request;
        request.enable_signed_distance = is_exact;
        fcl::DistanceResultd ours, theirs;
        ASSERT_NEAR(fcl::distance(&r.a, kIdentity, &r.b, X, request, ours),
                    fcl::distance(&r.c, kIdentity, &r.d, X, request, theirs), 1e-12);
        const fcl::ContinuousCollisionRequestd moving;
        fcl::ContinuousCollisionResultd when, expected_when;
        auto end = X;
        end.translation() *= -1;
        ASSERT_NEAR(fcl::continuousCollide(&r.a, kIdentity, kIdentity, &r.b, X, end, moving, when),
                    fcl::continuousCollide(&r.c, kIdentity, kIdentity, &r.d, X, end, moving, expected_when),
                    2 * moving.toc_err);
      }
      EXPECT_EQ(r.a.statistics().mesh_bytes > 0, returns);
      EXPECT_EQ(r.a.mesh(), nullptr) << "only queries see it";
      r.a.visit([](const NodeView& node) { ASSERT_EQ(node.object, nullptr); });
      r.rest();
    }
    EXPECT_GT(hits, 5);
    EXPECT_THROW(r.a.updateVertices(r.raw.vertices), std::logic_error);
    EXPECT_THROW(r.a.computeVolume(), std::logic_error);
    EXPECT_NO_THROW(r.a.releaseMesh()) << "for the second time";
    r.a.expandAll(4);
    Modeld whole(r.raw.mesh(), with(OracleKind::kCpu, answer));
    whole.expandAll(4);
    EXPECT_EQ(r.a.statistics().nodes_per_level, whole.statistics().nodes_per_level);
  }
}

TEST_P(OnDevice, AReleasedMeshThatIsLostIsAnError) {
  for (const Answer answer : {Answer::kExact, Answer::kConservative}) {
    Released r(GetParam(), answer);
    const auto X = test::pose<double>(Eigen::Matrix3d::Identity(), {1.5, 0.2, 0});
    EXPECT_TRUE(test::touching<double>(r.a, kIdentity, r.b, X));
    r.rest();
    deviceOf(r.a).thread().lose("a test says so");
    for (int again = 0; again < 2; ++again) {
      EXPECT_THROW(test::touching<double>(r.a, kIdentity, r.b, X), OracleError) << "never \"free\"";
    }
    EXPECT_FALSE(
        test::touching<double>(r.a, kIdentity, r.b, test::pose<double>(Eigen::Matrix3d::Identity(), {9, 0, 0})));
  }
}

TEST_P(OnDevice, ThreadsShareAReleasedMesh) {
  for (const Answer answer : {Answer::kExact, Answer::kConservative}) {
    Released r(GetParam(), answer);
    const auto all = poses(12, 2.4);
    std::vector<bool> expected;
    for (const auto& X : all) expected.push_back(test::touching<double>(r.c, kIdentity, r.d, X));
    std::atomic<int> wrong{0};
    for (int round = 0; round < 3; ++round) {
      test::ThreadGroup(4, [&](std::size_t t) {
        for (std::size_t i = 0; i < all.size(); ++i) {
          const std::size_t k = (i + 3 * t) % all.size();
          wrong += test::touching<double>(r.a, kIdentity, r.b, all[k]) != expected[k];
          (void)r.a.statistics();
        }
      });
      r.rest();
      EXPECT_EQ(r.a.statistics().mesh_bytes, 0u);
    }
    EXPECT_EQ(wrong, 0);
  }
}

std::string nameOf(const testing::TestParamInfo<OracleKind>& info) {
  return info.param == OracleKind::kCompute ? "compute" : "occlusion";
}
INSTANTIATE_TEST_SUITE_P(All, OnDevice, testing::Values(OracleKind::kCompute, OracleKind::kOcclusion), nameOf);

TEST(Compute, TheMeshNeedNotBeInHostMemory) {
  const Raw raw = test::torus(60);
  const auto options = with(OracleKind::kCompute, Answer::kConservative, 7);
  auto mesh = raw.mesh();
  Modeld a(mesh, options), b(mesh, options);
  const std::weak_ptr<const Mesh> host = mesh;
  mesh.reset();
  EXPECT_GT(a.statistics().mesh_bytes, 0u);
  a.releaseMesh();
  EXPECT_FALSE(host.expired()) << "b holds it";
  b.releaseMesh();
  EXPECT_TRUE(host.expired());
  EXPECT_EQ(a.mesh(), nullptr);
  EXPECT_EQ(a.statistics().mesh_bytes, 0u);
  const auto cpu = with(OracleKind::kCpu, Answer::kConservative, 7);
  const Modeld c(raw.mesh(), cpu), d(raw.mesh(), cpu), exact(raw.mesh());
  const auto bvh = test::bvh<fcl::OBBRSSd>(raw);
  for (const auto& X : poses(40, 2.4)) {
    ASSERT_EQ(test::touching<double>(a, kIdentity, b, X), test::touching<double>(c, kIdentity, d, X));
    ASSERT_EQ(test::touching<double>(a, kIdentity, exact, X), test::touching<double>(c, kIdentity, exact, X));
    ASSERT_EQ(test::touching<double>(*bvh, X, a, kIdentity), test::touching<double>(*bvh, X, c, kIdentity));
    fcl::DistanceRequest<double> request;
    fcl::DistanceResult<double> ours, theirs;
    ASSERT_EQ(fcl::distance(&a, kIdentity, &b, X, request, ours), fcl::distance(&c, kIdentity, &d, X, request, theirs));
  }
  EXPECT_GT(a.statistics().device_bytes, 12 * raw.triangles.size());
  a.computeLocalAABB();
  EXPECT_EQ(a.aabb_local.min_, c.aabb_local.min_);
  a.visit([](const NodeView& node) { EXPECT_EQ(node.object, nullptr); });
  EXPECT_THROW(a.updateVertices(raw.vertices), std::logic_error);
  EXPECT_EQ(deviceOf(a).leftToCpu(), 0u);
  // Nobody has the mesh any more once the device goes: that is an error, never "free".
  deviceOf(a).thread().lose("a test says so");
  a.prune(Clock::now() + std::chrono::hours(1));
  EXPECT_THROW(
      {
        for (const auto& X : poses(60, 2.0)) test::touching<double>(a, kIdentity, b, X);
      },
      OracleError);
}

TEST(Compute, WhatNeedsTheMeshKeepsIt) {
  const auto mesh = test::torus(20).mesh();
  for (const Answer answer : {Answer::kExact, Answer::kConservative}) {
    Modeld cpu(mesh, with(OracleKind::kCpu, answer));
    EXPECT_THROW(cpu.releaseMesh(), OracleError);
    EXPECT_EQ(cpu.mesh(), mesh);
    Options solid = with(OracleKind::kCompute, answer);
    solid.solid = true;
    EXPECT_THROW(Modeld(mesh, solid).releaseMesh(), std::logic_error);
  }
}

TEST(Compute, BytesOnTheDeviceComeAndGo) {
  const Raw raw = test::torus(60);
  Modeld a(raw.mesh(), with(OracleKind::kCompute)), b(raw.mesh(), with(OracleKind::kCompute));
  EXPECT_EQ(a.statistics().device_bytes, 0u) << "at rest nothing was sent";
  EXPECT_TRUE(test::touching<double>(a, kIdentity, b, test::pose<double>(Eigen::Matrix3d::Identity(), {1.5, 0.2, 0})));
  const std::size_t mesh = 12 * raw.triangles.size() + 48 * raw.vertices.size();
  EXPECT_GT(a.statistics().device_bytes, mesh) << "and lists";
  Clock::time_point later = Clock::now();
  for (int level = 0; level < 20; ++level) a.prune(later += std::chrono::hours(1));
  EXPECT_EQ(a.statistics().resident_nodes, 1u);
  EXPECT_EQ(a.statistics().device_bytes, mesh) << "lists went with their branches";
}

TEST(Sampled, IsNeverChosenByItself) {
  const auto mesh = test::torus(20).mesh();
  EXPECT_NE(Modeld(mesh).oracleName(), "sampled");
  EXPECT_EQ(Modeld(mesh, with(OracleKind::kSampled)).oracleName(), "sampled");
}

// A rod along a direction: many triangles, so that it is no leaf, and nearly no width.
Raw rod(double width) {
  Raw raw;
  const Eigen::Vector3d d = Eigen::Vector3d(0.8, 0.5, 0.33).normalized(), u = d.unitOrthogonal(), v = d.cross(u);
  constexpr std::size_t parts = 100;
  for (std::size_t i = 0; i <= parts; ++i) {
    for (int k = 0; k < 4; ++k) {
      const double a = k == 0 || k == 3 ? -0.5 : 0.5, b = k < 2 ? -0.5 : 0.5;
      raw.vertices.push_back(static_cast<double>(i) / parts * d + width * (a * u + b * v));
    }
  }
  for (std::size_t i = 0; i < parts; ++i) {
    for (std::size_t k = 0; k < 4; ++k) {
      const std::size_t p = 4 * i + k, q = 4 * i + (k + 1) % 4;
      raw.triangles.emplace_back(p, q, q + 4);
      raw.triangles.emplace_back(p, q + 4, p + 4);
    }
  }
  return raw;
}

TEST(Sampled, MissesWhatIsThin) {
  const Raw thin = rod(2e-4), other = test::torus(30);
  const auto hits = [&](OracleKind kind) {
    const Modeld a(thin.mesh(), with(kind)), b(other.mesh(), with(OracleKind::kCpu));
    int count = 0;
    for (const auto& X : poses(60, 1.0)) count += test::touching<double>(a, kIdentity, b, X);
    return count;
  };
  const int expected = hits(OracleKind::kCpu);
  EXPECT_GT(expected, 15);
  EXPECT_EQ(hits(OracleKind::kCompute), expected);
  EXPECT_EQ(hits(OracleKind::kOcclusion), expected);
  EXPECT_LT(hits(OracleKind::kSampled), expected / 2);
}

}  // namespace
}  // namespace bocst
