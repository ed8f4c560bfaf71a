// SPDX-License-Identifier: BSD-3-Clause
#include "query/collide/tree_steps.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/collide/tree_steps.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>

#include "query/cull/frames-inl.h"

#ifndef BOCST_TREE_STEPS_ONCE
#define BOCST_TREE_STEPS_ONCE
namespace bocst::query {
namespace {

inline bool isLeaf(const StepNode& n) {
  const tree::ChildRef::Tag tag = n.ref.tag();
  return tag == tree::ChildRef::kShortList || (tag == tree::ChildRef::kList && n.level == lattice::kMaxLevel);
}

inline std::uint32_t childLevel(const tree::Block& block) { return static_cast<std::uint32_t>(block.childLevel()); }

// The order is there already: overlapping() writes it to where the group will be.
inline void push(PairSteps& s, int side, const tree::Block* at, std::uint32_t block, std::uint32_t level,
                 std::uint32_t frame, const StepNode& other, unsigned octants, std::uint32_t large = StepGroup::kNone) {
  StepGroup& top = s.stack[s.depth++];
  top.at = at;
  top.other.node = other.node;
  top.other.ref = other.ref;
  top.other.level = other.level;
  top.other.lane = other.lane;
  top.side = static_cast<std::uint32_t>(side);
  top.block = block;
  top.frame = frame;
  top.level = level;
  top.octants = octants;
  top.late = 0;
  top.large = large;
}

// Most of a leaf's corners, and all of them.
constexpr std::size_t kNextLeafLines = 4, kLeafLines = 10;

// Brings to the processor what the next steps will read of a node, or, of a leaf, its corners: so many lines of them.
inline void fetch(const tree::Tree& tree, tree::ChildRef ref, std::size_t leaf_lines = kNextLeafLines) {
  constexpr std::size_t kLine = 64;
  if (ref.tag() == tree::ChildRef::kBlock) {
    const char* at = reinterpret_cast<const char*>(&tree.block(ref.index()));
    __builtin_prefetch(at);
    __builtin_prefetch(at + kLine);
  } else if (ref.tag() == tree::ChildRef::kShortList) {
    const char* at = reinterpret_cast<const char*>(tree.lists().begin(ref.index()));
    for (std::size_t i = 0; i < leaf_lines; ++i) __builtin_prefetch(at + i * kLine);
  }
}

// The same for octants that are all to be walked, so that there is time until they are asked for: a leaf as a whole.
inline void fetchAll(const tree::Tree& tree, const tree::Block& block, unsigned octants) {
  for (; octants != 0; octants &= octants - 1) {
    const tree::ChildRef ref = block.child[__builtin_ctz(octants)].load(std::memory_order_acquire);
    fetch(tree, ref, kLeafLines);
    if (ref.tag() == tree::ChildRef::kBlock) tree.prefetchLastUse(ref.index());
  }
}

}  // namespace
}  // namespace bocst::query
#endif

