// SPDX-License-Identifier: BSD-3-Clause
#include "query/unpack.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/unpack.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "query/octants-inl.h"

HWY_BEFORE_NAMESPACE();
namespace bocst::query::HWY_NAMESPACE {

void UnpackTriangles(const tree::PackedTriangles& packed, const double* center, TrianglePack& pack) {
  using tree::PackedTriangles;
  const D d;
  const hn::Rebind<std::uint16_t, D> du;
  const hn::RebindToSigned<D> di;
  const V step = hn::Set(d, packed.step);
  V offset[3], size = hn::Zero(d);
  BOCST_UNROLL
  for (int c = 0; c < 3; ++c) {
    offset[c] = hn::Set(d, static_cast<float>(static_cast<double>(packed.origin[c]) - center[c]));
  }
  for (std::size_t i = 0; i < packed.count; i += hn::Lanes(d)) {
    const std::uint16_t* const group =
        packed.steps + i / PackedTriangles::kGroup * PackedTriangles::kGroupSteps + i % PackedTriangles::kGroup;
    BOCST_UNROLL
    for (std::size_t k = 0; k < 9; ++k) {
      const auto steps = hn::PromoteTo(di, hn::LoadU(du, group + PackedTriangles::kGroup * k));
      const V x = hn::MulAdd(hn::ConvertTo(d, steps), step, offset[k % 3]);
      hn::Store(x, d, pack.xyz[k] + i);
      size = hn::Max(size, hn::Abs(x));
    }
  }
  pack.count = packed.count;
  pack.size = hn::GetLane(hn::MaxOfLanes(d, size));
}

}  // namespace bocst::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bocst::query {

HWY_EXPORT(UnpackTriangles);

void unpackTriangles(const tree::PackedTriangles& packed, const double* center, TrianglePack& pack) {
  HWY_DYNAMIC_DISPATCH(UnpackTriangles)(packed, center, pack);
}

}  // namespace bocst::query
#endif
