// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// FCL's shapes as partners of tests.

#include <fcl/geometry/shape/box.h>
#include <fcl/geometry/shape/capsule.h>
#include <fcl/geometry/shape/cone.h>
#include <fcl/geometry/shape/convex.h>
#include <fcl/geometry/shape/cylinder.h>
#include <fcl/geometry/shape/ellipsoid.h>
#include <fcl/geometry/shape/halfspace.h>
#include <fcl/geometry/shape/plane.h>
#include <fcl/geometry/shape/sphere.h>
#include <fcl/geometry/shape/triangle_p.h>

#include <memory>
#include <string>
#include <vector>

#include "meshes.h"

namespace bocst::test {

/// A ball-like polytope of 2 * n * (n - 1) triangles.
template <typename S>
std::shared_ptr<fcl::Convex<S>> polytope(int n, const Eigen::Vector3d& radii) {
  auto vertices = std::make_shared<std::vector<fcl::Vector3<S>>>();
  auto faces = std::make_shared<std::vector<int>>();
  const double pi = std::acos(-1.0);
  vertices->push_back(Eigen::Vector3d(0, 0, -radii.z()).cast<S>());
  for (int i = 1; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      const double u = pi * i / n - pi / 2, v = 2 * pi * j / n;
      vertices->push_back(
          radii.cwiseProduct(Eigen::Vector3d(std::cos(u) * std::cos(v), std::cos(u) * std::sin(v), std::sin(u)))
              .template cast<S>());
    }
  }
  vertices->push_back(Eigen::Vector3d(0, 0, radii.z()).cast<S>());
  const int last = static_cast<int>(vertices->size()) - 1;
  int count = 0;
  const auto face = [&](std::initializer_list<int> corners) {
    faces->push_back(static_cast<int>(corners.size()));
    faces->insert(faces->end(), corners);
    ++count;
  };
  for (int j = 0; j < n; ++j) {
    const int k = (j + 1) % n;
    face({0, 1 + k, 1 + j});
    for (int i = 0; i + 2 < n; ++i) {
      const int a = 1 + i * n, b = a + n;
      face({a + j, a + k, b + k});
      face({a + j, b + k, b + j});
    }
    face({last - n + j, last - n + k, last});
  }
  return std::make_shared<fcl::Convex<S>>(vertices, count, faces);
}

template <typename S>
struct NamedShape {
  std::string name;
  std::shared_ptr<fcl::ShapeBase<S>> shape;
};

/// One of each of FCL's shapes, about as large as a torus() is thick.
template <typename S>
std::vector<NamedShape<S>> shapes() {
  const auto v = [](double x, double y, double z) { return Eigen::Vector3d(x, y, z).cast<S>().eval(); };
  return {{"box", std::make_shared<fcl::Box<S>>(v(0.7, 0.4, 1.1))},
          {"sphere", std::make_shared<fcl::Sphere<S>>(S(0.45))},
          {"ellipsoid", std::make_shared<fcl::Ellipsoid<S>>(v(0.3, 0.7, 0.5))},
          {"capsule", std::make_shared<fcl::Capsule<S>>(S(0.3), S(0.8))},
          {"cone", std::make_shared<fcl::Cone<S>>(S(0.5), S(0.9))},
          {"cylinder", std::make_shared<fcl::Cylinder<S>>(S(0.4), S(0.8))},
          {"convex", polytope<S>(7, {0.5, 0.4, 0.6})},
          {"large convex", polytope<S>(12, {0.5, 0.4, 0.6})},
          {"plane", std::make_shared<fcl::Plane<S>>(v(1, 2, -2) / S(3), S(0.25))},
          {"half-space", std::make_shared<fcl::Halfspace<S>>(v(2, -1, 2) / S(3), S(-0.5))},
          {"triangle", std::make_shared<fcl::TriangleP<S>>(v(0.6, 0, 0.1), v(-0.5, 0.4, 0), v(-0.1, -0.7, 0.2))}};
}

}  // namespace bocst::test
