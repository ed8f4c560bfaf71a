// SPDX-License-Identifier: BSD-3-Clause
#include "query/collide/sphere_walk.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "query/collide/deferred_pairs.h"
#include "thread/of_thread.h"

namespace bocst::query {

namespace {

template <typename F>
void forEachBit(const std::vector<std::uint32_t>& words, F&& f) {
  for (std::uint32_t i = 0; i < words.size(); ++i) {
    for (std::uint32_t bits = words[i]; bits != 0; bits &= bits - 1) {
      f(32 * i + static_cast<std::uint32_t>(__builtin_ctz(bits)));
    }
  }
}

}  // namespace

struct SphereWalk::Scratch {
  std::vector<SphereGroup> stack;
  SphereFrame spheres[SphereSteps::kFrames];
  Frame volumes[SphereSteps::kFrames];
  DeferredPairs<TreeSide, TreeSide> deferred;
};

bool SphereWalk::areBoxesApart() const {
  return facesApart(a_.volume(a_.root()), b_.volume(b_.root()), withSphereReach(a_, b_, b_in_a_));
}

SphereWalk::Scratch& SphereWalk::scratchOfThread() { return thread::ofThread<Scratch>(); }

bool SphereWalk::run(Visitor& visitor) {
  Scratch& s = scratchOfThread();
  SphereSteps steps(a_, b_, b_in_a_, s.spheres, s.volumes);
  steps.nearest_first = visitor.endsAtFirst();
  steps.cut = visitor.cut();
  return search(steps, s, visitor);
}

bool SphereWalk::search(SphereSteps& steps, Scratch& s, Visitor& visitor) const {
  bool has_grown;
  const auto start = [&] {
    s.deferred.clear();
    steps.depth = 0;
    pushWithRoom(steps, s.stack, a_.root(), b_.root());
    has_grown = false;
  };
  const auto grow = [&] {
    has_grown = true;
    s.deferred.grow(a_, b_, b_in_a_, visitor.endsAtFirst() || steps.cut != nullptr,
                    [&](const auto& pair) { pushWithRoom(steps, s.stack, pair.a, pair.b); });
  };
  start();
  for (;;) {
    switch (nextEvent(steps)) {
      case SphereSteps::kDone:
        if (steps.cut != nullptr) {
          s.deferred.dropIf([&](const auto& pair) { return steps.isBeyondCut(pair.a, pair.b); });
        }
        if (s.deferred.empty()) return false;
        grow();
        break;
      case SphereSteps::kDeferred:
        s.deferred.add({steps.pair[0], steps.pair[1]});
        // Now and not at the end: a hit is more likely below the nearest octants than elsewhere in the resident nodes.
        if (visitor.endsAtFirst() && s.deferred.fillsBatch()) {
          leaveFrames(steps);
          grow();
        }
        break;
      case SphereSteps::kLeaves:
        // A query that is asked again must grow nothing, and its walk visits in another order what has grown here: so
        // it walks from the root until nothing grows.
        if (visitor.endsAtFirst() && has_grown) {
          start();
        } else if (visitLeaves(steps, visitor)) {
          return true;
        }
    }
  }
}

SphereWalk::Outcome SphereWalk::walkResident(std::size_t batch, std::vector<tree::Tree::Growth>& growths) const {
  Scratch& s = scratchOfThread();
  SphereSteps steps(a_, b_, b_in_a_, s.spheres, s.volumes);
  s.deferred.clear();
  pushWithRoom(steps, s.stack, a_.root(), b_.root());
  for (;;) {
    switch (nextEvent(steps)) {
      case SphereSteps::kDone:
        if (s.deferred.empty()) return Outcome::kApart;
        s.deferred.addGrowths(a_, b_, b_in_a_, batch, growths);
        return Outcome::kNeedsGrowth;
      case SphereSteps::kDeferred:
        s.deferred.add({steps.pair[0], steps.pair[1]});
        break;
      case SphereSteps::kLeaves:
        return Outcome::kMeet;
    }
  }
}

bool SphereWalk::describe(oracle::DeviceWalks::Pair& pair) const {
  // Square roots of a device's float may be off by some ulp more.
  constexpr float kWider = 1.5f;
  const SphereFrames frames(b_in_a_);
  if (!std::isfinite(frames.rounding_margin) || (a_.tree().isDeepest(1) && b_.tree().isDeepest(1))) return false;
  const SideFrame& side = frames.side[1];
  std::copy_n(&side.to_other[0][0], 9, &pair.rotation[0][0]);
  std::copy_n(side.shift, 3, pair.shift);
  pair.unit = side.unit;
  pair.rounding_margin = kWider * frames.rounding_margin;
  pair.tolerance = frames.tolerance;
  pair.not_smaller = LevelRule::of(b_in_a_.scale).not_smaller;
  return true;
}

oracle::DeviceWalks::Tree SphereWalk::describe(const TreeSide& side, const tree::Tree::NodeTable& table) {
  oracle::DeviceWalks::Tree tree;
  tree.nodes = table.nodes;
  tree.blocks = table.blocks;
  tree.root = table.root;
  tree.deepest = static_cast<std::uint32_t>(side.tree().deepest());
  std::copy_n(side.tree().surface().lattice.extent().data(), 3, tree.extent);
  return tree;
}

void SphereWalk::markUsed(const TreeSide& side, const oracle::DeviceWalks::Tree& tree) {
  forEachBit(tree.used, [&](std::uint32_t block) { side.tree().markUsed(block, side.now()); });
}

void SphereWalk::addWanted(const TreeSide& side, const oracle::DeviceWalks::Tree& tree,
                           std::vector<tree::Tree::Growth>& growths) {
  forEachBit(tree.wanted, [&](std::uint32_t bit) {
    const std::uint32_t block = bit / 8;
    const auto octant = static_cast<int>(bit % 8);
    const bool is_root = bit == 8 * tree.blocks;
    // A device that errs must not make nodes of what is empty.
    if (!is_root && (block >= tree.blocks || (side.tree().block(block).grey >> octant & 1) == 0)) return;
    const tree::NodeRef node = is_root ? side.root() : tree::NodeRef::octant(block, octant);
    if (side.state(node) == State::kGrows) side.grow(node, growths);
  });
}

bool SphereWalk::visitLeaves(const SphereSteps& steps, Visitor& visitor) const {
  const auto leaf = [](const TreeSide& side, tree::NodeRef node) {
    return CellLeaf{side.cellId(node), side.cellSphere(node)};
  };
  CellLeaf leaves[2];
  const int x = steps.expanded, y = 1 - x;
  const auto set = [&](int side, tree::NodeRef node) {
    leaves[side] = leaf(side == 0 ? a_ : b_, node);
    if (side == 1) leaves[1].sphere = placed(leaves[1].sphere, b_in_a_);
  };
  set(y, steps.pair[y]);
  for (unsigned mask = steps.mask; mask != 0; mask &= mask - 1) {
    set(x, tree::NodeRef::octant(steps.pair[x].block(), __builtin_ctz(mask)));
    if (visitor.cells(leaves[0], leaves[1])) return true;
  }
  return false;
}

}  // namespace bocst::query
