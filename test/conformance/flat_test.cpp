// SPDX-License-Identifier: BSD-3-Clause
// Pairs of which many parts are about as near as the nearest: flat faces with little space between them, cones tip to
// tip. Answers are right whatever was asked before, and the work is bounded.
#include <bocst/is_closer_than.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "conformance/reference.h"
#include "fcl/adapters/models.h"
#include "query/ccd/contact_time_walk.h"
#include "query/collide/tree_walk.h"
#include "query/distance/distance_walk.h"
#include "query/distance/touch.h"

namespace bocst {
namespace {

using Eigen::Vector3d;
using test::pipe;
using test::plate;
using test::Raw;

// A plate with walls about it: a tray, whose floor is no side of its convex hull.
Raw tray(std::size_t n) {
  Raw raw = plate(n), wall = plate(n);
  for (Vector3d& v : wall.vertices) v = Vector3d(0.5, v.y(), v.x() / 2 + 0.25);
  raw.add(wall);
  for (Vector3d& v : wall.vertices) v.x() = -0.5;
  raw.add(wall);
  return raw;
}

// With its tip at the origin, up to z = 1.
Raw cone(std::size_t sectors) {
  Raw raw;
  raw.vertices.emplace_back(0, 0, 0);
  for (std::size_t i = 0; i < sectors; ++i) {
    const double angle = 2 * std::acos(-1.0) * static_cast<double>(i) / static_cast<double>(sectors);
    raw.vertices.emplace_back(0.3 * std::cos(angle), 0.3 * std::sin(angle), 1);
    raw.triangles.emplace_back(0, 1 + i, 1 + (i + 1) % sectors);
  }
  return raw;
}

template <typename S>
fcl::Transform3<S> above(double gap, double turn = 0) {
  return test::pose<S>(Eigen::AngleAxisd(turn, Vector3d::UnitZ()).toRotationMatrix(), Vector3d(0.0123, 0.0071, gap));
}

template <typename S>
class FlatFaces : public testing::Test {};
TYPED_TEST_SUITE(FlatFaces, test::Scalars);

// One pose after the other, so that the later ones find oriented boxes built.
TYPED_TEST(FlatFaces, AnswersAreRightAtAnyGap) {
  using S = TypeParam;
  const fcl::Transform3<S> I = fcl::Transform3<S>::Identity();
  const double finest = std::is_same<S, double>::value ? 1e-12 : 1e-5;
  const Model<S> below(plate(24).mesh()), inside(tray(24).mesh());
  const Model<S> upper(plate(20).scale(0.9).mesh());
  for (const Model<S>* lower : {&below, &inside}) {
    for (int round = 0; round < 2; ++round) {
      for (const double gap : {0.0, 1e-12, 1e-9, 1e-7, 1e-6, 4e-6, 2e-5, 1e-4, 1e-3, 1e-2, 0.1}) {
        if (gap > 0 && gap < finest) continue;
        if (lower == &inside && gap > 0.03) continue;  // the walls are as near
        for (const double turn : {0.0, 0.3}) {
          if (lower == &inside && turn != 0) continue;  // it would meet the walls
          const fcl::Transform3<S> X = above<S>(gap, turn);
          SCOPED_TRACE(testing::Message() << "gap " << gap << ", turned by " << turn << ", round " << round);
          ASSERT_EQ(test::touching<S>(*lower, I, upper, X), gap == 0);
          ASSERT_EQ(test::touching<S>(upper, X, *lower, I), gap == 0);
          const double rounding = std::is_same<S, double>::value ? 2e-12 : 1e-6;
          ASSERT_NEAR(test::distance<S>(*lower, I, upper, X), gap, rounding);
          ASSERT_NEAR(test::distance<S>(upper, X, *lower, I), gap, rounding);
          if (gap < 100 * finest) continue;
          for (const double share : {0.5, 0.98, 0.9999, 1.0001, 1.02}) {
            const S limit = static_cast<S>(share * gap);
            ASSERT_EQ(isCloserThan<S>(lower, I, &upper, X, limit), share > 1) << share;
            ASSERT_EQ(isCloserThan<S>(&upper, X, lower, I, limit), share > 1) << share;
          }
        }
      }
    }
  }
}

struct Side {
  explicit Side(const Raw& raw) : tree(raw.mesh(), options()) {}
  static Options options() {
    Options o;
    o.ttl = std::chrono::milliseconds(0);
    return o;
  }
  tree::Tree tree;
};

query::SimilarityTransform relative(const Side& a, const Side& b, const fcl::Transform3d& X_AB) {
  const lattice::Lattice &la = a.tree.surface().lattice, &lb = b.tree.surface().lattice;
  query::SimilarityTransform p;
  p.rotation = X_AB.linear();
  p.scale = lb.unit() / la.unit();
  p.translation = (X_AB * lb.origin() - la.origin()) / la.unit();
  p.tolerance = 1e-13 * lattice::kMiddle;
  p.ready();
  return p;
}

// Says no to all pairs, as the exact test would, and counts them.
class Counter final : public query::Visitor {
 public:
  bool endsAtFirst() const override { return true; }
  bool triangles(std::uint32_t, std::uint32_t, bool certain) override {
    EXPECT_TRUE(!certain || may_be_certain);
    ++count;
    return false;
  }
  bool cells(const query::CellLeaf&, const query::CellLeaf&) override { return false; }
  bool cellOfA(const query::CellLeaf&, std::uint32_t, const Vector3d&) override { return false; }
  bool cellOfB(std::uint32_t, const query::CellLeaf&, const Vector3d&) override { return false; }

