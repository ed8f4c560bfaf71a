// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>
#include <pthread.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cstddef>
#include <future>
#include <memory>
#include <system_error>
#include <thread>
#include <vector>

#include "thread/helper_thread.h"
#include "thread/start.h"
#include "thread/thread_pool.h"

namespace bocst::thread {
namespace {

TEST(HelperThread, CallsJobsInOrderInOneOtherThread) {
  std::vector<int> order;  // no lock: one thread writes, and the promise orders what is read
  std::vector<std::thread::id> threads;
  std::promise<void> done;
  for (int i = 0; i < 100; ++i) {
    runInHelperThread([&, i] {
      order.push_back(i);
      threads.push_back(std::this_thread::get_id());
      if (i == 99) done.set_value();
    });
  }
  done.get_future().wait();
  for (int i = 0; i < 100; ++i) {
    EXPECT_EQ(order[static_cast<std::size_t>(i)], i);
    EXPECT_EQ(threads[static_cast<std::size_t>(i)], threads[0]);
  }
  EXPECT_NE(threads[0], std::this_thread::get_id());
}

bool takesNoSignals() {
  sigset_t mask;
  pthread_sigmask(SIG_SETMASK, nullptr, &mask);
  return sigismember(&mask, SIGINT) == 1 && sigismember(&mask, SIGTERM) == 1;
}

TEST(HelperThread, TakesNoSignals) {
  std::promise<bool> blocked;
  runInHelperThread([&] { blocked.set_value(takesNoSignals()); });
  EXPECT_TRUE(blocked.get_future().get());
  EXPECT_FALSE(takesNoSignals()) << "the caller still does";
}

TEST(ThreadPool, ItsThreadsTakeNoSignals) {
  ThreadPool pool(3);
  ASSERT_EQ(pool.threads(), 3u);
  const std::thread::id caller = std::this_thread::get_id();
  std::atomic<int> blocked{0};
  pool.run([&] { blocked += std::this_thread::get_id() != caller && takesNoSignals(); });
  EXPECT_EQ(blocked, 2);
  EXPECT_FALSE(takesNoSignals()) << "the caller still does";
}

TEST(StartWithoutSignals, LeavesTheCallersMaskWhenThereIsNoThread) {
  pthread_attr_t before, huge;
  ASSERT_EQ(pthread_getattr_default_np(&before), 0);
  ASSERT_EQ(pthread_attr_init(&huge), 0);
  ASSERT_EQ(pthread_attr_setstacksize(&huge, std::size_t{1} << 50), 0);
  ASSERT_EQ(pthread_setattr_default_np(&huge), 0);
  EXPECT_THROW(startWithoutSignals([] {}), std::system_error);
  EXPECT_FALSE(takesNoSignals());
  EXPECT_EQ(ThreadPool(3).threads(), 1u) << "the caller works alone";
  ASSERT_EQ(pthread_setattr_default_np(&before), 0);
  pthread_attr_destroy(&huge);
  pthread_attr_destroy(&before);
}

// Also while the parent's thread is at work, and has more to do.
TEST(HelperThread, AChildHasItsOwn) {
  std::promise<void> begun, go;
  runInHelperThread([&] {
    begun.set_value();
    go.get_future().wait();
  });
  const auto waiting = std::make_shared<int>(0);
  runInHelperThread([waiting] { ++*waiting; });
  begun.get_future().wait();
  const pid_t child = fork();
  if (child == 0) {
    alarm(60);
    std::promise<int> answer;
    runInHelperThread([&] { answer.set_value(42); });
    const bool good = answer.get_future().get() == 42 && *waiting == 0;
    _exit(good ? 0 : 1);
  }
  int status = -1;
  waitpid(child, &status, 0);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
  go.set_value();
  std::promise<void> after;
  runInHelperThread([&] { after.set_value(); });
  after.get_future().wait();
  EXPECT_EQ(*waiting, 1);
}

// In a process of its own: one job never gets its turn, the other is waited for.
TEST(HelperThreadDeathTest, EndsWithTheProcess) {
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  EXPECT_EXIT(
      {
        std::promise<void> begun;
        runInHelperThread([&] {
          begun.set_value();
          std::this_thread::sleep_for(std::chrono::milliseconds(50));
          std::fputs("ended", stderr);
        });
        runInHelperThread([] { std::fputs("NEVER", stderr); });
        begun.get_future().wait();
        std::exit(7);
      },
      testing::ExitedWithCode(7), "^ended$");
}

}  // namespace
}  // namespace bocst::thread
