// SPDX-License-Identifier: BSD-3-Clause
// Options::build_ahead: the helper thread builds the tree while queries run.
#include <bocst/bocst.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <future>
#include <memory>
#include <random>
#include <shared_mutex>
#include <thread>

#include "fcl/adapters/models.h"
#include "meshes.h"
#include "sanitized.h"
#include "thread/helper_thread.h"
#include "thread_group.h"
#include "tree/tree.h"

namespace bocst {
namespace {

Options options(bool ahead) {
  Options o;
  o.oracle = OracleKind::kCpu;  // on a device nothing is built whole
  o.build_ahead = ahead;
  o.ttl = std::chrono::milliseconds(0);
  return o;
}

// Few contacts of models that are built ahead are those of the least position, as with a budget.
Options byPosition() {
  Options o = options(false);
  o.memory_budget = std::size_t{1} << 30;
  return o;
}

fcl::Transform3d at(double x, double y, double z) { return fcl::Transform3d(Eigen::Translation3d(x, y, z)); }

std::vector<std::pair<int, int>> contacts(const Modeld& a, const Modeld& b, const fcl::Transform3d& X,
                                          std::size_t most = 1 << 20) {
  fcl::CollisionResultd result;
  fcl::collide(&a, fcl::Transform3d::Identity(), &b, X, fcl::CollisionRequestd(most), result);
  std::vector<std::pair<int, int>> pairs;
  for (std::size_t i = 0; i < result.numContacts(); ++i) {
    pairs.emplace_back(static_cast<int>(result.getContact(i).b1), static_cast<int>(result.getContact(i).b2));
  }
  return pairs;
}

bool isWhole(const Modeld& model) {
  const tree::Tree& tree = fcl_adapter::treeOf(model);
  const std::shared_lock<thread::ShardedLock> lock(tree.queryLock());
  const tree::ChildRef root = tree.childRef(tree::NodeRef());
  return root.tag() == tree::ChildRef::kBlock && tree.block(root.index()).isLoose();
}

template <typename Condition>
bool comesTrue(const Condition& condition) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(120);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return true;
}

/// Keeps the helper thread from its next jobs until go(), or its own end.
class BusyThread {
 public:
  BusyThread() {
    thread::runInHelperThread([busy = go_.get_future().share()] { busy.wait(); });
  }
  ~BusyThread() {
    if (is_busy_) go();
  }
  BusyThread(const BusyThread&) = delete;
  BusyThread& operator=(const BusyThread&) = delete;

  void go() {
    is_busy_ = false;
    go_.set_value();
  }
  /// Waits until all jobs are done.
  void finish() {
    go();
    std::promise<void> done;
    thread::runInHelperThread([&done] { done.set_value(); });
    done.get_future().wait();
  }

