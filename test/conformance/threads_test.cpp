// SPDX-License-Identifier: BSD-3-Clause
// Many threads on the same fresh models: right answers whatever else happens to the trees. Runs under TSan.
#include <fcl/geometry/octree/octree.h>
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <thread>

#include "conformance/reference.h"
#include "conformance/shapes.h"
#include "sanitized.h"
#include "thread_group.h"

namespace bocst {
namespace {

struct PosedQuery {
  fcl::Transform3d pose;
  bool expected;
};

std::vector<PosedQuery> questions(const test::Raw& raw, int count) {
  const auto f = test::bvh<fcl::OBBRSSd>(raw);
  std::mt19937_64 g(1);
  std::uniform_real_distribution<double> u(0, 1);
  std::vector<PosedQuery> all;
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  for (int i = 0; i < count; ++i) {
    const auto X = test::pose<double>(test::randomRotation(g), test::randomDirection(g) * 2.2 * u(g));
    all.push_back({X, test::touching<double>(*f, I, *f, X)});
  }
  return all;
}

TEST(Threads, OneFreshModel) {
  const test::Raw raw = test::torus(60);
  const std::vector<PosedQuery> all = questions(raw, 60);
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  for (int round = 0; round < 3; ++round) {
    const Modeld a(raw.mesh()), b(raw.mesh());
    std::atomic<int> wrong{0};
    test::ThreadGroup(4, [&](std::size_t thread) {
      for (std::size_t i = 0; i < all.size(); ++i) {
        const PosedQuery& q = all[(i * 7 + thread * 13) % all.size()];
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
  const std::vector<PosedQuery> all = questions(raw, 40);
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  Options options;
  options.ttl = std::chrono::milliseconds(1);
  options.memory_budget = 200000;
  Modeld a(raw.mesh(), options), b(raw.mesh(), options);
  std::atomic<int> wrong{0}, running{3};
  test::ThreadGroup(4, [&](std::size_t thread) {
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
      for (const PosedQuery& q : all) wrong += test::touching<double>(a, I, b, q.pose) != q.expected;
    }
    --running;
  });
  EXPECT_EQ(wrong, 0);
}

TEST(Threads, QueriesWhileEverythingIsExpanded) {
  // The complete tree expands leaves that queries test, packed ones, too.
  Modeld a(test::torus(24).mesh());
  const Modeld b(test::torus(24).mesh());
  std::atomic<bool> done{false};
  std::atomic<int> asked{0}, wrong{0};
  test::ThreadGroup threads(3, [&](std::size_t t) {
    for (int i = 0; !done || i < 20; ++i) {
      const auto X =
          test::pose<double>(Eigen::Matrix3d::Identity(), Eigen::Vector3d(1.2 + 0.02 * (i % 4), 0.3, 0.01 * t));
      wrong += !test::touching<double>(a, fcl::Transform3d::Identity(), b, X);
      ++asked;
    }
  });
  for (int i = 0; i < test::repetitions(60); ++i) a.expandAll(7);
  done = true;
  threads.join();
  EXPECT_EQ(wrong, 0);
  EXPECT_GE(asked, 60);
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
  test::ThreadGroup(4, [&](std::size_t thread) {
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
    all.distance = test::distance<double>(a, I, b, Y);
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
  test::ThreadGroup(5, [&](std::size_t thread) {
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
      const std::size_t n = (i * 5 + thread * 11) % expected.size();
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
  test::ThreadGroup(4, [&](std::size_t thread) {
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

/// One of each of FCL's shapes, an octree and a mesh.
std::vector<std::shared_ptr<fcl::CollisionGeometryd>> partners() {
  std::vector<std::shared_ptr<fcl::CollisionGeometryd>> all;
  for (const auto& s : test::shapes<double>()) all.push_back(s.shape);
  auto map = std::make_shared<octomap::OcTree>(0.2);
  std::mt19937_64 g(3);
  for (int i = 0; i < 60; ++i) {
    const Eigen::Vector3f p = (test::randomDirection(g) * 0.5).cast<float>();
    map->updateNode(octomap::point3d(p.x(), p.y(), p.z()), true);
  }
  all.push_back(std::make_shared<fcl::OcTreed>(map));
  all.push_back(test::bvh<fcl::OBBRSSd>(test::torus(10).scale(0.5)));
  return all;
}

/// Answers about a model and any partner, by the solver and in the order that `way` says.
struct ConvexAnswers {
  bool touches = false;
  std::size_t contacts = 0, costs = 0;
  double distance = 0;

  static ConvexAnswers of(const Modeld& model, const fcl::CollisionGeometryd& partner, const fcl::Transform3d& Y,
                          unsigned way) {
    const fcl::Transform3d I = fcl::Transform3d::Identity();
    const fcl::CollisionGeometryd *a = &model, *b = &partner;
    const fcl::Transform3d *X_A = &I, *X_B = &Y;
    if (way & 1) std::swap(a, b), std::swap(X_A, X_B);
    const auto solver = way & 2 ? fcl::GST_INDEP : fcl::GST_LIBCCD;
    fcl::CollisionRequestd one, all(100000, true, 100000, true, false);
    fcl::DistanceRequestd far(true);
    one.gjk_solver_type = all.gjk_solver_type = far.gjk_solver_type = solver;
    ConvexAnswers answers;
    fcl::CollisionResultd first, every;
    answers.touches = fcl::collide(a, *X_A, b, *X_B, one, first) > 0;
    answers.contacts = fcl::collide(a, *X_A, b, *X_B, all, every);
    answers.costs = every.numCostSources();
    fcl::DistanceResultd nearest;
    answers.distance = fcl::distance(a, *X_A, b, *X_B, far, nearest);
    return answers;
  }
  bool operator==(const ConvexAnswers& o) const {
    return touches == o.touches && contacts == o.contacts && costs == o.costs && std::abs(distance - o.distance) < 1e-8;
  }
};

TEST(Threads, ShapesAndOctreesWhilePruningAndLooking) {
  const test::Raw raw = test::torus(30);
  Options exact, coarse;
  exact.ttl = coarse.ttl = std::chrono::milliseconds(1);
  exact.memory_budget = 200000;
  coarse.answer = Answer::kConservative;
  coarse.depth = 5;
  const auto others = partners();
  std::mt19937_64 g(4);
  std::uniform_real_distribution<double> u(0, 1);
  std::vector<fcl::Transform3d> poses;
  for (int i = 0; i < 3; ++i) {
    poses.push_back(test::pose<double>(test::randomRotation(g), test::randomDirection(g) * (0.5 + 1.5 * u(g))));
  }
  const Modeld calm_exact(raw.mesh(), exact), calm_coarse(raw.mesh(), coarse);
  Modeld a(raw.mesh(), exact), b(raw.mesh(), coarse);
  struct Case {
    bool is_exact;
    std::size_t partner, pose;
    std::array<ConvexAnswers, 2>
        expected;  // of each solver: of cells that just touch, FCL's solvers count not the same
  };
  std::vector<Case> cases;
  int hits = 0;
  for (const bool is_exact : {true, false}) {
    for (std::size_t k = 0; k < others.size(); ++k) {
      for (std::size_t p = 0; p < poses.size(); ++p) {
        const Modeld& model = is_exact ? calm_exact : calm_coarse;
        cases.push_back(
            {is_exact,
             k,
             p,
             {ConvexAnswers::of(model, *others[k], poses[p], 0), ConvexAnswers::of(model, *others[k], poses[p], 2)}});
        hits += cases.back().expected[0].touches;
      }
    }
  }
  EXPECT_GT(hits, 10);
  EXPECT_LT(hits, static_cast<int>(cases.size()) - 10);
  std::atomic<int> wrong{0}, running{4};
  test::ThreadGroup(5, [&](std::size_t thread) {
    if (thread == 4) {
      while (running > 0) {
        for (Modeld* model : {&a, &b}) {
          model->prune(Clock::now() + std::chrono::seconds(10));
          std::size_t nodes = 0;
          model->visit([&](const NodeView&) { ++nodes; });
          if (nodes < 1 || model->statistics().resident_nodes < 1) ++wrong;
        }
        std::this_thread::yield();
      }
      return;
    }
    for (std::size_t i = 0; i < cases.size(); ++i) {
      const Case& c = cases[(i * 5 + thread * 17) % cases.size()];
      const ConvexAnswers x =
          ConvexAnswers::of(c.is_exact ? a : b, *others[c.partner], poses[c.pose], static_cast<unsigned>(thread));
      wrong += !(x == c.expected[thread / 2]);
    }
    --running;
  });
  EXPECT_EQ(wrong, 0);
}

TEST(Threads, ShapesAndOctreesWhileVerticesChange) {
  // The mesh jumps between here and there; an answer is that of the one or of the other place.
  const test::Raw raw = test::torus(16);
  std::vector<Eigen::Vector3d> away = raw.vertices;
  for (auto& v : away) v.x() += 2;
  Modeld a(raw.mesh());
  const Modeld here(raw.mesh()), there(std::make_shared<const Mesh>(away, raw.triangles));
  const auto others = partners();
  std::vector<fcl::Transform3d> poses;
  for (const double x : {0.7, 2.2, 5.0}) {
    poses.push_back(test::pose<double>(Eigen::Matrix3d::Identity(), {x, 0.1, 0.05}));
  }
  std::vector<ConvexAnswers> one, other;
  for (const auto& partner : others) {
    for (const auto& Y : poses) {
      one.push_back(ConvexAnswers::of(here, *partner, Y, 0));
      other.push_back(ConvexAnswers::of(there, *partner, Y, 0));
    }
  }
  std::atomic<int> wrong{0}, running{3};
  test::ThreadGroup(4, [&](std::size_t thread) {
    if (thread == 3) {
      for (int i = 0; running > 0; ++i) a.updateVertices(i % 2 ? raw.vertices : away);
      return;
    }
    for (std::size_t round = 0; round < 5; ++round) {
      for (std::size_t n = 0; n < one.size(); ++n) {
        // The model may jump between two queries, so each is looked at by itself.
        const ConvexAnswers x =
            ConvexAnswers::of(a, *others[n / poses.size()], poses[n % poses.size()], static_cast<unsigned>(thread));
        wrong += x.touches != one[n].touches && x.touches != other[n].touches;
        wrong += x.contacts != one[n].contacts && x.contacts != other[n].contacts;
        wrong += x.costs != one[n].costs && x.costs != other[n].costs;
        wrong += std::abs(x.distance - one[n].distance) > 1e-8 && std::abs(x.distance - other[n].distance) > 1e-8;
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
  test::ThreadGroup(4, [&](std::size_t thread) {
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
