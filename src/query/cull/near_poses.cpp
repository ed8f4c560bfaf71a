// SPDX-License-Identifier: BSD-3-Clause
#include "query/cull/near_poses.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/cull/near_poses.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <type_traits>

#include "simd/vectors-inl.h"

HWY_BEFORE_NAMESPACE();
namespace bocst::query::HWY_NAMESPACE {

// One pose a lane. More than four lanes gain nothing: memory does not bring more.
using Dd = hn::CappedTag<double, 4>;
using Vd = hn::Vec<Dd>;
using Md = hn::Mask<Dd>;
using Vec3d = Vec3Of<Vd>;
constexpr std::size_t kLanes = 4;

HWY_INLINE Vec3d broadcast(const double (&v)[3]) {
  const Dd d;
  return {hn::Set(d, v[0]), hn::Set(d, v[1]), hn::Set(d, v[2])};
}

// Numbers i and i + 1 of the poses from X on.
HWY_INLINE void loadPair(const double* X, std::size_t i, Vd& first, Vd& second) {
  const Dd d;
#if HWY_TARGET == HWY_SCALAR
  first = hn::Set(d, X[i]);
  second = hn::Set(d, X[i + 1]);
#else
  Vd even = hn::LoadDup128(d, X + i), odd = hn::LoadDup128(d, X + 16 + i);
  if (hn::Lanes(d) == 4) {
    even = hn::ConcatUpperLower(d, hn::LoadDup128(d, X + 32 + i), even);
    odd = hn::ConcatUpperLower(d, hn::LoadDup128(d, X + 48 + i), odd);
  }
  first = hn::InterleaveLower(d, even, odd);
  second = hn::InterleaveUpper(d, even, odd);
#endif
}

struct LanesOfPoses {
  Vec3d column[3], translation;
  Vec3d last_row;
  Vd last;
};

HWY_INLINE LanesOfPoses load(const double* X, bool rows) {
  Vd m[16];
#pragma GCC unroll 8
  for (std::size_t i = 0; i < 16; i += 2) loadPair(X, i, m[i], m[i + 1]);
  if (rows)
    return {{{m[0], m[4], m[8]}, {m[1], m[5], m[9]}, {m[2], m[6], m[10]}},
            {m[3], m[7], m[11]},
            {m[12], m[13], m[14]},
            m[15]};
  return {
      {{m[0], m[1], m[2]}, {m[4], m[5], m[6]}, {m[8], m[9], m[10]}}, {m[12], m[13], m[14]}, {m[3], m[7], m[11]}, m[15]};
}

HWY_INLINE Md haveRotations(const LanesOfPoses& X) {
  const Dd d;
  const Vd one = hn::Set(d, 1.0);
  const Vd squares =
      hn::Add(dot(X.column[0], X.column[0]), hn::Add(dot(X.column[1], X.column[1]), dot(X.column[2], X.column[2])));
  const Vd determinant = dot(X.column[0], cross(X.column[1], X.column[2]));
  const Vd stretch = hn::Abs(hn::Sub(squares, hn::Set(d, 3.0)));
  const Vd shear = hn::Sub(hn::Sub(squares, hn::Add(determinant, determinant)), one);
  const Md rigid = hn::And(hn::Le(stretch, hn::Set(d, kPoseStretch)), hn::Le(shear, hn::Set(d, kPoseShear)));
  return hn::And(rigid, hn::And(hn::Eq(norm1(X.last_row), hn::Zero(d)), hn::Eq(X.last, one)));
}

HWY_INLINE Md areApartByAxes(const PoseBoxes& boxes, const LanesOfPoses& X, Vec3d displacement, Vd allowed) {
  const Dd d;
  const Vec3d turned[3] = {abs(X.column[0]), abs(X.column[1]), abs(X.column[2])};
  Vec3d b = {allowed, allowed, allowed};
  for (std::size_t k = 0; k < 3; ++k) {
    displacement = along(displacement, hn::Set(d, boxes.middle_b[k]), X.column[k]);
    b = along(b, hn::Set(d, boxes.half_b[k]), turned[k]);
  }
  const Vec3d half_a = broadcast(boxes.half_a), gap = sub(sub(abs(displacement), half_a), b);
  Vd largest = max3(gap.x, gap.y, gap.z);
  for (std::size_t k = 0; k < 3; ++k) {
    const Vd extent = hn::Add(dot(half_a, turned[k]), hn::Add(hn::Set(d, boxes.along_b[k]), allowed));
    largest = hn::Max(largest, hn::Sub(hn::Abs(dot(displacement, X.column[k])), extent));
  }
  return hn::Gt(largest, hn::Zero(d));
}

template <typename S>
std::size_t find(const PoseBoxes& boxes, const S* X_AB, bool rows, std::size_t count, std::uint32_t* near) {
  const Dd d;
  const std::size_t lanes = hn::Lanes(d);
  HWY_ALIGN double copy[16 * kLanes] = {};
  std::size_t found = 0;
  for (std::size_t first = 0; first < count; first += lanes) {
    const std::size_t poses = std::min(lanes, count - first);
    const double* from = copy;
    if constexpr (std::is_same<S, double>::value) {
      if (poses == lanes) from = X_AB + 16 * first;
    }
    if (from == copy) std::copy(X_AB + 16 * first, X_AB + 16 * (first + poses), copy);
    const LanesOfPoses X = load(from, rows);
    const Vec3d displacement = sub(X.translation, broadcast(boxes.middle_a));
    // Of a translation that is not finite, this is not, so it parts nothing.
    const Vd allowed =
        hn::MulAdd(hn::Set(d, boxes.allowed_per_length), norm1(X.translation), hn::Set(d, boxes.allowed));
    const Vd far = hn::Add(hn::Set(d, boxes.radius_sum), allowed);
    Md apart = hn::Gt(dot(displacement, displacement), hn::Mul(far, far));
    // Most of a planner's poses end here.
    if (!hn::AllTrue(d, apart)) apart = hn::Or(apart, areApartByAxes(boxes, X, displacement, allowed));
    const unsigned settled = bitsOf(d, hn::And(apart, haveRotations(X)));
    for (unsigned left = ~settled & ((1u << poses) - 1); left != 0; left &= left - 1) {
      near[found++] = static_cast<std::uint32_t>(first) + static_cast<std::uint32_t>(__builtin_ctz(left));
    }
  }
  return found;
}

// Called twice with a constant, so that the loop does not test `rows`.
std::size_t FindNearPosesDouble(const PoseBoxes& boxes, const double* X_AB, bool rows, std::size_t count,
                                std::uint32_t* near) {
  return rows ? find(boxes, X_AB, true, count, near) : find(boxes, X_AB, false, count, near);
}
std::size_t FindNearPosesFloat(const PoseBoxes& boxes, const float* X_AB, bool rows, std::size_t count,
                               std::uint32_t* near) {
  return rows ? find(boxes, X_AB, true, count, near) : find(boxes, X_AB, false, count, near);
}

}  // namespace bocst::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bocst::query {

HWY_EXPORT(FindNearPosesDouble);
HWY_EXPORT(FindNearPosesFloat);

template <>
std::size_t findNearPoses(const PoseBoxes& boxes, const double* X_AB, bool rows, std::size_t count,
                          std::uint32_t* near) {
  return HWY_DYNAMIC_DISPATCH(FindNearPosesDouble)(boxes, X_AB, rows, count, near);
}
template <>
std::size_t findNearPoses(const PoseBoxes& boxes, const float* X_AB, bool rows, std::size_t count,
                          std::uint32_t* near) {
  return HWY_DYNAMIC_DISPATCH(FindNearPosesFloat)(boxes, X_AB, rows, count, near);
}

}  // namespace bocst::query
#endif