  std::size_t count = 0;
  bool may_be_certain = false;
};

TEST(FlatWork, OfAYesOrNoQueryIsBounded) {
  Side a(tray(40)), b(plate(40).scale(0.9));
  const query::TreeSide side_a(a.tree), side_b(b.tree);
  const query::SimilarityTransform to = relative(a, b, above<double>(1e-7));
  const std::size_t triangles = a.tree.surface().triangle_count + b.tree.surface().triangle_count;
  const auto ask = [&](bool by_turns) {
    Counter counter;
    query::TreeWalk walk(side_a, side_b, to);
    const bool ended = by_turns ? walk.runByTurns(counter) : walk.run(counter);
    EXPECT_FALSE(ended);
    return counter.count;
  };
  ASSERT_GT(ask(false), 2000u) << "float leaves most of the faces' pairs in doubt";
  std::size_t sum = 0;
  for (int i = 0; i < 30; ++i) sum += ask(true);
  EXPECT_LT(sum, 2 * triangles) << "until oriented boxes are built, exact tests cost less than these";
  EXPECT_NE(a.tree.knownBoxes(), nullptr);
  EXPECT_NE(b.tree.knownBoxes(), nullptr);
  EXPECT_LT(ask(true), 200u) << "from then on, blocks get no more time before boxes than these took";
}

TEST(FlatWork, OfFacesCloseToEachOtherNeedsNoTree) {
  const Modeld a(plate(40).mesh()), b(plate(40).scale(0.7).mesh());
  std::mt19937_64 g(3);
  std::uniform_real_distribution<double> u(-1, 1);
  for (int i = 0; i < 200; ++i) {
    const fcl::Transform3d X_W1 = test::pose<double>(test::randomRotation(g), Vector3d(u(g), u(g), u(g)));
    const fcl::Transform3d X_W2 = X_W1 * above<double>(1e-5 * std::pow(10, u(g)), 3 * u(g));
    fcl::CollisionRequestd request;
    fcl::CollisionResultd result;
    ASSERT_EQ(fcl::collide<double>(&a, X_W1, &b, X_W2, request, result), 0u);
  }
  EXPECT_EQ(a.statistics().resident_nodes, 1u);
  EXPECT_EQ(b.statistics().resident_nodes, 1u);
}

TEST(FlatWork, PipesGetBoxesToo) {
  Side a(pipe(256)), b(pipe(256));
  const query::TreeSide side_a(a.tree), side_b(b.tree);
  fcl::Transform3d X = fcl::Transform3d::Identity();
  X.linear() = Eigen::AngleAxisd(0.5, Vector3d::UnitX()).toRotationMatrix();
  X.translation() = Vector3d(0.19, 0, 0);  // they cross, and overlap by little
  const query::SimilarityTransform to = relative(a, b, X);
  Counter counter;
  counter.may_be_certain = true;
  for (int i = 0; i < 3; ++i) EXPECT_FALSE(query::TreeWalk(side_a, side_b, to).runByTurns(counter));
  EXPECT_NE(a.tree.knownBoxes(), nullptr);
  EXPECT_NE(b.tree.knownBoxes(), nullptr);
}

// Requests for contacts alone get the boxes, too, and then find nothing quickly; what they find stays the same.
TEST(FlatWork, ContactsOfPipesComeOverBoxes) {
  const Raw raw = pipe(512);
  const Modeld a(raw.mesh()), b(raw.mesh());
  const auto bvh_a = test::bvh<fcl::OBBRSSd>(raw), bvh_b = test::bvh<fcl::OBBRSSd>(raw);
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  const auto crossed = [](double gap) {
    const Vector3d axis(std::cos(0.7), std::sin(0.7), 0);  // no direction of the support tables
    return test::pose<double>(Eigen::AngleAxisd(0.5, axis).toRotationMatrix(), (0.2 + gap) * axis);
  };
  using Found = std::vector<std::array<double, 5>>;
  const auto contacts = [&](const fcl::Transform3d& X, std::size_t most) {
    fcl::CollisionResultd result;
    fcl::collide(&a, I, &b, X, fcl::CollisionRequestd(most, true), result);
    Found found;
    for (std::size_t i = 0; i < result.numContacts(); ++i) {
      const fcl::Contactd& c = result.getContact(i);
      found.push_back({double(c.b1), double(c.b2), c.pos.x(), c.pos.y(), c.penetration_depth});
    }
    return found;
  };
  const auto boxes = [](const Modeld& m) { return fcl_adapter::treeOf<double>(m).knownBoxes(); };
  const std::vector<fcl::Transform3d> poses{crossed(0.01), crossed(-0.01), crossed(-0.1), crossed(-1e-3),
                                            crossed(1e-4)};
  std::vector<Found> few, all;
  for (const fcl::Transform3d& X : poses) few.push_back(contacts(X, 3)), all.push_back(contacts(X, 1000000));
  EXPECT_TRUE(all[0].empty() && all[4].empty());
  EXPECT_GT(all[2].size(), 100u);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    EXPECT_EQ(test::pairs<double>(a, I, b, poses[i]), test::pairs<double>(*bvh_a, I, *bvh_b, poses[i])) << i;
  }
  for (int i = 0; i < 1000 && boxes(a) == nullptr; ++i) contacts(poses[4], 1000000);
  ASSERT_NE(boxes(a), nullptr);
  ASSERT_NE(boxes(b), nullptr);
  for (const auto& [over_boxes, times] : {std::pair(0u, 1u), std::pair(0u, 2u), std::pair(1u, 1u), std::pair(1u, 2u)}) {
    SCOPED_TRACE(testing::Message() << over_boxes << ' ' << times);
    for (const Modeld* m : {&a, &b}) {
      fcl_adapter::treeOf<double>(*m).setLongSearch(tree::Tree::Search::kContacts, {over_boxes, times, 500});
    }
    for (std::size_t i = 0; i < poses.size(); ++i) {
      EXPECT_EQ(contacts(poses[i], 3), few[i]) << i;
      EXPECT_EQ(contacts(poses[i], 1000000), all[i]) << i;
    }
  }
}

// `steps` counts pairs of leaves and of triangles, each exact distance as two more.
TEST(FlatWork, OfADistanceIsBounded) {
  const Raw first[] = {plate(40), plate(40), cone(64), cone(64)};
  const Raw second[] = {plate(40), plate(40).scale(0.9), cone(64), plate(40)};
  for (std::size_t i = 0; i < 4; ++i) {
    Side a(first[i]), b(second[i]);
    const query::TreeSide side_a(a.tree), side_b(b.tree);
    const bool tips = i == 2;
    fcl::Transform3d X = above<double>(i < 2 ? 0.1 : -0.1, 0.3);
    if (tips) X.linear() = Eigen::AngleAxisd(std::acos(-1.0), Vector3d::UnitX()).toRotationMatrix() * X.linear();
    const query::SimilarityTransform to = relative(a, b, X);
    const double expected = (tips ? X.translation().norm() : 0.1) / a.tree.surface().lattice.unit();
    query::DistanceWalk<query::TreeSide, query::TreeSide>(side_a, side_b, to).run({});  // grows
    query::DistanceWalk<query::TreeSide, query::TreeSide> trees(side_a, side_b, to);
    EXPECT_NEAR(trees.run({}).distance, expected, 1e-11 * expected + 1e-6) << i;
    const query::BoxSide boxes_a(side_a), boxes_b(side_b);
    query::DistanceWalk<query::BoxSide, query::BoxSide> boxes(boxes_a, boxes_b, to);
    EXPECT_NEAR(boxes.run({}).distance, expected, 1e-11 * expected + 1e-6) << i;
    EXPECT_LT(boxes.steps(), tips ? 2u * 64 * 64 : 800u) << i;
    const std::size_t triangles = a.tree.surface().triangle_count + b.tree.surface().triangle_count;
    EXPECT_LT(trees.steps(), tips ? 2u * 64 * 64 : 5 * triangles) << i;
    // An answer in hand is not lost where a walk gives up at once.
    query::DistanceWalk<query::TreeSide, query::TreeSide> short_one(side_a, side_b, to);
    query::Nearest known;
    known.distance = expected / 2;
    EXPECT_EQ(short_one.run({}, known, 0).distance, known.distance);
    EXPECT_TRUE(short_one.gaveUp());
    EXPECT_NEAR(query::findNearest(side_a, side_b, to, {}).distance, expected, 1e-11 * expected + 1e-6) << i;
  }
}

/// Keeps the pairs of triangles that it is asked about, and takes one of them.
class Asked final : public query::Visitor {
 public:
  explicit Asked(std::size_t taken = ~std::size_t{0}) : taken_(taken) {}
  bool endsAtFirst() const override { return true; }
  bool triangles(std::uint32_t a, std::uint32_t b, bool) override {
    pairs.emplace_back(a, b);
    return pairs.size() > taken_;
  }
  bool cells(const query::CellLeaf&, const query::CellLeaf&) override { return false; }
  bool cellOfA(const query::CellLeaf&, std::uint32_t, const Vector3d&) override { return false; }
  bool cellOfB(std::uint32_t, const query::CellLeaf&, const Vector3d&) override { return false; }

