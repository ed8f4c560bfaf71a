// SPDX-License-Identifier: BSD-3-Clause
// What the tests of eight octants share, once for each instruction set; see Highway's -inl.h headers.
#if defined(BOCST_SIMD_OCTANTS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BOCST_SIMD_OCTANTS_INL_H
#undef BOCST_SIMD_OCTANTS_INL_H
#else
#define BOCST_SIMD_OCTANTS_INL_H
#endif

#include <hwy/highway.h>

#include <cstdint>

#include "simd/unroll.h"

HWY_BEFORE_NAMESPACE();
namespace bocst::query::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using D = hn::CappedTag<float, 8>;
using V = hn::Vec<D>;
using M = hn::Mask<D>;

// The corners of eight octants in sides of an octant, from that of the first.
HWY_ALIGN static constexpr float kOctantCorner[3][8] = {
    {0, 1, 0, 1, 0, 1, 0, 1}, {0, 0, 1, 1, 0, 0, 1, 1}, {0, 0, 0, 0, 1, 1, 1, 1}};

HWY_INLINE V fromBytes(D d, const std::uint8_t* p) {
  const hn::Rebind<std::uint8_t, D> du;
  const hn::RebindToSigned<D> di;
  return hn::ConvertTo(d, hn::PromoteTo(di, hn::LoadU(du, p)));
}

HWY_INLINE V fromBytes(D d, const std::int8_t* p) {
  const hn::Rebind<std::int8_t, D> ds;
  const hn::RebindToSigned<D> di;
  return hn::ConvertTo(d, hn::PromoteTo(di, hn::LoadU(ds, p)));
}

// A mask of at most eight lanes as bits, and back; bits of lanes that a vector does not have are not looked at.
template <typename Tag>
HWY_INLINE unsigned bitsOf(Tag d, hn::Mask<Tag> mask) {
  std::uint8_t bits[8] = {};
  hn::StoreMaskBits(d, mask, bits);
  return bits[0];
}
template <typename Tag>
HWY_INLINE hn::Mask<Tag> maskOf(Tag d, unsigned bits) {
  const std::uint8_t bytes[8] = {static_cast<std::uint8_t>(bits)};
  return hn::LoadMaskBits(d, bytes);
}

}  // namespace bocst::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
