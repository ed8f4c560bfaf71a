// SPDX-License-Identifier: BSD-3-Clause
#include "query/cull/separation.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/cull/separation.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>

#include "simd/float4.h"
#include "simd/octants-inl.h"

#ifndef BOCST_SEPARATION_ONCE
#define BOCST_SEPARATION_ONCE
#if HWY_IS_TSAN || defined(__SANITIZE_THREAD__)  // Highway asks Clang only
#define BOCST_IS_TSAN 1
#else
#define BOCST_IS_TSAN 0
#endif
namespace bocst::query {
namespace {

using tree::SupportTable;

// Each iteration evaluates eight directions about the best one so far. Most pairs that are apart are found by the first
// iteration, nearly all by the fourth. The hulls of pairs that touch nearly always overlap by more than kHopeless of
// the smaller root's side in every direction, so most hits take one iteration or none; a small body on the outside of a
// large one may take all six.
constexpr int kIterations = 6;
constexpr float kFirstRadius = 0.45f, kHopeless = 0.12f, kHopelessLater = 0.5f;
constexpr float kShallow = 0.3f;  // 0.2 and 0.4 were no faster (share/doc/performance-record.md, "Warm exact queries")

}  // namespace

/// The pose of b's lattice in a's, in float; t is the displacement between the middles of the roots.
struct Between {
  float rotation[3][4];  // [j][k]: column j; the last entries are not used
  float t[4];
  float scale, tolerance, orthogonality_error;
};

}  // namespace bocst::query
#endif

HWY_BEFORE_NAMESPACE();
namespace bocst::query::HWY_NAMESPACE {

using VI = hn::Vec<hn::RebindToSigned<D>>;

// The corners of the cells whose first ones are at `at`: those with i, j; i, j + 1; i + 1, j; i + 1, j + 1. A lane at a
// time, since processors gather no faster.
HWY_INLINE void cornersOf(const SupportTable& supports, VI at, V (&corner)[4]) {
  const D d;
  const hn::RebindToSigned<D> di;
  alignas(64) std::int32_t lanes[8];
  hn::Store(at, di, lanes);
#if HWY_TARGET == HWY_SCALAR || BOCST_IS_TSAN
  // One by one, as ThreadSanitizer can follow it, too.
  constexpr int kCorner[4] = {0, 1, SupportTable::kRow, SupportTable::kRow + 1};
  alignas(64) float values[8];
  for (int k = 0; k < 4; ++k) {
    for (std::size_t lane = 0; lane < hn::Lanes(d); ++lane) values[lane] = supports.value(lanes[lane] + kCorner[k]);
    corner[k] = hn::Load(d, values);
  }
#else
  const hn::Full128<float> d4;
  const hn::Half<hn::Full128<float>> d2;
  const hn::Repartition<std::uint64_t, D> dw;
  const auto fourOf = [&](std::size_t lane) HWY_ATTR {
    const float* first = supports.values() + lanes[lane];
    return hn::Combine(d4, hn::LoadU(d2, first + SupportTable::kRow), hn::LoadU(d2, first));
  };
  V row[4];
  BOCST_UNROLL
  for (std::size_t k = 0; k < 4; ++k) {
#if HWY_MAX_BYTES >= 32
    row[k] = hn::Combine(d, fourOf(k + 4), fourOf(k));
#else
    row[k] = fourOf(k);
#endif
  }
  const auto even = hn::BitCast(dw, hn::InterleaveLower(d, row[0], row[1]));
  const auto even2 = hn::BitCast(dw, hn::InterleaveLower(d, row[2], row[3]));
  const auto odd = hn::BitCast(dw, hn::InterleaveUpper(d, row[0], row[1]));
  const auto odd2 = hn::BitCast(dw, hn::InterleaveUpper(d, row[2], row[3]));
  corner[0] = hn::BitCast(d, hn::InterleaveLower(dw, even, even2));
  corner[1] = hn::BitCast(d, hn::InterleaveUpper(dw, even, even2));
  corner[2] = hn::BitCast(d, hn::InterleaveLower(dw, odd, odd2));
  corner[3] = hn::BitCast(d, hn::InterleaveUpper(dw, odd, odd2));
#endif
}

/// The support of a surface in some directions, interpolated between three of the kept ones.
HWY_INLINE V supportOf(const SupportTable& supports, const V (&u)[3]) {
  const D d;
  const hn::RebindToSigned<D> di;
  const V zero = hn::Zero(d), one = hn::Set(d, 1), half = hn::Set(d, SupportTable::kCells / 2.0f);
  const V ax = hn::Abs(u[0]), ay = hn::Abs(u[1]), az = hn::Abs(u[2]);
  const M is_x = hn::And(hn::Ge(ax, ay), hn::Ge(ax, az)), is_y = hn::AndNot(is_x, hn::Ge(ay, az));
  const auto choose = [&](V x, V y, V z) { return hn::IfThenElse(is_x, x, hn::IfThenElse(is_y, y, z)); };
  const V major = choose(u[0], u[1], u[2]), size = hn::Abs(major), per = hn::Div(half, size);
  // What is not a number comes to some cell, too.
  const V last = hn::Set(d, SupportTable::kCells - 1);
  const auto cell = [&](V x, V& rest) {
    const V at = hn::MulAdd(x, per, half);
    const V i = hn::Max(hn::Min(hn::Floor(at), last), zero);
    rest = hn::Max(hn::Min(hn::Sub(at, i), one), zero);
    return i;
  };
  V rest_i, rest_j;
  const V i = cell(choose(u[1], u[2], u[0]), rest_i), j = cell(choose(u[2], u[0], u[1]), rest_j);
  const V high = hn::Max(rest_i, rest_j), low = hn::Min(rest_i, rest_j);
  const V face = hn::Add(choose(zero, hn::Set(d, 2), hn::Set(d, 4)), hn::IfThenElseZero(hn::Lt(major, zero), one));
  const V row = hn::Set(d, SupportTable::kRow);
  V corner[4];
  cornersOf(supports, hn::ConvertTo(di, hn::MulAdd(hn::MulAdd(face, row, i), row, j)), corner);
  const V inner = hn::Mul(hn::Sub(one, high), corner[0]), outer = hn::Mul(low, corner[3]);
  const V middle = hn::Mul(hn::Sub(high, low), hn::IfThenElse(hn::Ge(rest_i, rest_j), corner[2], corner[1]));
  return hn::Mul(size, hn::Add(hn::Add(inner, middle), outer));
}

// f of EightSeparations, and the largest of it. direction(lane, v) gives the directions.
template <typename F>
HWY_INLINE float values(const SupportTable& a, const SupportTable& b, const Between& g, F&& direction, float* value) {
  const D d;
  V most = hn::Set(d, -1e30f);
  for (std::size_t lane = 0; lane < 8; lane += hn::Lanes(d)) {
    V v[3], w[3], along = hn::Zero(d);
    direction(lane, v);
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) along = hn::MulAdd(hn::Set(d, g.t[k]), v[k], along);
    BOCST_UNROLL
    for (int j = 0; j < 3; ++j) {
      w[j] = hn::Mul(hn::Set(d, g.rotation[j][0]), v[0]);
      w[j] = hn::MulAdd(hn::Set(d, g.rotation[j][1]), v[1], w[j]);
      w[j] = hn::Neg(hn::MulAdd(hn::Set(d, g.rotation[j][2]), v[2], w[j]));
    }
    const V f = hn::NegMulAdd(hn::Set(d, g.scale), supportOf(b, w), hn::Sub(along, supportOf(a, v)));
    hn::StoreU(f, d, value + lane);
    most = hn::Max(most, f);
  }
  return hn::GetLane(hn::MaxOfLanes(d, most));
}

