// SPDX-License-Identifier: BSD-3-Clause
#include "query/cull/far_apart.h"

#include <cmath>

#include "simd/float4.h"

namespace bocst::query {
namespace {

using simd::Float4;
using simd::lane;

/// A box turned as in the world. Lane k of `half` is about axis k; lanes 3 are not used.
struct TurnedBox {
  Float4 axes[3], center, half;
  float radius;
};

// The matrix of these columns times v.
Float4 product(const Float4 (&columns)[3], Float4 v) {
  return columns[0] * lane<0>(v) + columns[1] * lane<1>(v) + columns[2] * lane<2>(v);
}

struct BoxReader {
  const tree::Outline::Box& box;
  Float4 axis(std::size_t k) const { return simd::load(box.axes[k].direction); }
  Float4 center() const { return simd::load(box.center); }
};

// Inlined, or its answer goes through memory.
template <typename Reader, typename S>
__attribute__((always_inline)) inline TurnedBox turn(const Reader& box, const S* X) {
  const Float4 R[3] = {simd::load(X), simd::load(X + 4), simd::load(X + 8)};
  const Float4 x = box.axis(0), y = box.axis(1), z = box.axis(2), center = box.center();
  const Float4 half_xy = __builtin_shufflevector(x, y, 3, 7, 3, 7);
  return {{product(R, x), product(R, y), product(R, z)},
          product(R, center),
          __builtin_shufflevector(half_xy, z, 0, 1, 7, 7),
          center[3]};
}

// Lanes 1 2 0 and 2 0 1: the next of three, and the one after it.
Float4 next(Float4 v) { return __builtin_shufflevector(v, v, 1, 2, 0, 3); }
Float4 afterNext(Float4 v) { return __builtin_shufflevector(v, v, 2, 0, 1, 3); }

// Along the product of any axis i of a, a lane each, and axis J of b. Their products are at most 1 long, so a gap along
// them is no shorter than it looks. `cosines` are of the angles between axis i and each of b.
template <int J>
simd::Int4 areApartByProducts(Float4 displacement, Float4 half_a, const Float4 (&cosines)[3], Float4 half_b,
                              Float4 least) {
  constexpr int kNext = (J + 1) % 3, kAfter = (J + 2) % 3;
  const Float4 cosine = cosines[J], size = simd::abs(cosine);
  const Float4 distance = simd::abs(afterNext(displacement) * next(cosine) - next(displacement) * afterNext(cosine));
  const Float4 extent_a = next(half_a) * afterNext(size) + afterNext(half_a) * next(size);
  const Float4 extent_b =
      lane<kNext>(half_b) * simd::abs(cosines[kAfter]) + lane<kAfter>(half_b) * simd::abs(cosines[kNext]);
  return distance - extent_a - extent_b > least;
}

/// Two turned boxes along their axes.
struct Projections {
  Float4 along_a, along_b;               // the displacement of the centres
  Float4 cosines[3];                     // of the axes of a, a lane each, and axis j of b
  Float4 sizes[3], transposed_sizes[3];  // of these cosines, and with the boxes changed over
  float squared, length;                 // of the displacement

