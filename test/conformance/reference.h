// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/bocst.h>
#include <fcl/geometry/bvh/BVH_model.h>
#include <gtest/gtest.h>

#include <initializer_list>
#include <set>
#include <utility>
#include <vector>

#include "meshes.h"

namespace bocst::test {

/// How far inside contact poses at its very edge are put. Where Debian's libfcl fuses products and sums, which bocst's
/// own code never does, the last bit of a pose decides there.
#ifdef __aarch64__
constexpr double kAtContact = 1e-12;
#else
constexpr double kAtContact = 0;
#endif

using Scalars = testing::Types<float, double>;

/// Geometries of several types that a loop goes through.
template <typename S>
using Geometries = std::initializer_list<const fcl::CollisionGeometry<S>*>;

using Pairs = std::set<std::pair<std::intptr_t, std::intptr_t>>;

template <typename BV>
std::shared_ptr<fcl::BVHModel<BV>> bvh(const Raw& raw) {
  using S = typename BV::S;
  std::vector<fcl::Vector3<S>> vertices;
  for (const auto& v : raw.vertices) vertices.push_back(v.cast<S>());
  auto model = std::make_shared<fcl::BVHModel<BV>>();
  model->beginModel();
  model->addSubModel(vertices, raw.triangles);
  model->endModel();
  return model;
}

// Compiled once, in fcl_models.cpp.
#define BOCST_FCL_MODEL(declaration, BV) \
  declaration template std::shared_ptr<fcl::BVHModel<fcl::BV>> bvh<fcl::BV>(const Raw&);
#define BOCST_FCL_MODELS(declaration, S)  \
  BOCST_FCL_MODEL(declaration, OBBRSS<S>) \
  BOCST_FCL_MODEL(declaration, OBB<S>)    \
  BOCST_FCL_MODEL(declaration, RSS<S>)    \
  BOCST_FCL_MODEL(declaration, kIOS<S>)   \
  BOCST_FCL_MODEL(declaration, AABB<S>)
BOCST_FCL_MODELS(extern, float)
BOCST_FCL_MODELS(extern, double)

template <typename S>
bool touching(const fcl::CollisionGeometry<S>& a, const fcl::Transform3<S>& X_WA, const fcl::CollisionGeometry<S>& b,
              const fcl::Transform3<S>& X_WB) {
  fcl::CollisionRequest<S> request;
  fcl::CollisionResult<S> result;
  return fcl::collide(&a, X_WA, &b, X_WB, request, result) > 0;
}

template <typename S>
S distance(const fcl::CollisionGeometry<S>& a, const fcl::Transform3<S>& X_WA, const fcl::CollisionGeometry<S>& b,
           const fcl::Transform3<S>& X_WB) {
  fcl::DistanceRequest<S> request;
  fcl::DistanceResult<S> result;
  return fcl::distance(&a, X_WA, &b, X_WB, request, result);
}

template <typename S>
Pairs pairs(const fcl::CollisionGeometry<S>& a, const fcl::Transform3<S>& X_WA, const fcl::CollisionGeometry<S>& b,
            const fcl::Transform3<S>& X_WB) {
  fcl::CollisionRequest<S> request(1000000000);
  fcl::CollisionResult<S> result;
  fcl::collide(&a, X_WA, &b, X_WB, request, result);
  Pairs set;
  for (std::size_t i = 0; i < result.numContacts(); ++i) {
    const auto& c = result.getContact(i);
    set.insert({c.b1, c.b2});
  }
  return set;
}

/// Along a direction, how far b must go so that the two just part: by bisection of `test(distance)`.
template <typename Test>
double contactDistance(Test&& test, double far, int steps) {
  double lo = 0, hi = far;
  for (int i = 0; i < steps; ++i) (test((lo + hi) / 2) ? lo : hi) = (lo + hi) / 2;
  return (lo + hi) / 2;
}

}  // namespace bocst::test
