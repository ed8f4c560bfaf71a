// SPDX-License-Identifier: BSD-3-Clause
// Vectors of space, one a lane, once for each instruction set; see Highway's -inl.h headers.
#if defined(BOCST_QUERY_VECTORS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BOCST_QUERY_VECTORS_INL_H
#undef BOCST_QUERY_VECTORS_INL_H
#else
#define BOCST_QUERY_VECTORS_INL_H
#endif

#include "query/kernels.h"
#include "query/octants-inl.h"

HWY_BEFORE_NAMESPACE();
namespace bocst::query::HWY_NAMESPACE {

struct Vec3 {
  V x, y, z;
};

HWY_INLINE Vec3 sub(Vec3 a, Vec3 b) { return {hn::Sub(a.x, b.x), hn::Sub(a.y, b.y), hn::Sub(a.z, b.z)}; }
HWY_INLINE V dot(Vec3 a, Vec3 b) { return hn::MulAdd(a.x, b.x, hn::MulAdd(a.y, b.y, hn::Mul(a.z, b.z))); }
HWY_INLINE Vec3 cross(Vec3 a, Vec3 b) {
  return {hn::Sub(hn::Mul(a.y, b.z), hn::Mul(a.z, b.y)), hn::Sub(hn::Mul(a.z, b.x), hn::Mul(a.x, b.z)),
          hn::Sub(hn::Mul(a.x, b.y), hn::Mul(a.y, b.x))};
}
HWY_INLINE V norm1(Vec3 a) { return hn::Add(hn::Add(hn::Abs(a.x), hn::Abs(a.y)), hn::Abs(a.z)); }
HWY_INLINE V min3(V a, V b, V c) { return hn::Min(hn::Min(a, b), c); }
HWY_INLINE V max3(V a, V b, V c) { return hn::Max(hn::Max(a, b), c); }

HWY_INLINE Vec3 min3(const Vec3 (&v)[3]) {
  return {min3(v[0].x, v[1].x, v[2].x), min3(v[0].y, v[1].y, v[2].y), min3(v[0].z, v[1].z, v[2].z)};
}
HWY_INLINE Vec3 max3(const Vec3 (&v)[3]) {
  return {max3(v[0].x, v[1].x, v[2].x), max3(v[0].y, v[1].y, v[2].y), max3(v[0].z, v[1].z, v[2].z)};
}
HWY_INLINE Vec3 abs(Vec3 a) { return {hn::Abs(a.x), hn::Abs(a.y), hn::Abs(a.z)}; }
HWY_INLINE Vec3 scaled(Vec3 a, V by) { return {hn::Mul(a.x, by), hn::Mul(a.y, by), hn::Mul(a.z, by)}; }

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

/// Corner k of the triangles from number i on.
HWY_INLINE Vec3 corner(const TrianglePack& pack, std::size_t k, std::size_t i) {
  const D d;
  return {hn::Load(d, pack.xyz[3 * k] + i), hn::Load(d, pack.xyz[3 * k + 1] + i), hn::Load(d, pack.xyz[3 * k + 2] + i)};
}

}  // namespace bocst::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
