// SPDX-License-Identifier: BSD-3-Clause
#include "query/collide/sphere_steps.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/collide/sphere_steps.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>

#include "log/assert.h"
#include "query/cull/frames-inl.h"
#include "simd/octants-inl.h"

#ifndef BOCST_SPHERE_STEPS_ONCE
#define BOCST_SPHERE_STEPS_ONCE
namespace bocst::query {

/// Decides in double, as the definition says, which octants in `mask` of a block of side `own` meet the other node.
unsigned decideMeeting(const SphereSteps& s, int own, std::uint32_t index, unsigned mask, tree::NodeRef other);

}  // namespace bocst::query
#endif

HWY_BEFORE_NAMESPACE();
namespace bocst::query::HWY_NAMESPACE {

// Decodes the octants of a block into its frame, unless it holds them: the last pair may have had the same block.
HWY_INLINE void decodeBlock(SphereSteps& s, const BlockView& block) {
  const std::uint64_t name = frameName(block.side, block.index);
  if (s.holds[block.frame] == name) return;
  s.holds[block.frame] = name;
  decodeSpheres(s.frames.side[block.side], s.cells[block.side], block.at->shape, block.at->at, s.spheres[block.frame]);
}

// Decodes the block of an expanded node of a side into a frame.
HWY_INLINE BlockView open(SphereSteps& s, int side, const StepNode& node, std::uint32_t frame) {
  const BlockView block = viewOf(s.side[side]->tree(), side, node.ref.index(), frame);
  s.side[side]->tree().markUsed(block.index, s.side[side]->now());
  decodeBlock(s, block);
  return block;
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

// The volumes of what a frame has the spheres of: the octants of a node's block, or the root.
HWY_INLINE const Frame& volumesOf(SphereSteps& s, int side, tree::NodeRef node, std::uint32_t frame) {
  const PairFrames& g = *s.volume_geometry;
  const tree::Tree& tree = s.side[side]->tree();
  Frame& f = s.volumes[frame];
  std::uint64_t& held = s.volumes_hold[frame];
  if (node.isRoot()) {
    decodeRoot(g, side, tree.rootBounds(), f);
    held = kEmptyFrame;
    return f;
  }
  const std::uint64_t name = frameName(static_cast<std::uint32_t>(side), node.block());
  if (held != name) decodeBlock(g, side, tree.block(node.block()), f);
  held = name;
  return f;
}

// Which octants in `mask` of a block may have leaves that meet those of the other side's node.
HWY_INLINE unsigned overlapping(SphereSteps& s, const BlockView& block, const StepNode& other, unsigned mask) {
  const int x = static_cast<int>(block.side), y = 1 - x;
  const auto is_large = [&s](int side, std::uint32_t level) {
    return level + SphereSteps::kVolumeLevels <= s.cells[side].deepest;
  };
  if (mask == 0 || !s.volume_geometry || !is_large(x, block.level) || !is_large(y, other.level)) return mask;
  const Frame& octants = volumesOf(s, x, tree::NodeRef::octant(block.index, 0), block.frame);
  const Frame& others = volumesOf(s, y, other.node, other.lane / 8);
  return overlapping(*s.volume_geometry, octants, others, other.lane % 8, mask, nullptr);
}

// The octants of a block in a frame whose spheres meet that of the other side's node, and their order.
HWY_INLINE unsigned meetingOctants(SphereSteps& s, const BlockView& block, const StepNode& other,
                                   std::uint32_t* order) {
  const Met met = meeting(s.frames, s.spheres[block.frame], s.spheres[other.lane / 8], other.lane % 8, order);
  const unsigned mask = overlapping(s, block, other, met.maybe & block.at->grey), doubtful = met.doubtful & mask;
  if (doubtful == 0) return mask;
  return (mask & ~doubtful) | decideMeeting(s, static_cast<int>(block.side), block.index, doubtful, other.node);
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
  const std::uint32_t root[3] = {0, 0, 0};
  if (!node.isRoot()) {
    decodeBlock(s, viewOf(s.side[side]->tree(), side, node.block(), frame));
    return 8 * frame + static_cast<std::uint32_t>(node.octant());
  }
  s.holds[frame] = kEmptyFrame;
  // The root as the first octant of a cell that is twice as large, whose other octants nobody asks for.
  decodeSpheres(s.frames.side[side], s.cells[side], 0, root, s.spheres[frame]);
  return 8 * frame;
}

HWY_INLINE bool isLeaf(const SphereSteps& s, int side, std::uint32_t level) { return level >= s.cells[side].deepest; }

// True if of two nodes that are no leaves, that of side x, at `level`, is expanded before the other.
HWY_INLINE bool isLarger(const SphereSteps& s, int x, std::uint32_t level, std::uint32_t other_level) {
  return s.level_rule.isFirst(x, static_cast<int>(other_level) - static_cast<int>(level));
}

HWY_INLINE void push(SphereSteps& s, const BlockView& own, const StepNode& other, unsigned octants) {
  BOCST_ASSERT(own.frame < SphereSteps::kFrames && s.stack + s.depth < s.stack_end);
  SphereGroup& top = s.stack[s.depth++];
  copyWords(other, top.other);
  copyWords(own, top.own);
  top.octants = octants;
}

// Expands the other node of a pair for all octants in `mask` of a block, so that their tests overlap in time. False
// where it is not the next to be expanded.
HWY_INLINE bool expandOther(SphereSteps& s, const BlockView& own, const StepNode& other, unsigned mask) {
  const int x = static_cast<int>(own.side), y = 1 - x;
  if (isLeaf(s, y, other.level) || other.ref.tag() != tree::ChildRef::kBlock) return false;
  if (!isLeaf(s, x, own.level) && !isLarger(s, y, other.level, own.level)) return false;
  const BlockView block = open(s, y, other, own.frame + 1);
  const std::size_t start = s.depth;
  for (; mask != 0; mask &= mask - 1) {
    StepNode n;
    setOctant(n, own, static_cast<std::uint32_t>(__builtin_ctz(mask)));
    const unsigned left = meetingOctants(s, block, n, s.stack[s.depth].order);
    if (left != 0) push(s, block, n, left);
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
    const int side = static_cast<int>(top.own.side);
    StepNode other = top.other;
    const bool own_leaf = isLeaf(s, side, top.own.level), other_leaf = isLeaf(s, 1 - side, other.level);
    if (own_leaf && other_leaf) {
      --s.depth;
      s.pair[side] = tree::NodeRef::octant(top.own.index, 0);
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
    StepNode own;
    own.node = tree::NodeRef::octant(top.own.index, static_cast<int>(o));
    if (s.cut != nullptr && s.isBeyondCut(side == 0 ? own.node : other.node, side == 0 ? other.node : own.node)) {
      continue;
    }
    own.level = top.own.level;
    own.ref =
        top.own.at != nullptr ? top.own.at->child[o].load(std::memory_order_acquire) : s.side[side]->childRef(own.node);
    std::uint32_t frames = top.own.frame + 1;  // 0 without a frame
    if (frames == 0) {
      own.lane = lookUp(s, side, own.node, frames++);
      other.lane = lookUp(s, 1 - side, other.node, frames++);
    } else {
      own.lane = 8 * top.own.frame + o;
    }
    // The larger of two nodes is expanded, unless it is a leaf.
    const bool expands_own = other_leaf || (!own_leaf && isLarger(s, side, own.level, other.level));
    const int x = expands_own ? side : 1 - side;
    const StepNode &gone = expands_own ? own : other, &still = expands_own ? other : own;
    if (gone.ref.tag() != tree::ChildRef::kBlock) {
      s.pair[side] = own.node;
      s.pair[1 - side] = other.node;
      return SphereSteps::kDeferred;
    }
    const BlockView block = open(s, x, gone, frames++);
    const unsigned mask = meetingOctants(s, block, still, s.stack[s.depth].order);
    if (mask == 0) continue;
    const bool leaves = isLeaf(s, x, block.level) && isLeaf(s, 1 - x, still.level);
    // Not expandOther() with a cut: it puts octants on the stack in the opposite order.
    if (leaves || s.cut != nullptr || !expandOther(s, block, still, mask)) push(s, block, still, mask);
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
  const double size = placeSides(one_in_zero, side[0], side[1]) + 2.45 * (q0 + q1);
  constexpr double kMost = 1e17;  // squares must be floats
  if (!(size < kMost && one_in_zero.tolerance < kMost)) {
    side[0] = side[1] = {};  // numbers, so that the margin alone decides
    return;
  }
  rounding_margin = static_cast<float>(size * (48 * 0x1p-24 + 6 * one_in_zero.orthogonality_error) * 1.0001);
  tolerance = static_cast<float>(one_in_zero.tolerance);
}

SphereSteps::SphereSteps(const TreeSide& a, const TreeSide& b, const SimilarityTransform& b_in_a_,
                         SphereFrame* spheres_, Frame* volumes_)
    : side{&a, &b},
      b_in_a(b_in_a_),
      frames(b_in_a_),
      cells{cellTreeOf(a.tree()), cellTreeOf(b.tree())},
      level_rule(LevelRule::of(b_in_a_.scale)),
      spheres(spheres_),
      volumes(volumes_) {
  const SimilarityTransform wide = withSphereReach(a, b, b_in_a);
  const bool as_in_paper = a.tree().options().dimension > 0 || b.tree().options().dimension > 0;
  if (!as_in_paper && PairFrames::fits(b_in_a.scale) && wide.tolerance < 1e9) volume_geometry.emplace(wide);
  std::fill_n(holds, kFrames, kEmptyFrame);
  std::fill_n(volumes_hold, kFrames, kEmptyFrame);
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
  for (std::size_t i = 0; i < s.depth; ++i) s.stack[i].own.frame = BlockView::kNoFrame;
}

void pushPair(SphereSteps& s, tree::NodeRef node_a, tree::NodeRef node_b) {
  const tree::Tree &a = s.side[0]->tree(), &b = s.side[1]->tree();
  SphereGroup& top = s.stack[s.depth++];
  top.other.node = node_b;
  top.other.ref = s.side[1]->childRef(node_b);
  top.other.level = static_cast<std::uint32_t>(b.level(node_b));
  const tree::Block* const block = node_a.isRoot() ? nullptr : &a.block(node_a.block());
  top.own = {block, node_a.block(), static_cast<std::uint32_t>(a.level(node_a)), BlockView::kNoFrame, 0};
  top.octants = 1u << node_a.octant();
}

}  // namespace bocst::query
#endif
