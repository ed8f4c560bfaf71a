// SPDX-License-Identifier: BSD-3-Clause
#include "scene/boxes.h"

#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "scene/boxes.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "simd/vectors-inl.h"

HWY_BEFORE_NAMESPACE();
namespace bocst::scene::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using namespace query::HWY_NAMESPACE;

// Which of eight boxes along the world's axes are no farther than `far` + far_b[] along any of them.
template <typename Boxes>
HWY_INLINE std::uint32_t overlapping(const BoxLane& a, const Boxes& b, float far, const float* far_b) {
  const D d;
  const BoxGroup& own = *a.group;
  std::uint32_t bits = 0;
  for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
    V more = hn::Set(d, far);
    if (far_b != nullptr) more = hn::Add(more, hn::LoadU(d, far_b + i));
    M all = hn::MaskFromVec(hn::BitCast(d, hn::Set(hn::RebindToSigned<D>(), -1)));
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      const M below = hn::Le(hn::Load(d, b.lo[k] + i), hn::Add(hn::Set(d, own.hi[k][a.lane]), more));
      const M above = hn::Ge(hn::Add(hn::Load(d, b.hi[k] + i), more), hn::Set(d, own.lo[k][a.lane]));
      all = hn::And(all, hn::And(below, above));
    }
    bits |= maskBits(all) << i;
  }
  return bits;
}

// What the faces of one box say: the distance of the other's box along the own axes, or how deep it is inside.
HWY_INLINE V ofFaces(V s0, V s1, V s2) {
  const D d;
  const V zero = hn::Zero(d);
  const V p0 = hn::Max(s0, zero), p1 = hn::Max(s1, zero), p2 = hn::Max(s2, zero);
  const V squared = hn::MulAdd(p0, p0, hn::MulAdd(p1, p1, hn::Mul(p2, p2)));
  return hn::IfThenElse(hn::Gt(squared, zero), hn::Sqrt(squared), max3(s0, s1, s2));
}

// Fills the gaps of the lanes in `mask` and returns those that are near.
//
// With u = 2^-24, C the largest coordinate and r the radius of each: centres are off by u C, so a way between them
// along an axis by at most 12 u (Ca + Cb), radii by 16 u (ra + rb); a box's reach has 128 u (C + r) for that. Axes are
// those of a rotation with entries of R^T R - 1 up to e = kFineError, see World::boxAt(). Their cross product, and sums
// of half sides along it, are then off by up to 4.5 e d for a distance d of the centres and 6.4 e r for each box.
// Beyond d = 4 (ra + rb) the faces' gap is more than d / 2, and kShare covers this; nearer, the reach does.
constexpr float kShare = 0.995f;

// The largest gap along a cross product of an axis of box a and one of boxes b, where there is one; it is a gap along
// an axis of length 1 or less, so not more than the distance. r[k][j] is the product of a's axis k and b's axis j,
// `size` its amount, t the displacement along the axes of a.
HWY_INLINE V gapAlongEdges(const V (&r)[3][3], const V (&size)[3][3], const V (&t)[3], const V (&half_a)[3],
                           const V (&half_b)[3]) {
  const D d;
  V most = hn::Zero(d);
  BOCST_UNROLL
  for (int k = 0; k < 3; ++k) {
    const int k1 = (k + 1) % 3, k2 = (k + 2) % 3;
    BOCST_UNROLL
    for (int j = 0; j < 3; ++j) {
      const int j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      const V along = hn::Abs(hn::NegMulAdd(t[k1], r[k2][j], hn::Mul(t[k2], r[k1][j])));
      const V of_a = hn::MulAdd(half_a[k1], size[k2][j], hn::Mul(half_a[k2], size[k1][j]));
      const V of_b = hn::MulAdd(half_b[j1], size[k][j2], hn::Mul(half_b[j2], size[k][j1]));
      most = hn::Max(most, hn::Sub(along, hn::Add(of_a, of_b)));
    }
  }
  return most;
}

