// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>

#include "bounds/node_bounds.h"

namespace bocst::bounds {

/// The frame of the bounds of a bulk-built block's lanes, in lattice units; it follows no cell of the lattice.
///
/// Sides are powers of two, so a thin axis may be finer than the longest by one of four factors. 55 bits in all.
struct LooseFrame {
  static constexpr int kShifts[4] = {0, 3, 6, 10};
  static constexpr int kLeastExponent = 2, kMostExponent = 17;

  std::uint16_t origin[3] = {0, 0, 0};    ///< Even: lattice units.
  std::uint8_t exponent = kMostExponent;  ///< The longest side is 2^exponent units.
  std::uint8_t thin[3] = {0, 0, 0};       ///< Side k is 2^-kShifts[thin[k]] of that.

  /// The finest frame that holds a box (lattice units, inside the root cube but for rounding).
  static LooseFrame of(const double (&lo)[3], const double (&hi)[3]) {
    LooseFrame f;
    double extent[3];
    int most = kLeastExponent;
    for (int k = 0; k < 3; ++k) {
      const double least = std::clamp(lo[k] - kMargin, 0.0, 65534.0);
      f.origin[k] = static_cast<std::uint16_t>(static_cast<std::uint32_t>(least) & ~1u);
      extent[k] = hi[k] + kMargin - f.origin[k];
      while (most < kMostExponent && extent[k] > side(most)) ++most;
    }
    f.exponent = static_cast<std::uint8_t>(most);
    for (int k = 0; k < 3; ++k) {
      std::uint8_t code = 3;
      while (code > 0 && extent[k] > side(most - kShifts[code])) --code;
      f.thin[k] = code;
    }
    return f;
  }

  static LooseFrame unpack(std::uint64_t bits) {
    LooseFrame f;
    f.exponent = static_cast<std::uint8_t>(kLeastExponent + (bits & 15));
    for (int k = 0; k < 3; ++k) {
      f.thin[k] = static_cast<std::uint8_t>(bits >> (4 + 17 * k) & 3);
      f.origin[k] = static_cast<std::uint16_t>((bits >> (6 + 17 * k) & 0x7fff) << 1);
    }
    return f;
  }
  /// 55 bits.
  std::uint64_t pack() const {
    std::uint64_t bits = static_cast<std::uint64_t>(exponent - kLeastExponent);
    for (int k = 0; k < 3; ++k) {
      bits |= static_cast<std::uint64_t>(thin[k]) << (4 + 17 * k);
      bits |= static_cast<std::uint64_t>(origin[k] >> 1) << (6 + 17 * k);
    }
    return bits;
  }

  double side(std::size_t k) const { return side(exponent - kShifts[thin[k]]); }
  double longest() const { return side(int{exponent}); }

  /// Of the box of a lane.
  double lower(const NodeBounds& b, std::size_t k) const { return origin[k] + b.lo[k] * (side(k) / kBoxSteps); }
  double upper(const NodeBounds& b, std::size_t k) const { return origin[k] + b.hi[k] * (side(k) / kBoxSteps); }
  double middle(const NodeBounds& b, std::size_t k) const {
    return origin[k] + (b.lo[k] + b.hi[k]) * (side(k) * (0.5 / kBoxSteps));
  }

  /// The box that the frame was made for, or one inside that; kMargin is added.
  void encodeBox(const double (&lo)[3], const double (&hi)[3], NodeBounds& b) const {
    for (std::size_t k = 0; k < 3; ++k) {
      const double steps = kBoxSteps / side(k);
      b.setBox(k, (lo[k] - kMargin - origin[k]) * steps, (hi[k] + kMargin - origin[k]) * steps);
    }
  }

  /// The slab along `n`: n . (p - middle of the box) is `least` to `most` for the points p.
  void encodeSlab(const std::int8_t* n, double least, double most, NodeBounds& b) const {
    const double units = kLooseSlabSteps / longest() / kNormalLength;
    b.setSlab(n, least * units, most * units);
  }

  Volume decode(const NodeBounds& b) const {
    Volume v;
    for (std::size_t k = 0; k < 3; ++k) {
      const double half_step = side(k) * (0.5 / kBoxSteps);
      v.center[k] = origin[k] + (b.lo[k] + b.hi[k]) * half_step;
      v.half[k] = static_cast<float>((b.hi[k] - b.lo[k]) * half_step);
      v.normal[k] = static_cast<float>(b.normal[k] * (1.0 / kNormalLength));
    }
    const double unit = longest() / kLooseSlabSteps;
    v.slab_offset = static_cast<float>(b.slab_center * unit);
    v.slab_half = static_cast<float>(b.slab_half * (unit / 2));
    return v;
  }

  static constexpr double kMargin = 1e-6;  ///< Lattice units; far above the rounding of toLattice().

 private:
  // ldexp() takes as long as all else that a walk or a build does with a side.
  static double side(int exponent) {
    const std::uint64_t bits = static_cast<std::uint64_t>(1023 + exponent) << 52;
    double side;
    std::memcpy(&side, &bits, sizeof(side));
    return side;
  }
};

}  // namespace bocst::bounds
