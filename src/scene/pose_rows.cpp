// SPDX-License-Identifier: BSD-3-Clause
#include "scene/pose_rows.h"

#include <algorithm>

#include "fcl/adapters/validate.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "scene/pose_rows.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "simd/octants-inl.h"

HWY_BEFORE_NAMESPACE();
namespace bocst::scene::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using D = hn::CappedTag<double, kPosesAtOnce>;
using V = hn::Vec<D>;
constexpr std::size_t kLanes = hn::MaxLanes(D());

// Four numbers of S, or as many as a vector has.
template <typename Tag>
HWY_INLINE hn::Vec<Tag> loadAs(Tag d, const double* p) {
  return hn::LoadU(d, p);
}
template <typename Tag>
HWY_INLINE hn::Vec<Tag> loadAs(Tag d, const float* p) {
  return hn::PromoteTo(d, hn::LoadU(hn::Rebind<float, Tag>(), p));
}

// One column of as many poses as a vector has lanes: x, y and z of each.
struct Column {
  V x, y, z;
};

template <typename Tag, typename S>
HWY_INLINE Column column(Tag d, const S* const* poses, std::size_t c) {
#if HWY_TARGET != HWY_SCALAR
  if constexpr (kLanes == 4) {
    const auto p = loadAs(d, poses[0] + 4 * c), q = loadAs(d, poses[1] + 4 * c), r = loadAs(d, poses[2] + 4 * c),
               s = loadAs(d, poses[3] + 4 * c);
    const auto pq_xz = hn::InterleaveLower(d, p, q), rs_xz = hn::InterleaveLower(d, r, s);
    const auto pq_y = hn::InterleaveUpper(d, p, q), rs_y = hn::InterleaveUpper(d, r, s);
    return {hn::ConcatLowerLower(d, rs_xz, pq_xz), hn::ConcatLowerLower(d, rs_y, pq_y),
            hn::ConcatUpperUpper(d, rs_xz, pq_xz)};
  }
#endif
  HWY_ALIGN double x[kLanes], y[kLanes], z[kLanes];
  for (std::size_t l = 0; l < kLanes; ++l) {
    x[l] = static_cast<double>(poses[l][4 * c]);
    y[l] = static_cast<double>(poses[l][4 * c + 1]);
    z[l] = static_cast<double>(poses[l][4 * c + 2]);
  }
  return {hn::Load(d, x), hn::Load(d, y), hn::Load(d, z)};
}

struct Poses {
  Column rotation[3], translation;
};

// The poses of objects i and up of a state; lanes without an object repeat the last.
template <typename S>
HWY_INLINE Poses posesAt(const S* state, std::size_t i, std::size_t moving) {
  const S* at[kLanes];
  for (std::size_t l = 0; l < kLanes; ++l) at[l] = state + 16 * std::min(i + l, moving - 1);
  return {{column(D(), at, 0), column(D(), at, 1), column(D(), at, 2)}, column(D(), at, 3)};
}

HWY_INLINE V dot(const Column& a, const Column& b) {
  return hn::MulAdd(a.x, b.x, hn::MulAdd(a.y, b.y, hn::Mul(a.z, b.z)));
}
HWY_INLINE Column sub(const Column& a, const Column& b) {
  return {hn::Sub(a.x, b.x), hn::Sub(a.y, b.y), hn::Sub(a.z, b.z)};
}

// The sums of fcl_adapter::rigidSumsOf().
HWY_INLINE void rigidSums(const Poses& X, V& stretch, V& shear) {
  const D d;
  const Column &a = X.rotation[0], &b = X.rotation[1], &c = X.rotation[2];
  const Column nothing = sub(X.translation, X.translation);  // 0, or NaN
  const V squares =
      hn::Add(hn::Add(hn::Add(dot(a, a), dot(b, b)), dot(c, c)), hn::Add(hn::Add(nothing.x, nothing.y), nothing.z));
  const Column across = {hn::Sub(hn::Mul(b.y, c.z), hn::Mul(b.z, c.y)), hn::Sub(hn::Mul(b.z, c.x), hn::Mul(b.x, c.z)),
                         hn::Sub(hn::Mul(b.x, c.y), hn::Mul(b.y, c.x))};
  stretch = hn::Sub(squares, hn::Set(d, 3.0));
  shear = hn::Sub(hn::NegMulAdd(hn::Set(d, 2.0), dot(a, across), squares), hn::Set(d, 1.0));
}

