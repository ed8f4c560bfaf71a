// SPDX-License-Identifier: BSD-3-Clause
#include "tree/root_grid_kernels.h"

#include <algorithm>

#include "simd/unroll.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tree/root_grid_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace bocst::tree::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// Triangles at once: two where vectors are short, else four.
constexpr std::size_t kSpanLanes = 16;

void Quantise(const double* in, std::size_t count, const double* origin, double scale, std::int16_t most,
              std::int16_t* out) {
  const hn::CappedTag<double, 8> dd;
  const hn::Rebind<std::int32_t, decltype(dd)> d32;
  const hn::Rebind<std::int16_t, decltype(dd)> d16;
  const std::size_t lanes = hn::Lanes(dd), values = 3 * count;
  // The axis of a lane repeats after three vectors.
  HWY_ALIGN double pattern[24];
  for (std::size_t i = 0; i < 3 * lanes; ++i) pattern[i] = origin[i % 3];
  const auto factor = hn::Set(dd, scale), least = hn::Set(dd, 1.0), top = hn::Set(dd, static_cast<double>(most));
  std::size_t i = 0;
  for (; i + 3 * lanes <= values; i += 3 * lanes) {
    BOCST_UNROLL
    for (std::size_t k = 0; k < 3; ++k) {
      const auto from = hn::Load(dd, pattern + k * lanes);
      const auto x = hn::Mul(hn::Sub(hn::LoadU(dd, in + i + k * lanes), from), factor);
      const auto whole = hn::DemoteTo(d32, hn::Min(hn::Max(x, least), top));
      hn::StoreU(hn::DemoteTo(d16, whole), d16, out + i + k * lanes);
    }
  }
  for (; i < values; ++i) {
    const double x = (in[i] - origin[i % 3]) * scale;
    out[i] = static_cast<std::int16_t>(x > 1 ? (x < most ? x : most) : 1);
  }
}

#if HWY_TARGET == HWY_SCALAR

void GridSpans(const std::int16_t* vertices, const std::uint32_t* indices, std::size_t count, int bits, GridSpan* out) {
  const int shift = kGridSpanBits - bits;
  for (std::size_t i = 0; i < count; ++i, indices += 3) {
    out[i] = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const auto at = [&](int k) { return vertices[3 * std::size_t{indices[k]} + static_cast<std::size_t>(axis)]; };
      const int lo = (std::min({at(0), at(1), at(2)}) - 1) >> shift,
                reach = ((std::max({at(0), at(1), at(2)}) + 1) >> shift) - lo;
      out[i] |= static_cast<GridSpan>(lo << axis * bits | (reach > 1 ? kGridSpanLarge : reach) << (3 * bits + axis));
    }
  }
}

#else

// The vertices of one corner of as many triangles as fit, four lanes each: the last is the next vertex's.
template <class D16>
HWY_INLINE hn::Vec<D16> cornersOf(D16 d, const std::int16_t* vertices, const std::uint32_t* index) {
  const hn::Half<D16> half;
  if constexpr (hn::MaxLanes(d) == 8) {
    return hn::Combine(d, hn::LoadU(half, vertices + 3 * std::size_t{index[3]}),
                       hn::LoadU(half, vertices + 3 * std::size_t{index[0]}));
  } else {
    return hn::Combine(d, cornersOf(half, vertices, index + 3 * hn::MaxLanes(d) / 8), cornersOf(half, vertices, index));
  }
}

// a times b, each two neighbours added up; the products fit in 15 bits.
template <class D16>
HWY_INLINE auto sumsOfPairs([[maybe_unused]] D16 d, hn::Vec<D16> a, hn::Vec<D16> b) {
  const hn::Repartition<std::int32_t, D16> d32;
#if HWY_ARCH_X86 && HWY_TARGET != HWY_EMU128
  auto unused = hn::Zero(d32);
  return hn::ReorderWidenMulAccumulate(d32, a, b, hn::Zero(d32), unused);  // one instruction
#else
  const auto products = hn::BitCast(d32, hn::Mul(a, b));
  return hn::Add(hn::And(products, hn::Set(d32, 0xffff)), hn::ShiftRight<16>(products));
#endif
}

