// SPDX-License-Identifier: BSD-3-Clause
#include "query/collide/sphere_steps.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/collide/sphere_steps.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>

#include "query/cull/frames-inl.h"

#ifndef BOCST_SPHERE_STEPS_ONCE
#define BOCST_SPHERE_STEPS_ONCE
namespace bocst::query {

/// Decides in double, as the definition says: which octants in `mask` of a block of side `own` meet the other node?
unsigned decideMeeting(const SphereSteps& s, int own, std::uint32_t index, unsigned mask, tree::NodeRef other);

namespace {

constexpr float kHalfDiagonal = 0.8660254f;  // of a cube of side 1
constexpr float kClippedFactor = 1.4142136f;  // see TreeSide::sphere()

/// A sphere in float, about the middle of its side's root or of the other's.
struct RoughSphere {
  float center[3];
  float radius;
};

// The sphere of a cell in the frame of its side, as TreeSide::sphere() has it.
inline RoughSphere sphereOf(const SphereSteps& s, int side, std::uint32_t level, const std::uint32_t (&at)[3]) {
  const std::uint32_t length = 1u << (lattice::kMaxLevel - static_cast<int>(level));
  const float unit = s.frames.side[side].unit;
  RoughSphere sphere;
  std::uint32_t sum = 0, sizes[3];
  BOCST_UNROLL
  for (int k = 0; k < 3; ++k) {
    const std::uint32_t low = at[k] * length, high = std::min(low + length, s.extent[side][k]);
    sizes[k] = high - low;
    sum += sizes[k];
    sphere.center[k] = static_cast<float>(static_cast<std::int32_t>(low + high) - 2 * lattice::kMiddle) * (0.5f * unit);
  }
  if (sum == 3 * length) {
    sphere.radius = kHalfDiagonal * (static_cast<float>(length) * unit);
    return sphere;
  }
  float squared = 0;
  BOCST_UNROLL
  for (int k = 0; k < 3; ++k) squared += static_cast<float>(sizes[k]) * static_cast<float>(sizes[k]);
  sphere.radius = std::sqrt(squared) * (0.5f * unit);
  if (level < s.deepest[side]) sphere.radius *= kClippedFactor;
  return sphere;
}

inline RoughSphere seenByOther(const SphereSteps& s, int side, const RoughSphere& sphere) {
  const SphereFrames::Side& f = s.frames.side[side];
  RoughSphere seen;
  BOCST_UNROLL
  for (int j = 0; j < 3; ++j) {
    seen.center[j] = f.shift[j] + (f.to_other[j][0] * sphere.center[0] + f.to_other[j][1] * sphere.center[1] +
                                   f.to_other[j][2] * sphere.center[2]);
  }
  seen.radius = sphere.radius;
  return seen;
}

inline RoughSphere sphereOfOctant(const SphereSteps& s, int side, const tree::Block* block, std::uint32_t level,
                                  std::uint32_t o) {
  std::uint32_t at[3] = {0, 0, 0};
  if (block != nullptr) {
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) at[k] = 2u * block->at[k] + (o >> k & 1);
  }
  return sphereOf(s, side, level, at);
}

}  // namespace
}  // namespace bocst::query
#endif

