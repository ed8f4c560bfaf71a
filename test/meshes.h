// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// Meshes and poses that tests make for themselves.

#include <bocst/mesh.h>

#include <cmath>
#include <memory>
#include <random>
#include <vector>

namespace bocst::test {

struct Raw {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<fcl::Triangle> triangles;

  std::shared_ptr<const Mesh> mesh() const { return std::make_shared<const Mesh>(vertices, triangles); }

  Raw& scale(double s) {
    for (auto& v : vertices) v *= s;
    return *this;
  }
  Raw& move(const Eigen::Vector3d& d) {
    for (auto& v : vertices) v += d;
    return *this;
  }
  Raw& addTriangle(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
    const std::size_t n = vertices.size();
    vertices.insert(vertices.end(), {a, b, c});
    triangles.emplace_back(n, n + 1, n + 2);
    return *this;
  }
  Raw& add(const Raw& other) {
    const std::size_t first = vertices.size();
    vertices.insert(vertices.end(), other.vertices.begin(), other.vertices.end());
    for (const auto& t : other.triangles) triangles.emplace_back(t[0] + first, t[1] + first, t[2] + first);
    return *this;
  }
};

/// Every triangle with vertices of its own, as STL files have them.
inline Raw unwelded(const Raw& raw) {
  Raw out;
  for (const auto& t : raw.triangles) out.addTriangle(raw.vertices[t[0]], raw.vertices[t[1]], raw.vertices[t[2]]);
  return out;
}

inline Raw turnedOver(Raw raw) {
  for (auto& t : raw.triangles) t = fcl::Triangle(t[0], t[2], t[1]);
  return raw;
}

/// A rotation that turns the direction `from` to the direction `to`. Eigen's FromTwoVectors compiles for four seconds.
inline Eigen::Matrix3d turnOnto(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const Eigen::Vector3d axis = from.cross(to);
  const double length = axis.norm(), angle = std::atan2(length, from.dot(to));
  return Eigen::AngleAxisd(angle, length > 0 ? Eigen::Vector3d(axis / length) : from.unitOrthogonal())
      .toRotationMatrix();
}

/// A bumpy torus of 2 * n * n triangles, about two units wide.
inline Raw torus(std::size_t n, double bumps = 0.08) {
  Raw raw;
  const double pi = std::acos(-1.0);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) {
      const double u = 2 * pi * static_cast<double>(i) / static_cast<double>(n);
      const double v = 2 * pi * static_cast<double>(j) / static_cast<double>(n);
      const double r = 0.35 * (1 + bumps * std::sin(5 * u) * std::cos(3 * v));
      raw.vertices.emplace_back((0.7 + r * std::cos(v)) * std::cos(u), (0.7 + r * std::cos(v)) * std::sin(u),
                                r * std::sin(v));
      const std::size_t a = i * n + j, b = i * n + (j + 1) % n, c = (i + 1) % n * n + j,
                        d = (i + 1) % n * n + (j + 1) % n;
      raw.triangles.emplace_back(a, c, b);
      raw.triangles.emplace_back(b, c, d);
    }
  }
  return raw;
}

/// A square of side 1 about the origin, of 2 n^2 triangles.
inline Raw plate(std::size_t n) {
  Raw raw;
  const auto at = [n](std::size_t i) { return static_cast<double>(i) / static_cast<double>(n) - 0.5; };
  for (std::size_t i = 0; i <= n; ++i) {
    for (std::size_t j = 0; j <= n; ++j) raw.vertices.emplace_back(at(i), at(j), 0);
  }
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) {
      const std::size_t a = i * (n + 1) + j, b = a + 1, c = a + n + 1, d = c + 1;
      raw.triangles.emplace_back(a, c, b);
      raw.triangles.emplace_back(b, c, d);
    }
  }
  return raw;
}

/// A pipe whose triangles run from end to end: a leaf has few, and each pair of leaves takes long.
inline Raw pipe(std::size_t sectors) {
  Raw raw;
  for (std::size_t i = 0; i < sectors; ++i) {
    const double angle = 2 * std::acos(-1.0) * static_cast<double>(i) / static_cast<double>(sectors);
    for (const double z : {-1.0, 1.0}) raw.vertices.emplace_back(0.1 * std::cos(angle), 0.1 * std::sin(angle), z);
    const std::size_t j = (i + 1) % sectors;
    raw.triangles.emplace_back(2 * i, 2 * j, 2 * i + 1);
    raw.triangles.emplace_back(2 * j, 2 * j + 1, 2 * i + 1);
  }
  return raw;
}