  // Face axes: a gap along one of them is larger than `least`.
  bool facesBeyond(const TurnedBox& a, const TurnedBox& b, Float4 least) const {
    return simd::any((simd::abs(along_a) - a.half - product(sizes, b.half) > least) |
                     (simd::abs(along_b) - b.half - product(transposed_sizes, a.half) > least));
  }
};

// `translation` is that of b minus that of a.
__attribute__((always_inline)) inline Projections project(const TurnedBox& a, const TurnedBox& b, Float4 translation) {
  Projections p;
  const Float4 displacement = translation + b.center - a.center;
  const Float4 none = {0, 0, 0, 0};
  // Row c: coordinate c of each axis of a. So what is a sum over rows has a lane for each axis, and 0 in lane 3.
  Float4 rows_a[3] = {a.axes[0], a.axes[1], a.axes[2]}, rest = none;
  simd::transpose(rows_a[0], rows_a[1], rows_a[2], rest);
  p.along_a = product(rows_a, displacement);
  const Float4 squares = p.along_a * p.along_a;
  p.squared = squares[0] + squares[1] + squares[2];
  p.length = std::sqrt(p.squared);
#pragma GCC unroll 3
  for (int j = 0; j < 3; ++j) p.cosines[j] = product(rows_a, b.axes[j]);
  Float4 transposed[3] = {p.cosines[0], p.cosines[1], p.cosines[2]};
  rest = none;
  simd::transpose(transposed[0], transposed[1], transposed[2], rest);
  p.along_b = product(transposed, p.along_a);
#pragma GCC unroll 3
  for (int j = 0; j < 3; ++j) {
    p.sizes[j] = simd::abs(p.cosines[j]);
    p.transposed_sizes[j] = simd::abs(transposed[j]);
  }
  return p;
}

// What the numbers of areFarApart() may be off by.
float slackOf(const Projections& p, const TurnedBox& a, const TurnedBox& b) {
  return 2e-4f * (p.length + 2 * (a.radius + b.radius));
}

__attribute__((always_inline)) inline bool areFarApart(const TurnedBox& a, const TurnedBox& b, Float4 translation,
                                                       float margin) {
  const Projections p = project(a, b, translation);
  // The square may vanish. Where it is infinite, so is the gap that is asked for.
  if (!(p.squared > 1e-30f)) return false;
  const float gap = 1.001f * margin + slackOf(p, a, b);
  const Float4 least = {gap, gap, gap, gap};
  if (p.facesBeyond(a, b, least)) return true;
  const Float4 extents = simd::abs(p.along_a) * a.half + simd::abs(p.along_b) * b.half;
  if (p.squared - extents[0] - extents[1] - extents[2] > gap * p.length) return true;
  return simd::any(areApartByProducts<0>(p.along_a, a.half, p.cosines, b.half, least) |
                   areApartByProducts<1>(p.along_a, a.half, p.cosines, b.half, least) |
                   areApartByProducts<2>(p.along_a, a.half, p.cosines, b.half, least));
}

__attribute__((always_inline)) inline bool facesMayPart(const TurnedBox& a, const TurnedBox& b, Float4 translation) {
  const Projections p = project(a, b, translation);
  const float least = -slackOf(p, a, b);
  return p.facesBeyond(a, b, Float4{least, least, least, least});
}

// In the frame of a side; false where float cannot hold it, or where it is being changed.
bool outlineOf(const TreeSide& side, OrientedVolume& volume) {
  return side.tree().outline().read([&](const tree::Outline::Reader& box) {
    const Float4 center = box.center();
    if (!(center[3] > 1e-30f)) return false;
    const auto direction = [&box](std::size_t k) {
      const Float4 axis = box.axis(k);
      return Eigen::Vector3d(static_cast<double>(axis[0]), static_cast<double>(axis[1]), static_cast<double>(axis[2]));
    };
    // At right angles again, as they were before they were rounded to float.
    const Eigen::Vector3d first = direction(0).normalized(), second = direction(1);
    volume.axes.col(0) = first;
    volume.axes.col(1) = (second - first.dot(second) * first).normalized();
    volume.axes.col(2) = volume.axes.col(0).cross(volume.axes.col(1));
    if (volume.axes.col(2).dot(direction(2)) < 0) volume.axes.col(2) *= -1;
    for (int k = 0; k < 3; ++k) {
      // The centre, the axes and the half sides were rounded.
      volume.half[k] =
          static_cast<double>(box.half(static_cast<std::size_t>(k))) + 0x1p-21 * static_cast<double>(center[3]);
      volume.center[k] = static_cast<double>(center[k]);
    }
    volume.half *= side.inverseUnit();
    volume.center = (volume.center - side.origin()) * side.inverseUnit();
    return true;
  });
}

}  // namespace

template <typename S>
bool mayBeApart(const tree::Outline& a, const S* X_WA, const tree::Outline& b, const S* X_WB) {
  const Float4 translation = simd::loadDifference(X_WB + 12, X_WA + 12);
  return a.read([&](const tree::Outline::Reader& box_a) {
    return b.read([&](const tree::Outline::Reader& box_b) {
      return facesMayPart(turn(box_a, X_WA), turn(box_b, X_WB), translation);
    });
  });
}

bool outlinesApart(const TreeSide& a, const TreeSide& b, const SimilarityTransform& b_in_a) {
  OrientedVolume of_a, of_b;
  return outlineOf(a, of_a) && outlineOf(b, of_b) && boxesApart(of_a, of_b, b_in_a);
}

bool outlinesHardlyOverlap(const TreeSide& a, const TreeSide& b, const SimilarityTransform& b_in_a) {
  OrientedVolume of_b;
  return outlineOf(b, of_b) && outlinesHardlyOverlap(a, of_b, b_in_a);
}

bool outlinesHardlyOverlap(const TreeSide& a, const OrientedVolume& of_b, const SimilarityTransform& b_in_a) {
  constexpr double kLittle = 0.05;  // of the smaller one's length
  OrientedVolume of_a;
  if (!outlineOf(a, of_a)) return false;

  const Eigen::Matrix3d r = of_a.axes.transpose() * (b_in_a.rotation * of_b.axes), s = r.cwiseAbs();
  const Eigen::Vector3d t = of_a.axes.transpose() * (b_in_a * of_b.center - of_a.center),
                        half = b_in_a.scale * of_b.half;
  const double little = kLittle * std::min(of_a.half.maxCoeff(), half.maxCoeff());
  const Eigen::Array3d along_a = of_a.half + s * half - t.cwiseAbs();
  const Eigen::Array3d along_b = half + s.transpose() * of_a.half - (r.transpose() * t).cwiseAbs();
  return std::min(along_a.minCoeff(), along_b.minCoeff()) + b_in_a.margin < little;
}

bool outlinesCoincide(const TreeSide& a, const TreeSide& b, const SimilarityTransform& b_in_a) {
  constexpr double kAbout = 0.05;  // of the length
  OrientedVolume of_a, of_b;
  if (!outlineOf(a, of_a) || !outlineOf(b, of_b)) return false;
  // Their corners, up to the signs of the axes.
  const Eigen::Matrix3d r = (of_a.axes.transpose() * (b_in_a.rotation * of_b.axes)).cwiseAbs();
  const Eigen::Vector3d apart = b_in_a * of_b.center - of_a.center;
  const Eigen::Vector3d longer = b_in_a.scale * (r * of_b.half) - of_a.half;
  return apart.cwiseAbs().maxCoeff() + longer.cwiseAbs().maxCoeff() < kAbout * of_a.half.maxCoeff();
}

template <typename S>
bool areFarApart(const tree::Outline& a, const S* X_WA, const tree::Outline& b, const S* X_WB, double margin) {
  const Float4 translation = simd::loadDifference(X_WB + 12, X_WA + 12);
  return a.read([&](const tree::Outline::Reader& box_a) {
    return b.read([&](const tree::Outline::Reader& box_b) {
      return areFarApart(turn(box_a, X_WA), turn(box_b, X_WB), translation, static_cast<float>(margin));
    });
  });
}

template <typename S>
bool areFarApart(const tree::Outline& a, const S* X_WA, const tree::Outline::Box& b, const S* X_WB, double margin) {
  const Float4 translation = simd::loadDifference(X_WB + 12, X_WA + 12);
  return a.read([&](const tree::Outline::Reader& box_a) {
    return areFarApart(turn(box_a, X_WA), turn(BoxReader{b}, X_WB), translation, static_cast<float>(margin));
  });
}

#define BOCST_INSTANTIATE(S)                                                                         \
  template bool mayBeApart(const tree::Outline&, const S*, const tree::Outline&, const S*);          \
  template bool areFarApart(const tree::Outline&, const S*, const tree::Outline&, const S*, double); \
  template bool areFarApart(const tree::Outline&, const S*, const tree::Outline::Box&, const S*, double);
BOCST_INSTANTIATE(float)
BOCST_INSTANTIATE(double)
#undef BOCST_INSTANTIATE

}  // namespace bocst::query
