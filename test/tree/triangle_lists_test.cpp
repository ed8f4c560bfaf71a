// SPDX-License-Identifier: BSD-3-Clause
#include "tree/triangle_lists.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "meshes.h"
#include "oracle/oracle.h"
#include "tree/bulk.h"

namespace bocst::tree {
namespace {

using Ids = std::vector<std::uint32_t>;

Ids idsOf(const TriangleLists& lists, std::uint32_t list) {
  Ids ids;
  lists[list].appendTo(ids);
  return ids;
}

TEST(TriangleLists, AreReadAsTheyWereWrittenAndCopied) {
  const std::uint32_t most = 0xffffffffu;
  std::vector<Ids> all = {{},           {0},    {most},       {most, 0}, {0, 0xffff},        {0x10000, 0},
                          {5, 0x10004}, {5, 6}, {7, 7, 7, 7}, {9, 8},    {0x20000, 0x10001}, {most, most - 9}};
  std::mt19937 g(5);
  for (int i = 0; i < 2000; ++i) {
    Ids ids(g() % (i % 100 == 0 ? 5000 : 40));
    const std::uint32_t span = 1u << g() % 31, least = static_cast<std::uint32_t>(g()) % (most - span);
    for (auto& id : ids) id = least + static_cast<std::uint32_t>(g()) % span;
    all.push_back(ids);
  }
  TriangleLists lists, copies;
  std::vector<std::uint32_t> at, copied;
  for (const Ids& ids : all) at.push_back(lists.add(ids.data(), ids.size()));
  for (const std::uint32_t list : at) copied.push_back(copies.addCopy(lists, list));
  for (std::size_t i = 0; i < all.size(); ++i) {
    ASSERT_EQ(idsOf(lists, at[i]), all[i]);
    ASSERT_EQ(idsOf(copies, copied[i]), all[i]);
    ASSERT_FALSE(lists.isOnDevice(at[i]));
    ASSERT_TRUE(lists[at[i]].ids.areKnown());
  }
}

TEST(TriangleLists, NearNumbersTakeTwoBytes) {
  TriangleLists near, far;
  Ids ids(1000);
  for (int i = 0; i < 200; ++i) {
    for (auto& id : ids) id = 3000000 + static_cast<std::uint32_t>(&id - ids.data());
    near.add(ids.data(), ids.size());
    ids[500] = 1;
    far.add(ids.data(), ids.size());
  }
  EXPECT_LT(near.bytes(), 1.15 * 2 * 200 * 1000);
  EXPECT_GT(far.bytes(), 4 * 200 * 1000);
}

struct FakeResource : oracle::DeviceResource {
  std::size_t bytes() const override { return 100; }
};

TEST(TriangleLists, PackedAndKeptOnesGoAlongWithCopies) {
  const test::Raw raw = test::torus(30);
  const auto mesh = raw.mesh();
  const oracle::Surface surface{mesh, lattice::Lattice(mesh->bounds(), Subdivision::kBono, 0)};
  TriangleLists lists, copies;
  std::mt19937 g(6);
  std::vector<std::shared_ptr<const oracle::DeviceResource>> resources(5);
  for (auto& resource : resources) resource = std::make_shared<const FakeResource>();
  for (std::uint32_t i = 0; i < 300; ++i) {
    const auto& resource = resources[i % resources.size()];
    Ids ids(1 + g() % PackedTriangles::kMostTriangles);
    for (auto& id : ids) id = static_cast<std::uint32_t>(g() % mesh->triangleCount());
    BulkBuilder bulk;
    bulk.build(surface, ids.data(), ids.size(), surface.latticeBounds());
    PackedTriangles::Words words;
    const std::size_t size = bulk.pack(0, static_cast<std::uint32_t>(ids.size()), words);
    const std::uint32_t plain = lists.add(ids.data(), ids.size()),
                        packed = lists.addPacked(ids.data(), ids.size(), words, size),
                        kept = lists.addDeviceList(1000 * i, {resource, 7 * i}), copy = copies.addCopy(lists, packed),
                        kept_copy = copies.addCopy(lists, kept);
    PackedTriangles no, first, second;
    ASSERT_FALSE(lists.packed(plain, no));
    ASSERT_TRUE(lists.packed(packed, first));
    ASSERT_TRUE(copies.packed(copy, second));
    ASSERT_EQ(idsOf(lists, plain), ids);
    ASSERT_EQ(idsOf(lists, packed), ids);
    ASSERT_EQ(idsOf(copies, copy), ids);
    ASSERT_EQ(first.count, ids.size());
    ASSERT_EQ(first.words(), second.words());
    ASSERT_EQ(first.step, second.step);
    ASSERT_TRUE(std::equal(first.steps, first.steps + 3 * first.places, second.steps));
    ASSERT_TRUE(std::equal(first.corners, first.corners + 3 * first.count, second.corners));
    ASSERT_TRUE(copies.isOnDevice(kept_copy));
    ASSERT_FALSE(copies[kept_copy].ids.areKnown());
    ASSERT_EQ(copies[kept_copy].count, 1000 * i);
    ASSERT_EQ(copies.place(kept_copy).resource, resource);
    ASSERT_EQ(copies.place(kept_copy).begin, 7 * i);
  }
}

TEST(TriangleLists, HoldTheResourcesThatTheyName) {
  const auto first = std::make_shared<const FakeResource>(), second = std::make_shared<const FakeResource>();
  TriangleLists lists, copies;
  const std::uint32_t list = lists.addDeviceList(10, {first, 1});
  lists.addDeviceList(20, {second, 2});
  lists.addDeviceList(30, {first, 3});
  EXPECT_EQ(lists.deviceBytes(), 200u);
  EXPECT_EQ(first.use_count(), 2);
  copies.addCopy(lists, list);
  EXPECT_EQ(copies.deviceBytes(), 100u);
  lists.swap(copies);
  copies.clear();
  EXPECT_EQ(copies.deviceBytes(), 0u);
  EXPECT_EQ(first.use_count(), 2);
  EXPECT_EQ(second.use_count(), 1);
}

TEST(TriangleLists, RefuseMoreThanTheyCanCount) {
  TriangleLists lists;
  const auto resource = std::make_shared<const FakeResource>();
  EXPECT_THROW(lists.addDeviceList(std::size_t{1} << 29, {resource, 0}), std::length_error);
  EXPECT_NO_THROW(lists.addDeviceList((std::size_t{1} << 29) - 1, {resource, 0}));
}

}  // namespace
}  // namespace bocst::tree
