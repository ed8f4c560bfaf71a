// SPDX-License-Identifier: BSD-3-Clause
// How a model grows, forgets and shows itself, driven by a clock of the test's own.
#include "tree/tree.h"

#include <bocst/bocst.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>

#include "fcl/adapters/models.h"
#include "lattice/lattice.h"
#include "meshes.h"
#include "oracle/reference.h"
#include "query/sides/side.h"
#include "sanitized.h"
#include "thread_group.h"
#include "tree/packed_share.h"

namespace bocst {
namespace {

using std::chrono::milliseconds;

struct FakeClock {
  Clock::time_point now = Clock::time_point(std::chrono::hours(1));
  std::function<Clock::time_point()> function() {
    return [this] { return now; };
  }
};

bool touching(const Modeld& a, const Modeld& b, const Eigen::Vector3d& p) {
  fcl::Transform3d X = fcl::Transform3d::Identity(), Y = X;
  Y.translation() = p;
  fcl::CollisionRequestd request;
  fcl::CollisionResultd result;
  const fcl::CollisionGeometryd *ga = &a, *gb = &b;
  return fcl::collide(ga, X, gb, Y, request, result) > 0;
}

const Eigen::Vector3d kHit(1.3, 0.2, 0.1), kMiss(9, 0, 0);

TEST(Tree, StartsAsOneSphere) {
  Modeld model(test::torus(64).mesh());
  const Statistics s = model.statistics();
  EXPECT_EQ(s.resident_nodes, 1u);
  EXPECT_EQ(s.nodes_per_level, std::vector<std::size_t>{1});
  EXPECT_EQ(s.resident_bytes, 0u);
  EXPECT_EQ(s.expansions, 0u);
  Modeld other(test::torus(64).mesh());
  EXPECT_FALSE(touching(model, other, kMiss));
  EXPECT_EQ(model.statistics().resident_nodes, 1u) << "a miss of the roots needs no branch";
}

TEST(Tree, GrowsOnlyWhatAQueryNeedsAndSettles) {
  Modeld a(test::torus(100).mesh()), b(test::torus(100).mesh());
  EXPECT_TRUE(touching(a, b, kHit));
  const Statistics first = a.statistics();
  EXPECT_GT(first.resident_nodes, 1u);
  Modeld whole(a.mesh());
  whole.expandAll(static_cast<int>(first.nodes_per_level.size()));
  EXPECT_LT(first.resident_nodes, whole.statistics().resident_nodes / 2);
  // The same query needs no more.
  for (int repeat = 0; repeat < 3; ++repeat) EXPECT_TRUE(touching(a, b, kHit));
  EXPECT_EQ(a.statistics().expansions, first.expansions);
}

// Whatever is asked, all growth together costs no more than about twice a build of the whole tree: what is built by
// parts is an eighth of the triangles and one query's more, then all are built at once.
TEST(Tree, GrowthCostsABuildAndAnEighth) {
  for (const std::size_t n : {std::size_t{20}, std::size_t{60}, std::size_t{150}}) {
    Options options;
    options.ttl = milliseconds(0);
    Modeld a(test::torus(n).mesh(), options), b(test::torus(n).mesh(), options);
    std::mt19937_64 g(n);
    std::uniform_real_distribution<double> u(-2.5, 2.5);
    const std::size_t triangles = a.mesh()->triangleCount();
    std::size_t most_by_parts = 0, before = 0;  // of one query
    for (int i = 0; i < 3000; ++i) {
      touching(a, b, {u(g), u(g), u(g) / 2});
      const std::size_t now = a.statistics().built_triangles;
      if (now - before < triangles) most_by_parts = std::max(most_by_parts, now - before);
      before = now;
    }
    const Statistics asked = a.statistics();
    EXPECT_GT(asked.built_triangles, triangles / 8);
    EXPECT_LE(asked.built_triangles, triangles + triangles / 8 + most_by_parts);
    if (asked.built_triangles < triangles) continue;
    for (int i = 0; i < 3000; ++i) touching(a, b, {u(g), u(g), u(g) / 2});
    EXPECT_EQ(a.statistics().built_triangles, asked.built_triangles) << "what is whole does not grow";
  }
}

// A whole tree takes milliseconds, so two of them are built in two queries.
TEST(Tree, AQueryBuildsOneWholeTreeAtMost) {
  const std::shared_ptr<const Mesh> mesh = test::torus(250).mesh();
  const std::size_t triangles = mesh->triangleCount();
  const fcl::CollisionRequestd all(1 << 20);
  Options options;
  options.oracle = OracleKind::kCpu;  // on a device nothing is built whole
  for (unsigned seed = 0; seed < 5; ++seed) {
    Modeld a(mesh, options), b(mesh, options);
    std::mt19937_64 g(seed);
    std::uniform_real_distribution<double> u(-1, 1);
    std::size_t built_a = 0, built_b = 0;
    int builds = 0;
    for (int i = 0; i < 30; ++i) {
      fcl::CollisionResultd result;
      const fcl::Transform3d X(Eigen::Translation3d(u(g), u(g), u(g)));
      fcl::collide(&a, fcl::Transform3d::Identity(), &b, X, all, result);
      const std::size_t now_a = a.statistics().built_triangles, now_b = b.statistics().built_triangles;
      const bool is_a = now_a >= built_a + triangles, is_b = now_b >= built_b + triangles;
      EXPECT_FALSE(is_a && is_b) << "query " << i;
      builds += is_a + is_b;
      built_a = now_a;
      built_b = now_b;
    }
    EXPECT_EQ(builds, 2);
  }
}

// Queries of a whole tree read no mesh but for pairs in doubt: its leaves have their corners with them, unless these
// would take most of the memory budget, or a leaf is so small beside the mesh that its corners would be rounded badly.
TEST(Tree, LeavesOfAWholeTreeArePacked) {
  const auto share = [](const std::shared_ptr<const Mesh>& mesh, std::size_t budget) {
    Options options;
    options.oracle = OracleKind::kCpu;
    options.memory_budget = budget;
    tree::Tree tree(mesh, options);
    tree.payRent(2 * mesh->triangleCount());
    EXPECT_TRUE(tree.buildIfDue());
    const test::PackedShare found = test::packedShareOf(tree);
    EXPECT_EQ(found.all, mesh->triangleCount());
    return static_cast<double>(found.packed) / static_cast<double>(found.all);
  };
  for (const std::size_t n : {std::size_t{3}, std::size_t{20}, std::size_t{80}}) {  // a leaf, below a sort, sorted
    const auto mesh = test::torus(n).mesh();
    EXPECT_EQ(share(mesh, 0), 1) << n;
    EXPECT_EQ(share(mesh, 100 * mesh->triangleCount()), 1) << n;
    EXPECT_EQ(share(mesh, 20 * mesh->triangleCount()), 0) << n;
  }
  // A torus of a 100 000th of the mesh's size.
  test::Raw raw = test::torus(40);
  raw.scale(1e-5).addTriangle({-1, 1, 2}, {0, 0, 1}, {1, 1, 0});
  EXPECT_LT(share(raw.mesh(), 0), 0.05);
}

// A sphere about the leaf of two large triangles meets far more cells than they do.
TEST(Tree, MixedAnswersGrowAlongTheTrianglesOnly) {
  const std::vector<Eigen::Vector3d> corners{{-50, -50, 0}, {50, -50, 0}, {50, 50, 0}, {-50, 50, 0}};
  const std::vector<fcl::Triangle> wall{{0, 1, 2}, {0, 2, 3}};
  Options conservative;
  conservative.answer = Answer::kConservative;
  conservative.depth = 10;
  const Modeld exact(std::make_shared<Mesh>(corners, wall));
  Modeld ring(test::torus(60).mesh(), conservative);
  const double lowest = ring.mesh()->bounds().min().z();
  EXPECT_FALSE(touching(exact, ring, {0.3, 0.2, 0.05 - lowest}));
  EXPECT_LT(ring.statistics().resident_nodes, 5000u);
  EXPECT_TRUE(touching(exact, ring, {0.3, 0.2, -0.01 - lowest}));
  EXPECT_TRUE(touching(ring, exact, {-0.3, -0.2, lowest + 0.01}));
  EXPECT_LT(ring.statistics().resident_nodes, 20000u);
}

TEST(Tree, DecaysLevelByLevelToItsRoot) {
  for (const std::size_t n : {std::size_t{20}, std::size_t{100}}) {  // without and with a root grid
    FakeClock clock;
    Options options;
    options.clock = clock.function();
    Modeld a(test::torus(n).mesh(), options), b(test::torus(n).mesh(), options);
    EXPECT_TRUE(touching(a, b, kHit));
    std::size_t levels = a.statistics().nodes_per_level.size();
    ASSERT_GT(levels, 2u);
    a.prune(clock.now + milliseconds(1999));
    EXPECT_EQ(a.statistics().nodes_per_level.size(), levels) << "not yet";
    const Statistics before = a.statistics();
    while (levels > 1) {
      clock.now += milliseconds(2001);
      a.prune();
      EXPECT_EQ(a.statistics().nodes_per_level.size(), levels - 1) << "one level at a time";
      a.prune();
      EXPECT_EQ(a.statistics().nodes_per_level.size(), levels - 1) << "the parent's own time has just started";
      levels = a.statistics().nodes_per_level.size();
      if (levels > 1) {
        EXPECT_TRUE(touching(b, Modeld(a.mesh()), kHit));
      }
    }
    const Statistics after = a.statistics();
    EXPECT_EQ(after.resident_nodes, 1u);
    EXPECT_EQ(after.resident_bytes, 0u);
    EXPECT_EQ(after.pruned_nodes, before.resident_nodes - 1);
    EXPECT_TRUE(touching(a, b, kHit)) << "and grows again";
  }
}

// How many leaves of a tree have their corners with them, and how many do not.
struct Leaves {
  std::size_t packed = 0, plain = 0;
};
Leaves leavesOf(const tree::Tree& tree) {
  Leaves leaves;
  std::vector<tree::NodeRef> stack{tree::NodeRef()};
  while (!stack.empty()) {
    const tree::ChildRef ref = tree.childRef(stack.back());
    stack.pop_back();
    if (ref.isList()) ++(tree.lists().isPacked(ref.index()) ? leaves.packed : leaves.plain);
    if (ref.tag() != tree::ChildRef::kBlock) continue;
    for (int o = 0; o < 8; ++o) {
      if ((tree.block(ref.index()).grey >> o & 1) != 0) stack.push_back(tree::NodeRef::octant(ref.index(), o));
    }
  }
  return leaves;
}

// While queries use the tree they keep its blocks, which are a small part of it, and drop the corners of leaves. These
// come back where a query reads them.
TEST(Tree, AWholeTreeInUseKeepsItsBlocksWithoutCorners) {
  FakeClock clock;
  Options options;
  options.clock = clock.function();
  options.oracle = OracleKind::kCpu;
  Modeld a(test::torus(100).mesh(), options);
  const Modeld b(test::torus(10, 0.05).mesh(), options);
  const tree::Tree& tree = fcl_adapter::treeOf(a);
  a.buildTree();
  ASSERT_TRUE(touching(a, b, kHit));
  const Statistics whole = a.statistics();
  ASSERT_EQ(leavesOf(tree).plain, 0u);
  for (int i = 0; i < 40; ++i) {
    clock.now += milliseconds(600);
    ASSERT_TRUE(touching(a, b, kHit));
  }
  EXPECT_EQ(a.statistics().resident_nodes, whole.resident_nodes);
  EXPECT_LT(a.statistics().resident_bytes, whole.resident_bytes / 2);
  const Leaves in_use = leavesOf(tree);
  EXPECT_GT(in_use.packed, 0u) << "those that the queries read";
  EXPECT_LT(in_use.packed, in_use.plain);
  const auto expectPackedAt = [&](double angle) {
    const std::size_t before = leavesOf(tree).packed;
    const Eigen::Vector3d p(std::cos(angle), std::sin(angle), 0);
    ASSERT_EQ(touching(a, b, p), touching(Modeld(a.mesh(), options), b, p));
    EXPECT_GT(leavesOf(tree).packed, before) << angle;
    EXPECT_TRUE(touching(a, b, p)) << "by the packed corners";
  };
  for (double angle = 0.5; angle < 3; angle += 0.5) expectPackedAt(angle);
  const std::size_t most = leavesOf(tree).packed;
  for (int i = 0; i < 10; ++i) {
    clock.now += milliseconds(600);
    ASSERT_TRUE(touching(a, b, kHit));
  }
  EXPECT_LT(leavesOf(tree).packed, most) << "they went again";
  for (double angle = 3.5; angle < 6; angle += 0.5) expectPackedAt(angle);
  EXPECT_EQ(a.statistics().built_triangles, whole.built_triangles) << "nothing is built for that";
  a.buildTree();
  EXPECT_EQ(leavesOf(tree).plain, 0u) << "but by whoever asks for it";
  clock.now += milliseconds(2001);
  a.prune();
  EXPECT_LT(a.statistics().resident_nodes, whole.resident_nodes) << "prune() drops all that is old";
  for (int i = 0; i < 30; ++i) {
    clock.now += milliseconds(2001);
    a.prune();
  }
  EXPECT_EQ(a.statistics().resident_nodes, 1u);
}

// The first query after a rest finds a tree that nobody has used. If it does not use it either, the blocks stay until
// the next look.
TEST(Tree, ARestIsNoReasonToDropBlocks) {
  FakeClock clock;
  Options options;
  options.clock = clock.function();
  options.oracle = OracleKind::kCpu;
  Modeld a(test::torus(100).mesh(), options);
  a.buildTree();
  const std::size_t nodes = a.statistics().resident_nodes;
  clock.now += milliseconds(20000);
  EXPECT_EQ(a.statistics().resident_nodes, nodes);
  tree::Tree& tree = fcl_adapter::treeOf(a);
  const auto look = [&] { tree.afterQuery(tree.now()); };
  look();
  EXPECT_EQ(a.statistics().resident_nodes, nodes);
  EXPECT_EQ(leavesOf(tree).packed, 0u);
  clock.now += milliseconds(20000);
  look();
  EXPECT_LT(a.statistics().resident_nodes, nodes) << "nothing used it in between";
  for (int i = 0; i < 60; ++i) {
    clock.now += milliseconds(20000);
    look();
  }
  EXPECT_EQ(a.statistics().resident_nodes, 1u) << "a model beside which nothing happens decays to its root";
}

// After it, no pose makes the tree grow.
TEST(Tree, BuildTreeLeavesNothingToGrow) {
  for (const std::size_t n : {3, 20, 100}) {
    const auto mesh = test::torus(n).mesh();
    Options on_host;
    on_host.oracle = OracleKind::kCpu;
    Modeld a(mesh, on_host), b(mesh, on_host), lazy(mesh);
    a.buildTree();
    b.buildTree();
    EXPECT_GE(a.statistics().built_triangles, mesh->triangleCount());
    const std::uint64_t expansions = a.statistics().expansions;
    std::mt19937_64 g(n);
    std::uniform_real_distribution<double> u(-1.5, 1.5);
    for (int i = 0; i < 200; ++i) {
      const Eigen::Vector3d p(u(g), u(g), u(g));
      EXPECT_EQ(touching(a, b, p), touching(lazy, b, p));
    }
    EXPECT_EQ(a.statistics().expansions, expansions);
    const std::uint64_t built = a.statistics().built_triangles;
    a.buildTree();
    EXPECT_EQ(a.statistics().built_triangles, built) << "nothing is left to build";
    EXPECT_TRUE(touching(a, b, kHit));
  }
  EXPECT_THROW(Modeld().buildTree(), std::logic_error);
  Options options;
  options.answer = Answer::kConservative;
  Modeld conservative(test::torus(20).mesh(), options);
  conservative.buildTree();
  EXPECT_EQ(conservative.statistics().resident_nodes, 1u);
}

TEST(Tree, BuildTreeBuildsWhatWasDropped) {
  const test::Raw torus = test::torus(60);
  FakeClock clock;
  Options options;
  options.oracle = OracleKind::kCpu;
  options.clock = clock.function();
  Modeld model(torus.mesh(), options);
  model.buildTree();
  const std::size_t nodes = model.statistics().resident_nodes;
  clock.now += milliseconds(3000);
  model.prune();
  EXPECT_LT(model.statistics().resident_nodes, nodes);
  EXPECT_GT(model.statistics().resident_nodes, 1u);
  model.buildTree();
  EXPECT_EQ(model.statistics().resident_nodes, nodes);
  model.expandAll(2);
  model.buildTree();
  EXPECT_EQ(model.statistics().resident_nodes, nodes);
  model.updateVertices(torus.vertices);
  EXPECT_EQ(model.statistics().resident_nodes, 1u);
  model.buildTree();
  EXPECT_EQ(model.statistics().resident_nodes, nodes);
}

// Parts that queries grew before the tree was built go without it.
TEST(Tree, BuildTreeDoesNothingWhileTheTreeIsComplete) {
  FakeClock clock;
  Options options;
  options.oracle = OracleKind::kCpu;
  options.clock = clock.function();
  const auto mesh = test::torus(60).mesh();
  Modeld model(mesh, options), twin(mesh, options), small(test::box({-.05, -.05, -.05}, {.05, .05, .05}).mesh());
  touching(model, small, {1.05, 0, 0});
  clock.now += milliseconds(1500);
  model.buildTree();
  const Statistics built = model.statistics();
  EXPECT_GT(built.built_triangles, mesh->triangleCount()) << "a query had grown a part";
  std::size_t least = built.resident_bytes;
  for (int k = 0; k < 12; ++k) {
    clock.now += milliseconds(1000);
    fcl::CollisionResultd result;
    const fcl::Transform3d X = fcl::Transform3d::Identity();
    fcl::collide(&model, X, &twin, X, fcl::CollisionRequestd(1 << 20), result);  // uses all of it
    model.prune();
    model.buildTree();
    const Statistics s = model.statistics();
    EXPECT_EQ(s.built_triangles, built.built_triangles);
    EXPECT_EQ(s.resident_nodes, built.resident_nodes);
    EXPECT_EQ(s.pruned_nodes, 0u);
    least = std::min(least, s.resident_bytes);
  }
  EXPECT_LT(least, built.resident_bytes) << "the part went";
}

// What statistics() counts is what visit() finds, also where a tree was built beside queries that grow it.
TEST(Tree, CountsTheNodesThatItHas) {
  const auto mesh = test::torus(60).mesh();
  Options options;
  options.oracle = OracleKind::kCpu;
  for (int round = 0; round < test::repetitions(20); ++round) {
    Modeld model(mesh, options), partner(mesh, options);
    test::ThreadGroup threads(3, [&](std::size_t t) {
      std::mt19937_64 g(t);
      std::uniform_real_distribution<double> u(-1.5, 1.5);
      for (int i = 0; i < 20; ++i) touching(model, partner, {u(g), u(g), u(g)});
    });
    model.buildTree();
    threads.join();
    std::vector<std::size_t> levels;
    model.visit([&](const NodeView& v) {
      const auto level = static_cast<std::size_t>(std::min(v.level, lattice::kMaxLevel));
      if (levels.size() < level) levels.resize(level, 0);
      ++levels[level - 1];
    });
    EXPECT_EQ(model.statistics().nodes_per_level, levels);
  }
}

// A block is used at the time of its own model's clock, whichever model is asked first.
TEST(Tree, ModelsWithClocksOfTheirOwnKeepWhatIsUsed) {
  for (const Answer answer : {Answer::kExact, Answer::kConservative}) {
    for (const bool turned : {false, true}) {
      // The other clock stands still.
      for (const int moving : {0, 1}) {
        FakeClock clocks[2];
        Options options[2];
        for (int i = 0; i < 2; ++i) {
          options[i].answer = answer;
          options[i].clock = clocks[i].function();
        }
        Modeld a(test::torus(60).mesh(), options[0]), b(test::torus(60).mesh(), options[1]);
        const auto ask = [&] { EXPECT_TRUE(turned ? touching(b, a, -kHit) : touching(a, b, kHit)); };
        for (int i = 0; i < 10; ++i) ask();
        for (int i = 0; i < 20; ++i) {
          clocks[moving].now += milliseconds(900);
          ask();
        }
        const std::uint64_t grown = a.statistics().expansions + b.statistics().expansions;
        for (int i = 0; i < 20; ++i) {
          clocks[moving].now += milliseconds(900);
          ask();
        }
        EXPECT_EQ(a.statistics().expansions + b.statistics().expansions, grown) << "what was dropped grew again";
      }
    }
  }
}

TEST(Tree, WhatIsUsedStays) {
  FakeClock clock;
  Options options;
  options.clock = clock.function();
  Modeld a(test::torus(100).mesh(), options), b(test::torus(100).mesh(), options);
  // What the first answer explored but the next ones pass by may go; the branch of the contact itself stays.
  for (int i = 0; i < 10; ++i) {
    clock.now += milliseconds(1500);
    EXPECT_TRUE(touching(a, b, kHit));
  }
  const Statistics used = a.statistics();
  EXPECT_GT(used.resident_nodes, 1u);
  for (int i = 0; i < 20; ++i) {
    clock.now += milliseconds(1500);
    EXPECT_TRUE(touching(a, b, kHit));
  }
  EXPECT_GT(a.statistics().resident_nodes, 1u);
  EXPECT_LE(a.statistics().resident_nodes, used.resident_nodes);
  EXPECT_EQ(a.statistics().expansions, used.expansions);
  // Queries prune by themselves: a contact elsewhere lets the old branch go.
  for (int i = 0; i < 60; ++i) {
    clock.now += milliseconds(600);
    EXPECT_TRUE(touching(a, b, -kHit));
  }
  EXPECT_GT(a.statistics().pruned_nodes, 0u);
}

// Also queries that no branch has a part in, because the boxes are far apart.
TEST(Tree, FarMissesLetBranchesGo) {
  FakeClock clock;
  Options options;
  options.clock = clock.function();
  Modeld a(test::torus(60).mesh(), options), b(test::torus(60).mesh(), options);
  EXPECT_TRUE(touching(a, b, kHit));
  ASSERT_GT(a.statistics().resident_nodes, 1u);
  for (int i = 0; i < 100; ++i) {
    clock.now += milliseconds(700);
    EXPECT_FALSE(touching(a, b, kMiss));
  }
  EXPECT_EQ(a.statistics().resident_nodes, 1u);
  EXPECT_EQ(b.statistics().resident_nodes, 1u);
  // Beside a partner that keeps its own.
  options.ttl = milliseconds(0);
  Modeld keeps(a.mesh(), options);
  for (const bool first : {true, false}) {
    EXPECT_TRUE(touching(a, keeps, kHit));
    ASSERT_GT(a.statistics().resident_nodes, 1u);
    for (int i = 0; i < 100; ++i) {
      clock.now += milliseconds(700);
      EXPECT_FALSE(first ? touching(a, keeps, kMiss) : touching(keeps, a, kMiss));
    }
    EXPECT_EQ(a.statistics().resident_nodes, 1u);
  }
}

TEST(Tree, TtlZeroKeepsEverything) {
  FakeClock clock;
  Options options;
  options.clock = clock.function();
  options.ttl = milliseconds(0);
  Modeld a(test::torus(50).mesh(), options), b(test::torus(50).mesh(), options);
  for (int i = 0; i < 30; ++i) EXPECT_TRUE(touching(a, b, kHit));
  const std::size_t grown = a.statistics().resident_nodes;
  clock.now += std::chrono::hours(100000);
  a.prune();
  EXPECT_TRUE(touching(a, b, kHit));
  EXPECT_EQ(a.statistics().resident_nodes, grown);
}

// Differences of these times do not fit 64 bits.
TEST(Tree, TimesAtTheEndsOfTheClock) {
  for (const milliseconds ttl : {milliseconds(1000), milliseconds::max(), milliseconds(18446744073710)}) {
    FakeClock clock;
    Options options;
    options.clock = clock.function();
    options.ttl = ttl;
    Modeld a(test::torus(50).mesh(), options), b(test::torus(50).mesh(), options);
    for (int i = 0; i < 30; ++i) EXPECT_TRUE(touching(a, b, kHit));
    const std::size_t grown = a.statistics().resident_nodes;
    a.prune(Clock::time_point::min());
    a.prune(clock.now + milliseconds(500));
    EXPECT_EQ(a.statistics().resident_nodes, grown) << "nothing is older than " << ttl.count() << " ms";
    clock.now = Clock::time_point::max();
    for (int i = 0; i < 3; ++i) EXPECT_TRUE(touching(a, b, kHit));
    clock.now = Clock::time_point::min();
    for (int i = 0; i < 3; ++i) EXPECT_TRUE(touching(a, b, kHit));
    a.prune(Clock::time_point::max());
    EXPECT_TRUE(touching(a, b, kHit));
  }
}

TEST(Tree, AnswersDoNotDependOnDecay) {
  FakeClock clock;
  Options options;
  options.clock = clock.function();
  Modeld a(test::torus(60).mesh(), options), b(test::torus(60).mesh(), options);
  std::mt19937_64 g(4);
  std::uniform_real_distribution<double> u(0, 1);
  for (int i = 0; i < test::repetitions(200); ++i) {
    const Eigen::Vector3d p = test::randomDirection(g) * 2.2 * u(g);
    clock.now += milliseconds(static_cast<int>(3000 * u(g)));
    if (i % 3 == 0) a.prune();
    EXPECT_EQ(touching(a, b, p), touching(Modeld(a.mesh()), Modeld(b.mesh()), p));
  }
}

TEST(Tree, StaysWithinItsBudget) {
  Options options;
  options.memory_budget = 60000;
  const auto mesh = test::torus(100).mesh();
  Modeld a(mesh, options), b(mesh);
  std::mt19937_64 g(8);
  std::uniform_real_distribution<double> u(0, 1);
  for (int i = 0; i < test::repetitions(100); ++i) {
    const Eigen::Vector3d p = test::randomDirection(g) * 2.2 * u(g);
    EXPECT_EQ(touching(a, b, p), touching(Modeld(mesh), Modeld(mesh), p));
    EXPECT_LE(a.statistics().resident_bytes, options.memory_budget);
  }
  EXPECT_GT(a.statistics().pruned_nodes, 0u);
}

// What a query of just now needed is there for the next one like it; what older ones needed goes first.
TEST(Tree, ABudgetKeepsWhatWasUsedLast) {
  Options options;
  options.ttl = milliseconds(0);
  options.oracle = OracleKind::kCpu;
  const std::shared_ptr<const Mesh> mesh = test::torus(100).mesh();
  const Modeld b(mesh);
  const auto bytesAfter = [&](const std::vector<Eigen::Vector3d>& places) {
    Modeld a(mesh, options);
    for (const Eigen::Vector3d& p : places) EXPECT_TRUE(touching(a, b, p));
    return a.statistics().resident_bytes;
  };
  const Eigen::Vector3d here = kHit, there = -kHit;
  FakeClock clock;
  options.clock = clock.function();
  options.memory_budget = (std::max(bytesAfter({here}), bytesAfter({there})) + bytesAfter({here, there})) / 2;
  Modeld a(mesh, options);
  for (const Eigen::Vector3d& p : {here, there, here, there}) {
    clock.now += milliseconds(10);
    EXPECT_TRUE(touching(a, b, p));
    clock.now += milliseconds(10);
    EXPECT_TRUE(touching(a, b, p));
    const Statistics before = a.statistics();
    EXPECT_GT(before.resident_nodes, 1u);
    EXPECT_TRUE(touching(a, b, p));
    EXPECT_EQ(a.statistics().expansions, before.expansions);
  }
  EXPECT_GT(a.statistics().pruned_nodes, 0u);
}

TEST(Tree, WhatDecayLeavesIsSmallAndGrowsAgain) {
  for (const Answer answer : {Answer::kExact, Answer::kConservative}) {
    FakeClock clock;
    Options options;
    options.clock = clock.function();
    options.oracle = OracleKind::kCpu;
    options.answer = answer;
    const std::shared_ptr<const Mesh> mesh = test::torus(30).mesh();
    Modeld a(mesh, options), fresh(mesh, options);
    a.expandAll(5);
    fresh.expandAll(4);
    const Statistics before = a.statistics();
    clock.now += milliseconds(2001);
    a.prune();
    const Statistics pruned = a.statistics();
    EXPECT_EQ(pruned.nodes_per_level, fresh.statistics().nodes_per_level);
    EXPECT_LE(pruned.resident_bytes, fresh.statistics().resident_bytes) << "the lists are the same";
    if (answer == Answer::kExact) continue;
    a.expandAll(5);
    EXPECT_EQ(a.statistics().nodes_per_level, before.nodes_per_level);
    // No triangle is ever listed twice, or lists would become longer each time.
    Modeld asked(mesh, options), b(mesh, options);
    std::size_t first = 0;
    for (int i = 0; i < 10; ++i) {
      EXPECT_TRUE(touching(asked, b, kHit));
      const std::size_t bytes = asked.statistics().resident_bytes;
      first = first == 0 ? bytes : first;
      EXPECT_LE(bytes, 2 * first);
      clock.now += milliseconds(2001);
      asked.prune();
    }
  }
  // Of exact answers, which build branches at once.
  FakeClock clock;
  Options options;
  options.clock = clock.function();
  options.oracle = OracleKind::kCpu;
  Modeld a(test::torus(40).mesh(), options), b(test::torus(40).mesh(), options);
  EXPECT_TRUE(touching(a, b, kHit));
  const std::size_t levels = a.statistics().nodes_per_level.size();
  ASSERT_GT(levels, 3u);
  while (a.statistics().nodes_per_level.size() > 2) {
    clock.now += milliseconds(2001);
    a.prune();
  }
  EXPECT_TRUE(touching(a, b, kHit));
  EXPECT_GE(a.statistics().nodes_per_level.size(), levels) << "leaves are as small as before";
}

TEST(Tree, UpdatedVerticesAreANewSurface) {
  const test::Raw raw = test::torus(60);
  Modeld a(raw.mesh()), b(raw.mesh());
  EXPECT_TRUE(touching(a, b, kHit));
  std::vector<Eigen::Vector3d> moved = raw.vertices;
  for (auto& v : moved) v += Eigen::Vector3d(5, 0, 0);
  a.updateVertices(moved);
  EXPECT_EQ(a.statistics().resident_nodes, 1u);
  EXPECT_FALSE(touching(a, b, kHit));
  EXPECT_TRUE(touching(a, b, kHit + Eigen::Vector3d(5, 0, 0)));
  EXPECT_GT(a.aabb_local.min_.x(), 3);
  EXPECT_TRUE(a.mesh()->vertex(0).isApprox(moved[0]));

  moved.pop_back();
  EXPECT_THROW(a.updateVertices(moved), std::invalid_argument);
  moved.emplace_back(std::nan(""), 0, 0);
  EXPECT_THROW(a.updateVertices(moved), std::invalid_argument);
  EXPECT_TRUE(touching(a, b, kHit + Eigen::Vector3d(5, 0, 0))) << "as before";
}

TEST(Tree, VisitShowsThePapersNodes) {
  for (const Subdivision s : {Subdivision::kOctree, Subdivision::kBono}) {
    Options options;
    options.subdivision = s;
    options.dimension = 768;
    Modeld model(test::torus(80).mesh(), options);
    model.expandAll(5);
    const lattice::Lattice lattice(model.mesh()->bounds(), s, 768);
    std::map<std::uint32_t, NodeView> nodes;
    model.visit([&](const NodeView& v) {
      if (v.parent != NodeView::kNone) {
        EXPECT_TRUE(nodes.count(v.parent)) << "parents first";
      }
      EXPECT_TRUE(nodes.emplace(v.id, v).second) << "ids are unique";
    });
    std::vector<std::size_t> levels(5, 0);
    for (const auto& [id, v] : nodes) {
      ++levels[static_cast<std::size_t>(v.level - 1)];
      EXPECT_EQ(v.object, model.mesh().get());
      EXPECT_EQ(v.n, 10 - (v.level - 1));  // the root cube of d_t = 768 has a side of 1024
      EXPECT_EQ(v.children.empty(), v.level == 5);
      for (const std::uint32_t child : v.children) {
        EXPECT_EQ(nodes.at(child).parent, id);
        EXPECT_EQ(nodes.at(child).level, v.level + 1);
        EXPECT_LE(nodes.at(child).radius, v.radius);
      }
      // The sphere is that of the actual region.
      const Eigen::AlignedBox3d region = lattice.region({v.level, v.cell});
      EXPECT_NEAR(v.radius, region.sizes().norm() / 2 * lattice.unit(), 1e-12);
      EXPECT_TRUE(v.center.isApprox(lattice.origin() + region.center() * lattice.unit()));
    }
    EXPECT_EQ(model.statistics().nodes_per_level, levels);
    EXPECT_EQ(model.statistics().resident_nodes, nodes.size());
  }
}

TEST(Tree, ExpandAllIsTheCompleteTree) {
  for (const test::Raw& raw : {test::torus(24), test::torus(60), test::adversarial()}) {  // 60: through the root grid
    const auto mesh = raw.mesh();
    for (const double dimension : {0.0, 514.0, 900.0}) {
      Options options;
      options.dimension = dimension;
      Modeld model(mesh, options);
      const lattice::Lattice lattice(mesh->bounds(), options.subdivision, dimension);
      model.expandAll(4);
      for (int level = 2; level <= 4; ++level) {
        std::size_t grey = 0;
        const std::uint32_t side = 1u << (level - 1);
        for (std::uint32_t i = 0; i < side * side * side; ++i) {
          const lattice::Cell cell{level, {i % side, i / side % side, i / side / side}};
          if (!lattice.exists(cell)) continue;
          const auto corner = cell.corner();
          const Eigen::Vector3d center = Eigen::Vector3d(corner[0], corner[1], corner[2]).array() + cell.side() / 2.0;
          for (std::size_t t = 0; t < mesh->triangleCount(); ++t) {
            Eigen::Vector3d c[3];
            for (std::size_t k = 0; k < 3; ++k) c[k] = lattice.toLattice(mesh->vertex(mesh->indices(t)[k]));
            if (oracle::triangleMeetsCube(c, center, cell.side() / 2.0)) {
              ++grey;
              break;
            }
          }
        }
        EXPECT_EQ(model.statistics().nodes_per_level.at(static_cast<std::size_t>(level - 1)), grey);
      }
    }
  }
}

TEST(Tree, CountsTheOctantsThatThePaperWouldAskAbout) {
  for (const test::Raw& raw : {test::torus(24), test::torus(60)}) {  // 60: through the root grid
    const auto mesh = raw.mesh();
    for (const Subdivision subdivision : {Subdivision::kOctree, Subdivision::kBono}) {
      for (const double dimension : {514.0, 700.0, 1024.0}) {
        Options options;
        options.subdivision = subdivision;
        options.dimension = dimension;
        Modeld model(mesh, options);
        EXPECT_EQ(model.statistics().expanded_octants, 0u);
        model.expandAll(5);
        const lattice::Lattice lattice(mesh->bounds(), subdivision, dimension);
        std::size_t octants = 0, inner = 0;
        model.visit([&](const NodeView& node) {
          if (node.level == 5) return;
          ++inner;
          for (int o = 0; o < 8; ++o) octants += lattice.exists(lattice::Cell{node.level, node.cell}.octant(o));
        });
        EXPECT_EQ(model.statistics().expanded_octants, octants);
        if (subdivision == Subdivision::kOctree || dimension == 1024) {
          EXPECT_LE(octants, 8 * inner);
        } else {
          EXPECT_LT(octants, 8 * inner) << "some octants have no actual region";
        }
      }
    }
  }
}

TEST(Tree, SpheresHoldThoseOfAllCellsBelow) {
  for (const Subdivision subdivision : {Subdivision::kOctree, Subdivision::kBono}) {
    for (const double dimension : {0.0, 514.0, 700.0, 1023.0}) {
      Options options;
      options.subdivision = subdivision;
      options.dimension = dimension;
      options.answer = Answer::kConservative;
      Modeld model(test::torus(24).scale(0.37).mesh(), options);
      model.expandAll(options.depth);
      const tree::Tree& tree = fcl_adapter::treeOf(model);
      const query::TreeSide side(fcl_adapter::treeOf(model));
      std::size_t exact = 0, inner = 0;
      const auto visit = [&](const auto& self, tree::NodeRef node, std::vector<query::Sphere> above) -> void {
        const query::Sphere cell = side.cellSphere(node), bound = side.sphere(node);
        above.push_back(bound);
        for (const query::Sphere& s : above) {
          EXPECT_LE((s.center - cell.center).norm() + cell.radius, s.radius * (1 + 1e-12));
        }
        if (tree.isDeepest(tree.cell(node).level)) return;
        ++inner;
        exact += bound.radius == cell.radius;
        side.children(node, [&](tree::NodeRef child) { self(self, child, above); });
      };
      visit(visit, side.root(), {});
      EXPECT_GT(inner, 100u);
      EXPECT_GT(exact, inner / 2) << "most cells are not clipped, and need no more than their own sphere";
      EXPECT_TRUE(subdivision == Subdivision::kBono || exact == inner);
    }
  }
}

// Boxes and slabs come from expansions, from looks at what was passed by, and from octants; none may lose a point.
TEST(Tree, BoundsHoldTheSurfaceHoweverTheyWereLearnt) {
  for (const Subdivision subdivision : {Subdivision::kOctree, Subdivision::kBono}) {
    Options options;
    options.subdivision = subdivision;
    options.ttl = milliseconds(0);
    const Modeld a(test::torus(80).mesh(), options), b(test::torus(80, 0.3).mesh(), options);
    std::mt19937_64 g(5);
    std::uniform_real_distribution<double> u(0, 1);
    for (int i = 0; i < 200; ++i) touching(a, b, test::randomDirection(g) * 2.6 * u(g));
    std::map<int, int> slabs;
    int loose = 0;
    for (const Modeld* model : {&a, &b}) {
      const tree::Tree& tree = fcl_adapter::treeOf(*model);
      const auto contains = [](const bounds::NodeBounds& bounds, const lattice::Cell& cell, const Eigen::Vector3d& p) {
        constexpr double kRounding = 1e-9;  // of p, in lattice units; bounds are rounded outwards
        double along = 0;
        for (std::size_t k = 0; k < 3; ++k) {
          const double x = p[static_cast<int>(k)] - cell.corner()[k], byte = cell.side() / 255.0;
          if (x < bounds.lo[k] * byte - kRounding || x > bounds.hi[k] * byte + kRounding) return false;
          along += bounds.normal[k] * (x / cell.side() - 0.5);
        }
        return std::abs(along - bounds.slab_center) <= bounds.slab_half / 2.0 + 400 * kRounding / cell.side() ||
               bounds.normal == bounds::NodeBounds().normal;
      };
      for (int i = 0; i < 20000; ++i) {
        // A point of the surface, and the way down to it.
        const auto t = static_cast<std::uint32_t>(g() % model->mesh()->triangleCount());
        double s = u(g), r = u(g);
        if (s + r > 1) s = 1 - s, r = 1 - r;
        const Eigen::Vector3d c0 = tree.surface().corner(t, 0), c1 = tree.surface().corner(t, 1),
                              c2 = tree.surface().corner(t, 2), p = c0 + s * (c1 - c0) + r * (c2 - c0);
        lattice::Cell cell;
        ASSERT_TRUE(contains(tree.rootBounds(), cell, p));
        tree::ChildRef ref = tree.childRef(tree::NodeRef());
        // Below loose blocks each triangle is in one lane: of those that hold the point, one must lead to it.
        const auto isHeld = [&](auto& again, tree::ChildRef at) -> bool {
          if (at.isList()) {
            std::vector<std::uint32_t> ids;
            tree.list(at).appendTo(ids);
            return std::find(ids.begin(), ids.end(), t) != ids.end();
          }
          const tree::Block& block = tree.block(at.index());
          for (int o = 0; o < 8; ++o) {
            if ((block.grey >> o & 1) == 0) continue;
            const Eigen::AlignedBox3d box = block.looseBox(o);
            const double unit = block.frame().longest() / 512;
            double along = 0;
            for (int k = 0; k < 3; ++k) along += block.octants.normal[k][o] / 127.0 * (p[k] - box.center()[k]);
            const bool holds = box.contains(p) && std::abs(along - block.octants.slab_center[o] * 2 * unit) <=
                                                      block.octants.slab_half[o] * unit;
            if (holds && again(again, block.child[o].load())) return true;
          }
          return false;
        };
        while (ref.tag() == tree::ChildRef::kBlock) {
          if (tree.block(ref.index()).isLoose()) {
            ASSERT_TRUE(isHeld(isHeld, ref));
            ++loose;
            break;
          }
          const tree::Block& block = tree.block(ref.index());
          int o = 0;
          for (int k = 0; k < 3; ++k) o |= (p[k] >= cell.corner()[static_cast<std::size_t>(k)] + cell.side() / 2) << k;
          ASSERT_TRUE(block.grey >> o & 1);
          cell = cell.octant(o);
          const bounds::NodeBounds bounds = block.octants.get(o);
          ASSERT_TRUE(contains(bounds, cell, p)) << "level " << cell.level;
          slabs[cell.level] += bounds.normal != bounds::NodeBounds().normal;
          ref = block.child[o].load();
        }
      }
    }
    EXPECT_GT(loose, 1000);
  }
}

TEST(Tree, RootBoundsHoldWhatEndsBesideWholeBytes) {
  for (const Subdivision subdivision : {Subdivision::kOctree, Subdivision::kBono}) {
    Options options;
    options.subdivision = subdivision;
    for (int byte = 1; byte < 127; ++byte) {
      for (const double off : {-0.1, 0.1}) {  // lattice units, of which a byte has 257
        Eigen::Vector3d size = Eigen::Vector3d::Constant(65536);
        const int k = byte % 3;
        size[k] = off + (subdivision == Subdivision::kBono ? 65536.0 * byte / 255 : 65536.0 - 131072.0 * byte / 255);
        const tree::Tree tree(test::box({0, 0, 0}, size).mesh(), options);
        const lattice::Lattice& lattice = tree.surface().lattice;
        const Eigen::Vector3d lo = lattice.toLattice({0, 0, 0}), hi = lattice.toLattice(size);
        const bounds::NodeBounds& bounds = tree.rootBounds();
        for (int c = 0; c < 3; ++c) {
          ASSERT_LE(bounds.lo[static_cast<std::size_t>(c)] * 65536.0 / 255, lo[c] + 1e-9) << byte;
          ASSERT_GE(bounds.hi[static_cast<std::size_t>(c)] * 65536.0 / 255, hi[c] - 1e-9) << byte;
        }
        ASSERT_LE(bounds.hi[static_cast<std::size_t>(k)] - bounds.lo[static_cast<std::size_t>(k)],
                  size[k] * 255 / 65536 + 2.01);
      }
    }
  }
}

// Which contacts are first must not depend on what has grown.
TEST(Tree, RootBoundsAreThoseOfTheMesh) {
  for (const std::size_t n : {3, 20, 60}) {
    const auto mesh = test::torus(n).mesh();
    Modeld a(mesh), b(mesh);
    const bounds::NodeBounds before = fcl_adapter::treeOf(a).rootBounds();
    for (int i = 0; i < 50; ++i) touching(a, b, {0.03 * i, 0.2, 0.1});
    EXPECT_GT(a.statistics().resident_nodes, n < 60 ? 0u : 1u);
    a.buildTree();
    EXPECT_EQ(fcl_adapter::treeOf(a).rootBounds(), before) << n;
  }
}

TEST(Tree, ConservativeTreesStopAtTheirDepth) {
  for (const bool rule : {false, true}) {
    Options options;
    options.answer = Answer::kConservative;
    options.depth = 5;
    options.dimension = 600;
    options.paper.level_rule = rule;  // 514 <= 600 < 768: one level more
    Modeld a(test::torus(100).mesh(), options), b(test::torus(100).mesh(), options);
    EXPECT_TRUE(touching(a, b, kHit));
    EXPECT_EQ(a.statistics().nodes_per_level.size(), rule ? 6u : 5u);
  }
}

TEST(Tree, DeepAndDenseMeshesStayBounded) {
  // A million triangles in one cell of the finest level, and one far away that makes the lattice coarse.
  test::Raw raw;
  raw.vertices = {{0, 0, 0}, {1e-9, 0, 0}, {0, 1e-9, 0}, {1, 1, 1}, {1, 1, 0.9}, {1, 0.9, 1}};
  raw.triangles.assign(static_cast<std::size_t>(test::repetitions(1 << 20)), fcl::Triangle(0, 1, 2));
  raw.triangles.emplace_back(3, 4, 5);
  Modeld a(raw.mesh()), b(test::box({-0.5, -0.5, 0}, {0.5, 0.5, 0.5}).mesh());
  EXPECT_TRUE(touching(a, b, {0, 0, 0}));
  EXPECT_FALSE(touching(a, b, {0, 0, 1e-6}));
  const Statistics s = a.statistics();
  EXPECT_LE(s.nodes_per_level.size(), 17u);
  EXPECT_LE(s.resident_bytes, std::size_t{4} * 20 * raw.triangles.size());
}

TEST(Tree, BadOptionsAreNamed) {
  const auto mesh = test::torus(8).mesh();
  const auto message = [&](const std::function<void(Options&)>& change) {
    Options o;
    change(o);
    try {
      Modeld model(mesh, o);
    } catch (const std::invalid_argument& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  EXPECT_EQ(message([](Options&) {}), "");
  EXPECT_NE(message([](Options& o) { o.depth = 0; }).find("depth"), std::string::npos);
  Options bad;
  bad.depth = 0;
  EXPECT_THROW(Modeld{bad}, std::invalid_argument) << "without a mesh, too";
  EXPECT_NE(message([](Options& o) { o.depth = 18; }).find("depth"), std::string::npos);
  EXPECT_NE(message([](Options& o) { o.dimension = -1; }).find("dimension"), std::string::npos);
  EXPECT_NE(message([](Options& o) { o.dimension = 65537; }).find("dimension"), std::string::npos);
  EXPECT_NE(message([](Options& o) { o.dimension = std::nan(""); }).find("dimension"), std::string::npos);
  EXPECT_NE(message([](Options& o) { o.ttl = milliseconds(-1); }).find("ttl"), std::string::npos);
  EXPECT_NE(message([](Options& o) { o.margin = -0.1; }).find("margin"), std::string::npos);
  EXPECT_NE(message([](Options& o) { o.margin = std::nan(""); }).find("margin"), std::string::npos);
  EXPECT_NE(message([](Options& o) { o.margin = 1 / 0.0; }).find("margin"), std::string::npos);
  EXPECT_THROW(Modeld(nullptr), std::invalid_argument);
  EXPECT_NE(message([](Options& o) { o.paper.viewport = 0; }).find("viewport"), std::string::npos);
  Modeld model(mesh);
  EXPECT_THROW(model.expandAll(0), std::invalid_argument);
  EXPECT_THROW(model.expandAll(18), std::invalid_argument);
}

}  // namespace
}  // namespace bocst
