// SPDX-License-Identifier: BSD-3-Clause
#include "query/collide/sphere_steps.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/collide/sphere_steps.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>

#include "log/assert.h"
#include "simd/octants-inl.h"

#ifndef BOCST_SPHERE_STEPS_ONCE
#define BOCST_SPHERE_STEPS_ONCE
namespace bocst::query {

/// Decides in double, as the definition says: which octants in `mask` of a block of side `own` meet the other node?
unsigned decideMeeting(const SphereSteps& s, int own, std::uint32_t index, unsigned mask, tree::NodeRef other);

namespace {

constexpr float kHalfDiagonal = 0.8660254f;   // of a cube of side 1
constexpr float kClippedFactor = 1.4142136f;  // see TreeSide::sphere()
constexpr std::uint64_t kNothing = ~std::uint64_t{0};

inline std::uint64_t nameOf(int side, std::uint32_t block) {
  return std::uint64_t{block} << 1 | static_cast<std::uint64_t>(side);
}

}  // namespace
}  // namespace bocst::query
#endif

HWY_BEFORE_NAMESPACE();
namespace bocst::query::HWY_NAMESPACE {

// Writes the centres of some spheres, in their own frame and in the other.
HWY_INLINE void turnSpheres(const SphereFrames::Side& g, const V (&c)[3], std::size_t i, SphereFrame& f) {
  const D d;
  BOCST_UNROLL
  for (int j = 0; j < 3; ++j) {
    V cj = hn::Set(d, g.shift[j]);
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) cj = hn::MulAdd(hn::Set(d, g.to_other[j][k]), c[k], cj);
    hn::Store(c[j], d, f.center[0][j] + i);
    hn::Store(cj, d, f.center[1][j] + i);
  }
}

// Writes the spheres of the octants of a cell, as TreeSide::sphere() has them. Whole lattice units are exact.
template <typename Position>
HWY_INLINE void decodeSpheres(const SphereSteps& s, int side, int level, const Position& at, SphereFrame& f) {
  const D d;
  const SphereFrames::Side& g = s.frames.side[side];
  const std::int32_t length = 1 << (lattice::kMaxLevel - 1 - level);
  std::int32_t corner[3], end[3];  // of the first octant and of the regions, from the middle of the root
  bool whole = true;
  BOCST_UNROLL
  for (int k = 0; k < 3; ++k) {
    corner[k] = static_cast<std::int32_t>(at[k]) * (2 * length) - lattice::kMiddle;
    end[k] = static_cast<std::int32_t>(s.extent[side][k]) - lattice::kMiddle;
    whole &= corner[k] + 2 * length <= end[k];
  }
  const V size = hn::Set(d, static_cast<float>(length)), half_unit = hn::Set(d, 0.5f * g.unit);
  V c[3];
  if (whole) {
    const V radius = hn::Set(d, static_cast<float>(length) * g.unit * kHalfDiagonal);
    for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
      BOCST_UNROLL
      for (int k = 0; k < 3; ++k) {
        const V twice = hn::MulAdd(hn::Load(d, kOctantCorner[k] + i), hn::Set(d, static_cast<float>(2 * length)),
                                   hn::Set(d, static_cast<float>(2 * corner[k] + length)));
        c[k] = hn::Mul(twice, half_unit);
      }
      turnSpheres(g, c, i, f);
      hn::Store(radius, d, f.radius + i);
    }
    return;
  }
  const bool leaves = static_cast<std::uint32_t>(level) + 1 >= s.deepest[side];
  const V of_clipped = hn::Set(d, leaves ? 1.0f : kClippedFactor);
  for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
    V squared = hn::Zero(d), least = size;
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      const V low = hn::MulAdd(hn::Load(d, kOctantCorner[k] + i), size, hn::Set(d, static_cast<float>(corner[k])));
      const V high = hn::Min(hn::Add(low, size), hn::Set(d, static_cast<float>(end[k]))), extent = hn::Sub(high, low);
      least = hn::Min(least, extent);
      squared = hn::MulAdd(extent, extent, squared);
      c[k] = hn::Mul(hn::Add(low, high), half_unit);
    }
    const V factor = hn::IfThenElse(hn::Lt(least, size), of_clipped, hn::Set(d, 1.0f));
    turnSpheres(g, c, i, f);
    hn::Store(hn::Mul(hn::Mul(hn::Sqrt(squared), half_unit), factor), d, f.radius + i);
  }
}

