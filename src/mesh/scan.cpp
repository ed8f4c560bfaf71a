// SPDX-License-Identifier: BSD-3-Clause
#include "mesh/scan.h"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mesh/scan.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace bocst::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

bool WidenByPoints(const double* points, std::size_t count, double most, double lo[3], double hi[3]) {
  const hn::CappedTag<double, 8> d;
  const std::size_t lanes = hn::Lanes(d), values = 3 * count;
  const auto top = hn::Set(d, most);
  // The axis of a lane repeats after three vectors.
  HWY_ALIGN double pattern[24];
  for (std::size_t i = 0; i < 3 * lanes; ++i) pattern[i] = lo[i % 3];
  auto lo0 = hn::Load(d, pattern), lo1 = hn::Load(d, pattern + lanes), lo2 = hn::Load(d, pattern + 2 * lanes);
  for (std::size_t i = 0; i < 3 * lanes; ++i) pattern[i] = hi[i % 3];
  auto hi0 = hn::Load(d, pattern), hi1 = hn::Load(d, pattern + lanes), hi2 = hn::Load(d, pattern + 2 * lanes);
  auto good = hn::Eq(top, top);
  std::size_t i = 0;
  const auto take = [&](std::size_t at, auto& low, auto& high) HWY_ATTR {
    const auto x = hn::LoadU(d, points + at);
    low = hn::Min(low, x);
    high = hn::Max(high, x);
    good = hn::And(good, hn::Le(hn::Abs(x), top));
  };
  for (; i + 3 * lanes <= values; i += 3 * lanes) {
    take(i, lo0, hi0);
    take(i + lanes, lo1, hi1);
    take(i + 2 * lanes, lo2, hi2);
  }
  hn::Store(lo0, d, pattern);
  hn::Store(lo1, d, pattern + lanes);
  hn::Store(lo2, d, pattern + 2 * lanes);
  for (std::size_t k = 0; k < 3 * lanes; ++k) lo[k % 3] = std::min(lo[k % 3], pattern[k]);
  hn::Store(hi0, d, pattern);
  hn::Store(hi1, d, pattern + lanes);
  hn::Store(hi2, d, pattern + 2 * lanes);
  for (std::size_t k = 0; k < 3 * lanes; ++k) hi[k % 3] = std::max(hi[k % 3], pattern[k]);
  bool all_good = hn::AllTrue(d, good);
  for (; i < values; ++i) {
    lo[i % 3] = std::min(lo[i % 3], points[i]);
    hi[i % 3] = std::max(hi[i % 3], points[i]);
    all_good &= std::abs(points[i]) <= most;
  }
  return all_good;
}

std::uint32_t Largest(const std::uint32_t* values, std::size_t count) {
  const hn::CappedTag<std::uint32_t, 16> d;
  const std::size_t lanes = hn::Lanes(d);
  auto most0 = hn::Zero(d), most1 = hn::Zero(d);
  std::size_t i = 0;
  for (; i + 2 * lanes <= count; i += 2 * lanes) {
    most0 = hn::Max(most0, hn::LoadU(d, values + i));
    most1 = hn::Max(most1, hn::LoadU(d, values + i + lanes));
  }
  HWY_ALIGN std::uint32_t each[16];
  hn::Store(hn::Max(most0, most1), d, each);
  std::uint32_t result = *std::max_element(each, each + lanes);
  for (; i < count; ++i) result = std::max(result, values[i]);
  return result;
}

bool Contains(const std::uint32_t* values, std::size_t count, std::uint32_t value) {
  const hn::CappedTag<std::uint32_t, 16> d;
  const std::size_t lanes = hn::Lanes(d);
  const auto wanted = hn::Set(d, value);
  std::size_t i = 0;
  for (; i + 2 * lanes <= count; i += 2 * lanes) {
    const auto a = hn::Eq(hn::LoadU(d, values + i), wanted), b = hn::Eq(hn::LoadU(d, values + i + lanes), wanted);
    if (!hn::AllFalse(d, hn::Or(a, b))) return true;
  }
  return std::find(values + i, values + count, value) != values + count;
}

}  // namespace bocst::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bocst {

HWY_EXPORT(WidenByPoints);
HWY_EXPORT(Largest);
HWY_EXPORT(Contains);

bool widenByPoints(const double* points, std::size_t count, double most, double lo[3], double hi[3]) {
  return HWY_DYNAMIC_DISPATCH(WidenByPoints)(points, count, most, lo, hi);
}

std::uint32_t largest(const std::uint32_t* values, std::size_t count) {
  return HWY_DYNAMIC_DISPATCH(Largest)(values, count);
}

bool contains(const std::uint32_t* values, std::size_t count, std::uint32_t value) {
  return HWY_DYNAMIC_DISPATCH(Contains)(values, count, value);
}

}  // namespace bocst
#endif
