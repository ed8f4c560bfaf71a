// SPDX-License-Identifier: BSD-3-Clause
// Which of many contacts a request for few gets: the documented order, computed pair by pair.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <tuple>
#include <vector>

#include "conformance/octrees.h"
#include "conformance/reference.h"
#include "every_target.h"
#include "fcl/adapters/models.h"
#include "geometry/triangle.h"
#include "tree/tree.h"

namespace bocst {
namespace {

using Eigen::Vector3d;
using test::Raw;

// Few contacts of two models with a budget are those of the least position.
Options byPosition() {
  Options options;
  options.memory_budget = std::size_t{1} << 30;
  return options;
}

// Position, then ids.
using Place = std::tuple<double, std::intptr_t, std::intptr_t>;

std::vector<fcl::Contactd> ask(const fcl::CollisionGeometryd& one, const fcl::Transform3d& X_W1,
                               const fcl::CollisionGeometryd& two, const fcl::Transform3d& X_W2, std::size_t most) {
  const fcl::CollisionRequestd request(most, true);
  fcl::CollisionResultd result;
  fcl::collide(&one, X_W1, &two, X_W2, request, result);
  std::vector<fcl::Contactd> contacts;
  result.getContacts(contacts);
  return contacts;
}

using Ids = std::vector<std::pair<std::intptr_t, std::intptr_t>>;

Ids idsOf(const std::vector<fcl::Contactd>& contacts) {
  Ids ids;
  for (const fcl::Contactd& c : contacts) ids.emplace_back(c.b1, c.b2);
  return ids;
}

void takeCorners(const Raw& raw, std::intptr_t t, const fcl::Transform3d& X, query::Corners& corners) {
  for (std::size_t k = 0; k < 3; ++k) corners[k] = X * raw.vertices[raw.triangles[static_cast<std::size_t>(t)][k]];
}

Vector3d directionOf(const Mesh& mesh) {
  int longest = 0;
  mesh.bounds().diagonal().maxCoeff(&longest);
  Vector3d direction;
  direction[longest] = 1;
  direction[(longest + 1) % 3] = 0.31;
  direction[(longest + 2) % 3] = 0.23;
  return direction;
}

// The contacts in their order; none where rounding decides whether two triangles clearly intersect. `ordering`: the
// mesh in whose frame positions are, that of the first geometry or the second.
std::vector<Place> places(const std::vector<fcl::Contactd>& all, const Raw& one, const fcl::Transform3d& in_ordering1,
                          const Raw& two, const fcl::Transform3d& in_ordering2, const Raw& ordering) {
  const Vector3d direction = directionOf(*ordering.mesh());
  std::vector<Place> ordered;
  for (const fcl::Contactd& c : all) {
    query::Corners p, q;
    takeCorners(one, c.b1, in_ordering1, p);
    takeCorners(two, c.b2, in_ordering2, q);
    const auto endOf = [&](const query::Corners& t) {
      return std::max({direction.dot(t[0]), direction.dot(t[1]), direction.dot(t[2])});
    };
    const auto place = query::nearEndOfCut(p, q, direction, 1e-6);
    if (place.has_value() != query::nearEndOfCut(p, q, direction, 1e-8).has_value()) return {};
    ordered.emplace_back(place.value_or(std::min(endOf(p), endOf(q))), c.b1, c.b2);
  }
  std::sort(ordered.begin(), ordered.end());
  return ordered;
}

Raw cloud(std::mt19937_64& g) {
  std::uniform_real_distribution<double> u(-1, 1);
  Raw raw;
  for (int i = 0; i < 300; ++i) {
    const Vector3d at(1.5 * u(g), u(g), u(g));
    const double size = i % 20 == 0 ? 1 : 0.2;
    const auto corner = [&] { return Vector3d(at + size * Vector3d(u(g), u(g), u(g))); };
    raw.addTriangle(corner(), corner(), corner());
  }
  return raw;
}

// Its sides run from end to end, and each cap is a fan in one plane across its longest axis.
Raw cylinder(double radius, double length, std::size_t sectors) {
  Raw raw;
  for (std::size_t i = 0; i < sectors; ++i) {
    const double angle = 2 * std::acos(-1.0) * static_cast<double>(i) / static_cast<double>(sectors);
    for (const double z : {-length / 2, length / 2}) {
      raw.vertices.emplace_back(radius * std::cos(angle), radius * std::sin(angle), z);
    }
  }
  raw.vertices.emplace_back(0, 0, -length / 2);
  raw.vertices.emplace_back(0, 0, length / 2);
  for (std::size_t i = 0; i < sectors; ++i) {
    const std::size_t a = 2 * i, b = 2 * ((i + 1) % sectors);
    raw.triangles.emplace_back(a, b, b + 1);
    raw.triangles.emplace_back(a, b + 1, a + 1);
    raw.triangles.emplace_back(2 * sectors, b, a);
    raw.triangles.emplace_back(2 * sectors + 1, a + 1, b + 1);
  }
  return raw;
}

struct Counts {
  std::size_t compared = 0, doubtful = 0;
};

// Does a request for `most` contacts get the first of them?
void expectFirst(const fcl::CollisionGeometryd& first, const fcl::Transform3d& X_W1,
                 const fcl::CollisionGeometryd& second, const fcl::Transform3d& X_W2, std::size_t most,
                 const std::vector<Place>& ordered, Counts& counts) {
  if (ordered.size() <= most) return;
  // Rounding decides which of two at the same place is first.
  if (std::get<0>(ordered[most]) - std::get<0>(ordered[most - 1]) < 1e-8) {
    ++counts.doubtful;
    return;
  }
  ++counts.compared;
  const auto few = ask(first, X_W1, second, X_W2, most);
  const auto end = ordered.begin() + static_cast<std::ptrdiff_t>(most);
  ASSERT_EQ(few.size(), most);
  for (const fcl::Contactd& c : few) {
    ASSERT_TRUE(std::any_of(ordered.begin(), end, [&](const Place& p) {
      return std::get<1>(p) == c.b1 && std::get<2>(p) == c.b2;
    })) << most;
  }
}

TEST(FewContacts, AreThoseOfTheLeastPosition) {
  std::mt19937_64 g(17);
  std::uniform_real_distribution<double> u(-1, 1);
  const std::vector<Raw> raws = {test::torus(24), cloud(g), cylinder(0.4, 2.2, 60), test::torus(9)};
  Counts counts;
  for (int round = 0; round < 240; ++round) {
    const std::size_t i = g() % raws.size(), j = (i + 1 + g() % (raws.size() - 1)) % raws.size();
    const Raw &one = raws[i], &two = raws[j];
    const Modeld a(one.mesh(), byPosition()), b(two.mesh(), byPosition());
    const auto other = test::bvh<fcl::OBBRSSd>(two);
    const auto rotation = [&] { return Eigen::Quaterniond(u(g), u(g), u(g), u(g)).normalized().toRotationMatrix(); };
    const Vector3d at(u(g), u(g), u(g));
    const fcl::Transform3d X1 = test::pose<double>(rotation(), at),
                           X2 = test::pose<double>(rotation(), at + Vector3d(u(g), u(g), u(g)));
    const fcl::Transform3d X_12 = X1.inverse(Eigen::Isometry) * X2, same = fcl::Transform3d::Identity();
    const auto check = [&](const fcl::CollisionGeometryd& first, const fcl::Transform3d& X_W1,
                           const fcl::CollisionGeometryd& second, const fcl::Transform3d& X_W2,
                           const std::vector<Place>& ordered) {
      SCOPED_TRACE(round);
      for (const std::size_t most : {1, 7, 20}) expectFirst(first, X_W1, second, X_W2, most, ordered, counts);
    };
    const auto ordered = places(ask(a, X1, b, X2, 1000000), one, same, two, X_12, one);
    ASSERT_NO_FATAL_FAILURE(check(a, X1, b, X2, ordered));
    ASSERT_NO_FATAL_FAILURE(check(a, X1, *other, X2, ordered));
    ASSERT_NO_FATAL_FAILURE(
        check(*other, X2, a, X1, places(ask(*other, X2, a, X1, 1000000), two, X_12, one, same, one)));
  }
  EXPECT_GT(counts.compared, 500u);
  EXPECT_LT(counts.doubtful, counts.compared);
}

TEST(FewContacts, WithinAMarginAreThoseWhoseTriangleOfTheModelEndsFirst) {
  std::mt19937_64 g(19);
  std::uniform_real_distribution<double> u(-1, 1);
  const Raw one = test::torus(24), two = test::torus(9);
  const Vector3d direction = directionOf(*one.mesh());
  const auto other = test::bvh<fcl::OBBRSSd>(two);
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  Options options = byPosition();
  options.margin = 0.05;
  const Modeld a(one.mesh(), options);
  Counts counts;
  for (int round = 0; round < 40; ++round) {
    const fcl::Transform3d X = test::pose<double>(
        Eigen::Quaterniond(u(g), u(g), u(g), u(g)).normalized().toRotationMatrix(), Vector3d(u(g), u(g), u(g)));
    for (const bool is_second : {false, true}) {
      const auto asked = [&](std::size_t most) {
        return is_second ? ask(*other, X, a, I, most) : ask(a, I, *other, X, most);
      };
      std::vector<Place> ordered;
      for (const fcl::Contactd& c : asked(1000000)) {
        query::Corners t;
        takeCorners(one, is_second ? c.b2 : c.b1, I, t);
        ordered.emplace_back(std::max({direction.dot(t[0]), direction.dot(t[1]), direction.dot(t[2])}), c.b1, c.b2);
      }
      std::sort(ordered.begin(), ordered.end());
      SCOPED_TRACE(round);
      for (const std::size_t most : {1, 3, 7, 20}) {
        if (is_second) {
          expectFirst(*other, X, a, I, most, ordered, counts);
        } else {
          expectFirst(a, I, *other, X, most, ordered, counts);
        }
      }
    }
  }
  EXPECT_GT(counts.compared, 50u);
}

// A bumpy sheet across the direction of the order, as large as its mesh or a small part of it: all contacts are within
// a part in 300 of the mesh's size along that direction. What a walk leaves out too early shows there, with the small
// sheet also in leaves.
TEST(FewContacts, AreTheFirstOfManyAtHardlyDifferentPositions) {
  constexpr double kBumps = 0.002;
  std::mt19937_64 g(5);
  std::uniform_real_distribution<double> u(-1, 1);
  const Vector3d normal = Vector3d(1, 0.31, 0.23).normalized();
  const Eigen::Quaterniond turn = Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), normal);
  Counts counts;
  for (int round = 0; round < 40; ++round) {
    const double size = round % 2 == 0 ? 1 : 0.05;
    Raw sheet;
    constexpr std::size_t kSide = 24;
    for (std::size_t i = 0; i <= kSide; ++i) {
      for (std::size_t k = 0; k <= kSide; ++k) {
        const double x = 2.0 * static_cast<double>(i) / kSide - 1, y = 2.0 * static_cast<double>(k) / kSide - 1;
        sheet.vertices.push_back(turn * Vector3d(0.8 * size * x, 0.8 * size * y, kBumps * u(g)));
        if (i == 0 || k == 0) continue;
        const std::size_t v = sheet.vertices.size() - 1;
        sheet.triangles.emplace_back(v, v - 1, v - kSide - 2);
        sheet.triangles.emplace_back(v, v - kSide - 2, v - kSide - 1);
      }
    }
    Raw pieces;
    for (int i = 0; i < 150; ++i) {
      const Vector3d at = turn * (size * Vector3d(0.7 * u(g), 0.7 * u(g), 0.05 * u(g)));
      const auto corner = [&] { return Vector3d(at + 0.1 * size * Vector3d(u(g), u(g), u(g))); };
      pieces.addTriangle(corner(), corner(), corner());
    }
    // So x is the longest axis of each.
    for (Raw* raw : {&sheet, &pieces}) {
      for (const double x : {-1.1, 1.1}) raw->addTriangle({x, 0, 0}, {x, 0.01, 0}, {x, 0, 0.01});
    }
    const Modeld a(sheet.mesh(), byPosition()), b(pieces.mesh(), byPosition());
    const auto same = fcl::Transform3d::Identity();
    const fcl::Transform3d X =
        test::pose<double>(Eigen::AngleAxisd(1e-3 * u(g), Vector3d(u(g), u(g), u(g)).normalized()).toRotationMatrix(),
                           {0.01 * size, 0, 0});
    const fcl::Transform3d back = X.inverse(Eigen::Isometry);
    SCOPED_TRACE(round);
    for (const std::size_t most : {1, 7, 40}) {
      expectFirst(a, same, b, X, most, places(ask(a, same, b, X, 1000000), sheet, same, pieces, X, sheet), counts);
      expectFirst(b, X, a, same, most, places(ask(b, X, a, same, 1000000), pieces, same, sheet, back, pieces), counts);
    }
  }
  EXPECT_GT(counts.compared, 80u);
}

