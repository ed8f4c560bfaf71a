// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/bocst.h>
#include <bocst/collide_poses.h>
#include <bocst/is_closer_than.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "fcl/adapters/models.h"
#include "meshes.h"
#include "tree/tree.h"

namespace bocst {
namespace {

using Eigen::Vector3d;
using test::Raw;

template <typename S>
using Poses = std::vector<fcl::Transform3<S>, Eigen::aligned_allocator<fcl::Transform3<S>>>;

template <typename S>
Poses<S> randomPoses(std::size_t count, double spread, unsigned seed, const Vector3d& middle = Vector3d::Zero()) {
  std::mt19937_64 g(seed);
  std::normal_distribution<double> n;
  std::uniform_real_distribution<double> u(-spread, spread);
  Poses<S> poses(count, fcl::Transform3<S>::Identity());
  for (fcl::Transform3<S>& X : poses) {
    const Eigen::Quaterniond q = Eigen::Quaterniond(n(g), n(g), n(g), n(g)).normalized();
    X.linear() = q.toRotationMatrix().template cast<S>();
    X.translation() = (middle + Vector3d(u(g), u(g), u(g))).template cast<S>();
  }
  return poses;
}

template <typename S>
std::vector<std::uint8_t> oneByOne(const Model<S>& a, const Model<S>& b, const Poses<S>& X_AB) {
  std::vector<std::uint8_t> hits;
  for (const fcl::Transform3<S>& X : X_AB) {
    fcl::CollisionResult<S> result;
    hits.push_back(fcl::collide(&a, fcl::Transform3<S>(fcl::Transform3<S>::Identity()), &b, X,
                                fcl::CollisionRequest<S>(), result) > 0);
  }
  return hits;
}

template <typename S>
std::vector<std::uint8_t> atOnce(const Model<S>& a, const Model<S>& b, const Poses<S>& X_AB, unsigned threads = 1) {
  std::vector<std::uint8_t> hits(X_AB.size(), 7);
  collidePoses(a, b, X_AB.data(), X_AB.size(), hits.data(), threads);
  return hits;
}

/// The 16 numbers of each pose in one order, `skip` numbers into a buffer.
template <typename S>
std::vector<S> numbersOf(const Poses<S>& X_AB, MatrixOrder order, std::size_t skip = 0) {
  std::vector<S> numbers(skip);
  for (const fcl::Transform3<S>& X : X_AB) {
    for (int k = 0; k < 16; ++k) numbers.push_back(order == MatrixOrder::kRows ? X(k / 4, k % 4) : X(k % 4, k / 4));
  }
  return numbers;
}

std::size_t count(const std::vector<std::uint8_t>& hits) {
  return static_cast<std::size_t>(std::count(hits.begin(), hits.end(), 1));
}

Options optionsOf(Answer answer, double margin, bool solid) {
  Options options;
  options.answer = answer;
  options.depth = 5;
  options.margin = margin;
  options.solid = solid;
  return options;
}

template <typename S>
class CollidePoses : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(CollidePoses, Scalars);

TYPED_TEST(CollidePoses, HasTheVerdictsOfCollide) {
  using S = TypeParam;
  const auto mesh_a = test::torus(20).mesh(), mesh_b = test::box({-0.1, 0.2, 0.3}, {0.4, 0.6, 0.4}).mesh();
  for (const Options& options :
       {Options(), optionsOf(Answer::kConservative, 0, false), optionsOf(Answer::kExact, 0.1, false),
        optionsOf(Answer::kExact, 0, true), optionsOf(Answer::kConservative, 0.05, true)}) {
    const Model<S> a(mesh_a, options), b(mesh_b, options);
    const Poses<S> X = randomPoses<S>(1500, 1.6, 1);
    const auto expected = oneByOne(a, b, X);
    EXPECT_GT(count(expected), 100u);
    EXPECT_LT(count(expected), 1400u);
    for (const unsigned threads : {1u, 2u, 3u, 0u}) EXPECT_EQ(atOnce(a, b, X, threads), expected) << threads;
    EXPECT_EQ(atOnce(a, a, X), oneByOne(a, a, X));
  }
}

// Once enough poses touched, most are known to by probes. A walk, which collide() always makes, agrees.
TYPED_TEST(CollidePoses, HasThemOnceInteriorsAreKnown) {
  using S = TypeParam;
  Raw shell = test::box({-1, -1, -1}, {1, 1, 1});
  shell.add(test::box({-0.6, -0.6, -0.6}, {0.6, 0.6, 0.6}));
  const Raw raws[] = {test::torus(30), test::torus(12).scale(0.4), shell,
                      test::box({-0.1, -0.2, -0.3}, {0.1, 0.2, 0.3})};
  for (const Options& options :
       {Options(), optionsOf(Answer::kConservative, 0, false), optionsOf(Answer::kExact, 0.1, false)}) {
    for (const Raw& raw_a : raws) {
      for (const Raw& raw_b : raws) {
        const Model<S> a(raw_a.mesh(), options), b(raw_b.mesh(), options);
        const Poses<S> before = randomPoses<S>(1500, 0.8, 2), X = randomPoses<S>(800, 1.6, 3);
        atOnce(a, b, before);
        ASSERT_NE(fcl_adapter::treeOf(a).interior(0), nullptr);
        ASSERT_NE(fcl_adapter::treeOf(b).interior(0), nullptr);
        const auto expected = oneByOne(a, b, X);
        EXPECT_GT(count(expected), 10u);
        EXPECT_EQ(atOnce(a, b, X), expected);
        const auto turned = oneByOne(b, a, X);
        EXPECT_EQ(atOnce(b, a, X), turned);
      }
    }
  }
}

// What proves contact quickly is dropped like a branch, and counted.
TEST(CollidePosesInteriors, Decay) {
  Clock::time_point now{};
  Options options;
  options.clock = [&now] { return now; };
  options.ttl = std::chrono::milliseconds(1000);
  const auto mesh = test::torus(20).mesh();
  Model<double> a(mesh, options);
  const Model<double> b(mesh, options);
  const Poses<double> X = randomPoses<double>(800, 0.8, 2);
  atOnce(a, b, X);
  const tree::Tree& tree = fcl_adapter::treeOf(a);
  ASSERT_NE(tree.interior(0), nullptr);
  for (int n = 0; n < 20; ++n) a.prune(now += std::chrono::milliseconds(1500));
  EXPECT_EQ(tree.interior(0), nullptr);
  EXPECT_EQ(a.statistics().resident_bytes, Model<double>(mesh, options).statistics().resident_bytes);
  atOnce(a, b, X);
  EXPECT_NE(tree.interior(0), nullptr);
}

// A mesh that moves has another one.
TEST(CollidePosesInteriors, AreOfTheVerticesAsTheyAre) {
  const Raw raw = test::torus(20);
  Model<double> a(raw.mesh());
  const Model<double> b(raw.mesh());
  const Poses<double> X = randomPoses<double>(800, 0.8, 2);
  atOnce(a, b, X);
  ASSERT_NE(fcl_adapter::treeOf(a).interior(0), nullptr);
  Raw moved = raw;
  moved.scale(0.3).move({0.7, 0, 0});
  a.updateVertices(moved.vertices);
  EXPECT_EQ(fcl_adapter::treeOf(a).interior(0), nullptr);
  for (int n = 0; n < 2; ++n) EXPECT_EQ(atOnce(a, b, X), oneByOne(a, b, X));
}

TEST(CollidePosesInteriors, DoNotExceedTheBudget) {
  Options options;
  options.memory_budget = 2 * Interior::mostBytesOf(test::torus(20).triangles.size()) - 2;
  const auto mesh = test::torus(20).mesh();
  const Model<double> a(mesh, options), b(mesh);
  atOnce(a, b, randomPoses<double>(800, 0.8, 2));
  EXPECT_EQ(fcl_adapter::treeOf(a).interior(0), nullptr);
  EXPECT_NE(fcl_adapter::treeOf(b).interior(0), nullptr);
}

// Where boxes just touch, and where they just do not: rounding must not part what meets.
TYPED_TEST(CollidePoses, HasThemWhereBoxesBarelyTouch) {
  using S = TypeParam;
  std::mt19937_64 g(3);
  std::uniform_real_distribution<double> u(-1, 1);
  std::size_t hits = 0, poses = 0;
  for (const double away : {0.0, 10.0, 1e4}) {
    for (const double margin : {0.0, 0.01}) {
      const auto options = optionsOf(Answer::kExact, margin, false);
      // Corner, edge and face against face, of boxes that are turned and far from their own origins.
      const Model<S> a(test::box({away, away, away}, {away + 1, away + 2, away + 3}).mesh(), options);
      const Model<S> b(test::box({-1, -1, -1}, {1, 1, 1}).mesh(), options);
      Poses<S> X = randomPoses<S>(600, 0, 5);
      for (std::size_t k = 0; k < X.size(); ++k) {
        if (k % 3 == 0) X[k].linear().setIdentity();
        const auto R = X[k].linear().template cast<double>();
        const int axis = static_cast<int>(k % 2);
        const double reach = R.row(axis).cwiseAbs().sum() + 2 * margin;
        const double epsilon = static_cast<double>(std::numeric_limits<S>::epsilon()) * (away + 4);
        const double gap = epsilon * std::round(40 * u(g) * u(g) * u(g));
        Vector3d p(away + 0.5 + 0.3 * u(g), away + 1 + 0.5 * u(g), away + 1.5 + u(g));
        p[axis] = away - reach - gap;
        X[k].translation() = p.template cast<S>();
      }
      const auto expected = oneByOne(a, b, X);
      EXPECT_EQ(atOnce(a, b, X), expected) << away << " " << margin;
      hits += count(expected);
      poses += X.size();
    }
  }
  EXPECT_GT(hits, poses / 10);
  EXPECT_LT(hits, poses * 9 / 10);
}

// Rotations that are only nearly ones, as float's are after many products: a cube near the face of a skewed plate.
TYPED_TEST(CollidePoses, HasThemForPosesThatAreNotQuiteRigid) {
  using S = TypeParam;
  const Model<S> a(test::box({-0.02, -0.02, -0.02}, {0.02, 0.02, 0.02}).mesh());
  const Model<S> b(test::box({-0.01, -9, -9}, {0.01, 9, 9}).mesh());
  std::mt19937_64 g(4);
  std::uniform_real_distribution<double> u(-1, 1);
  Poses<S> X = randomPoses<S>(6000, 0, 6);
  for (fcl::Transform3<S>& x : X) {
    for (int i = 0; i < 9; ++i) x.linear()(i % 3, i / 3) += static_cast<S>(1.2e-4 * u(g));
    const Eigen::Matrix3d R = x.linear().template cast<double>();
    const double reach = 0.01 + 0.02 * R.col(0).cwiseAbs().sum() + 2e-3 * u(g);
    x.translation() = (-R * Vector3d(reach, 8.5 * u(g), 8.5 * u(g))).template cast<S>();
  }
  const auto expected = oneByOne(a, b, X);
  EXPECT_EQ(atOnce(a, b, X), expected);
  EXPECT_GT(count(expected), 1000u);
  EXPECT_LT(count(expected), 5000u);
}

// Conservative answers allow for what a rotation that is not quite one moves: the more, the farther from the origins.
TYPED_TEST(CollidePoses, HasThemForConservativeAnswersOfSuchPosesFarFromTheOrigins) {
  using S = TypeParam;
  const Vector3d middle_a(800, -500, 300), middle_b(-400, 900, 700);
  const auto mesh_a = test::box({-1, -0.01, -1}, {1, 0.01, 1}).move(middle_a).mesh(),
             mesh_b = test::torus(12).scale(0.1).move(middle_b).mesh();
  for (const bool first : {true, false}) {
    const Options conservative = optionsOf(Answer::kConservative, 0, false);
    const Model<S> a(mesh_a, first ? conservative : Options()), b(mesh_b, first ? Options() : conservative);
    std::mt19937_64 g(8);
    std::uniform_real_distribution<double> u(-1, 1);
    Poses<S> X = randomPoses<S>(4000, 0, 9);
    for (fcl::Transform3<S>& x : X) {
      for (int i = 0; i < 9; ++i) x.linear()(i % 3, i / 3) += static_cast<S>(2e-5 * u(g));
      const Eigen::Matrix3d R = x.linear().template cast<double>();
      x.translation() = (middle_a + Vector3d(u(g), 0.4 + 0.4 * u(g), u(g)) - R * middle_b).template cast<S>();
    }
    const auto expected = oneByOne(a, b, X);
    EXPECT_EQ(atOnce(a, b, X), expected);
    EXPECT_GT(count(expected), 100u);
    EXPECT_LT(count(expected), 3900u);
  }
}

TEST(CollidePosesModels, NothingTouchesAnEmptyOne) {
  const Modeld empty, model(test::torus(9).mesh());
  const std::vector<fcl::Transform3d> X(100, fcl::Transform3d::Identity());
  std::vector<std::uint8_t> hit(100, 7);
  collidePoses<double>(model, empty, X.data(), X.size(), hit.data(), 3);
  EXPECT_EQ(hit, std::vector<std::uint8_t>(100, 0));
  collidePoses<double>(model, model, X.data(), X.size(), hit.data(), 4000000000u);
  EXPECT_EQ(hit, std::vector<std::uint8_t>(100, 1));
}

TEST(CollidePosesConservative, HasThemWhereSpheresOfPointsBarelyTouch) {
  Raw raw;
  raw.addTriangle({1, 0, 0}, {1, 0, 0}, {1, 0, 0});
  Options options;
  options.answer = Answer::kConservative;
  options.subdivision = Subdivision::kOctree;
  options.depth = 1;
  const Modeld a(raw.mesh(), options), b(raw.mesh(), options);
  Poses<double> X(400, fcl::Transform3d::Identity());
  for (std::size_t i = 0; i < X.size(); ++i) {
    X[i].translation().x() = 1.2e-13 * std::pow(1.05, static_cast<double>(i) - 200);
  }
  EXPECT_EQ(atOnce(a, b, X), oneByOne(a, b, X));
}

TYPED_TEST(CollidePoses, HasThemForMeshesFarFromTheirOrigins) {
  using S = TypeParam;
  const Vector3d m(3, -20, 5), n(-7, 1, 4);
  const Model<S> a(test::torus(12).move(m).mesh()), b(test::torus(10).move(n).mesh());
  Poses<S> X = randomPoses<S>(2000, 1.6, 11, m);
  for (fcl::Transform3<S>& x : X) x.translation() -= x.linear() * n.cast<S>();
  const auto expected = oneByOne(a, b, X);
  EXPECT_EQ(atOnce(a, b, X), expected);
  EXPECT_GT(count(expected), 400u);
  EXPECT_LT(count(expected), 1600u);
}

TYPED_TEST(CollidePoses, NamesTheFirstPoseThatIsNone) {
  using S = TypeParam;
  const Model<S> a(test::torus(6).mesh());
  for (const unsigned threads : {1u, 2u}) {
    Poses<S> X = randomPoses<S>(3000, 2, 7);
    X[2500].linear()(0, 0) = 9;
    X[1234].translation()[1] = std::numeric_limits<S>::quiet_NaN();
    std::vector<std::uint8_t> hits(X.size());
    try {
      collidePoses(a, a, X.data(), X.size(), hits.data(), threads);
      FAIL();
    } catch (const std::invalid_argument& e) {
      EXPECT_NE(std::string(e.what()).find("collidePoses: pose 1234 "), std::string::npos) << e.what();
    }
  }
  std::uint8_t hit = 7;
  const fcl::Transform3<S> X = fcl::Transform3<S>::Identity();
  EXPECT_THROW(collidePoses<S>(a, a, nullptr, 1, &hit), std::invalid_argument);
  EXPECT_THROW(collidePoses<S>(a, a, &X, 1, nullptr), std::invalid_argument);
  collidePoses<S>(a, a, nullptr, 0, nullptr);
  EXPECT_EQ(hit, 7);
}

TYPED_TEST(CollidePoses, ReadsNumbersInBothOrders) {
  using S = TypeParam;
  const Model<S> a(test::torus(20).mesh()), b(test::box({-0.1, 0.2, 0.3}, {0.4, 0.6, 0.4}).mesh());
  const Poses<S> X = randomPoses<S>(1501, 1.6, 12);
  const auto expected = atOnce(a, b, X);
  EXPECT_GT(count(expected), 100u);
  for (const MatrixOrder order : {MatrixOrder::kColumns, MatrixOrder::kRows}) {
    for (const std::size_t skip : {0u, 1u, 3u}) {
      const std::vector<S> numbers = numbersOf<S>(X, order, skip);
      for (const unsigned threads : {1u, 2u}) {
        std::vector<std::uint8_t> hits(X.size(), 7);
        collidePoses(a, b, numbers.data() + skip, order, X.size(), hits.data(), threads);
        EXPECT_EQ(hits, expected) << skip << " " << threads;
      }
    }
  }
}

TYPED_TEST(CollidePoses, NamesTheFirstMatrixThatIsNoPose) {
  using S = TypeParam;
  Model<S> a(test::torus(6).mesh());
  const Poses<S> X = randomPoses<S>(3000, 9, 13);
  for (const bool occupied : {true, false}) {
    a.cost_density = occupied ? 1 : 0;
    for (const MatrixOrder order : {MatrixOrder::kColumns, MatrixOrder::kRows}) {
      const auto words = [&](const std::vector<S>& numbers, unsigned threads) -> std::string {
        std::vector<std::uint8_t> hits(X.size());
        try {
          collidePoses(a, a, numbers.data(), order, X.size(), hits.data(), threads);
        } catch (const std::invalid_argument& e) {
          return e.what();
        }
        return "";
      };
      for (const unsigned threads : {1u, 2u}) {
        const std::vector<S> right = numbersOf<S>(X, order);
        EXPECT_EQ(words(right, threads), "");
        for (int i = 0; i < 4; ++i) {
          for (int j = 0; j < 4; ++j) {
            std::vector<S> wrong = right;
            const std::size_t at = static_cast<std::size_t>(order == MatrixOrder::kRows ? 4 * i + j : 4 * j + i);
            wrong[16 * 2345 + at] = std::numeric_limits<S>::quiet_NaN();
            wrong[16 * 2999] = 9;
            const std::string what = i == 3 ? "last row" : j == 3 ? "translation" : "rotation";
            EXPECT_EQ(words(wrong, threads).find("bocst::collidePoses: pose 2345 has the " + what), 0u)
                << words(wrong, threads);
          }
        }
      }
    }
  }
  std::vector<S> numbers = numbersOf<S>(X, MatrixOrder::kRows);
  numbers[16 * 7 + 13] = static_cast<S>(0.25);
  std::uint8_t hits[9];
  EXPECT_THROW(collidePoses<S>(a, a, nullptr, MatrixOrder::kRows, 1, hits), std::invalid_argument);
  EXPECT_THROW(collidePoses<S>(a, a, numbers.data(), MatrixOrder::kRows, 9, nullptr), std::invalid_argument);
  EXPECT_THROW(collidePoses<S>(a, a, numbers.data(), MatrixOrder::kRows, 9, hits), std::invalid_argument);
  collidePoses<S>(a, a, numbers.data(), MatrixOrder::kRows, 7, hits);
  collidePoses<S>(a, a, nullptr, MatrixOrder::kRows, 0, nullptr);
}

TYPED_TEST(CollidePoses, OnlyOccupiedModelsCollide) {
  using S = TypeParam;
  const Model<S> a(test::torus(6).mesh());
  Model<S> b(test::torus(6).mesh());
  b.cost_density = 0;
  const Poses<S> X = randomPoses<S>(300, 0.5, 8);
  EXPECT_EQ(atOnce(a, b, X), oneByOne(a, b, X));
  EXPECT_EQ(count(atOnce(a, b, X)), 0u);
  EXPECT_EQ(count(atOnce(b, a, X)), 0u);
  EXPECT_GT(count(atOnce(a, a, X)), 0u);
}

TYPED_TEST(CollidePoses, FarAwayAndHugePoses) {
  using S = TypeParam;
  const Model<S> a(test::torus(6).mesh());
  Poses<S> X = randomPoses<S>(6, 0, 9);
  X[0].translation()[0] = std::numeric_limits<S>::max();
  X[1].translation().setConstant(-std::numeric_limits<S>::max() / 2);
  X[2].translation()[2] = static_cast<S>(1e20);
  X[3].translation()[1] = static_cast<S>(-1e9);
  const auto hits = atOnce(a, a, X);
  EXPECT_EQ(hits, oneByOne(a, a, X));
  EXPECT_EQ(count(std::vector<std::uint8_t>(hits.begin(), hits.begin() + 4)), 0u);
}

TYPED_TEST(CollidePoses, BesideOtherThreadsAndADeformingMesh) {
  using S = TypeParam;
  const Raw raw = test::torus(12);
  Model<S> a(raw.mesh());
  const Model<S> b(raw.mesh());
  const Poses<S> X = randomPoses<S>(2000, 1.6, 10);
  const auto expected = oneByOne(Model<S>(raw.mesh()), b, X);
  std::thread changes([&] {
    for (int i = 0; i < 50; ++i) a.updateVertices(raw.vertices);
  });
  for (int i = 0; i < 5; ++i) EXPECT_EQ(atOnce(a, b, X, 2), expected);
  changes.join();
}

// The clock is read while a query holds its locks. A writer that comes just then waits for the query; one that took a
// lock twice would wait behind the writer, for ever.
TYPED_TEST(CollidePoses, NoQueryTakesALockTwice) {
  using S = TypeParam;
  const Raw raw = test::torus(12);
  std::atomic<bool> comes{false};
  std::thread writer;
  Model<S>* deformed = nullptr;
  Options options;
  options.clock = [&] {
    if (comes.exchange(false)) {
      writer = std::thread([&] { deformed->updateVertices(raw.vertices); });
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    return Clock::now();
  };
  const auto a = std::make_shared<Model<S>>(raw.mesh(), options), b = std::make_shared<Model<S>>(raw.mesh());
  deformed = a.get();
  const fcl::Transform3<S> X_WA = fcl::Transform3<S>::Identity();
  fcl::Transform3<S> X_WB = X_WA;
  X_WB.translation()[0] = S(0.3);
  Scene<S> scene;
  scene.addMoving(a);
  scene.addFixed(b, X_WB);
  std::uint8_t hit = 0;
  fcl::CollisionResult<S> contacts;
  fcl::DistanceResult<S> nearest;
  fcl::ContinuousCollisionResult<S> first;
  const std::function<bool()> queries[] = {
      [&] { return collidePoses<S>(*a, *b, &X_WB, 1, &hit), hit != 0; },
      [&] { return collidePoses<S>(*b, *a, &X_WB, 1, &hit), hit != 0; },
      [&] { return fcl::collide(a.get(), X_WA, b.get(), X_WB, fcl::CollisionRequest<S>(), contacts) > 0; },
      [&] { return fcl::distance(a.get(), X_WA, b.get(), X_WB, fcl::DistanceRequest<S>(), nearest) <= 0; },
      [&] { return isCloserThan<S>(a.get(), X_WA, b.get(), X_WB, S(0.1)); },
      [&] {
        bocst::continuousCollide<S>(a.get(), X_WA, X_WA, b.get(), X_WB, X_WB, fcl::ContinuousCollisionRequest<S>(),
                                    first);
        return first.is_collide;
      },
      [&] { return scene.collides(&X_WA); },
      [&] { return scene.clearance(&X_WA) <= 0; },
  };
  for (const auto& touch : queries) {
    comes = true;
    EXPECT_TRUE(touch());
    ASSERT_FALSE(comes);
    writer.join();
  }
}

}  // namespace
}  // namespace bocst
