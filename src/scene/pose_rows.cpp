// SPDX-License-Identifier: BSD-3-Clause
#include "scene/pose_rows.h"

#include <algorithm>
#include <limits>

#include "fcl/adapters/validate.h"
#include "scene/reach.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "scene/pose_rows.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "simd/vectors-inl.h"

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

// One column of as many poses as a vector has lanes.
using Column = query::HWY_NAMESPACE::Vec3Of<V>;

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

// The sums of fcl_adapter::rigidSumsOf().
HWY_INLINE void rigidSums(const Poses& X, V& stretch, V& shear) {
  const D d;
  const Column &a = X.rotation[0], &b = X.rotation[1], &c = X.rotation[2];
  const Column nothing = sub(X.translation, X.translation);  // 0, or NaN
  const V squares =
      hn::Add(hn::Add(hn::Add(dot(a, a), dot(b, b)), dot(c, c)), hn::Add(hn::Add(nothing.x, nothing.y), nothing.z));
  stretch = hn::Sub(squares, hn::Set(d, 3.0));
  shear = hn::Sub(hn::NegMulAdd(hn::Set(d, 2.0), dot(a, cross(b, c)), squares), hn::Set(d, 1.0));
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

// R x + t, from columns.
HWY_INLINE Column transformed(const Column (&R)[3], const V (&x)[3], const Column& t) {
  return {hn::MulAdd(R[0].x, x[0], hn::MulAdd(R[1].x, x[1], hn::MulAdd(R[2].x, x[2], t.x))),
          hn::MulAdd(R[0].y, x[0], hn::MulAdd(R[1].y, x[1], hn::MulAdd(R[2].y, x[2], t.y))),
          hn::MulAdd(R[0].z, x[0], hn::MulAdd(R[1].z, x[1], hn::MulAdd(R[2].z, x[2], t.z)))};
}

HWY_INLINE V load(const std::vector<double>& row, std::size_t i) { return hn::LoadU(D(), row.data() + i); }

template <typename S>
HWY_INLINE void measurePathsOf(const S* poses, std::size_t states, const BoundsRows& bounds, double* path,
                               double* most_place) {
  const D d;
  const std::size_t moving = bounds.moving, room = roomFor(moving);
  const V half = hn::Set(d, 0.5), more = hn::Set(d, 1 + 1e-6);
  for (std::size_t i = 0; i < moving; i += kLanes) {
    const V center[3] = {load(bounds.center[0], i), load(bounds.center[1], i), load(bounds.center[2], i)};
    const V radius = load(bounds.radius, i);
    Poses before = posesAt(poses, i, moving);
    V sum = hn::Zero(d), place = hn::Zero(d);
    for (std::size_t k = 0; k < states; ++k) {
      const Poses X = posesAt(poses + 16 * k * moving, i, moving);
      const Column turn[3] = {sub(X.rotation[0], before.rotation[0]), sub(X.rotation[1], before.rotation[1]),
                              sub(X.rotation[2], before.rotation[2])};
      const Column displacement = transformed(turn, center, sub(X.translation, before.translation));
      const V turned = hn::Add(hn::Add(dot(turn[0], turn[0]), dot(turn[1], turn[1])), dot(turn[2], turn[2]));
      const V step = hn::MulAdd(radius, hn::Sqrt(hn::Mul(turned, half)), hn::Sqrt(dot(displacement, displacement)));
      sum = hn::MulAdd(step, more, sum);
      place = hn::Max(place, norm1(X.translation));
      hn::StoreU(sum, d, path + k * room + i);
      before = X;
    }
    hn::StoreU(place, d, most_place + i);
  }
}

template <typename S>
HWY_INLINE std::size_t placeBoxesOf(const S* state, const BoundsRows& bounds, const Placing& p, BoxGroup* groups,
                                    std::uint32_t* others) {
  const D d;
  const hn::Rebind<float, D> df;
  const V least_size = hn::Set(d, kUnboxedSize), fine = hn::Set(d, kFineError);
  const ReachFactors factors = reachFactors<S>();
  std::size_t count = 0;
  for (std::size_t i = 0; i < bounds.moving; i += kLanes) {
    BoxGroup& group = groups[i / 8];
    const std::size_t lane = i % 8;
    const auto store = [&](V v, float* row) HWY_ATTR { hn::StoreU(hn::DemoteTo(df, v), df, row + lane); };
    const Poses X = posesAt(state, i, bounds.moving);
    const Column origin = {hn::Set(d, p.origin[0]), hn::Set(d, p.origin[1]), hn::Set(d, p.origin[2])};
    const V middle[3] = {load(bounds.center[0], i), load(bounds.center[1], i), load(bounds.center[2], i)};
    const Column center = transformed(X.rotation, middle, sub(X.translation, origin));
    const V error = hn::LoadU(d, p.orthogonality_errors + i), given = hn::LoadU(d, p.reach + i);
    const V radius = load(bounds.radius, i), size = load(bounds.size, i), displacement = norm1(center);
    V reach = hn::Add(load(bounds.reach, i), hn::Set(d, factors.least));
    reach = hn::MulAdd(hn::Set(d, factors.per_place), hn::Add(norm1(X.translation), size), reach);
    reach = hn::MulAdd(hn::Mul(hn::Set(d, factors.per_error), error), hn::Add(hn::Set(d, p.largest), size), reach);
    reach = hn::MulAdd(hn::Set(d, factors.per_displacement), hn::Add(displacement, radius), reach);
    reach = hn::IfThenElse(hn::Eq(given, hn::Zero(d)), reach, given);
    // Comparisons with what is infinite or no number say no.
    const auto is_box = hn::And(hn::Lt(hn::Add(hn::Add(displacement, size), reach), least_size), hn::Le(error, fine));
    const Column nothing = {hn::Zero(d), hn::Zero(d), hn::Zero(d)};
    Column extent = {reach, reach, reach};
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      const V along[3] = {load(bounds.axes[k][0], i), load(bounds.axes[k][1], i), load(bounds.axes[k][2], i)};
      const Column axis = transformed(X.rotation, along, nothing);
      const V half = load(bounds.half[k], i);
      extent = {hn::MulAdd(hn::Abs(axis.x), half, extent.x), hn::MulAdd(hn::Abs(axis.y), half, extent.y),
                hn::MulAdd(hn::Abs(axis.z), half, extent.z)};
      store(axis.x, group.axis[k][0]);
      store(axis.y, group.axis[k][1]);
      store(axis.z, group.axis[k][2]);
      store(half, group.half[k]);
    }
    store(center.x, group.center[0]);
    store(center.y, group.center[1]);
    store(center.z, group.center[2]);
    store(reach, group.reach);
    store(hn::Sub(center.x, extent.x), group.lo[0]);
    store(hn::Sub(center.y, extent.y), group.lo[1]);
    store(hn::Sub(center.z, extent.z), group.lo[2]);
    store(hn::Add(center.x, extent.x), group.hi[0]);
    store(hn::Add(center.y, extent.y), group.hi[1]);
    store(hn::Add(center.z, extent.z), group.hi[2]);
    if (HWY_LIKELY(hn::AllTrue(d, is_box))) continue;
    HWY_ALIGN double boxed[kLanes];
    hn::Store(hn::IfThenElseZero(is_box, hn::Set(d, 1.0)), d, boxed);
    for (std::size_t l = 0; l < std::min(kLanes, bounds.moving - i); ++l) {
      if (boxed[l] == 0) others[count++] = static_cast<std::uint32_t>(i + l);
    }
  }
  return count;
}