// A large triangle ends no earlier than any small one on it: the small ones are in the order of their own ends.
TEST(FewContacts, OfFlatFacesOnEachOther) {
  std::mt19937_64 g(23);
  std::uniform_real_distribution<double> u(-1, 1);
  Counts counts;
  for (int round = 0; round < 20; ++round) {
    const Raw block = test::box({-1, -0.9, -0.2}, {1, 0.9, 0});
    Raw grid;
    constexpr std::size_t kSide = 20;
    for (std::size_t i = 0; i <= kSide; ++i) {
      for (std::size_t k = 0; k <= kSide; ++k) {
        grid.vertices.emplace_back(1.7 * static_cast<double>(i) / kSide - 0.9, 1.5 * static_cast<double>(k) / kSide, 0);
        if (i == 0 || k == 0) continue;
        const std::size_t v = grid.vertices.size() - 1;
        grid.triangles.emplace_back(v, v - 1, v - kSide - 2);
        grid.triangles.emplace_back(v, v - kSide - 2, v - kSide - 1);
      }
    }
    const Modeld a(block.mesh(), byPosition()), b(grid.mesh(), byPosition()), c(block.mesh()), d(grid.mesh());
    const auto partner = test::bvh<fcl::OBBRSSd>(grid);
    const auto same = fcl::Transform3d::Identity();
    const fcl::Transform3d X =
        test::pose<double>(Eigen::AngleAxisd(0.5 * u(g), Vector3d::UnitZ()).toRotationMatrix(), {0.1 * u(g), 0, 0});
    SCOPED_TRACE(round);
    for (const std::size_t most : {1, 5, 50}) {
      const auto ordered = places(ask(a, same, b, X, 1000000), block, same, grid, X, block);
      EXPECT_GT(ordered.size(), 100u);
      expectFirst(a, same, b, X, most, ordered, counts);
      expectFirst(a, same, *partner, X, most, ordered, counts);
      EXPECT_EQ(idsOf(ask(c, same, d, X, most)), idsOf(ask(a, same, b, X, most))) << "no walk in order";
      expectFirst(b, X, a, same, most,
                  places(ask(b, X, a, same, 1000000), grid, same, block, X.inverse(Eigen::Isometry), grid), counts);
    }
  }
  EXPECT_GT(counts.compared, 30u);
}

