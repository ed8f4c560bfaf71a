// SPDX-License-Identifier: BSD-3-Clause
// Who is in a query lock together, and who is not.
#include "thread/sharded_lock.h"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <chrono>
#include <mutex>
#include <shared_mutex>
#include <thread>
#include <vector>

namespace bocst::thread {
namespace {

TEST(ShardedLock, ReadersSeeWhatWritersWroteWhole) {
  ShardedLock sharded_lock;
  // No atomics: without the query lock's order this is a data race, and the sums differ.
  std::array<int, 64> numbers{};
  std::atomic<bool> done{false};
  std::atomic<int> torn{0};
  const auto read = [&] {
    while (!done) {
      const std::shared_lock<ShardedLock> lock(sharded_lock);
      for (const int n : numbers) torn += n != numbers[0];
    }
  };
  std::vector<std::thread> readers;
  for (int i = 0; i < 3; ++i) readers.emplace_back(read);
  const auto write = [&](int rounds, bool only_try) {
    for (int i = 0; i < rounds; ++i) {
      std::unique_lock<ShardedLock> alone(sharded_lock, std::defer_lock);
      if (!only_try) {
        alone.lock();
      } else if (!alone.try_lock()) {
        continue;
      }
      for (int& n : numbers) ++n;
    }
  };
  std::thread tries([&] { write(20000, true); });
  write(500, false);  // ends, though readers keep coming
  tries.join();
  done = true;
  for (std::thread& r : readers) r.join();
  EXPECT_EQ(torn, 0);
  EXPECT_GE(numbers[0], 500);
}

TEST(ShardedLock, WritersWaitUntilReadersHaveLeft) {
  ShardedLock sharded_lock;
  std::atomic<bool> in{false};
  sharded_lock.lock_shared();
  std::thread writer([&] {
    const std::lock_guard<ShardedLock> alone(sharded_lock);
    in = true;
  });
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_FALSE(in);
  sharded_lock.unlock_shared();
  writer.join();
  EXPECT_TRUE(in);
}

TEST(ShardedLock, NobodyIsBesideAWriter) {
  ShardedLock sharded_lock;
  std::atomic<int> readers{0}, writers{0}, met{0};
  std::atomic<bool> done{false};
  const auto read = [&] {
    while (!done) {
      const std::shared_lock<ShardedLock> lock(sharded_lock);
      ++readers;
      for (int i = 0; i < 20; ++i) met += writers != 0;
      --readers;
    }
  };
  const auto write = [&](bool only_try) {
    while (!done) {
      std::unique_lock<ShardedLock> alone(sharded_lock, std::defer_lock);
      if (!only_try) {
        alone.lock();
      } else if (!alone.try_lock()) {
        continue;
      }
      met += ++writers != 1;
      for (int i = 0; i < 200; ++i) met += readers != 0;
      --writers;
    }
  };
  std::vector<std::thread> threads;
  for (int i = 0; i < 2; ++i) threads.emplace_back(read);
  threads.emplace_back(write, true);
  threads.emplace_back(write, false);
  std::this_thread::sleep_for(std::chrono::seconds(2));
  done = true;
  for (std::thread& t : threads) t.join();
  EXPECT_EQ(met, 0);
}

TEST(ShardedLock, TryingGivesUpWhereOthersAre) {
  ShardedLock sharded_lock;
  const auto tried = [&sharded_lock] {
    bool had = false;
    std::thread([&] {
      const std::unique_lock<ShardedLock> alone(sharded_lock, std::try_to_lock);
      had = alone.owns_lock();
    }).join();
    return had;
  };
  EXPECT_TRUE(tried());
  sharded_lock.lock_shared();
  EXPECT_FALSE(tried());
  sharded_lock.lock_shared();
  sharded_lock.unlock_shared();
  EXPECT_FALSE(tried()) << "one reader is left";
  sharded_lock.unlock_shared();
  EXPECT_TRUE(tried());
  sharded_lock.lock();
  EXPECT_FALSE(tried());
  sharded_lock.unlock();
  EXPECT_TRUE(tried());
}

// Readers that come between the two looks of a writer that tries.
TEST(ShardedLock, TryingSeesReadersThatComeMeanwhile) {
  ShardedLock sharded_lock;
  std::atomic<bool> done{false};
  std::atomic<int> readers{0};
  std::thread reader([&] {
    for (unsigned i = 0; !done; ++i) {
      sharded_lock.lock_shared();
      ++readers;
      --readers;
      sharded_lock.unlock_shared();
      for (std::atomic<unsigned> wait{i % 16}; wait > 0;) --wait;
    }
  });
  int met = 0, had = 0;
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(4);
  while (std::chrono::steady_clock::now() < end && met == 0) {
    for (int i = 0; i < 1000; ++i) {
      if (!sharded_lock.try_lock()) continue;
      ++had;
      for (int k = 0; k < 10; ++k) met += readers != 0;
      sharded_lock.unlock();
    }
  }
  done = true;
  reader.join();
  EXPECT_EQ(met, 0);
  EXPECT_GT(had, 0);
}

TEST(ShardedLock, ReadersWaitForTheWriter) {
  ShardedLock sharded_lock;
  int value = 0;
  sharded_lock.lock();
  std::vector<std::thread> readers;
  std::atomic<int> seen{0};
  for (int i = 0; i < 20; ++i) {  // more than there are counts
    readers.emplace_back([&] {
      const std::shared_lock<ShardedLock> lock(sharded_lock);
      seen += value;
    });
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  EXPECT_EQ(seen, 0);
  value = 1;
  sharded_lock.unlock();
  for (std::thread& r : readers) r.join();
  EXPECT_EQ(seen, 20);
}

}  // namespace
}  // namespace bocst::thread