// Decodes the octants of a block into a frame, unless it holds them: the last pair may have had the same block.
HWY_INLINE void decodeBlock(SphereSteps& s, int side, std::uint32_t index, const tree::Block& block,
                            std::uint32_t frame) {
  if (s.holds[frame] == nameOf(side, index)) return;
  s.holds[frame] = nameOf(side, index);
  decodeSpheres(s, side, block.shape, block.at, s.spheres[frame]);
}

// Octants of frame f: which may meet lane l of frame y, of the other side, and of which float does not tell.
struct Met {
  unsigned maybe, doubtful;
};
HWY_INLINE Met meeting(const SphereFrames& g, const SphereFrame& f, const SphereFrame& y, std::size_t l,
                       std::uint32_t* order) {
  const D d;
  const hn::RebindToUnsigned<D> du;
  const V more = hn::Set(d, y.radius[l] + (g.tolerance + g.rounding_margin));
  const V less = hn::Set(d, y.radius[l] + (g.tolerance - g.rounding_margin));
  Met met{0, 0};
  for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
    V squared = hn::Zero(d);
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      const V displacement = hn::Sub(hn::Set(d, y.center[1][k][l]), hn::Load(d, f.center[0][k] + i));
      squared = hn::MulAdd(displacement, displacement, squared);
    }
    const V radius = hn::Load(d, f.radius + i);
    const V most = hn::Add(radius, more), least = hn::Max(hn::Add(radius, less), hn::Zero(d));
    // Both are false for NaN.
    const M apart = hn::Gt(squared, hn::Mul(most, most)), certain = hn::Lt(squared, hn::Mul(least, least));
    const auto depth =
        hn::Or(hn::And(hn::BitCast(du, squared), hn::Set(du, ~7u)), hn::Iota(du, static_cast<std::uint32_t>(i)));
    hn::StoreU(depth, du, order + i);
    const unsigned bits_apart = bitsOf(D(), apart), bits_certain = bitsOf(D(), certain);
    met.maybe |= bits_apart << i;
    met.doubtful |= (bits_apart | bits_certain) << i;
  }
  met.maybe = ~met.maybe & 0xff;
  met.doubtful = ~met.doubtful & 0xff;
  return met;
}

// The octants of a block in a frame whose spheres meet that of lane `lane` of the other side, and their order.
HWY_INLINE unsigned meetingOctants(SphereSteps& s, int x, std::uint32_t index, const tree::Block& block,
                                   std::uint32_t frame, tree::NodeRef other, std::uint32_t lane, std::uint32_t* order) {
  const Met met = meeting(s.frames, s.spheres[frame], s.spheres[lane / 8], lane % 8, order);
  const unsigned mask = met.maybe & block.grey, doubtful = met.doubtful & block.grey;
  if (doubtful == 0) return mask;
  return (mask & ~doubtful) | decideMeeting(s, x, index, doubtful, other);
}

// The first in the order of a group.
HWY_INLINE std::uint32_t first(const SphereGroup& group, std::uint32_t octants) {
  const hn::RebindToUnsigned<D> du;
  auto least = hn::Set(du, ~0u);
  for (std::size_t i = 0; i < 8; i += hn::Lanes(du)) {
    const auto order = hn::LoadU(du, group.order + i);
    least = hn::Min(least, hn::IfThenElse(maskOf(du, octants >> i), order, hn::Set(du, ~0u)));
  }
  return hn::GetLane(hn::MinOfLanes(du, least));
}

// Decodes a node of a pair that has no frames into a frame, and returns its lane.
HWY_NOINLINE std::uint32_t lookUp(SphereSteps& s, int side, tree::NodeRef node, std::uint32_t frame) {
  const tree::Tree& tree = s.side[side]->tree();
  const std::uint32_t root[3] = {0, 0, 0};
  if (!node.isRoot()) {
    const tree::Block& block = tree.block(node.block());
    decodeBlock(s, side, node.block(), block, frame);
    return 8 * frame + static_cast<std::uint32_t>(node.octant());
  }
  s.holds[frame] = kNothing;
  // The root as the first octant of a cell that is twice as large, whose other octants nobody asks for.
  decodeSpheres(s, side, 0, root, s.spheres[frame]);
  return 8 * frame;
}

