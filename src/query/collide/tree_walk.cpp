// SPDX-License-Identifier: BSD-3-Clause
#include "query/collide/tree_walk.h"

namespace bocst::query {

struct TreeWalk::Scratch {
  std::vector<StepGroup> stack;
  Frame frames[PairSteps::kFrames];
  DeferredPairs<TreeSide, TreeSide> deferred;
  LeafPairs<TreeSide, TreeSide> leaves;
  bool leaves_started = false;
  LargeTriangles large[2];
  LargeTriangleLeaf<TreeSide> long_a, long_b;  // leaves of more triangles than those hold
  bool grew = false;
};

bool TreeWalk::run(Visitor& visitor) {
  visitor_ = &visitor;
  thread_local Scratch s;
  s.deferred.clear();
  s.leaves_started = false;
  for (LargeTriangles& large : s.large) large.clear();
  s.long_a.clear();
  s.long_b.clear();
  s.grew = false;
  for (const TreeSide* side : {&a_, &b_}) side->tree().payRent(tree::Tree::kWalkRent);
  const bool ended = search(s);
  // A first answer has enough to do; what a later one needs again is worth to be packed.
  if (s.leaves_started && !s.grew) {
    a_.tree().packLeaves(s.leaves.looseOfA());
    b_.tree().packLeaves(s.leaves.looseOfB());
  }
  return ended;
}

bool TreeWalk::search(Scratch& s) {
  // Nothing grows for what is far away.
  const bool new_root = a_.state(a_.root()) == State::kGrows || b_.state(b_.root()) == State::kGrows;
  if (new_root && facesApart(a_.volume(a_.root()), b_.volume(b_.root()), b_in_a_)) return false;

  PairSteps steps(&a_.tree(), &b_.tree(), a_.now(), PairFrames(b_in_a_.scale, b_in_a_), s.frames);
  for (int side = 0; side < 2; ++side) steps.leaf[side] = &s.large[side];
  const Cut* const cut = visitor_->cut();
  const bool may_end = visitor_->endsAtFirst() || cut != nullptr;
  steps.sees_all = !may_end;
  steps.all_at_once = cut == nullptr && (is_shallow_ || steps.sees_all);
  if (cut != nullptr) steps.setCut(*cut);
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
    if (cut != nullptr) {
      s.deferred.dropIf([&](const auto& pair) { return cut->isBeyond(a_.volume(pair.a)); });
    }
    if (s.deferred.empty()) return false;
    s.grew = true;
    s.deferred.grow(a_, b_, b_in_a_, may_end, push);
  }
}

bool TreeWalk::stepAll(PairSteps& steps, Scratch& s) {
  for (;;) {
    switch (nextEvent(steps)) {
      case PairSteps::kDone:
        return false;
      case PairSteps::kDeferred:
        s.deferred.add({steps.pair[0].node, steps.pair[1].node});
        break;
      case PairSteps::kLargeTriangles:
        testLargeTriangles(steps, s);
        break;
      case PairSteps::kLeaves:
        if (testLeaves(steps, s)) return true;
        if (steps.isCut()) steps.setCut(*visitor_->cut());
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
  } else if (!small.hasOctants(node)) {
    pushOctants(steps, steps.mask);
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

}  // namespace bocst::query