HWY_BEFORE_NAMESPACE();
namespace bocst::query::HWY_NAMESPACE {

// The octants of a block. Pairs that differ in the other node only come one after the other and find the frame filled:
// then it is false.
HWY_INLINE bool decodeBlock(PairSteps& s, int own, std::uint32_t index, const tree::Block& block, std::uint32_t frame) {
  const std::uint64_t name = PairSteps::name(own, index);
  if (s.holds[frame] == name) return false;
  s.holds[frame] = name;
  decodeBlock(s.geometry, own, block, s.frames[frame]);
  return true;
}

// Where the volume of a pair's node on one side is; for pairs that come without frames.
HWY_INLINE void lookUp(PairSteps& s, StepNode& n, int side, std::uint32_t& frames) {
  const tree::Tree& tree = *s.tree[side];
  if (n.node.isRoot()) {
    decodeRoot(s.geometry, side, tree.rootBounds(), s.frames[frames]);
    s.holds[frames] = PairSteps::kNothing;
    n.lane = 8 * frames;
  } else {
    const std::uint32_t index = n.node.block();
    decodeBlock(s, side, index, tree.block(index), frames);
    n.lane = 8 * frames + static_cast<std::uint32_t>(n.node.octant());
  }
  ++frames;
}

std::uint8_t OverlappingOctants(const PairFrames& geometry, int own, const CellOctants& cell, const CellOctants& other,
                                int octant) {
  Frame f, y;
  decodeCell(geometry, own, cell.cell.level, cell.cell.at, cell.octants, f);
  decodeCell(geometry, 1 - own, other.cell.level, other.cell.at, other.octants, y);
  std::uint32_t order[8];
  return static_cast<std::uint8_t>(overlapping(geometry, f, y, static_cast<std::size_t>(octant), 0xff, order));
}

// Which of a group's octants overlaps the most.
HWY_INLINE std::uint32_t deepest(const StepGroup& group, std::uint32_t octants) {
  const hn::RebindToUnsigned<D> du;
  auto most = hn::Zero(du);
  for (std::size_t i = 0; i < 8; i += hn::Lanes(du)) {
    const std::uint8_t wanted[8] = {static_cast<std::uint8_t>(octants >> i)};
    const auto depth = hn::LoadU(du, group.order + i);
    most = hn::Max(most, hn::IfThenElseZero(hn::LoadMaskBits(du, wanted), depth));
  }
  return hn::GetLane(hn::MaxOfLanes(du, most)) & 7;
}

// A pair off the stack: an octant of a group, the other node, and how many frames they and what is under them use.
struct Popped {
  StepNode own, other;
  int side;
  std::uint32_t frames;
};

// Takes the next pair off the stack: the deepest, or, where all are wanted, the first, which is known sooner. A step is
// mostly a chain of what waits for each other, from a child reference to the next one, so what is handed on stays in
// registers. What is still implicit is left for last: a hit among resident nodes makes its growth unnecessary.
HWY_INLINE Popped pop(PairSteps& s) {
  for (;;) {
    StepGroup& top = s.stack[s.depth - 1];
    const std::uint32_t soon = top.octants & ~top.late, which = soon != 0 ? soon : top.octants;
    const std::uint32_t o = s.all_at_once ? static_cast<std::uint32_t>(__builtin_ctz(which)) : deepest(top, which);
    const std::uint32_t rest = top.octants & ~(1u << o);
    Popped p;
    p.side = static_cast<int>(top.side);
    p.own.node = tree::NodeRef::octant(top.block, static_cast<int>(o));
    p.own.ref =
        top.at != nullptr ? top.at->child[o].load(std::memory_order_acquire) : s.tree[p.side]->childRef(p.own.node);
    if (p.own.ref.tag() == tree::ChildRef::kImplicit && rest != 0 && soon != 0) {
      top.late |= 1u << o;
      continue;
    }
    top.octants = rest;
    if (rest == 0) --s.depth;
    p.own.level = top.level;
    p.own.lane = top.frame == StepGroup::kNoFrame ? StepNode::kNoLane : 8 * top.frame + o;
    p.other.node = top.other.node;
    p.other.ref = top.other.ref;
    p.other.level = top.other.level;
    p.other.lane = top.other.lane;
    p.frames = top.frame + 1;  // 0 without a frame
    s.large = top.large;
    s.triangles = top.triangles[o];
    return p;
  }
}

// The octants of a frame against triangles, see octantsMeeting(). Of the octants in `mask`, and the triangles in
// `which`; f(lane, which triangles) is called for each vector. Returns the octants that a triangle may meet.
template <typename F>
HWY_INLINE unsigned meeting(const PairFrames& g, int own, const Frame& f, unsigned mask, std::uint32_t which,
                            const TriangleBounds& b, F&& store) {
  const D d;
  const hn::RebindToUnsigned<D> du;
  const V rounding_margin = hn::Set(d, g.side[own].rounding_margin);
  unsigned result = 0;
  for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
    const std::uint8_t wanted[8] = {static_cast<std::uint8_t>(mask >> i)};
    const M in = hn::LoadMaskBits(d, wanted);
    V c[3], h[3], m[3], low[3], high[3];
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      c[k] = hn::Load(d, f.center[0][k] + i);
      h[k] = hn::Load(d, f.half[0][k] + i);
      m[k] = hn::Load(d, f.normal[0][k] + i);
      const V extent = hn::Add(h[k], rounding_margin);
      low[k] = hn::Sub(c[k], extent);
      high[k] = hn::Add(c[k], extent);
    }
    const V slab = hn::Load(d, f.slab_center + i), thick = hn::Load(d, f.slab_half + i);
    auto triangles = hn::Zero(du);
    for (std::uint32_t left = which; left != 0; left &= left - 1) {
      const int t = __builtin_ctz(left);
      M meet = in;
      BOCST_UNROLL
      for (int k = 0; k < 3; ++k) {
        meet =
            hn::And(meet, hn::And(hn::Le(low[k], hn::Set(d, b.high[k][t])), hn::Ge(high[k], hn::Set(d, b.low[k][t]))));
      }
      {
        // How far the octant reaches along the normal: its box, and its slab as in overlapping().
        V n[3], at = hn::Zero(d), r = rounding_margin, along = hn::Zero(d);
        BOCST_UNROLL
        for (int k = 0; k < 3; ++k) {
          n[k] = hn::Set(d, b.normal[k][t]);
          at = hn::MulAdd(n[k], c[k], at);
          r = hn::MulAdd(hn::Abs(n[k]), h[k], r);
          along = hn::MulAdd(n[k], m[k], along);
        }
        V slab_r = hn::MulAdd(hn::Abs(along), thick, rounding_margin);
        BOCST_UNROLL
        for (int k = 0; k < 3; ++k) slab_r = hn::MulAdd(hn::Abs(hn::NegMulAdd(along, m[k], n[k])), h[k], slab_r);
        const V slab_at = hn::MulAdd(along, slab, at);
        const V least = hn::Max(hn::Sub(at, r), hn::Sub(slab_at, slab_r));
        const V most = hn::Min(hn::Add(at, r), hn::Add(slab_at, slab_r));
        meet = hn::And(meet,
                       hn::And(hn::Le(least, hn::Set(d, b.normal_high[t])), hn::Ge(most, hn::Set(d, b.normal_low[t]))));
      }
      if (hn::AllFalse(d, meet)) continue;
      BOCST_UNROLL
      for (int e = 0; e < 3; ++e) {
        V at = hn::Zero(d), r = rounding_margin;
        BOCST_UNROLL
        for (int k = 0; k < 3; ++k) {
          const V a = hn::Set(d, b.edge[e][k][t]);
          at = hn::MulAdd(a, c[k], at);
          r = hn::MulAdd(hn::Abs(a), h[k], r);
        }
        meet = hn::And(meet, hn::Le(hn::Sub(at, r), hn::Set(d, b.edge_high[e][t])));
      }
      triangles = hn::Or(triangles, hn::IfThenElseZero(hn::RebindMask(du, meet), hn::Set(du, 1u << t)));
    }
    store(i, triangles);
    std::uint8_t bits[8] = {};
    hn::StoreMaskBits(du, hn::Ne(triangles, hn::Zero(du)), bits);
    result |= static_cast<unsigned>(bits[0]) << i;
  }
  return result;
}

