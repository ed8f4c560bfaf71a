// SPDX-License-Identifier: BSD-3-Clause
#include "query/tree_walk.h"

namespace bocst::query {

namespace {

constexpr std::size_t kLooks = 8;  // at most so many at each tree after one query

}  // namespace

struct TreeWalk::Scratch {
  std::vector<StepPair> stack;
  Frame frames[PairSteps::kFrames];
  SetAside<TreeSide, TreeSide> aside;
  LeafPairs<TreeSide, TreeSide> leaves;
  CoarseLeaf<TreeSide> coarse_a, coarse_b;
  bool grew = false;
  std::vector<tree::NodeRef> unseen[2];  // set aside, and with no slab yet
};

bool TreeWalk::run() {
  thread_local Scratch s;
  s.aside.clear();
  s.leaves.start(b_in_a_, a_in_b_);
  s.coarse_a.clear();
  s.coarse_b.clear();
  s.unseen[0].clear();
  s.unseen[1].clear();
  s.grew = false;
  if (!search(s)) return false;
  // What a query could do without, the next one meets again: a look is cheaper than growing it.
  a_.tree().look(s.unseen[0]);
  b_.tree().look(s.unseen[1]);
  if (!s.aside.empty() && !s.grew && a_.tree().hasRoom() && b_.tree().hasRoom()) s.aside.growFirst(a_, b_);
  return true;
}

bool TreeWalk::search(Scratch& s) {
  if (boxesApart(oriented(a_.volume(a_.root())), oriented(b_.volume(b_.root())), b_in_a_)) return false;

  for (Frame& f : s.frames) f.holds = Frame::kNothing;
  PairSteps steps{{&a_.tree(), &b_.tree()}, a_.now(), PairFrames(b_in_a_.scale, b_in_a_), s.frames, nullptr};
  const auto push = [&](const SetAside<TreeSide, TreeSide>::Pair& pair) {
    if (s.stack.size() < steps.depth + 1 + PairSteps::kStackRoom) {
      s.stack.resize(2 * (steps.depth + PairSteps::kStackRoom));
    }
    StepPair p;
    p.node[0] = pair.a;
    p.node[1] = pair.b;
    for (int side = 0; side < 2; ++side) {
      p.link[side] = steps.tree[side]->link(p.node[side]);
      p.level[side] = static_cast<std::uint32_t>(steps.tree[side]->cell(p.node[side]).level);
    }
    s.stack[steps.depth++] = p;
  };
  push({a_.root(), b_.root()});
  for (;;) {
    steps.stack = s.stack.data();
    if (stepAll(steps, s)) return true;
    if (s.aside.empty()) return false;
    s.grew = true;
    s.aside.grow(a_, b_, b_in_a_, visitor_.endsAtFirst(), push);
  }
}

bool TreeWalk::stepAll(PairSteps& steps, Scratch& s) {
  for (;;) {
    switch (nextEvent(steps)) {
      case PairSteps::kDone:
        return false;
      case PairSteps::kAside:
        setAside(steps, s);
        break;
      case PairSteps::kCoarse:
        pushOctants(steps, steps.expanded == 0 ? s.coarse_b.octantsMeeting(a_, steps.pair.node[0], steps.mask, b_,
                                                                           steps.pair.node[1], b_in_a_)
                                               : s.coarse_a.octantsMeeting(b_, steps.pair.node[1], steps.mask, a_,
                                                                           steps.pair.node[0], a_in_b_));
        break;
      case PairSteps::kLeaves:
        if (s.leaves.test(
                a_, steps.pair.node[0], b_, steps.pair.node[1],
                [this](std::uint32_t t, std::uint32_t u, bool certain) { return visitor_.triangles(t, u, certain); })) {
          return true;
        }
        break;
    }
  }
}

void TreeWalk::setAside(const PairSteps& steps, Scratch& s) {
  const StepPair& p = steps.pair;
  s.aside.add({p.node[0], p.node[1]});
  for (int side = 0; side < 2; ++side) {
    if (s.unseen[side].size() == kLooks || p.link[side].tag() != tree::Link::kImplicit) continue;
    if (p.lane[side] == StepPair::kNoLane) continue;
    const auto& normal = steps.frames[p.lane[side] / 8].normal[side];
    const std::size_t o = p.lane[side] % 8;
    if (normal[0][o] == 0 && normal[1][o] == 0 && normal[2][o] == 0) s.unseen[side].push_back(p.node[side]);
  }
}

}  // namespace bocst::query