HWY_INLINE bool isLeaf(const SphereSteps& s, int side, std::uint32_t level) { return level >= s.deepest[side]; }

// Of two nodes that are no leaves, is that of side x, at `level`, to be expanded before the other?
HWY_INLINE bool isLarger(const SphereSteps& s, int x, std::uint32_t level, std::uint32_t other_level) {
  const int deeper = static_cast<int>(other_level) - static_cast<int>(level);
  return x == 0 ? deeper >= s.not_smaller : -deeper < s.not_smaller;
}

HWY_INLINE void push(SphereSteps& s, int side, const tree::Block& block, std::uint32_t index, std::uint32_t frame,
                     std::uint32_t frames, const SphereGroup::Node& other, unsigned octants) {
  BOCST_ASSERT(frames <= SphereSteps::kFrames && s.stack + s.depth < s.stack_end);
  SphereGroup& top = s.stack[s.depth++];
  top.other = other;
  top.at = &block;
  top.side = static_cast<std::uint32_t>(side);
  top.block = index;
  top.level = block.shape + 1u;
  top.frame = frame;
  top.frames = frames;
  top.octants = octants;
}

// Expands the other node of a pair for all octants in `mask` of block `index`, in frame `frame`, so that their tests
// overlap in time. False where it is not the next to be expanded.
HWY_INLINE bool expandOther(SphereSteps& s, int x, const tree::Block& own, std::uint32_t index, std::uint32_t frame,
                            const SphereGroup::Node& other, unsigned mask) {
  const int y = 1 - x;
  const std::uint32_t level = own.shape + 1u;
  if (isLeaf(s, y, other.level) || other.ref.tag() != tree::ChildRef::kBlock) return false;
  if (!isLeaf(s, x, level) && !isLarger(s, y, other.level, level)) return false;
  const std::uint32_t other_index = other.ref.index(), other_frame = frame + 1;
  const tree::Tree& tree = s.side[y]->tree();
  const tree::Block& block = tree.block(other_index);
  tree.markUsed(other_index, s.side[0]->now());
  decodeBlock(s, y, other_index, block, other_frame);
  const std::size_t start = s.depth;
  for (; mask != 0; mask &= mask - 1) {
    const auto o = static_cast<std::uint32_t>(__builtin_ctz(mask));
    SphereGroup::Node n;
    n.node = tree::NodeRef::octant(index, static_cast<int>(o));
    n.level = level;
    n.lane = 8 * frame + o;
    const unsigned left = meetingOctants(s, y, other_index, block, other_frame, n.node, n.lane, s.stack[s.depth].order);
    if (left == 0) continue;
    n.ref = own.child[o].load(std::memory_order_acquire);
    push(s, y, block, other_index, other_frame, other_frame + 1, n, left);
  }
  // The group with the nearest octant goes on top.
  if (s.depth - start < 2 || !s.nearest_first) return true;
  std::size_t best = start;
  std::uint32_t least = ~0u;
  for (std::size_t i = start; i < s.depth; ++i) {
    const std::uint32_t order = first(s.stack[i], s.stack[i].octants);
    if (order < least) least = order, best = i;
  }
  if (best != s.depth - 1) std::swap(s.stack[best], s.stack[s.depth - 1]);
  return true;
}