HWY_BEFORE_NAMESPACE();
namespace bocst::query::HWY_NAMESPACE {

// Which octants of a block may meet the sphere `y`, in the frame of the block's side, and of which of them that is in
// doubt.
struct Met {
  unsigned maybe, doubtful;
};
HWY_INLINE Met meeting(const SphereSteps& s, int own, const tree::Block& block, const RoughSphere& y,
                       std::uint32_t* order) {
  const D d;
  const hn::RebindToUnsigned<D> du;
  const std::uint32_t length = 1u << (lattice::kMaxLevel - 1 - block.shape);
  const float unit = s.frames.side[own].unit;
  const float more = s.frames.tolerance + s.frames.rounding_margin, less = s.frames.tolerance - s.frames.rounding_margin;
  bool whole = true;
  std::int32_t corner[3];  // of the first octant, from the middle of the root
  BOCST_UNROLL
  for (int k = 0; k < 3; ++k) {
    const std::uint32_t low = block.at[k] * (2 * length);
    whole &= low + 2 * length <= s.extent[own][k];
    corner[k] = static_cast<std::int32_t>(low) - lattice::kMiddle;
  }
  Met met{0, 0};
  const auto compare = [&](std::size_t i, V squared, V high, V low) HWY_ATTR {
    const M apart = hn::Gt(squared, hn::Mul(high, high));
    const M certain = hn::And(hn::Gt(low, hn::Zero(d)), hn::Le(squared, hn::Mul(low, low)));
    const auto depth =
        hn::Or(hn::And(hn::BitCast(du, squared), hn::Set(du, ~7u)), hn::Iota(du, static_cast<std::uint32_t>(i)));
    hn::StoreU(depth, du, order + i);
    met.maybe |= (maskBits(hn::Not(apart)) & ((1u << hn::Lanes(d)) - 1)) << i;
    met.doubtful |= (maskBits(hn::Not(hn::Or(apart, certain))) & ((1u << hn::Lanes(d)) - 1)) << i;
  };
  if (whole) {
    const float side = static_cast<float>(length) * unit, sum = kHalfDiagonal * side + y.radius;
    float first[3];  // from the centre of the first octant's sphere
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      first[k] = y.center[k] - (static_cast<float>(2 * corner[k] + static_cast<std::int32_t>(length))) * (0.5f * unit);
    }
    for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
      V squared = hn::Zero(d);
      BOCST_UNROLL
      for (int k = 0; k < 3; ++k) {
        const V way = hn::NegMulAdd(hn::Load(d, kOctantCorner[k] + i), hn::Set(d, side), hn::Set(d, first[k]));
        squared = hn::MulAdd(way, way, squared);
      }
      compare(i, squared, hn::Set(d, sum + more), hn::Set(d, sum + less));
    }
  } else {
    const float factor = block.shape + 1u < s.deepest[own] ? kClippedFactor : 1.0f;
    const V side = hn::Set(d, static_cast<float>(length));
    for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
      V squared = hn::Zero(d), diagonal = hn::Zero(d), cut = hn::Zero(d);
      BOCST_UNROLL
      for (int k = 0; k < 3; ++k) {
        const V end = hn::Set(d, static_cast<float>(static_cast<std::int32_t>(s.extent[own][k]) - lattice::kMiddle));
        const V low = hn::MulAdd(hn::Load(d, kOctantCorner[k] + i), side, hn::Set(d, static_cast<float>(corner[k])));
        const V high = hn::Min(hn::Add(low, side), end), size = hn::Sub(high, low);
        cut = hn::Max(cut, hn::Sub(side, size));
        diagonal = hn::MulAdd(size, size, diagonal);
        const V way = hn::NegMulAdd(hn::Add(low, high), hn::Set(d, 0.5f * unit), hn::Set(d, y.center[k]));
        squared = hn::MulAdd(way, way, squared);
      }
      const V per_size = hn::IfThenElse(hn::Gt(cut, hn::Zero(d)), hn::Set(d, factor * 0.5f * unit),
                                        hn::Set(d, 0.5f * unit));
      const V sum = hn::MulAdd(hn::Sqrt(diagonal), per_size, hn::Set(d, y.radius));
      compare(i, squared, hn::Add(sum, hn::Set(d, more)), hn::Add(sum, hn::Set(d, less)));
    }
  }
  met.maybe &= block.grey;
  met.doubtful &= block.grey;
  return met;
}

// Which of a group's octants is the nearest.
HWY_INLINE std::uint32_t nearest(const SphereGroup& group, std::uint32_t octants) {
  const hn::RebindToUnsigned<D> du;
  auto least = hn::Set(du, ~0u);
  for (std::size_t i = 0; i < 8; i += hn::Lanes(du)) {
    const std::uint8_t wanted[8] = {static_cast<std::uint8_t>(octants >> i)};
    least = hn::Min(least, hn::IfThenElse(hn::LoadMaskBits(du, wanted), hn::LoadU(du, group.order + i), hn::Set(du, ~0u)));
  }
  return hn::GetLane(hn::MinOfLanes(du, least)) & 7;
}