// Good to some bits, which is enough for directions: the test is valid for any.
HWY_INLINE float roughInverse(float x) {
  const hn::CappedTag<float, 1> d;
  return hn::GetLane(hn::ApproximateReciprocal(hn::Set(d, x)));
}

HWY_INLINE float roughInverseSqrt(float x) {
  const hn::CappedTag<float, 1> d;
  return hn::GetLane(hn::ApproximateReciprocalSqrt(hn::Set(d, x)));
}

// Directions about one of about unit length, `radius` away in the plane across it.
struct Ring {
  HWY_INLINE Ring(const float (&n)[3], float radius, const float (*circle_)[8])
      : middle{n[0], n[1], n[2]}, circle(circle_) {
    const float sign = std::copysign(1.0f, n[2]), a = -roughInverse(sign + n[2]), b = n[0] * n[1] * a;
    const float both[2][3] = {{1 + sign * n[0] * n[0] * a, sign * b, -sign * n[0]}, {b, sign + n[1] * n[1] * a, -n[1]}};
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) across[0][k] = both[0][k] * radius, across[1][k] = both[1][k] * radius;
  }
  HWY_INLINE void directions(std::size_t lane, V (&v)[3]) const {
    const D d;
    const V x = hn::Load(d, circle[0] + lane), y = hn::Load(d, circle[1] + lane);
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      v[k] = hn::MulAdd(hn::Set(d, across[0][k]), x, hn::MulAdd(hn::Set(d, across[1][k]), y, hn::Set(d, middle[k])));
    }
  }
  HWY_INLINE float entry(int k, std::size_t lane) const {
    return middle[k] + across[0][k] * circle[0][lane] + across[1][k] * circle[1][lane];
  }
  float middle[3], across[2][3];
  const float (*circle)[8];
};

