// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <limits>
#include <string>

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

TEST(Mesh, DegenerateTrianglesAreLegal) {
  EXPECT_EQ(messageOf(test::adversarial()), "");
  Raw point;
  point.vertices.assign(3, Eigen::Vector3d(1, 2, 3));
  point.triangles.emplace_back(0, 1, 2);
  EXPECT_EQ(messageOf(point), "");
}

}  // namespace
}  // namespace bocst