void DecodeRoots(SphereSteps& s) {
  for (int side = 0; side < 2; ++side) {
    decodeRoot(s.geometry, side, s.side[side]->tree().rootBounds(), s.volumes[side]);
  }
}

// Where the volume of a node is, for pairs that come without frames.
HWY_INLINE std::uint32_t lookUp(SphereSteps& s, int side, tree::NodeRef node, std::uint32_t& frames) {
  const std::uint32_t frame = frames++;
  const tree::Tree& tree = s.side[side]->tree();
  if (node.isRoot()) {
    decodeRoot(s.geometry, side, tree.rootBounds(), s.volumes[frame]);
    s.holds[frame] = ~std::uint64_t{0};
    return 8 * frame;
  }
  const std::uint64_t name = std::uint64_t{node.block()} << 1 | static_cast<std::uint64_t>(side);
  if (s.holds[frame] != name) decodeBlock(s.geometry, side, tree.block(node.block()), s.volumes[frame]);
  s.holds[frame] = name;
  return 8 * frame + static_cast<std::uint32_t>(node.octant());
}

SphereSteps::Event NextEvent(SphereSteps& s) {
  while (s.depth != 0) {
    SphereGroup& top = s.stack[s.depth - 1];
    const int side = static_cast<int>(top.side);
    const std::uint32_t o = s.nearest_first && (top.octants & (top.octants - 1)) != 0
                                ? nearest(top, top.octants)
                                : static_cast<std::uint32_t>(__builtin_ctz(top.octants));
    top.octants &= ~(1u << o);
    if (top.octants == 0) --s.depth;
    SphereNode own;
    own.node = tree::NodeRef::octant(top.block, static_cast<int>(o));
    own.level = top.level;
    const SphereNode other = top.other;
    const bool own_leaf = own.level >= s.deepest[side], other_leaf = other.level >= s.deepest[1 - side];
    own.ref = top.at != nullptr ? top.at->child[o].load(std::memory_order_acquire)
                                : s.side[side]->tree().childRef(own.node);
    // The larger of two nodes is expanded, unless it is a leaf.
    const int below = static_cast<int>(other.level) - static_cast<int>(own.level);
    const bool own_larger = side == 0 ? below >= s.not_smaller : -below < s.not_smaller;
    const bool expands_own = other_leaf || (!own_leaf && own_larger);
    const SphereNode& expanded = expands_own ? own : other;
    if (expanded.ref.tag() != tree::ChildRef::kBlock) {
      s.pair[side] = own.node;
      s.pair[1 - side] = other.node;
      return SphereSteps::kDeferred;
    }
    const int x = expands_own ? side : 1 - side;
    const std::uint32_t index = expanded.ref.index();
    const tree::Tree& tree = s.side[x]->tree();
    const tree::Block& block = tree.block(index);
    RoughSphere y;
    std::uint32_t lane, frames = top.frames;
    if (expands_own) {
      lane = top.other_lane;
      BOCST_UNROLL
      for (int k = 0; k < 3; ++k) y.center[k] = top.center[k];
      y.radius = top.radius;
    } else {
      y = seenByOther(s, side, sphereOfOctant(s, side, top.at, own.level, o));
      lane = top.frame == SphereGroup::kNone ? SphereGroup::kNone : 8 * top.frame + (top.at == nullptr ? 0 : o);
    }
    const SphereNode still = expands_own ? other : own;
    tree.markUsed(index, s.side[0]->now());
    SphereGroup& next = s.stack[s.depth];
    const std::uint32_t level = block.shape + 1u;
    const bool leaves = level >= s.deepest[x] && (expands_own ? other_leaf : own_leaf);
    unsigned mask = block.grey;
    if (leaves || !s.touching_only) {
      const Met met = meeting(s, x, block, y, next.order);
      mask = met.maybe;
      if (met.doubtful != 0) mask = (mask & ~met.doubtful) | decideMeeting(s, x, index, met.doubtful, still.node);
      if (mask == 0) continue;
    }
    std::uint32_t frame = SphereGroup::kNone;
    if (s.touching_only ? !leaves : level <= s.last_volumes[x] && lane != SphereGroup::kNone) {
      if (lane == SphereGroup::kNone) lane = lookUp(s, 1 - x, still.node, frames);
      frame = frames++;
      const std::uint64_t name = std::uint64_t{index} << 1 | static_cast<std::uint64_t>(x);
      if (s.holds[frame] != name) decodeBlock(s.geometry, x, block, s.volumes[frame]);
      s.holds[frame] = name;
      mask = overlapping(s.geometry, s.volumes[frame], s.volumes[lane / 8], lane % 8, mask, next.order);
      if (mask == 0) continue;
      const hn::RebindToUnsigned<D> du;
      for (std::size_t i = 0; i < 8; i += hn::Lanes(du)) {
        hn::StoreU(hn::Xor(hn::LoadU(du, next.order + i), hn::Set(du, ~7u)), du, next.order + i);
      }
    }
    if (leaves) {
      s.pair[x] = tree::NodeRef::octant(index, 0);
      s.pair[1 - x] = still.node;
      s.expanded = x;
      s.mask = mask;
      return SphereSteps::kLeaves;
    }
    ++s.depth;
    next.other = still;
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) next.center[k] = y.center[k];
    next.radius = y.radius;
    next.at = &block;
    next.side = static_cast<std::uint32_t>(x);
    next.block = index;
    next.level = level;
    next.octants = mask;
    next.other_lane = lane;
    next.frame = frame;
    next.frames = frames;
  }
  return SphereSteps::kDone;
}

