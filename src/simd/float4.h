// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <cstring>

// Four floats or doubles, by the compiler's own vectors: for code that is too short to be compiled for each instruction
// set and called through a table.

namespace bocst::simd {

using Float4 = float __attribute__((vector_size(16)));
using Int4 = std::int32_t __attribute__((vector_size(16)));
using Double2 = double __attribute__((vector_size(16)));
using Long2 = std::int64_t __attribute__((vector_size(16)));

template <int I>
Float4 lane(Float4 v) {
  return __builtin_shufflevector(v, v, I, I, I, I);
}

inline Float4 abs(Float4 v) {
  constexpr std::int32_t kAllButSign = 0x7fffffff;
  return reinterpret_cast<Float4>(reinterpret_cast<Int4>(v) & Int4{kAllButSign, kAllButSign, kAllButSign, kAllButSign});
}

inline bool any(Int4 mask) {
  const Long2 halves = reinterpret_cast<Long2>(mask);
  return (halves[0] | halves[1]) != 0;
}

/// Makes columns of rows.
inline void transpose(Float4& a, Float4& b, Float4& c, Float4& d) {
  const Float4 ab_low = __builtin_shufflevector(a, b, 0, 4, 1, 5), ab_high = __builtin_shufflevector(a, b, 2, 6, 3, 7);
  const Float4 cd_low = __builtin_shufflevector(c, d, 0, 4, 1, 5), cd_high = __builtin_shufflevector(c, d, 2, 6, 3, 7);
  a = __builtin_shufflevector(ab_low, cd_low, 0, 1, 4, 5);
  b = __builtin_shufflevector(ab_low, cd_low, 2, 3, 6, 7);
  c = __builtin_shufflevector(ab_high, cd_high, 0, 1, 4, 5);
  d = __builtin_shufflevector(ab_high, cd_high, 2, 3, 6, 7);
}

/// Four numbers from p on, as floats; or their differences from those at q.
inline Float4 load(const float* p) {
  Float4 v;
  std::memcpy(&v, p, sizeof v);
  return v;
}
inline Float4 load(const double* p) {
  double __attribute__((vector_size(32))) v;
  std::memcpy(&v, p, sizeof v);
  return __builtin_convertvector(v, Float4);
}
inline Float4 loadDifference(const float* p, const float* q) { return load(p) - load(q); }
inline Float4 loadDifference(const double* p, const double* q) {
  double __attribute__((vector_size(32))) v, w;
  std::memcpy(&v, p, sizeof v);
  std::memcpy(&w, q, sizeof w);
  return __builtin_convertvector(v - w, Float4);
}

/// Four doubles. (A vector of 32 bytes is not passed the same way by all compilers' settings.)
struct Double4 {
  Double2 low, high;

  friend Double4 operator+(Double4 a, Double4 b) { return {a.low + b.low, a.high + b.high}; }
  friend Double4 operator-(Double4 a, Double4 b) { return {a.low - b.low, a.high - b.high}; }
  friend Double4 operator*(Double4 a, double b) { return {a.low * b, a.high * b}; }
  double operator[](int i) const { return i < 2 ? low[i] : high[i - 2]; }
};

inline Double4 loadDoubles(const double* p) {
  Double4 v;
  std::memcpy(&v, p, sizeof v);
  return v;
}
inline Double4 loadDoubles(const float* p) {
  const double x = p[0], y = p[1], z = p[2], w = p[3];
  return {Double2{x, y}, Double2{z, w}};
}

inline Double4 abs(Double4 v) {
  constexpr Long2 kAllButSign = {0x7fffffffffffffff, 0x7fffffffffffffff};
  return {reinterpret_cast<Double2>(reinterpret_cast<Long2>(v.low) & kAllButSign),
          reinterpret_cast<Double2>(reinterpret_cast<Long2>(v.high) & kAllButSign)};
}

}  // namespace bocst::simd