// A triangle and a body are where the first of them ends, whatever nodes a tree has: many cells lie on one triangle,
// and octants have parts of triangles.
TEST(FewContacts, BesideCellsAndShapes) {
  std::mt19937_64 g(29);
  std::uniform_real_distribution<double> u(-1, 1);
  const auto map = test::cloudMap(7, 4000, 0.05);
  const auto octree = test::cloud<double>(map);
  const auto* const root = octree->getRoot();
  std::map<std::intptr_t, std::pair<Vector3d, double>> cells;
  for (auto leaf = map->begin(), end = map->end(); leaf != end; ++leaf) {
    cells[&*leaf - root] = {{leaf.getX(), leaf.getY(), leaf.getZ()}, leaf.getSize() / 2};
  }
  const fcl::Boxd box(0.9, 0.7, 0.5);
  Counts counts;
  for (int round = 0; round < 60; ++round) {
    const Raw raw = round % 3 == 0   ? test::box({-1, -0.7, -0.2}, {1, 0.7, 0.1})
                    : round % 3 == 1 ? cloud(g)
                                     : test::torus(9);
    const auto mesh = raw.mesh();
    Options octree_options = byPosition();
    octree_options.subdivision = Subdivision::kOctree;
    Modeld model(mesh, byPosition()), fresh(mesh, byPosition()), octants(mesh, octree_options);
    model.buildTree();
    octants.expandAll(3 + round % 5);
    const auto rotation = [&] { return Eigen::Quaterniond(u(g), u(g), u(g), u(g)).normalized().toRotationMatrix(); };
    const fcl::Transform3d X1 = test::pose<double>(rotation(), {u(g), u(g), u(g)}),
                           X2 = X1 * test::pose<double>(rotation(), Vector3d(u(g), u(g), u(g)) / 2),
                           to_model = X1.inverse(Eigen::Isometry) * X2;
    const Vector3d direction = directionOf(*mesh);
    for (const bool is_octree : {true, false}) {
      const auto endOf = [&](std::intptr_t id) {
        const auto [center, half] = is_octree ? cells.at(id) : std::pair(Vector3d(0, 0, 0), 0.0);
        const Vector3d extents = is_octree ? Vector3d(half, half, half) : Vector3d(0.45, 0.35, 0.25);
        return direction.dot(to_model * center) + (to_model.linear().transpose() * direction).cwiseAbs().dot(extents);
      };
      const fcl::CollisionGeometryd& body = is_octree ? static_cast<const fcl::CollisionGeometryd&>(*octree)
                                                      : static_cast<const fcl::CollisionGeometryd&>(box);
      for (const bool is_second : {false, true}) {
        const auto asked = [&](std::size_t most) {
          return is_second ? ask(body, X2, model, X1, most) : ask(model, X1, body, X2, most);
        };
        std::vector<Place> ordered;
        for (const fcl::Contactd& c : asked(1000000)) {
          query::Corners t;
          takeCorners(raw, is_second ? c.b2 : c.b1, fcl::Transform3d::Identity(), t);
          const double end = std::max({direction.dot(t[0]), direction.dot(t[1]), direction.dot(t[2])});
          ordered.emplace_back(std::min(end, endOf(is_second ? c.b1 : c.b2)), c.b1, c.b2);
        }
        std::sort(ordered.begin(), ordered.end());
        SCOPED_TRACE(round);
        for (const std::size_t most : {1, 5, 50}) {
          for (const Modeld* asked_one : {&fresh, &model, &octants}) {
            if (is_second) {
              expectFirst(body, X2, *asked_one, X1, most, ordered, counts);
            } else {
              expectFirst(*asked_one, X1, body, X2, most, ordered, counts);
            }
          }
        }
      }
    }
  }
  EXPECT_GT(counts.compared, 200u);
}