unsigned OctantsMeeting(const SphereSteps& s, int own, const tree::Block& block, const RoughSphere& y,
                        unsigned& doubtful) {
  std::uint32_t order[8];
  const Met met = meeting(s, own, block, y, order);
  doubtful = met.doubtful;
  return met.maybe;
}

}  // namespace bocst::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bocst::query {

HWY_EXPORT(DecodeRoots);
HWY_EXPORT(NextEvent);
HWY_EXPORT(OctantsMeeting);

SphereFrames::SphereFrames(const SimilarityTransform& one_in_zero) {
  const double q0 = lattice::kMiddle, q1 = q0 * one_in_zero.scale;
  const Eigen::Matrix3d& r = one_in_zero.rotation;
  const Eigen::Vector3d t = one_in_zero * Eigen::Vector3d::Constant(q0) - Eigen::Vector3d::Constant(q0);
  const double size = t.norm() + 2.45 * (q0 + q1);
  constexpr double kMost = 1e17;  // squares must be floats
  if (!(size < kMost && one_in_zero.tolerance < kMost)) return;
  const Eigen::Vector3d back = -(r.transpose() * t);
  for (int j = 0; j < 3; ++j) {
    for (int k = 0; k < 3; ++k) side[0].to_other[j][k] = side[1].to_other[k][j] = static_cast<float>(r(k, j));
    side[0].shift[j] = static_cast<float>(back[j]);
    side[1].shift[j] = static_cast<float>(t[j]);
  }
  side[0].unit = 1;
  side[1].unit = static_cast<float>(one_in_zero.scale);
  rounding_margin = static_cast<float>(size * (48 * 0x1p-24 + 6 * one_in_zero.orthogonality_error) * 1.0001);
  tolerance = static_cast<float>(one_in_zero.tolerance);
}

SphereSteps::SphereSteps(const TreeSide& a, const TreeSide& b, const SimilarityTransform& b_in_a_, Frame* volumes_)
    : side{&a, &b},
      b_in_a(b_in_a_),
      frames(b_in_a_),
      geometry(b_in_a_.scale, withReach(a, b, b_in_a_)),
      volumes(volumes_) {
  const PairFrames tight(b_in_a.scale, b_in_a);
  margins[0][0] = geometry.rounding_margin;
  margins[0][1] = geometry.slab_rounding_margin;
  margins[1][0] = tight.rounding_margin;
  margins[1][1] = tight.slab_rounding_margin;
  std::fill_n(holds, kVolumes, ~std::uint64_t{0});
  static int skip = getenv("SKIP") ? atoi(getenv("SKIP")) : 1;
  for (int s = 0; s < 2; ++s) {
    const tree::Tree& tree = side[s]->tree();
    std::copy_n(tree.surface().lattice.extent().data(), 3, extent[s]);
    deepest[s] = static_cast<std::uint32_t>(tree.deepest());
    last_volumes[s] = PairFrames::fits(b_in_a.scale) && int(deepest[s]) > skip ? deepest[s] - skip : 0;
  }
  // 2^deeper against the ratio of units, exactly.
  const bool even = std::frexp(b_in_a.scale, &not_smaller) == 0.5;
  if (even) --not_smaller;
}

