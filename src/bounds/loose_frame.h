// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

namespace bocst::bounds {

/// Where the eight boxes of a bulk-built block lie: bytes of a frame of its own, which follows no cell of the lattice.
/// Box k of lane o spans origin[k] + lo * side(k) / 255 to origin[k] + hi * side(k) / 255, in lattice units. The slab
/// of a lane counts from the middle of its box, in units of the longest side: |normal / 127 . (p - middle) -
/// slab_center * side / 256| <= slab_half * side / 512; a zero normal is no bound.
///
/// Sides are powers of two, so a thin axis may be finer than the longest by one of four factors. 63 bits in all.
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

/// A direction as bytes of length about 127; false where it has none.
inline bool byteNormal(const float (&direction)[3], std::int8_t (&bytes)[3]) {
  const float* const d = direction;
  const float length = std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
  if (!(length > 0) || !std::isfinite(length)) return false;
  for (int k = 0; k < 3; ++k) bytes[k] = static_cast<std::int8_t>(std::lrint(d[k] / length * 127));
  return true;
}

/// What a lane of a LooseFrame says, as bytes.
struct LooseBounds {
  std::uint8_t lo[3] = {0, 0, 0}, hi[3] = {0, 0, 0};
  std::int8_t normal[3] = {0, 0, 0};
  std::int8_t slab_center = 0;
  std::uint8_t slab_half = 255;

  /// The box, rounded outwards.
  void setBox(const LooseFrame& f, const double (&lo_)[3], const double (&hi_)[3]) {
    for (std::size_t k = 0; k < 3; ++k) {
      const double scale = 255 / f.side(k);
      const double least = (lo_[k] - LooseFrame::kMargin - f.origin[k]) * scale;
      const double most = (hi_[k] + LooseFrame::kMargin - f.origin[k]) * scale;
      lo[k] = static_cast<std::uint8_t>(std::clamp(std::floor(least), 0.0, 255.0));
      hi[k] = static_cast<std::uint8_t>(std::clamp(std::ceil(most), 0.0, 255.0));
    }
  }

  /// The middle of the box as it is stored, in lattice units.
  double middle(const LooseFrame& f, std::size_t k) const { return f.origin[k] + (lo[k] + hi[k]) * (f.side(k) / 510); }

  /// The slab along `n` (bytes) that holds the interval, which counts from the middle; none where bytes do not reach.
  void setSlab(const LooseFrame& f, const std::int8_t (&n)[3], double least, double most) {
    const double center = std::round((least + most) / 2 * (256 / f.longest())), at = center * (f.longest() / 256);
    const double half = std::ceil(std::max(most - at, at - least) * (512 / f.longest()));
    if (!(std::abs(center) <= 127) || !(half <= 255)) return;
    std::copy_n(n, 3, normal);
    slab_center = static_cast<std::int8_t>(center);
    slab_half = static_cast<std::uint8_t>(half);
  }
};

}  // namespace bocst::bounds
