// SPDX-License-Identifier: BSD-3-Clause
// Eight bounds decoded at once, on every instruction set: all bytes in frames of every size, against their definition.
#include <hwy/aligned_allocator.h>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "bounds/decode_test.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "bounds/decode-inl.h"

#ifndef BOCST_DECODE_TEST_ONCE
#define BOCST_DECODE_TEST_ONCE
namespace bocst::bounds {

struct Decoded {
  alignas(64) float middle[3][8], half[3][8], normal[3][8], slab_center[8], slab_half[8];
};

}  // namespace bocst::bounds
#endif

HWY_BEFORE_NAMESPACE();
namespace bocst::bounds::HWY_NAMESPACE {

void Decode(const OctantBounds& octants, float corner, float side, float slab_unit, Decoded& out) {
  const D d;
  for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
    V middle, half;
    for (int k = 0; k < 3; ++k) {
      decodeBox(octants, k, i, hn::Set(d, corner), hn::Set(d, halfStep(side)), middle, half);
      hn::Store(middle, d, out.middle[k] + i);
      hn::Store(half, d, out.half[k] + i);
      hn::Store(decodeNormal(octants, k, i), d, out.normal[k] + i);
    }
    decodeSlab(octants, i, slab_unit, middle, half);
    hn::Store(middle, d, out.slab_center + i);
    hn::Store(half, d, out.slab_half + i);
  }
}

float CellSlabUnit(float side) { return cellSlabUnit(side); }
float LooseSlabUnit(float side) { return looseSlabUnit(side); }

}  // namespace bocst::bounds::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include <cmath>

#include "every_target.h"

namespace bocst::bounds {
namespace {

HWY_EXPORT(Decode);
HWY_EXPORT(CellSlabUnit);
HWY_EXPORT(LooseSlabUnit);

class Decoding : public test::EveryTarget {};

constexpr double kUnit = 0x1p-24;

void expectNear(float decoded, double exact, double bound) { ASSERT_LE(std::abs(double{decoded} - exact), bound); }

void checkBytes(const OctantBounds& octants, float corner, float side) {
  const float units[2] = {HWY_DYNAMIC_DISPATCH(CellSlabUnit)(side), HWY_DYNAMIC_DISPATCH(LooseSlabUnit)(side)};
  const double exact_units[2] = {double{side} / 127, double{side} / 256};
  for (int form = 0; form < 2; ++form) {
    Decoded decoded;
    HWY_DYNAMIC_DISPATCH(Decode)(octants, corner, side, units[form], decoded);
    for (std::size_t o = 0; o < 8; ++o) {
      for (std::size_t k = 0; k < 3; ++k) {
        // Half a step is off by 2 u, the product by one more where it is not fused, the sum by one.
        const double sum = (octants.lo[k][o] + octants.hi[k][o]) * (double{side} / 510);
        expectNear(decoded.middle[k][o], corner + sum, 1.01 * kUnit * (3 * sum + std::abs(corner + sum)));
        const double half = (octants.hi[k][o] - octants.lo[k][o]) * (double{side} / 510);
        expectNear(decoded.half[k][o], half, 3.01 * kUnit * std::abs(half));
        const double normal = octants.normal[k][o] / 127.0;
        expectNear(decoded.normal[k][o], normal, 2.01 * kUnit * std::abs(normal));
      }
      const double center = octants.slab_center[o] * exact_units[form];
      expectNear(decoded.slab_center[o], center, 3.01 * kUnit * std::abs(center));
      const double half = octants.slab_half[o] * exact_units[form] / 2;
      expectNear(decoded.slab_half[o], half, 3.01 * kUnit * half);
    }
  }
}

TEST_P(Decoding, AllBytesInFramesOfEverySize) {
  for (int first = 0; first <= 255; ++first) {
    for (int second = 0; second < 256; second += 8) {
      OctantBounds octants;
      for (std::size_t o = 0; o < 8; ++o) {
        const int other = second + static_cast<int>(o);
        for (std::size_t k = 0; k < 3; ++k) {
          octants.lo[k][o] = static_cast<std::uint8_t>(k == 1 ? other : first);
          octants.hi[k][o] = static_cast<std::uint8_t>(k == 1 ? first : other);
          octants.normal[k][o] = static_cast<std::int8_t>((first + other * (k == 2 ? 3 : 1)) % 255 - 127);
        }
        octants.slab_center[o] = static_cast<std::int8_t>(first);
        octants.slab_half[o] = static_cast<std::uint8_t>(other);
      }
      // Sides of cells and of loose frames, and what a second tree of any scale makes of them.
      const float unit = first % 4 == 0 ? 1.0f : first % 4 == 1 ? 0.7f : first % 4 == 2 ? 1000.0f : 0.001f;
      const float side = std::ldexp(unit, (first + second / 8) % 29 - 10);
      checkBytes(octants, first % 2 != 0 ? 0.0f : -1.5f * side, side);
      if (HasFatalFailure()) return;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Targets, Decoding, testing::ValuesIn(test::EveryTarget::targets()), test::EveryTarget::name);

}  // namespace
}  // namespace bocst::bounds
#endif