// Of two models whose hulls overlap deeply: those that a walk in order over complete trees finds.

struct DeepPairs {
  DeepPairs() {
    std::mt19937_64 g(31);
    std::uniform_real_distribution<double> u(-1, 1);
    for (int i = 0; i < 30; ++i) {
      const Eigen::Quaterniond q(u(g), u(g), u(g), u(g));
      poses.push_back(test::pose<double>(q.normalized().toRotationMatrix(), 0.7 * Vector3d(u(g), u(g), u(g))));
    }
  }

  Ids ask(const fcl::CollisionGeometryd& a, const fcl::CollisionGeometryd& b, std::size_t i, std::size_t most) const {
    return idsOf(bocst::ask(a, fcl::Transform3d::Identity(), b, poses[i], most));
  }

  const Raw one = test::torus(40), two = test::torus(23, 0.2);
  std::vector<fcl::Transform3d> poses;
};

Options within(double margin, Options options = {}) {
  options.margin = margin;
  return options;
}

class FewContactsWithin : public testing::TestWithParam<double> {};

TEST_P(FewContactsWithin, OfDeepPairsAreSomeOfAllWhateverHappenedBefore) {
  const DeepPairs pairs;
  const Options options = within(GetParam());
  std::size_t others = 0, asked = 0;
  for (const std::size_t most : {1, 5, 60}) {
    const Modeld a(pairs.one.mesh(), options), b(pairs.two.mesh(), options);
    const Modeld placed_a(pairs.one.mesh(), within(GetParam(), byPosition())),
        placed_b(pairs.two.mesh(), within(GetParam(), byPosition()));
    for (std::size_t i = 0; i < pairs.poses.size(); ++i) {
      const Ids few = pairs.ask(a, b, i, most), all = pairs.ask(a, b, i, 1000000);
      ASSERT_TRUE(std::is_sorted(few.begin(), few.end()));
      ASSERT_TRUE(std::includes(all.begin(), all.end(), few.begin(), few.end()));
      ASSERT_EQ(few.size(), std::min(most, all.size()));
      others += few != pairs.ask(placed_a, placed_b, i, most);
      ++asked;
      // Other models: new ones; some that grew by other queries; complete ones; some that lost branches.
      const Modeld c(pairs.one.mesh(), options), d(pairs.two.mesh(), options);
      ASSERT_EQ(pairs.ask(c, d, i, most), few) << i;
      Modeld e(pairs.one.mesh(), options), f(pairs.two.mesh(), options);
      test::touching<double>(e, fcl::Transform3d::Identity(), f, pairs.poses[(i + 1) % pairs.poses.size()]);
      f.buildTree();
      ASSERT_EQ(pairs.ask(e, f, i, most), few) << i;
      Clock::time_point now = Clock::now();
      for (const int levels : {1, 2, 5, 20}) {
        for (int k = 0; k < levels; ++k) e.prune(now += std::chrono::hours(1));
        ASSERT_EQ(pairs.ask(e, f, i, most), few) << i;
      }
      e.expandAll(4);
      ASSERT_EQ(pairs.ask(e, f, i, most), few) << i;
    }
  }
  EXPECT_GT(others, asked / 2) << "so they were not chosen by position";
}

