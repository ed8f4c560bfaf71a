// SPDX-License-Identifier: BSD-3-Clause
#include "query/tree_walk.h"

namespace bocst::query {

namespace {

constexpr std::size_t kLooks = 8;  // at most so many at each tree after one query

}  // namespace

struct TreeWalk::Scratch {
  std::vector<StepGroup> stack;
  Frame frames[PairSteps::kFrames];
  SetAside<TreeSide, TreeSide> aside;
  LeafPairs<TreeSide, TreeSide> leaves;
  PackedLeaves packed;
  PackPair found[TrianglePack::kCapacity * TrianglePack::kCapacity];
  CoarseLeaf<TreeSide> coarse_a, coarse_b;
  bool grew = false;
  std::vector<tree::NodeRef> unseen[2];  // set aside, and with no slab yet
  std::vector<tree::NodeRef> loose[2];   // leaves whose corners are not packed
};

bool TreeWalk::run() {
  thread_local Scratch s;
  s.aside.clear();
  s.leaves.clear();
  s.coarse_a.clear();
  s.coarse_b.clear();
  s.packed.clear();
  for (int side = 0; side < 2; ++side) {
    s.unseen[side].clear();
    s.loose[side].clear();
  }
  s.grew = false;
  const bool ended = search(s);
  // A first answer has enough to do; what a later one needs again is worth to be packed.
  if (!s.grew) {
    a_.tree().packLeaves(s.loose[0]);
    b_.tree().packLeaves(s.loose[1]);
  }
  if (!ended) return false;
  // What a query could do without, the next one meets again: a look is cheaper than growing it.
  a_.tree().look(s.unseen[0]);
  b_.tree().look(s.unseen[1]);
  if (!s.aside.empty() && !s.grew && a_.tree().hasRoom() && b_.tree().hasRoom()) s.aside.growFirst(a_, b_);
  return true;
}

bool TreeWalk::search(Scratch& s) {
  if (facesApart(a_.volume(a_.root()), b_.volume(b_.root()), b_in_a_)) return false;

  PairSteps steps(&a_.tree(), &b_.tree(), a_.now(), PairFrames(b_in_a_.scale, b_in_a_), s.frames);
  const auto push = [&](const SetAside<TreeSide, TreeSide>::Pair& pair) {
    if (s.stack.size() < steps.depth + 1 + PairSteps::kStackRoom) {
      s.stack.resize(2 * (steps.depth + PairSteps::kStackRoom));
    }
    steps.stack = s.stack.data();
    pushPair(steps, pair.a, pair.b);
  };
  push({a_.root(), b_.root()});
  for (;;) {
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
        pushOctants(steps, steps.expanded == 0 ? s.coarse_b.octantsMeeting(a_, steps.pair[0].node, steps.mask, b_,
                                                                           steps.pair[1].node, b_in_a_)
                                               : s.coarse_a.octantsMeeting(b_, steps.pair[1].node, steps.mask, a_,
                                                                           steps.pair[0].node, b_in_a_.inverse()));
        break;
      case PairSteps::kLeaves:
        if (testLeaves(steps, s)) return true;
        break;
    }
  }
}

bool TreeWalk::testLeaves(const PairSteps& steps, Scratch& s) {
  const StepNode &a = steps.pair[0], &b = steps.pair[1];
  tree::PackedTriangles packed[2];
  const bool packed_a = a_.tree().packed(a.link, packed[0]), packed_b = b_.tree().packed(b.link, packed[1]);
  const auto fits = [](const tree::PackedTriangles& p) { return p.count <= TrianglePack::kCapacity; };
  if (packed_a && packed_b && fits(packed[0]) && fits(packed[1])) {
    for (int i = 0; i < 6; ++i) {
      __builtin_prefetch(reinterpret_cast<const char*>(packed[0].steps) + 64 * i);
      __builtin_prefetch(reinterpret_cast<const char*>(packed[1].steps) + 64 * i);
    }
    const std::uint32_t *ids_a = a_.tree().list(a.link).ids, *ids_b = b_.tree().list(b.link).ids;
    const std::size_t found =
        s.packed.test(a.node, packed[0], a_.cellSphere(a.node).center, packed[1], b_in_a_, s.found);
    for (std::size_t i = 0; i < found; ++i) {
      if (visitor_.triangles(ids_a[s.found[i].row], ids_b[s.found[i].lane])) return true;
    }
    return false;
  }
  for (int side = 0; side < 2; ++side) {
    if (!(side == 0 ? packed_a : packed_b) && s.loose[side].size() < kLooks) {
      s.loose[side].push_back(steps.pair[side].node);
    }
  }
  return s.leaves.test(a_, a.node, b_, b.node, b_in_a_,
                       [this](std::uint32_t t, std::uint32_t u) { return visitor_.triangles(t, u); });
}

void TreeWalk::setAside(const PairSteps& steps, Scratch& s) {
  s.aside.add({steps.pair[0].node, steps.pair[1].node});
  for (int side = 0; side < 2; ++side) {
    const StepNode& n = steps.pair[side];
    if (s.unseen[side].size() == kLooks || n.link.tag() != tree::Link::kImplicit) continue;
    if (n.lane == StepNode::kNoLane) continue;
    const auto& normal = steps.frames[n.lane / 8].normal[side];
    const std::size_t o = n.lane % 8;
    if (normal[0][o] == 0 && normal[1][o] == 0 && normal[2][o] == 0) s.unseen[side].push_back(n.node);
  }
}

}  // namespace bocst::query