SphereSteps::Event NextEvent(SphereSteps& s) {
  while (s.depth != 0) {
    SphereGroup& top = s.stack[s.depth - 1];
    const int side = static_cast<int>(top.side);
    SphereGroup::Node other = top.other;
    const bool own_leaf = isLeaf(s, side, top.level), other_leaf = isLeaf(s, 1 - side, other.level);
    if (own_leaf && other_leaf) {
      --s.depth;
      s.pair[side] = tree::NodeRef::octant(top.block, 0);
      s.pair[1 - side] = other.node;
      s.expanded = side;
      s.mask = top.octants;
      return SphereSteps::kLeaves;
    }
    const std::uint32_t o = s.nearest_first && (top.octants & (top.octants - 1)) != 0
                                ? first(top, top.octants) & 7
                                : static_cast<std::uint32_t>(__builtin_ctz(top.octants));
    top.octants &= ~(1u << o);
    if (top.octants == 0) --s.depth;
    SphereGroup::Node own;
    own.node = tree::NodeRef::octant(top.block, static_cast<int>(o));
    if (s.cut != nullptr && s.isBeyondCut(side == 0 ? own.node : other.node, side == 0 ? other.node : own.node)) {
      continue;
    }
    own.level = top.level;
    own.ref =
        top.at != nullptr ? top.at->child[o].load(std::memory_order_acquire) : s.side[side]->tree().childRef(own.node);
    std::uint32_t frames = top.frames;
    if (frames == 0) {
      own.lane = lookUp(s, side, own.node, frames++);
      other.lane = lookUp(s, 1 - side, other.node, frames++);
    } else {
      own.lane = 8 * top.frame + o;
    }
    // The larger of two nodes is expanded, unless it is a leaf.
    const bool expands_own = other_leaf || (!own_leaf && isLarger(s, side, own.level, other.level));
    const int x = expands_own ? side : 1 - side;
    const SphereGroup::Node& gone = expands_own ? own : other;
    const SphereGroup::Node& still = expands_own ? other : own;
    if (gone.ref.tag() != tree::ChildRef::kBlock) {
      s.pair[side] = own.node;
      s.pair[1 - side] = other.node;
      return SphereSteps::kDeferred;
    }
    const std::uint32_t index = gone.ref.index(), frame = frames++;
    const tree::Tree& tree = s.side[x]->tree();
    const tree::Block& block = tree.block(index);
    tree.markUsed(index, s.side[0]->now());
    const std::uint32_t level = block.shape + 1u;
    const bool leaves = isLeaf(s, x, level) && isLeaf(s, 1 - x, still.level);
    decodeBlock(s, x, index, block, frame);
    const unsigned mask = meetingOctants(s, x, index, block, frame, still.node, still.lane, s.stack[s.depth].order);
    if (mask == 0) continue;
    // Not expandOther() with a cut: it puts octants on the stack in the opposite order.
    if (leaves || s.cut != nullptr || !expandOther(s, x, block, index, frame, still, mask)) {
      push(s, x, block, index, frame, frames, still, mask);
    }
  }
  return SphereSteps::kDone;
}

}  // namespace bocst::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bocst::query {

HWY_EXPORT(NextEvent);

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

int levelsApart(double scale) {
  int levels;
  const bool even = std::frexp(scale, &levels) == 0.5;
  return even ? levels - 1 : levels;
}

SphereSteps::SphereSteps(const TreeSide& a, const TreeSide& b, const SimilarityTransform& b_in_a_,
                         SphereFrame* spheres_)
    : side{&a, &b}, b_in_a(b_in_a_), frames(b_in_a_), spheres(spheres_) {
  for (int s = 0; s < 2; ++s) {
    const tree::Tree& tree = side[s]->tree();
    std::copy_n(tree.surface().lattice.extent().data(), 3, extent[s]);
    deepest[s] = static_cast<std::uint32_t>(tree.deepest());
  }
  not_smaller = levelsApart(b_in_a.scale);
  std::fill_n(holds, kFrames, kNothing);
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

void leaveFrames(SphereSteps& s) {
  for (std::size_t i = 0; i < s.depth; ++i) s.stack[i].frames = 0;
}

void pushPair(SphereSteps& s, tree::NodeRef node_a, tree::NodeRef node_b) {
  const tree::Tree &a = s.side[0]->tree(), &b = s.side[1]->tree();
  SphereGroup& top = s.stack[s.depth++];
  top.other.node = node_b;
  top.other.ref = b.childRef(node_b);
  top.other.level = static_cast<std::uint32_t>(b.level(node_b));
  top.side = 0;
  top.at = node_a.isRoot() ? nullptr : &a.block(node_a.block());
  top.block = node_a.block();
  top.level = static_cast<std::uint32_t>(a.level(node_a));
  top.octants = 1u << node_a.octant();
  top.frames = 0;
}

}  // namespace bocst::query
#endif
