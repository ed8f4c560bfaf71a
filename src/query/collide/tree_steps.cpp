// SPDX-License-Identifier: BSD-3-Clause
#include "query/collide/tree_steps.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/collide/tree_steps.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>

#include "log/assert.h"
#include "query/cull/frames-inl.h"

#ifndef BOCST_TREE_STEPS_ONCE
#define BOCST_TREE_STEPS_ONCE
namespace bocst::query {
namespace {

inline bool isLeaf(const PairSteps& s, int side, const StepNode& n) {
  const tree::ChildRef::Tag tag = n.ref.tag();
  const bool is_deepest = n.level == s.leaf_level[side];
  return s.has_cells[side] ? is_deepest
                           : tag == tree::ChildRef::kShortList || (tag == tree::ChildRef::kList && is_deepest);
}

// StepGroup::order is set before: overlapping() writes it to the place on the stack that the group takes.
inline void push(PairSteps& s, const BlockView& own, const StepNode& other, unsigned octants,
                 std::uint32_t asked = AskedLeaf::kNone) {
  BOCST_ASSERT(s.stack + s.depth < s.stack_end);
  StepGroup& top = s.stack[s.depth++];
  copyWords(own, top.own);
  copyWords(other, top.other);
  top.octants = octants;
  top.late = 0;
  top.asked = asked;
}

// Cache lines that hold most of a packed leaf, and all of it.
constexpr std::size_t kNextLeafLines = 4, kLeafLines = 10;

// Prefetches what the next steps read of a node: its block, or the first `leaf_lines` cache lines of a leaf's corners.
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
inline void fetchAll(const PairSteps& s, const BlockView& block, unsigned octants) {
  const tree::Tree& tree = *s.tree[block.side];
  for (; octants != 0; octants &= octants - 1) {
    const tree::ChildRef ref = block.at->child[__builtin_ctz(octants)].load(std::memory_order_acquire);
    fetch(tree, ref, kLeafLines);
    if (ref.tag() == tree::ChildRef::kBlock) tree.prefetchLastUse(ref.index());
  }
}

}  // namespace
}  // namespace bocst::query
#endif

