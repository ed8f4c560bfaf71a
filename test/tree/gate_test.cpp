// SPDX-License-Identifier: BSD-3-Clause
// Who is in a gate together, and who is not.
#include "tree/gate.h"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <chrono>
#include <mutex>
#include <shared_mutex>
#include <thread>
#include <vector>

namespace bocst::tree {
namespace {

TEST(Gate, ReadersSeeWhatWritersWroteWhole) {
  Gate gate;
  // No atomics: without the gate's order this is a data race, and the sums differ.
  std::array<int, 64> numbers{};
  std::atomic<bool> done{false};
  std::atomic<int> torn{0};
  const auto read = [&] {
    while (!done) {
      const std::shared_lock<Gate> look(gate);
      for (const int n : numbers) torn += n != numbers[0];
    }
  };
  std::vector<std::thread> readers;
  for (int i = 0; i < 3; ++i) readers.emplace_back(read);
  const auto write = [&](int rounds, bool only_try) {
    for (int i = 0; i < rounds; ++i) {
      std::unique_lock<Gate> alone(gate, std::defer_lock);
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

TEST(Gate, TryingGivesUpWhereOthersAre) {
  Gate gate;
  const auto tried = [&gate] {
    bool had = false;
    std::thread([&] {
      const std::unique_lock<Gate> alone(gate, std::try_to_lock);
      had = alone.owns_lock();
    }).join();
    return had;
  };
  EXPECT_TRUE(tried());
  gate.lock_shared();
  EXPECT_FALSE(tried());
  gate.lock_shared();
  gate.unlock_shared();
  EXPECT_FALSE(tried()) << "one reader is left";
  gate.unlock_shared();
  EXPECT_TRUE(tried());
  gate.lock();
  EXPECT_FALSE(tried());
  gate.unlock();
  EXPECT_TRUE(tried());
}

TEST(Gate, ReadersWaitForTheWriter) {
  Gate gate;
  int value = 0;
  gate.lock();
  std::vector<std::thread> readers;
  std::atomic<int> seen{0};
  for (int i = 0; i < 20; ++i) {  // more than there are counts
    readers.emplace_back([&] {
      const std::shared_lock<Gate> look(gate);
      seen += value;
    });
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  EXPECT_EQ(seen, 0);
  value = 1;
  gate.unlock();
  for (std::thread& r : readers) r.join();
  EXPECT_EQ(seen, 20);
}

}  // namespace
}  // namespace bocst::tree
