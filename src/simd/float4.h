// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <cstring>

// Four floats, by the compiler's own vectors: for code that is too short to be compiled for each instruction
// set and called through a table.

namespace bocst::simd {

using Float4 = float __attribute__((vector_size(16)));
using Int4 = std::int32_t __attribute__((vector_size(16)));
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

}  // namespace bocst::simd