HWY_BEFORE_NAMESPACE();
namespace bocst::query::HWY_NAMESPACE {

// Decodes the octants of a block into a frame. False where the frame holds them already: pairs that differ in the other
// node only come one after the other.
HWY_INLINE bool decodeBlock(PairSteps& s, int own, std::uint32_t index, const tree::Block& block, std::uint32_t frame) {
  const std::uint64_t name = frameName(static_cast<std::uint32_t>(own), index);
  if (s.holds[frame] == name) return false;
  s.holds[frame] = name;
  decodeBlock(s.geometry, own, block, s.frames[frame]);
  return true;
}

// Decodes the volume of one node of a pair that was pushed without frames into the next frame, and sets its lane.
HWY_INLINE void lookUp(PairSteps& s, StepNode& n, int side, std::uint32_t& frames) {
  const tree::Tree& tree = *s.tree[side];
  if (n.node.isRoot()) {
    decodeRoot(s.geometry, side, tree.rootBounds(), s.frames[frames]);
    s.holds[frames] = kEmptyFrame;
    n.lane = 8 * frames;
  } else {
    const std::uint32_t index = n.node.block();
    decodeBlock(s, side, index, tree.block(index), frames);
    n.lane = 8 * frames + static_cast<std::uint32_t>(n.node.octant());
  }
  ++frames;
}

// Decodes the block of an expanded node of side x into a frame. `is_new`: the frame did not hold it before.
HWY_INLINE BlockView open(PairSteps& s, int x, const StepNode& node, std::uint32_t frame, bool& is_new) {
  BOCST_ASSERT(frame < PairSteps::kFrames);
  const BlockView block = viewOf(*s.tree[x], x, node.ref.index(), frame);
  s.tree[x]->markUsed(block.index, s.now[x]);
  is_new = decodeBlock(s, x, block.index, *block.at, frame);
  return block;
}

std::uint8_t OverlappingOctants(const PairFrames& geometry, int own, const CellOctants& cell, const CellOctants& other,
                                int octant) {
  Frame f, y;
  decodeCell(geometry, own, cell.cell.level, cell.cell.at, cell.octants, f);
  decodeCell(geometry, 1 - own, other.cell.level, other.cell.at, other.octants, y);
  std::uint32_t order[8];
  return static_cast<std::uint8_t>(overlapping(geometry, f, y, static_cast<std::size_t>(octant), 0xff, order));
}

// The spheres of the cells in a block that a frame holds.
HWY_INLINE const SphereFrame& spheresOf(PairSteps& s, int side, std::uint32_t index, std::uint32_t frame) {
  const std::uint64_t name = frameName(static_cast<std::uint32_t>(side), index);
  if (s.spheres_hold[frame] != name) {
    const tree::Block& block = s.tree[side]->block(index);
    decodeSpheres(s.geometry.side[side], s.cells, block.shape, block.at, s.spheres[frame]);
    s.spheres_hold[frame] = name;
  }
  return s.spheres[frame];
}

// Spheres beside boxes and slabs, in the frame of these: how far a sphere's centre is from the box, squared, and from
// the slab.
HWY_INLINE void toVolumes(const V (&displacement)[3], const V (&half)[3], const V (&normal)[3], V slab_center,
                          V slab_half, V& squared, V& from_slab) {
  const D d;
  V along = hn::Zero(d);
  squared = hn::Zero(d);
  BOCST_UNROLL
  for (int k = 0; k < 3; ++k) {
    const V outside = hn::Max(hn::Sub(hn::Abs(displacement[k]), half[k]), hn::Zero(d));
    squared = hn::MulAdd(outside, outside, squared);
    along = hn::MulAdd(normal[k], displacement[k], along);
  }
  from_slab = hn::Sub(hn::Abs(hn::Sub(along, slab_center)), slab_half);
}

constexpr float kLongestNormal = 1.01f;  // of a slab; what it says of places is longer by so much

// The octants in `mask` of a block for which the cell's sphere may meet the volume beside it, be the cells those of the
// block or the other node; all where these cells are above the last levels. Sets their order, unless null.
HWY_INLINE unsigned meetingSpheres(PairSteps& s, const BlockView& block, const StepNode& other, unsigned mask,
                                   std::uint32_t* order) {
  const D d;
  const hn::RebindToUnsigned<D> du;
  const int x = static_cast<int>(block.side), y = 1 - x;
  const bool one_cell = s.has_cells[y];
  const std::uint32_t level = one_cell ? other.level : block.level;
  if (level + PairSteps::kSphereLevels < s.cells.deepest || (one_cell && other.node.isRoot())) return mask;
  const SphereFrame& cells =
      one_cell ? spheresOf(s, y, other.node.block(), other.lane / 8) : spheresOf(s, x, block.index, block.frame);
  const Frame& volumes = s.frames[one_cell ? block.frame : other.lane / 8];
  const std::size_t l = other.lane % 8;
  const auto of_cell = [d, one_cell, l](const float* lanes, std::size_t i)
                           HWY_ATTR { return one_cell ? hn::Set(d, lanes[l]) : hn::Load(d, lanes + i); };
  const auto of_volume = [d, one_cell, l](const float* lanes, std::size_t i)
                             HWY_ATTR { return one_cell ? hn::Load(d, lanes + i) : hn::Set(d, lanes[l]); };
  unsigned result = 0;
  for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
    V displacement[3], half[3], normal[3], squared, from_slab;
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      displacement[k] = hn::Sub(of_cell(cells.center[1][k], i), of_volume(volumes.center[0][k], i));
      half[k] = of_volume(volumes.half[0][k], i);
      normal[k] = of_volume(volumes.normal[0][k], i);
    }
    toVolumes(displacement, half, normal, of_volume(volumes.slab_center, i), of_volume(volumes.slab_half, i), squared,
              from_slab);
    const V reach = hn::Add(of_cell(cells.radius, i), hn::Set(d, s.sphere_margin));
    const V depth = hn::Sub(hn::Mul(reach, reach), squared);
    const V reach_along = hn::Mul(reach, hn::Set(d, kLongestNormal));
    const M apart = hn::Or(hn::Lt(depth, hn::Zero(d)), hn::Gt(from_slab, reach_along));
    if (order != nullptr) {
      const auto bits = hn::And(hn::BitCast(du, depth), hn::Set(du, ~7u));
      hn::StoreU(hn::Or(bits, hn::Iota(du, static_cast<std::uint32_t>(i))), du, order + i);
    }
    result |= bitsOf(d, hn::AndNot(apart, maskOf(d, mask >> i))) << i;
  }
  return result;
}