template <typename S>
HWY_INLINE std::size_t rigidStatesOf(const S* poses, std::size_t states, std::size_t moving, double* deviations) {
  const D d;
  const V most = hn::Set(d, fcl_adapter::kSurelyRigidStretch), least = hn::Neg(most),
          most_shear = hn::Set(d, fcl_adapter::kSurelyRigidShear), quarter = hn::Set(d, 0.25);
  for (std::size_t k = 0; k < states; ++k) {
    for (std::size_t i = 0; i < moving; i += kLanes) {
      V stretch, shear;
      rigidSums(posesAt(poses + 16 * k * moving, i, moving), stretch, shear);
      const auto rigid = hn::And(hn::And(hn::Le(stretch, most), hn::Ge(stretch, least)), hn::Le(shear, most_shear));
      if (!hn::AllTrue(d, rigid)) return k;
      const V deviation = hn::MulAdd(hn::Mul(stretch, stretch), quarter, hn::Abs(shear));
      hn::StoreU(hn::Max(hn::LoadU(d, deviations + i), deviation), d, deviations + i);
    }
  }
  return states;
}

template <typename S>
HWY_INLINE void measurePathsOf(const S* poses, std::size_t states, std::size_t moving, const PathRow& row) {
  const D d;
  const std::size_t room = roomFor(moving);
  const V half = hn::Set(d, 0.5), more = hn::Set(d, 1 + 1e-6);
  for (std::size_t i = 0; i < moving; i += kLanes) {
    const V c0 = hn::LoadU(d, row.center[0] + i), c1 = hn::LoadU(d, row.center[1] + i),
            c2 = hn::LoadU(d, row.center[2] + i), radius = hn::LoadU(d, row.radius + i);
    V sum = hn::Zero(d), place = hn::Zero(d);
    Poses before;
    for (std::size_t k = 0; k < states; ++k) {
      const Poses X = posesAt(poses + 16 * k * moving, i, moving);
      if (k > 0) {
        const Column a = sub(X.rotation[0], before.rotation[0]), b = sub(X.rotation[1], before.rotation[1]),
                     c = sub(X.rotation[2], before.rotation[2]), t = sub(X.translation, before.translation);
        const auto along = [&](V a_k, V b_k, V c_k, V t_k)
                               HWY_ATTR { return hn::MulAdd(a_k, c0, hn::MulAdd(b_k, c1, hn::MulAdd(c_k, c2, t_k))); };
        const Column displacement = {along(a.x, b.x, c.x, t.x), along(a.y, b.y, c.y, t.y), along(a.z, b.z, c.z, t.z)};
        const V turn = hn::Add(hn::Add(dot(a, a), dot(b, b)), dot(c, c));
        const V step = hn::MulAdd(radius, hn::Sqrt(hn::Mul(turn, half)), hn::Sqrt(dot(displacement, displacement)));
        sum = hn::MulAdd(step, more, sum);
      }
      const Column& t = X.translation;
      place = hn::Max(place, hn::Add(hn::Add(hn::Abs(t.x), hn::Abs(t.y)), hn::Abs(t.z)));
      hn::StoreU(sum, d, row.path + k * room + i);
      before = X;
    }
    hn::StoreU(place, d, row.place + i);
  }
}

std::size_t RigidStatesFloat(const float* poses, std::size_t states, std::size_t moving, double* deviations) {
  return rigidStatesOf(poses, states, moving, deviations);
}
std::size_t RigidStatesDouble(const double* poses, std::size_t states, std::size_t moving, double* deviations) {
  return rigidStatesOf(poses, states, moving, deviations);
}
void MeasurePathsFloat(const float* poses, std::size_t states, std::size_t moving, const PathRow& row) {
  measurePathsOf(poses, states, moving, row);
}
void MeasurePathsDouble(const double* poses, std::size_t states, std::size_t moving, const PathRow& row) {
  measurePathsOf(poses, states, moving, row);
}

}  // namespace bocst::scene::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bocst::scene {

HWY_EXPORT(RigidStatesFloat);
HWY_EXPORT(RigidStatesDouble);
HWY_EXPORT(MeasurePathsFloat);
HWY_EXPORT(MeasurePathsDouble);

template <>
std::size_t rigidStates(const float* poses, std::size_t states, std::size_t moving, double* deviations) {
  return HWY_DYNAMIC_DISPATCH(RigidStatesFloat)(poses, states, moving, deviations);
}
template <>
std::size_t rigidStates(const double* poses, std::size_t states, std::size_t moving, double* deviations) {
  return HWY_DYNAMIC_DISPATCH(RigidStatesDouble)(poses, states, moving, deviations);
}
template <>
void measurePaths(const float* poses, std::size_t states, std::size_t moving, const PathRow& row) {
  HWY_DYNAMIC_DISPATCH(MeasurePathsFloat)(poses, states, moving, row);
}
template <>
void measurePaths(const double* poses, std::size_t states, std::size_t moving, const PathRow& row) {
  HWY_DYNAMIC_DISPATCH(MeasurePathsDouble)(poses, states, moving, row);
}

}  // namespace bocst::scene
#endif
