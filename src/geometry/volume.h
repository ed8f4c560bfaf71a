// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <cmath>
#include <utility>

#include "bounds/node_bounds.h"
#include "geometry/overlap_kernels.h"
#include "geometry/triangle.h"
#include "lattice/lattice.h"

namespace bocst::query {

using bounds::Volume;

/// A box with axes of its own and no slab: the volume of a partner's node.
struct OrientedVolume {
  Eigen::Vector3d center;
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();  ///< Columns: the box's unit axes.
  Eigen::Vector3d half;
  float seen_axes[3][3] = {};  // what seenFrom() points at
};

/// A sphere in the frame of its side.
struct Sphere {
  Eigen::Vector3d center;
  double radius = 0;
};

/// From the frame of one side to that of the other: x' = scale * rotation * x + translation.
struct SimilarityTransform {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  double scale = 1;
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  double tolerance = 0;  ///< A length in the target frame: what positions may be off by; touching within it counts.
  double margin = 0;     ///< The same: surfaces at most this far apart certainly touch. Included in `tolerance`.
  double orthogonality_error = 0;  ///< Largest entry of rotation^T rotation - 1: what the axes tests must allow for.
  float axes[3][3] = {};           ///< axes[j]: column j of rotation; set by ready().
  float rounding_margin = 0;       ///< Per unit of size, see overlappingOctants(); set by ready().

  /// To be called when rotation and orthogonality_error are set.
  void ready() {
#pragma GCC unroll 3
    for (int j = 0; j < 3; ++j) {
#pragma GCC unroll 3
      for (int k = 0; k < 3; ++k) axes[j][k] = static_cast<float>(rotation(k, j));
    }
    rounding_margin = static_cast<float>((128 * 0x1p-24 + 4 * orthogonality_error) * 1.0001);
  }

  Eigen::Vector3d operator*(const Eigen::Vector3d& x) const { return scale * (rotation * x) + translation; }