// The one of these octants of a group that overlaps the other node the most.
HWY_INLINE std::uint32_t deepest(const StepGroup& group, std::uint32_t octants) {
  const hn::RebindToUnsigned<D> du;
  auto most = hn::Zero(du);
  for (std::size_t i = 0; i < 8; i += hn::Lanes(du)) {
    const auto depth = hn::LoadU(du, group.order + i);
    most = hn::Max(most, hn::IfThenElseZero(maskOf(du, octants >> i), depth));
  }
  return hn::GetLane(hn::MaxOfLanes(du, most)) & 7;
}

// A pair off the stack: an octant of a group, the other node, and how many frames they and what is under them use.
struct Popped {
  StepNode own, other;
  int side;
  std::uint32_t frames;
  AskedLeaf asked;
};

// Takes the next pair off the stack: the octant that overlaps the most, or, with all_at_once, the first, which needs no
// search. The pair is returned, not stored: loads of a step wait for each other, from one child reference to the next.
// Octants that are still implicit come last: a hit among resident nodes makes their growth unnecessary.
HWY_INLINE Popped pop(PairSteps& s) {
  for (;;) {
    StepGroup& top = s.stack[s.depth - 1];
    const std::uint32_t soon = top.octants & ~top.late, which = soon != 0 ? soon : top.octants;
    const std::uint32_t o = s.all_at_once ? static_cast<std::uint32_t>(__builtin_ctz(which)) : deepest(top, which);
    const std::uint32_t rest = top.octants & ~(1u << o);
    Popped p;
    p.side = static_cast<int>(top.own.side);
    p.own.node = tree::NodeRef::octant(top.own.index, static_cast<int>(o));
    p.own.ref = top.own.at != nullptr ? top.own.at->child[o].load(std::memory_order_acquire)
                                      : s.side[p.side]->childRef(p.own.node);
    p.own.level = top.own.level;
    if (p.own.ref.tag() == tree::ChildRef::kImplicit && rest != 0 && soon != 0 && !isLeaf(s, p.side, p.own)) {
      top.late |= 1u << o;
      continue;
    }
    top.octants = rest;
    if (rest == 0) --s.depth;
    p.own.lane = top.own.frame == BlockView::kNoFrame ? StepNode::kNoLane : 8 * top.own.frame + o;
    p.other.node = top.other.node;
    p.other.ref = top.other.ref;
    p.other.level = top.other.level;
    p.other.lane = top.other.lane;
    p.frames = top.own.frame + 1;  // 0 without a frame
    p.asked.side = top.asked;
    p.asked.triangles = top.triangles[o];
    return p;
  }
}

// As many octants of a frame as a vector has, along their own axes; `low` to `high` is the box and the rounding margin.
struct OctantLanes {
  V center[3], half[3], normal[3], slab_center, slab_half, low[3], high[3], rounding_margin;
};

HWY_INLINE void load(const Frame& f, std::size_t i, float rounding_margin, OctantLanes& o) {
  const D d;
  o.rounding_margin = hn::Set(d, rounding_margin);
  BOCST_UNROLL
  for (int k = 0; k < 3; ++k) {
    o.center[k] = hn::Load(d, f.center[0][k] + i);
    o.half[k] = hn::Load(d, f.half[0][k] + i);
    o.normal[k] = hn::Load(d, f.normal[0][k] + i);
    const V extent = hn::Add(o.half[k], o.rounding_margin);
    o.low[k] = hn::Sub(o.center[k], extent);
    o.high[k] = hn::Add(o.center[k], extent);
  }
  o.slab_center = hn::Load(d, f.slab_center + i);
  o.slab_half = hn::Load(d, f.slab_half + i);
}

