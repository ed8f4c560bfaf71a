// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/model.h>
#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/math/geometry.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <type_traits>

#include "fcl/adapters/bvh_side.h"
#include "fcl/adapters/models.h"
#include "fcl/adapters/rounding.h"
#include "geometry/volume.h"
#include "tree/tree.h"

// What the queries about a pair of geometries share.

namespace bocst::fcl_adapter {

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

/// With so large a tolerance, in lattice units, the floats of a walk no longer tell how far two geometries are apart:
/// those that areOutOfSight() are not to be walked.
constexpr double kMostTolerance = 1e15;
/// True if the distance of two points exceeds the sizes of what is about them, and a margin, by far. Halves do not
/// overflow.
inline bool areOutOfSight(const Eigen::Vector3d& p, const Eigen::Vector3d& q, double sizes, double margin) {
  return (p / 2 - q / 2).cwiseAbs().maxCoeff() > 8 * sizes + margin;
}

/// What is no farther touches: the sum of what the two ask for.
template <typename S>
double marginOf(const Model<S>* model1, const Model<S>* model2) {
  // The trees' options: a query reads them anyway.
  return (model1 != nullptr ? treeOf(*model1).options().margin : 0) +
         (model2 != nullptr ? treeOf(*model2).options().margin : 0);
}

/// The mesh of a model as host memory has it now, null for another geometry.
template <typename S>
std::shared_ptr<const Mesh> meshOf(const Model<S>* model) {
  const tree::Tree* const tree = model != nullptr ? ModelTree::of(*model) : nullptr;
  return tree != nullptr ? tree->mesh() : nullptr;
}

/// The pose of B in A's frame, computed in S as FCL does. Spelled out: Eigen's products of blocks are calls.
template <typename S>
struct RelativePose {
  S rotation[3][3];
  S translation[3];

  RelativePose(const fcl::Transform3<S>& X_WA, const fcl::Transform3<S>& X_WB) {
    const S *a = X_WA.matrix().data(), *b = X_WB.matrix().data();  // columns of four
    const S displacement[3] = {b[12] - a[12], b[13] - a[13], b[14] - a[14]};
#pragma GCC unroll 3
    for (int r = 0; r < 3; ++r) {
      const S* axis = a + 4 * r;
#pragma GCC unroll 3
      for (int c = 0; c < 3; ++c) rotation[r][c] = axis[0] * b[4 * c] + axis[1] * b[4 * c + 1] + axis[2] * b[4 * c + 2];
      translation[r] = axis[0] * displacement[0] + axis[1] * displacement[1] + axis[2] * displacement[2];
    }
  }

  /// The pose of A in B's frame. Not A's rotation transposed: X_AB need not be quite rigid.
  RelativePose inverse() const {
    Eigen::Matrix3d R;
    Eigen::Vector3d p;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) R(r, c) = rotation[r][c];
      p[r] = translation[r];
    }
    R = R.inverse().eval();
    p = -(R * p).eval();
    RelativePose X_BA;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) X_BA.rotation[r][c] = static_cast<S>(R(r, c));
      X_BA.translation[r] = static_cast<S>(p[r]);
    }
    return X_BA;
  }

  /// Positions in A's frame are at most this large, for sizes of A and B in their own.
  double magnitude(double size_a, double size_b) const {
    const double x = translation[0], y = translation[1], z = translation[2];
    return std::sqrt(x * x + y * y + z * z) + 2 * (size_a + size_b);
  }

 private:
  RelativePose() = default;
};

/// From the frame of B (origin and unit in B's model frame) to that of A, through the pose X_AB in model units.
template <typename S>
query::SimilarityTransform similarityOf(const RelativePose<S>& X_AB, const Eigen::Vector3d& origin_a, double unit_a,
                                        const Eigen::Vector3d& origin_b, double unit_b, double magnitude) {
  query::SimilarityTransform p;
  const double per_unit = 1 / unit_a;
#pragma GCC unroll 3
  for (int r = 0; r < 3; ++r) {
    double at = static_cast<double>(X_AB.translation[r]) - origin_a[r];
#pragma GCC unroll 3
    for (int c = 0; c < 3; ++c) {
      p.rotation(r, c) = static_cast<double>(X_AB.rotation[r][c]);
      at += p.rotation(r, c) * origin_b[c];
    }
    p.translation[r] = at * per_unit;
  }
  p.scale = unit_b / unit_a;
  // What FCL's triangle test, which computes R q + t in S, may take for a contact.
  p.tolerance = roundingOf<S>(magnitude) * per_unit;
  const auto dot = [&p](int c, int d) {
    return p.rotation(0, c) * p.rotation(0, d) + p.rotation(1, c) * p.rotation(1, d) +
           p.rotation(2, c) * p.rotation(2, d);
  };
  // By value: of references the compiler makes branches.
  const auto larger = [](double x, double y) { return x > y ? x : y; };
  p.orthogonality_error =
      larger(larger(larger(std::abs(dot(0, 0) - 1), std::abs(dot(1, 1) - 1)), std::abs(dot(2, 2) - 1)),
             larger(larger(std::abs(dot(0, 1)), std::abs(dot(0, 2))), std::abs(dot(1, 2))));
  p.ready();
  return p;
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

/// The partner of a model as a side of a walk, see BvhSide(). @throws std::invalid_argument when it is no finished
/// BVHModel of triangles.
template <typename S>
BvhSide bvhSideOf(const char* query, const fcl::CollisionGeometry<S>* partner) {
  std::optional<BvhSide> side;
  withBvh<S>(query, partner, [&](const auto& bvh) { side.emplace(query, bvh); });
  return *side;
}

}  // namespace bocst::fcl_adapter
