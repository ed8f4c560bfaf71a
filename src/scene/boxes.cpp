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

/// A box in all lanes; `lo`, `hi` are farther out by `far`.
struct Own {
  Vec3 center, axis[3];
  V half[3], reach, far, lo[3], hi[3];
};

HWY_INLINE Own ownOf(const BoxLane& a, float far) {
  const D d;
  const BoxGroup& g = *a.group;
  const std::size_t l = a.lane;
  Own own;
  own.center = broadcast(g.center[0][l], g.center[1][l], g.center[2][l]);
  own.reach = hn::Set(d, g.reach[l]);
  own.far = hn::Set(d, far);
  BOCST_UNROLL
  for (int k = 0; k < 3; ++k) {
    own.axis[k] = broadcast(g.axis[k][0][l], g.axis[k][1][l], g.axis[k][2][l]);
    own.half[k] = hn::Set(d, g.half[k][l]);
    own.lo[k] = hn::Set(d, g.lo[k][l] - far);
    own.hi[k] = hn::Set(d, g.hi[k][l] + far);
  }
  return own;
}

// How far the own box or those of a vector may be: `far` and their own, if they have one.
HWY_INLINE V farOf(const Own& a, const float* far_b, std::size_t i) {
  return far_b == nullptr ? a.far : hn::Add(a.far, hn::LoadU(D(), far_b + i));
}

// Which of eight boxes along the world's axes are no farther than the own `far` + far_b[] along any of them.
template <typename Boxes>
HWY_INLINE std::uint32_t overlapping(const Own& a, const Boxes& b, const float* far_b) {
  const D d;
  std::uint32_t bits = 0;
  for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
    const V more = far_b == nullptr ? hn::Zero(d) : hn::LoadU(d, far_b + i);
    M all = hn::MaskFromVec(hn::BitCast(d, hn::Set(hn::RebindToSigned<D>(), -1)));
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      V lo = hn::Load(d, b.lo[k] + i), hi = hn::Load(d, b.hi[k] + i);
      if (far_b != nullptr) {
        lo = hn::Sub(lo, more);
        hi = hn::Add(hi, more);
      }
      all = hn::And(all, hn::And(hn::Le(lo, a.hi[k]), hn::Ge(hi, a.lo[k])));
    }
    bits |= bitsOf(D(), all) << i;
  }
  return bits;
}

// The gap of two boxes along the normals of one box's faces: their distance if kDistance, else the largest gap of the
// three; negative: the depth.
template <bool kDistance>
HWY_INLINE V gapAlongFaces(V s0, V s1, V s2) {
  const D d;
  if constexpr (!kDistance) return max3(s0, s1, s2);
  const V zero = hn::Zero(d);
  const V p0 = hn::Max(s0, zero), p1 = hn::Max(s1, zero), p2 = hn::Max(s2, zero);
  const V squared = hn::MulAdd(p0, p0, hn::MulAdd(p1, p1, hn::Mul(p2, p2)));
  return hn::IfThenElse(hn::Gt(squared, zero), hn::Sqrt(squared), max3(s0, s1, s2));
}

constexpr float kShare = 0.995f;  // see nearLanes()

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

// Fills the gaps of the lanes in `mask` and returns those that are near.
//
// With u = 2^-24, C the largest coordinate and r the radius of each: centres are off by u C, so their distance
// along an axis by at most 12 u (Ca + Cb), radii by 16 u (ra + rb); a box's reach has 128 u (C + r) for that. Axes are
// those of a rotation with entries of R^T R - I up to e = kFineError, see World::boxAt(). Their cross product, and sums
// of half sides along it, are then off by up to 4.5 e d for a distance d of the centres and 6.4 e r for each box.
// Beyond d = 4 (ra + rb) the faces' gap is more than d / 4, and kShare covers this; nearer, the reach does.
template <bool kDistance>
HWY_INLINE std::uint32_t nearLanes(const Own& a, const BoxGroup& b, std::uint32_t mask, const float* far_b,
                                   float* gap) {
  const D d;
  std::uint32_t result = 0;
  for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
    const std::uint32_t lanes = mask >> i & ((1u << hn::Lanes(d)) - 1);
    if (lanes == 0) continue;
    const V reach = hn::Add(a.reach, hn::Load(d, b.reach + i)), far = farOf(a, far_b, i), share = hn::Set(d, kShare);
    const Vec3 displacement = sub(load(b.center, i), a.center);
    Vec3 axis_b[3];
    V half_b[3], r[3][3], size[3][3], t[3], s[3], v[3];
    BOCST_UNROLL
    for (int j = 0; j < 3; ++j) {
      axis_b[j] = load(b.axis[j], i);
      half_b[j] = hn::Load(d, b.half[j] + i);
    }
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      t[k] = dot(displacement, a.axis[k]);
      V radius = a.half[k];
      BOCST_UNROLL
      for (int j = 0; j < 3; ++j) {
        r[k][j] = dot(a.axis[k], axis_b[j]);
        size[k][j] = hn::Abs(r[k][j]);
        radius = hn::MulAdd(half_b[j], size[k][j], radius);
      }
      s[k] = hn::Sub(hn::Abs(t[k]), radius);
    }
    V most = gapAlongFaces<kDistance>(s[0], s[1], s[2]), g;
    const auto near = [&] {
      g = hn::Sub(hn::Mul(share, most), reach);
      return bitsOf(D(), hn::Le(g, far)) & lanes;
    };
    if (near() == 0) continue;
    BOCST_UNROLL
    for (int j = 0; j < 3; ++j) {
      V radius = half_b[j];
      BOCST_UNROLL
      for (int k = 0; k < 3; ++k) radius = hn::MulAdd(a.half[k], size[k][j], radius);
      v[j] = hn::Sub(hn::Abs(dot(displacement, axis_b[j])), radius);
    }
    most = hn::Max(most, gapAlongFaces<kDistance>(v[0], v[1], v[2]));
    if (near() == 0) continue;
    // How deep boxes overlap along edges says little: their axes may have almost no length.
    const V along_edges = gapAlongEdges(r, size, t, a.half, half_b);
    most = hn::IfThenElse(hn::Gt(along_edges, hn::Zero(d)), hn::Max(most, along_edges), most);
    result |= near() << i;
    hn::StoreU(g, d, gap + i);
  }
  return result;
}