// The octants in `meet` that meet triangle t's box.
HWY_INLINE M meetsBox(const OctantLanes& o, const TriangleBounds& b, int t, M meet) {
  const D d;
  BOCST_UNROLL
  for (int k = 0; k < 3; ++k) {
    meet =
        hn::And(meet, hn::And(hn::Le(o.low[k], hn::Set(d, b.high[k][t])), hn::Ge(o.high[k], hn::Set(d, b.low[k][t]))));
  }
  return meet;
}

// Those that reach triangle t's plane. Along the normal, both the box of an octant and its slab, as in overlapping(),
// bound how far it reaches.
HWY_INLINE M meetsPlane(const OctantLanes& o, const TriangleBounds& b, int t, M meet) {
  const D d;
  V n[3], at = hn::Zero(d), r = o.rounding_margin, along = hn::Zero(d);
  BOCST_UNROLL
  for (int k = 0; k < 3; ++k) {
    n[k] = hn::Set(d, b.normal[k][t]);
    at = hn::MulAdd(n[k], o.center[k], at);
    r = hn::MulAdd(hn::Abs(n[k]), o.half[k], r);
    along = hn::MulAdd(n[k], o.normal[k], along);
  }
  V slab_r = hn::MulAdd(hn::Abs(along), o.slab_half, o.rounding_margin);
  BOCST_UNROLL
  for (int k = 0; k < 3; ++k) {
    slab_r = hn::MulAdd(hn::Abs(hn::NegMulAdd(along, o.normal[k], n[k])), o.half[k], slab_r);
  }
  const V slab_at = hn::MulAdd(along, o.slab_center, at);
  const V least = hn::Max(hn::Sub(at, r), hn::Sub(slab_at, slab_r));
  const V most = hn::Min(hn::Add(at, r), hn::Add(slab_at, slab_r));
  return hn::And(meet, hn::And(hn::Le(least, hn::Set(d, b.normal_high[t])), hn::Ge(most, hn::Set(d, b.normal_low[t]))));
}

// Those that reach behind triangle t's edges, in its plane.
HWY_INLINE M meetsEdges(const OctantLanes& o, const TriangleBounds& b, int t, M meet) {
  const D d;
  BOCST_UNROLL
  for (int e = 0; e < 3; ++e) {
    V at = hn::Zero(d), r = o.rounding_margin;
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      const V a = hn::Set(d, b.edge[e][k][t]);
      at = hn::MulAdd(a, o.center[k], at);
      r = hn::MulAdd(hn::Abs(a), o.half[k], r);
    }
    meet = hn::And(meet, hn::Le(hn::Sub(at, r), hn::Set(d, b.edge_high[e][t])));
  }
  return meet;
}

// Tests the octants in `mask` of a frame against the triangles in `which`, see octantsMeeting(). Calls store(first
// octant, triangles that each may meet) for each vector. Returns the octants that a triangle may meet.
template <typename F>
HWY_INLINE unsigned meeting(const PairFrames& g, int own, const Frame& f, unsigned mask, std::uint32_t which,
                            const TriangleBounds& b, F&& store) {
  const D d;
  const hn::RebindToUnsigned<D> du;
  unsigned result = 0;
  for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
    const M in = maskOf(d, mask >> i);
    OctantLanes octants;
    load(f, i, g.side[own].rounding_margin, octants);
    auto triangles = hn::Zero(du);
    for (std::uint32_t left = which; left != 0; left &= left - 1) {
      const int t = __builtin_ctz(left);
      M meet = meetsPlane(octants, b, t, meetsBox(octants, b, t, in));
      if (hn::AllFalse(d, meet)) continue;
      meet = meetsEdges(octants, b, t, meet);
      triangles = hn::Or(triangles, hn::IfThenElseZero(hn::RebindMask(du, meet), hn::Set(du, 1u << t)));
    }
    store(i, triangles);
    result |= bitsOf(du, hn::Ne(triangles, hn::Zero(du))) << i;
  }
  return result;
}

