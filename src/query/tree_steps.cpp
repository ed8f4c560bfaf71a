// SPDX-License-Identifier: BSD-3-Clause
#include "query/tree_steps.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/tree_steps.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "query/frames-inl.h"

#ifndef BOCST_TREE_STEPS_ONCE
#define BOCST_TREE_STEPS_ONCE
namespace bocst::query {
namespace {

inline bool isLeaf(const StepPair& p, int side) {
  const tree::Link::Tag tag = p.link[side].tag();
  return tag == tree::Link::kShortList || (tag == tree::Link::kList && p.level[side] == lattice::kMaxLevel);
}

inline float sideOf(const PairSteps& s, const StepPair& p, int side) {
  return s.geometry.unit[side] * static_cast<float>(1 << (lattice::kMaxLevel - p.level[side]));
}

// What is still implicit comes first, so that the stack leaves it for last: a hit among resident nodes makes its growth
// unnecessary.
inline void push(PairSteps& s, const StepPair& pair, int x, std::size_t frame, const tree::Block& block,
                 unsigned mask) {
  const int y = 1 - x;
  const std::uint32_t index = pair.link[x].index(), level = pair.level[x] + 1;
  const tree::NodeRef node_y = pair.node[y];
  const tree::Link link_y = pair.link[y];
  const std::uint32_t level_y = pair.level[y], lane_y = pair.lane[y];
  StepPair* top = s.stack + s.depth;
  const auto put = [&](int o, tree::Link link) {
    top->node[x] = tree::NodeRef::octant(index, o);
    top->link[x] = link;
    top->level[x] = level;
    top->lane[x] = static_cast<std::uint32_t>(8 * frame) + static_cast<std::uint32_t>(o);
    top->node[y] = node_y;
    top->link[y] = link_y;
    top->level[y] = level_y;
    top->lane[y] = lane_y;
    top->frames = static_cast<std::uint32_t>(frame) + 1;
    ++top;
  };
  unsigned resident = 0;
  for (unsigned left = mask; left != 0; left &= left - 1) {
    const int o = __builtin_ctz(left);
    const tree::Link link = block.child[o].load(std::memory_order_acquire);
    if (link.tag() == tree::Link::kImplicit) {
      put(o, link);
    } else {
      resident |= 1u << o;
    }
  }
  for (; resident != 0; resident &= resident - 1) {
    const int o = __builtin_ctz(resident);
    put(o, block.child[o].load(std::memory_order_acquire));
  }
  s.depth = static_cast<std::size_t>(top - s.stack);
}

}  // namespace
}  // namespace bocst::query
#endif

HWY_BEFORE_NAMESPACE();
namespace bocst::query::HWY_NAMESPACE {

// Bit o is set unless octant o of frame f (side `own`) is surely apart from the volume in lane l of frame y, by one of
// eight axes: the faces of both boxes and both slab normals. No edge axes: with slabs they gain nothing.
HWY_INLINE unsigned overlapping(const PairFrames& g, int own, const Frame& f, const Frame& y, std::size_t l) {
  const D d;
  const int other = 1 - own;
  const V pad = hn::Set(d, g.pad), slab_pad = hn::Set(d, g.slab_pad);
  unsigned result = 0;
  for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
    V way[2][3];  // from the octants' middles to the volume's, in both frames
    M apart = hn::MaskFromVec(hn::Zero(d));
    BOCST_UNROLL
    for (int s = 0; s < 2; ++s) {
      BOCST_UNROLL
      for (int k = 0; k < 3; ++k) {
        way[s][k] = hn::Sub(hn::Set(d, y.center[s][k][l]), hn::Load(d, f.center[s][k] + i));
        const V reach = hn::Add(hn::Load(d, f.half[s][k] + i), hn::Add(hn::Set(d, y.half[s][k][l]), pad));
        apart = hn::Or(apart, hn::Gt(hn::Abs(way[s][k]), reach));
      }
    }
    // Slabs: for z in a box with |m.z - offset| <= w, any a gives n.z in a * offset +- (|a| w + |n - a m| over the
    // box).
    const V x_center = hn::Load(d, f.slab_center + i), x_half = hn::Load(d, f.slab_half + i);
    const V y_center = hn::Set(d, y.slab_center[l]), y_half = hn::Set(d, y.slab_half[l]);
    V n[3], m[3], along = hn::Zero(d);
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      n[k] = hn::Load(d, f.normal[other][k] + i);
      m[k] = hn::Set(d, y.normal[other][k][l]);
      along = hn::MulAdd(n[k], m[k], along);
    }
    const V abs_along = hn::Abs(along);
    V t = hn::MulSub(along, y_center, x_center), r = hn::MulAdd(abs_along, y_half, hn::Add(x_half, slab_pad));
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      t = hn::MulAdd(n[k], own == 0 ? way[1][k] : way[0][k], t);
      r = hn::MulAdd(hn::Set(d, y.half[other][k][l]), hn::Abs(hn::NegMulAdd(along, m[k], n[k])), r);
    }
    apart = hn::Or(apart, hn::Gt(hn::Abs(t), r));
    t = hn::NegMulAdd(along, x_center, y_center);
    r = hn::MulAdd(abs_along, x_half, hn::Add(y_half, slab_pad));
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      const V mk = hn::Set(d, y.normal[own][k][l]);
      t = hn::MulAdd(mk, own == 0 ? way[0][k] : way[1][k], t);
      r = hn::MulAdd(hn::Load(d, f.half[own][k] + i),
                     hn::Abs(hn::NegMulAdd(along, hn::Load(d, f.normal[own][k] + i), mk)), r);
    }
    apart = hn::Or(apart, hn::Gt(hn::Abs(t), r));
    std::uint8_t bits[8] = {};
    hn::StoreMaskBits(d, hn::Not(apart), bits);
    result |= static_cast<unsigned>(bits[0]) << i;
  }
  return result;
}