HWY_INLINE std::uint32_t nearLanes(const Own& a, const BoxGroup& b, std::uint32_t mask, bool by_distance,
                                   const float* far_b, float* gap) {
  return by_distance ? nearLanes<true>(a, b, mask, far_b, gap) : nearLanes<false>(a, b, mask, far_b, gap);
}

void NearInGroup(const BoxLane& a, const BoxGroup& b, std::uint32_t mask, float far, const float* far_b, NearGroup& n) {
  const Own own = ownOf(a, far);
  n.mask = overlapping(own, b, far_b) & mask;
  if (n.mask != 0) n.mask = nearLanes(own, b, n.mask, far > 0 || far_b != nullptr, far_b, n.gap);
}

std::size_t NearBox(const SceneBoxes& boxes, std::size_t i, const std::uint8_t* masks, float far,
                    const float* far_of_moving, std::int32_t* stack, NearGroup* near) {
  const Own own = ownOf({&boxes.moving[i / 8], i % 8}, far);
  std::size_t count = 0, depth = 0;
  const auto addNearGroup = [&](const BoxGroup& group, std::uint32_t mask, std::size_t index, const float* far_b) {
    mask &= overlapping(own, group, far_b);
    if (mask == 0) return;
    NearGroup& n = near[count];
    n.mask = nearLanes(own, group, mask, far > 0 || far_b != nullptr, far_b, n.gap);
    n.box = static_cast<std::uint32_t>(i);
    n.group = static_cast<std::uint32_t>(index);
    if (n.mask != 0) ++count;
  };
  if (boxes.nodes != nullptr) stack[depth++] = 0;
  while (depth != 0) {
    const BoxNode& node = boxes.nodes[stack[--depth]];
    for (std::uint32_t left = overlapping(own, node, nullptr); left != 0; left &= left - 1) {
      const std::int32_t child = node.child[__builtin_ctz(left)];
      if (child >= 0) {
        stack[depth++] = child;
      } else {
        const auto group = static_cast<std::size_t>(~child);
        if (masks[group] != 0) addNearGroup(boxes.fixed[group], masks[group], group, nullptr);
      }
    }
  }
  // Pairs of two moving ones are in the row of the first.
  for (std::size_t g = i / 8; g < boxes.moving_count; ++g) {
    const std::size_t index = boxes.fixed_count + g;
    if (masks[index] == 0) continue;
    addNearGroup(boxes.moving[g], masks[index], index, far_of_moving == nullptr ? nullptr : far_of_moving + 8 * g);
  }
  return count;
}

}  // namespace bocst::scene::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bocst::scene {

HWY_EXPORT(NearInGroup);
HWY_EXPORT(NearBox);

namespace {

template <typename Boxes>
void makeEmpty(Boxes& boxes, std::size_t lane) {
  for (int k = 0; k < 3; ++k) {
    boxes.lo[k][lane] = std::numeric_limits<float>::infinity();
    boxes.hi[k][lane] = -std::numeric_limits<float>::infinity();
  }
}

}  // namespace

BoxGroup::BoxGroup() : center(), axis(), half(), reach() {
  for (std::size_t i = 0; i < 8; ++i) clear(i);
}

void BoxGroup::clear(std::size_t lane) { makeEmpty(*this, lane); }

BoxNode::BoxNode() : child() {
  for (std::size_t i = 0; i < 8; ++i) makeEmpty(*this, i);
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

std::size_t nearBox(const SceneBoxes& boxes, std::size_t i, const std::uint8_t* masks, float far,
                    const float* far_of_moving, std::int32_t* stack, NearGroup* near) {
  return HWY_DYNAMIC_DISPATCH(NearBox)(boxes, i, masks, far, far_of_moving, stack, near);
}

}  // namespace bocst::scene
#endif