// Puts those octants in `mask` of a block on the stack that a larger leaf's triangles may meet.
HWY_NOINLINE void pushThose(PairSteps& s, const BlockView& block, const StepNode& leaf, unsigned mask,
                            std::uint32_t triangles) {
  const hn::RebindToUnsigned<D> du;
  const int x = static_cast<int>(block.side), y = 1 - x;
  StepGroup& top = s.stack[s.depth];
  mask = meeting(s.geometry, x, s.frames[block.frame], mask, triangles, s.leaf[y]->bounds(),
                 [&top, du](std::size_t i, hn::Vec<hn::RebindToUnsigned<D>> met)
                     HWY_ATTR { hn::StoreU(met, du, top.triangles + i); });
  if (mask != 0) push(s, block, leaf, mask, static_cast<std::uint32_t>(y));
}

void PushMeeting(PairSteps& s, const StepEvent& e, std::uint32_t triangles) {
  pushThose(s, e.block, e.pair[1 - e.block.side], e.mask, triangles);
}

void OctantsMeeting(const PairFrames& geometry, int own, const CellOctants& cell, const TriangleBounds& triangles,
                    std::size_t count, std::uint32_t (&met)[8]) {
  const hn::RebindToUnsigned<D> du;
  Frame f;
  decodeCell(geometry, own, cell.cell.level, cell.cell.at, cell.octants, f);
  meeting(geometry, own, f, 0xff, count < 32 ? (1u << count) - 1 : ~0u, triangles,
          [&met, du](std::size_t i, hn::Vec<hn::RebindToUnsigned<D>> m) HWY_ATTR { hn::StoreU(m, du, met + i); });
}

// Expands the other node of the pair for all octants in `mask` of a block; false where it is not the next to be
// expanded. `fetch_own`: nobody has fetched what is below that block.
HWY_INLINE bool expandOther(PairSteps& s, const BlockView& own, const StepNode& other, unsigned mask, bool fetch_own) {
  const int x = static_cast<int>(own.side), y = 1 - x;
  if (other.ref.tag() != tree::ChildRef::kBlock || isLeaf(s, y, other)) return false;
  const int deeper = static_cast<int>(other.level) - static_cast<int>(own.level);
  if (s.level_rule.isFirst(x, deeper)) return false;
  bool is_new;
  const BlockView block = open(s, y, other, own.frame + 1, is_new);
  if (fetch_own) fetchAll(s, own, mask);
  unsigned met = 0;
  for (; mask != 0; mask &= mask - 1) {
    const auto o = static_cast<std::uint32_t>(__builtin_ctz(mask));
    unsigned left = overlapping(s.geometry, s.frames[block.frame], s.frames[own.frame], o, block.at->grey, nullptr);
    if (left == 0) continue;
    StepNode n;
    setOctant(n, own, o);
    if (s.spheres != nullptr && (left = meetingSpheres(s, block, n, left, nullptr)) == 0) continue;
    met |= left;
    if (!s.sees_all) fetch(*s.tree[x], n.ref);
    push(s, block, n, left);
  }
  if (is_new && s.sees_all) fetchAll(s, block, met);
  return true;
}

// Sets `next` to the pair of the next octant and puts the others on the stack. False where that octant is implicit and
// there are others: then all are on the stack, so that pop() takes it last.
HWY_INLINE bool pushOthers(PairSteps& s, const BlockView& own, const StepNode& other, unsigned octants, Popped& next) {
  const std::uint32_t o =
      s.all_at_once ? static_cast<std::uint32_t>(__builtin_ctz(octants)) : deepest(s.stack[s.depth], octants);
  const std::uint32_t rest = octants & ~(1u << o);
  next.side = static_cast<int>(own.side);
  setOctant(next.own, own, o);
  next.other = other;
  next.frames = own.frame + 1;
  next.asked.side = AskedLeaf::kNone;
  const bool waits = rest != 0 && next.own.ref.tag() == tree::ChildRef::kImplicit && !isLeaf(s, next.side, next.own);
  if (rest != 0) push(s, own, other, waits ? octants : rest);
  return !waits;
}