void expectTheSameBeside(const DeepPairs& pairs, const fcl::CollisionGeometryd& partner, double margin) {
  std::size_t others = 0, asked = 0;
  for (const bool is_second : {false, true}) {
    const auto askOf = [&](const Modeld& model, std::size_t i, std::size_t most) {
      return is_second ? pairs.ask(partner, model, i, most) : pairs.ask(model, partner, i, most);
    };
    for (const std::size_t most : {1, 5, 60}) {
      const Modeld a(pairs.one.mesh(), within(margin)), placed(pairs.one.mesh(), within(margin, byPosition()));
      for (std::size_t i = 0; i < pairs.poses.size(); ++i) {
        const Ids few = askOf(a, i, most), all = askOf(a, i, 1000000);
        ASSERT_TRUE(std::is_sorted(few.begin(), few.end()));
        ASSERT_TRUE(std::includes(all.begin(), all.end(), few.begin(), few.end()));
        ASSERT_EQ(few.size(), std::min(most, all.size()));
        others += few != askOf(placed, i, most);
        ++asked;
        if (is_second) {
          Ids turned = idsOf(ask(a, pairs.poses[i], partner, fcl::Transform3d::Identity(), most));
          for (auto& [b1, b2] : turned) std::swap(b1, b2);
          std::sort(turned.begin(), turned.end());
          ASSERT_EQ(turned, few) << i;
        }
        Modeld b(pairs.one.mesh(), within(margin));
        ASSERT_EQ(askOf(b, i, most), few) << i;
        Clock::time_point now = Clock::now();
        for (const int levels : {1, 2, 5, 20}) {
          for (int k = 0; k < levels; ++k) b.prune(now += std::chrono::hours(1));
          askOf(b, (i + 1) % pairs.poses.size(), 1000000);
          ASSERT_EQ(askOf(b, i, most), few) << i;
        }
        b.expandAll(4);
        ASSERT_EQ(askOf(b, i, most), few) << i;
      }
    }
  }
  EXPECT_GT(others, asked / 2) << "so they were not chosen by position";
}