/// The surface of a box.
inline Raw box(const Eigen::Vector3d& lo, const Eigen::Vector3d& hi) {
  Raw raw;
  for (int i = 0; i < 8; ++i) {
    raw.vertices.emplace_back(i & 1 ? hi.x() : lo.x(), i & 2 ? hi.y() : lo.y(), i & 4 ? hi.z() : lo.z());
  }
  const int faces[12][3] = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                            {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  for (const auto& f : faces) {
    raw.triangles.emplace_back(static_cast<std::size_t>(f[0]), static_cast<std::size_t>(f[1]),
                               static_cast<std::size_t>(f[2]));
  }
  return raw;
}

/// What breaks naive tests: faces on dyadic planes, slivers, segments, points, tiny and huge triangles, duplicates.
inline Raw adversarial() {
  Raw raw = box({0, 0, 0}, {1, 1, 1});
  raw.add(box({0.25, 0.5, 0.125}, {0.75, 0.5, 0.875}));  // flat: faces on cell faces, some without area
  raw.add(box({0.5, 0.25, 0.5}, {0.5, 0.5, 0.5}));       // a segment, twelve times
  raw.addTriangle({0.1, 0.1, 0.1}, {0.9, 0.9, 0.9}, {0.9, 0.9, 0.9 + 1e-12});  // sliver
  raw.addTriangle({0.2, 0.8, 0.3}, {0.2, 0.8, 0.3}, {0.2, 0.8, 0.3});          // point
  raw.addTriangle({0.3, 0.3, 0.7}, {0.3 + 1e-7, 0.3, 0.7}, {0.3, 0.3 + 1e-7, 0.7});
  raw.addTriangle({0.5, 0.5, 0.5}, {0.5 + 1e-7, 0.5, 0.5}, {0.5, 0.5 + 1e-7, 0.5 + 1e-7});  // at the root's centre
  raw.addTriangle({0, 0, 0}, {1, 0, 1}, {0, 1, 1});
  raw.addTriangle({0, 0, 0}, {1, 0, 1}, {0, 1, 1});  // twice
  raw.addTriangle({0.25, 0.25, 0}, {0.25, 0.25, 1}, {0.25, 0.75, 0.5});
  return raw;
}

/// Triangles anywhere in the unit cube, of sizes from 1e-6 to 1.
inline Raw soup(std::size_t count, unsigned seed) {
  Raw raw;
  std::mt19937_64 g(seed);
  std::uniform_real_distribution<double> u(0, 1);
  for (std::size_t t = 0; t < count; ++t) {
    const Eigen::Vector3d c(u(g), u(g), u(g));
    const double size = std::pow(10.0, -6 * u(g));
    for (int k = 0; k < 3; ++k)
      raw.vertices.push_back(c + size * (Eigen::Vector3d(u(g), u(g), u(g)) - Eigen::Vector3d::Constant(0.5)));
    raw.triangles.emplace_back(3 * t, 3 * t + 1, 3 * t + 2);
  }
  return raw;
}

template <typename S>
Eigen::Transform<S, 3, Eigen::Isometry> pose(const Eigen::Matrix3d& R, const Eigen::Vector3d& p) {
  Eigen::Transform<S, 3, Eigen::Isometry> X = Eigen::Transform<S, 3, Eigen::Isometry>::Identity();
  X.linear() = R.cast<S>();
  X.translation() = p.cast<S>();
  return X;
}

inline Eigen::Matrix3d randomRotation(std::mt19937_64& g) {
  std::normal_distribution<double> n;
  return Eigen::Quaterniond(n(g), n(g), n(g), n(g)).normalized().toRotationMatrix();
}

inline Eigen::Vector3d randomDirection(std::mt19937_64& g) {
  std::normal_distribution<double> n;
  return Eigen::Vector3d(n(g), n(g), n(g)).normalized();
}

}  // namespace bocst::test
