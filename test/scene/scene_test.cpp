// SPDX-License-Identifier: BSD-3-Clause
// Scene against fcl::collide and fcl::distance of every pair.
#include <bocst/bocst.h>
#include <fcl/geometry/bvh/BVH_model.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <new>
#include <random>
#include <set>
#include <string>
#include <thread>
#include <tuple>
#include <utility>
#include <vector>

#include "conformance/octrees.h"
#include "conformance/reference.h"
#include "fcl/adapters/models.h"
#include "fcl/queries/scene_pair.h"
#include "sanitized.h"
#include "scene/bounds.h"
#include "thread_group.h"
#include "tree/tree.h"

namespace {

thread_local std::size_t allocations = 0, most_bytes = ~std::size_t{0};

void* allocate(std::size_t size, std::size_t alignment) {
  ++allocations;
  if (size > most_bytes) throw std::bad_alloc();
  void* p = std::aligned_alloc(alignment, (size + alignment) / alignment * alignment);
  if (p == nullptr) throw std::bad_alloc();
  return p;
}

}  // namespace

// Not inlined, or GCC takes one of them beside the call of another for a mistake.
#define BOCST_OPERATOR __attribute__((noinline))
BOCST_OPERATOR void* operator new(std::size_t size) { return allocate(size, alignof(std::max_align_t)); }
BOCST_OPERATOR void* operator new(std::size_t size, std::align_val_t alignment) {
  return allocate(size, static_cast<std::size_t>(alignment));
}
BOCST_OPERATOR void operator delete(void* p) noexcept { std::free(p); }
BOCST_OPERATOR void operator delete(void* p, std::size_t) noexcept { std::free(p); }
BOCST_OPERATOR void operator delete(void* p, std::align_val_t) noexcept { std::free(p); }
BOCST_OPERATOR void operator delete(void* p, std::size_t, std::align_val_t) noexcept { std::free(p); }

namespace bocst {
namespace {

using test::Raw;

template <typename S>
using Geometry = std::shared_ptr<fcl::CollisionGeometry<S>>;
template <typename S>
using States = std::vector<fcl::Transform3<S>>;

/// A scene, and all that it was told.
template <typename S>
struct World {
  struct Object {
    Geometry<S> geometry;
    Id id;
    fcl::Transform3<S> X_WG;
  };

  explicit World(unsigned threads = 1) : scene(SceneOptions{threads}) {}

  Id fix(Geometry<S> g, const fcl::Transform3<S>& X) {
    fixed.push_back({g, scene.addFixed(g, X), X});
    return fixed.back().id;
  }
  Id move(Geometry<S> g) {
    moving.push_back({g, scene.addMoving(g), {}});
    return moving.back().id;
  }
  void ignore(Id a, Id b) {
    scene.ignore(a, b);
    ignored.insert({a, b});
    ignored.insert({b, a});
  }

  /// Calls f(a, X_WA, b, X_WB) for all pairs in the state at X_WM that are not ignored.
  template <typename F>
  void pairs(const fcl::Transform3<S>* X_WM, F&& f) const {
    for (std::size_t i = 0; i < moving.size(); ++i) {
      for (const Object& o : fixed) {
        if (ignored.count({moving[i].id, o.id}) == 0) f(moving[i], X_WM[i], o, o.X_WG);
      }
      for (std::size_t j = i + 1; j < moving.size(); ++j) {
        if (ignored.count({moving[i].id, moving[j].id}) == 0) f(moving[i], X_WM[i], moving[j], X_WM[j]);
      }
    }
  }

  std::set<std::pair<Id, Id>> hits(const fcl::Transform3<S>* X_WM) const {
    std::set<std::pair<Id, Id>> all;
    pairs(X_WM, [&](const Object& a, const auto& X_WA, const Object& b, const auto& X_WB) {
      if (test::touching<S>(*a.geometry, X_WA, *b.geometry, X_WB)) all.insert({a.id, b.id});
    });
    return all;
  }

  S clearance(const fcl::Transform3<S>* X_WM) const {
    S least = std::numeric_limits<S>::max();
    pairs(X_WM, [&](const Object& a, const auto& X_WA, const Object& b, const auto& X_WB) {
      least = std::min(least, std::max(test::distance<S>(*a.geometry, X_WA, *b.geometry, X_WB), S(0)));
    });
    return least;
  }

