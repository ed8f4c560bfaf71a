// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>

#include "every_target.h"
#include "mesh/scan.h"
#include "meshes.h"

namespace bocst {
namespace {

using test::Raw;

std::string messageOf(const Raw& raw) {
  try {
    raw.mesh();
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "";
}

TEST(Mesh, KeepsWhatItIsGiven) {
  const Raw raw = test::box({-1, 0, 2}, {1, 3, 5});
  const auto mesh = raw.mesh();
  ASSERT_EQ(mesh->vertexCount(), raw.vertices.size());
  ASSERT_EQ(mesh->triangleCount(), raw.triangles.size());
  for (std::size_t i = 0; i < raw.vertices.size(); ++i) EXPECT_EQ(mesh->vertex(i), raw.vertices[i]);
  for (std::size_t t = 0; t < raw.triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(mesh->triangle(t)[k], raw.triangles[t][k]);
  }
  EXPECT_EQ(mesh->bounds().min(), Eigen::Vector3d(-1, 0, 2));
  EXPECT_EQ(mesh->bounds().max(), Eigen::Vector3d(1, 3, 5));
}

TEST(Mesh, UnusedVerticesDoNotCount) {
  Raw raw = test::box({0, 0, 0}, {1, 1, 1});
  raw.vertices.emplace_back(100, 100, 100);
  EXPECT_EQ(raw.mesh()->bounds().max(), Eigen::Vector3d(1, 1, 1));
}

TEST(Mesh, BoundsOfMeshesLargerThanABlock) {
  const Raw raw = test::torus(50);
  Eigen::AlignedBox3d expected;
  for (const Eigen::Vector3d& v : raw.vertices) expected.extend(v);
  EXPECT_EQ(raw.mesh()->bounds().min(), expected.min());
  EXPECT_EQ(raw.mesh()->bounds().max(), expected.max());
  // A stray vertex at any place, beyond any face, alone or beside one that is used.
  for (const std::size_t place : {std::size_t{0}, raw.vertices.size() / 2, raw.vertices.size()}) {
    for (int face = 0; face < 6; ++face) {
      Raw stray = raw;
      for (auto& t : stray.triangles) {
        for (std::size_t k = 0; k < 3; ++k) t[k] += t[k] >= place;
      }
      Eigen::Vector3d v = expected.center();
      v[face % 3] = face < 3 ? -5 : 5;
      stray.vertices.insert(stray.vertices.begin() + static_cast<std::ptrdiff_t>(place), v);
      EXPECT_EQ(stray.mesh()->bounds().min(), expected.min());
      EXPECT_EQ(stray.mesh()->bounds().max(), expected.max());
      stray.vertices[place][face % 3] = face < 3 ? expected.min()[face] : expected.max()[face % 3];
      EXPECT_EQ(stray.mesh()->bounds().min(), expected.min());
      EXPECT_EQ(stray.mesh()->bounds().max(), expected.max());
    }
  }
}

TEST(Mesh, SharesTrianglesWithOtherVertices) {
  const Raw raw = test::torus(30);
  const auto mesh = raw.mesh();
  Raw moved = raw;
  moved.scale(3).move({1, 2, 3});
  const auto other = mesh->withVertices(moved.vertices);
  EXPECT_EQ(other->triangles().data(), mesh->triangles().data());
  EXPECT_EQ(other->vertices(), moved.vertices);
  EXPECT_EQ(other->bounds().min(), moved.mesh()->bounds().min());
  EXPECT_EQ(other->bounds().max(), moved.mesh()->bounds().max());
  moved.vertices[7].y() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(mesh->withVertices(moved.vertices), std::invalid_argument);
  moved.vertices = raw.vertices;
  moved.vertices.pop_back();
  EXPECT_THROW(mesh->withVertices(moved.vertices), std::invalid_argument);
}

TEST(Mesh, NamesTheFirstThatIsBadInALargeMesh) {
  const Raw raw = test::torus(50);
  for (const std::size_t i :
       {std::size_t{0}, std::size_t{511}, std::size_t{512}, std::size_t{2497}, std::size_t{2499}}) {
    Raw number = raw;
    number.vertices[i].z() = std::numeric_limits<double>::quiet_NaN();
    number.vertices.back().x() = -1e76;
    EXPECT_NE(messageOf(number).find("vertex " + std::to_string(i) + " "), std::string::npos) << messageOf(number);
  }
  for (const std::size_t t : {std::size_t{0}, std::size_t{1023}, std::size_t{1024}, std::size_t{4999}}) {
    for (const std::size_t index : {raw.vertices.size(), std::size_t{0xffffffff}, std::size_t{0x100000000}}) {
      Raw wrong = raw;
      wrong.triangles[t][2] = index;
      wrong.triangles.back()[2] = index;
      EXPECT_NE(messageOf(wrong).find("triangle " + std::to_string(t) + " has vertex index " + std::to_string(index)),
                std::string::npos)
          << messageOf(wrong);
    }
  }
}

TEST(Mesh, NamesWhatIsBad) {
  Raw raw = test::box({0, 0, 0}, {1, 1, 1});
  EXPECT_EQ(messageOf(raw), "");

  Raw empty = raw;
  empty.triangles.clear();
  EXPECT_NE(messageOf(empty).find("no triangles"), std::string::npos);
  EXPECT_NE(messageOf(Raw()).find("no triangles"), std::string::npos);

  Raw index = raw;
  index.triangles[7][1] = 8;
  EXPECT_NE(messageOf(index).find("triangle 7"), std::string::npos) << messageOf(index);
  EXPECT_NE(messageOf(index).find("index 8"), std::string::npos) << messageOf(index);
  index.triangles[7][1] = std::numeric_limits<std::size_t>::max();
  EXPECT_NE(messageOf(index).find("triangle 7"), std::string::npos);

  for (const double x : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
                         -std::numeric_limits<double>::infinity(), 1e200}) {
    for (int k = 0; k < 3; ++k) {
      Raw number = raw;
      number.vertices[5][k] = x;
      EXPECT_NE(messageOf(number).find("vertex 5"), std::string::npos) << messageOf(number);
    }
  }
}

TEST(Mesh, CoordinatesUpToTheLimitAreLegal) {
  for (const Raw& raw : {test::box({0, 0, 0}, {1, 1, 1}), test::torus(50)}) {
    for (const double sign : {1.0, -1.0}) {
      for (std::size_t i = 0; i < raw.vertices.size(); i += 1 + raw.vertices.size() / 7) {
        Raw large = raw;
        large.vertices[i].y() = sign * 1e75;
        EXPECT_EQ(messageOf(large), "");
        large.vertices[i].y() = sign * std::nextafter(1e75, 1e76);
        EXPECT_NE(messageOf(large).find("vertex " + std::to_string(i) + " "), std::string::npos) << messageOf(large);
        EXPECT_NE(messageOf(large).find("at most 1e75"), std::string::npos) << messageOf(large);
      }
    }
  }
}

TEST(Mesh, DegenerateTrianglesAreLegal) {
  EXPECT_EQ(messageOf(test::adversarial()), "");
  Raw point;
  point.vertices.assign(3, Eigen::Vector3d(1, 2, 3));
  point.triangles.emplace_back(0, 1, 2);
  EXPECT_EQ(messageOf(point), "");
}

using test::EveryTarget;

TEST_P(EveryTarget, ValuesAreFoundWhereverTheyAre) {
  for (std::uint32_t count = 0; count <= 70; ++count) {
    std::vector<std::uint32_t> values(count);
    for (std::uint32_t i = 0; i < count; ++i) values[i] = 2 * i + 1;
    ASSERT_FALSE(contains(values.data(), count, 0x80000001u));
    ASSERT_EQ(largest(values.data(), count), count == 0 ? 0 : 2 * count - 1);
    for (std::uint32_t i = 0; i < count; ++i) {
      ASSERT_TRUE(contains(values.data(), count, values[i])) << "value " << i << " of " << count;
      ASSERT_FALSE(contains(values.data(), count, values[i] + 1));
      std::vector<std::uint32_t> one = values;
      one[i] = 0xffff0000u + i;
      ASSERT_EQ(largest(one.data(), count), one[i]) << "value " << i << " of " << count;
    }
  }
}

TEST_P(EveryTarget, BoxesOfPointsAreThoseOfTheirCoordinates) {
  std::mt19937_64 g(6);
  std::uniform_real_distribution<double> u(-3, 3);
  for (std::size_t count = 0; count <= 30; ++count) {
    std::vector<double> points(3 * count);
    for (double& x : points) x = u(g);
    double lo[3] = {0.5, -2, 1}, hi[3] = {0.75, -1, 2}, expected_lo[3], expected_hi[3];
    for (std::size_t k = 0; k < 3; ++k) {
      expected_lo[k] = lo[k];
      expected_hi[k] = hi[k];
      for (std::size_t i = k; i < points.size(); i += 3) {
        expected_lo[k] = std::min(expected_lo[k], points[i]);
        expected_hi[k] = std::max(expected_hi[k], points[i]);
      }
    }
    ASSERT_TRUE(widenByPoints(points.data(), count, 3, lo, hi));
    for (std::size_t k = 0; k < 3; ++k) {
      ASSERT_EQ(lo[k], expected_lo[k]) << count << " points";
      ASSERT_EQ(hi[k], expected_hi[k]) << count << " points";
    }
    for (std::size_t i = 0; i < points.size(); ++i) {
      for (const double bad : {3.0000001, -3.0000001, std::numeric_limits<double>::quiet_NaN()}) {
        std::vector<double> other = points;
        other[i] = bad;
        ASSERT_FALSE(widenByPoints(other.data(), count, 3, lo, hi))
            << "coordinate " << i << " of " << count << " points";
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Targets, EveryTarget, testing::ValuesIn(EveryTarget::targets()), EveryTarget::name);

}  // namespace
}  // namespace bocst