void GridSpans(const std::int16_t* vertices, const std::uint32_t* indices, std::size_t count, int bits, GridSpan* out) {
  const hn::CappedTag<std::int16_t, kSpanLanes> d;
  const hn::Repartition<std::uint64_t, decltype(d)> d64;
  const std::size_t at_once = hn::Lanes(d) / 4;
  HWY_ALIGN std::int16_t pattern[2][kSpanLanes];
  for (std::size_t i = 0; i < kSpanLanes; ++i) {
    const std::size_t axis = i % 4;
    pattern[0][i] = static_cast<std::int16_t>(axis < 3 ? 1 << axis * static_cast<std::size_t>(bits) : 0);
    pattern[1][i] = static_cast<std::int16_t>(axis < 3 ? 1 << axis : 0);
  }
  const auto strides = hn::Load(d, pattern[0]), digits = hn::Load(d, pattern[1]);
  const auto one = hn::Set(d, std::int16_t{1}), large = hn::Set(d, static_cast<std::int16_t>(kGridSpanLarge));
  const int shift = kGridSpanBits - bits;
  std::uint32_t last[3 * kSpanLanes / 4] = {};
  for (std::size_t at = 0; at < count; at += at_once) {
    const std::uint32_t* i = indices + 3 * at;
    if (at + at_once > count) {
      std::copy(i, indices + 3 * count, last);
      i = last;
    }
    __builtin_prefetch(i + 512);  // what the hardware fetches ahead is too little for the largest meshes
    const auto a = cornersOf(d, vertices, i), b = cornersOf(d, vertices, i + 1), c = cornersOf(d, vertices, i + 2);
    const auto lo = hn::ShiftRightSame(hn::Sub(hn::Min(hn::Min(a, b), c), one), shift);
    const auto hi = hn::ShiftRightSame(hn::Add(hn::Max(hn::Max(a, b), c), one), shift);
    const auto reach = hn::Sub(hi, lo);
    const auto code = hn::IfThenElse(hn::Gt(reach, one), large, reach);
    // x with y, z alone: their sum is in the lower half of each triangle's lanes.
    const auto parts = hn::BitCast(
        d64, hn::Or(sumsOfPairs(d, lo, strides), hn::ShiftLeftSame(sumsOfPairs(d, code, digits), 3 * bits)));
    hn::StoreU(hn::Add(parts, hn::ShiftRight<32>(parts)), d64, out + at);
  }
}

#endif

void BitsOfOthers(const std::uint32_t* values, std::size_t count, std::uint32_t value, std::uint8_t* bits) {
  const hn::CappedTag<std::uint32_t, 8> d;
  const auto same = hn::Set(d, value);
  for (std::size_t i = 0; i < count; i += 8) {
    unsigned byte = 0;
    for (std::size_t k = 0; k < 8; k += hn::Lanes(d)) {
      std::uint8_t part[8];
      hn::StoreMaskBits(d, hn::Ne(hn::LoadU(d, values + i + k), same), part);
      byte |= static_cast<unsigned>(part[0]) << k;
    }
    bits[i / 8] = static_cast<std::uint8_t>(byte);
  }
}

bool StepsBack(const std::uint32_t* from, std::uint32_t first, std::size_t count, std::uint16_t* back) {
  const hn::CappedTag<std::uint32_t, 8> d;
  const hn::RebindToSigned<decltype(d)> di;
  const hn::Rebind<std::uint16_t, decltype(d)> du;
  auto most = hn::Zero(di);
  for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
    const auto at = hn::Iota(d, first + static_cast<std::uint32_t>(i));
    const auto steps = hn::BitCast(di, hn::Sub(at, hn::LoadU(d, from + i)));
    most = hn::Max(most, steps);
    hn::StoreU(hn::DemoteTo(du, steps), du, back + i);
  }
  return hn::GetLane(hn::MaxOfLanes(di, most)) >= 0xffff;
}

}  // namespace bocst::tree::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bocst::tree {

HWY_EXPORT(Quantise);
HWY_EXPORT(GridSpans);
HWY_EXPORT(BitsOfOthers);
HWY_EXPORT(StepsBack);

void quantise(const double* in, std::size_t count, const double* origin, double scale, std::int16_t most,
              std::int16_t* out) {
  HWY_DYNAMIC_DISPATCH(Quantise)(in, count, origin, scale, most, out);
}

void gridSpans(const std::int16_t* vertices, const std::uint32_t* indices, std::size_t count, int bits, GridSpan* out) {
  HWY_DYNAMIC_DISPATCH(GridSpans)(vertices, indices, count, bits, out);
}

void bitsOfOthers(const std::uint32_t* values, std::size_t count, std::uint32_t value, std::uint8_t* bits) {
  HWY_DYNAMIC_DISPATCH(BitsOfOthers)(values, count, value, bits);
}

bool stepsBack(const std::uint32_t* from, std::uint32_t first, std::size_t count, std::uint16_t* back) {
  return HWY_DYNAMIC_DISPATCH(StepsBack)(from, first, count, back);
}

}  // namespace bocst::tree
#endif
