// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/model.h>
#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/math/geometry.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string>
#include <type_traits>

#include "fcl/bvh_side.h"
#include "fcl/dispatch.h"
#include "query/volume.h"
#include "tree/tree.h"

// What the queries about a pair of geometries share.

namespace bocst::fcl_room {

template <typename S>
Eigen::Isometry3d isometryOf(const fcl::Transform3<S>& X) {
  Eigen::Isometry3d Y = Eigen::Isometry3d::Identity();
  Y.linear() = X.linear().template cast<double>();
  Y.translation() = X.translation().template cast<double>();
  return Y;
}

/// The largest coordinate, in absolute value.
inline double magnitudeOf(const Eigen::AlignedBox3d& box) {
  return std::max(box.min().cwiseAbs().maxCoeff(), box.max().cwiseAbs().maxCoeff());
}

/// What is no farther touches: the sum of what the two ask for.
template <typename S>
double marginOf(const Model<S>* model1, const Model<S>* model2) {
  return (model1 != nullptr ? model1->options().margin : 0) + (model2 != nullptr ? model2->options().margin : 0);
}

/// Positions in the frame of the first geometry are at most this large.
template <typename S>
double magnitudeOf(const fcl::Transform3<S>& X_W1, const fcl::Transform3<S>& X_W2, double size1, double size2) {
  const Eigen::Vector3d p = X_W1.linear().transpose().template cast<double>() *
                            (X_W2.translation() - X_W1.translation()).template cast<double>();
  return p.norm() + 2 * (size1 + size2);
}

/// From the frame of B (origin and unit in B's model frame) to that of A, through the pose X_AB in model units.
template <typename S>
query::Placement placementOf(const fcl::Transform3<S>& X_WA, const fcl::Transform3<S>& X_WB,
                             const Eigen::Vector3d& origin_a, double unit_a, const Eigen::Vector3d& origin_b,
                             double unit_b, double magnitude) {
  fcl::Matrix3<S> R;
  fcl::Vector3<S> t;
  fcl::relativeTransform(X_WA.linear(), X_WA.translation(), X_WB.linear(), X_WB.translation(), R, t);
  query::Placement p;
  p.rotation = R.template cast<double>();
  p.scale = unit_b / unit_a;
  p.translation = (p.rotation * origin_b + t.template cast<double>() - origin_a) / unit_a;
  // What FCL's triangle test, which computes R q + t in S, may take for a contact.
  p.slack = magnitude * 32 * static_cast<double>(std::numeric_limits<S>::epsilon()) / unit_a;
  p.defect = (p.rotation.transpose() * p.rotation - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  p.ready();
  return p;
}

/// Holds the gates of one or two trees shared, taken in address order.
class Look {
 public:
  Look(tree::Tree& a, tree::Tree* b) : a_(&a), b_(b == &a ? nullptr : b) {
    if (b_ != nullptr && std::less<tree::Tree*>()(b_, a_)) std::swap(a_, b_);
    a_->gate().lock_shared();
    if (b_ != nullptr) b_->gate().lock_shared();
  }
  ~Look() {
    if (b_ != nullptr) b_->gate().unlock_shared();
    a_->gate().unlock_shared();
  }
  Look(const Look&) = delete;
  Look& operator=(const Look&) = delete;

 private:
  tree::Tree *a_, *b_;
};

/// Calls f(a, b, b_in_a, magnitude) with two trees as the sides of a walk, while nobody takes nodes away.
template <typename S, typename F>
void betweenTrees(const fcl::Transform3<S>& X_WA, tree::Tree& tree_a, const fcl::Transform3<S>& X_WB,
                  tree::Tree& tree_b, F&& f) {
  std::int64_t now;
  {
    const Look look(tree_a, &tree_b);
    const query::TreeSide a(tree_a), b(tree_b);
    now = a.now();
    const oracle::Surface &sa = tree_a.surface(), &sb = tree_b.surface();
    const double magnitude = magnitudeOf(X_WA, X_WB, magnitudeOf(sa.bounds), magnitudeOf(sb.bounds));
    f(a, b,
      placementOf(X_WA, X_WB, sa.lattice.origin(), sa.lattice.unit(), sb.lattice.origin(), sb.lattice.unit(),
                  magnitude),
      magnitude);
  }
  tree_a.afterQuery(now);
  if (&tree_b != &tree_a) tree_b.afterQuery(now);
}

/// The same with a tree as side A and an FCL mesh as side B.
template <typename BV, typename F>
void betweenTreeAndBvh(const fcl::Transform3<typename BV::S>& X_WA, tree::Tree& tree,
                       const fcl::Transform3<typename BV::S>& X_WB, const fcl::BVHModel<BV>& bvh, F&& f) {
  std::int64_t now;
  {
    const Look look(tree, nullptr);
    const query::TreeSide a(tree);
    const BvhSide<BV> b(bvh);
    now = a.now();
    const oracle::Surface& s = tree.surface();
    const double magnitude = magnitudeOf(X_WA, X_WB, magnitudeOf(s.bounds), b.magnitude());
    const Eigen::Vector3d origin = Eigen::Vector3d::Zero();
    f(a, b, placementOf(X_WA, X_WB, s.lattice.origin(), s.lattice.unit(), origin, 1.0, magnitude), magnitude);
  }
  tree.afterQuery(now);
}

/// Calls f with the partner of a model as the BVHModel that it is.
/// @throws std::invalid_argument when it is none.
template <typename S, typename F>
void withBvh(const char* query, const fcl::CollisionGeometry<S>* partner, F&& f) {
  const auto as = [partner](auto* bv) -> const auto& {
    return *static_cast<const fcl::BVHModel<std::remove_pointer_t<decltype(bv)>>*>(partner);
  };
  switch (partner->getNodeType()) {
    case fcl::BV_AABB:
      return f(as(static_cast<fcl::AABB<S>*>(nullptr)));
    case fcl::BV_OBB:
      return f(as(static_cast<fcl::OBB<S>*>(nullptr)));
    case fcl::BV_RSS:
      return f(as(static_cast<fcl::RSS<S>*>(nullptr)));
    case fcl::BV_kIOS:
      return f(as(static_cast<fcl::kIOS<S>*>(nullptr)));
    case fcl::BV_OBBRSS:
      return f(as(static_cast<fcl::OBBRSS<S>*>(nullptr)));
    case fcl::BV_KDOP16:
      return f(as(static_cast<fcl::KDOP<S, 16>*>(nullptr)));
    case fcl::BV_KDOP18:
      return f(as(static_cast<fcl::KDOP<S, 18>*>(nullptr)));
    case fcl::BV_KDOP24:
      return f(as(static_cast<fcl::KDOP<S, 24>*>(nullptr)));
    default:
      throw std::invalid_argument(std::string("bocst::") + query + ": bocst::Model<" +
                                  (std::is_same<S, float>::value ? "float" : "double") + "> and " +
                                  typeName<S>(partner) +
                                  " are not supported; partners are Model, BVHModel, FCL's shapes and OcTree");
  }
}

}  // namespace bocst::fcl_room