 private:
  std::promise<void> go_;
  bool is_busy_ = true;
};

const fcl::Transform3d kHit = at(1.3, 0.2, 0.1), kMiss = at(9, 0, 0);

TEST(BuildAhead, TwoQueriesAreEnough) {
  for (const int n : {20, 80, 150}) {  // below and above the size that is sorted along a curve
    const std::shared_ptr<const Mesh> mesh = test::torus(n).mesh();
    const Modeld a(mesh, options(true)), b(mesh, options(true)), c(mesh, options(false)), d(mesh, options(false));
    for (int i = 0; i < 2; ++i) {
      EXPECT_FALSE(contacts(a, b, kHit, 1).empty());
      EXPECT_FALSE(contacts(c, d, kHit, 1).empty());
    }
    ASSERT_TRUE(comesTrue([&] { return isWhole(a) && isWhole(b); })) << n;
    if (n > 20) {
      EXPECT_FALSE(isWhole(c) || isWhole(d)) << "so it was not a query that built the others";
    }
    // By queries, in time: the same tree.
    for (int i = 0; i < 2000 && !(isWhole(c) && isWhole(d)); ++i) contacts(c, d, at(1.3, 1e-4 * i, 0.1));
    ASSERT_TRUE(isWhole(c));
    EXPECT_EQ(a.statistics().nodes_per_level, c.statistics().nodes_per_level);
    EXPECT_EQ(a.statistics().resident_nodes, c.statistics().resident_nodes);
    EXPECT_EQ(contacts(a, b, kHit), contacts(c, d, kHit)) << "and the same order";
  }
}

TEST(BuildAhead, AQueryBuildsTheTreeIfTheThreadIsBusyAndTheThreadDoesNotBuildItAgain) {
  BusyThread thread;
  const std::shared_ptr<const Mesh> mesh = test::torus(60).mesh();
  const Modeld a(mesh, options(true)), b(mesh, options(true));
  for (int i = 0; i < 3; ++i) contacts(a, b, kHit, 1);
  EXPECT_FALSE(isWhole(a) || isWhole(b)) << "so the thread was asked";
  for (int i = 0; i < 5000 && !(isWhole(a) && isWhole(b)); ++i) contacts(a, b, at(1.3, 1e-4 * i, 0.1), 1);
  EXPECT_TRUE(isWhole(a) && isWhole(b));
  const std::size_t built_a = a.statistics().built_triangles, built_b = b.statistics().built_triangles;
  thread.finish();
  EXPECT_EQ(a.statistics().built_triangles, built_a);
  EXPECT_EQ(b.statistics().built_triangles, built_b);
}

// Its blocks are as old as the last query, not as the request for the thread.
TEST(BuildAhead, WhatTheThreadBuildsLateDoesNotDecayAtOnce) {
  BusyThread thread;
  Clock::time_point now(std::chrono::hours(1));
  Options o = options(true);
  o.ttl = std::chrono::milliseconds(100);
  o.clock = [&now] { return now; };
  const std::shared_ptr<const Mesh> mesh = test::torus(60).mesh();
  Modeld a(mesh, o), b(mesh, o);
  for (int i = 0; i < 8; ++i) {
    contacts(a, b, kHit, 1);
    now += std::chrono::milliseconds(60);
  }
  EXPECT_FALSE(isWhole(a) || isWhole(b)) << "so the thread was asked";
  thread.go();
  ASSERT_TRUE(comesTrue([&] { return isWhole(a) && isWhole(b); }));
  const Statistics before = a.statistics();
  contacts(a, b, kHit, 1);
  EXPECT_EQ(a.statistics().pruned_nodes, before.pruned_nodes);
  EXPECT_EQ(a.statistics().resident_bytes, before.resident_bytes) << "corners of leaves stay";
  for (int level = 0; level < 64; ++level) {
    now += std::chrono::hours(1);
    a.prune(now);
  }
  EXPECT_EQ(a.statistics().resident_nodes, 1u) << "what nobody uses decays";
}

TEST(BuildAhead, WhatNobodyMeetsStaysARoot) {
  const std::shared_ptr<const Mesh> mesh = test::torus(80).mesh();
  const Modeld a(mesh, options(true)), b(mesh, options(true));
  for (int i = 0; i < 100; ++i) EXPECT_TRUE(contacts(a, b, kMiss).empty());
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  EXPECT_EQ(a.statistics().resident_nodes, 1u);
}

TEST(BuildAhead, IsNotForBudgetsNorConservativeAnswers) {
  const std::shared_ptr<const Mesh> mesh = test::torus(80).mesh();
  Options budget = options(true), coarse = options(true);
  budget.memory_budget = 1 << 16;
  coarse.answer = Answer::kConservative;
  for (const Options& o : {budget, coarse}) {
    const Modeld a(mesh, o), b(mesh, o);
    for (int i = 0; i < 3; ++i) contacts(a, b, kHit, 1);
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    EXPECT_FALSE(isWhole(a) || isWhole(b));
  }
}

TEST(BuildAhead, AnswersAreTheSameWhileItIsUnderWay) {
  const std::shared_ptr<const Mesh> mesh = test::torus(test::kSanitized ? 100 : 200).mesh();
  const Modeld x(mesh, byPosition()), y(mesh, byPosition());
  std::mt19937_64 g(11);
  std::uniform_real_distribution<double> u(-1.5, 1.5);
  for (int round = 0; round < test::repetitions(10); ++round) {
    const Modeld a(mesh, options(true)), b(mesh, options(true));
    for (int i = 0; i < 40; ++i) {
      const fcl::Transform3d X = at(u(g), u(g), u(g));
      ASSERT_EQ(contacts(a, b, X, 20), contacts(x, y, X, 20)) << round << ' ' << i;
    }
  }
}

// A model ends, gets other vertices, or drops its branches while its tree is built for the vertices before.
TEST(BuildAhead, ModelsEndAndChangeMeanwhile) {
  const test::Raw raw = test::torus(test::kSanitized ? 80 : 150);
  const std::shared_ptr<const Mesh> mesh = raw.mesh();
  std::mt19937_64 g(12);
  for (int round = 0; round < test::repetitions(100); ++round) {
    Modeld a(mesh, options(true)), b(mesh, options(true));
    double scale = 1;
    for (int i = 0; i < 6; ++i) {
      ASSERT_FALSE(contacts(a, b, at(1.3 * (1 + scale) / 2, 0.2, 0.1), 1).empty()) << round << ' ' << i;
      if (g() % 2 == 0) std::this_thread::sleep_for(std::chrono::microseconds(g() % 3000));
      switch (g() % 4) {
        case 0:
          scale = 1 + static_cast<double>(g() % 3);
          a.updateVertices(test::Raw(raw).scale(scale).vertices);
          break;
        case 1:
          b.prune(Clock::now() + std::chrono::hours(1));
          break;
        default:
          break;
      }
    }
    // The tree that stays is that of the last vertices.
    if (round % 10 == 0) {
      ASSERT_TRUE(comesTrue([&] { return contacts(a, b, at(1.3, 0.2, 0.1), 1), isWhole(a); }));
      const Modeld fresh(a.mesh(), options(false)), other(mesh, options(false));
      for (int i = 0; i < 5; ++i) {
        const fcl::Transform3d X = at(0.3 * i, 0.2, 0.1);
        ASSERT_EQ(contacts(a, b, X), contacts(fresh, other, X));
      }
    }
  }
}

TEST(BuildAhead, ThreadsAskMeanwhile) {
  const std::shared_ptr<const Mesh> mesh = test::torus(test::kSanitized ? 80 : 150).mesh();
  const Modeld x(mesh, byPosition()), y(mesh, byPosition());
  std::vector<fcl::Transform3d> poses;
  std::vector<std::vector<std::pair<int, int>>> expected;
  std::mt19937_64 g(13);
  std::uniform_real_distribution<double> u(-1.5, 1.5);
  for (int i = 0; i < 60; ++i) {
    poses.push_back(at(u(g), u(g), u(g)));
    expected.push_back(contacts(x, y, poses.back(), 20));
  }
  for (int round = 0; round < test::repetitions(10); ++round) {
    Modeld a(mesh, options(true)), b(mesh, options(true));
    std::atomic<int> wrong{0};
    test::ThreadGroup(3, [&](std::size_t t) {
      for (std::size_t i = 0; i < poses.size(); ++i) {
        const std::size_t k = (i + 20 * t) % poses.size();
        wrong += contacts(a, b, poses[k], 20) != expected[k];
        if (t == 2 && i % 16 == 0) a.prune(Clock::now() + std::chrono::hours(1));
      }
    });
    ASSERT_EQ(wrong, 0);
  }
}

// Structures beside the nodes, which queries pay for.

const tree::Tree& treeOf(const Modeld& m) { return fcl_adapter::treeOf(m); }

/// Two pipes of slivers that cross each other with a gap that boxes along the axes do not see: a query pays for
/// oriented boxes.
bool pipesMeet(const Modeld& a, const Modeld& b, double gap) {
  const Eigen::Vector3d axis(std::cos(0.7), std::sin(0.7), 0);
  const Eigen::Matrix3d R = Eigen::AngleAxisd(0.5, axis).toRotationMatrix();
  return !contacts(a, b, test::pose<double>(R, (0.2 + gap) * axis), 1).empty();
}

bool haveBoxes(const Modeld& a, const Modeld& b) {
  return treeOf(a).knownBoxes() != nullptr && treeOf(b).knownBoxes() != nullptr;
}

/// Asks until both have asked the helper thread for oriented boxes.
void askForBoxes(const Modeld& a, const Modeld& b) {
  const auto asked = [&] { return treeOf(a).boxPrice() == 0 && treeOf(b).boxPrice() == 0; };
  for (int i = 0; i < 1000 && !asked(); ++i) ASSERT_FALSE(pipesMeet(a, b, 1e-4));
  ASSERT_TRUE(asked());
}

TEST(BuildAhead, OrientedBoxesComeFromTheThread) {
  BusyThread thread;
  const std::shared_ptr<const Mesh> mesh = test::pipe(256).mesh();
  Modeld a(mesh, options(true)), b(mesh, options(true));
  a.buildTree();
  b.buildTree();
  askForBoxes(a, b);
  EXPECT_TRUE(pipesMeet(a, b, -1e-3));
  EXPECT_FALSE(haveBoxes(a, b)) << "so no query built them";
  thread.go();
  EXPECT_TRUE(comesTrue([&] { return haveBoxes(a, b); }));
  EXPECT_TRUE(pipesMeet(a, b, -1e-3));
  EXPECT_FALSE(pipesMeet(a, b, 1e-4));
}

TEST(BuildAhead, AQueryBuildsOrientedBoxesIfTheThreadIsBusy) {
  BusyThread thread;
  const std::shared_ptr<const Mesh> mesh = test::pipe(256).mesh();
  const Modeld a(mesh, options(true)), b(mesh, options(true));
  for (int i = 0; i < 5000 && !haveBoxes(a, b); ++i) EXPECT_FALSE(pipesMeet(a, b, 1e-4));
  ASSERT_TRUE(haveBoxes(a, b));
  const tree::BoxTree* const built = treeOf(a).knownBoxes();
  thread.finish();
  EXPECT_EQ(treeOf(a).knownBoxes(), built) << "queries may read them: the thread must leave them";
}

TEST(BuildAhead, OrientedBoxesOfOldVerticesAreNotUsed) {
  BusyThread thread;
  const test::Raw raw = test::pipe(256);
  Modeld a(raw.mesh(), options(true));
  const Modeld b(raw.mesh(), options(true));
  askForBoxes(a, b);
  a.updateVertices(test::Raw(raw).scale(0.5).vertices);
  EXPECT_GT(treeOf(a).boxPrice(), 0u) << "queries pay anew";
  thread.finish();
  EXPECT_EQ(treeOf(a).knownBoxes(), nullptr);
  EXPECT_NE(treeOf(b).knownBoxes(), nullptr);
}

// They change while the thread builds.
TEST(BuildAhead, OrientedBoxesOfVerticesThatChangeMeanwhileAreNotUsed) {
  const test::Raw raw = test::pipe(1024);
  std::mt19937_64 g(14);
  for (int round = 0; round < test::repetitions(30); ++round) {
    Modeld a(raw.mesh(), options(true));
    const Modeld b(raw.mesh(), options(true));
    BusyThread thread;
    askForBoxes(a, b);
    thread.go();
    std::this_thread::sleep_for(std::chrono::microseconds(g() % 3000));
    a.updateVertices(test::Raw(raw).scale(0.5).vertices);
    BusyThread().finish();
    ASSERT_EQ(treeOf(a).knownBoxes(), nullptr) << round;
  }
}

TEST(BuildAhead, ProbesComeFromTheThread) {
  BusyThread thread;
  const std::shared_ptr<const Mesh> mesh = test::torus(40).mesh();
  const Modeld a(mesh, options(true)), b(mesh, options(true)), c(mesh, options(false)), d(mesh, options(false));
  const std::vector<fcl::Transform3d> poses(600, at(1.3, 0.2, 0.1));
  const auto hits = [&](const Modeld& p, const Modeld& q) {
    std::vector<std::uint8_t> hit(poses.size());
    collidePoses(p, q, poses.data(), poses.size(), hit.data(), 1);
    return std::count(hit.begin(), hit.end(), 1);
  };
  const auto known = [](const Modeld& m) { return treeOf(m).interior(0) != nullptr; };
  EXPECT_EQ(hits(a, b), 600);
  EXPECT_EQ(hits(c, d), 600);
  EXPECT_TRUE(known(c) && known(d)) << "so these queries have paid";
  EXPECT_FALSE(known(a) || known(b));
  thread.go();
  EXPECT_TRUE(comesTrue([&] { return known(a) && known(b); }));
  EXPECT_EQ(hits(a, b), 600);
}

// A child makes models of its own; those of its parent, which may be half built, end without a wait.
TEST(BuildAhead, AChildBuildsItsOwn) {
  if (test::kThreadSanitized) return;  // It ends a child that starts threads.
  const std::shared_ptr<const Mesh> mesh = test::torus(100).mesh();
  for (int round = 0; round < test::repetitions(20); ++round) {
    auto a = std::make_unique<Modeld>(mesh, options(true)), b = std::make_unique<Modeld>(mesh, options(true));
    for (int i = 0; i < 2; ++i) contacts(*a, *b, kHit, 1);
    std::this_thread::sleep_for(std::chrono::microseconds(200 * round));
    const pid_t child = fork();
    if (child == 0) {
      alarm(120);
      a.reset();
      b.reset();
      const Modeld c(mesh, options(true)), d(mesh, options(true));
      for (int i = 0; i < 2; ++i) contacts(c, d, kHit, 1);
      _exit(comesTrue([&] { return isWhole(c) && isWhole(d); }) ? 0 : 1);
    }
    int status = -1;
    waitpid(child, &status, 0);
    ASSERT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << "round " << round << ": " << status;
  }
}

}  // namespace
}  // namespace bocst
