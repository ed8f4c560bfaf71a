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

/// Answers of all kinds about a pair at one pose.
struct Answers {
  bool touches = false;
  std::size_t contacts = 0;
  double distance = 0, time = 0;

  static Answers of(const fcl::CollisionGeometryd& a, const fcl::CollisionGeometryd& b, const fcl::Transform3d& Y) {
    Answers all;
    const fcl::Transform3d I = fcl::Transform3d::Identity();
    all.touches = test::touching<double>(a, I, b, Y);
    all.contacts = test::pairs<double>(a, I, b, Y).size();
    fcl::DistanceResultd d;
    all.distance = fcl::distance(&a, I, &b, Y, fcl::DistanceRequestd(), d);
    fcl::Transform3d start = Y;
    start.translation() += Eigen::Vector3d(4, 1, 0);
    fcl::ContinuousCollisionRequestd request;
    request.ccd_motion_type = fcl::CCDM_SCREW;
    fcl::ContinuousCollisionResultd result;
    all.time = fcl::continuousCollide(&a, I, I, &b, start, Y, request, result);
    return all;
  }
  bool operator==(const Answers& o) const {
    return touches == o.touches && contacts == o.contacts && std::abs(distance - o.distance) < 1e-12 &&
           std::abs(time - o.time) < 2e-4;
  }
};

TEST(Threads, QueriesOfAllKindsOnSharedModels) {
  const test::Raw raw = test::torus(40), inner = test::torus(12).scale(0.1);
  Options wide, full;
  wide.margin = 0.05;
  wide.ttl = full.ttl = std::chrono::milliseconds(1);
  full.solid = true;
  full.memory_budget = 300000;
  const auto bvh = test::bvh<fcl::OBBRSSd>(raw);
  std::mt19937_64 g(2);
  std::uniform_real_distribution<double> u(0, 1);
  std::vector<fcl::Transform3d> poses;
  for (int i = 0; i < 6; ++i) {
    poses.push_back(test::pose<double>(test::randomRotation(g), test::randomDirection(g) * (0.3 + 2.2 * u(g))));
  }
  const Modeld calm_wide(raw.mesh(), wide), calm_full(raw.mesh(), full), calm_inner(inner.mesh());
  Modeld a(raw.mesh(), wide), b(raw.mesh(), full), c(inner.mesh());
  using Pair = std::pair<const fcl::CollisionGeometryd*, const fcl::CollisionGeometryd*>;
  const std::vector<Pair> calm = {{&calm_wide, &calm_full},  {&calm_full, &calm_inner}, {&calm_wide, bvh.get()},
                                  {&calm_inner, &calm_full}, {bvh.get(), &calm_full},   {&calm_full, &calm_full}};
  const std::vector<Pair> shared = {{&a, &b}, {&b, &c}, {&a, bvh.get()}, {&c, &b}, {bvh.get(), &b}, {&b, &b}};
  std::vector<Answers> expected;
  for (const Pair& pair : calm) {
    for (const auto& Y : poses) expected.push_back(Answers::of(*pair.first, *pair.second, Y));
  }
  std::atomic<int> wrong{0}, running{4};
  inThreads(5, [&](int thread) {
    if (thread == 4) {
      while (running > 0) {
        for (Modeld* model : {&a, &b, &c}) {
          model->prune(Clock::now() + std::chrono::seconds(10));
          if (model->statistics().resident_nodes < 1) ++wrong;
        }
        std::this_thread::yield();
      }
      return;
    }
    for (std::size_t i = 0; i < expected.size(); ++i) {
      const std::size_t n = (i * 5 + static_cast<std::size_t>(thread) * 11) % expected.size();
      const Pair& pair = shared[n / poses.size()];
      wrong += !(Answers::of(*pair.first, *pair.second, poses[n % poses.size()]) == expected[n]);
    }
    --running;
  });
  EXPECT_EQ(wrong, 0);
}

TEST(Threads, DistancesTimesAndSolidsWhileVerticesChange) {
  // A solid box jumps between here and elsewhere: each answer is that of the one or of the other place.
  const test::Raw raw = test::box({0, 0, 0}, {1, 1, 1}), small = test::torus(8).scale(0.1);
  std::vector<Eigen::Vector3d> away = raw.vertices;
  for (auto& v : away) v.x() += 2;
  Options options;
  options.solid = true;
  Modeld a(raw.mesh(), options);
  const Modeld there(std::make_shared<const Mesh>(away, raw.triangles), options), here(raw.mesh(), options),
      grain(small.mesh());
  // In the middle of the one place, between the two, and beyond.
  std::vector<fcl::Transform3d> poses;
  for (const double x : {0.5, 1.4, 2.5, 4.0}) {
    poses.push_back(test::pose<double>(Eigen::Matrix3d::Identity(), {x, 0.5, 0.5}));
  }
  std::vector<Answers> one, other;
  for (const auto& Y : poses) {
    one.push_back(Answers::of(here, grain, Y));
    other.push_back(Answers::of(there, grain, Y));
  }
  std::atomic<int> wrong{0}, running{3};
  inThreads(4, [&](int thread) {
    if (thread == 3) {
      for (int i = 0; running > 0; ++i) a.updateVertices(i % 2 ? raw.vertices : away);
      return;
    }
    for (int i = 0; i < 40; ++i) {
      for (std::size_t k = 0; k < poses.size(); ++k) {
        // The model may jump between two queries, so each is looked at by itself.
        const Answers x = Answers::of(a, grain, poses[k]);
        wrong += x.touches != one[k].touches && x.touches != other[k].touches;
        wrong += x.contacts != one[k].contacts && x.contacts != other[k].contacts;
        wrong += !(std::abs(x.distance - one[k].distance) < 1e-12 || std::abs(x.distance - other[k].distance) < 1e-12);
        wrong += !(std::abs(x.time - one[k].time) < 2e-4 || std::abs(x.time - other[k].time) < 2e-4);
      }
    }
    --running;
  });
  EXPECT_EQ(wrong, 0);
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
