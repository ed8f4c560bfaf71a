// SPDX-License-Identifier: BSD-3-Clause
// Which of many contacts a request for few gets: the documented order, computed pair by pair.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <tuple>
#include <vector>

#include "conformance/reference.h"
#include "geometry/triangle.h"

namespace bocst {
namespace {

using Eigen::Vector3d;
using test::Raw;

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
// mesh whose frame counts, that of the first geometry or the second.
std::vector<Place> places(const std::vector<fcl::Contactd>& all, const Raw& one, const fcl::Transform3d& in_ordering1,
                          const Raw& two, const fcl::Transform3d& in_ordering2, const Raw& ordering) {
  const Vector3d direction = directionOf(*ordering.mesh());
  std::vector<Place> ordered;
  for (const fcl::Contactd& c : all) {
    query::Corners p, q;
    takeCorners(one, c.b1, in_ordering1, p);
    takeCorners(two, c.b2, in_ordering2, q);
    const query::Corners& own = &ordering == &one ? p : q;
    const double most = std::max({direction.dot(own[0]), direction.dot(own[1]), direction.dot(own[2])});
    const auto place = query::nearEndOfCut(p, q, direction, 1e-5);
    if (place.has_value() != query::nearEndOfCut(p, q, direction, 1e-8).has_value()) return {};
    ordered.emplace_back(place.value_or(most), c.b1, c.b2);
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

TEST(FewContacts, AreThoseOfTheLeastPosition) {
  std::mt19937_64 g(17);
  std::uniform_real_distribution<double> u(-1, 1);
  const std::vector<Raw> raws = {test::torus(24), cloud(g), cylinder(0.4, 2.2, 60), test::torus(9)};
  std::size_t compared = 0, doubtful = 0;
  for (int round = 0; round < 240; ++round) {
    const std::size_t i = g() % raws.size(), j = (i + 1 + g() % (raws.size() - 1)) % raws.size();
    const Raw &one = raws[i], &two = raws[j];
    const Modeld a(one.mesh()), b(two.mesh());
    const auto other = test::bvh<fcl::OBBRSSd>(two);
    const auto rotation = [&] { return Eigen::Quaterniond(u(g), u(g), u(g), u(g)).normalized().toRotationMatrix(); };
    const Vector3d at(u(g), u(g), u(g));
    const fcl::Transform3d X1 = test::pose<double>(rotation(), at),
                           X2 = test::pose<double>(rotation(), at + Vector3d(u(g), u(g), u(g)));
    const fcl::Transform3d X_12 = X1.inverse(Eigen::Isometry) * X2, same = fcl::Transform3d::Identity();
    const auto check = [&](const fcl::CollisionGeometryd& first, const fcl::Transform3d& X_W1,
                           const fcl::CollisionGeometryd& second, const fcl::Transform3d& X_W2,
                           const std::vector<Place>& ordered) {
      for (const std::size_t most : {std::size_t{1}, std::size_t{7}}) {
        if (ordered.size() <= most) continue;
        // Rounding decides which of two at the same place is first.
        if (std::get<0>(ordered[most]) - std::get<0>(ordered[most - 1]) < 1e-8) {
          ++doubtful;
          continue;
        }
        ++compared;
        const auto few = ask(first, X_W1, second, X_W2, most);
        const auto end = ordered.begin() + static_cast<std::ptrdiff_t>(most);
        ASSERT_EQ(few.size(), most);
        for (const fcl::Contactd& c : few) {
          ASSERT_TRUE(std::any_of(ordered.begin(), end,
                                  [&](const Place& p) { return std::get<1>(p) == c.b1 && std::get<2>(p) == c.b2; }))
              << "round " << round << ", " << most;
        }
      }
    };
    const auto ordered = places(ask(a, X1, b, X2, 1000000), one, same, two, X_12, one);
    ASSERT_NO_FATAL_FAILURE(check(a, X1, b, X2, ordered));
    ASSERT_NO_FATAL_FAILURE(check(a, X1, *other, X2, ordered));
    ASSERT_NO_FATAL_FAILURE(
        check(*other, X2, a, X1, places(ask(*other, X2, a, X1, 1000000), two, X_12, one, same, one)));
  }
  EXPECT_GT(compared, 500u);
  EXPECT_LT(doubtful, compared);
}

}  // namespace
}  // namespace bocst
