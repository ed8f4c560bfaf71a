// SPDX-License-Identifier: BSD-3-Clause
#include "planner/arm_world.h"

#include <algorithm>
#include <cmath>
#include <functional>

namespace bocst::program {
namespace {

using Eigen::Vector3d;

constexpr std::array<double, ArmWorld::kJoints> kLength{0.25, 0.2, 0.28, 0.2, 0.24, 0.14, 0.1};
constexpr double kFinger = 0.09;

struct Shape {
  std::vector<Vector3d> vertices;
  std::vector<fcl::Triangle> triangles;

  std::shared_ptr<const Mesh> mesh() const { return std::make_shared<const Mesh>(vertices, triangles); }

  /// A closed surface of `rows` rings of `columns` vertices: at(u, v), periodic in v, and in u unless there are caps.
  void addRings(std::size_t rows, std::size_t columns, bool capped, const std::function<Vector3d(double, double)>& at) {
    const std::size_t first = vertices.size(), last = capped ? rows - 1 : rows;
    for (std::size_t i = 0; i < rows; ++i) {
      for (std::size_t j = 0; j < columns; ++j) {
        vertices.push_back(at(static_cast<double>(i) / static_cast<double>(last),
                              static_cast<double>(j) / static_cast<double>(columns)));
      }
    }
    for (std::size_t i = 0; i < last; ++i) {
      for (std::size_t j = 0; j < columns; ++j) {
        const std::size_t a = first + i * columns + j, b = first + i * columns + (j + 1) % columns;
        const std::size_t c = first + (i + 1) % rows * columns + j,
                          d = first + (i + 1) % rows * columns + (j + 1) % columns;
        triangles.emplace_back(a, c, b);
        triangles.emplace_back(b, c, d);
      }
    }
    if (!capped) return;
    for (std::size_t j = 1; j + 1 < columns; ++j) {
      triangles.emplace_back(first, first + j, first + j + 1);
      const std::size_t top = first + last * columns;
      triangles.emplace_back(top, top + j + 1, top + j);
    }
  }
};

/// A hollow tube along z from 0 to `length` with a flange at both ends and ribs between, about n triangles.
Shape housing(double radius, double length, std::size_t n) {
  const auto rows = static_cast<std::size_t>(std::max(6.0, std::sqrt(static_cast<double>(n) / 2)));
  const std::size_t columns = std::max<std::size_t>(6, n / (2 * rows));
  Shape shape;
  shape.addRings(rows, columns, false, [=](double u, double v) {
    const bool outside = u < 0.5;  // up on the outside, down on the inside
    const double t = outside ? 2 * u : 2 - 2 * u;
    const double flange = std::exp(-std::pow((std::abs(t - 0.5) - 0.5) / 0.12, 2.0));
    const double rib = 0.02 * std::cos(24 * kPi * t);
    const double r = radius * (outside ? 0.75 + 0.4 * flange + rib : 0.6);
    return Vector3d(r * std::cos(2 * kPi * v), r * std::sin(2 * kPi * v), t * length);
  });
  return shape;
}

/// A bar along z from 0 to `length` that tapers, of rounded square section, about n triangles.
Shape finger(double x, double y, double length, std::size_t n) {
  const auto rows = static_cast<std::size_t>(std::max(3.0, std::sqrt(static_cast<double>(n) / 2)));
  const std::size_t columns = std::max<std::size_t>(8, n / (2 * rows));
  Shape shape;
  shape.addRings(rows, columns, true, [=](double u, double v) {
    const double c = std::cos(2 * kPi * v), s = std::sin(2 * kPi * v), taper = 1 - 0.5 * u;
    const auto side = [](double w) { return std::copysign(std::pow(std::abs(w), 0.4), w); };
    return Vector3d(taper * x / 2 * side(c), taper * y / 2 * side(s), u * length);
  });
  return shape;
}

void addPlate(Shape& shape, const Vector3d& center, const Vector3d& size, std::size_t n) {
  const Vector3d h = size / 2;
  shape.addRings(2, 4 * n, true, [&](double u, double v) {
    // Once round the plate's edge, n steps a side.
    const double t = 4 * v, f = t - std::floor(t);
    const int k = static_cast<int>(t) % 4;
    const double x[4] = {-1 + 2 * f, 1, 1 - 2 * f, -1}, y[4] = {-1, -1 + 2 * f, 1, 1 - 2 * f};
    return Vector3d(center.x() + h.x() * x[k], center.y() + h.y() * y[k], center.z() + h.z() * (2 * u - 1));
  });
}

/// Four boards and two sides, 1 m wide and 1.2 m high, about the origin.
Shape shelves() {
  Shape shape;
  for (int k = 0; k < 4; ++k) addPlate(shape, {0, 0, 0.4 * k - 0.6}, {1, 0.35, 0.02}, 16);
  for (const double x : {-0.5, 0.5}) addPlate(shape, {x, 0, 0}, {0.02, 0.35, 1.22}, 16);
  return shape;
}

/// About the origin, its longest side `size`.
std::shared_ptr<const Mesh> fitted(const Mesh& mesh, double size) {
  const Eigen::AlignedBox3d box = mesh.bounds();
  const double scale = size / box.sizes().maxCoeff();
  std::vector<Eigen::Vector3d> vertices = mesh.vertices();
  for (Eigen::Vector3d& v : vertices) v = scale * (v - box.center());
  return mesh.withVertices(std::move(vertices));
}

Eigen::Isometry3d at(double x, double y, double z, double yaw = 0) {
  return Eigen::Translation3d(x, y, z) * Eigen::AngleAxisd(yaw, Vector3d::UnitZ()) * Eigen::Isometry3d::Identity();
}

}  // namespace

ArmWorld::ArmWorld(std::size_t triangles_a_link, const std::vector<std::shared_ptr<const Mesh>>& scans,
                   std::uint64_t seed) {
  for (std::size_t i = 0; i < kJoints; ++i) {
    links_.push_back({"link " + std::to_string(i + 1),
                      housing(0.075 - 0.005 * static_cast<double>(i), kLength[i], triangles_a_link).mesh()});
  }
  addHand(triangles_a_link);
  addThings(scans, seed);
}

void ArmWorld::addHand(std::size_t triangles) {
  Shape palm = finger(0.16, 0.05, 0.04, triangles);
  links_.push_back({"palm", palm.mesh()});
  for (const char* name : {"left finger", "right finger"}) {
    links_.push_back({name, finger(0.012, 0.02, kFinger, triangles).mesh()});
  }
}

void ArmWorld::addThings(const std::vector<std::shared_ptr<const Mesh>>& scans, std::uint64_t seed) {
  Shape table;
  addPlate(table, Vector3d::Zero(), {1.6, 1.6, 0.04}, 32);
  things_.push_back({"table", table.mesh(), at(0, 0, -0.05)});
  const auto shelf = shelves().mesh();
  things_.push_back({"shelves in front", shelf, at(0.75, 0, 0.6, kPi / 2)});
  things_.push_back({"shelves beside", shelf, at(0, 0.8, 0.6)});
  Random random(seed);
  for (std::size_t turn = 0; turn < 3; ++turn) {
    for (std::size_t k = 0; k < scans.size(); ++k) {
      Thing thing{"scan " + std::to_string(k + 1) + "." + std::to_string(turn + 1),
                  fitted(*scans[k], random.between(0.2, 0.4)),
                  {}};
      const double along = random.between(-0.4, 0.4), height = 0.4 * static_cast<double>(turn) + 0.15;
      const double yaw = random.between(0, 2 * kPi);
      thing.X_WT = k % 2 == 0 ? at(0.7, along, height, yaw) : at(along, 0.75, height, yaw);
      things_.push_back(std::move(thing));
    }
  }
}

bool ArmWorld::mayTouch(std::size_t link, std::size_t other) const {
  const std::size_t first = std::min(link, other), last = std::max(link, other);
  return last - first <= 1 || (first + 2 >= kJoints && last >= kJoints) || first >= kJoints;
}

ArmWorld::Poses ArmWorld::posesAt(const Joints& q) const {
  Poses X_WL;
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  for (std::size_t i = 0; i < kJoints; ++i) {
    X.rotate(Eigen::AngleAxisd(q[i], i % 2 == 0 ? Vector3d(Vector3d::UnitZ()) : Vector3d(Vector3d::UnitY())));
    X_WL.push_back(X);
    X.translate(kLength[i] * Vector3d::UnitZ());
  }
  X_WL.push_back(X);
  for (const double side : {-0.06, 0.06}) X_WL.push_back(X * Eigen::Translation3d(side, 0, 0.04));
  return X_WL;
}

ArmWorld::Joints ArmWorld::randomJoints(Random& random) {
  Joints q;
  for (double& x : q) x = random.between(-2.2, 2.2);
  return q;
}

std::vector<ArmWorld::Joints> ArmWorld::edge(const Joints& from, const Joints& to) {
  constexpr double kJointStep = 0.02, kLongest = 1;
  double squared = 0;
  for (std::size_t i = 0; i < kJoints; ++i) squared += (to[i] - from[i]) * (to[i] - from[i]);
  const double length = std::sqrt(squared);
  std::vector<Joints> states;
  for (double way = kJointStep; way <= std::min(length, kLongest); way += kJointStep) {
    Joints q;
    for (std::size_t i = 0; i < kJoints; ++i) q[i] = from[i] + way / length * (to[i] - from[i]);
    states.push_back(q);
  }
  return states;
}

}  // namespace bocst::program
