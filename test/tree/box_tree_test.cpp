// SPDX-License-Identifier: BSD-3-Clause
// Oriented boxes: each triangle has a leaf, and all boxes above it contain it, tightly where it is long and thin.
#include "tree/box_tree.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>
#include <vector>

#include "oracle/surfaces.h"

namespace bocst::tree {
namespace {

using Eigen::Vector3d;
using oracle::surfaceOf;
using Random = std::mt19937_64;

double uniform(Random& g, double lo, double hi) { return std::uniform_real_distribution<double>(lo, hi)(g); }

class Check {
 public:
  explicit Check(const oracle::Surface& surface) : surface_(surface), tree_(surface) {}

  void run() {
    leaves_.assign(surface_.triangle_count, 0);
    const std::size_t end = visit(0, 0);
    EXPECT_EQ(end, tree_.nodes().size());
    const std::size_t bytes =
        tree_.nodes().size() * sizeof(BoxTree::Node) + tree_.triangles().size() * sizeof(std::uint32_t);
    EXPECT_LE(bytes, tree_.bytes());
    EXPECT_GE(bytes, tree_.bytes() / 2);
    EXPECT_EQ(tree_.bytes(), BoxTree::bytesOf(surface_.triangle_count));
    for (const int leaves : leaves_) EXPECT_EQ(leaves, 1);
    EXPECT_LE(depth_, 2 + static_cast<int>(std::ceil(std::log2(static_cast<double>(surface_.triangle_count)))));
  }

  const BoxTree& tree() const { return tree_; }

 private:
  // Returns the index behind what is below a node.
  std::size_t visit(std::size_t index, int depth) {
    depth_ = std::max(depth_, depth);
    const BoxTree::Node& node = tree_.nodes()[index];
    EXPECT_TRUE((node.axes.transpose() * node.axes).isIdentity(1e-14));
    path_.push_back(&node);
    std::size_t end = index + 1;
    if (node.second == 0) {
      EXPECT_GE(node.count, 1u);
      EXPECT_LE(node.count, BoxTree::kMostInLeaf);
      for (std::uint32_t i = 0; i < node.count; ++i) checkTriangle(tree_.triangles().at(node.begin + i));
    } else {
      EXPECT_EQ(node.count, 0u);
      EXPECT_EQ(visit(index + 1, depth + 1), node.second);
      end = visit(node.second, depth + 1);
    }
    path_.pop_back();
    return end;
  }

  void checkTriangle(std::uint32_t triangle) {
    ++leaves_[triangle];
    for (int k = 0; k < 3; ++k) {
      const Vector3d corner = surface_.corner(triangle, k);
      for (const BoxTree::Node* box : path_) {
        const Vector3d at = box->axes.transpose() * (corner - box->center);
        EXPECT_TRUE((at.cwiseAbs().array() <= box->half.array()).all()) << at.transpose() << " " << box->half;
      }
    }
  }

  const oracle::Surface surface_;
  const BoxTree tree_;
  std::vector<int> leaves_;
  std::vector<const BoxTree::Node*> path_;
  int depth_ = 0;
};

TEST(BoxTree, ContainsEachTriangle) {
  Random g(3);
  for (int round = 0; round < 60; ++round) {
    test::Raw raw;
    const auto count = static_cast<std::size_t>(uniform(g, 1, 90));
    const double y = std::exp2(uniform(g, -40, 0)), z = std::exp2(uniform(g, -40, 0));
    const Eigen::Matrix3d R =
        Eigen::Quaterniond(uniform(g, -1, 1), uniform(g, -1, 1), uniform(g, -1, 1), 1).normalized().matrix();
    const Vector3d from = round % 3 == 0 ? Vector3d(1e6, -3e5, 7e6) : Vector3d::Zero();
    for (std::size_t t = 0; t < count; ++t) {
      for (int k = 0; k < 3; ++k) {
        raw.vertices.emplace_back(from + R * Vector3d(uniform(g, -1, 1), y * uniform(g, -1, 1), z * uniform(g, -1, 1)));
      }
      if (t % 7 == 1) raw.vertices.back() = raw.vertices[raw.vertices.size() - 2];  // a segment
      if (t % 11 == 2)
        raw.vertices.back() = raw.vertices[raw.vertices.size() - 2] = raw.vertices[raw.vertices.size() - 3];
      raw.triangles.emplace_back(3 * t, 3 * t + 1, 3 * t + 2);
    }
    SCOPED_TRACE(round);
    Check(surfaceOf(raw)).run();
  }
  Check(surfaceOf(test::adversarial())).run();
  Check(surfaceOf(test::torus(12))).run();
}

TEST(BoxTree, IsAsThinAsASliver) {
  Random g(4);
  for (const double width : {1e-3, 1e-5, 1e-7}) {
    const Vector3d along = Vector3d(uniform(g, -1, 1), uniform(g, -1, 1), 1).normalized(),
                   across = along.unitOrthogonal();
    test::Raw raw;
    for (int i = 0; i < 16; ++i) {
      const Vector3d from = width * i * across;
      raw.vertices.insert(raw.vertices.end(), {from, from + along, from + along + width * across});
      const std::size_t n = raw.vertices.size();
      raw.triangles.emplace_back(n - 3, n - 2, n - 1);
    }
    const oracle::Surface surface = surfaceOf(raw);
    const BoxTree tree(surface);
    const double unit = surface.lattice.unit();
    const Vector3d root = unit * tree.nodes()[0].half;
    EXPECT_NEAR(root[0], 0.5, 1e-6 + 20 * width);
    EXPECT_LT(root[1], 8.01 * width + 1e-12);
    EXPECT_LT(root[2], 1e-12);
    for (const BoxTree::Node& node : tree.nodes()) {
      if (node.second != 0) continue;
      EXPECT_LT(unit * node.half[1], 0.51 * node.count * width + 1e-12);
    }
  }
}

// A cube's covariance has no axes of its own, and the halves of a right angle's box along its longest side stick out of
// the surface that it is cut from.
TEST(BoxTree, PartsMadeAlongTheirAxesHaveBoxesAlongThese) {
  const Check check(surfaceOf(test::box({0, 0, 0}, {1, 1, 1})));
  for (const BoxTree::Node& node : check.tree().nodes()) {
    const bool is_root = &node == check.tree().nodes().data();
    if (!is_root && node.second != 0) continue;
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(node.axes.col(k).cwiseAbs().maxCoeff(), 1, 1e-12);
  }
}

}  // namespace
}  // namespace bocst::tree