// The octants of a block. Pairs that differ in the other node only come one after the other and find the frame filled.
HWY_INLINE void decodeBlock(const PairFrames& g, int own, std::uint32_t index, const tree::Block& block, Frame& f) {
  const std::uint64_t holds = Frame::name(own, index);
  if (f.holds == holds) return;
  f.holds = holds;
  decodeCell(g, own, block.level, block.at, block.octants, f);
}

// Where the volume of a pair's node on one side is; for pairs that come without frames.
HWY_INLINE void lookUp(PairSteps& s, StepPair& p, int side, std::size_t& frames) {
  if (p.lane[side] != StepPair::kNoLane) return;
  const tree::Tree& tree = *s.tree[side];
  if (p.node[side].isRoot()) {
    decodeRoot(s.geometry, side, tree.rootBounds(), s.frames[frames]);
    s.frames[frames].holds = Frame::kNothing;
    p.lane[side] = static_cast<std::uint32_t>(8 * frames);
  } else {
    const std::uint32_t index = p.node[side].block();
    decodeBlock(s.geometry, side, index, tree.block(index), s.frames[frames]);
    p.lane[side] = static_cast<std::uint32_t>(8 * frames) + static_cast<std::uint32_t>(p.node[side].octant());
  }
  ++frames;
}

std::uint8_t OverlappingOctants(const PairFrames& geometry, int own, const CellOctants& cell, const CellOctants& other,
                                int octant) {
  Frame f, y;
  decodeCell(geometry, own, cell.cell.level, cell.cell.at, cell.octants, f);
  decodeCell(geometry, 1 - own, other.cell.level, other.cell.at, other.octants, y);
  return static_cast<std::uint8_t>(overlapping(geometry, own, f, y, static_cast<std::size_t>(octant)));
}

PairSteps::Event NextEvent(PairSteps& s) {
  while (s.depth > 0) {
    const StepPair& top = s.stack[--s.depth];
    StepPair p;
    for (int side = 0; side < 2; ++side) {
      p.node[side] = top.node[side];
      p.link[side] = top.link[side];
      p.level[side] = top.level[side];
      p.lane[side] = top.lane[side];
    }
    p.frames = top.frames;
    const bool leaf0 = isLeaf(p, 0), leaf1 = isLeaf(p, 1);
    if (leaf0 && leaf1) {
      s.pair = p;
      return PairSteps::kLeaves;
    }
    // The larger of two nodes is expanded, unless it is a leaf.
    const float side0 = sideOf(s, p, 0), side1 = sideOf(s, p, 1);
    const int x = leaf1 || (!leaf0 && side0 >= side1) ? 0 : 1, y = 1 - x;
    if (p.link[x].tag() != tree::Link::kBlock) {
      s.pair = p;
      return PairSteps::kAside;
    }
    std::size_t frames = p.frames;
    lookUp(s, p, 0, frames);
    lookUp(s, p, 1, frames);
    const tree::Block& block = s.tree[x]->block(p.link[x].index());
    s.tree[x]->touch(block, s.now);
    Frame& f = s.frames[frames];
    decodeBlock(s.geometry, x, p.link[x].index(), block, f);
    const unsigned mask = overlapping(s.geometry, x, f, s.frames[p.lane[y] / 8], p.lane[y] % 8) & block.grey;
    if (mask == 0) continue;
    if ((y == 0 ? leaf0 && side1 < side0 : leaf1 && side0 < side1)) {
      p.frames = static_cast<std::uint32_t>(frames);
      s.pair = p;
      s.expanded = x;
      s.mask = mask;
      return PairSteps::kCoarse;
    }
    push(s, p, x, frames, block, mask);
  }
  return PairSteps::kDone;
}

}  // namespace bocst::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bocst::query {

HWY_EXPORT(OverlappingOctants);
HWY_EXPORT(NextEvent);

std::uint8_t overlappingOctants(const PairFrames& geometry, int own, const CellOctants& cell, const CellOctants& other,
                                int octant) {
  return HWY_DYNAMIC_DISPATCH(OverlappingOctants)(geometry, own, cell, other, octant);
}

PairSteps::Event nextEvent(PairSteps& steps) { return HWY_DYNAMIC_DISPATCH(NextEvent)(steps); }

void pushOctants(PairSteps& s, unsigned mask) {
  const int x = s.expanded;
  push(s, s.pair, x, s.pair.frames, s.tree[x]->block(s.pair.link[x].index()), mask);
}

}  // namespace bocst::query
#endif