  Scene<S> scene;
  std::vector<Object> fixed, moving;
  std::set<std::pair<Id, Id>> ignored;
};

template <typename S>
fcl::Transform3<S> randomPose(std::mt19937_64& g, double spread) {
  std::uniform_real_distribution<double> u(-spread, spread);
  return test::pose<S>(test::randomRotation(g), {u(g), u(g), u(g)});
}

/// One of all kinds.
template <typename S>
Geometry<S> geometry(std::size_t kind, std::mt19937_64& g) {
  std::uniform_real_distribution<double> u(0.2, 0.7);
  Raw raw = kind % 2 == 0 ? test::torus(8 + kind % 5) : test::box({-0.5, -0.2, -0.3}, {0.5, 0.4, 0.3});
  raw.scale(u(g));
  const S x = static_cast<S>(u(g)), y = static_cast<S>(u(g)), z = static_cast<S>(u(g));
  Options options;
  options.ttl = std::chrono::milliseconds(0);  // on slow machines branches would go between two questions
  switch (kind % 10) {
    case 0:
    case 1:
    case 2:
      return std::make_shared<Model<S>>(raw.mesh(), options);
    case 3:
      options.margin = 0.05;
      return std::make_shared<Model<S>>(raw.mesh(), options);
    case 4:
      options.answer = Answer::kConservative;
      options.depth = 4;
      return std::make_shared<Model<S>>(raw.mesh(), options);
    case 5:
      options.solid = true;
      return std::make_shared<Model<S>>(raw.mesh(), options);
    case 6:
      return test::bvh<fcl::OBBRSS<S>>(raw);
    case 7:
      return std::make_shared<fcl::Box<S>>(x, y, z);
    case 8:
      return std::make_shared<fcl::Sphere<S>>(x / 2);
    default:
      return std::make_shared<fcl::Capsule<S>>(x / 3, y);
  }
}

template <typename S>
void populate(World<S>& w, std::size_t moving, std::size_t fixed, double spread, unsigned seed) {
  std::mt19937_64 g(seed);
  for (std::size_t i = 0; i < fixed; ++i) w.fix(geometry<S>(i, g), randomPose<S>(g, spread));
  for (std::size_t i = 0; i < moving; ++i) w.move(geometry<S>(3 * i, g));
  for (std::size_t i = 0; i + 1 < moving; i += 2) w.ignore(w.moving[i].id, w.moving[i + 1].id);
  if (moving > 0 && fixed > 2) w.ignore(w.fixed[2].id, w.moving[0].id);
}

/// Rows of states that go from one random state to the next in small steps, and some far from each other.
template <typename S>
States<S> walk(std::size_t states, std::size_t moving, double spread, double step, unsigned seed) {
  std::mt19937_64 g(seed);
  std::normal_distribution<double> n;
  States<S> all(states * moving);
  for (std::size_t k = 0; k < states; ++k) {
    for (std::size_t i = 0; i < moving; ++i) {
      fcl::Transform3<S>& X = all[k * moving + i];
      if (k % 40 == 0) {
        X = randomPose<S>(g, spread);
        continue;
      }
      const fcl::Transform3<double> last = all[(k - 1) * moving + i].template cast<double>();
      const Eigen::AngleAxisd turn(step * n(g), test::randomDirection(g));
      Eigen::Quaterniond q(Eigen::Matrix3d(turn * last.linear()));
      X = test::pose<S>(q.normalized().toRotationMatrix(), last.translation() + step * test::randomDirection(g));
    }
  }
  return all;
}

template <typename S>
class SceneTest : public testing::Test {};
TYPED_TEST_SUITE(SceneTest, test::Scalars);

template <typename S>
void checkVerdicts(const World<S>& w, const States<S>& X, std::size_t states, std::size_t& hits) {
  const std::size_t moving = w.moving.size();
  std::vector<std::uint8_t> expected(states), hit(states, 7);
  for (std::size_t k = 0; k < states; ++k) {
    const auto touching = w.hits(X.data() + k * moving);
    expected[k] = !touching.empty();
    hits += expected[k];
    Pair pair;
    ASSERT_EQ(w.scene.collides(X.data() + k * moving, &pair), expected[k] != 0) << "state " << k;
    ASSERT_EQ(w.scene.collides(X.data() + k * moving), expected[k] != 0);
    if (expected[k]) {
      EXPECT_EQ(touching.count({pair.a, pair.b}), 1u);
    }
    std::vector<std::pair<Id, Id>> listed;
    for (const Pair& p : w.scene.collidingPairs(X.data() + k * moving)) listed.emplace_back(p.a, p.b);
    ASSERT_EQ(listed, std::vector(touching.begin(), touching.end())) << "state " << k;
  }
  w.scene.collisions(X.data(), states, hit.data());
  EXPECT_EQ(hit, expected);
  // Parts of the row, of many lengths.
  for (std::size_t begin = 0, length = 1; begin + length <= states; begin += length, length += 3) {
    const auto first = std::find(expected.begin() + begin, expected.begin() + begin + length, 1) - expected.begin();
    const auto* from = X.data() + begin * moving;
    EXPECT_EQ(w.scene.firstCollision(from, length), static_cast<std::size_t>(first) - begin);
    std::size_t where = length;
    ASSERT_EQ(w.scene.anyCollision(from, length, &where), static_cast<std::size_t>(first) < begin + length);
    if (where < length) {
      EXPECT_TRUE(expected[begin + where]);
    }
    std::vector<std::uint8_t> part(length, 7);
    w.scene.collisions(from, length, part.data());
    EXPECT_TRUE(std::equal(part.begin(), part.end(), expected.begin() + begin));
  }
  const auto first = std::find(expected.begin(), expected.end(), 1) - expected.begin();
  EXPECT_EQ(w.scene.firstCollision(X.data(), states), static_cast<std::size_t>(first));
}

TYPED_TEST(SceneTest, OnlyOccupiedModelsCollide) {
  using S = TypeParam;
  const auto occupied = std::make_shared<Model<S>>(test::torus(6).mesh()),
             free = std::make_shared<Model<S>>(test::torus(6).mesh());
  free->cost_density = 0;
  const auto X = test::pose<S>(Eigen::Matrix3d::Identity(), {0.1, 0, 0});
  const auto touch = [&X](const auto& fixed, const auto& moving) {
    Scene<S> scene;
    scene.addFixed(fixed, test::pose<S>(Eigen::Matrix3d::Identity(), {0, 0, 0}));
    scene.addMoving(moving);
    std::uint8_t hit = 0;
    scene.collisions(&X, 1, &hit);
    EXPECT_EQ(scene.collides(&X), hit != 0);
    return hit != 0;
  };
  EXPECT_TRUE(touch(occupied, occupied));
  EXPECT_FALSE(touch(occupied, free));
  EXPECT_FALSE(touch(free, occupied));
}

TYPED_TEST(SceneTest, VerdictsAreThoseOfAllPairs) {
  using S = TypeParam;
  std::size_t all_hits = 0, all_states = 0;
  for (const auto& [moving, fixed, spread, step] :
       {std::tuple(4, 20, 3.0, 0.05), std::tuple(1, 9, 0.8, 0.01), std::tuple(11, 3, 2.0, 0.02),
        std::tuple(2, 150, 7.0, 0.2), std::tuple(3, 0, 0.6, 0.03)}) {
    SCOPED_TRACE(fixed);
    for (const unsigned threads : {1u, 3u}) {
      World<S> w(threads);
      populate(w, static_cast<std::size_t>(moving), static_cast<std::size_t>(fixed), spread, 7);
      const std::size_t states = 400;
      std::size_t hits = 0;
      checkVerdicts(w, walk<S>(states, w.moving.size(), spread, step, threads), states, hits);
      EXPECT_GT(hits, states / 50);
      all_hits += hits;
      all_states += states;
    }
  }
  EXPECT_LT(all_hits, all_states - all_states / 10);
}

TYPED_TEST(SceneTest, OctreesPlanesAndMapsWithoutCells) {
  using S = TypeParam;
  World<S> w;
  std::mt19937_64 g(5);
  w.fix(test::cloud<S>(3, 60), test::pose<S>(Eigen::Matrix3d::Identity(), {0.5, 0, 0}));
  w.fix(test::cloud<S>(std::make_shared<octomap::OcTree>(0.1)), fcl::Transform3<S>::Identity());
  w.fix(std::make_shared<fcl::Halfspace<S>>(fcl::Vector3<S>::UnitZ(), S(-1.5)), randomPose<S>(g, 0.1));
  w.fix(std::make_shared<fcl::Plane<S>>(fcl::Vector3<S>::UnitX(), S(2)), fcl::Transform3<S>::Identity());
  w.fix(geometry<S>(0, g), randomPose<S>(g, 1));
  w.move(geometry<S>(0, g));
  w.move(geometry<S>(7, g));
  const std::size_t states = 400;
  std::size_t hits = 0;
  checkVerdicts(w, walk<S>(states, 2, 3, 0.05, 9), states, hits);
  EXPECT_GT(hits, states / 10);
  EXPECT_LT(hits, states - states / 10);
}

// What has no bounds moves, among objects that are nowhere near its frame.
TYPED_TEST(SceneTest, UnboundedObjectsMove) {
  using S = TypeParam;
  for (const bool is_plane : {false, true}) {
    World<S> w;
    std::mt19937_64 g(8);
    w.fix(geometry<S>(0, g), test::pose<S>(Eigen::Matrix3d::Identity(), {40, -30, 20}));
    w.move(geometry<S>(0, g));
    if (is_plane) {
      w.move(std::make_shared<fcl::Plane<S>>(fcl::Vector3<S>::UnitX(), S(0)));
    } else {
      w.move(std::make_shared<fcl::Halfspace<S>>(fcl::Vector3<S>::UnitX(), S(0)));
    }
    const std::size_t states = 60;
    States<S> X;
    for (std::size_t k = 0; k < states; ++k) {
      X.push_back(test::pose<S>(Eigen::Matrix3d::Identity(), {200, 0, 100}));
      X.push_back(test::pose<S>(Eigen::Matrix3d::Identity(), {static_cast<double>(k), 0, 0}));
    }
    std::size_t hits = 0;
    checkVerdicts(w, X, states, hits);
    EXPECT_GT(hits, 0u);
    EXPECT_LT(hits, states);
  }
}

// Contacts are found where they begin, and far from the origin of the world.
TYPED_TEST(SceneTest, VerdictsOnTheBrinkOfContact) {
  using S = TypeParam;
  const double digits = std::is_same<S, double>::value ? 1e-15 : 1e-6;
  for (const double far : {0.0, 30.0, 4000.0}) {
    for (const std::size_t kind : {0, 3, 6, 7, 8}) {
      World<S> w;
      std::mt19937_64 g(11);
      const Eigen::Vector3d away = far * test::randomDirection(g);
      w.fix(geometry<S>(kind, g), test::pose<S>(test::randomRotation(g), away));
      w.move(geometry<S>(1, g));
      States<S> X;
      for (int turn = 0; turn < 8; ++turn) {
        const Eigen::Vector3d direction = test::randomDirection(g);
        const Eigen::Matrix3d R = test::randomRotation(g);
        const auto at = [&](double d) { return test::pose<S>(R, away + d * direction); };
        const double contact = test::contactDistance(
            [&](double d) {
              const auto pose = at(d);
              return !w.hits(&pose).empty();
            },
            4, 60);
        for (int k = -20; k <= 20; ++k) X.push_back(at(contact + k * (1 + far) * digits));
      }
      std::size_t hits = 0;
      checkVerdicts(w, X, X.size(), hits);
      EXPECT_GT(hits, X.size() / 20);
      EXPECT_LT(hits, X.size() - X.size() / 20);
    }
  }
}

TYPED_TEST(SceneTest, AnswersDoNotDependOnThreadsOrHistory) {
  using S = TypeParam;
  const std::size_t states = 3000;
  const States<S> X = walk<S>(states, 4, 3, 0.03, 21);
  std::vector<std::uint8_t> expected;
  std::size_t where_expected = 0, first_expected = 0;
  for (const unsigned threads : {1u, 2u, 3u, 4u, 0u}) {
    World<S> w(threads);
    populate(w, 4, 30, 3, 8);
    for (int again = 0; again < 2; ++again) {
      std::vector<std::uint8_t> hit(states);
      w.scene.collisions(X.data(), states, hit.data());
      std::size_t where = states;
      EXPECT_TRUE(w.scene.anyCollision(X.data(), states, &where));
      const std::size_t first = w.scene.firstCollision(X.data(), states);
      if (expected.empty()) {
        expected = hit;
        where_expected = where;
        first_expected = first;
      }
      EXPECT_EQ(hit, expected);
      EXPECT_EQ(where, where_expected);
      EXPECT_EQ(first, first_expected);
    }
    // The same states one by one, in another order.
    std::mt19937_64 g(3);
    for (int k = 0; k < 300; ++k) {
      const std::size_t state = g() % states;
      EXPECT_EQ(w.scene.collides(X.data() + 4 * state), expected[state] != 0);
    }
  }
}

TYPED_TEST(SceneTest, Changes) {
  using S = TypeParam;
  World<S> w;
  populate(w, 4, 12, 2, 5);
  std::mt19937_64 g(17);
  std::size_t hits = 0;
  const std::size_t all_pairs = 4 * 12 + 6 - w.ignored.size() / 2;
  EXPECT_EQ(w.scene.pairCount(), all_pairs);
  const auto check = [&](unsigned seed) {
    const std::size_t states = 60;
    EXPECT_EQ(w.scene.movingCount(), w.moving.size());
    EXPECT_EQ(w.scene.fixedCount(), w.fixed.size());
    for (std::size_t i = 0; i < w.moving.size(); ++i) EXPECT_EQ(w.scene.movingIndex(w.moving[i].id), i);
    checkVerdicts(w, walk<S>(states, w.moving.size(), 2, 0.05, seed), states, hits);
  };
  check(1);
  w.fixed[3].X_WG = randomPose<S>(g, 2);
  w.scene.setPose(w.fixed[3].id, w.fixed[3].X_WG);
  check(2);
  w.scene.remove(w.moving[1].id);
  w.moving.erase(w.moving.begin() + 1);
  check(3);
  w.scene.remove(w.fixed[0].id);
  w.fixed.erase(w.fixed.begin());
  w.move(geometry<S>(8, g));
  check(4);
  w.ignore(w.moving[0].id, w.fixed[5].id);
  check(5);
  w.scene.ignore(w.fixed[5].id, w.moving[0].id, false);
  w.ignored.erase({w.moving[0].id, w.fixed[5].id});
  check(6);
  while (!w.fixed.empty()) {
    w.scene.remove(w.fixed.back().id);
    w.fixed.pop_back();
  }
  check(7);
  EXPECT_GT(hits, 20u);
}

// Changes between queries: of few and of many objects, so that places are used again, the hierarchy grows at its root
// and is made anew, and moving objects come and go.
TYPED_TEST(SceneTest, ManyChangesBetweenQueries) {
  using S = TypeParam;
  for (const auto& [seed, start] : {std::pair(1u, 0), std::pair(2u, 30), std::pair(3u, 200)}) {
    SCOPED_TRACE(start);
    World<S> w;
    std::mt19937_64 g(seed);
    const double spread = start > 100 ? 6 : 3;
    populate(w, 3, static_cast<std::size_t>(start), spread, seed);
    std::size_t hits = 0, states = 0;
    std::set<Id> nowhere;  // FCL has no distance of these
    const auto any = [&g](auto& list) -> auto& { return list[g() % list.size()]; };
    const auto forget = [&w](auto& list, std::size_t at) {
      const Id id = list[at].id;
      w.scene.remove(id);
      list.erase(list.begin() + static_cast<std::ptrdiff_t>(at));
      for (auto i = w.ignored.begin(); i != w.ignored.end();) {
        i = i->first == id || i->second == id ? w.ignored.erase(i) : std::next(i);
      }
    };
    for (int round = 0; round < 60; ++round) {
      for (std::size_t changes = g() % 8; changes > 0; --changes) {
        const std::size_t what = g() % 16;
        if (what < 6 || w.fixed.empty() || w.moving.empty()) {
          const bool is_empty = what == 5 && g() % 2 == 0;
          const Geometry<S> octree = test::cloud<S>(seed, is_empty ? 0 : 30);
          const Id id = w.fix(what == 5 ? octree : geometry<S>(g(), g), randomPose<S>(g, spread));
          if (is_empty) nowhere.insert(id);
        } else if (what < 9) {
          auto& object = any(w.fixed);
          object.X_WG = randomPose<S>(g, g() % 5 == 0 ? 40 * spread : spread);
          w.scene.setPose(object.id, object.X_WG);
        } else if (what < 12) {
          forget(w.fixed, g() % w.fixed.size());
        } else if (what == 12) {
          w.move(geometry<S>(g(), g));
        } else if (what == 13 && w.moving.size() > 1) {
          forget(w.moving, g() % w.moving.size());
        } else if (what == 14) {
          w.scene.update(any(w.fixed).id);
        } else {
          const Id a = any(w.moving).id, b = g() % 3 == 0 ? any(w.moving).id : any(w.fixed).id;
          if (a == b) continue;
          w.ignore(a, b);
          if (g() % 3 != 0) continue;
          w.scene.ignore(b, a, false);
          w.ignored.erase({a, b});
          w.ignored.erase({b, a});
        }
      }
      std::size_t pairs = 0;
      w.pairs(States<S>(w.moving.size()).data(), [&pairs](const auto&...) { ++pairs; });
      ASSERT_EQ(w.scene.pairCount(), pairs);
      ASSERT_EQ(w.scene.fixedCount(), w.fixed.size());
      for (std::size_t i = 0; i < w.moving.size(); ++i) ASSERT_EQ(w.scene.movingIndex(w.moving[i].id), i);
      const States<S> X = walk<S>(3, w.moving.size(), spread, 0.05, static_cast<unsigned>(round));
      ASSERT_NO_FATAL_FAILURE(checkVerdicts(w, X, 3, hits));
      states += 3;
      const auto isNowhere = [&](const auto& object) { return nowhere.count(object.id) != 0; };
      if (round % 4 != 0 || std::any_of(w.fixed.begin(), w.fixed.end(), isNowhere)) continue;
      Pair nearest;
      const S clearance = w.scene.clearance(X.data(), &nearest);
      const double rounding = std::is_same<S, double>::value ? 2e-6 : 2e-5;
      ASSERT_NEAR(clearance, w.clearance(X.data()), rounding);
    }
    EXPECT_GT(hits, states / 10);
    EXPECT_LT(hits, states);
  }
}

template <typename S>
fcl::Transform3<S> placeAt(S x, S y, S z) {
  fcl::Transform3<S> X = fcl::Transform3<S>::Identity();
  X.translation() << x, y, z;
  return X;
}

// One pair decides, so a change that is lost shows.
// A removed geometry that nobody else holds is destroyed by remove() itself, not under the locks of a later query.
TYPED_TEST(SceneTest, RemovedGeometriesAreDestroyedAtOnce) {
  using S = TypeParam;
  const auto ball = std::make_shared<fcl::Sphere<S>>(S(1));
  Scene<S> scene;
  scene.addMoving(ball);
  scene.addFixed(ball, placeAt<S>(50, 0, 0));
  const States<S> X(2, placeAt<S>(0, 0, 0));
  EXPECT_FALSE(scene.collides(X.data()));
  for (const bool moves : {true, false}) {
    auto geometry = std::make_shared<fcl::Sphere<S>>(S(2));
    const std::weak_ptr<fcl::Sphere<S>> watch = geometry;
    const Id id = moves ? scene.addMoving(geometry) : scene.addFixed(geometry, X[0]);
    EXPECT_TRUE(scene.collides(X.data()));
    geometry.reset();
    scene.remove(id);
    EXPECT_TRUE(watch.expired()) << moves;
    EXPECT_FALSE(scene.collides(X.data()));
  }
}

TYPED_TEST(SceneTest, IgnoredPairsStayIgnoredThroughChanges) {
  using S = TypeParam;
  const auto ball = std::make_shared<fcl::Sphere<S>>(S(1));
  Scene<S> scene;
  const Id a = scene.addMoving(ball), b = scene.addMoving(ball), f = scene.addFixed(ball, placeAt<S>(5, 0, 0));
  for (int i = 0; i < 40; ++i) scene.addFixed(ball, placeAt<S>(S(100 + 3 * i), 0, 0));
  const States<S> beside_f = {placeAt<S>(S(5.5), 0, 0), placeAt<S>(0, 20, 0)};
  const States<S> together = {placeAt<S>(0, 0, 20), placeAt<S>(0, S(0.5), 20)};
  EXPECT_TRUE(scene.collides(beside_f.data()));
  scene.ignore(a, f);
  EXPECT_FALSE(scene.collides(beside_f.data()));
  scene.setPose(f, placeAt<S>(5, S(0.1), 0));
  EXPECT_FALSE(scene.collides(beside_f.data()));
  scene.ignore(f, a, false);
  EXPECT_TRUE(scene.collides(beside_f.data()));
  EXPECT_TRUE(scene.collides(together.data()));
  scene.ignore(b, a);
  EXPECT_FALSE(scene.collides(together.data()));
  scene.ignore(a, b, false);
  EXPECT_TRUE(scene.collides(together.data()));
}

// So many objects come that the root of the hierarchy moves down; then some leave its bounds.
TYPED_TEST(SceneTest, ObjectsAreFoundWhereTheyMove) {
  using S = TypeParam;
  const auto ball = std::make_shared<fcl::Sphere<S>>(S(1));
  Scene<S> scene;
  scene.addMoving(ball);
  std::mt19937_64 g(5);
  std::uniform_real_distribution<S> u(-500, 500);
  std::vector<Id> fixed;
  const auto touchesAt = [&scene](const fcl::Transform3<S>& X) { return scene.collides(&X); };
  for (int i = 0; i < 580; ++i) {
    fixed.push_back(scene.addFixed(ball, placeAt<S>(u(g), u(g), u(g))));
    if (i >= 512) touchesAt(placeAt<S>(0, 0, 700));  // from here on, each is added to what was made
  }
  for (int i = 0; i < 50; ++i) {
    const fcl::Transform3<S> X = placeAt<S>(600, S(10 * i), S(3 * i));
    EXPECT_FALSE(touchesAt(X));
    scene.setPose(fixed[static_cast<std::size_t>(11 * i)], X);
    EXPECT_TRUE(touchesAt(X)) << i;
  }
}

// What has no bounds is placed apart from the others.
TYPED_TEST(SceneTest, HalfSpacesMove) {
  using S = TypeParam;
  Scene<S> scene;
  scene.addMoving(std::make_shared<fcl::Halfspace<S>>(fcl::Vector3<S>::UnitZ(), S(0)));
  scene.addMoving(std::make_shared<Model<S>>(test::torus(8).mesh()));
  scene.addFixed(std::make_shared<Model<S>>(test::torus(10).mesh()), placeAt<S>(50, 0, 10));
  const States<S> below = {placeAt<S>(0, 0, 0), placeAt<S>(0, 0, 90)}, above = {placeAt<S>(0, 0, 20), below[1]},
                  both = {placeAt<S>(0, 0, 0), placeAt<S>(-40, 0, -5)};
  EXPECT_FALSE(scene.collides(below.data()));
  EXPECT_TRUE(scene.collides(above.data()));
  EXPECT_TRUE(scene.collides(both.data()));
}

// Objects that share a geometry share what the scene knows of it, also when one of them is gone.
TYPED_TEST(SceneTest, DeformedMesh) {
  using S = TypeParam;
  const Raw raw = test::torus(10);
  for (const bool is_model : {true, false}) {
    const auto model = std::make_shared<Model<S>>(raw.mesh());
    const auto bvh = test::bvh<fcl::OBBRSS<S>>(raw);
    const std::shared_ptr<fcl::CollisionGeometry<S>> mesh = is_model ? Geometry<S>(model) : Geometry<S>(bvh);
    const auto deform = [&](const Eigen::Vector3d& displacement) {
      std::vector<Eigen::Vector3d> vertices;
      for (const auto& v : raw.vertices) vertices.push_back(v + displacement);
      if (is_model) {
        model->updateVertices(vertices);
      } else {
        bvh->beginReplaceModel();
        for (const auto& v : vertices) bvh->replaceVertex(v.cast<S>());
        bvh->endReplaceModel();
      }
    };
    const auto at = [](double x) { return test::pose<S>(Eigen::Matrix3d::Identity(), {x, 0, 0}); };
    Scene<S> scene;
    const Id zero = scene.addFixed(mesh, at(0)), ten = scene.addFixed(mesh, at(10));
    scene.addMoving(std::make_shared<fcl::Sphere<S>>(S(0.2)));
    const auto collides = [&](double x) {
      const auto X = at(x);
      return scene.collides(&X);
    };
    EXPECT_TRUE(collides(1) && collides(11));
    EXPECT_FALSE(collides(5) || collides(15));
    deform({4, 0, 0});
    scene.update(zero);
    EXPECT_TRUE(collides(5) && collides(15)) << "of the other, too";
    EXPECT_FALSE(collides(1) || collides(11));
    scene.remove(ten);
    const Id twenty = scene.addFixed(mesh, at(20));
    EXPECT_TRUE(collides(5) && collides(25));
    EXPECT_FALSE(collides(15));
    deform({0, 0, 0});
    scene.update(twenty);
    EXPECT_TRUE(collides(1) && collides(21));
    scene.remove(twenty);
    if (is_model) {
      model->beginModel();
      EXPECT_THROW(scene.addFixed(mesh, at(0)), std::logic_error);
      model->addTriangle(fcl::Vector3<S>(0, 0, 0), fcl::Vector3<S>(1, 0, 0), fcl::Vector3<S>(0, 1, 0));
      model->endModel();
      model->setMesh(raw.mesh());
    }
    scene.remove(zero);
    EXPECT_FALSE(collides(1) || collides(21));
    deform({4, 0, 0});
    scene.addFixed(mesh, at(0));
    EXPECT_TRUE(collides(5)) << "nothing is known of a geometry that left";
  }
}

// What an object knows of its geometry does not go with another object that was added later.
TYPED_TEST(SceneTest, ObjectsShareTheModelOfAMeshAfterOneOfThemLeft) {
  using S = TypeParam;
  const auto mesh = test::bvh<fcl::OBBRSS<S>>(test::box({-1, -1, -1}, {1, 1, 1}));
  const auto at = [](double x) { return test::pose<S>(Eigen::Matrix3d::Identity(), {x, 0, 0}); };
  Scene<S> scene;
  scene.addFixed(mesh, at(0));
  const Id later = scene.addFixed(mesh, at(10));
  scene.addMoving(std::make_shared<fcl::Sphere<S>>(S(0.2)));
  scene.remove(later);
  ASSERT_EQ(mesh->beginReplaceModel(), fcl::BVH_OK);
  for (const auto& v : test::box({3, -1, -1}, {5, 1, 1}).vertices) mesh->replaceVertex(v.cast<S>());
  ASSERT_EQ(mesh->endReplaceModel(), fcl::BVH_OK);
  scene.addFixed(mesh, at(20));
  for (const double x : {1.0, 21.0}) {
    const auto X = at(x);
    EXPECT_TRUE(scene.collides(&X)) << "the mesh changed, but update() was not called: " << x;
  }
}

// A model stands for one of FCL's meshes: faces that rest on one another touch, and its occupancy counts.
TYPED_TEST(SceneTest, MeshesOfFclAreChecked) {
  using S = TypeParam;
  const auto cube = test::bvh<fcl::OBB<S>>(test::box({-1, -1, -1}, {1, 1, 1}));
  const auto other = test::bvh<fcl::KDOP<S, 24>>(test::box({-1, -1, -1}, {1, 1, 1}));
  Scene<S> scene;
  const Id fixed = scene.addFixed(cube, fcl::Transform3<S>::Identity());
  scene.addMoving(other);
  const auto at = [](double x) { return test::pose<S>(Eigen::Matrix3d::Identity(), {x, 0, 0}); };
  const auto resting = at(2), apart = at(2.25);
  EXPECT_TRUE(scene.collides(&resting));
  EXPECT_FALSE(scene.collides(&apart));
  EXPECT_EQ(scene.clearance(&apart), S(0.25));
  EXPECT_TRUE(scene.edgeIsFree(&apart, &apart));
  cube->cost_density = 0;
  scene.update(fixed);
  EXPECT_FALSE(scene.collides(&resting));
  EXPECT_TRUE(scene.edgeIsFree(&resting, &apart));
}

TYPED_TEST(SceneTest, ScenesWithoutPairs) {
  using S = TypeParam;
  std::mt19937_64 g(1);
  Scene<S> scene;
  std::uint8_t hit[3] = {7, 7, 7};
  std::size_t where = 9;
  const auto isFree = [&](const fcl::Transform3<S>* X) {
    EXPECT_FALSE(scene.collides(X));
    EXPECT_EQ(scene.firstCollision(X, 3), 3u);
    EXPECT_FALSE(scene.anyCollision(X, 3, &where));
    EXPECT_FALSE(scene.anyCollision(X, 0, &where)) << "no states";
    EXPECT_EQ(where, 9u);
    scene.collisions(X, 3, hit);
    EXPECT_EQ(hit[0] + hit[1] + hit[2], 0);
    Pair nearest;
    EXPECT_EQ(scene.clearance(X, &nearest), std::numeric_limits<S>::max());
    EXPECT_FALSE(nearest.a.isValid() || nearest.b.isValid());
    S distances[3] = {1, 1, 1};
    Pair pairs[3];
    scene.clearances(X, 3, distances, pairs);
    EXPECT_EQ(distances[0] + distances[1] + distances[2], 3 * std::numeric_limits<S>::max());
    EXPECT_FALSE(pairs[0].a.isValid());
    EXPECT_TRUE(scene.collidingPairs(X).empty());
    EXPECT_TRUE(scene.pairsWithin(X, std::numeric_limits<S>::infinity()).empty());
    EXPECT_TRUE(scene.edgeIsFree(X, X));
    EXPECT_EQ(scene.pairCount(), 0u);
  };
  isFree(nullptr);
  const Id fixed = scene.addFixed(geometry<S>(0, g), randomPose<S>(g, 1));
  scene.addFixed(geometry<S>(0, g), randomPose<S>(g, 1));
  isFree(nullptr);
  scene.remove(fixed);
  EXPECT_EQ(scene.fixedCount(), 1u);
  Scene<S> alone;
  alone.addMoving(geometry<S>(0, g));
  const States<S> X(3, randomPose<S>(g, 1));
  EXPECT_FALSE(alone.collides(X.data()));
  EXPECT_EQ(alone.clearance(X.data()), std::numeric_limits<S>::max());
  EXPECT_EQ(alone.firstCollision(X.data(), 0), 0u);
}

TYPED_TEST(SceneTest, ClearanceIsTheLeastDistance) {
  using S = TypeParam;
  World<S> w;
  std::mt19937_64 g(2);
  for (std::size_t i = 0; i < 25; ++i) w.fix(geometry<S>(i % 3 == 2 ? 6 : 0, g), randomPose<S>(g, 3));
  for (const std::size_t kind : {0, 1, 8}) w.move(geometry<S>(kind, g));
  w.ignore(w.moving[0].id, w.fixed[4].id);
  // FCL's own distance of a mesh and a shape depends on values that it has not set.
  for (std::size_t i = 2; i < 25; i += 3) w.ignore(w.moving[2].id, w.fixed[i].id);
  const double tolerance = std::is_same<S, double>::value ? 1e-5 : 1e-4;  // of FCL's pairs
  int near = 0, apart = 0;
  States<S> states;
  for (int k = 0; k < 60; ++k) {
    States<S> X;
    for (std::size_t i = 0; i < 3; ++i) X.push_back(randomPose<S>(g, k % 2 == 0 ? 3 : 6));
    states.insert(states.end(), X.begin(), X.end());
    Pair nearest;
    const S expected = w.clearance(X.data());
    ASSERT_NEAR(w.scene.clearance(X.data(), &nearest), expected, tolerance);
    (expected > 0 ? apart : near) += 1;
    w.pairs(X.data(), [&](const auto& a, const auto& X_WA, const auto& b, const auto& X_WB) {
      if (a.id != nearest.a || b.id != nearest.b) return;
      EXPECT_NEAR(std::max(test::distance<S>(*a.geometry, X_WA, *b.geometry, X_WB), S(0)), expected, tolerance);
    });
  }
  EXPECT_GT(near, 5);
  EXPECT_GT(apart, 5);
  for (const unsigned threads : {1u, 3u}) {
    World<S> shared(threads);
    for (const auto& o : w.fixed) shared.fix(o.geometry, o.X_WG);
    for (const auto& o : w.moving) shared.move(o.geometry);
    std::vector<S> all(60);
    std::vector<Pair> nearest(60);
    shared.scene.clearances(states.data(), 60, all.data(), nearest.data());
    for (std::size_t k = 0; k < 60; ++k) {
      Pair pair;
      EXPECT_EQ(shared.scene.clearance(&states[3 * k], &pair), all[k]);
      EXPECT_EQ(pair.a == nearest[k].a && pair.b == nearest[k].b, true);
    }
    for (const S at_most : {S(0), S(0.01), S(0.5), S(3), std::numeric_limits<S>::infinity()}) {
      std::vector<S> limited(60);
      shared.scene.clearances(states.data(), 60, limited.data(), nearest.data(), at_most);
      for (std::size_t k = 0; k < 60; ++k) {
        EXPECT_EQ(limited[k], std::min(all[k], at_most)) << at_most;
        EXPECT_EQ(nearest[k].a.isValid(), all[k] < at_most);
        EXPECT_EQ(shared.scene.clearance(&states[3 * k], nullptr, at_most), limited[k]);
      }
    }
    shared.scene.clearances(states.data(), 60, all.data());
    shared.scene.clearances(nullptr, 0, nullptr);
  }
}

template <typename S>
bool isOnSurface(const fcl::CollisionGeometry<S>& g, const fcl::Transform3<S>& X_WG, const fcl::Vector3<S>& point,
                 double tolerance) {
  const fcl::Sphere<S> ball(static_cast<S>(tolerance / 4));
  return static_cast<double>(test::distance<S>(
             g, X_WG, ball, test::pose<S>(Eigen::Matrix3d::Identity(), point.template cast<double>()))) < tolerance;
}

TYPED_TEST(SceneTest, PairsWithinADistance) {
  using S = TypeParam;
  World<S> w;
  std::mt19937_64 g(21);
  for (std::size_t i = 0; i < 30; ++i) w.fix(geometry<S>(i % 5 == 4 ? 7 : i % 10, g), randomPose<S>(g, 3));
  const Id nowhere = w.fix(test::cloud<S>(std::make_shared<octomap::OcTree>(0.1)), fcl::Transform3<S>::Identity());
  for (const std::size_t kind : {0, 2, 4, 9}) w.move(geometry<S>(kind, g));
  w.ignore(w.moving[0].id, w.fixed[4].id);
  // FCL's own distance of a mesh and a shape depends on values that it has not set.
  for (const auto& o : w.fixed) {
    if (o.id == nowhere || fcl_adapter::asModel<S>(o.geometry.get()) == nullptr) w.ignore(o.id, w.moving[3].id);
  }
  const double tolerance = std::is_same<S, double>::value ? 1e-5 : 1e-4;
  std::size_t listed = 0, left_out = 0;
  for (int k = 0; k < 40; ++k) {
    States<S> X;
    for (std::size_t i = 0; i < 4; ++i) X.push_back(randomPose<S>(g, 3));
    for (const S most : {S(0), w.scene.clearance(X.data()), S(0.3), S(2), std::numeric_limits<S>::max(),
                         std::numeric_limits<S>::infinity()}) {
      const std::vector<PairDistance<S>> found = w.scene.pairsWithin(X.data(), most);
      std::map<std::pair<Id, Id>, S> distance_of;
      for (std::size_t i = 0; i < found.size(); ++i) {
        EXPECT_LE(found[i].distance, most * (1 + S(1e-5)) + S(tolerance / 100));
        EXPECT_LE(found[i == 0 ? 0 : i - 1].distance, found[i].distance);
        const auto [a, b] = found[i].pair;
        EXPECT_TRUE(distance_of.emplace(std::pair(a, b), found[i].distance).second) << "twice";
      }
      if (most == w.scene.clearance(X.data())) {
        EXPECT_GE(found.size(), 1u);
      }
      std::size_t seen = 0;
      w.pairs(X.data(), [&](const auto& a, const auto& X_WA, const auto& b, const auto& X_WB) {
        if (b.id == nowhere) return;
        const S d = std::max(test::distance<S>(*a.geometry, X_WA, *b.geometry, X_WB), S(0));
        const auto at = distance_of.find({a.id, b.id});
        if (at == distance_of.end()) {
          EXPECT_GT(d, S(0)) << "touching pairs are never left out";
          EXPECT_GT(d, most - static_cast<S>(tolerance)) << most;
          ++left_out;
          return;
        }
        ++seen;
        EXPECT_NEAR(d, at->second, tolerance);
        if (d < S(tolerance) || most != S(2)) return;
        const auto& points = std::find_if(found.begin(), found.end(), [&](const auto& p) {
                               return p.pair.a == a.id && p.pair.b == b.id;
                             })->nearest_points;
        EXPECT_NEAR((points[0] - points[1]).norm(), d, tolerance);
        // Of conservative answers the points are those of spheres; FCL measures no mesh of its own and a shape well.
        const auto isMeasured = [](const fcl::CollisionGeometry<S>& geometry) {
          const Model<S>* model = fcl_adapter::asModel<S>(&geometry);
          return model != nullptr && model->options().answer == Answer::kExact;
        };
        if (isMeasured(*a.geometry)) {
          EXPECT_TRUE(isOnSurface<S>(*a.geometry, X_WA, points[0], 10 * tolerance));
        }
        if (isMeasured(*b.geometry)) {
          EXPECT_TRUE(isOnSurface<S>(*b.geometry, X_WB, points[1], 10 * tolerance));
        }
      });
      EXPECT_EQ(seen, found.size());
      listed += seen;
    }
  }
  EXPECT_GT(listed, 1000u);
  EXPECT_GT(left_out, 1000u);
}

// Bodies that pass each other and others: what the middle of a row says must hold for all of its states.
// Pairs are listed in rounds of growing reach: none may fall between two rounds, whatever was asked before.
TYPED_TEST(SceneTest, ClearanceOfAnyLength) {
  using S = TypeParam;
  const auto cube = std::make_shared<Model<S>>(test::box({-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5}).mesh());
  const auto at = [](double x) { return test::pose<S>(Eigen::Matrix3d::Identity(), {x, 0, 0}); };
  const double rounding = std::is_same<S, double>::value ? 1e-12 : 1e-5;
  const auto origin = at(0);
  for (int i = 1; i < 5000; ++i) {
    const double gap = 0.001 * i;
    Scene<S> scene;
    scene.addFixed(cube, at(1 + gap));
    scene.addMoving(cube);
    ASSERT_NEAR(scene.clearance(&origin), gap, rounding);
  }
  Scene<S> scene;
  std::mt19937_64 g(7);
  std::uniform_real_distribution<double> u(-6, 6);
  World<S> turned;
  for (int i = 0; i < 40; ++i) turned.fix(cube, randomPose<S>(g, 12));
  turned.move(cube);
  for (int i = 0; i < 400; ++i) {
    const auto X = randomPose<S>(g, 12);
    ASSERT_NEAR(turned.scene.clearance(&X), turned.clearance(&X), 10 * rounding);
  }
  const Id far = scene.addFixed(cube, at(1e6)), near = scene.addFixed(cube, at(2));
  scene.addMoving(cube);
  for (int i = 0; i < 300; ++i) {
    const double gap = std::abs(u(g)) * std::pow(10.0, u(g) - 2);
    scene.setPose(near, at(1 + gap));
    scene.setPose(far, at(i % 2 == 0 ? 1e6 : 1 + 2 * gap));
    ASSERT_NEAR(scene.clearance(&origin), gap, rounding * (1 + 1e3 * gap)) << gap;
  }
}

TYPED_TEST(SceneTest, RowsOfStatesOfBodiesThatPassEachOther) {
  using S = TypeParam;
  std::mt19937_64 g(31);
  std::uniform_real_distribution<double> u(-1, 1);
  const auto ring = std::make_shared<Model<S>>(test::torus(14).scale(0.15).mesh());
  const auto bar = std::make_shared<Model<S>>(test::box({-0.05, -0.05, -0.3}, {0.05, 0.05, 0.3}).mesh());
  const auto ball = std::make_shared<fcl::Sphere<S>>(S(0.1));
  Raw corners;  // whose hull is much less than its box
  corners.vertices = {{0.2, 0.2, 0.2}, {-0.2, -0.2, 0.2}, {-0.2, 0.2, -0.2}, {0.2, -0.2, -0.2}};
  for (const std::size_t k : {0, 1, 2, 3}) corners.triangles.emplace_back(k, (k + 1) % 4, (k + 2) % 4);
  const auto tetrahedron = std::make_shared<Model<S>>(corners.mesh());
  const auto anyOf = [&]() -> Geometry<S> {
    switch (g() % 6) {
      case 0:
        return ring;
      case 1:
        return bar;
      case 2:
        return ball;
      default:
        return tetrahedron;
    }
  };
  constexpr std::size_t kStates = 101, kMoving = 3;
  std::size_t touching = 0, rows_with_some = 0;
  for (int round = 0; round < 300; ++round) {
    World<S> w;
    for (std::size_t i = 0; i < kMoving; ++i) w.move(anyOf());
    const auto somewhere = [&] { return Eigen::Vector3d(u(g), u(g), u(g)); };
    for (int k = 0; k < 8 * (round % 4); ++k) {
      w.fix(anyOf(), test::pose<S>(test::randomRotation(g), 1.2 * somewhere()));
    }
    States<S> X(kStates * kMoving);
    for (std::size_t i = 0; i < kMoving; ++i) {
      // Some hardly move.
      const double share = g() % 2 == 0 ? 1 : 0.01;
      const Eigen::Vector3d from = somewhere(), way = share * (somewhere() - from), axis = test::randomDirection(g);
      const Eigen::Matrix3d R = test::randomRotation(g);
      for (std::size_t k = 0; k < kStates; ++k) {
        const double t = static_cast<double>(k) / (kStates - 1);
        const Eigen::Matrix3d turn = Eigen::AngleAxisd(share * t, axis).toRotationMatrix();
        X[k * kMoving + i] = test::pose<S>(turn * R, from + t * way);
      }
    }
    std::vector<std::uint8_t> expected, hits(kStates);
    for (std::size_t k = 0; k < kStates; ++k) expected.push_back(!w.hits(&X[k * kMoving]).empty());
    const auto first = std::find(expected.begin(), expected.end(), 1);
    touching += static_cast<std::size_t>(std::count(expected.begin(), expected.end(), 1));
    rows_with_some += first != expected.end();
    w.scene.collisions(X.data(), kStates, hits.data());
    EXPECT_EQ(hits, expected) << round;
    EXPECT_EQ(w.scene.firstCollision(X.data(), kStates), static_cast<std::size_t>(first - expected.begin())) << round;
    EXPECT_EQ(w.scene.anyCollision(X.data(), kStates), first != expected.end()) << round;
  }
  EXPECT_GT(rows_with_some, 100u);
  EXPECT_LT(touching, 300 * kStates / 2) << "most states are free";
}

// No sample between touches where an edge is free; where it is not, something comes very close.
/// On the way of CCDM_LINEAR.
template <typename S>
fcl::Transform3<S> between(const fcl::Transform3<S>& begin, const fcl::Transform3<S>& end, double t) {
  const Eigen::Matrix3d R0 = begin.linear().template cast<double>(), R1 = end.linear().template cast<double>();
  return test::pose<S>(
      Eigen::Quaterniond(R0).slerp(t, Eigen::Quaterniond(R1)).toRotationMatrix(),
      (1 - t) * begin.translation().template cast<double>() + t * end.translation().template cast<double>());
}

TYPED_TEST(SceneTest, EdgesNeverStepOverAContact) {
  using S = TypeParam;
  int free = 0, blocked = 0;
  for (const unsigned seed : {1u, 2u}) {
    World<S> w;
    std::mt19937_64 g(seed);
    for (std::size_t i = 0; i < 8; ++i) w.fix(geometry<S>(i % 2 == 0 ? 0 : 6 + i % 3, g), randomPose<S>(g, 2.5));
    w.move(geometry<S>(0, g));
    w.move(geometry<S>(8, g));
    for (int k = 0; k < 30; ++k) {
      States<S> begin, end;
      for (std::size_t i = 0; i < 2; ++i) begin.push_back(randomPose<S>(g, 3)), end.push_back(randomPose<S>(g, 3));
      const int samples = 200;
      bool touches = false;
      double nearest = 1;
      for (int s = 0; s <= samples; ++s) {
        States<S> X;
        const double t = static_cast<double>(s) / samples;
        for (std::size_t i = 0; i < 2; ++i) X.push_back(between(begin[i], end[i], t));
        if (w.scene.collides(X.data())) {
          touches = true;
          break;
        }
        nearest = std::min(nearest, static_cast<double>(w.scene.clearance(X.data())));
      }
      const bool is_free = w.scene.edgeIsFree(begin.data(), end.data());
      EXPECT_FALSE(is_free && touches) << k;
      // Between two samples, objects come no nearer than this.
      if (!is_free && !touches) {
        EXPECT_LT(nearest, 0.1);
      }
      (is_free ? free : blocked) += 1;
    }
  }
  EXPECT_GT(free, 5);
  EXPECT_GT(blocked, 5);
}

// Beside an FCL mesh, steps by the distance would be as short as the gap.
TYPED_TEST(SceneTest, EdgesAlongMeshesOfFcl) {
  using S = TypeParam;
  Raw disk;
  const int sides = 500;
  disk.vertices.emplace_back(0, 0, 0);
  for (int i = 0; i < sides; ++i) {
    disk.vertices.emplace_back(std::cos(2 * M_PI * i / sides), std::sin(2 * M_PI * i / sides), 0);
    disk.triangles.emplace_back(0, 1 + i, 1 + (i + 1) % sides);
  }
  const auto bvh = test::bvh<fcl::OBBRSS<S>>(disk);
  for (const double gap : {1e-2, 1e-4, -1e-4}) {
    Scene<S> scene;
    const Id fixed = scene.addFixed(bvh, fcl::Transform3<S>::Identity());
    const Id moving = scene.addMoving(bvh);
    const auto at = [&](double angle, double nearer = 0) {
      return test::pose<S>(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()).toRotationMatrix(),
                           {2 + gap - nearer, 0, 0});
    };
    const auto begin = at(0.003), end = at(3);
    EXPECT_EQ(scene.edgeIsFree(&begin, &end), gap > 0) << gap;
    if (gap < 0) continue;
    // Both become smaller and come nearer.
    const auto replace = [&](double scale) {
      bvh->beginReplaceModel();
      for (const auto& v : disk.vertices) bvh->replaceVertex((v * scale).template cast<S>());
      bvh->endReplaceModel();
      scene.update(scale < 1 ? fixed : moving);  // of the other, too
    };
    replace(0.98);
    const auto nearer_begin = at(0.003, 0.01), nearer_end = at(3, 0.01);
    EXPECT_TRUE(scene.edgeIsFree(&nearer_begin, &nearer_end)) << gap;
    replace(1);
    EXPECT_FALSE(scene.edgeIsFree(&nearer_begin, &nearer_end)) << gap;
  }
}

// Where libccd says that two shapes are farther apart than they are: boxes with parallel faces (6.083 for 6), and a box
// above a tetrahedron (1.9685 for 1.8200).
TYPED_TEST(SceneTest, EdgesOfShapesThatFclMeasuresTooFarApart) {
  using S = TypeParam;
  const auto I = fcl::Transform3<S>(fcl::Transform3<S>::Identity());
  const auto at = [](double z) { return test::pose<S>(Eigen::Matrix3d::Identity(), {0, 0, z}); };
  Scene<S> boxes;
  const auto cube = std::make_shared<fcl::Box<S>>(S(1), S(1), S(1));
  boxes.addFixed(cube, I);
  boxes.addMoving(cube);
  const auto far = at(7), touching = at(0.95), near = at(1.05);
  EXPECT_FALSE(boxes.edgeIsFree(&far, &touching));
  EXPECT_FALSE(boxes.edgeIsFree(&far, &touching, fcl::CCDM_TRANS));
  EXPECT_TRUE(boxes.edgeIsFree(&far, &near));

  using V = fcl::Vector3<S>;
  const auto corners =
      std::make_shared<const std::vector<V>>(std::vector<V>{V::Zero(), V::UnitX(), V::UnitY(), V::UnitZ()});
  const auto faces =
      std::make_shared<const std::vector<int>>(std::vector<int>{3, 0, 2, 1, 3, 0, 1, 3, 3, 1, 2, 3, 3, 2, 0, 3});
  Scene<S> scene;
  scene.addFixed(std::make_shared<fcl::Box<S>>(S(0.5), S(0.5), S(2)),
                 test::pose<S>(Eigen::Matrix3d::Identity(), {1, 1, 2}));
  scene.addMoving(std::make_shared<fcl::Convex<S>>(corners, 4, faces));
  Eigen::Matrix3d R;
  R << 0, -1, 0, -1, 0, 0, 0, 0, -1;
  const auto begin = test::pose<S>(R, {0.5, -1, 0.5}),
             end = test::pose<S>(R, {1.1601118569381956, 0.7683657226852851, 1.0201701376286056});
  EXPECT_TRUE(scene.collides(&end));
  for (const auto motion : {fcl::CCDM_TRANS, fcl::CCDM_LINEAR, fcl::CCDM_SCREW}) {
    EXPECT_FALSE(scene.edgeIsFree(&begin, &end, motion)) << motion;
  }
}

// A thin wall that samples would step over.
// Beside an octomap the distance of a shape is that of its cells: no edge steps over one, and what stays clear is free.
TYPED_TEST(SceneTest, EdgesOfShapesBesideOctrees) {
  using S = TypeParam;
  const auto cells = test::cloud<S>(test::cloudMap(11, 150));
  const auto empty = test::cloud<S>(std::make_shared<octomap::OcTree>(0.1));
  const std::vector<Geometry<S>> shapes = {
      std::make_shared<fcl::Box<S>>(S(0.3), S(0.2), S(0.4)),       std::make_shared<fcl::Sphere<S>>(S(0.15)),
      std::make_shared<fcl::Ellipsoid<S>>(S(0.1), S(0.2), S(0.3)), std::make_shared<fcl::Capsule<S>>(S(0.1), S(0.4)),
      std::make_shared<fcl::Cylinder<S>>(S(0.15), S(0.3)),         std::make_shared<fcl::Cone<S>>(S(0.2), S(0.4))};
  const auto box_of_triangles = std::make_shared<Model<S>>(test::box({-0.15, -0.1, -0.2}, {0.15, 0.1, 0.2}).mesh());
  std::mt19937_64 g(31);
  const auto X_WO = test::pose<S>(test::randomRotation(g), {20, -10, 5});
  int free = 0, blocked = 0, clear = 0;
  for (std::size_t k = 0; k < shapes.size(); ++k) {
    Scene<S> scene, other_way, of_triangles, without;
    scene.addFixed(cells, X_WO);
    scene.addMoving(shapes[k]);
    other_way.addFixed(shapes[k], fcl::Transform3<S>::Identity());
    other_way.addMoving(cells);
    of_triangles.addFixed(cells, X_WO);
    of_triangles.addMoving(box_of_triangles);
    without.addFixed(empty, X_WO);
    without.addMoving(shapes[k]);
    for (int i = 0; i < 80; ++i) {
      const fcl::Transform3<S> begin = X_WO * randomPose<S>(g, 1), end = begin * randomPose<S>(g, 0.3);
      EXPECT_TRUE(without.edgeIsFree(&begin, &end));
      const bool is_free = scene.edgeIsFree(&begin, &end);
      ++(is_free ? free : blocked);
      S least = std::numeric_limits<S>::max();
      for (int t = 0; t <= 100; ++t) {
        const auto X = between(begin, end, t / 100.0);
        if (is_free) {
          ASSERT_FALSE(scene.collides(&X)) << k << ", time " << t;
        }
        if (k == 0) least = std::min(least, scene.collides(&X) ? S(0) : of_triangles.clearance(&X));
      }
      if (k == 0 && least > S(0.02)) {
        EXPECT_TRUE(is_free) << least;
        ++clear;
      }
      S gap = std::numeric_limits<S>::max();
      for (const std::array<S, 6>& cell : cells->toBoxes()) {
        const fcl::Box<S> cube(cell[3], cell[3], cell[3]);
        const fcl::Transform3<S> X_WC = X_WO * fcl::Transform3<S>(fcl::Translation3<S>(cell[0], cell[1], cell[2]));
        gap = std::min(gap, static_cast<S>(*fcl_adapter::distanceOfShapes<S>(*shapes[k], begin, cube, X_WC)));
      }
      const double tolerance = std::is_same<S, double>::value ? 1e-9 : 1e-5;
      EXPECT_NEAR(*fcl_adapter::distanceOfShapes<S>(*shapes[k], begin, *cells, X_WO), gap, tolerance);
      EXPECT_NEAR(*fcl_adapter::distanceOfShapes<S>(*cells, X_WO, *shapes[k], begin), gap, tolerance);
      // The octree moves past the shape in the same way.
      const fcl::Transform3<S> from = begin.inverse(Eigen::Isometry) * X_WO;
      EXPECT_EQ(other_way.edgeIsFree(&from, &from), !other_way.collides(&from));
    }
  }
  EXPECT_GT(free, 100);
  EXPECT_GT(blocked, 100);
  EXPECT_GT(clear, 10);
}

TYPED_TEST(SceneTest, EdgesThroughAThinWall) {
  using S = TypeParam;
  for (const bool is_model : {true, false}) {
    World<S> w;
    const Raw wall = test::box({-1, -1, -1e-4}, {1, 1, 1e-4});
    if (is_model) {
      w.fix(std::make_shared<Model<S>>(wall.mesh()), fcl::Transform3<S>::Identity());
    } else {
      w.fix(std::make_shared<fcl::Box<S>>(S(2), S(2), S(2e-4)), fcl::Transform3<S>::Identity());
    }
    w.move(std::make_shared<fcl::Sphere<S>>(S(0.001)));
    const auto at = [](double x, double z) { return test::pose<S>(Eigen::Matrix3d::Identity(), {x, 0, z}); };
    const auto above = at(0.3, 3), below = at(0.3, -4), beside = at(1.2, 3), under = at(1.2, -4);
    EXPECT_FALSE(w.scene.edgeIsFree(&above, &below));
    EXPECT_TRUE(w.scene.edgeIsFree(&beside, &under));
    EXPECT_TRUE(w.scene.edgeIsFree(&above, &above));
    EXPECT_FALSE(w.scene.edgeIsFree(&above, &below, fcl::CCDM_TRANS));
  }
}

// The spheres of conservative answers reach out of the tree's boxes, by up to two radii of a cell.
TYPED_TEST(SceneTest, ConservativeSpheresReachOutOfTheBoxes) {
  using S = TypeParam;
  Raw slanted, plate = test::box({-1, -1, 0}, {1, 1, 0});
  slanted.addTriangle({1, 0, 0}, {0, 1, 0}, {0, 0, 1});
  int hits = 0;
  for (const Raw& raw : {slanted, plate}) {
    for (const Subdivision subdivision : {Subdivision::kBono, Subdivision::kOctree}) {
      for (const int depth : {2, 3}) {
        Options options;
        options.answer = Answer::kConservative;
        options.subdivision = subdivision;
        options.depth = depth;
        World<S> w;
        w.fix(std::make_shared<Model<S>>(raw.mesh(), options), fcl::Transform3<S>::Identity());
        w.move(std::make_shared<fcl::Sphere<S>>(S(0.01)));
        std::mt19937_64 g(3);
        std::uniform_real_distribution<double> u(-0.4, 0.4);
        for (int i = 0; i < 300; ++i) {
          const Eigen::Vector3d off = 1.5 * std::abs(u(g)) * Eigen::Vector3d(1, 1, 1).normalized();
          const auto X =
              test::pose<S>(Eigen::Matrix3d::Identity(), off + Eigen::Vector3d(0.375 + u(g) / 4, 0.375, 0.25));
          const bool touches = !w.hits(&X).empty();
          ASSERT_EQ(w.scene.collides(&X), touches) << i;
          hits += touches;
        }
      }
    }
  }
  EXPECT_GT(hits, 500);
}

// Where the first state is too far for any pose of FCL's, the others are answered as they are alone.
TYPED_TEST(SceneTest, AStateBeyondAllNumbersHidesNone) {
  using S = TypeParam;
  World<S> w;
  w.fix(std::make_shared<Model<S>>(test::box({-1, -1, -1}, {1, 1, 1}).mesh()), fcl::Transform3<S>::Identity());
  w.move(std::make_shared<Model<S>>(test::torus(8).mesh()));
  const double far = std::is_same<S, float>::value ? 1e30 : 1e160;
  for (const std::size_t beyond : {0u, 2u, 4u}) {
    States<S> X(5, fcl::Transform3<S>::Identity());
    X[beyond].translation().x() = static_cast<S>(far);
    std::vector<std::uint8_t> hit(5, 7), expected(5, 1);
    expected[beyond] = 0;
    w.scene.collisions(X.data(), 5, hit.data());
    EXPECT_EQ(hit, expected);
    EXPECT_EQ(w.scene.firstCollision(X.data(), 5), beyond == 0 ? 1u : 0u);
    EXPECT_TRUE(w.scene.anyCollision(X.data(), 5));
    EXPECT_FALSE(w.scene.collides(&X[beyond]));
  }
}

// Rotations within the stated bound, but far from exact: boxes, reach and motions allow for them.
TYPED_TEST(SceneTest, RotationsThatAreNotQuiteOrthogonal) {
  using S = TypeParam;
  const Raw a = test::box({-1, 0, -0.01}, {1, 0, 0.01}), b = test::box({-1, -0.01, 0}, {1, 0.01, 0});
  for (const double stretch : {1.000499, 0.999501, 1.00001}) {
    const Eigen::Matrix3d R =
        stretch * Eigen::AngleAxisd(14.71 * std::acos(-1.0) / 180, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    World<S> w;
    w.fix(std::make_shared<Model<S>>(b.mesh()), test::pose<S>(R, Eigen::Vector3d::Zero()));
    w.move(std::make_shared<Model<S>>(a.mesh()));
    const auto at = [&](double x, double z) { return test::pose<S>(stretch * Eigen::Matrix3d::Identity(), {x, 0, z}); };
    const States<S> X = {at(0, 0), at(0, 3.9)};
    EXPECT_FALSE(w.hits(X.data()).empty());
    EXPECT_TRUE(w.scene.collides(X.data()));
    EXPECT_TRUE(w.scene.anyCollision(X.data(), 2));
    const auto above = at(0, 200), below = at(0, -1);
    EXPECT_FALSE(w.scene.edgeIsFree(&above, X.data()));
    EXPECT_FALSE(w.scene.edgeIsFree(&above, &below));
    // All that touches by FCL's poses is seen.
    std::size_t hits = 0;
    States<S> row;
    for (int i = -120; i <= 120; ++i) row.push_back(at(2.0 / 120 * i, 0.011 * (i % 3)));
    checkVerdicts(w, row, row.size(), hits);
    EXPECT_GT(hits, 10u);
  }
}

// A way so long that the rest of the row is below its rounding says nothing about the rest.
TYPED_TEST(SceneTest, AFarStateBesideATouchHidesNone) {
  using S = TypeParam;
  World<S> w;
  w.fix(std::make_shared<Model<S>>(test::box({-1, -1, -1}, {1, 1, 1}).mesh()), fcl::Transform3<S>::Identity());
  w.move(std::make_shared<Model<S>>(test::box({-1, -1, -1}, {1, 1, 1}).mesh()));
  const auto at = [](double x) { return test::pose<S>(Eigen::Matrix3d::Identity(), {x, 0, 0}); };
  std::mt19937_64 g(7);
  std::uniform_real_distribution<double> exponent(0, 20);
  std::size_t hits = 0;
  for (int i = 0; i < 400; ++i) {
    const double far = std::pow(10.0, exponent(g)), d = std::pow(10.0, -exponent(g) / 6);
    States<S> X = {at(9), at(9), at(far), at(2 - d / 2), at(2 + d / 2)};
    if (i % 2 != 0) std::shuffle(X.begin(), X.end(), g);
    checkVerdicts(w, X, X.size(), hits);
  }
  EXPECT_GT(hits, 300u);
}

// FCL's relative poses take the transpose for the inverse, so off its frame's origin a geometry moves by the error of
// the rotation times their distance.
TYPED_TEST(SceneTest, RotationsThatAreOffFarFromTheOrigin) {
  using S = TypeParam;
  const Eigen::Vector3d c(1000, 0, 0);
  const Raw far = test::box(c - Eigen::Vector3d::Ones(), c + Eigen::Vector3d::Ones()),
            near = test::box({-1, -1, -1}, {1, 1, 1});
  Options conservative;
  conservative.answer = Answer::kConservative;
  conservative.depth = 9;
  std::size_t hits = 0;
  for (const Options& options : {Options(), conservative}) {
    World<S> w;
    w.fix(std::make_shared<Model<S>>(near.mesh()), fcl::Transform3<S>::Identity());
    w.move(std::make_shared<Model<S>>(far.mesh(), options));
    std::mt19937_64 g(8);
    std::uniform_real_distribution<double> u(-12, 12);
    for (int i = 0; i < 100; ++i) {
      States<S> X;
      for (int k = 0; k < 5; ++k) {
        const double stretch = 1 + (k == i % 5 || i % 3 == 0 ? 4.9e-4 : 0);
        X.push_back(test::pose<S>(stretch * Eigen::Matrix3d::Identity(),
                                  -stretch * c + Eigen::Vector3d(u(g), u(g) / 8, u(g) / 8)));
      }
      checkVerdicts(w, X, X.size(), hits);
    }
  }
  EXPECT_GT(hits, 150u);
}

// Sizes at which floats have few digits left.
TEST(SceneDouble, TinySizes) {
  for (const double s : {2e-45, 1.2e-44, 3e-43, 1e-38, 1e-30}) {
    const Eigen::Vector3d half = Eigen::Vector3d::Constant(s);
    const auto cube = std::make_shared<Modeld>(test::box(-half, half).mesh());
    World<double> w;
    w.fix(cube, fcl::Transform3d::Identity());
    w.move(cube);
    std::size_t hits = 0;
    States<double> X;
    for (int k = 0; k < 100; ++k)
      X.push_back(test::pose<double>(Eigen::Matrix3d::Identity(), {s * 0.04 * k + s * 1e-3, 0, 0}));
    checkVerdicts(w, X, X.size(), hits);
    EXPECT_EQ(hits, 50u) << s;
    EXPECT_NEAR(w.scene.clearance(&X[75]) / s, 1.001, 1e-9) << s;
  }
}

// After it, no query builds anything.
TYPED_TEST(SceneTest, BuildsItsTreesBeforeQueries) {
  using S = TypeParam;
  const test::Raw torus = test::torus(30);
  const States<S> X = walk<S>(500, 2, 1.5, 0.05, 4);
  std::vector<std::uint8_t> expected(500), hit(500);
  for (const unsigned threads : {1u, 3u}) {
    Options on_host, conservative;
    on_host.oracle = conservative.oracle = OracleKind::kCpu;
    conservative.answer = Answer::kConservative;
    std::vector<std::shared_ptr<Model<S>>> models;
    for (std::size_t i = 0; i < 4; ++i) models.push_back(std::make_shared<Model<S>>(torus.mesh(), on_host));
    const auto cells = std::make_shared<Model<S>>(torus.mesh(), conservative);
    const auto emptied = std::make_shared<Model<S>>(torus.mesh(), on_host);
    Scene<S> scene(SceneOptions{threads});
    scene.addMoving(models[0]);
    scene.addMoving(models[1]);
    for (std::size_t i = 2; i < 4; ++i) {
      for (const double x : {-1.0, 1.0}) {  // two objects have one geometry
        scene.addFixed(models[i], test::pose<S>(Eigen::Matrix3d::Identity(), {x, 0, static_cast<double>(i)}));
      }
    }
    scene.addFixed(cells, test::pose<S>(Eigen::Matrix3d::Identity(), {100, 0, 0}));
    scene.addFixed(emptied, test::pose<S>(Eigen::Matrix3d::Identity(), {0, 100, 0}));
    scene.addFixed(test::bvh<fcl::OBBRSS<S>>(torus), test::pose<S>(Eigen::Matrix3d::Identity(), {0, -100, 0}));
    scene.addFixed(std::make_shared<fcl::Sphere<S>>(S(0.5)), test::pose<S>(Eigen::Matrix3d::Identity(), {0, 0, 0}));
    emptied->beginModel();
    emptied->endModel();
    if (threads == 1) scene.collisions(X.data(), 500, expected.data());
    scene.buildTrees();
    EXPECT_EQ(cells->statistics().resident_nodes, 1u);
    std::uint64_t built[4];
    for (std::size_t i = 0; i < 4; ++i) {
      built[i] = models[i]->statistics().built_triangles;
      EXPECT_GE(built[i], torus.triangles.size());
    }
    scene.collisions(X.data(), 500, hit.data());
    EXPECT_EQ(hit, expected);
    scene.buildTrees();
    for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(models[i]->statistics().built_triangles, built[i]);
  }
  EXPECT_GT(std::count(expected.begin(), expected.end(), 1), 20);
  EXPECT_LT(std::count(expected.begin(), expected.end(), 1), 480);
}

TYPED_TEST(SceneTest, AModelThatWasEmptied) {
  using S = TypeParam;
  const auto mesh = test::box({-1, -1, -1}, {1, 1, 1}).mesh();
  for (const Answer answer : {Answer::kExact, Answer::kConservative}) {
    for (const bool asked_before : {false, true}) {
      for (const bool moves : {false, true}) {
        Options options;
        options.answer = answer;
        const auto model = std::make_shared<Model<S>>(mesh, options);
        Scene<S> scene;
        const auto partner = std::make_shared<Model<S>>(mesh, options);
        if (moves) {
          scene.addMoving(model);
          scene.addFixed(partner, fcl::Transform3<S>::Identity());
        } else {
          scene.addFixed(model, fcl::Transform3<S>::Identity());
          scene.addMoving(partner);
        }
        scene.addMoving(std::make_shared<fcl::Sphere<S>>(S(1)));
        const fcl::Transform3<S> here = fcl::Transform3<S>::Identity(),
                                 there = test::pose<S>(Eigen::Matrix3d::Identity(), {0, 0, 100});
        // The model with the other one, then with the sphere; what else moves is far away.
        States<S> X{test::pose<S>(Eigen::Matrix3d::Identity(), {0.5, 0, 0}), there};
        if (!moves) X.insert(X.end(), {there, here});
        const std::size_t states = X.size() / 2;
        std::vector<std::uint8_t> hit(states, 1);
        if (asked_before) {
          scene.collisions(X.data(), states, hit.data());
          EXPECT_EQ(hit, std::vector<std::uint8_t>(states, 1));
        }
        model->beginModel();
        model->endModel();
        scene.collisions(X.data(), states, hit.data());
        EXPECT_EQ(hit, std::vector<std::uint8_t>(states, 0));
        EXPECT_EQ(scene.firstCollision(X.data(), states), states);
        EXPECT_FALSE(scene.anyCollision(X.data(), states));
        for (std::size_t k = 0; k < states; ++k) {
          EXPECT_FALSE(scene.collides(&X[2 * k]));
          EXPECT_TRUE(scene.edgeIsFree(&X[2 * k], &X[2 * k]));
          EXPECT_GT(scene.clearance(&X[2 * k]), S(90));
          EXPECT_TRUE(scene.collidingPairs(&X[2 * k]).empty());
          EXPECT_TRUE(scene.pairsWithin(&X[2 * k], S(50)).empty());
          EXPECT_EQ(scene.pairsWithin(&X[2 * k], std::numeric_limits<S>::infinity()).size(), 1u);
        }
      }
    }
  }
}

// Changes of others while a model gets a mesh are complete.
TYPED_TEST(SceneTest, ChangesWhileAModelGetsAMesh) {
  using S = TypeParam;
  const test::Raw box = test::box({-1, -1, -1}, {1, 1, 1});
  const auto at = [](double x) { return test::pose<S>(Eigen::Matrix3d::Identity(), {x, 0, 0}); };
  const auto refill = [&](Model<S>& model) {
    std::vector<fcl::Vector3<S>> vertices;
    for (const Eigen::Vector3d& v : box.vertices) vertices.push_back(v.cast<S>());
    model.addSubModel(vertices, box.triangles);
    model.endModel();
  };
  const auto a = std::make_shared<Model<S>>(box.mesh()), b = std::make_shared<Model<S>>(box.mesh());
  Scene<S> scene;
  const Id fixed = scene.addFixed(a, at(0));
  scene.addMoving(b);
  States<S> X{at(0.5), at(9.5)};
  EXPECT_TRUE(scene.collides(&X[0]));
  a->beginModel();
  EXPECT_THROW(scene.collides(&X[0]), std::logic_error);
  scene.setPose(fixed, at(9));
  refill(*a);
  EXPECT_FALSE(scene.collides(&X[0]));
  EXPECT_TRUE(scene.collides(&X[1]));

  a->beginModel();
  const auto sphere = std::make_shared<fcl::Sphere<S>>(S(1));
  const Id moving = scene.addMoving(sphere);
  scene.addFixed(sphere, at(50));
  X = {at(-50), at(50)};
  EXPECT_TRUE(scene.collides(X.data()));
  refill(*a);
  EXPECT_TRUE(scene.collides(X.data()));
  a->beginModel();
  scene.remove(moving);
  EXPECT_FALSE(scene.collides(X.data()));
  refill(*a);
  EXPECT_FALSE(scene.collides(X.data()));
}

// Steps of conservative advancement end where they are below the rounding of time.
TEST(SceneDouble, LongEdgesBetweenShapes) {
  Scened scene;
  scene.addFixed(std::make_shared<fcl::Sphered>(1), fcl::Transform3d(fcl::Transform3d::Identity()));
  scene.addMoving(std::make_shared<fcl::Sphered>(1));
  const auto isFree = [&](double far, double off) {
    const auto X = test::pose<double>(Eigen::Matrix3d::Identity(), {-far, off, 0}),
               Y = test::pose<double>(Eigen::Matrix3d::Identity(), {1.3 * far, off, 0});
    return scene.edgeIsFree(&X, &Y);
  };
  for (const double far : {10.0, 1e6, 1e13, 1e17}) EXPECT_FALSE(isFree(far, 1.5)) << far;
  for (const double far : {10.0, 1e6}) EXPECT_TRUE(isFree(far, 2.01)) << far;
  for (const double far : {1e13, 1e15, 1e18}) isFree(far, 2.0001);  // ends
  // A last state that touches is seen however far it is from the first one.
  std::mt19937_64 g(9);
  std::uniform_real_distribution<double> u(0, 1);
  for (const double far : {1e3, 1e12, 1e13, 1e15, 1e17}) {
    for (int i = 0; i < 100; ++i) {
      const Eigen::Vector3d end = (2 - std::pow(10.0, -5 + 5 * u(g))) * test::randomDirection(g);
      const auto X = test::pose<double>(Eigen::Matrix3d::Identity(), end + far * test::randomDirection(g)),
                 Y = test::pose<double>(Eigen::Matrix3d::Identity(), end);
      ASSERT_TRUE(scene.collides(&Y));
      ASSERT_FALSE(scene.edgeIsFree(&X, &Y, fcl::CCDM_TRANS)) << far << ' ' << i;
    }
  }
}

template <typename F>
std::string complaintOf(F&& f) {
  try {
    f();
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "nothing thrown";
}

// Each pose of a row is looked at, also behind one whose rotation is off by what is allowed.
TYPED_TEST(SceneTest, APoseThatIsNoneBehindOneThatIsSlightlyOff) {
  using S = TypeParam;
  std::mt19937_64 g(1);
  Scene<S> scene;
  scene.addFixed(geometry<S>(0, g), fcl::Transform3<S>::Identity());
  for (int i = 0; i < 3; ++i) scene.addMoving(geometry<S>(0, g));
  const std::size_t states = 5;
  States<S> X(3 * states, test::pose<S>(Eigen::Matrix3d::Identity(), {50, 0, 0}));
  X[1].linear() *= S(1.0003);
  std::vector<std::uint8_t> hit(states);
  EXPECT_NO_THROW(scene.collisions(X.data(), states, hit.data()));
  for (const std::size_t bad : {3u, 4u, 8u, 14u}) {
    States<S> Y = X;
    Y[bad].translation().y() = std::numeric_limits<S>::quiet_NaN();
    EXPECT_THROW(scene.collisions(Y.data(), states, hit.data()), std::invalid_argument) << bad;
    EXPECT_THROW(scene.anyCollision(Y.data(), states), std::invalid_argument) << bad;
  }
}

// Rows of states are checked one by one, by any thread: the first bad pose of all is named.
TYPED_TEST(SceneTest, TheFirstPoseThatIsNotRigidIsNamedAmongManyStates) {
  using S = TypeParam;
  std::mt19937_64 g(1);
  for (const unsigned threads : {1u, 3u}) {
    SceneOptions options;
    options.threads = threads;
    Scene<S> scene(options);
    scene.addFixed(geometry<S>(0, g), fcl::Transform3<S>::Identity());
    for (int i = 0; i < 2; ++i) scene.addMoving(geometry<S>(0, g));
    const std::size_t states = 1000;
    const States<S> X(2 * states, test::pose<S>(Eigen::Matrix3d::Identity(), {50, 0, 0}));
    std::vector<std::uint8_t> hit(states);
    for (const std::size_t first : {0u, 127u, 128u, 700u, 999u}) {
      States<S> Y = X;
      Y[2 * first + 1].linear() *= S(1.01);
      for (std::size_t k = first + 1; k < states; k += 100) Y[2 * k].linear().setZero();
      const std::string said = complaintOf([&] { scene.collisions(Y.data(), states, hit.data()); }),
                        name = "object 1 in state " + std::to_string(first) + " ";
      EXPECT_NE((said + " ").find(name), std::string::npos) << said;
    }
    EXPECT_THROW(scene.collisions(nullptr, states, hit.data()), std::invalid_argument);
  }
}

TYPED_TEST(SceneTest, MisuseThrows) {
  using S = TypeParam;
  std::mt19937_64 g(1);
  Scene<S> scene, other;
  const auto good = fcl::Transform3<S>::Identity();
  const Id fixed = scene.addFixed(geometry<S>(0, g), good), moving = scene.addMoving(geometry<S>(0, g));
  const Id gone = scene.addMoving(geometry<S>(0, g)), foreign = other.addFixed(geometry<S>(0, g), good);
  scene.remove(gone);
  EXPECT_NE(scene.addMoving(geometry<S>(0, g)), gone);
  for (const Id bad : {Id(), gone, foreign}) {
    EXPECT_THROW(scene.remove(bad), std::invalid_argument);
    EXPECT_THROW(scene.setPose(bad, good), std::invalid_argument);
    EXPECT_THROW(scene.ignore(fixed, bad), std::invalid_argument);
    EXPECT_THROW(scene.ignore(bad, fixed), std::invalid_argument);
    EXPECT_THROW(scene.update(bad), std::invalid_argument);
    EXPECT_THROW(scene.movingIndex(bad), std::invalid_argument);
  }
  EXPECT_THROW(scene.setPose(moving, good), std::invalid_argument);
  EXPECT_THROW(scene.movingIndex(fixed), std::invalid_argument);
  EXPECT_THROW(scene.ignore(fixed, fixed), std::invalid_argument);
  EXPECT_THROW(scene.addFixed(nullptr, good), std::invalid_argument);
  EXPECT_THROW(scene.addMoving(nullptr), std::invalid_argument);
  const auto unfinished = std::make_shared<fcl::BVHModel<fcl::OBBRSS<S>>>();
  unfinished->beginModel();
  unfinished->addTriangle(fcl::Vector3<S>(0, 0, 0), fcl::Vector3<S>(1, 0, 0), fcl::Vector3<S>(0, 1, 0));
  EXPECT_THROW(scene.addMoving(unfinished), std::invalid_argument);
  EXPECT_THROW(scene.collides(nullptr), std::invalid_argument);
  EXPECT_THROW(scene.collisions(nullptr, 1, nullptr), std::invalid_argument);
  EXPECT_THROW(scene.clearances(&good, 1, nullptr), std::invalid_argument);
  for (const S distance : {S(-1), std::numeric_limits<S>::quiet_NaN()}) {
    EXPECT_THROW(scene.pairsWithin(&good, distance), std::invalid_argument);
    EXPECT_THROW(scene.clearance(&good, nullptr, distance), std::invalid_argument);
  }

  const S nan = std::numeric_limits<S>::quiet_NaN(), inf = std::numeric_limits<S>::infinity();
  std::vector<fcl::Transform3<S>> bad(6, good);
  bad[0].translation()[1] = nan;
  bad[1].translation()[2] = -inf;
  bad[2].linear()(1, 2) = nan;
  bad[3].linear() *= S(1.01);
  bad[4].linear().col(0) *= S(-1);
  bad[5].linear().setZero();
  for (const fcl::Transform3<S>& X : bad) {
    EXPECT_THROW(scene.addFixed(geometry<S>(0, g), X), std::invalid_argument);
    EXPECT_THROW(scene.setPose(fixed, X), std::invalid_argument);
    for (std::size_t at = 0; at < 6; ++at) {
      States<S> states(6, test::pose<S>(Eigen::Matrix3d::Identity(), {9, 9, 9}));
      states[at] = X;
      std::uint8_t hit[3];
      S distances[3];
      const std::string name = "object " + std::to_string(at % 2) + " in state " + std::to_string(at / 2);
      for (const std::string& said : {complaintOf([&] { scene.firstCollision(states.data(), 3); }),
                                      complaintOf([&] { scene.anyCollision(states.data(), 3); }),
                                      complaintOf([&] { scene.collisions(states.data(), 3, hit); }),
                                      complaintOf([&] { scene.clearances(states.data(), 3, distances); })}) {
        EXPECT_NE(said.find(name), std::string::npos) << said;
      }
      if (at >= 2) continue;
      EXPECT_THROW(scene.collides(states.data()), std::invalid_argument);
      EXPECT_THROW(scene.clearance(states.data()), std::invalid_argument);
      EXPECT_THROW(scene.collidingPairs(states.data()), std::invalid_argument);
      EXPECT_THROW(scene.pairsWithin(states.data(), S(1)), std::invalid_argument);
      EXPECT_THROW(scene.edgeIsFree(states.data(), states.data() + 2), std::invalid_argument);
      EXPECT_THROW(scene.edgeIsFree(states.data() + 2, states.data()), std::invalid_argument);
    }
  }
  EXPECT_EQ(scene.fixedCount(), 1u);
}

// The box of a mesh is found once; another mesh at the same address has its own.
TYPED_TEST(SceneTest, MeshesAtTheAddressOfOneThatIsGone) {
  using S = TypeParam;
  std::set<const Mesh*> addresses;
  for (int i = 1; i <= 400; ++i) {
    const double half = 0.01 * i;
    const auto raw = test::box({-half, -half, -half}, {half, half, half}).mesh();
    // Not of make_shared(), whose memory is there for as long as anybody asks whether the mesh is.
    const auto mesh = Mesh::fromIndices(raw->vertices(), raw->triangles());
    addresses.insert(mesh.get());
    const auto model = std::make_shared<Model<S>>(mesh);
    for (int again = 0; again < 2; ++again) {
      Scene<S> scene;
      scene.addFixed(model, test::pose<S>(Eigen::Matrix3d::Identity(), {10, 0, 0}));
      scene.addMoving(model);
      const auto X = test::pose<S>(Eigen::Matrix3d::Identity(), {10 - 2 * half - 0.001, 0, 0}),
                 Y = test::pose<S>(Eigen::Matrix3d::Identity(), {10 - 2 * half + 0.001, 0, 0});
      ASSERT_FALSE(scene.collides(&X)) << i;
      ASSERT_TRUE(scene.collides(&Y)) << i;
    }
  }
  // The allocators of sanitizers give no address twice.
  if (!test::kSanitized) {
    EXPECT_LT(addresses.size(), 400u);
  }
}

// A box about an octree holds all occupied cells, and no face of it is farther out than by 1/32 of its length.
TYPED_TEST(SceneTest, BoundsOfOcTreesAreNearlyTight) {
  using S = TypeParam;
  std::mt19937_64 g(3);
  std::uniform_real_distribution<double> u(-1, 1);
  std::vector<std::shared_ptr<octomap::OcTree>> maps;
  for (const double resolution : {0.3, 0.05, 0.013}) {
    const auto add = [&](const std::vector<Eigen::Vector3d>& occupied, const std::vector<Eigen::Vector3d>& free) {
      maps.push_back(std::make_shared<octomap::OcTree>(resolution));
      const auto at = [](const Eigen::Vector3d& p) {
        return octomap::point3d(float(p.x()), float(p.y()), float(p.z()));
      };
      for (const Eigen::Vector3d& p : free) maps.back()->updateNode(at(p), false);
      for (const Eigen::Vector3d& p : occupied) maps.back()->updateNode(at(p), true);
    };
    std::vector<Eigen::Vector3d> one{{0.7, -8, 3}}, line, floor, ball, far, free;
    for (int i = 0; i < 4000; ++i) {
      line.emplace_back(4 * u(g), 0.01, 7);
      floor.emplace_back(3 * u(g), 2 * u(g), 0.001);
      ball.push_back(test::randomDirection(g) + Eigen::Vector3d(5, 1, 1));
      free.push_back(9 * test::randomDirection(g));
    }
    far = ball;
    far.emplace_back(-40, 3, -20);
    for (const auto& occupied : {one, line, floor, ball, far}) {
      add(occupied, {});
      add(occupied, free);
    }
  }
  for (std::size_t m = 0; m < maps.size(); ++m) {
    const fcl::OcTree<S> octree(maps[m]);
    Eigen::AlignedBox3d tight;
    for (const auto& c : octree.toBoxes()) {
      const Eigen::Vector3d center(c[0], c[1], c[2]), half = Eigen::Vector3d::Constant(c[3] / 2);
      tight.extend(center - half).extend(center + half);
    }
    ASSERT_FALSE(tight.isEmpty());
    const scene::Bounds b = scene::boundsOf<S>(octree);
    ASSERT_EQ(b.kind, scene::Bounds::kBox);
    const Eigen::AlignedBox3d box(b.center - b.half, b.center + b.half);
    const double rounding = 1e-4 * (tight.sizes().norm() + tight.center().norm());
    EXPECT_TRUE(
        Eigen::AlignedBox3d(box.min().array() - 1e-2 * rounding, box.max().array() + 1e-2 * rounding).contains(tight))
        << m;
    EXPECT_LT((tight.min() - box.min()).maxCoeff(), tight.sizes().maxCoeff() / 31 + rounding) << m;
    EXPECT_LT((box.max() - tight.max()).maxCoeff(), tight.sizes().maxCoeff() / 31 + rounding) << m;
  }
  const auto free = std::make_shared<octomap::OcTree>(0.1);
  free->updateNode(octomap::point3d(1, 2, 3), false);
  EXPECT_EQ(scene::boundsOf<S>(fcl::OcTree<S>(free)).kind, scene::Bounds::kNowhere);
}

// FCL has no distance of them: its general algorithm would follow a support function that is null.
TYPED_TEST(SceneTest, FclHasNoDistanceOfUnboundedShapes) {
  using S = TypeParam;
  const auto at = fcl::Transform3<S>::Identity();
  const fcl::Halfspace<S> half(fcl::Vector3<S>::UnitZ(), S(-5));
  const fcl::Plane<S> plane(fcl::Vector3<S>::UnitZ(), S(-5));
  const fcl::Sphere<S> ball(S(1));
  const auto said = [&](const fcl::CollisionGeometry<S>& a, const fcl::CollisionGeometry<S>& b) {
    return complaintOf([&] {
      fcl::DistanceResult<S> result;
      bocst::distance<S>(&a, at, &b, at, fcl::DistanceRequest<S>(), result);
    });
  };
  EXPECT_NE(said(ball, half).find("Halfspace"), std::string::npos);
  EXPECT_NE(said(ball, plane).find("Plane"), std::string::npos);
  EXPECT_NE(said(half, ball).find("bocst::Model"), std::string::npos);
}

// Beside a floor, clearance and edges of every bounded shape follow from its lowest point, and those beside a plane
// from the lowest and the highest one.
TYPED_TEST(SceneTest, ShapesBesidePlanes) {
  using S = TypeParam;
  using V = fcl::Vector3<S>;
  // How far a shape extends from its origin along a unit direction of its frame.
  using Extent = std::function<double(const Eigen::Vector3d&)>;
  const auto disc = [](const Eigen::Vector3d& n) { return 0.5 * std::hypot(n.x(), n.y()); };
  const std::vector<std::pair<Geometry<S>, Extent>> shapes = {
      {std::make_shared<fcl::Box<S>>(S(0.4), S(0.8), S(1.2)),
       [](const Eigen::Vector3d& n) { return n.cwiseAbs().dot(Eigen::Vector3d(0.2, 0.4, 0.6)); }},
      {std::make_shared<fcl::Sphere<S>>(S(0.7)), [](const Eigen::Vector3d&) { return 0.7; }},
      {std::make_shared<fcl::Ellipsoid<S>>(S(0.3), S(0.6), S(0.9)),
       [](const Eigen::Vector3d& n) { return n.cwiseProduct(Eigen::Vector3d(0.3, 0.6, 0.9)).norm(); }},
      {std::make_shared<fcl::Capsule<S>>(S(0.3), S(1)),
       [](const Eigen::Vector3d& n) { return 0.3 + 0.5 * std::abs(n.z()); }},
      {std::make_shared<fcl::Cylinder<S>>(S(0.5), S(1.2)),
       [=](const Eigen::Vector3d& n) { return disc(n) + 0.6 * std::abs(n.z()); }},
      {std::make_shared<fcl::Cone<S>>(S(0.5), S(1.2)),
       [=](const Eigen::Vector3d& n) { return std::max(disc(n) - 0.6 * n.z(), 0.6 * n.z()); }},
  };
  std::mt19937_64 g(12);
  const double rounding = std::is_same<S, double>::value ? 1e-12 : 1e-6, short_of = rounding < 1e-9 ? 1e-3 : 1e-2;
  const V normal = V(1, 2, -2) / S(3);
  for (const bool is_half : {false, true}) {
    const Geometry<S> plane = is_half ? Geometry<S>(std::make_shared<fcl::Halfspace<S>>(normal, S(0.5)))
                                      : Geometry<S>(std::make_shared<fcl::Plane<S>>(normal, S(0.5)));
    for (const auto& [shape, extent] : shapes) {
      Scene<S> scene, other_way;
      const auto X_WP = test::pose<S>(test::randomRotation(g), {100, -50, 30});
      scene.addFixed(plane, X_WP);
      const Id id = scene.addMoving(shape);
      // FCL sees contacts of these up to half of their size away.
      const bool is_wrong = shape->getNodeType() == (is_half ? fcl::GEOM_CONE : fcl::GEOM_CYLINDER);
      int touching = 0, above = 0, below = 0;
      for (int i = 0; i < 60; ++i) {
        const double height = std::uniform_real_distribution<double>(-3, 4)(g);
        const V foot = X_WP * V(normal * (S(0.5) + static_cast<S>(height)));
        const States<S> X(1, test::pose<S>(test::randomRotation(g), foot.template cast<double>()));
        const Eigen::Vector3d n = (X[0].linear().transpose() * X_WP.linear() * normal).template cast<double>();
        const double low = height - extent(-n), high = height + extent(n), gap = is_half ? low : std::max(low, -high);
        Pair nearest;
        EXPECT_NEAR(static_cast<double>(scene.clearance(X.data(), &nearest)), std::max(gap, 0.0), 100 * rounding);
        EXPECT_EQ(nearest.a, id);
        const S most = static_cast<S>(std::max(gap, 0.0) + 1000 * rounding);
        const std::vector<PairDistance<S>> near = scene.pairsWithin(X.data(), most);
        ASSERT_EQ(near.size(), 1u);
        EXPECT_NEAR(near[0].distance, std::max(gap, 0.0), 100 * rounding);
        if (gap > 0.01) {
          EXPECT_EQ(scene.pairsWithin(X.data(), static_cast<S>(gap - 0.01)).size(), 0u);
          const V on_shape = near[0].nearest_points[0], on_plane = near[0].nearest_points[1];
          EXPECT_NEAR((on_shape - on_plane).norm(), gap, 100 * rounding);
          EXPECT_NEAR(normal.dot(X_WP.inverse() * on_plane), 0.5, 100 * rounding);
          EXPECT_TRUE(isOnSurface<S>(*shape, X[0], on_shape, 1e-3));
          States<S> there{X_WP};
          Scene<S> swapped;
          swapped.addMoving(plane);
          swapped.addFixed(shape, X[0]);
          const PairDistance<S> same = swapped.pairsWithin(there.data(), most).at(0);
          EXPECT_EQ(same.nearest_points[0], on_plane);
          EXPECT_EQ(same.nearest_points[1], on_shape);
        }
        ++(gap < 0 ? touching : low > 0 ? above : below);
        if (is_wrong || std::abs(gap) < 2 * short_of) continue;
        EXPECT_EQ(scene.collides(X.data()), gap < 0);
        if (gap < 0) continue;
        for (const double way : {gap - short_of, gap + short_of, gap + 20}) {
          States<S> end = X;
          end[0].translation() += X_WP.linear() * normal * static_cast<S>(low > 0 ? -way : way);
          EXPECT_EQ(scene.edgeIsFree(X.data(), end.data()), way < gap) << way << ' ' << gap;
          EXPECT_EQ(scene.edgeIsFree(end.data(), X.data()), way < gap) << way << ' ' << gap;
        }
      }
      EXPECT_GT(touching, 2);
      EXPECT_GT(above, 5);
      EXPECT_GT(is_half ? 6 : below, 5);
      // A plane may move, too, but then FCL's shapes have no edges beside it.
      const V free = X_WP * V(normal * S(4));
      const States<S> X{X_WP}, Y{test::pose<S>(Eigen::Matrix3d::Identity(), free.template cast<double>())};
      other_way.addFixed(shape, Y[0]);
      other_way.addMoving(plane);
      EXPECT_EQ(other_way.clearance(X.data()), scene.clearance(Y.data()));
      EXPECT_NE(complaintOf([&] { other_way.edgeIsFree(X.data(), X.data()); }).find("Plane or Halfspace that moves"),
                std::string::npos);
    }
  }
}

TYPED_TEST(SceneTest, WarmQueriesAllocateNothing) {
  using S = TypeParam;
  World<S> w;
  std::mt19937_64 g(9);
  for (std::size_t i = 0; i < 30; ++i) w.fix(geometry<S>(i % 3, g), randomPose<S>(g, 2));
  // For other shapes, FCL's tests of triangles allocate.
  for (int i = 0; i < 8; ++i) w.fix(std::make_shared<fcl::Sphere<S>>(S(0.4)), randomPose<S>(g, 2));
  for (std::size_t i = 0; i < 3; ++i) w.move(geometry<S>(i, g));
  const States<S> X = walk<S>(120, 3, 2, 0.03, 31);
  std::uint8_t hit[120];
  const auto ask = [&] {
    for (std::size_t k = 0; k < 120; ++k) w.scene.collides(X.data() + 3 * k);
    w.scene.collisions(X.data(), 120, hit);
    w.scene.firstCollision(X.data(), 120);
    w.scene.anyCollision(X.data(), 120);
  };
  for (int k = 0; k < 40; ++k) ask();
  const std::size_t before = allocations;
  ask();
  EXPECT_EQ(allocations, before);
}

TYPED_TEST(SceneTest, WarmPairsAllocateNothing) {
  using S = TypeParam;
  const auto mesh = test::torus(30).mesh();
  const Model<S> a(mesh), b(mesh);
  std::mt19937_64 g(10);
  std::vector<fcl::Transform3<S>> X;
  for (int k = 0; k < 100; ++k) X.push_back(randomPose<S>(g, 1.5));
  std::uint8_t hit[100];
  fcl::CollisionResult<S> collision;
  const auto ask = [&] {
    collidePoses(a, b, X.data(), X.size(), hit, 1);
    for (const fcl::Transform3<S>& X_AB : X) {
      isCloserThan<S>(&a, fcl::Transform3<S>::Identity(), &b, X_AB, S(0.05));
      collision.clear();
      bocst::collide<S>(&a, fcl::Transform3<S>::Identity(), &b, X_AB, fcl::CollisionRequest<S>(), collision);
      fcl::DistanceResult<S> distance;
      bocst::distance<S>(&a, fcl::Transform3<S>::Identity(), &b, X_AB, fcl::DistanceRequest<S>(), distance);
    }
  };
  for (int k = 0; k < 10; ++k) ask();
  const std::size_t before = allocations;
  ask();
  EXPECT_EQ(allocations, before);
}

// Two flat faces with little space between them are searched over oriented boxes, if there is memory for these.
TEST(Scene, ClearancesDoNotNeedMemoryForOrientedBoxes) {
  const auto mesh = test::plate(64).mesh();
  const auto clearance = [&](std::size_t most) {
    const auto fixed = std::make_shared<Modeld>(mesh), moving = std::make_shared<Modeld>(mesh);
    Scened scene;
    scene.addFixed(fixed, fcl::Transform3d::Identity());
    scene.addMoving(moving);
    const auto X = test::pose<double>(Eigen::Matrix3d::Identity(), {0.1, 0.2, 1e-3});
    scene.collides(&X);
    most_bytes = most;
    double d = 0;
    for (int k = 0; k < 10; ++k) d = scene.clearance(&X);
    most_bytes = ~std::size_t{0};
    const bool has_boxes = fcl_adapter::treeOf(*fixed).knownBoxes() != nullptr;
    EXPECT_EQ(has_boxes, most == ~std::size_t{0});
    return d;
  };
  const double with = clearance(~std::size_t{0}), without = clearance(1 << 17);
  EXPECT_NEAR(with, 1e-3, 1e-9);
  EXPECT_NEAR(without, with, 1e-12);
}

// Others may read the box of a shape that they share with the scene, and may have enlarged it.
// Builds that fail, at whichever allocation, leave a tree that is counted right and that the next call builds.
TEST(Scene, BuildsTreesOnceThereIsMemory) {
  const auto countNodes = [](const Modeld& model) {
    std::size_t count = 0;
    model.visit([&](const NodeView&) { ++count; });
    return count;
  };
  int failures = 0;
  for (const test::Raw& raw : {test::box({-1, -1, -1}, {1, 1, 1}), test::torus(60)}) {
    Options options;
    options.oracle = OracleKind::kCpu;
    Modeld whole(raw.mesh(), options);
    whole.buildTree();
    for (std::size_t most = 16; most < std::size_t{1} << 18; most += most / 2) {
      const auto model = std::make_shared<Modeld>(raw.mesh(), options);
      Scened scene;
      scene.addFixed(model, fcl::Transform3d::Identity());
      most_bytes = most;
      try {
        scene.buildTrees();
      } catch (const std::bad_alloc&) {
        ++failures;
      }
      most_bytes = ~std::size_t{0};
      EXPECT_EQ(model->statistics().resident_nodes, countNodes(*model));
      const bool is_asked = countNodes(*model) < countNodes(whole) && most % 2 == 0;
      if (is_asked) {
        // A failed build keeps no later query from building the tree.
        const auto at = fcl::Transform3d(Eigen::Translation3d(0.7, 0.2, 0.1));
        for (int i = 0; i < 3000; ++i) {
          test::distance<double>(*model, fcl::Transform3d::Identity(), whole, at);
        }
        EXPECT_EQ(countNodes(*model), countNodes(whole));
      }
      scene.buildTrees();
      EXPECT_EQ(model->statistics().resident_nodes, countNodes(*model));
      EXPECT_EQ(countNodes(*model), countNodes(whole));
      if (!is_asked) {
        EXPECT_EQ(model->statistics().built_triangles, raw.triangles.size());
      }
    }
  }
  EXPECT_GT(failures, 10);
}

// Whole trees, which few contacts are taken from, need more memory than parts.
TEST(SceneMemory, FewContactsAreFoundWithoutWholeTrees) {
  const auto mesh = test::torus(180).mesh();
  const Modeld a(mesh), b(mesh);
  const auto X = fcl::Transform3d(Eigen::Translation3d(1.3, 0.2, 0.1));
  fcl::CollisionResultd few, more;
  most_bytes = std::size_t{1} << 20;
  EXPECT_NO_THROW(fcl::collide(&a, fcl::Transform3d::Identity(), &b, X, fcl::CollisionRequestd(5, true), few));
  most_bytes = ~std::size_t{0};
  ASSERT_EQ(few.numContacts(), 5u);
  Options by_position;
  by_position.memory_budget = std::size_t{1} << 30;
  const Modeld c(mesh, by_position), d(mesh, by_position);
  fcl::CollisionResultd expected;
  fcl::collide(&c, fcl::Transform3d::Identity(), &d, X, fcl::CollisionRequestd(5, true), expected);
  ASSERT_EQ(expected.numContacts(), 5u);
  for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(few.getContact(i).b1, expected.getContact(i).b1);
  EXPECT_FALSE(fcl_adapter::treeOf(a).isComplete() && fcl_adapter::treeOf(b).isComplete()) << "there was enough memory";
  fcl::collide(&a, fcl::Transform3d::Identity(), &b, X, fcl::CollisionRequestd(5, true), more);
  EXPECT_EQ(more.numContacts(), 5u);
  EXPECT_TRUE(fcl_adapter::treeOf(a).isComplete() && fcl_adapter::treeOf(b).isComplete());
}

TYPED_TEST(SceneTest, LeavesTheBoxesOfShapesAlone) {
  using S = TypeParam;
  const auto ball = std::make_shared<fcl::Sphere<S>>(S(1));
  ball->aabb_local.max_[0] = S(5);
  ball->aabb_radius = S(6);
  const auto box = ball->aabb_local;
  Scene<S> scene;
  const Id fixed = scene.addFixed(ball, fcl::Transform3<S>::Identity());
  scene.addMoving(ball);
  scene.update(fixed);
  EXPECT_TRUE(ball->aabb_local.min_ == box.min_ && ball->aabb_local.max_ == box.max_);
  EXPECT_EQ(ball->aabb_radius, S(6));
  const auto near = test::pose<S>(Eigen::Matrix3d::Identity(), {1.9, 0, 0}),
             apart = test::pose<S>(Eigen::Matrix3d::Identity(), {2.1, 0, 0});
  EXPECT_TRUE(scene.collides(&near));
  EXPECT_FALSE(scene.collides(&apart));
}

// FCL would call a support function that a plane does not have.
TYPED_TEST(SceneTest, RefusesPlanesBesideConvexes) {
  using S = TypeParam;
  const auto plane = std::make_shared<fcl::Plane<S>>(fcl::Vector3<S>::UnitZ(), S(0));
  const auto corners = std::make_shared<const std::vector<fcl::Vector3<S>>>(
      std::vector<fcl::Vector3<S>>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}});
  const auto faces =
      std::make_shared<const std::vector<int>>(std::vector<int>{3, 0, 2, 1, 3, 0, 1, 3, 3, 1, 2, 3, 3, 2, 0, 3});
  const auto convex = std::make_shared<fcl::Convex<S>>(corners, 4, faces);
  const States<S> X(1, fcl::Transform3<S>::Identity());
  for (const bool turned : {false, true}) {
    Scene<S> scene;
    scene.addFixed(turned ? Geometry<S>(convex) : Geometry<S>(plane), X[0]);
    scene.addMoving(turned ? Geometry<S>(plane) : Geometry<S>(convex));
    EXPECT_NE(complaintOf([&] { scene.collides(X.data()); }).find("Convex"), std::string::npos);
    EXPECT_THROW(scene.edgeIsFree(X.data(), X.data()), std::invalid_argument);
  }
}

// FCL's tables have nothing for a TriangleP: it would say "free" at every pose.
TYPED_TEST(SceneTest, RefusesTrianglesBesideShapes) {
  using S = TypeParam;
  using V = fcl::Vector3<S>;
  const auto triangle = std::make_shared<fcl::TriangleP<S>>(V(0, 0, 0), V(S(0.1), 0, 0), V(0, S(0.1), 0));
  const std::vector<Geometry<S>> partners = {std::make_shared<fcl::Box<S>>(2, 2, 2),
                                             std::make_shared<fcl::Sphere<S>>(1),
                                             std::make_shared<fcl::Halfspace<S>>(V::UnitZ(), S(1)),
                                             std::make_shared<fcl::TriangleP<S>>(V(0, 0, -1), V(0, 1, 1), V(1, 0, 1))};
  const States<S> X(1, fcl::Transform3<S>::Identity());
  for (const Geometry<S>& partner : partners) {
    for (const bool turned : {false, true}) {
      Scene<S> scene;
      scene.addFixed(turned ? Geometry<S>(triangle) : partner, X[0]);
      scene.addMoving(turned ? partner : Geometry<S>(triangle));
      EXPECT_NE(complaintOf([&] { scene.collides(X.data()); }).find("TriangleP a bocst::Model"), std::string::npos);
    }
  }
}

// Two shapes that are carried together never meet, and one that comes up with the other does. The number of queries on
// the way is that of the gap over the relative way: without that, this test takes hours.
TYPED_TEST(SceneTest, EdgesOfShapesThatMoveTogether) {
  using S = TypeParam;
  Scene<S> scene;
  const auto box = std::make_shared<fcl::Box<S>>(S(0.4), S(0.4), S(0.4));
  scene.addMoving(box);
  scene.addMoving(box);
  States<S> begin(2, fcl::Transform3<S>::Identity()), end = begin;
  const S gap = S(1e-3), way = std::is_same<S, double>::value ? S(1e6) : S(1);
  begin[1].translation().x() = S(0.4) + gap;
  for (const S closer : {S(0), gap / 2, gap * 2, S(0.5)}) {
    end[0].translation() = fcl::Vector3<S>(0, way, way / 2);
    end[1].translation() = begin[1].translation() + end[0].translation() - fcl::Vector3<S>(closer, 0, 0);
    EXPECT_EQ(scene.edgeIsFree(begin.data(), end.data()), closer < gap) << closer;
    EXPECT_EQ(scene.edgeIsFree(end.data(), begin.data()), closer < gap) << closer;
  }
}

// The same of a joint that turns both.
TYPED_TEST(SceneTest, EdgesOfShapesThatTurnTogether) {
  using S = TypeParam;
  using V = fcl::Vector3<S>;
  Scene<S> scene;
  const auto box = std::make_shared<fcl::Box<S>>(S(0.4), S(0.4), S(0.4));
  scene.addMoving(box);
  scene.addMoving(box);
  States<S> begin(2, fcl::Transform3<S>::Identity()), end = begin;
  const S gap = S(1e-3), far = std::is_same<S, double>::value ? S(1e5) : S(1);
  begin[0].translation().x() = far;
  begin[1].translation().x() = far + S(0.4) + gap;
  for (const S closer : {S(0), gap / 2, gap * 2, S(0.5)}) {
    fcl::Transform3<S> joint = fcl::Transform3<S>::Identity();
    joint.linear() = Eigen::AngleAxis<S>(S(1.5), V(0, S(0.6), S(0.8))).toRotationMatrix();
    end[0] = joint * begin[0];
    end[1] = joint * begin[1];
    end[1].translation() -= joint.linear() * V(closer, 0, 0);
    EXPECT_EQ(scene.edgeIsFree(begin.data(), end.data(), fcl::CCDM_SCREW), closer < gap) << closer;
    EXPECT_EQ(scene.edgeIsFree(end.data(), begin.data(), fcl::CCDM_SCREW), closer < gap) << closer;
  }
}

// The two touch for a hundredth of the way, between the states that halving it looks at.
TYPED_TEST(SceneTest, EdgesOfShapesThatPassOneAnother) {
  using S = TypeParam;
  using V = fcl::Vector3<S>;
  const auto small = std::make_shared<fcl::Box<S>>(S(0.01), S(0.01), S(0.01));
  const auto rod = std::make_shared<fcl::Box<S>>(S(1), S(0.01), S(0.01));
  const S time = S(11.5 / 32), angle = S(2.8);
  for (const bool meet : {false, true}) {
    const S aside = meet ? S(0) : S(0.02);
    for (const bool turned : {false, true}) {
      SCOPED_TRACE(testing::Message() << meet << turned);
      const std::size_t i = turned, j = 1 - i;
      States<S> begin(2, fcl::Transform3<S>::Identity()), end = begin;
      Scene<S> boxes;
      boxes.addMoving(small);
      boxes.addMoving(small);
      begin[j].translation() = V(-2 * time, aside, 0);
      end[i].translation() = V(0, 0, 3);
      end[j].translation() = V(2 - 2 * time, aside, 3);
      EXPECT_EQ(boxes.edgeIsFree(begin.data(), end.data()), !meet);

      // A rod that turns about its middle, and what it sweeps: carried along.
      Scene<S> sweep;
      sweep.addMoving(turned ? small : rod);
      sweep.addMoving(turned ? rod : small);
      const V along = Eigen::AngleAxis<S>(time * angle, V::UnitZ()) * V::UnitX();
      begin[j].translation() = along * S(0.4) + V(0, 0, aside);
      end[j].translation() = begin[j].translation() + V(0, 0, 3);
      end[i].linear() = Eigen::AngleAxis<S>(angle, V::UnitZ()).toRotationMatrix();
      EXPECT_EQ(sweep.edgeIsFree(begin.data(), end.data()), !meet);
    }
  }
}

/// Runs f in a child, which has a minute.
template <typename F>
void expectInChild(F&& f) {
  const pid_t child = fork();
  if (child == 0) {
    alarm(60);
    _exit(f() ? 0 : 1);
  }
  int status = -1;
  waitpid(child, &status, 0);
  EXPECT_EQ(status, 0);
}

/// Three states of a ball at the face of a cube, of which the second collides.
struct BallAndCube {
  explicit BallAndCube(unsigned threads) : scene(SceneOptions{threads}) {
    scene.addFixed(std::make_shared<Modeld>(test::box({-1, -1, -1}, {1, 1, 1}).mesh()),
                   fcl::Transform3d(fcl::Transform3d::Identity()));
    scene.addMoving(std::make_shared<fcl::Sphered>(0.25));
  }