  SimilarityTransform inverse() const {
    SimilarityTransform p;
    // Not the transposed rotation: far from the origin, what that is off by would move things.
    p.rotation = rotation.inverse();
    p.scale = 1 / scale;
    p.translation = -p.scale * (p.rotation * translation);
    p.tolerance = tolerance * p.scale;
    p.margin = margin * p.scale;
    p.orthogonality_error = orthogonality_error;
    p.ready();
    return p;
  }
};

inline Sphere placed(const Sphere& s, const SimilarityTransform& to) { return {to * s.center, s.radius * to.scale}; }
inline Corners placed(const Corners& c, const SimilarityTransform& to) { return {to * c[0], to * c[1], to * c[2]}; }

/// The volume as the octants of a cell see it; `corner` is the cell's minimum corner, `side` that of its octants.
inline OneVolume seenFrom(const Volume& v, const SimilarityTransform& to, const double* corner, double side) {
  OneVolume o;
  const double inverse = 1 / side, shrink = to.scale * inverse;
  const float scale = static_cast<float>(shrink);
  const double* r = to.rotation.data();  // column by column
  const double x = v.center[0], y = v.center[1], z = v.center[2];
  o.center[0] =
      static_cast<float>((r[0] * x + r[3] * y + r[6] * z) * shrink + (to.translation[0] - corner[0]) * inverse);
  o.center[1] =
      static_cast<float>((r[1] * x + r[4] * y + r[7] * z) * shrink + (to.translation[1] - corner[1]) * inverse);
  o.center[2] =
      static_cast<float>((r[2] * x + r[5] * y + r[8] * z) * shrink + (to.translation[2] - corner[2]) * inverse);
  o.half[0] = v.half[0] * scale;
  o.half[1] = v.half[1] * scale;
  o.half[2] = v.half[2] * scale;
  const float n0 = v.normal[0], n1 = v.normal[1], n2 = v.normal[2];
  o.normal[0] = n0 * to.axes[0][0] + n1 * to.axes[1][0] + n2 * to.axes[2][0];
  o.normal[1] = n0 * to.axes[0][1] + n1 * to.axes[1][1] + n2 * to.axes[2][1];
  o.normal[2] = n0 * to.axes[0][2] + n1 * to.axes[1][2] + n2 * to.axes[2][2];
  o.slab_offset = v.slab_offset * scale;
  o.slab_half = v.slab_half * scale;
  o.axes = to.axes;
  const float size =
      4 + std::abs(o.center[0]) + std::abs(o.center[1]) + std::abs(o.center[2]) + o.half[0] + o.half[1] + o.half[2];
  o.rounding_margin = size * to.rounding_margin + static_cast<float>(to.tolerance * inverse);
  return o;
}

inline OneVolume seenFrom(OrientedVolume& v, const SimilarityTransform& to, const double* corner, double side) {
  OneVolume o;
  const double inverse = 1 / side, scale = to.scale * inverse;
  const Eigen::Vector3d center = (to * v.center - Eigen::Vector3d(corner[0], corner[1], corner[2])) * inverse;
  const Eigen::Matrix3d axes = to.rotation * v.axes;
  for (int k = 0; k < 3; ++k) {
    o.center[k] = static_cast<float>(center[k]);
    o.half[k] = static_cast<float>(v.half[k] * scale);
    o.normal[k] = 0;
    for (int j = 0; j < 3; ++j) v.seen_axes[j][k] = static_cast<float>(axes(k, j));
  }
  o.axes = v.seen_axes;
  o.slab_offset = 0;
  o.slab_half = 0;
  const double size = center.lpNorm<1>() + v.half.lpNorm<1>() * scale + 4;
  o.rounding_margin = static_cast<float>(size) * to.rounding_margin + static_cast<float>(to.tolerance * inverse);
  return o;
}

/// A box with axes of its own in the frame of the side that sees it.
struct PlacedVolume {
  double center[3];
  double half[3];    ///< Along the axes.
  float axes[3][3];  ///< axes[j]: unit axis j.
};

inline PlacedVolume placed(const OrientedVolume& v, const SimilarityTransform& to) {
  PlacedVolume p;
  const Eigen::Vector3d center = to * v.center;
  for (int k = 0; k < 3; ++k) {
    p.center[k] = center[k];
    p.half[k] = v.half[k] * to.scale;
    const Eigen::Vector3d axis = to.rotation * v.axes.col(k);
    for (int c = 0; c < 3; ++c) p.axes[k][c] = static_cast<float>(axis[c]);
  }
  return p;
}

/// `to`: what placed the volume.
inline OneVolume seenFrom(const PlacedVolume& v, const SimilarityTransform& to, const double* corner, double side) {
  OneVolume o;
  const double inverse = 1 / side;
  double size = 4;
  for (int k = 0; k < 3; ++k) {
    const double center = (v.center[k] - corner[k]) * inverse, half = v.half[k] * inverse;
    o.center[k] = static_cast<float>(center);
    o.half[k] = static_cast<float>(half);
    o.normal[k] = 0;
    size += std::abs(center) + half;
  }
  o.axes = v.axes;
  o.slab_offset = 0;
  o.slab_half = 0;
  o.rounding_margin = static_cast<float>(size) * to.rounding_margin + static_cast<float>(to.tolerance * inverse);
  return o;
}

inline OrientedVolume oriented(const Volume& v) {
  OrientedVolume o;
  for (int k = 0; k < 3; ++k) {
    o.center[k] = v.center[k];
    o.half[k] = v.half[k] * (1 + 0x1p-22);  // it was rounded to float
  }
  return o;
}
inline const OrientedVolume& oriented(const OrientedVolume& v) { return v; }

/// The box about a triangle: along its longest edge, across that in its plane, and along its normal.
inline OrientedVolume boxAbout(const Corners& c) {
  Eigen::Vector3d edge = c[1] - c[0], other = c[2] - c[0];
  if (other.squaredNorm() > edge.squaredNorm()) std::swap(edge, other);
  const Eigen::Vector3d third = c[2] - c[1];
  if (third.squaredNorm() > edge.squaredNorm()) edge = third;
  OrientedVolume v;
  const double length = edge.norm();
  // Any axes at right angles will do: the extents are found along what they are.
  if (length > 0) {
    const Eigen::Vector3d along = edge / length;
    Eigen::Vector3d across = other - other.dot(along) * along;
    if (!(across.norm() > 1e-6 * length)) across = along.unitOrthogonal();
    v.axes.col(0) = along;
    v.axes.col(1) = (across - across.dot(along) * along).normalized();
    v.axes.col(2) = along.cross(v.axes.col(1));
  }
  Eigen::Matrix3d in_axes;
  for (int k = 0; k < 3; ++k) in_axes.col(k) = v.axes.transpose() * c[static_cast<std::size_t>(k)];
  const Eigen::Vector3d low = in_axes.rowwise().minCoeff(), high = in_axes.rowwise().maxCoeff();
  v.center = v.axes * ((low + high) / 2);
  v.half = (high - low) / 2;
  v.half.array() += 32 * 0x1p-53 * in_axes.cwiseAbs().sum();
  return v;
}

/// The corners of a box, placed.
inline void cornersOf(const OrientedVolume& box, const SimilarityTransform& to, Eigen::Vector3d (&corners)[8]) {
  const Eigen::Vector3d center = to * box.center;
  const Eigen::Matrix3d edges = to.rotation * box.axes * (box.half * to.scale).asDiagonal();
  for (int i = 0; i < 8; ++i) {
    corners[i] = center + edges * Eigen::Vector3d(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1);
  }
}

/// True if the two boxes are surely apart. The fifteen axes in double; `to` places b in a's frame. For the few pairs
/// that no kernel sees.
inline bool boxesApart(const OrientedVolume& a, const OrientedVolume& b, const SimilarityTransform& to) {
  const Eigen::Matrix3d r = a.axes.transpose() * (to.rotation * b.axes);
  const Eigen::Vector3d t = a.axes.transpose() * (to * b.center - a.center), h = b.half * to.scale;
  const double rounding_margin =
      (t.lpNorm<1>() + a.half.lpNorm<1>() + h.lpNorm<1>()) * (64 * 0x1p-53 + 4 * to.orthogonality_error) + to.tolerance;
  const Eigen::Matrix3d s = r.cwiseAbs();
  for (int i = 0; i < 3; ++i) {
    if (std::abs(t[i]) > a.half[i] + s.row(i).dot(h) + rounding_margin) return true;
    if (std::abs(r.col(i).dot(t)) > h[i] + s.col(i).dot(a.half) + rounding_margin) return true;
  }
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      const double d = t[i2] * r(i1, j) - t[i1] * r(i2, j);
      const double extent = a.half[i1] * s(i2, j) + a.half[i2] * s(i1, j) + h[j1] * s(i, j2) + h[j2] * s(i, j1);
      if (std::abs(d) > extent + 2 * rounding_margin) return true;
    }
  }
  return false;
}

