// SPDX-License-Identifier: BSD-3-Clause
// Vectors of space, one a lane, once for each instruction set; see Highway's -inl.h headers.
#if defined(BOCST_SIMD_VECTORS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BOCST_SIMD_VECTORS_INL_H
#undef BOCST_SIMD_VECTORS_INL_H
#else
#define BOCST_SIMD_VECTORS_INL_H
#endif

#include "simd/octants-inl.h"

HWY_BEFORE_NAMESPACE();
namespace bocst::query::HWY_NAMESPACE {

template <typename T>
struct Vec3Of {
  T x, y, z;
};
using Vec3 = Vec3Of<V>;

template <typename T>
HWY_INLINE Vec3Of<T> sub(Vec3Of<T> a, Vec3Of<T> b) {
  return {hn::Sub(a.x, b.x), hn::Sub(a.y, b.y), hn::Sub(a.z, b.z)};
}
template <typename T>
HWY_INLINE T dot(Vec3Of<T> a, Vec3Of<T> b) {
  return hn::MulAdd(a.x, b.x, hn::MulAdd(a.y, b.y, hn::Mul(a.z, b.z)));
}
template <typename T>
HWY_INLINE Vec3Of<T> cross(Vec3Of<T> a, Vec3Of<T> b) {
  return {hn::Sub(hn::Mul(a.y, b.z), hn::Mul(a.z, b.y)), hn::Sub(hn::Mul(a.z, b.x), hn::Mul(a.x, b.z)),
          hn::Sub(hn::Mul(a.x, b.y), hn::Mul(a.y, b.x))};
}
template <typename T>
HWY_INLINE T norm1(Vec3Of<T> a) {
  return hn::Add(hn::Add(hn::Abs(a.x), hn::Abs(a.y)), hn::Abs(a.z));
}
template <typename T>
HWY_INLINE T min3(T a, T b, T c) {
  return hn::Min(hn::Min(a, b), c);
}
template <typename T>
HWY_INLINE T max3(T a, T b, T c) {
  return hn::Max(hn::Max(a, b), c);
}

HWY_INLINE Vec3 min3(const Vec3 (&v)[3]) {
  return {min3(v[0].x, v[1].x, v[2].x), min3(v[0].y, v[1].y, v[2].y), min3(v[0].z, v[1].z, v[2].z)};
}
HWY_INLINE Vec3 max3(const Vec3 (&v)[3]) {
  return {max3(v[0].x, v[1].x, v[2].x), max3(v[0].y, v[1].y, v[2].y), max3(v[0].z, v[1].z, v[2].z)};
}
template <typename T>
HWY_INLINE Vec3Of<T> abs(Vec3Of<T> a) {
  return {hn::Abs(a.x), hn::Abs(a.y), hn::Abs(a.z)};
}
template <typename T>
HWY_INLINE Vec3Of<T> scaled(Vec3Of<T> a, T by) {
  return {hn::Mul(a.x, by), hn::Mul(a.y, by), hn::Mul(a.z, by)};
}
/// a + by * direction.
template <typename T>
HWY_INLINE Vec3Of<T> along(Vec3Of<T> a, T by, Vec3Of<T> direction) {
  return {hn::MulAdd(by, direction.x, a.x), hn::MulAdd(by, direction.y, a.y), hn::MulAdd(by, direction.z, a.z)};
}
template <typename Mask, typename T>
HWY_INLINE Vec3Of<T> choose(Mask mask, Vec3Of<T> yes, Vec3Of<T> no) {
  return {hn::IfThenElse(mask, yes.x, no.x), hn::IfThenElse(mask, yes.y, no.y), hn::IfThenElse(mask, yes.z, no.z)};
}

HWY_INLINE Vec3 broadcast(float x, float y, float z) {
  const D d;
  return {hn::Set(d, x), hn::Set(d, y), hn::Set(d, z)};
}

template <std::size_t N>
HWY_INLINE Vec3 load(const float (&xyz)[3][N], std::size_t i) {
  const D d;
  return {hn::Load(d, xyz[0] + i), hn::Load(d, xyz[1] + i), hn::Load(d, xyz[2] + i)};
}
template <std::size_t N>
HWY_INLINE void store(Vec3 v, float (&xyz)[3][N], std::size_t i) {
  const D d;
  hn::Store(v.x, d, xyz[0] + i);
  hn::Store(v.y, d, xyz[1] + i);
  hn::Store(v.z, d, xyz[2] + i);
}

/// Corner k of the triangles from number i on, of a pack that has coordinate c of corner k at xyz[3 * k + c].
template <typename Pack>
HWY_INLINE Vec3 corner(const Pack& pack, std::size_t k, std::size_t i) {
  const D d;
  return {hn::Load(d, pack.xyz[3 * k] + i), hn::Load(d, pack.xyz[3 * k + 1] + i), hn::Load(d, pack.xyz[3 * k + 2] + i)};
}

}  // namespace bocst::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