  std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs;

 private:
  const std::size_t taken_;
};

// Of a distance, and a limit just above it, few pairs are tested, however small the triangles are beside it.
TEST(FlatWork, AVisitorIsAskedAboutAllPairsThatAreNearEnough) {
  Side a(test::torus(30)), b(test::torus(24, 0.2));
  const query::TreeSide side_a(a.tree), side_b(b.tree);
  std::mt19937_64 g(9);
  for (const double far : {2.6, 30.0, 3000.0}) {
    const auto X = test::pose<double>(test::randomRotation(g), test::randomDirection(g) * far);
    const query::SimilarityTransform to = relative(a, b, X);
    const double distance = query::findNearest(side_a, side_b, to, {}).distance;
    const double unit = a.tree.surface().lattice.unit();
    for (const double more : {1e-12 * distance, 0.003 / unit, 0.6 / unit}) {
      const double below = distance + more;
      std::set<std::pair<std::uint32_t, std::uint32_t>> expected;
      for (std::uint32_t i = 0; i < a.tree.surface().triangle_count; ++i) {
        for (std::uint32_t j = 0; j < b.tree.surface().triangle_count; ++j) {
          Vector3d p, q;
          const query::Corners in_a = side_a.corners(i), of_b = query::placed(side_b.corners(j), to);
          if (query::nearestPoints(in_a, of_b, p, q) < below) expected.emplace(i, j);
        }
      }
      Asked all;
      query::DistanceWalk<query::TreeSide, query::TreeSide> walk(side_a, side_b, to);
      EXPECT_FALSE(std::isfinite(walk.run({below, 0, 0, &all}).distance)) << "none was taken";
      EXPECT_EQ(std::set(all.pairs.begin(), all.pairs.end()), expected) << far << ' ' << more;
      ASSERT_FALSE(expected.empty());
      EXPECT_LT(walk.steps(), 40 * expected.size() + 4000) << far << ' ' << more;
      const std::size_t last = all.pairs.size() - 1;
      for (const std::size_t taken : {std::size_t{0}, last / 2, last}) {
        Asked some(taken);
        const query::Nearest found = query::findNearest(side_a, side_b, to, {below, 0, 0, &some});
        ASSERT_EQ(some.pairs.size(), taken + 1) << "nothing is asked after it";
        EXPECT_EQ(std::make_pair(std::uint64_t{some.pairs.back().first}, std::uint64_t{some.pairs.back().second}),
                  std::make_pair(found.a, found.b));
        EXPECT_LT(found.distance, below);
      }
    }
  }
}

// Where surfaces touch, a short walk finds a pair that is at distance 0; else it says nothing, and grows no new tree.
TEST(FlatWork, TouchesAreFoundByAShortWalk) {
  Side a(test::torus(40)), b(test::torus(30, 0.2));
  const query::TreeSide side_a(a.tree), side_b(b.tree);
  std::mt19937_64 g(8);
  std::uniform_real_distribution<double> u(0, 1);
  int found = 0, apart = 0;
  EXPECT_FALSE(query::findTouch(side_a, side_b, relative(a, b, fcl::Transform3d::Identity()))) << "the roots are new";
  for (int i = 0; i < 60; ++i) {
    const auto X = test::pose<double>(test::randomRotation(g), test::randomDirection(g) * 3 * u(g));
    const query::SimilarityTransform to = relative(a, b, X);
    const query::Nearest nearest = query::findNearest(side_a, side_b, to, {});
    const std::optional<query::Nearest> touch = query::findTouch(side_a, side_b, to);
    ASSERT_FALSE(touch && nearest.distance > 0) << i;
    ++(touch ? found : apart);
    if (!touch) continue;
    EXPECT_EQ(touch->distance, 0);
    EXPECT_LT((touch->on_a - touch->on_b).norm(), 1e-6);
    const auto t = static_cast<std::uint32_t>(touch->a), v = static_cast<std::uint32_t>(touch->b);
    const query::Corners in_a = side_a.corners(t);
    const query::Corners of_b = query::placed(side_b.corners(v), to);
    Vector3d p, q;
    EXPECT_EQ(query::nearestPoints(in_a, of_b, p, q), 0) << "the triangles that it names touch";
  }
  EXPECT_GT(found, 15);
  EXPECT_GT(apart, 15);
  // Pairs that the walk must look at, and that do not touch.
  Side lower(tray(40)), upper(plate(40).scale(0.9));
  const query::TreeSide side_lower(lower.tree), side_upper(upper.tree);
  const query::SimilarityTransform to = relative(lower, upper, above<double>(1e-7));
  EXPECT_GT(query::findNearest(side_lower, side_upper, to, {}).distance, 0);
  EXPECT_FALSE(query::findTouch(side_lower, side_upper, to));
}

// Rough plates that are nearly parallel: the search takes more than a turn, over blocks and over oriented boxes.
TEST(FlatWork, DistancesOfManyTurnsAreRight) {
  std::mt19937_64 g(10);
  std::uniform_real_distribution<double> u(0, 1);
  Raw rough[2] = {plate(120), plate(110)};
  for (Raw& raw : rough) {
    for (Vector3d& v : raw.vertices) v.z() += 1e-4 * u(g);
  }
  Side a(rough[0]), b(rough[1]);
  const query::TreeSide side_a(a.tree), side_b(b.tree);
  std::size_t most = 0;
  for (int i = 0; i < 12; ++i) {
    const query::SimilarityTransform to = relative(a, b, above<double>(0.02 + 0.02 * u(g), 6 * u(g)));
    query::DistanceWalk<query::TreeSide, query::TreeSide> walk(side_a, side_b, to);
    const double expected = walk.run({}).distance;
    most = std::max(most, walk.steps());
    EXPECT_NEAR(query::findNearest(side_a, side_b, to, {}).distance, expected, 1e-12 * expected) << i;
    // Shorter turns, so that each of them ends too early.
    query::DistanceWalk<query::TreeSide, query::TreeSide> part(side_a, side_b, to);
    const query::Nearest first = part.run({}, {}, walk.steps() / 2);
    EXPECT_TRUE(part.gaveUp());
    EXPECT_NEAR(part.run({}, first).distance, expected, 1e-12 * expected);
  }
  EXPECT_GT(most, 2048u);
}

// Rough plates of which one place touches: oriented boxes look for longer than they may, and must not say "none".
TEST(FlatWork, ContactsThatBoxesDoNotFindAreFound) {
  std::mt19937_64 g(5);
  std::uniform_real_distribution<double> height(0, 2e-3);
  Raw first = plate(100), second = plate(100);
  for (Raw* raw : {&first, &second}) {
    for (Vector3d& v : raw->vertices) v.z() = height(g);
  }
  const auto bvh_a = test::bvh<fcl::OBBRSSd>(first), bvh_b = test::bvh<fcl::OBBRSSd>(second);
  const Modeld a(first.mesh()), b(second.mesh());
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  const auto at = [](double gap) { return above<double>(gap, 0.3); };
  const double contact =
      test::contactDistance([&](double gap) { return test::touching<double>(*bvh_a, I, *bvh_b, at(gap)); }, 0.1, 40);
  const auto boxes = [&] { return fcl_adapter::treeOf<double>(a).knownBoxes(); };
  for (int i = 0; i < 1000 && boxes() == nullptr; ++i) {
    ASSERT_TRUE(test::pairs<double>(a, I, b, at(contact + 1e-7)).empty());
  }
  ASSERT_NE(boxes(), nullptr);
  const test::Pairs expected = test::pairs<double>(*bvh_a, I, *bvh_b, at(contact - 1e-7));
  EXPECT_FALSE(expected.empty());
  EXPECT_EQ(test::pairs<double>(a, I, b, at(contact - 1e-7)), expected);
}

// Rough plates: the nearest pair is not among the first that a walk looks at.
TEST(FlatWork, ATurnThatGivesUpIsNoAnswer) {
  std::mt19937_64 g(3);
  std::uniform_real_distribution<double> height(0, 2e-3);
  for (int round = 0; round < 8; ++round) {
    Raw first = plate(90), second = plate(90);
    for (Raw* raw : {&first, &second}) {
      for (Vector3d& v : raw->vertices) v.z() = height(g);
    }
    Side a(first), b(second);
    const query::TreeSide side_a(a.tree), side_b(b.tree);
    const query::SimilarityTransform to = relative(a, b, above<double>(0.1, 0.3));
    query::DistanceWalk<query::TreeSide, query::TreeSide> walk(side_a, side_b, to);
    const double expected = walk.run({}).distance;
    EXPECT_GT(walk.steps(), 256u) << "or the turns below do not give up";
    a.tree.boxes(0);
    b.tree.boxes(0);
    EXPECT_NEAR(query::findNearest(side_a, side_b, to, {}).distance, expected, 1e-11 * expected);
  }
}

query::SimilarityTransform inBody(const Side& side) {
  const lattice::Lattice& lattice = side.tree.surface().lattice;
  query::SimilarityTransform p;
  p.scale = lattice.unit();
  p.translation = lattice.origin();
  return p;
}

// A plate that lands on another or in a tray, or slides over it, turning or not. Boxes separate what slides for all of
// the time, and end a landing at its first contact.
TEST(FlatWork, OfATimeOfContactIsBounded) {
  const query::AxisMotion still = query::translation(Eigen::Isometry3d::Identity(), Eigen::Isometry3d::Identity());
  query::ContactGoal goal;
  goal.rounding = 1e-12;
  goal.time_error = 1e-4;
  const double never = std::numeric_limits<double>::infinity();
  for (const bool into_tray : {false, true}) {
    Side a(into_tray ? tray(40) : plate(40)), b(plate(40).scale(0.6));
    const query::TreeSide side_a(a.tree), side_b(b.tree);
    for (const double turn : {0.0, 0.3}) {
      for (const double end : {-0.1, 0.0, 1e-9, 1e-6, 1e-3}) {
        SCOPED_TRACE(testing::Message() << into_tray << ", turned by " << turn << ", to " << end);
        const Eigen::Isometry3d begin(above<double>(0.1, 0.1).matrix()), last(above<double>(end, 0.1 + turn).matrix());
        const query::AxisMotion motion = query::interpolation(begin, last);
        const double expected = end > 0 ? never : 0.1 / (0.1 - end);
        const auto expectTime = [&](double time) {
          if (end > 0) {
            EXPECT_EQ(time, never);
            return;
          }
          EXPECT_LE(time, expected);
          EXPECT_GE(time, expected - goal.time_error - 1e-9);
        };
        const query::BoxSide boxes_a(side_a), boxes_b(side_b);
        query::ContactTimeWalk<query::BoxSide, query::BoxSide> boxes(boxes_a, inBody(a), still, boxes_b, inBody(b),
                                                                     motion);
        expectTime(boxes.run(goal));
        EXPECT_LT(boxes.steps(), 400u);
        expectTime(query::findContactTime(side_a, inBody(a), still, side_b, inBody(b), motion, goal));
      }
      Eigen::Isometry3d begin(above<double>(1e-6, 0.1).matrix()), last(above<double>(1e-6, 0.1 + turn).matrix());
      last.translation().x() -= 0.1;
      const query::AxisMotion slide = query::interpolation(begin, last);
      const query::BoxSide boxes_a(side_a), boxes_b(side_b);
      query::ContactTimeWalk<query::BoxSide, query::BoxSide> boxes(boxes_a, inBody(a), still, boxes_b, inBody(b),
                                                                   slide);
      EXPECT_EQ(boxes.run(goal), never);
      EXPECT_LT(boxes.steps(), 200u);
      EXPECT_EQ(query::findContactTime(side_a, inBody(a), still, side_b, inBody(b), slide, goal), never);
    }
  }
}

// Oriented boxes are built when walks have paid for them.
TEST(FlatWork, OfManyTimesOfContactPaysForBoxes) {
  const Modeld a(plate(24).mesh()), b(plate(24).scale(0.6).mesh());
  const fcl::Transform3d I = fcl::Transform3d::Identity(), begin = above<double>(1e-7, 0.1);
  fcl::ContinuousCollisionRequestd request;
  request.ccd_motion_type = fcl::CCDM_LINEAR;
  request.ccd_solver_type = fcl::CCDC_CONSERVATIVE_ADVANCEMENT;
  const std::size_t before = a.statistics().resident_bytes;
  int queries = 0;
  for (; queries < 1000 && a.statistics().resident_bytes < before + 100 * 2 * 24 * 24; ++queries) {
    fcl::Transform3d end = begin;
    end.translation().x() += 0.1;
    fcl::ContinuousCollisionResultd result;
    fcl::continuousCollide(&a, I, I, &b, begin, end, request, result);
    ASSERT_FALSE(result.is_collide);
  }
  EXPECT_LT(queries, 1000);
}

// What is nearly as near as a touching pair is not taken for it.
TEST(FlatWork, DistancesNextToNothingAreFound) {
  std::mt19937_64 g(3);
  std::uniform_real_distribution<double> u(-1, 1);
  const Modeld a(plate(12).mesh()), b(cone(12).mesh());
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  for (const double gap : {1e-13, 1e-11, 1e-9, 1e-6}) {
    for (int i = 0; i < 20; ++i) {
      fcl::Transform3d X = above<double>(gap);
      X.linear() = Eigen::AngleAxisd(0.2 * u(g), Vector3d(u(g), u(g), 0).normalized()).toRotationMatrix();
      ASSERT_NEAR(test::distance<double>(a, I, b, X), gap, 1e-12 + 2e-3 * gap);
    }
  }
}

}  // namespace
}  // namespace bocst