std::size_t RigidStatesFloat(const float* poses, std::size_t states, std::size_t moving, double* deviations) {
  return rigidStatesOf(poses, states, moving, deviations);
}
std::size_t RigidStatesDouble(const double* poses, std::size_t states, std::size_t moving, double* deviations) {
  return rigidStatesOf(poses, states, moving, deviations);
}
void MeasurePathsFloat(const float* poses, std::size_t states, const BoundsRows& b, double* path, double* place) {
  measurePathsOf(poses, states, b, path, place);
}
void MeasurePathsDouble(const double* poses, std::size_t states, const BoundsRows& b, double* path, double* place) {
  measurePathsOf(poses, states, b, path, place);
}
std::size_t PlaceBoxesFloat(const float* state, const BoundsRows& b, const Placing& p, BoxGroup* groups,
                            std::uint32_t* others) {
  return placeBoxesOf(state, b, p, groups, others);
}
std::size_t PlaceBoxesDouble(const double* state, const BoundsRows& b, const Placing& p, BoxGroup* groups,
                             std::uint32_t* others) {
  return placeBoxesOf(state, b, p, groups, others);
}

}  // namespace bocst::scene::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bocst::scene {

HWY_EXPORT(RigidStatesFloat);
HWY_EXPORT(RigidStatesDouble);
HWY_EXPORT(MeasurePathsFloat);
HWY_EXPORT(MeasurePathsDouble);
HWY_EXPORT(PlaceBoxesFloat);
HWY_EXPORT(PlaceBoxesDouble);

BoundsRows rowsOf(const std::vector<Bounds>& bounds) {
  BoundsRows rows;
  rows.moving = bounds.size();
  const auto fill = [&bounds](std::vector<double>& row, auto&& of) {
    row.assign(roomFor(bounds.size()), 0);
    std::transform(bounds.begin(), bounds.end(), row.begin(), of);
  };
  for (int k = 0; k < 3; ++k) {
    fill(rows.center[k], [k](const Bounds& b) { return b.center[k]; });
    fill(rows.half[k], [k](const Bounds& b) { return b.half[k]; });
    for (int j = 0; j < 3; ++j) fill(rows.axes[k][j], [k, j](const Bounds& b) { return b.axes(j, k); });
  }
  fill(rows.reach, [](const Bounds& b) { return b.reach; });
  fill(rows.radius, [](const Bounds& b) { return b.radius; });
  fill(rows.size,
       [](const Bounds& b) { return b.kind == Bounds::kBox ? b.size : std::numeric_limits<double>::infinity(); });
  return rows;
}

#define BOCST_FOR(S, Name)                                                                                       \
  template <>                                                                                                    \
  std::size_t rigidStates(const S* poses, std::size_t states, std::size_t moving, double* deviations) {          \
    return HWY_DYNAMIC_DISPATCH(RigidStates##Name)(poses, states, moving, deviations);                           \
  }                                                                                                              \
  template <>                                                                                                    \
  void measurePaths(const S* poses, std::size_t states, const BoundsRows& bounds, double* path, double* place) { \
    HWY_DYNAMIC_DISPATCH(MeasurePaths##Name)(poses, states, bounds, path, place);                                \
  }                                                                                                              \
  template <>                                                                                                    \
  std::size_t placeBoxes(const S* state, const BoundsRows& bounds, const Placing& placing, BoxGroup* groups,     \
                         std::uint32_t* others) {                                                                \
    return HWY_DYNAMIC_DISPATCH(PlaceBoxes##Name)(state, bounds, placing, groups, others);                       \
  }
BOCST_FOR(float, Float)
BOCST_FOR(double, Double)
#undef BOCST_FOR

}  // namespace bocst::scene
#endif
