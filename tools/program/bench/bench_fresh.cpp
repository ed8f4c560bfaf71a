// SPDX-License-Identifier: BSD-3-Clause
// Poses that are asked once: what a planner asks.
#include <algorithm>
#include <array>
#include <chrono>

#include "bench/bench_scenarios.h"
#include "cli/report.h"
#include "pairs/poses.h"

namespace bocst::program {
namespace {

/// Windows and totals end after these numbers of poses.
constexpr std::array<std::size_t, 5> kWindows{100, 1000, 5000, 20000, 100000};
constexpr std::array<std::size_t, 6> kTotals{1, 100, 1000, 5000, 20000, 100000};
constexpr std::size_t kPosesInTurn = 50;  // poses that one side is asked before the other is

struct PoseTimes {
  std::vector<double> bocst, fcl;  // microseconds, by pose
};

double worst(const std::vector<double>& values) { return *std::max_element(values.begin(), values.end()); }

void addWindow(BenchReport& report, const PoseTimes& times, std::size_t begin, std::size_t end,
               const std::string& key_prefix, const std::string& name_prefix) {
  const auto part = [&](const std::vector<double>& all) {
    return std::vector<double>(all.begin() + static_cast<std::ptrdiff_t>(begin),
                               all.begin() + static_cast<std::ptrdiff_t>(end));
  };
  const std::vector<double> ours = part(times.bocst), theirs = part(times.fcl);
  const std::string key = key_prefix + std::to_string(end);
  const std::string name = name_prefix + "poses " + std::to_string(begin + 1) + " to " + std::to_string(end);
  const auto row = [&](const std::string& what, double bocst, double fcl) {
    report.compare(key + "_" + what, name + ", " + what, BenchRow::Unit::kMicroseconds, bocst, fcl);
  };
  row("mean", mean(ours), mean(theirs));
  row("median", quantile(ours, 0.5), quantile(theirs, 0.5));
  row("p99", quantile(ours, 0.99), quantile(theirs, 0.99));
  row("worst", worst(ours), worst(theirs));
}

/// Asks both sides each pose once, in turns, and compares their answers.
PoseTimes askInTurns(const BocstPair& bocst, const FclPair& fcl, const std::vector<Eigen::Isometry3d>& X_ABs,
                     BenchReport& report) {
  PoseTimes times;
  std::vector<bool> our_verdicts, fcl_verdicts;
  Progress progress("fresh: poses", X_ABs.size());
  for (std::size_t begin = 0; begin < X_ABs.size(); begin += kPosesInTurn) {
    const std::size_t end = std::min(begin + kPosesInTurn, X_ABs.size());
    const auto ask = [&](const QueryPair& pair, std::vector<double>& microseconds, std::vector<bool>& verdicts) {
      for (std::size_t i = begin; i < end; ++i) {
        const Stopwatch watch;
        const bool touch = pair.touch(X_ABs[i]);
        microseconds.push_back(watch.microseconds());
        verdicts.push_back(touch);
        if (&verdicts == &our_verdicts) progress.step();
      }
    };
    ask(fcl, times.fcl, fcl_verdicts);
    ask(bocst, times.bocst, our_verdicts);
  }
  report.verdicts(our_verdicts, fcl_verdicts, X_ABs);
  return times;
}

}  // namespace

void benchFresh(BenchSetting& setting, BenchReport& report) {
  const double fcl_build = setting.fclBuildTime();
  PoseSampler sampler(*setting.meshA(), *setting.meshB(), setting.fcl(), setting.request().seed + 1);
  std::vector<Eigen::Isometry3d> X_ABs;
  for (std::size_t i = 0; i < setting.request().poses; ++i) X_ABs.push_back(sampler.nextAnywhere().transform());

  // New models from arrays that they take over, and the microseconds that this takes.
  const auto make = [&](const Options& options, bool builds_trees) {
    HandedOver a(*setting.meshA()), b(*setting.meshB());
    const Stopwatch making;
    std::unique_ptr<BocstPair> pair = makeBocstPair(std::move(a), std::move(b), options);
    if (builds_trees) pair->buildTrees();
    return std::make_pair(std::move(pair), making.microseconds());
  };
  Options options;
  options.build_ahead = setting.request().build_ahead;
  const auto [bocst, bocst_build] = make(options, false);
  const PoseTimes times = askInTurns(*bocst, setting.fcl(), X_ABs, report);
  std::size_t begin = 0;
  for (const std::size_t window : kWindows) {
    const std::size_t end = std::min(window, X_ABs.size());
    if (end > begin) addWindow(report, times, begin, end, "fresh_", "");
    begin = end;
  }
  double ours = bocst_build, theirs = fcl_build;
  for (std::size_t i = 0; i < X_ABs.size(); ++i) {
    ours += times.bocst[i];
    theirs += times.fcl[i];
    const std::size_t asked = i + 1;
    if (std::find(kTotals.begin(), kTotals.end(), asked) == kTotals.end() && asked != X_ABs.size()) continue;
    report.compare("total_" + std::to_string(asked), "total from the arrays after " + std::to_string(asked),
                   BenchRow::Unit::kMicroseconds, ours, theirs);
  }
  report.figure("fresh_bytes", "tree bytes a triangle after them", BenchRow::Unit::kBytesPerTriangle,
                static_cast<double>(bocst->bytes()) / setting.triangles());

  // As a planner with a set-up would do it: the trees are built, and kept.
  options = Options();
  options.ttl = std::chrono::milliseconds(0);
  const auto [built, set_up] = make(options, true);
  const std::string built_name = "trees built first, ";
  report.compare("built_set_up", built_name + "from the arrays", BenchRow::Unit::kMicroseconds, set_up, fcl_build);
  const PoseTimes built_times = askInTurns(*built, setting.fcl(), X_ABs, report);
  const std::size_t first = std::min(kWindows.front(), X_ABs.size());
  addWindow(report, built_times, 0, first, "built_", built_name);
  if (first < X_ABs.size()) addWindow(report, built_times, first, X_ABs.size(), "built_", built_name);
}

}  // namespace bocst::program
