// SPDX-License-Identifier: BSD-3-Clause
// The loop over steps meets the same pairs in whatever order it takes them, on every instruction set that the dispatch
// can choose, and leaves what is still implicit for last.
#include <gtest/gtest.h>

#include <set>
#include <utility>
#include <vector>

#include "every_target.h"
#include "meshes.h"
#include "query/collide/tree_steps.h"
#include "query/sides/side.h"

namespace bocst::query {
namespace {

class Steps : public test::EveryTarget {};

// A walk over two trees, without the tests at its bottom.
class Walk {
 public:
  Walk(tree::Tree& a, tree::Tree& b, const SimilarityTransform& b_in_a, bool all_at_once)
      : side_a_(a),
        side_b_(b),
        frames_(PairSteps::kFrames),
        stack_(PairSteps::kStackRoom + 1),
        steps_(side_a_, side_b_, PairFrames(b_in_a), frames_.data()) {
    steps_.stack = stack_.data();
    steps_.stack_end = stack_.data() + stack_.size();
    steps_.all_at_once = all_at_once;
    pushPair(steps_, tree::NodeRef(), tree::NodeRef());
  }

  // Up to the next pair that is not a larger leaf with a smaller node.
  StepEvent::Kind next() {
    for (;;) {
      nextEvent(steps_, event_);
      if (event_.kind != StepEvent::kLargeTriangles) return event_.kind;
      pushOctants(steps_, event_, event_.mask);
    }
  }
  tree::NodeRef node(int side) const { return event_.pair[side].node; }

 private:
  const TreeSide side_a_, side_b_;
  std::vector<Frame> frames_;
  std::vector<StepGroup> stack_;
  PairSteps steps_;
  StepEvent event_;
};

SimilarityTransform placed(const Eigen::Matrix3d& R, double scale, const Eigen::Vector3d& displacement) {
  const Eigen::Vector3d middle = Eigen::Vector3d::Constant(lattice::kMiddle);
  SimilarityTransform to;
  to.rotation = R;
  to.scale = scale;
  to.translation = middle + displacement - scale * (R * middle);
  to.ready();
  return to;
}

using Met = std::set<std::pair<std::uint32_t, std::uint32_t>>;

TEST_P(Steps, MeetTheSamePairsInEitherOrder) {
  std::mt19937_64 g(41);
  tree::Tree a(test::torus(60, 0.2).mesh(), Options()), b(test::torus(25, 0.3).mesh(), Options());
  a.expandAll(6);
  b.expandAll(4);  // b is deferred in places
  std::size_t leaves = 0, deferrals = 0;
  for (int i = 0; i < 60; ++i) {
    const double scale = i % 2 ? 1 : 0.4;
    const SimilarityTransform to = placed(test::randomRotation(g), scale, test::randomDirection(g) * 2000 * (g() % 30));
    Met met[2], aside[2];
    for (const bool all_at_once : {false, true}) {
      Walk walk(a, b, to, all_at_once);
      for (StepEvent::Kind event = walk.next(); event != StepEvent::kDone; event = walk.next()) {
        Met& of = (event == StepEvent::kLeaves ? met : aside)[all_at_once];
        EXPECT_TRUE(of.insert({walk.node(0).bits, walk.node(1).bits}).second) << "a pair came twice";
      }
    }
    ASSERT_EQ(met[0], met[1]) << i;
    ASSERT_EQ(aside[0], aside[1]) << i;
    leaves += met[0].size();
    deferrals += aside[0].size();
  }
  EXPECT_GT(leaves, 1000u);
  EXPECT_GT(deferrals, 100u);
}

TEST_P(Steps, LeaveWhatIsImplicitForLast) {
  // A root grid knows the octants of a's root, of which one at a time is grown.
  const test::Raw raw = test::torus(100, 0.2);
  tree::Tree b(test::torus(40, 0.2).mesh(), Options());
  b.expandAll(5);
  std::mt19937_64 g(42);
  std::size_t both = 0;
  for (int o = 0; o < 8; ++o) {
    tree::Tree a(raw.mesh(), Options());
    const auto grow = [&a](tree::NodeRef node) {
      std::vector<tree::Tree::Growth> batch{{&a, node, true}};
      tree::Tree::grow(batch);
    };
    grow(tree::NodeRef());
    const tree::Block& root = a.block(a.childRef(tree::NodeRef()).index());
    if ((root.grey >> o & 1) == 0) continue;
    const tree::NodeRef grown = tree::NodeRef::octant(a.childRef(tree::NodeRef()).index(), o);
    ASSERT_EQ(a.childRef(grown).tag(), tree::ChildRef::kImplicit);
    grow(grown);
    ASSERT_EQ(a.childRef(grown).tag(), tree::ChildRef::kBlock);
    for (int i = 0; i < 20; ++i) {
      Walk walk(a, b, placed(test::randomRotation(g), 1, test::randomDirection(g) * 9000), false);
      bool late = false;
      std::size_t of_grown = 0;
      for (StepEvent::Kind event = walk.next(); event != StepEvent::kDone; event = walk.next()) {
        const bool of_root = walk.node(0).block() == grown.block();
        late |= of_root;
        of_grown += !of_root;
        ASSERT_FALSE(late && !of_root) << "octant " << o << " pose " << i;
      }
      both += late && of_grown > 0;
    }
  }
  EXPECT_GT(both, 20u);
}

INSTANTIATE_TEST_SUITE_P(Targets, Steps, testing::ValuesIn(test::EveryTarget::targets()), test::EveryTarget::name);

}  // namespace
}  // namespace bocst::query
