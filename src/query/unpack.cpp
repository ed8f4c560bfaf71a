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
    // Lanes beyond the last triangle repeat the first of the vector.
    const M in = hn::FirstN(d, packed.count - i);
    BOCST_UNROLL
    for (std::size_t k = 0; k < PackedTriangles::kRows; ++k) {
      const std::uint16_t* const row = packed.steps + k * packed.count + i;
      const V q = hn::ConvertTo(d, hn::PromoteTo(di, hn::LoadU(du, row)));
      const V x = hn::MulAdd(hn::IfThenElse(in, q, hn::Set(d, static_cast<float>(row[0]))), step, offset[k % 3]);
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