// True if a node of a side lies behind the cut. All in the frame of side 0, as side 1's octants see it, too.
HWY_INLINE bool isBeyondCut(const PairSteps& s, int side, const StepNode& node) {
  if (node.lane == StepNode::kNoLane) return false;
  const Frame& f = s.frames[node.lane / 8];
  const std::uint32_t o = node.lane % 8;
  float center = 0, box = 0, along = 0;
  for (int k = 0; k < 3; ++k) {
    center += s.cut_direction[k] * f.center[side][k][o];
    box += s.cut_direction[k] * f.half[side][k][o];
    along += s.cut_direction[k] * f.normal[side][k][o];
  }
  if (center - box > s.cut) return true;
  // The slab bounds the part of the direction along its normal, and the box the rest.
  float least = along * f.slab_center[o] - std::abs(along) * f.slab_half[o];
  for (int k = 0; k < 3; ++k) {
    least -= std::abs(s.cut_direction[k] - along * f.normal[side][k][o]) * f.half[side][k][o];
  }
  return center + least > s.cut;
}

// Orders a side's octants by their least coordinates along the direction of the cut: that with the smallest is taken
// first.
HWY_INLINE void orderAlongCut(const PairSteps& s, int side, const Frame& f, std::uint32_t (&order)[8]) {
  const D d;
  const hn::RebindToUnsigned<D> du;
  const V beyond = hn::Set(d, 16.0f * lattice::kMiddle);  // keeps the numbers positive: their bits are in their order
  for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
    V least = hn::Zero(d);
    for (int k = 0; k < 3; ++k) {
      const V at = hn::Sub(hn::Load(d, f.center[side][k] + i), hn::Load(d, f.half[side][k] + i));
      least = hn::MulAdd(hn::Set(d, s.cut_direction[k]), at, least);
    }
    const auto octant = hn::Iota(du, static_cast<std::uint32_t>(i));
    hn::StoreU(hn::Or(hn::AndNot(hn::Set(du, 7), hn::BitCast(du, hn::Sub(beyond, least))), octant), du, order + i);
  }
}

// Orders octants by their numbers, as their ids are: that with the smallest is taken first.
HWY_INLINE void orderById(std::uint32_t (&order)[8]) {
  for (std::uint32_t o = 0; o < 8; ++o) order[o] = (7 - o) << 3 | o;
}

// Which node of a pair is expanded, and whether the other is a leaf that is larger.
struct Choice {
  int side;
  bool has_larger_leaf;
};

// The larger of two nodes is expanded, unless it is a leaf. At most one is.
HWY_INLINE Choice choose(const PairSteps& s, const Popped& p, bool own_leaf, bool other_leaf) {
  const bool leaf0 = p.side == 0 ? own_leaf : other_leaf, leaf1 = p.side == 0 ? other_leaf : own_leaf;
  const int below = static_cast<int>(p.own.level) - static_cast<int>(p.other.level);
  const int deeper = p.side == 0 ? -below : below;  // side 1's node than side 0's
  const bool is_smaller = !s.level_rule.isFirst(0, deeper);
  if (leaf1 || (!leaf0 && !is_smaller)) return {0, leaf1 && is_smaller};
  return {1, leaf0 && deeper >= s.level_rule.larger};
}

HWY_INLINE void fill(StepEvent& e, StepEvent::Kind kind, const Popped& p) {
  e.kind = kind;
  e.pair[p.side] = p.own;
  e.pair[1 - p.side] = p.other;
  e.asked = p.asked;
}