// The octants of the pair's smaller node that the larger leaf's triangles may meet, onto the stack.
HWY_NOINLINE void pushThose(PairSteps& s) {
  const hn::RebindToUnsigned<D> du;
  const int x = s.expanded, y = 1 - x;
  StepGroup& top = s.stack[s.depth];
  const unsigned mask = meeting(s.geometry, x, s.frames[s.frames_used], s.mask, s.triangles, s.leaf[y]->bounds(),
                                [&top, du](std::size_t i, hn::Vec<hn::RebindToUnsigned<D>> met)
                                    HWY_ATTR { hn::StoreU(met, du, top.triangles + i); });
  if (mask == 0) return;
  const std::uint32_t index = s.pair[x].ref.index();
  const tree::Block& block = s.tree[x]->block(index);
  push(s, x, &block, index, childLevel(block), s.frames_used, s.pair[y], mask, static_cast<std::uint32_t>(y));
}

void PushMeeting(PairSteps& s) { pushThose(s); }

void OctantsMeeting(const PairFrames& geometry, int own, const CellOctants& cell, const TriangleBounds& triangles,
                    std::size_t count, std::uint32_t (&met)[8]) {
  const hn::RebindToUnsigned<D> du;
  Frame f;
  decodeCell(geometry, own, cell.cell.level, cell.cell.at, cell.octants, f);
  meeting(geometry, own, f, 0xff, count < 32 ? (1u << count) - 1 : ~0u, triangles,
          [&met, du](std::size_t i, hn::Vec<hn::RebindToUnsigned<D>> m) HWY_ATTR { hn::StoreU(m, du, met + i); });
}