HWY_INLINE std::uint32_t nearLanes(const BoxLane& a, const BoxGroup& b, std::uint32_t mask, float far,
                                   const float* far_b, float* gap) {
  const D d;
  const BoxGroup& own = *a.group;
  const std::size_t l = a.lane;
  std::uint32_t result = 0;
  for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
    const std::uint32_t lanes = mask >> i & ((1u << hn::Lanes(d)) - 1);
    if (lanes == 0) continue;
    const Vec3 displacement = sub(load(b.center, i), broadcast(own.center[0][l], own.center[1][l], own.center[2][l]));
    Vec3 axis_a[3], axis_b[3];
    V half_a[3], half_b[3], r[3][3], size[3][3], t[3], s[3], v[3];
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      axis_a[k] = broadcast(own.axis[k][0][l], own.axis[k][1][l], own.axis[k][2][l]);
      axis_b[k] = load(b.axis[k], i);
      half_a[k] = hn::Set(d, own.half[k][l]);
      half_b[k] = hn::Load(d, b.half[k] + i);
      t[k] = dot(displacement, axis_a[k]);
    }
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      V radius = half_a[k];
      BOCST_UNROLL
      for (int j = 0; j < 3; ++j) {
        r[k][j] = dot(axis_a[k], axis_b[j]);
        size[k][j] = hn::Abs(r[k][j]);
        radius = hn::MulAdd(half_b[j], size[k][j], radius);
      }
      s[k] = hn::Sub(hn::Abs(t[k]), radius);
    }
    BOCST_UNROLL
    for (int j = 0; j < 3; ++j) {
      V radius = half_b[j];
      BOCST_UNROLL
      for (int k = 0; k < 3; ++k) radius = hn::MulAdd(half_a[k], size[k][j], radius);
      v[j] = hn::Sub(hn::Abs(dot(displacement, axis_b[j])), radius);
    }
    V most = hn::Max(ofFaces(s[0], s[1], s[2]), ofFaces(v[0], v[1], v[2]));
    const V reach = hn::Add(hn::Set(d, own.reach[l]), hn::Load(d, b.reach + i));
    V more = hn::Set(d, far);
    if (far_b != nullptr) more = hn::Add(more, hn::LoadU(d, far_b + i));
    const V share = hn::Set(d, kShare);
    V g = hn::Sub(hn::Mul(share, most), reach);
    std::uint32_t near = maskBits(hn::Le(g, more)) & lanes;
    if (near != 0) {
      // How deep boxes overlap along edges says little: their axes may have almost no length.
      const V along_edges = gapAlongEdges(r, size, t, half_a, half_b);
      most = hn::IfThenElse(hn::Gt(along_edges, hn::Zero(d)), hn::Max(most, along_edges), most);
      g = hn::Sub(hn::Mul(share, most), reach);
      near = maskBits(hn::Le(g, more)) & lanes;
    }
    hn::StoreU(g, d, gap + i);
    result |= near << i;
  }
  return result;
}

void NearInGroup(const BoxLane& a, const BoxGroup& b, std::uint32_t mask, float far, const float* far_b, NearGroup& n) {
  n.mask = overlapping(a, b, far, far_b) & mask;
  if (n.mask != 0) n.mask = nearLanes(a, b, n.mask, far, far_b, n.gap);
}

std::size_t NearInTree(const BoxLane& a, const BoxNode* nodes, const BoxGroup* groups, const std::uint8_t* masks,
                       float far, std::int32_t* stack, NearGroup* near) {
  std::size_t count = 0, depth = 0;
  stack[depth++] = 0;
  while (depth != 0) {
    const BoxNode& node = nodes[stack[--depth]];
    for (std::uint32_t left = overlapping(a, node, far, nullptr); left != 0; left &= left - 1) {
      const std::int32_t child = node.child[__builtin_ctz(left)];
      if (child >= 0) {
        stack[depth++] = child;
        continue;
      }
      const auto group = static_cast<std::uint32_t>(~child);
      NearGroup& n = near[count];
      n.group = group;
      n.mask = masks[group] == 0 ? 0 : overlapping(a, groups[group], far, nullptr) & masks[group];
      if (n.mask != 0) n.mask = nearLanes(a, groups[group], n.mask, far, nullptr, n.gap);
      if (n.mask != 0) ++count;
    }
  }
  return count;
}

}  // namespace bocst::scene::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bocst::scene {

HWY_EXPORT(NearInGroup);
HWY_EXPORT(NearInTree);

BoxGroup::BoxGroup() : center(), axis(), half(), reach() {
  for (int k = 0; k < 3; ++k) {
    for (std::size_t i = 0; i < 8; ++i) {
      lo[k][i] = std::numeric_limits<float>::infinity();
      hi[k][i] = -std::numeric_limits<float>::infinity();
    }
  }
}

void BoxGroup::set(std::size_t lane, const Box& box) {
  for (int k = 0; k < 3; ++k) {
    center[k][lane] = box.center[k];
    for (int j = 0; j < 3; ++j) axis[k][j][lane] = box.axis[k][j];
    half[k][lane] = box.half[k];
    lo[k][lane] = box.lo[k];
    hi[k][lane] = box.hi[k];
  }
  reach[lane] = box.reach;
}

void nearInGroup(const BoxLane& a, const BoxGroup& b, std::uint32_t mask, float far, const float* far_b, NearGroup& n) {
  HWY_DYNAMIC_DISPATCH(NearInGroup)(a, b, mask, far, far_b, n);
}

std::size_t nearInTree(const BoxLane& a, const BoxNode* nodes, const BoxGroup* groups, const std::uint8_t* masks,
                       float far, std::int32_t* stack, NearGroup* near) {
  return HWY_DYNAMIC_DISPATCH(NearInTree)(a, nodes, groups, masks, far, stack, near);
}

}  // namespace bocst::scene
#endif