SimilarityTransform withReach(const TreeSide& a, const TreeSide& b, SimilarityTransform b_in_a) {
  const auto diameter = [](const TreeSide& side) {
    return std::sqrt(3.0) * (1 << (lattice::kMaxLevel - side.tree().deepest()));
  };
  b_in_a.tolerance += (diameter(a) + diameter(b) * b_in_a.scale) * (1 + 1e-9);
  return b_in_a;
}

unsigned decideMeeting(const SphereSteps& s, int own, std::uint32_t index, unsigned mask, tree::NodeRef other) {
  unsigned met = 0;
  for (; mask != 0; mask &= mask - 1) {
    const int o = __builtin_ctz(mask);
    const tree::NodeRef octant = tree::NodeRef::octant(index, o);
    const Sphere a = s.side[0]->sphere(own == 0 ? octant : other), b = s.side[1]->sphere(own == 0 ? other : octant);
    met |= static_cast<unsigned>(spheresMeet(a, placed(b, s.b_in_a), s.b_in_a.tolerance)) << o;
  }
  return met;
}

SphereSteps::Event nextEvent(SphereSteps& steps) { return HWY_DYNAMIC_DISPATCH(NextEvent)(steps); }

void pushPair(SphereSteps& s, tree::NodeRef node_a, tree::NodeRef node_b) {
  const tree::Tree &a = s.side[0]->tree(), &b = s.side[1]->tree();
  SphereGroup& top = s.stack[s.depth++];
  top.other.node = node_b;
  top.other.ref = b.childRef(node_b);
  top.other.level = static_cast<std::uint32_t>(b.level(node_b));
  const tree::Block* block = node_b.isRoot() ? nullptr : &b.block(node_b.block());
  const auto octant = static_cast<std::uint32_t>(node_b.octant());
  const RoughSphere seen = seenByOther(s, 1, sphereOfOctant(s, 1, block, top.other.level, octant));
  std::copy_n(seen.center, 3, top.center);
  top.radius = seen.radius;
  top.side = 0;
  top.at = node_a.isRoot() ? nullptr : &a.block(node_a.block());
  top.block = node_a.block();
  top.level = static_cast<std::uint32_t>(a.level(node_a));
  top.octants = 1u << node_a.octant();
  top.other_lane = top.frame = SphereGroup::kNone;
  top.frames = 0;
  if (node_a.isRoot() && node_b.isRoot() && s.last_volumes[0] > 0 && s.last_volumes[1] > 0) {
    HWY_DYNAMIC_DISPATCH(DecodeRoots)(s);
    for (int side = 0; side < 2; ++side) s.holds[side] = ~std::uint64_t{0};
    top.other_lane = 8;
    top.frame = 0;
    top.frames = 2;
  }
}

unsigned octantsMeeting(const SphereSteps& s, int own, std::uint32_t index, tree::NodeRef other, unsigned& doubtful) {
  const tree::Tree &tree = s.side[own]->tree(), &partner = s.side[1 - own]->tree();
  const tree::Block* of_other = other.isRoot() ? nullptr : &partner.block(other.block());
  const auto level = static_cast<std::uint32_t>(partner.level(other)), octant = static_cast<std::uint32_t>(other.octant());
  const RoughSphere y = seenByOther(s, 1 - own, sphereOfOctant(s, 1 - own, of_other, level, octant));
  return HWY_DYNAMIC_DISPATCH(OctantsMeeting)(s, own, tree.block(index), y, doubtful);
}

}  // namespace bocst::query
#endif