// Expands the other node of the pair for all octants in `mask` of block `index`, in frame `frame`; false where it is
// not the next to be expanded. `fetch_own`: nobody has fetched what is below that block.
HWY_INLINE bool expandOther(PairSteps& s, int x, const tree::Block& own, std::uint32_t index, std::uint32_t level,
                            const StepNode& other, std::uint32_t frame, unsigned mask, bool fetch_own) {
  const int y = 1 - x;
  if (other.ref.tag() != tree::ChildRef::kBlock) return false;
  const int deeper = static_cast<int>(other.level) - static_cast<int>(level);
  if (x == 0 ? deeper >= s.not_smaller : -deeper < s.not_smaller) return false;
  const std::uint32_t other_index = other.ref.index();
  const tree::Block& block = s.tree[y]->block(other_index);
  s.tree[y]->markUsed(other_index, s.now);
  const bool fetch_other = decodeBlock(s, y, other_index, block, frame + 1) && s.sees_all;
  if (fetch_own) fetchAll(*s.tree[x], own, mask);
  unsigned met = 0;
  for (; mask != 0; mask &= mask - 1) {
    const auto o = static_cast<std::uint32_t>(__builtin_ctz(mask));
    const unsigned left = overlapping(s.geometry, s.frames[frame + 1], s.frames[frame], o, block.grey, nullptr);
    if (left == 0) continue;
    met |= left;
    StepNode n;
    n.node = tree::NodeRef::octant(index, static_cast<int>(o));
    n.ref = own.child[o].load(std::memory_order_acquire);
    n.level = level;
    n.lane = 8 * frame + o;
    if (!s.sees_all) fetch(*s.tree[x], n.ref);
    push(s, y, &block, other_index, childLevel(block), frame + 1, n, left);
  }
  if (fetch_other) fetchAll(*s.tree[y], block, met);
  return true;
}

// Puts some octants of a block on the stack, but for the one that is next: true where that is in `next`, at once.
HWY_INLINE bool pushOthers(PairSteps& s, int side, const tree::Block& block, std::uint32_t index, std::uint32_t level,
                           std::uint32_t frame, const StepNode& other, unsigned octants, Popped& next) {
  const std::uint32_t o =
      s.all_at_once ? static_cast<std::uint32_t>(__builtin_ctz(octants)) : deepest(s.stack[s.depth], octants);
  const std::uint32_t rest = octants & ~(1u << o);
  next.side = side;
  next.own.node = tree::NodeRef::octant(index, static_cast<int>(o));
  next.own.ref = block.child[o].load(std::memory_order_acquire);
  next.own.level = level;
  next.own.lane = 8 * frame + o;
  next.other = other;
  next.frames = frame + 1;
  s.large = StepGroup::kNone;
  const bool waits = rest != 0 && next.own.ref.tag() == tree::ChildRef::kImplicit;
  if (rest != 0) push(s, side, &block, index, level, frame, other, waits ? octants : rest);
  return !waits;
}

// How far a node reaches back along the axis of the cut, in the frame of side 0.
HWY_INLINE float leastAlongCut(const PairSteps& s, const Frame& f, std::uint32_t o) {
  return f.center[0][s.cut_axis][o] - f.half[0][s.cut_axis][o];
}

HWY_INLINE bool isBeyondCut(const PairSteps& s, const StepNode& of_side_0) {
  if (!s.isCut() || of_side_0.lane == StepNode::kNoLane) return false;
  return leastAlongCut(s, s.frames[of_side_0.lane / 8], of_side_0.lane % 8) > s.cut;
}

// The order of octants by how far they reach back along the axis of the cut.
HWY_INLINE void orderAlongCut(const PairSteps& s, const Frame& f, std::uint32_t (&order)[8]) {
  const D d;
  const hn::RebindToUnsigned<D> du;
  const V beyond = hn::Set(d, 4.0f * lattice::kMiddle);  // keeps the numbers positive: their bits are in their order
  for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
    const V least = hn::Sub(hn::Load(d, f.center[0][s.cut_axis] + i), hn::Load(d, f.half[0][s.cut_axis] + i));
    const auto octant = hn::Iota(du, static_cast<std::uint32_t>(i));
    hn::StoreU(hn::Or(hn::AndNot(hn::Set(du, 7), hn::BitCast(du, hn::Sub(beyond, least))), octant), du, order + i);
  }
}

