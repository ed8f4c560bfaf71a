// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/common/types.h>

#include <Eigen/LU>

#include "fcl/adapters/convex_shapes.h"
#include "fcl/adapters/pair.h"
#include "fcl/adapters/validate.h"
#include "query/sides/convex_side.h"
#include "query/sides/side.h"

// What the queries about a model and solid bodies share. All in double, in the frame of the bodies.

namespace bocst::fcl_adapter {

/// How a model at X_WM lies in the frame of a partner at X_WB. Rotations may be off by up to kMaxOrthogonalityError, so
/// they are inverted, not transposed: far from an origin the difference moves things.
template <typename S>
class ConvexFrame {
 public:
  ConvexFrame(const fcl::Transform3<S>& X_WM, const fcl::Transform3<S>& X_WB, const oracle::Surface& surface) {
    const Eigen::Matrix3d R_WM = X_WM.linear().template cast<double>(), R_WB = X_WB.linear().template cast<double>();
    const Eigen::Vector3d p = (X_WM.translation().template cast<double>() - X_WB.translation().template cast<double>());
    const Eigen::Matrix3d R_BW = R_WB.inverse();
    R_BM_ = R_BW * R_WM;
    p_BM_ = R_BW * p;
    R_MB_ = R_BM_.inverse();
    const Eigen::AlignedBox3d& bounds = surface.bounds;
    region_.center = *this * bounds.center();
    region_.radius = bounds.diagonal().norm() / 2;
    // FCL computes in the world, with world coordinates of either.
    rounding_ = roundingOf<S>(X_WM.translation().template cast<double>().norm() +
                              X_WB.translation().template cast<double>().norm() + region_.center.norm() +
                              2 * magnitudeOf(bounds));
    rounding_of_positions_ = rounding_;
    // Nor is a body in the world what it is in its frame; FCL takes some of its sizes from the one, some from the
    // other.
    rounding_ += 4 * (orthogonalityError(R_WM) + orthogonalityError(R_WB)) * (p_BM_.norm() + 2 * magnitudeOf(bounds));
    region_.radius = region_.radius * 1.001 + rounding_;
  }

  Eigen::Vector3d operator*(const Eigen::Vector3d& x) const { return R_BM_ * x + p_BM_; }

  /// The other way.
  Eigen::Vector3d toModel(const Eigen::Vector3d& x) const { return R_MB_ * (x - p_BM_); }

  /// A ball about the model.
  const query::Sphere& region() const { return region_; }

  /// What rounding in S, and rotations that are off, may do to positions.
  double rounding() const { return rounding_; }

  /// What rounding in S alone may do to them.
  double roundingOfPositions() const { return rounding_of_positions_; }

  /// From the frame of the bodies to the lattice of the model; touching within `tolerance` (model units) counts.
  query::SimilarityTransform toLattice(const lattice::Lattice& lattice, double tolerance) const {
    const double unit = lattice.unit();
    query::SimilarityTransform p;
    p.rotation = R_MB_;
    p.scale = 1 / unit;
    p.translation = -(p.rotation * p_BM_ + lattice.origin()) / unit;
    p.tolerance = tolerance / unit;
    p.orthogonality_error = orthogonalityError(p.rotation);
    p.ready();
    return p;
  }

 private:
  Eigen::Matrix3d R_BM_, R_MB_;
  Eigen::Vector3d p_BM_;
  query::Sphere region_;
  double rounding_, rounding_of_positions_;
};

}  // namespace bocst::fcl_adapter
