// SPDX-License-Identifier: BSD-3-Clause
// Pairs of ids against the standard library's set, in queries of changing size.
#include "query/leaf/pair_set.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <limits>
#include <random>
#include <set>
#include <utility>

namespace bocst::query {
namespace {

template <typename Id>
class PairSets : public testing::Test {};
using Ids = testing::Types<std::uint32_t, std::uint64_t>;
TYPED_TEST_SUITE(PairSets, Ids);

TYPED_TEST(PairSets, TellNewPairsFromOldOnes) {
  using Id = TypeParam;
  PairSet<Id> set;
  std::mt19937_64 g(1);
  std::size_t again = 0;
  // Large queries after small ones and back, so that it grows and shrinks; the same pairs come in several of them.
  for (const std::size_t count :
       {0u, 1u, 5000u, 3u, 0u, 40000u, 10u, 10u, 10u, 10u, 10u, 10u, 10u, 3000u, 200u, 150000u, 100u, 3000u}) {
    set.clear();
    std::set<std::pair<Id, std::uint32_t>> want;
    for (std::size_t i = 0; i < count; ++i) {
      const auto a = static_cast<Id>(g() % 300), b = static_cast<Id>(g() % 300);
      const bool is_new = want.insert({a, static_cast<std::uint32_t>(b)}).second;
      ASSERT_EQ(set.insert(a, static_cast<std::uint32_t>(b)), is_new) << "pair " << i << " of " << count;
      again += !is_new;
    }
  }
  EXPECT_GT(again, 10000u);
}

TYPED_TEST(PairSets, HoldIdsOfAnySize) {
  using Id = TypeParam;
  const Id most = std::numeric_limits<Id>::max();
  const std::uint32_t last = std::numeric_limits<std::uint32_t>::max() - 1;  // of as many triangles as there can be
  PairSet<Id> set;
  for (int query = 0; query < 3; ++query) {
    set.clear();
    for (const Id a : {Id{0}, Id{1}, static_cast<Id>(most / 2), static_cast<Id>(most - 1), most}) {
      for (const std::uint32_t b : {0u, 1u, last / 2, last - 1, last}) {
        EXPECT_TRUE(set.insert(a, b)) << a << " " << b;
        EXPECT_FALSE(set.insert(a, b)) << a << " " << b;
      }
    }
  }
}

// Many triangles about one place: their pairs want the same cache lines.
TYPED_TEST(PairSets, TakeNeighboursAllWithAll) {
  PairSet<TypeParam> set;
  for (int time = 0; time < 2; ++time) {
    for (std::uint32_t a = 0; a < 300; ++a) {
      for (std::uint32_t b = 1000; b < 1300; ++b) ASSERT_EQ(set.insert(a, b), time == 0) << a << " " << b;
    }
  }
}

}  // namespace
}  // namespace bocst::query