TEST_P(FewContactsWithin, BesideOtherPartnersAreSomeOfAllWhateverHappenedBefore) {
  const DeepPairs pairs;
  expectTheSameBeside(pairs, *test::bvh<fcl::OBBRSSd>(pairs.two), GetParam());
  expectTheSameBeside(pairs, *test::bvh<fcl::AABBd>(pairs.two), GetParam());
  expectTheSameBeside(pairs, *test::cloud<double>(test::cloudMap(8, 3000, 0.04)), GetParam());
}

INSTANTIATE_TEST_SUITE_P(Margins, FewContactsWithin, testing::Values(0, 0.03));

// Hundreds of leaves overlap and few triangles touch, so the walk in order gives up; what it found until then is
// forgotten.
TEST(FewContacts, AfterAWalkInOrderThatGivesUpAreThoseOfTheLeastPosition) {
  std::mt19937_64 g(41);
  std::uniform_real_distribution<double> u(-1, 1);
  const auto soup = [&] {
    Raw raw;
    for (int i = 0; i < 8000; ++i) {
      const Vector3d at(u(g), u(g), u(g));
      const auto corner = [&] { return Vector3d(at + 0.024 * Vector3d(u(g), u(g), u(g))); };
      raw.addTriangle(corner(), corner(), corner());
    }
    return raw;
  };
  constexpr std::size_t kRounds = 20;
  std::size_t same_of_models = 0, same_of_bvh = 0, many = 0;
  for (std::size_t round = 0; round < kRounds; ++round) {
    const Raw one = soup(), two = soup();
    const Modeld a(one.mesh()), b(two.mesh()), c(one.mesh(), byPosition()), d(two.mesh(), byPosition());
    const auto bvh = test::bvh<fcl::OBBRSSd>(two);
    const auto I = fcl::Transform3d::Identity();
    const fcl::Transform3d X = test::pose<double>(test::randomRotation(g), Vector3d(u(g), u(g), u(g)) / 4);
    const std::size_t most = 4 + round % 4;
    many += ask(a, I, b, X, 1000).size() > most;
    const Ids expected = idsOf(ask(c, I, d, X, most));
    same_of_models += idsOf(ask(a, I, b, X, most)) == expected;
    same_of_bvh += idsOf(ask(a, I, *bvh, X, most)) == expected;
  }
  EXPECT_GT(many, kRounds * 9 / 10);
  EXPECT_GT(same_of_models, kRounds * 9 / 10);
  EXPECT_GT(same_of_bvh, kRounds * 9 / 10);
}

