// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// FCL's geometries as unions of convex sets, for convex.h.

#include <fcl/geometry/octree/octree.h>

#include <stdexcept>

#include "conformance/convex.h"
#include "conformance/shapes.h"

namespace bocst::test {

/// How far planes and half-spaces go; tests keep within.
constexpr double kWide = 8;

inline Solids solidsOf(const Raw& raw) {
  Solids all;
  for (const auto& t : raw.triangles) {
    all.push_back(sweptHullOf({raw.vertices[t[0]], raw.vertices[t[1]], raw.vertices[t[2]]}));
    all.back().id = static_cast<std::intptr_t>(all.size()) - 1;
  }
  return all;
}

inline Solid boxOf(const Eigen::Vector3d& center, const Eigen::Vector3d& half) {
  std::vector<Eigen::Vector3d> corners;
  for (int i = 0; i < 8; ++i) {
    corners.push_back(center + Eigen::Vector3d(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1).cwiseProduct(half));
  }
  return sweptHullOf(std::move(corners));
}

/// What is between two planes n.x = low and n.x = high, as wide as kWide.
inline Solid slabOf(const Eigen::Vector3d& n, double low, double high) {
  const Eigen::Vector3d u = n.unitOrthogonal() * kWide, v = n.cross(u);
  std::vector<Eigen::Vector3d> corners;
  for (const double d : {low, high}) {
    for (const double s : {-1, 1}) corners.insert(corners.end(), {n * d + u + s * v, n * d - u + s * v});
  }
  return sweptHullOf(std::move(corners));
}

/// What lies between two discs about the z axis, with radii below and above.
inline Solid roundOf(double below, double above, double length) {
  Solid s;
  s.reach = std::hypot(std::max(below, above), length / 2);
  s.support = [=](const Eigen::Vector3d& d) {
    const double r = std::hypot(d.x(), d.y());
    const Eigen::Vector3d out = r > 0 ? Eigen::Vector3d(d.x() / r, d.y() / r, 0) : Eigen::Vector3d(0, 0, 0);
    const Eigen::Vector3d p = out * below - Eigen::Vector3d::UnitZ() * length / 2;
    const Eigen::Vector3d q = out * above + Eigen::Vector3d::UnitZ() * length / 2;
    return p.dot(d) > q.dot(d) ? p : q;
  };
  return s;
}

template <typename S>
Solid solidOf(const fcl::ShapeBase<S>& shape) {
  const auto v = [](const fcl::Vector3<S>& x) { return x.template cast<double>().eval(); };
  Solid s;
  if (const auto* box = dynamic_cast<const fcl::Box<S>*>(&shape)) {
    s = boxOf({0, 0, 0}, v(box->side) / 2);
  } else if (const auto* sphere = dynamic_cast<const fcl::Sphere<S>*>(&shape)) {
    s = sweptHullOf({Eigen::Vector3d::Zero()});
    s.round = sphere->radius;
  } else if (const auto* ellipsoid = dynamic_cast<const fcl::Ellipsoid<S>*>(&shape)) {
    s.reach = v(ellipsoid->radii).maxCoeff();
    s.support = [r = v(ellipsoid->radii)](const Eigen::Vector3d& d) {
      const Eigen::Vector3d rd = r.cwiseProduct(d);
      return Eigen::Vector3d(r.cwiseProduct(rd) / rd.norm());
    };
  } else if (const auto* capsule = dynamic_cast<const fcl::Capsule<S>*>(&shape)) {
    s = sweptHullOf({Eigen::Vector3d(0, 0, -capsule->lz / 2.0), Eigen::Vector3d(0, 0, capsule->lz / 2.0)});
    s.round = capsule->radius;
  } else if (const auto* cone = dynamic_cast<const fcl::Cone<S>*>(&shape)) {
    s = roundOf(cone->radius, 0, cone->lz);
  } else if (const auto* cylinder = dynamic_cast<const fcl::Cylinder<S>*>(&shape)) {
    s = roundOf(cylinder->radius, cylinder->radius, cylinder->lz);
  } else if (const auto* convex = dynamic_cast<const fcl::Convex<S>*>(&shape)) {
    std::vector<Eigen::Vector3d> points;
    for (const auto& p : convex->getVertices()) points.push_back(v(p));
    s = sweptHullOf(std::move(points));
  } else if (const auto* plane = dynamic_cast<const fcl::Plane<S>*>(&shape)) {
    s = slabOf(v(plane->n), plane->d, plane->d);
  } else if (const auto* space = dynamic_cast<const fcl::Halfspace<S>*>(&shape)) {
    s = slabOf(v(space->n), space->d - kWide, space->d);
  } else if (const auto* triangle = dynamic_cast<const fcl::TriangleP<S>*>(&shape)) {
    s = sweptHullOf({v(triangle->a), v(triangle->b), v(triangle->c)});
  } else {
    throw std::logic_error("no such shape");
  }
  s.reach += s.round;
  s.id = -1;
  return s;
}

/// The occupied cells, named as FCL names them.
template <typename S>
Solids solidsOf(const fcl::OcTree<S>& octree, const octomap::OcTree& map) {
  Solids all;
  for (auto leaf = map.begin_leafs(); leaf != map.end_leafs(); ++leaf) {
    if (!octree.isNodeOccupied(&*leaf)) continue;
    // In double, unlike octomap's points.
    Eigen::Vector3d center;
    for (int k = 0; k < 3; ++k) center[k] = map.keyToCoord(leaf.getKey()[static_cast<unsigned>(k)], leaf.getDepth());
    all.push_back(boxOf(center, Eigen::Vector3d::Constant(leaf.getSize() / 2)));
    all.back().id = &*leaf - map.getRoot();
  }
  return all;
}

}  // namespace bocst::test
