// SPDX-License-Identifier: BSD-3-Clause
#include "query/collide/tree_walk.h"

#include "thread/of_thread.h"

namespace bocst::query {
namespace {

// One walk in ten thousand of scans and robots' links tests more than 256 pairs of leaves without a hit.
constexpr Turns::LimitsByKind kLimits = {{64, 256, 256, 1}, {256, 1024, 1024, 2}};
// The exact test of two triangles that float cannot tell apart takes as long as this many pairs of leaves.
constexpr std::size_t kExactTest = 8;
// Boxes and slabs of leaves leave few triangles to be tested, but of slivers all: so many pairs of triangles then take
// as long as a pair of leaves.
constexpr std::size_t kTrianglePairs = 32;

}  // namespace

struct TreeWalk::Scratch {
  std::vector<StepGroup> stack;
  Frame frames[PairSteps::kFrames];
  SphereFrame spheres[PairSteps::kFrames];
  DeferredPairs<TreeSide, TreeSide> deferred;
  LeafPairs<TreeSide, TreeSide> leaves;
  bool leaves_started = false;
  LargeTriangles large[2], beside_cell;
  LargeTriangleLeaf<TreeSide> long_a, long_b;  // leaves of more triangles than those hold
};

bool TreeWalk::runByTurns(Visitor& visitor) {
  if (!BoxSide::fits(a_) || !BoxSide::fits(b_)) return run(visitor);
  return walkByTurns(a_, b_, b_in_a_, visitor, kLimits, [&](std::size_t most) { return run(visitor, most); });
}

void TreeWalk::payForBoxes(std::size_t steps) const { Turns::pay(a_, b_, kLimits.of_verdict, steps); }

WalkEnd TreeWalk::run(Visitor& visitor, std::size_t most_steps) {
  visitor_ = &visitor;
  steps_ = 0;
  most_steps_ = most_steps;
  gave_up_ = false;
  auto& s = thread::ofThread<Scratch>();
  s.deferred.clear();
  s.leaves_started = false;
  for (LargeTriangles* large : {&s.large[0], &s.large[1], &s.beside_cell}) large->clear();
  s.long_a.clear();
  s.long_b.clear();
  // Each walk in a tree that is not whole brings the query nearer that builds it whole: see Tree::payRent().
  for (const TreeSide* side : {&a_, &b_}) {
    if (!side->isConservative()) side->tree().payRent(tree::Tree::kWalkRent);
  }
  const bool ended = search(s);
  return {ended && !gave_up_, steps_, gave_up_};
}

WalkEnd TreeWalk::runInOrder(Visitor& visitor, std::size_t most_leaf_pairs) {
  in_order_ = true;
  const WalkEnd end = run(visitor, most_leaf_pairs);
  in_order_ = false;
  return end;
}

bool TreeWalk::search(Scratch& s) {
  // A root is not expanded for a pair whose root boxes are apart.
  const bool new_root = a_.state(a_.root()) == State::kGrows || b_.state(b_.root()) == State::kGrows;
  if (new_root && facesApart(a_.volume(a_.root()), b_.volume(b_.root()), place())) return false;

  PairSteps steps(a_, b_, PairFrames(place()), s.frames);
  for (int side = 0; side < 2; ++side) steps.leaf[side] = &s.large[side];
  const Cut* const cut = in_order_ ? nullptr : visitor_->cut();
  const bool may_end = in_order_ || visitor_->endsAtFirst() || cut != nullptr;
  steps.in_order = in_order_;
  steps.sees_all = !may_end;
  steps.all_at_once = !in_order_ && cut == nullptr && (is_shallow_ || steps.sees_all);
  if (wide_) {
    steps.setSpheres(s.spheres, PairFrames(b_in_a_).slab_rounding_margin);
    steps.cell_cut = cut;
  } else if (cut != nullptr) {
    steps.setCut(*cut);
  }
  const auto push = [&](const DeferredPairs<TreeSide, TreeSide>::Pair& pair) {
    pushWithRoom(steps, s.stack, pair.a, pair.b);
  };
  push({a_.root(), b_.root()});
  for (;;) {
    if (stepAll(steps, s)) return true;
    if (cut != nullptr) {
      s.deferred.dropIf([&](const auto& pair) {
        return wide_ ? steps.isBeyondCellCut(pair.a, pair.b) : cut->isBeyond(cut->leastOf(a_.volume(pair.a)));
      });
    }
    if (s.deferred.empty()) return false;
    s.deferred.grow(a_, b_, b_in_a_, may_end, push);
  }
}

bool TreeWalk::stepAll(PairSteps& steps, Scratch& s) {
  StepEvent event;
  for (;;) {
    nextEvent(steps, event);
    switch (event.kind) {
      case StepEvent::kDone:
        return false;
      case StepEvent::kDeferred:
        s.deferred.add({event.pair[0].node, event.pair[1].node});
        break;
      case StepEvent::kLargeTriangles:
        testLargeTriangles(steps, event, s);
        ++steps_;
        break;
      case StepEvent::kLeaves:
        if (testLeaves(event, s)) return true;
        if (steps.is_cut) steps.setCut(*visitor_->cut());
        break;
    }
  }
}

void TreeWalk::testLargeTriangles(PairSteps& steps, const StepEvent& event, Scratch& s) {
  const auto x = static_cast<int>(event.block.side), y = 1 - x;
  const TreeSide &small = x == 0 ? a_ : b_, &large = x == 0 ? b_ : a_;
  const SimilarityTransform& to = x == 0 ? place() : aInB();
  const tree::NodeRef node = event.pair[x].node, leaf = event.pair[y].node;
  if (large.triangleCount(leaf) <= LargeTriangles::kCapacity) {
    const auto unit = static_cast<double>(steps.geometry.side[x].unit);
    const std::uint32_t asked = event.asked.side == AskedLeaf::kNone ? ~0u : event.asked.triangles;
    const std::uint32_t triangles = s.large[y].meeting(small, node, large, leaf, asked, to, unit);
    if (triangles != 0) pushMeeting(steps, event, triangles);
  } else if (!small.hasOctants(node)) {
    pushOctants(steps, event, event.mask);
  } else {
    pushOctants(steps, event, (x == 0 ? s.long_b : s.long_a).octantsMeeting(small, node, event.mask, large, leaf, to));
  }
}

// True when the visitor ended the walk, or it gave up.
bool TreeWalk::testLeaves(const StepEvent& event, Scratch& s) {
  gave_up_ = ++steps_ > most_steps_;
  if (gave_up_) return true;
  if (wide_) return testCell(event, s);
  if (!s.leaves_started) {
    s.leaves.start(b_in_a_, aInB(), visitor_->endsAtFirst(), in_order_ ? nullptr : visitor_->cut());
    s.leaves_started = true;
  }
  const auto visit = [this](std::uint32_t t, std::uint32_t u, bool certain) {
    if (in_order_) return visitor_->triangles(t, u, certain);
    if (!certain) steps_ += kExactTest;
    gave_up_ = steps_ > most_steps_;
    return gave_up_ || visitor_->triangles(t, u, certain);
  };
  const tree::NodeRef a = event.pair[0].node, b = event.pair[1].node;
  const std::uint32_t triangles = event.asked.triangles;
  const std::size_t before = s.leaves.tested();
  const bool ended = event.asked.side == AskedLeaf::kNone ? s.leaves.test(a_, a, b_, b, visit)
                     : event.asked.side == 0              ? s.leaves.testLargeA(s.large[0], triangles, b_, b, visit)
                                                          : s.leaves.testLargeB(a_, a, s.large[1], triangles, visit);
  // How many triangles are tested depends on whether their corners are packed.
  if (in_order_) return visitor_->endLeaves();
  steps_ += (s.leaves.tested() - before) / kTrianglePairs;
  return ended;
}

// A cell against the triangles of a leaf.
bool TreeWalk::testCell(const StepEvent& event, Scratch& s) {
  const int x = a_.isConservative() ? 0 : 1;
  const TreeSide &cells = x == 0 ? a_ : b_, &meshes = x == 0 ? b_ : a_;
  const tree::NodeRef node = event.pair[x].node, leaf = event.pair[1 - x].node;
  CellLeaf cell{cells.cellId(node), cells.cellSphere(node)};
  const std::size_t count = meshes.triangleCount(leaf);
  std::uint32_t left = event.asked.triangles;
  const auto near = [&] {
    return x == 0 ? s.beside_cell.near(cell.sphere, b_in_a_.tolerance, b_, leaf, place())
                  : s.beside_cell.near(cell.sphere, b_in_a_.tolerance / b_in_a_.scale, a_, leaf, aInB());
  };
  const bool is_short = count <= LargeTriangles::kCapacity;
  if (is_short) left = event.asked.side == AskedLeaf::kNone ? near() : left & near();
  if (x == 1) cell.sphere = placed(cell.sphere, b_in_a_);
  const auto meets = [&](std::uint32_t t) {
    const Corners own = meshes.corners(t);
    const Eigen::Vector3d point = closestPoint(cell.sphere.center, x == 0 ? placed(own, b_in_a_) : own);
    if (!spheresMeet(cell.sphere, {point, 0}, b_in_a_.tolerance)) return false;
    return x == 0 ? visitor_->cellOfA(cell, t, point) : visitor_->cellOfB(t, cell, point);
  };
  const tree::TriangleList list = meshes.triangles(leaf);
  if (is_short) {
    for (; left != 0; left &= left - 1) {
      if (meets(list.ids[static_cast<std::size_t>(__builtin_ctz(left))])) return true;
    }
    return false;
  }
  for (std::uint32_t i = 0; i < list.count; ++i) {
    if (meets(list.ids[i])) return true;
  }
  return false;
}

const SimilarityTransform& TreeWalk::aInB() {
  if (!inverted_) a_in_b_ = place().inverse();
  inverted_ = true;
  return a_in_b_;
}

}  // namespace bocst::query