TEST(FewContacts, OfPairsThatDoNotTouchNeedNoWholeTree) {
  const Raw ring = test::torus(80);  // so large that growth begins by parts
  const Modeld a(ring.mesh()), b(Raw(ring).scale(0.2).mesh());
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  EXPECT_TRUE(ask(a, I, b, I, 1).empty()) << "a ring in the hole of another";
  EXPECT_FALSE(fcl_adapter::treeOf(a).isComplete());
  EXPECT_FALSE(ask(a, I, b, test::pose<double>(Eigen::Matrix3d::Identity(), {0.4, 0, 0}), 1).empty());
  EXPECT_TRUE(fcl_adapter::treeOf(a).isComplete());
  const Modeld c(ring.mesh());
  const auto bvh = test::bvh<fcl::OBBRSSd>(Raw(ring).scale(0.2));
  EXPECT_TRUE(ask(c, I, *bvh, I, 1).empty());
  EXPECT_FALSE(fcl_adapter::treeOf(c).isComplete());
  EXPECT_FALSE(ask(c, I, *bvh, test::pose<double>(Eigen::Matrix3d::Identity(), {0.4, 0, 0}), 1).empty());
  EXPECT_TRUE(fcl_adapter::treeOf(c).isComplete());
}

// Which of the trees are built whole, and which contacts are first, is the same on each instruction set.
class FewContactsOnTarget : public test::EveryTarget {
 protected:
  static std::vector<Ids> answers() {
    const DeepPairs pairs;
    const Modeld a(pairs.one.mesh()), b(pairs.two.mesh());
    const auto bvh = test::bvh<fcl::OBBRSSd>(pairs.two);
    static const auto octree = test::cloud<double>(test::cloudMap(8, 3000, 0.04));  // ids depend on where it is
    std::vector<Ids> found;
    for (std::size_t i = 0; i < pairs.poses.size(); ++i) {
      for (const std::size_t most : {1, 5, 60}) {
        found.push_back(pairs.ask(a, b, i, most));
        found.push_back(pairs.ask(a, *bvh, i, most));
        found.push_back(pairs.ask(a, *octree, i, most));
      }
    }
    return found;
  }
};

TEST_P(FewContactsOnTarget, AreTheSame) {
  static const std::vector<Ids> expected = answers();
  EXPECT_EQ(answers(), expected);
}

INSTANTIATE_TEST_SUITE_P(Targets, FewContactsOnTarget, testing::ValuesIn(test::EveryTarget::targets()),
                         test::EveryTarget::name);

// What changes in each frame, and what is large, is not built whole for a contact.
TEST(FewContacts, OfVerticesThatChangedAreThoseOfTheLeastPosition) {
  const DeepPairs pairs;
  Modeld a(pairs.one.mesh());
  const Modeld b(pairs.two.mesh());
  a.updateVertices(pairs.one.vertices);
  const Modeld placed_a(pairs.one.mesh(), byPosition()), placed_b(pairs.two.mesh(), byPosition());
  const auto bvh = test::bvh<fcl::OBBRSSd>(pairs.two);
  for (std::size_t i = 0; i < pairs.poses.size(); ++i) {
    EXPECT_EQ(pairs.ask(a, b, i, 5), pairs.ask(placed_a, placed_b, i, 5)) << i;
    EXPECT_EQ(pairs.ask(a, *bvh, i, 5), pairs.ask(placed_a, *bvh, i, 5)) << i;
  }
}