  bool isRight() const {
    States<double> X(300, test::pose<double>(Eigen::Matrix3d::Identity(), {3, 0, 0}));
    X[177].translation().x() = 1.1;
    std::vector<std::uint8_t> hit(X.size(), 7), expected(X.size(), 0);
    expected[177] = 1;
    scene.collisions(X.data(), X.size(), hit.data());
    return hit == expected && scene.firstCollision(X.data(), X.size()) == 177;
  }

  Scened scene;
};

TEST(SceneThreads, AChildWorksAlone) {
  if (test::kThreadSanitized) return;  // It ends a child that starts threads: their ids are those of the parent's.
  auto scene = std::make_unique<BallAndCube>(3);
  EXPECT_TRUE(scene->isRight());
  expectInChild([&] {
    if (!scene->isRight()) return false;
    scene.reset();
    return BallAndCube(2).isRight();
  });
  EXPECT_TRUE(scene->isRight());
}

// A child that was forked during a change of another thread is told so, or works.
TEST(SceneThreads, ForksBesideChanges) {
  if (test::kSanitized) return;  // Their allocator may be locked at the fork.
  Scened scene;
  const auto ball = std::make_shared<fcl::Sphered>(1);
  const fcl::Transform3d X = fcl::Transform3d::Identity();
  const Id id = scene.addFixed(ball, X);
  scene.addMoving(ball);
  std::atomic<bool> stop{false};
  std::thread other([&] {
    while (!stop) scene.setPose(id, X);
  });
  for (int i = 0; i < 40; ++i) {
    usleep(500);
    expectInChild([&] {
      try {
        return scene.collides(&X);
      } catch (const std::runtime_error&) {
        return true;
      }
    });
  }
  stop = true;
  other.join();
}

// A change that throws in a child that was forked beside queries has changed nothing.
TEST(SceneThreads, ChangesInAChildAreWholeOrNone) {
  if (test::kSanitized) return;  // Their allocator may be locked at the fork.
  Scened scene;
  const auto ball = std::make_shared<fcl::Sphered>(1);
  const fcl::Transform3d X = fcl::Transform3d::Identity();
  const Id fixed = scene.addFixed(ball, test::pose<double>(Eigen::Matrix3d::Identity(), {9, 0, 0}));
  scene.addMoving(ball);
  EXPECT_FALSE(scene.collides(&X));
  std::atomic<bool> stop{false};
  test::ThreadGroup group(4, [&](std::size_t t) {
    if (t != 0) {
      while (!stop) scene.collides(&X);
      return;
    }
    for (int i = 0; i < 60; ++i) {
      usleep(300);
      expectInChild([&] {
        const auto is_whole = [&](auto&& change, std::size_t count, bool collides) {
          try {
            change();
          } catch (const std::runtime_error&) {
            count = 1;
            collides = false;
          }
          try {
            return scene.fixedCount() == count && scene.collides(&X) == collides;
          } catch (const std::runtime_error&) {
            return scene.fixedCount() == count;
          }
        };
        if (i % 3 == 0) return is_whole([&] { scene.addFixed(ball, X); }, 2, true);
        if (i % 3 == 1) return is_whole([&] { scene.setPose(fixed, X); }, 1, true);
        return is_whole([&] { scene.remove(fixed); }, 0, false);
      });
    }
    stop = true;
  });
}

// Where the system has not so many threads, the scene works with those that there are.
TEST(SceneThreads, FewerThanAskedFor) {
  if (test::kSanitized) return;  // Sanitizers need all of the address space.
  expectInChild([] {
    rlimit limit{};
    getrlimit(RLIMIT_AS, &limit);
    long pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    limit.rlim_cur = static_cast<rlim_t>(pages * sysconf(_SC_PAGESIZE)) + (rlim_t(1) << 28);
    if (setrlimit(RLIMIT_AS, &limit) != 0) return false;
    return BallAndCube(5000).isRight();
  });
}

// The model that the scene made of one of FCL's meshes grows.
TEST(SceneThreads, EdgesAlongMeshesOfFcl) {
  for (int turn = 0; turn < 8; ++turn) {
    Scened scene;
    const auto bvh = test::bvh<fcl::OBBRSSd>(test::torus(20, 0));
    scene.addFixed(bvh, fcl::Transform3d::Identity());
    scene.addMoving(bvh);
    test::ThreadGroup(3, [&scene](std::size_t t) {
      // About their common axis, one above the other: the tubes have the radius 0.35.
      for (const double height : {0.705, 0.695}) {
        const auto begin = test::pose<double>(Eigen::Matrix3d::Identity(), {0, 0, height});
        const auto end =
            test::pose<double>(Eigen::AngleAxisd(1 + t, Eigen::Vector3d::UnitZ()).toRotationMatrix(), {0, 0, height});
        EXPECT_EQ(scene.edgeIsFree(&begin, &end), height > 0.7);
      }
    });
  }
}

TEST(SceneThreads, ChangesBesideNewVertices) {
  Options options;
  options.answer = Answer::kConservative;
  const test::Raw raw = test::torus(10);
  const auto model = std::make_shared<Modeld>(raw.mesh(), options);
  Scened scene;
  const Id id = scene.addFixed(model, fcl::Transform3d::Identity());
  std::atomic<bool> stop{false};
  std::thread changes([&] {
    for (int i = 0; !stop; ++i) {
      std::vector<Eigen::Vector3d> vertices = raw.vertices;
      for (Eigen::Vector3d& v : vertices) v *= 1 + i % 3;
      model->updateVertices(vertices);
    }
  });
  for (int i = 0; i < test::repetitions(200); ++i) scene.update(id);
  stop = true;
  changes.join();
  model->updateVertices(raw.vertices);
  scene.update(id);
  scene.addMoving(std::make_shared<fcl::Sphered>(0.1));
  const auto X = test::pose<double>(Eigen::Matrix3d::Identity(), {0.7, 0, 0.4});
  EXPECT_TRUE(scene.collides(&X));
}

// What the tests run under ThreadSanitizer looks at: queries from several threads beside changes.
TEST(SceneThreads, ChangesBesideQueries) {
  std::mt19937_64 g(4);
  SceneOptions options;
  options.threads = 2;
  Scened scene(options);
  std::vector<Id> fixed;
  for (int i = 0; i < 12; ++i) fixed.push_back(scene.addFixed(geometry<double>(0, g), randomPose<double>(g, 3)));
  scene.addMoving(geometry<double>(0, g));
  scene.addMoving(geometry<double>(1, g));
  // This one touches in all states.
  const auto wall = std::make_shared<fcl::Box<double>>(100, 100, 100);
  const States<double> X = walk<double>(300, 2, 3, 0.02, 6);
  scene.addFixed(wall, fcl::Transform3d::Identity());
  std::atomic<bool> stop{false};
  std::atomic<int> asked{0};
  test::ThreadGroup threads(3, [&](std::size_t t) {
    std::vector<std::uint8_t> hit(300);
    for (std::size_t k = t; !stop || k < t + 3; ++k) {
      scene.collisions(X.data(), 300, hit.data());
      EXPECT_EQ(std::count(hit.begin(), hit.end(), 1), 300);
      EXPECT_TRUE(scene.collides(X.data() + 2 * (k % 300)));
      EXPECT_EQ(scene.firstCollision(X.data(), 300), 0u);
      ++asked;
    }
  });
  while (asked < 3) std::this_thread::yield();
  for (int k = 0; k < 40; ++k) {
    if (k % 8 == 0) scene.buildTrees();
    scene.setPose(fixed[static_cast<std::size_t>(k) % fixed.size()], randomPose<double>(g, 3));
    const Id id = scene.addFixed(geometry<double>(2, g), randomPose<double>(g, 3));
    if (k % 2 == 0) scene.remove(id);
  }
  stop = true;
  threads.join();
  EXPECT_EQ(scene.fixedCount(), 12u + 1 + 20);
}

// Distances of two of FCL's shapes, which FCL's solvers find too large: nearest points that are as far apart, one on
// each shape, bound the distance from above, points all over both shapes from below.
TEST(SceneShapes, AreMeasuredToTheirNearestPoints) {
  std::mt19937_64 g(71);
  std::uniform_real_distribution<double> u(-1, 1);
  struct Solid {
    std::shared_ptr<fcl::CollisionGeometryd> geometry;
    std::function<double(const Eigen::Vector3d&)> outside;  // 0 on it, more outside
    std::function<Eigen::Vector3d()> any;                   // a point on it
  };
  const auto disc = [&](double radius, double length) {
    return Solid{
        std::make_shared<fcl::Cylinderd>(radius, length),
        [=](const Eigen::Vector3d& x) { return std::max(x.head<2>().norm() - radius, std::abs(x.z()) - length / 2); },
        [&g, &u, radius, length]() -> Eigen::Vector3d {
          const double angle = 4 * u(g), r = u(g) > 0 ? radius : radius * std::sqrt(std::abs(u(g)));
          return {r * std::cos(angle), r * std::sin(angle), u(g) > 0 ? length / 2 : -length / 2};
        }};
  };
  const auto capsule = [&](double radius, double length) {
    return Solid{std::make_shared<fcl::Capsuled>(radius, length),
                 [=](const Eigen::Vector3d& x) {
                   const Eigen::Vector3d axis(0, 0, std::clamp(x.z(), -length / 2, length / 2));
                   return (x - axis).norm() - radius;
                 },
                 [&g, &u, radius, length]() -> Eigen::Vector3d {
                   return Eigen::Vector3d(0, 0, u(g) * length / 2) +
                          radius * Eigen::Vector3d(u(g), u(g), u(g)).normalized();
                 }};
  };
  const auto box = [&](const Eigen::Vector3d& half) {
    return Solid{std::make_shared<fcl::Boxd>(2 * half),
                 [=](const Eigen::Vector3d& x) { return (x.cwiseAbs() - half).maxCoeff(); },
                 [&g, &u, half]() -> Eigen::Vector3d {
                   Eigen::Vector3d x(u(g), u(g), u(g));
                   x[static_cast<int>(g() % 3)] = g() % 2 == 0 ? 1 : -1;
                   return x.cwiseProduct(half);
                 }};
  };
  const std::vector<Solid> solids{disc(0.3, 0.02), disc(0.05, 0.4), capsule(0.1, 0.5), box({0.2, 0.01, 0.3})};
  int apart = 0, fcl_was_wrong = 0;
  for (const Solid& a : solids) {
    for (const Solid& b : solids) {
      Scened scene;
      scene.addMoving(a.geometry);
      scene.addMoving(b.geometry);
      for (int round = 0; round < 40; ++round) {
        const auto pose = [&] {
          return test::pose<double>(Eigen::Quaterniond(u(g), u(g), u(g), u(g)).normalized().toRotationMatrix(),
                                    0.4 * Eigen::Vector3d(u(g), u(g), u(g)));
        };
        const fcl::Transform3d X[2] = {pose(), pose()};
        const double clearance = scene.clearance(X);
        const auto pairs = scene.pairsWithin(X, 10);
        ASSERT_EQ(pairs.size(), 1u);
        ASSERT_NEAR(pairs[0].distance, clearance, 1e-12);
        if (!(clearance > 1e-6)) continue;
        ++apart;
        const Eigen::Vector3d p = pairs[0].nearest_points[0], q = pairs[0].nearest_points[1];
        ASSERT_NEAR((p - q).norm(), clearance, 1e-5);
        ASSERT_LT(a.outside(X[0].inverse(Eigen::Isometry) * p), 1e-7);
        ASSERT_LT(b.outside(X[1].inverse(Eigen::Isometry) * q), 1e-7);
        for (int i = 0; i < 300; ++i) ASSERT_GT((X[0] * a.any() - X[1] * b.any()).norm(), clearance - 1e-9);
        fcl::DistanceResultd result;
        fcl_was_wrong += fcl::distance(a.geometry.get(), X[0], b.geometry.get(), X[1], fcl::DistanceRequestd(),
                                       result) > 1.0001 * clearance;
      }
    }
  }
  EXPECT_GT(apart, 200);
  EXPECT_GT(fcl_was_wrong, 0) << "FCL's distances would do";
}

}  // namespace
}  // namespace bocst
