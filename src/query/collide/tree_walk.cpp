// SPDX-License-Identifier: BSD-3-Clause
#include "query/collide/tree_walk.h"

#include "query/cull/support_refinement.h"

namespace bocst::query {

namespace {

constexpr std::size_t kUnseen = 8;  // nodes to look at, at most so many of each tree after one query

}  // namespace

struct TreeWalk::Scratch {
  std::vector<StepGroup> stack;
  Frame frames[PairSteps::kFrames];
  DeferredPairs<TreeSide, TreeSide> deferred;
  LeafPairs<TreeSide, TreeSide> leaves;
  bool leaves_started = false;
  LargeTriangles large[2];
  LargeTriangleLeaf<TreeSide> long_a, long_b;  // leaves of more triangles than those hold
  bool grew = false;
  std::vector<tree::NodeRef> unseen[2];  // deferred, and with no slab yet
};

bool TreeWalk::run(Visitor& visitor) {
  visitor_ = &visitor;
  thread_local Scratch s;
  s.deferred.clear();
  s.leaves_started = false;
  for (LargeTriangles& large : s.large) large.clear();
  s.long_a.clear();
  s.long_b.clear();
  s.unseen[0].clear();
  s.unseen[1].clear();
  s.grew = false;
  const bool ended = search(s);
  // A first answer has enough to do; what a later one needs again is worth to be packed.
  if (s.leaves_started && !s.grew) {
    a_.tree().packLeaves(s.leaves.looseOfA());
    b_.tree().packLeaves(s.leaves.looseOfB());
  }
  if (!ended) {
    if (!s.grew) refineSupports(a_, b_, near_);
    return false;
  }
  // What a query could do without, the next one meets again: a look is cheaper than growing it.
  a_.tree().tightenBounds(s.unseen[0]);
  b_.tree().tightenBounds(s.unseen[1]);
  if (!s.deferred.empty() && !s.grew && a_.tree().hasBudget() && b_.tree().hasBudget()) s.deferred.growFirst(a_, b_);
  return true;
}

bool TreeWalk::search(Scratch& s) {
  // Nothing grows for what is far away.
  const bool new_root = a_.state(a_.root()) == State::kGrows || b_.state(b_.root()) == State::kGrows;
  if (new_root && facesApart(a_.volume(a_.root()), b_.volume(b_.root()), b_in_a_)) return false;

  PairSteps steps(&a_.tree(), &b_.tree(), a_.now(), PairFrames(b_in_a_.scale, b_in_a_), s.frames);
  for (int side = 0; side < 2; ++side) steps.leaf[side] = &s.large[side];
  steps.sees_all = !visitor_->endsAtFirst();
  steps.all_at_once = near_.shallow || steps.sees_all;
  const auto push = [&](const DeferredPairs<TreeSide, TreeSide>::Pair& pair) {
    if (s.stack.size() < steps.depth + 1 + PairSteps::kStackRoom) {
      s.stack.resize(2 * (steps.depth + PairSteps::kStackRoom));
    }
    steps.stack = s.stack.data();
    pushPair(steps, pair.a, pair.b);
  };
  push({a_.root(), b_.root()});
  for (;;) {
    if (stepAll(steps, s)) return true;
    if (s.deferred.empty()) return false;
    s.grew = true;
    s.deferred.grow(a_, b_, b_in_a_, visitor_->endsAtFirst(), push);
  }
}

bool TreeWalk::stepAll(PairSteps& steps, Scratch& s) {
  for (;;) {
    switch (nextEvent(steps)) {
      case PairSteps::kDone:
        return false;
      case PairSteps::kDeferred:
        defer(steps, s);
        break;
      case PairSteps::kLargeTriangles:
        testLargeTriangles(steps, s);
        break;
      case PairSteps::kLeaves:
        if (testLeaves(steps, s)) return true;
        break;
    }
  }
}

void TreeWalk::testLargeTriangles(PairSteps& steps, Scratch& s) {
  const int x = steps.expanded, y = 1 - x;
  const TreeSide &small = x == 0 ? a_ : b_, &large = x == 0 ? b_ : a_;
  const SimilarityTransform& to = x == 0 ? b_in_a_ : aInB();
  const tree::NodeRef node = steps.pair[x].node, leaf = steps.pair[y].node;
  if (large.triangleCount(leaf) <= LargeTriangles::kCapacity) {
    const auto unit = static_cast<double>(steps.geometry.side[x].unit);
    const std::uint32_t asked = steps.large == StepGroup::kNone ? ~0u : steps.triangles;
    steps.triangles = s.large[y].meeting(small, node, large, leaf, asked, to, unit);
    if (steps.triangles != 0) pushMeeting(steps);
  } else {
    pushOctants(steps, (x == 0 ? s.long_b : s.long_a).octantsMeeting(small, node, steps.mask, large, leaf, to));
  }
}

bool TreeWalk::testLeaves(const PairSteps& steps, Scratch& s) {
  if (!s.leaves_started) {
    s.leaves.start(b_in_a_, aInB());
    s.leaves_started = true;
  }
  const auto visit = [this](std::uint32_t t, std::uint32_t u, bool certain) {
    return visitor_->triangles(t, u, certain);
  };
  const tree::NodeRef a = steps.pair[0].node, b = steps.pair[1].node;
  if (steps.large == StepGroup::kNone) return s.leaves.test(a_, a, b_, b, visit);
  return steps.large == 0 ? s.leaves.testLargeA(s.large[0], steps.triangles, b_, b, visit)
                          : s.leaves.testLargeB(a_, a, s.large[1], steps.triangles, visit);
}

const SimilarityTransform& TreeWalk::aInB() {
  if (!inverted_) a_in_b_ = b_in_a_.inverse();
  inverted_ = true;
  return a_in_b_;
}

void TreeWalk::defer(const PairSteps& steps, Scratch& s) {
  s.deferred.add({steps.pair[0].node, steps.pair[1].node});
  for (int side = 0; side < 2; ++side) {
    const StepNode& n = steps.pair[side];
    if (s.unseen[side].size() == kUnseen || n.ref.tag() != tree::ChildRef::kImplicit) continue;
    if (n.lane == StepNode::kNoLane) continue;
    const auto& normal = steps.frames[n.lane / 8].normal[0];
    const std::size_t o = n.lane % 8;
    if (normal[0][o] == 0 && normal[1][o] == 0 && normal[2][o] == 0) s.unseen[side].push_back(n.node);
  }
}

}  // namespace bocst::query
