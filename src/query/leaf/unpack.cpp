// SPDX-License-Identifier: BSD-3-Clause
#include "query/leaf/unpack.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/leaf/unpack.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "log/assert.h"
#include "simd/octants-inl.h"

HWY_BEFORE_NAMESPACE();
namespace bocst::query::HWY_NAMESPACE {

void UnpackTriangles(const tree::PackedTriangles& packed, const PackMotion& motion, TrianglePack& pack) {
  const D d;
  const hn::Rebind<std::uint8_t, D> db;
  const hn::Rebind<std::uint16_t, D> du;
  const hn::RebindToSigned<D> di;
  const std::size_t lanes = hn::Lanes(d);
  HWY_ALIGN float places[3][tree::PackedTriangles::kMostPlaces];
  V size = hn::Zero(d);
  for (std::size_t p = 0; p < packed.places; p += lanes) {
    const M filled = hn::FirstN(d, packed.places - p);
    V steps[3];
    BOCST_UNROLL
    for (std::size_t k = 0; k < 3; ++k) {
      steps[k] = hn::ConvertTo(d, hn::PromoteTo(di, hn::LoadU(du, packed.steps + k * packed.places + p)));
    }
    BOCST_UNROLL
    for (std::size_t c = 0; c < 3; ++c) {
      V x = hn::Set(d, motion.offset[c]);
      BOCST_UNROLL
      for (std::size_t k = 0; k < 3; ++k) x = hn::MulAdd(hn::Set(d, motion.linear[c][k] * packed.step), steps[k], x);
      hn::Store(x, d, places[c] + p);
      size = hn::Max(size, hn::IfThenElseZero(filled, hn::Abs(x)));
    }
  }
  // Lanes beyond the last triangle get some place of these, too.
  const auto last = hn::Set(di, static_cast<std::int32_t>(packed.places) - 1);
  const auto in_table = hn::Set(di, static_cast<std::int32_t>(lanes) - 1);
  for (std::size_t k = 0; k < 3; ++k) {
    for (std::size_t i = 0; i < packed.count; i += lanes) {
      const auto place = hn::Min(hn::PromoteTo(di, hn::LoadU(db, packed.corners + k * packed.count + i)), last);
      const auto index = hn::IndicesFromVec(d, hn::And(place, in_table));
      V x[3];
      BOCST_UNROLL
      for (std::size_t c = 0; c < 3; ++c) x[c] = hn::TableLookupLanes(hn::Load(d, places[c]), index);
      for (std::size_t p = lanes; p < packed.places; p += lanes) {
        const M later = hn::RebindMask(d, hn::Gt(place, hn::Set(di, static_cast<std::int32_t>(p) - 1)));
        BOCST_UNROLL
        for (std::size_t c = 0; c < 3; ++c) {
          x[c] = hn::IfThenElse(later, hn::TableLookupLanes(hn::Load(d, places[c] + p), index), x[c]);
        }
      }
      BOCST_UNROLL
      for (std::size_t c = 0; c < 3; ++c) hn::Store(x[c], d, pack.xyz[3 * k + c] + i);
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

void unpackTriangles(const tree::PackedTriangles& packed, const PackMotion& motion, TrianglePack& pack) {
  BOCST_ASSERT(0 < packed.count && packed.count <= TrianglePack::kCapacity);
  BOCST_ASSERT(0 < packed.places && packed.places <= tree::PackedTriangles::kMostPlaces);
  HWY_DYNAMIC_DISPATCH(UnpackTriangles)(packed, motion, pack);
}

}  // namespace bocst::query
#endif
