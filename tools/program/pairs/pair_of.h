// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/geometry/collision_geometry.h>
#include <fcl/narrowphase/collision_request.h>
#include <fcl/narrowphase/collision_result.h>
#include <fcl/narrowphase/distance_request.h>
#include <fcl/narrowphase/distance_result.h>

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "pairs/query_pair.h"

namespace bocst::program {

/// A QueryPair over two FCL geometries. Queries is FclCalls, which stands for FCL's own functions or bocst's overloads.
template <typename S, typename Geometry, typename Base, typename Queries>
class PairOf : public Base {
 public:
  PairOf(std::unique_ptr<Geometry> a, std::unique_ptr<Geometry> b) : a_(std::move(a)), b_(std::move(b)) {}

  bool touch(const Eigen::Isometry3d& X_AB, QueryPair::Order order) const override {
    const fcl::CollisionRequest<S> request;
    fcl::CollisionResult<S> result;
    collide(X_AB, order, request, result);
    return result.isCollision();
  }

  std::vector<QueryPair::Contact> contacts(const Eigen::Isometry3d& X_AB, std::size_t limit,
                                           QueryPair::Order order) const override {
    const fcl::CollisionRequest<S> request(limit, false);
    fcl::CollisionResult<S> result;
    collide(X_AB, order, request, result);
    std::vector<QueryPair::Contact> found;
    found.reserve(result.numContacts());
    for (std::size_t i = 0; i < result.numContacts(); ++i) {
      const fcl::Contact<S>& contact = result.getContact(i);
      found.push_back(order == QueryPair::Order::kAB ? QueryPair::Contact(contact.b1, contact.b2)
                                                     : QueryPair::Contact(contact.b2, contact.b1));
    }
    std::sort(found.begin(), found.end());
    found.erase(std::unique(found.begin(), found.end()), found.end());
    return found;
  }

  std::size_t countContacts(const Eigen::Isometry3d& X_AB) const override {
    const fcl::CollisionRequest<S> request(QueryPair::kAll, true);
    fcl::CollisionResult<S> result;
    collide(X_AB, QueryPair::Order::kAB, request, result);
    return result.numContacts();
  }

  double distance(const Eigen::Isometry3d& X_AB) const override {
    const fcl::DistanceRequest<S> request;
    fcl::DistanceResult<S> result;
    measure(X_AB, request, result);
    return result.min_distance;
  }

 protected:
  const Geometry& a() const { return *a_; }
  const Geometry& b() const { return *b_; }
  Geometry& a() { return *a_; }
  Geometry& b() { return *b_; }
  void replaceA(std::unique_ptr<Geometry> a) { a_ = std::move(a); }

  void collide(const Eigen::Isometry3d& X_AB, QueryPair::Order order, const fcl::CollisionRequest<S>& request,
               fcl::CollisionResult<S>& result) const {
    const fcl::Transform3<S> X_WA = fcl::Transform3<S>::Identity();
    const fcl::Transform3<S> X_WB = X_AB.cast<S>();
    const fcl::CollisionGeometry<S>* a = a_.get();
    const fcl::CollisionGeometry<S>* b = b_.get();
    if (order == QueryPair::Order::kAB) {
      Queries::collide(a, X_WA, b, X_WB, request, result);
    } else {
      Queries::collide(b, X_WB, a, X_WA, request, result);
    }
  }

  void measure(const Eigen::Isometry3d& X_AB, const fcl::DistanceRequest<S>& request,
               fcl::DistanceResult<S>& result) const {
    const fcl::Transform3<S> X_WA = fcl::Transform3<S>::Identity();
    const fcl::Transform3<S> X_WB = X_AB.cast<S>();
    const fcl::CollisionGeometry<S>* a = a_.get();
    const fcl::CollisionGeometry<S>* b = b_.get();
    Queries::distance(a, X_WA, b, X_WB, request, result);
  }

 private:
  std::unique_ptr<Geometry> a_;
  std::unique_ptr<Geometry> b_;
};

}  // namespace bocst::program
