// SPDX-License-Identifier: BSD-3-Clause
// How many steps two walks get in turns, and what the next query of the same models remembers of the last.
#include "query/sides/turns.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>

#include "meshes.h"

namespace bocst::query {
namespace {

using Search = tree::Tree::Search;

constexpr Turns::Limits kLimits = {64, 1024, 2048, 4};

struct Pair {
  Pair() : a(test::torus(20).mesh(), options()), b(test::torus(16).mesh(), options()), side_a(a), side_b(b) {}
  static Options options() {
    Options o;
    o.ttl = std::chrono::milliseconds(0);
    return o;
  }
  void buildBoxes() {
    a.boxes(0);
    b.boxes(0);
  }
  Turns turns(Search kind = Search::kDistance) const { return {side_a, side_b, kind, kLimits}; }

  tree::Tree a, b;
  TreeSide side_a, side_b;
};

TEST(Turns, WalksPayForBoxes) {
  const Pair pair;
  const std::size_t price = pair.a.boxPrice() + pair.b.boxPrice();
  EXPECT_FALSE(Turns::arePaid(pair.side_a, pair.side_b));
  EXPECT_EQ(pair.turns().most(), std::max(kLimits.many, price));
  pair.turns().tookOverBlocks(kLimits.many, true);
  EXPECT_EQ(pair.a.boxPrice() + pair.b.boxPrice(), price) << "a short walk pays nothing";
  pair.turns().tookOverBlocks(kLimits.many + 100, true);
  EXPECT_EQ(pair.a.boxPrice() + pair.b.boxPrice(), price - 200) << "a long one pays for both";
}

TEST(Turns, EachIsSixteenTimesAsLong) {
  Pair pair;
  pair.buildBoxes();
  Turns turns = pair.turns();
  EXPECT_EQ(turns.most(), 64u);
  EXPECT_EQ(turns.mostOverBoxes(), 2048u);
  turns.next();
  EXPECT_EQ(turns.most(), 1024u);
  EXPECT_EQ(turns.mostOverBoxes(), 2048u);
  turns.next();
  EXPECT_EQ(turns.most(), 16384u);
  EXPECT_EQ(turns.mostOverBoxes(), 4096u);
}

TEST(Turns, WhatEndedTheLastLongSearchGetsMore) {
  Pair pair;
  pair.buildBoxes();
  pair.turns().endedOverBoxes(5000);
  EXPECT_EQ(pair.turns().most(), 20000u) << "as long as those boxes took";
  EXPECT_EQ(pair.turns().mostOverBoxes(), 10000u);
  EXPECT_EQ(pair.turns(Search::kYesOrNo).mostOverBoxes(), 2048u) << "of another kind";

  pair.turns().tookOverBlocks(50, false);
  EXPECT_EQ(pair.turns().mostOverBoxes(), 10000u) << "a short search says nothing";
  pair.turns().tookOverBlocks(kLimits.few + 6, false);
  EXPECT_EQ(pair.turns().mostOverBoxes(), 10000u) << "nor does a first turn: boxes were not tried";

  Turns second = pair.turns();
  second.next();
  second.tookOverBlocks(900, true);
  EXPECT_EQ(pair.turns().most(), 20000u) << "that one gave up";
  second.tookOverBlocks(7000, false);
  EXPECT_EQ(pair.turns().most(), 14000u);
  EXPECT_EQ(pair.turns().mostOverBoxes(), 3500u);
  pair.turns().tookOverBlocks(300, false);
  pair.turns().tookOverBlocks(300, false);
  EXPECT_EQ(pair.turns().most(), 600u) << "no longer than the last of these";
  pair.turns().tookOverBlocks(40, false);
  EXPECT_EQ(pair.turns().most(), 600u) << "a short one says nothing";

  pair.a.setLongSearch(Search::kDistance, {1, 1, 9000});
  EXPECT_EQ(pair.turns().most(), 64u) << "the two do not agree";
  EXPECT_EQ(pair.turns().mostOverBoxes(), 2048u);
  pair.b.setLongSearch(Search::kDistance, {1, 1, 4000});
  EXPECT_EQ(pair.turns().mostOverBoxes(), 8000u) << "the lesser of both";
}

// Of one pose that is asked again and again: what would have ended soon after it was given up, or is never begun.
TEST(Turns, NeitherWayIsGivenUpForEver) {
  Pair pair;
  pair.buildBoxes();
  const auto is_power_of_two = [](int n) { return n == 2 || n == 4 || n == 8 || n == 16 || n == 32; };
  for (int times = 1; times < 40; ++times) {
    pair.turns().endedOverBoxes(5000);
    EXPECT_EQ(pair.turns().most(), is_power_of_two(times) ? 40000u : 20000u) << times;
    EXPECT_EQ(pair.turns().mostOverBoxes(), 10000u);
  }
  Turns second = pair.turns();
  second.next();
  second.tookOverBlocks(8000, false);
  for (int times = 1; times < 40; ++times) {
    EXPECT_EQ(pair.turns().most(), is_power_of_two(times) ? 2000u : 16000u) << times;
    pair.turns().tookOverBlocks(8000, false);
  }
  for (int times = 1; times <= 2; ++times) pair.turns().endedOverBoxes(5000);
  EXPECT_EQ(pair.turns().most(), 40000u) << "counted from the last walk over blocks on";
}

// Parts that rested flat on one another are asked about in other poses, too: there boxes would take several times as
// long as blocks.
TEST(Turns, BlocksComeFirstHoweverShortTheLastWalkOverBoxes) {
  Pair pair;
  pair.buildBoxes();
  EXPECT_TRUE(Turns::arePaid(pair.side_a, pair.side_b));
  for (const Search kind : {Search::kYesOrNo, Search::kContacts, Search::kDistance}) {
    pair.turns(kind).endedOverBoxes(10);
    EXPECT_EQ(pair.turns(kind).most(), 40u) << "as long as those boxes took";
    EXPECT_EQ(pair.turns(kind).mostOverBoxes(), 2048u);
  }
}

TEST(Turns, BlocksGetNoMoreBeforeBoxesAreThere) {
  const Pair pair;
  for (const tree::Tree* tree : {&pair.a, &pair.b}) tree->setLongSearch(Search::kDistance, {0, 1, 1u << 29});
  EXPECT_EQ(pair.turns().most(), std::max(kLimits.many, pair.a.boxPrice() + pair.b.boxPrice()));
}

}  // namespace
}  // namespace bocst::query
