// SPDX-License-Identifier: BSD-3-Clause
#include "log/log.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <memory>
#include <stdexcept>
#include <thread>
#include <utility>
#include <vector>

#include "thread_group.h"

namespace bocst {
namespace {

class Log : public testing::Test {
 protected:
  ~Log() override { setLogger({}); }
};

TEST_F(Log, GoesToTheLoggerAndByDefaultToStderr) {
  std::vector<std::pair<LogLevel, std::string>> seen;
  setLogger([&seen](LogLevel level, const std::string& message) { seen.emplace_back(level, message); });
  testing::internal::CaptureStderr();
  log(LogLevel::kWarning, "a device is lost");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  ASSERT_EQ(seen.size(), 1u);
  EXPECT_EQ(seen[0].first, LogLevel::kWarning);
  EXPECT_EQ(seen[0].second, "a device is lost");

  setLogger({});
  testing::internal::CaptureStderr();
  log(LogLevel::kError, "50 % of nothing: %s");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "bocst: 50 % of nothing: %s\n");
  EXPECT_EQ(seen.size(), 1u);
}

TEST_F(Log, WhatALoggerThrowsIsIgnored) {
  int calls = 0;
  setLogger([&calls](LogLevel, const std::string&) {
    ++calls;
    throw std::runtime_error("disk full");
  });
  log(LogLevel::kInfo, "one");
  log(LogLevel::kInfo, "two");
  EXPECT_EQ(calls, 2);
}

// Another thread of the parent may hold the lock at the fork.
TEST_F(Log, WorksInAChildOfAProcessThatReports) {
  setLogger([](LogLevel, const std::string&) {});
  const std::string message = "again";
  std::atomic<bool> stop{false};
  test::ThreadGroup threads(3, [&](std::size_t) {
    while (!stop) log(LogLevel::kInfo, message);
  });
  int failed = 0;
  for (int i = 0; i < 300; ++i) {
    const pid_t child = fork();
    if (child == 0) {
      alarm(20);
      log(LogLevel::kInfo, message);
      _exit(0);
    }
    int status = 0;
    EXPECT_EQ(waitpid(child, &status, 0), child);
    failed += status != 0;
    if (failed > 0) break;
  }
  stop = true;
  threads.join();
  EXPECT_EQ(failed, 0);
}

TEST_F(Log, MayBeReplacedWhileOthersReport) {
  std::atomic<int> first{0}, second{0};
  std::atomic<bool> stop{false};
  setLogger([&first](LogLevel, const std::string&) { ++first; });
  test::ThreadGroup threads(3, [&stop](std::size_t) {
    while (!stop) log(LogLevel::kInfo, "again");
  });
  while (first == 0) std::this_thread::yield();
  for (int i = 0; i < 200; ++i) {
    setLogger([&second](LogLevel, const std::string&) { ++second; });
    setLogger([&first](LogLevel, const std::string&) { ++first; });
  }
  setLogger([&second](LogLevel, const std::string&) { ++second; });
  const int before = second;
  while (second == before) std::this_thread::yield();
  stop = true;
  threads.join();
  EXPECT_GT(first, 0);
  EXPECT_GT(second, 0);
}

TEST_F(Log, TheFormerLoggerIsDestroyed) {
  auto held = std::make_shared<int>(1);
  setLogger([held](LogLevel, const std::string&) {});
  EXPECT_EQ(held.use_count(), 2);
  setLogger({});
  EXPECT_EQ(held.use_count(), 1);
}

}  // namespace
}  // namespace bocst