TEST(FewContacts, OfLargeMeshesAreThoseOfTheLeastPosition) {
  const DeepPairs pairs;
  const std::shared_ptr<const Mesh> large = test::torus(363).mesh();
  const Modeld a(large), b(pairs.two.mesh()), placed_a(large, byPosition()), placed_b(pairs.two.mesh(), byPosition());
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(pairs.ask(a, b, i, 5), pairs.ask(placed_a, placed_b, i, 5)) << i;
  }
}
// Small parts beside a plate's fine grid: each pair of leaves has many pairs of triangles in doubt.
TEST(FewContacts, BesideABvhModelOfFlatFacesPayForOrientedBoxes) {
  const Raw ground = test::box({-1, -1, -1}, {1, 1, 0});
  Raw part = test::plate(14);
  part.addTriangle({1.2, 0, 0}, {1.2, 0.1, 0}, {1.2, 0, -0.5});  // beside the ground, so that the outlines overlap
  const auto bvh = test::bvh<fcl::OBBRSSd>(part);
  Modeld model(ground.mesh());
  const fcl::Transform3d I = fcl::Transform3d::Identity(),
                         X = test::pose<double>(Eigen::Matrix3d::Identity(), {0.013, 0.007, 1e-7});
  model.buildTree();
  ASSERT_GT(fcl_adapter::treeOf(model).boxPrice(), 0u);
  for (int k = 0; k < 2000 && fcl_adapter::treeOf(model).boxPrice() > 0; ++k)
    EXPECT_TRUE(ask(model, I, *bvh, X, 5).empty());
  EXPECT_EQ(fcl_adapter::treeOf(model).boxPrice(), 0u);
}

// Next to parallel faces, too many leaves are in doubt for a walk in order to reach the place where they touch.
TEST(FewContacts, OfFacesThatHardlyTouchAreThoseOfTheLeastPosition) {
  const Raw plate = test::plate(64);
  const auto bvh = test::bvh<fcl::OBBRSSd>(plate);
  const auto map = std::make_shared<octomap::OcTree>(0.02);
  for (float x = -0.61f; x < 0.6f; x += 0.02f) {
    for (float y = -0.61f; y < 0.6f; y += 0.02f) map->updateNode(octomap::point3d(x, y, -0.01f), true);
  }
  const auto octree = test::cloud<double>(map);
  // Fins that touch nothing, so that the outlines overlap by more than a little.
  const auto withFin = [](Raw raw, double x) {
    raw.addTriangle({x, -0.1, 0}, {x, 0.1, 0}, {x, 0, -0.5});
    return raw;
  };
  const Modeld smaller(withFin(Raw(plate).scale(0.7), -0.3).mesh());
  const fcl::Transform3d I = fcl::Transform3d::Identity(),
                         X = test::pose<double>(Eigen::Matrix3d::Identity(), {0.013, 0.007, 1e-9});
  std::size_t touching = 0;
  for (const std::size_t bump : {0, 1000, 4000}) {
    Raw with_bump = plate;
    with_bump.vertices[bump].z() = -1e-3;
    with_bump = withFin(with_bump, 0.4);
    const Modeld a(with_bump.mesh()), placed_a(with_bump.mesh(), byPosition());
    for (const fcl::CollisionGeometryd* partner :
         std::initializer_list<const fcl::CollisionGeometryd*>{&*bvh, &*octree, &smaller}) {
      for (const std::size_t most : {1, 60}) {
        const Ids few = idsOf(ask(a, X, *partner, I, most));
        EXPECT_EQ(few, idsOf(ask(placed_a, X, *partner, I, most))) << bump << " " << most;
        touching += !few.empty();
      }
    }
  }
  EXPECT_EQ(touching, 14u);
}

// As many pairs of triangles are in doubt as touch.
TEST(FewContacts, OfCopiesAtOnePlaceAreThoseOfTheLeastPosition) {
  const DeepPairs pairs;
  const Modeld a(pairs.one.mesh()), b(pairs.one.mesh());
  const Modeld placed_a(pairs.one.mesh(), byPosition()), placed_b(pairs.one.mesh(), byPosition());
  const auto I = fcl::Transform3d::Identity();
  const auto X = test::pose<double>(Eigen::Matrix3d::Identity(), {1e-3, 0, 0});
  EXPECT_EQ(idsOf(ask(a, I, b, X, 5)), idsOf(ask(placed_a, I, placed_b, X, 5)));
}

}  // namespace
}  // namespace bocst