PairSteps::Event NextEvent(PairSteps& s) {
  Popped p;
  bool known = false;  // what comes next
  for (;;) {
    if (!known) {
      if (s.depth == 0) break;
      p = pop(s);
    }
    known = false;
    const int side = p.side;
    s.pair[side] = p.own;
    s.pair[1 - side] = p.other;
    if (isBeyondCut(s, s.pair[0])) continue;
    const bool own_leaf = isLeaf(p.own), other_leaf = isLeaf(p.other);
    if (own_leaf && other_leaf) {
      if (!s.sees_all) {
        fetch(*s.tree[side], p.own.ref);
        fetch(*s.tree[1 - side], p.other.ref);
      }
      return PairSteps::kLeaves;
    }
    // The larger of two nodes is expanded, unless it is a leaf.
    const bool leaf0 = side == 0 ? own_leaf : other_leaf, leaf1 = side == 0 ? other_leaf : own_leaf;
    const int below = static_cast<int>(p.own.level) - static_cast<int>(p.other.level);
    const int deeper = side == 0 ? -below : below;
    const int x = leaf1 || (!leaf0 && deeper >= s.not_smaller) ? 0 : 1, y = 1 - x;
    const StepNode own = x == side ? p.own : p.other;
    StepNode other = x == side ? p.other : p.own;
    if (own.ref.tag() != tree::ChildRef::kBlock) return PairSteps::kDeferred;
    if (!s.sees_all && other.ref.tag() == tree::ChildRef::kBlock) fetch(*s.tree[y], other.ref);
    std::uint32_t frames = p.frames;
    if (other.lane == StepNode::kNoLane) {
      lookUp(s, other, y, frames);
      s.pair[y].lane = other.lane;
    }
    const std::uint32_t index = own.ref.index();
    const tree::Block& block = s.tree[x]->block(index);
    s.tree[x]->markUsed(index, s.now);
    const bool fetch_own = decodeBlock(s, x, index, block, frames) && s.sees_all;
    const unsigned mask = overlapping(s.geometry, s.frames[frames], s.frames[other.lane / 8], other.lane % 8,
                                      block.grey, s.stack[s.depth].order);
    if (mask == 0) continue;
    if (s.isCut() && x == 0) orderAlongCut(s, s.frames[frames], s.stack[s.depth].order);
    if (y == 0 ? leaf0 && deeper >= s.larger : leaf1 && deeper < s.not_smaller) {
      s.frames_used = frames;
      s.expanded = x;
      s.mask = mask;
      if (s.large == StepGroup::kNone || !s.leaf[y]->know(other.node, s.triangles)) return PairSteps::kLargeTriangles;
      pushThose(s);
      continue;
    }
    const std::uint32_t level = childLevel(block);
    if (!s.all_at_once || !expandOther(s, x, block, index, level, other, frames, mask, fetch_own)) {
      if (fetch_own) fetchAll(*s.tree[x], block, mask);
      known = pushOthers(s, x, block, index, level, frames, other, mask, p);
    }
  }
  return PairSteps::kDone;
}

}  // namespace bocst::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bocst::query {

HWY_EXPORT(OverlappingOctants);
HWY_EXPORT(NextEvent);
HWY_EXPORT(PushMeeting);
HWY_EXPORT(OctantsMeeting);

std::uint8_t overlappingOctants(const PairFrames& geometry, int own, const CellOctants& cell, const CellOctants& other,
                                int octant) {
  return HWY_DYNAMIC_DISPATCH(OverlappingOctants)(geometry, own, cell, other, octant);
}

PairSteps::Event nextEvent(PairSteps& steps) { return HWY_DYNAMIC_DISPATCH(NextEvent)(steps); }

void pushMeeting(PairSteps& steps) { HWY_DYNAMIC_DISPATCH(PushMeeting)(steps); }

void octantsMeeting(const PairFrames& geometry, int own, const CellOctants& cell, const TriangleBounds& triangles,
                    std::size_t count, std::uint32_t (&met)[8]) {
  HWY_DYNAMIC_DISPATCH(OctantsMeeting)(geometry, own, cell, triangles, count, met);
}

void pushOctants(PairSteps& s, unsigned mask) {
  if (mask == 0) return;
  const int x = s.expanded;
  const std::uint32_t index = s.pair[x].ref.index();
  const tree::Block& block = s.tree[x]->block(index);
  push(s, x, &block, index, childLevel(block), s.frames_used, s.pair[1 - x], mask);
}

void pushPair(PairSteps& s, tree::NodeRef node_a, tree::NodeRef node_b) {
  StepNode other;
  other.node = node_b;
  other.ref = s.tree[1]->childRef(node_b);
  other.level = static_cast<std::uint32_t>(s.tree[1]->level(node_b));
  const auto o = static_cast<std::uint32_t>(node_a.octant());
  std::fill_n(s.stack[s.depth].order, 8, o);
  push(s, 0, node_a.isRoot() ? nullptr : &s.tree[0]->block(node_a.block()), node_a.block(),
       static_cast<std::uint32_t>(s.tree[0]->level(node_a)), StepGroup::kNoFrame, other, 1u << o);
}

}  // namespace bocst::query
#endif