HWY_ALIGN constexpr float kSevenAndMiddle[2][8] = {
    {0, 1, 0.6234898f, -0.2225209f, -0.9009689f, -0.9009689f, -0.2225209f, 0.6234898f},
    {0, 0, 0.7818315f, 0.9749279f, 0.4338837f, -0.4338837f, -0.9749279f, -0.7818315f}};
HWY_ALIGN constexpr float kEight[2][8] = {{1, 0.7071068f, 0, -0.7071068f, -1, -0.7071068f, 0, 0.7071068f},
                                          {0, 0.7071068f, 1, 0.7071068f, 0, -0.7071068f, -1, -0.7071068f}};

HWY_INLINE Between between(const SimilarityTransform& b_in_a) {
  constexpr double q = lattice::kMiddle;
  const double* r = b_in_a.rotation.data();
  Between g;
  for (int k = 0; k < 3; ++k) {
    for (int j = 0; j < 3; ++j) g.rotation[j][k] = b_in_a.axes[j][k];
    g.t[k] = static_cast<float>(b_in_a.translation[k] - q + q * b_in_a.scale * (r[k] + r[k + 3] + r[k + 6]));
  }
  g.scale = static_cast<float>(b_in_a.scale);
  g.tolerance = static_cast<float>(b_in_a.tolerance);
  g.orthogonality_error = static_cast<float>(b_in_a.orthogonality_error);
  return g;
}

// Which of eight values is the largest, given that; 8 if they are not numbers.
HWY_INLINE std::size_t largest(const float (&values)[8], float most) {
  const D d;
  unsigned bits = 1u << 8;
  for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
    bits |= bitsOf(D(), hn::Eq(hn::LoadU(d, values + i), hn::Set(d, most))) << i;
  }
  return static_cast<std::size_t>(__builtin_ctz(bits));
}

// The direction from the middle of a's bounds to that of b's, and how far that is.
HWY_INLINE float displacementBetweenMiddles(const SupportTable& a, const SupportTable& b, const Between& g,
                                            float (&n)[3]) {
  const float to[3] = {b.center(0), b.center(1), b.center(2)};
  float squared = 0;
  BOCST_UNROLL
  for (int k = 0; k < 3; ++k) {
    const float turned = g.rotation[0][k] * to[0] + g.rotation[1][k] * to[1] + g.rotation[2][k] * to[2];
    n[k] = g.t[k] + g.scale * turned - a.center(static_cast<std::size_t>(k));
    squared += n[k] * n[k];
  }
  const float per_length = roughInverseSqrt(squared), length = squared * per_length;
  for (float& x : n) x *= per_length;
  return length;
}

Hulls HullsBetween(const SupportTable& a, const SupportTable& b, const Between& g) {
  const float size = static_cast<float>(lattice::kMiddle) * (1 + g.scale);
  const float smaller = 2 * lattice::kMiddle * std::min(1.0f, g.scale);
  const float distance = std::abs(g.t[0]) + std::abs(g.t[1]) + std::abs(g.t[2]);
  const float rounding_margin = 1.25f * (64 * 0x1p-24f * (distance + 2 * size) + g.tolerance);
  float n[3];
  const float length = displacementBetweenMiddles(a, b, g, n);
  // False for NaN.
  if (!(length > 1e-6f * size && length < 0x1p50f && g.orthogonality_error < 1e-3f)) return Hulls::kUnknown;
  // No direction can do better than this; most hits are so deep.
  const float depth = a.innerRadius() + g.scale * b.innerRadius() - length - rounding_margin;
  if (depth > kHopeless * smaller) return Hulls::kMeet;

  float value[8], best = -1e30f, hopeless = -kHopeless * smaller, radius = kFirstRadius;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const Ring ring(n, radius, iteration == 0 ? kSevenAndMiddle : kEight);
    const auto directions = [&ring](std::size_t lane, V(&v)[3]) HWY_ATTR { ring.directions(lane, v); };
    const float most = values(a, b, g, directions, value);
    if (most > rounding_margin) return Hulls::kApart;
    const std::size_t lane = largest(value, most);
    if (lane == 8) return Hulls::kUnknown;
    if (most > best) {
      best = most;
      const bool same = iteration == 0 && lane == 0;
      const float shrink = same ? 1 : roughInverseSqrt(1 + radius * radius);
      for (int k = 0; k < 3; ++k) n[k] = ring.entry(k, lane) * shrink;
      radius *= same ? 0.5f : 0.7f;
    } else {
      radius *= 0.4f;
    }
    if (best < hopeless) break;
    hopeless *= kHopelessLater;
  }
  // With less of a rounding margin, they may be apart.
  if (best > -rounding_margin) return Hulls::kClose;
  return best > -kShallow * smaller ? Hulls::kShallow : Hulls::kMeet;
}

