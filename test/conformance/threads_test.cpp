// SPDX-License-Identifier: BSD-3-Clause
// Many threads on the same fresh models: right answers whatever else happens to the trees. Runs under TSan.
#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "conformance/reference.h"

namespace bocst {
namespace {

struct Question {
  fcl::Transform3d pose;
  bool expected;
};

std::vector<Question> questions(const test::Raw& raw, int count) {
  const auto f = test::bvh<fcl::OBBRSSd>(raw);
  std::mt19937_64 g(1);
  std::uniform_real_distribution<double> u(0, 1);
  std::vector<Question> all;
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  for (int i = 0; i < count; ++i) {
    const auto X = test::pose<double>(test::randomRotation(g), test::randomDirection(g) * 2.2 * u(g));
    all.push_back({X, test::touching<double>(*f, I, *f, X)});
  }
  return all;
}

template <typename F>
void inThreads(int count, F&& f) {
  std::vector<std::thread> threads;
  for (int i = 0; i < count; ++i) threads.emplace_back([&f, i] { f(i); });
  for (auto& t : threads) t.join();
}

TEST(Threads, OneFreshModel) {
  const test::Raw raw = test::torus(60);
  const std::vector<Question> all = questions(raw, 60);
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  for (int round = 0; round < 3; ++round) {
    const Modeld a(raw.mesh()), b(raw.mesh());
    std::atomic<int> wrong{0};
    inThreads(4, [&](int thread) {
      for (std::size_t i = 0; i < all.size(); ++i) {
        const Question& q = all[(i * 7 + static_cast<std::size_t>(thread) * 13) % all.size()];
        // Half the threads in the other order, some against the model itself.
        const Modeld& other = i % 5 == 0 ? a : b;
        const bool answer =
            thread % 2 ? test::touching<double>(other, q.pose, a, I) : test::touching<double>(a, I, other, q.pose);
        wrong += answer != q.expected;
      }
    });
    EXPECT_EQ(wrong, 0);
  }
}

TEST(Threads, QueriesWhilePruning) {
  const test::Raw raw = test::torus(60);
  const std::vector<Question> all = questions(raw, 40);
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  Options options;
  options.ttl = std::chrono::milliseconds(1);
  options.memory_budget = 200000;
  Modeld a(raw.mesh(), options), b(raw.mesh(), options);
  std::atomic<int> wrong{0}, running{3};
  inThreads(4, [&](int thread) {
    if (thread == 3) {
      while (running > 0) {
        a.prune(Clock::now() + std::chrono::seconds(10));
        b.prune();
        std::size_t nodes = 0;
        a.visit([&](const NodeView&) { ++nodes; });
        if (nodes < 1 || a.statistics().resident_nodes < 1) ++wrong;
        std::this_thread::yield();
      }
      return;
    }
    for (int round = 0; round < 3; ++round) {
      for (const Question& q : all) wrong += test::touching<double>(a, I, b, q.pose) != q.expected;
    }
    --running;
  });
  EXPECT_EQ(wrong, 0);
}

TEST(Threads, QueriesWhileVerticesChange) {
  // The mesh jumps between here and far away: a query sees the one or the other, so it never hits while it is away,
  // and the model itself is never in between.
  const test::Raw raw = test::torus(40);
  Modeld a(raw.mesh());
  const Modeld b(raw.mesh());
  const auto touching = test::pose<double>(Eigen::Matrix3d::Identity(), {1.2, 0.3, 0.1});
  const auto never = test::pose<double>(Eigen::Matrix3d::Identity(), {-30, 0, 0});
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  std::vector<Eigen::Vector3d> away = raw.vertices;
  for (auto& v : away) v.x() += 100;
  std::atomic<int> wrong{0}, hits{0}, running{3};
  inThreads(4, [&](int thread) {
    if (thread == 3) {
      for (int i = 0; running > 0; ++i) a.updateVertices(i % 2 ? raw.vertices : away);
      return;
    }
    for (int i = 0; i < 150; ++i) {
      hits += test::touching<double>(a, I, b, touching);
      wrong += test::touching<double>(a, I, b, never);
    }
    --running;
  });
  EXPECT_EQ(wrong, 0);
  a.updateVertices(raw.vertices);
  EXPECT_TRUE(test::touching<double>(a, I, b, touching));
}

TEST(Threads, PruningOfAPairInBothOrdersDoesNotLock) {
  const test::Raw raw = test::torus(24);
  Modeld a(raw.mesh()), b(raw.mesh());
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  const auto X = test::pose<double>(Eigen::Matrix3d::Identity(), {1.2, 0.3, 0.1});
  std::atomic<int> wrong{0};
  inThreads(4, [&](int thread) {
    for (int i = 0; i < 300; ++i) {
      if (thread == 0) a.prune(Clock::now() + std::chrono::seconds(10));
      if (thread == 1) b.prune(Clock::now() + std::chrono::seconds(10));
      if (thread == 2) wrong += !test::touching<double>(a, I, b, X);
      if (thread == 3) wrong += !test::touching<double>(b, X, a, I);
    }
  });
  EXPECT_EQ(wrong, 0);
}

}  // namespace
}  // namespace bocst
