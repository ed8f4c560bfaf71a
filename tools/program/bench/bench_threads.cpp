// SPDX-License-Identifier: BSD-3-Clause
#include <sched.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <thread>

#include "bench/bench_scenarios.h"

namespace bocst::program {
namespace {

/// That this process may use, as taskset says; std::thread::hardware_concurrency() may count all that there are.
int processors() {
  cpu_set_t set;
  return ::sched_getaffinity(0, sizeof(set), &set) == 0 ? CPU_COUNT(&set)
                                                        : static_cast<int>(std::thread::hardware_concurrency());
}

/// Microseconds from when all threads are there until the last is done. `work` gets the number of its thread.
double timeThreads(std::size_t count, const std::function<void(std::size_t)>& work) {
  std::atomic<std::size_t> waiting{count};
  std::atomic<bool> go{false};
  std::vector<std::thread> threads;
  for (std::size_t i = 0; i < count; ++i) {
    threads.emplace_back([&, i] {
      --waiting;
      while (!go) std::this_thread::yield();
      work(i);
    });
  }
  while (waiting > 0) std::this_thread::yield();
  const Stopwatch watch;
  go = true;
  for (std::thread& thread : threads) thread.join();
  return watch.microseconds();
}

/// Asks one pair about all poses, from several threads at once.
class Questions {
 public:
  explicit Questions(BenchSetting& setting) : X_ABs_(setting.queryTransforms()), expected_(setting.queryVerdicts()) {}

  /// Each thread asks all poses several times, and each begins elsewhere. @return queries a second.
  double rate(const QueryPair& pair, std::size_t threads, std::size_t passes) {
    const std::size_t n = X_ABs_.size();
    const double time = timeThreads(threads, [&](std::size_t thread) {
      for (std::size_t i = 0; i < passes * n; ++i) ask(pair, (i + thread * n / threads) % n);
    });
    return 1e6 * static_cast<double>(threads * passes * n) / time;
  }

  /// The threads share the poses. @return microseconds.
  double once(const QueryPair& pair, std::size_t threads) {
    return timeThreads(threads, [&](std::size_t thread) {
      for (std::size_t i = thread; i < X_ABs_.size(); i += threads) ask(pair, i);
    });
  }

  /// The number of passes that take long enough to be timed.
  std::size_t passesFor(const QueryPair& pair) {
    constexpr double kMicroseconds = 2e4;
    return static_cast<std::size_t>(std::ceil(kMicroseconds / once(pair, 1)));
  }

  bool asExpected() const { return wrong_ == 0; }

 private:
  void ask(const QueryPair& pair, std::size_t i) {
    if (pair.touch(X_ABs_[i]) != expected_[i]) ++wrong_;
  }

  const std::vector<Eigen::Isometry3d>& X_ABs_;
  const std::vector<bool>& expected_;
  std::atomic<std::size_t> wrong_{0};
};

/// The best of all rounds: whatever else runs on the machine takes a processor from two threads first.
struct Rates {
  double one = 0, two = 0;

  void measure(Questions& questions, const QueryPair& pair, std::size_t passes) {
    one = std::max(one, questions.rate(pair, 1, passes));
    two = std::max(two, questions.rate(pair, 2, passes));
  }
};

void benchWarmThreads(BenchSetting& setting, BenchReport& report, Questions& questions) {
  const std::unique_ptr<BocstPair> pair = setting.makeBocst();
  warmUp(*pair, setting.queryTransforms());
  const std::size_t passes = questions.passesFor(*pair), fcl_passes = questions.passesFor(setting.fcl());
  Rates ours, theirs;
  Progress progress("threads: round", setting.request().rounds);
  for (std::size_t round = 0; round < setting.request().rounds; ++round) {
    theirs.measure(questions, setting.fcl(), fcl_passes);
    ours.measure(questions, *pair, passes);
    progress.step();
  }
  report.compare("threads_one", "one thread, warm", BenchRow::Unit::kQueriesPerSecond, ours.one, theirs.one);
  report.compare("threads_two", "two threads, warm", BenchRow::Unit::kQueriesPerSecond, ours.two, theirs.two);
  report.compare("threads_gain", "two threads over one, warm", BenchRow::Unit::kTimes, ours.two / ours.one,
                 theirs.two / theirs.one);
}

void benchColdThreads(BenchSetting& setting, BenchReport& report, Questions& questions) {
  double alone = HUGE_VAL, together = HUGE_VAL;
  for (std::size_t round = 0; round < setting.request().rounds; ++round) {
    alone = std::min(alone, questions.once(*setting.makeBocst(), 1));
    together = std::min(together, questions.once(*setting.makeBocst(), 2));
  }
  report.figure("threads_cold_one", "one thread, all poses of new models", BenchRow::Unit::kMicroseconds, alone);
  report.figure("threads_cold_two", "two threads, the same", BenchRow::Unit::kMicroseconds, together, {},
                alone / together);
}

}  // namespace

void benchThreads(BenchSetting& setting, BenchReport& report) {
  if (processors() == 1) return report.skip("threads", "this process may use one processor only");
  Questions questions(setting);
  benchWarmThreads(setting, report, questions);
  benchColdThreads(setting, report, questions);
  report.mustBeEqual(questions.asExpected(), "verdicts");
}

}  // namespace bocst::program