bool AreSeparate(const SupportTable& a, const SupportTable& b, const SimilarityTransform& b_in_a, bool& shallow) {
  const Hulls hulls = HullsBetween(a, b, between(b_in_a));
  shallow = hulls == Hulls::kShallow || hulls == Hulls::kClose;
  return hulls == Hulls::kApart;
}

void Evaluate(const SupportTable& a, const SupportTable& b, const SimilarityTransform& b_in_a,
              EightSeparations& eight) {
  const auto directions = [&eight](std::size_t lane, V(&v)[3]) HWY_ATTR {
    for (int k = 0; k < 3; ++k) v[k] = hn::LoadU(D(), eight.u[k] + lane);
  };
  values(a, b, between(b_in_a), directions, eight.value);
}

}  // namespace bocst::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bocst::query {

HWY_EXPORT(AreSeparate);
HWY_EXPORT(HullsBetween);
HWY_EXPORT(Evaluate);

bool areSeparate(const SupportTable& a, const SupportTable& b, const SimilarityTransform& b_in_a, bool& shallow) {
  return HWY_DYNAMIC_DISPATCH(AreSeparate)(a, b, b_in_a, shallow);
}

namespace {

// Of the surfaces at these poses, where what is no farther apart than `margin` touches.
template <typename S>
Between between(const SupportTable& a, const S* X_WA, const SupportTable& b, const S* X_WB, float margin) {
  using simd::Float4;
  const Float4 none = {0, 0, 0, 0}, middle_a = {a.middle(0), a.middle(1), a.middle(2), 0};
  Float4 rows_a[3] = {simd::load(X_WA), simd::load(X_WA + 4), simd::load(X_WA + 8)}, rest = none;
  simd::transpose(rows_a[0], rows_a[1], rows_a[2], rest);
  const auto in_a = [&](Float4 v) {
    return rows_a[0] * simd::lane<0>(v) + rows_a[1] * simd::lane<1>(v) + rows_a[2] * simd::lane<2>(v);
  };
  const float per_unit = 1 / a.unit();
  Between g;
  Float4 t = in_a(simd::loadDifference(X_WB + 12, X_WA + 12)) - middle_a, size = simd::abs(middle_a);
#pragma GCC unroll 3
  for (std::size_t j = 0; j < 3; ++j) {
    const Float4 axis = in_a(simd::load(X_WB + 4 * j));
    std::memcpy(g.rotation[j], &axis, sizeof axis);
    t += b.middle(j) * axis;
    size[j] += std::abs(b.middle(j));
  }
  t *= per_unit;
  std::memcpy(g.t, &t, sizeof t);
  const Float4 distances = simd::abs(t);
  const float distance = distances[0] + distances[1] + distances[2], far = size[0] + size[1] + size[2];
  g.scale = b.unit() * per_unit;
  // As of areFarApart(). The corners of a root's cube are nearer to its middle than 2 kMiddle.
  constexpr float kSide = 2.0f * static_cast<float>(lattice::kMiddle);
  const float slack = 2e-4f * (distance + 2 * (far * per_unit + kSide * (1 + g.scale)));
  g.tolerance = 1.001f * margin * per_unit + slack;
  // With more slack, only areSeparate() can tell hulls apart that are near each other. Nor is it less where a unit or
  // its inverse is no float: then the scale is 0 or no number.
  const bool is_sharp = slack < 0.02f * kSide * std::min(1.0f, g.scale);
  g.orthogonality_error = is_sharp ? 0.0f : 1.0f;
  return g;
}

}  // namespace

template <typename S>
Hulls hullsWithoutLock(const OpenHull& a, const S* X_WA, const OpenHull& b, const S* X_WB, double margin) {
  Hulls hulls = Hulls::kUnknown;
  const auto ask = [&](const tree::Outline::Reader&) {
    hulls = HWY_DYNAMIC_DISPATCH(HullsBetween)(a.supports, b.supports,
                                               between(a.supports, X_WA, b.supports, X_WB, static_cast<float>(margin)));
#if !BOCST_IS_TSAN  // which does not know fences; there, each value is acquired
    std::atomic_thread_fence(std::memory_order_acquire);
#endif
    return true;
  };
  if (!a.outline.read([&](const tree::Outline::Reader&) { return b.outline.read(ask); })) return Hulls::kUnknown;
  return hulls;
}

template Hulls hullsWithoutLock(const OpenHull&, const float*, const OpenHull&, const float*, double);
template Hulls hullsWithoutLock(const OpenHull&, const double*, const OpenHull&, const double*, double);

void evaluate(const SupportTable& a, const SupportTable& b, const SimilarityTransform& b_in_a,
              EightSeparations& eight) {
  HWY_DYNAMIC_DISPATCH(Evaluate)(a, b, b_in_a, eight);
}

}  // namespace bocst::query
#endif
