// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// FCL's OcTree as a partner of tests.

#include <fcl/geometry/octree/octree.h>

#include <array>
#include <limits>
#include <memory>

#include "geometry/convex_shape.h"
#include "meshes.h"

namespace bocst::test {

/// A cloud about the origin, with cells that are occupied, free, uncertain and unknown.
inline std::shared_ptr<octomap::OcTree> cloudMap(unsigned seed, std::size_t points, double resolution = 0.1) {
  auto map = std::make_shared<octomap::OcTree>(resolution);
  std::mt19937_64 g(seed);
  std::uniform_real_distribution<double> u(0, 1);
  for (std::size_t i = 0; i < points; ++i) {
    const Eigen::Vector3d p = randomDirection(g) * 0.6 * std::cbrt(u(g));
    const octomap::point3d at(static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z()));
    const double kind = u(g);
    map->updateNode(at, static_cast<float>(kind < 0.6 ? 2 : kind < 0.8 ? -2 : 0.2));
  }
  map->updateInnerOccupancy();
  return map;
}

template <typename S>
std::shared_ptr<fcl::OcTree<S>> cloud(const std::shared_ptr<octomap::OcTree>& map) {
  auto octree = std::make_shared<fcl::OcTree<S>>(map);
  octree->setOccupancyThres(S(0.7));
  octree->setFreeThres(S(0.4));
  return octree;
}

template <typename S>
std::shared_ptr<fcl::OcTree<S>> cloud(unsigned seed, std::size_t points) {
  return cloud<S>(cloudMap(seed, points));
}

/// The distance of a triangle of a mesh at X and a box of toBoxes() at Y.
template <typename S>
double gap(const Raw& raw, std::size_t t, const fcl::Transform3<S>& X, const std::array<S, 6>& box,
           const fcl::Transform3<S>& Y) {
  const Eigen::Vector3d center(box[0], box[1], box[2]);
  Eigen::Vector3d c[3];
  for (std::size_t k = 0; k < 3; ++k) {
    c[k] =
        Y.template cast<double>().inverse() * (X.template cast<double>() * raw.vertices[raw.triangles[t][k]]) - center;
  }
  return query::BoxShape(Eigen::Vector3d::Constant(box[3] / 2.0))
      .gap({c, 3}, std::numeric_limits<double>::infinity())
      .distance;
}

}  // namespace bocst::test