void NextEvent(PairSteps& s, StepEvent& event) {
  Popped p;
  bool known = false;  // p is set already
  while (known || s.depth != 0) {
    if (!known) p = pop(s);
    known = false;
    if (s.is_cut && (isBeyondCut(s, p.side, p.own) || isBeyondCut(s, 1 - p.side, p.other))) continue;
    if (s.cell_cut != nullptr &&
        s.isBeyondCellCut(p.side == 0 ? p.own.node : p.other.node, p.side == 0 ? p.other.node : p.own.node)) {
      continue;
    }
    const bool own_leaf = isLeaf(s, p.side, p.own), other_leaf = isLeaf(s, 1 - p.side, p.other);
    if (own_leaf && other_leaf) {
      if (!s.sees_all) {
        fetch(*s.tree[p.side], p.own.ref);
        fetch(*s.tree[1 - p.side], p.other.ref);
      }
      return fill(event, StepEvent::kLeaves, p);
    }
    const Choice choice = choose(s, p, own_leaf, other_leaf);
    const int x = choice.side, y = 1 - x;
    const StepNode node = x == p.side ? p.own : p.other;
    StepNode other = x == p.side ? p.other : p.own;
    if (node.ref.tag() != tree::ChildRef::kBlock) return fill(event, StepEvent::kDeferred, p);
    if (!s.sees_all && other.ref.tag() == tree::ChildRef::kBlock) fetch(*s.tree[y], other.ref);
    if (other.lane == StepNode::kNoLane) lookUp(s, other, y, p.frames);
    bool is_new;
    const BlockView block = open(s, x, node, p.frames, is_new);
    std::uint32_t(&order)[8] = s.stack[s.depth].order;
    unsigned mask =
        overlapping(s.geometry, s.frames[block.frame], s.frames[other.lane / 8], other.lane % 8, block.at->grey, order);
    if (mask != 0 && s.spheres != nullptr) mask = meetingSpheres(s, block, other, mask, order);
    if (mask == 0) continue;
    if (s.is_cut) orderAlongCut(s, x, s.frames[block.frame], order);
    if (s.in_order || (s.cell_cut != nullptr && s.has_cells[x])) orderById(order);
    if (choice.has_larger_leaf && !s.has_cells[y]) {
      if (p.asked.side == AskedLeaf::kNone || !s.leaf[y]->know(other.node, p.asked.triangles)) {
        fill(event, StepEvent::kLargeTriangles, p);
        event.pair[y] = other;
        event.block = block;
        event.mask = mask;
        return;
      }
      pushThose(s, block, other, mask, p.asked.triangles);
      continue;
    }
    const bool fetch_own = is_new && s.sees_all;
    if (s.all_at_once && expandOther(s, block, other, mask, fetch_own)) continue;
    if (fetch_own) fetchAll(s, block, mask);
    known = pushOthers(s, block, other, mask, p);
  }
  event.kind = StepEvent::kDone;
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

void nextEvent(PairSteps& steps, StepEvent& event) { HWY_DYNAMIC_DISPATCH(NextEvent)(steps, event); }

void pushMeeting(PairSteps& steps, const StepEvent& event, std::uint32_t triangles) {
  HWY_DYNAMIC_DISPATCH(PushMeeting)(steps, event, triangles);
}

void octantsMeeting(const PairFrames& geometry, int own, const CellOctants& cell, const TriangleBounds& triangles,
                    std::size_t count, std::uint32_t (&met)[8]) {
  HWY_DYNAMIC_DISPATCH(OctantsMeeting)(geometry, own, cell, triangles, count, met);
}

void pushOctants(PairSteps& s, const StepEvent& event, unsigned mask) {
  if (mask != 0) push(s, event.block, event.pair[1 - event.block.side], mask);
}

void pushPair(PairSteps& s, tree::NodeRef node_a, tree::NodeRef node_b) {
  StepNode other;
  other.node = node_b;
  other.ref = s.side[1]->childRef(node_b);
  other.level = static_cast<std::uint32_t>(s.tree[1]->level(node_b));
  const auto o = static_cast<std::uint32_t>(node_a.octant());
  std::fill_n(s.stack[s.depth].order, 8, o);
  BlockView own;
  own.at = node_a.isRoot() ? nullptr : &s.tree[0]->block(node_a.block());
  own.index = node_a.block();
  own.level = static_cast<std::uint32_t>(s.tree[0]->level(node_a));
  own.frame = BlockView::kNoFrame;
  own.side = 0;
  push(s, own, other, 1u << o);
}

}  // namespace bocst::query
#endif