/// The same by the six face axes alone, for volumes along their frames' axes. Of the roots: what only an edge axis
/// parts is parted one step later.
inline bool facesApart(const Volume& a, const Volume& b, const SimilarityTransform& to) {
  const double* r = to.rotation.data();  // column by column
  double displacement[3], b_half[3], sum = 0;
#pragma GCC unroll 3
  for (int k = 0; k < 3; ++k) {
    b_half[k] = static_cast<double>(b.half[k]) * to.scale;
    displacement[k] = to.scale * (r[k] * b.center[0] + r[k + 3] * b.center[1] + r[k + 6] * b.center[2]) +
                      to.translation[k] - a.center[k];
    sum += std::abs(displacement[k]) + static_cast<double>(a.half[k]) + b_half[k];
  }
  // Half extents were rounded to float.
  const double rounding_margin = sum * (0x1p-22 + 4 * to.orthogonality_error) + to.tolerance;
  bool apart = false;
#pragma GCC unroll 3
  for (int k = 0; k < 3; ++k) {
    const double reach_b = std::abs(r[k]) * b_half[0] + std::abs(r[k + 3]) * b_half[1] + std::abs(r[k + 6]) * b_half[2];
    apart |= std::abs(displacement[k]) > static_cast<double>(a.half[k]) + reach_b + rounding_margin;
    const double* axis = r + 3 * k;
    const double along = axis[0] * displacement[0] + axis[1] * displacement[1] + axis[2] * displacement[2];
    const double reach_a = std::abs(axis[0]) * static_cast<double>(a.half[0]) +
                           std::abs(axis[1]) * static_cast<double>(a.half[1]) +
                           std::abs(axis[2]) * static_cast<double>(a.half[2]);
    apart |= std::abs(along) > b_half[k] + reach_a + rounding_margin;
  }
  return apart;
}

}  // namespace bocst::query
