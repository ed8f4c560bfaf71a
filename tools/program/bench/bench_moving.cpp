// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <chrono>
#include <functional>
#include <numeric>

#include "bench/bench_scenarios.h"
#include "pairs/sliding_path.h"

namespace bocst::program {
namespace {

constexpr std::chrono::nanoseconds kFrame{1000000000 / 60};

/// One way along the path with new models; microseconds.
struct Run {
  double build = 0;
  std::vector<double> frames;
  std::vector<bool> verdicts;
};

template <typename Make>
Run follow(const std::vector<Eigen::Isometry3d>& path, Make&& make, const std::function<void()>& tick) {
  Run run;
  const Stopwatch build_watch;
  const std::unique_ptr<const QueryPair> pair = make();
  run.build = build_watch.microseconds();
  for (const Eigen::Isometry3d& X_AB : path) {
    const Stopwatch watch;
    run.verdicts.push_back(pair->touch(X_AB));
    run.frames.push_back(watch.microseconds());
    tick();
  }
  return run;
}

/// The least of all runs, frame by frame: every run does the same work, and what the machine does beside is not meant.
class Best {
 public:
  void add(const Run& run) {
    if (frames_.empty()) {
      build_ = run.build;
      frames_ = run.frames;
      verdicts_ = run.verdicts;
    }
    build_ = std::min(build_, run.build);
    for (std::size_t i = 0; i < frames_.size(); ++i) frames_[i] = std::min(frames_[i], run.frames[i]);
    raw_worst_ = std::max(raw_worst_, *std::max_element(run.frames.begin() + 1, run.frames.end()));
    if (run.verdicts != verdicts_) throw std::runtime_error("the same query had a different answer later");
  }

  double first() const { return build_ + frames_.front(); }
  std::vector<double> rest() const { return {frames_.begin() + 1, frames_.end()}; }
  double total() const { return std::accumulate(frames_.begin(), frames_.end(), build_); }
  double rawWorst() const { return raw_worst_; }
  const std::vector<bool>& verdicts() const { return verdicts_; }

 private:
  double build_ = 0;
  std::vector<double> frames_;
  std::vector<bool> verdicts_;
  double raw_worst_ = 0;
};

Run followWithBocst(const BenchSetting& setting, const std::vector<Eigen::Isometry3d>& path) {
  Clock::time_point now{std::chrono::hours(1)};
  Options options;
  options.clock = [&now] { return now; };
  HandedOver a(*setting.meshA()), b(*setting.meshB());
  return follow(
      path, [&] { return makeBocstPair(std::move(a), std::move(b), options); }, [&now] { now += kFrame; });
}

}  // namespace

void benchMoving(BenchSetting& setting, BenchReport& report) {
  const std::vector<Eigen::Isometry3d> path = slidingPath(*setting.meshA(), *setting.meshB(), *setting.makeBocst(),
                                                          setting.request().seed, setting.request().frames);
  Best ours, theirs;
  Progress progress("moving: round", setting.request().rounds);
  for (std::size_t round = 0; round < setting.request().rounds; ++round) {
    theirs.add(follow(
        path, [&] { return setting.makeFcl(); }, [] {}));
    ours.add(followWithBocst(setting, path));
    progress.step();
  }
  report.verdicts(ours.verdicts(), theirs.verdicts(), path);

  const auto compare = [&](const std::string& key, const std::string& name, double bocst, double fcl) {
    report.compare(key, name, BenchRow::Unit::kMicroseconds, bocst, fcl);
  };
  const std::vector<double> rest = ours.rest(), fcl_rest = theirs.rest();
  compare("moving_first", "first frame, new models included", ours.first(), theirs.first());
  compare("moving_worst", "worst frame after it", quantile(rest, 1), quantile(fcl_rest, 1));
  compare("moving_p999", "frames after it, 99.9th percentile", quantile(rest, 0.999), quantile(fcl_rest, 0.999));
  compare("moving_median", "frames after it, median", quantile(rest, 0.5), quantile(fcl_rest, 0.5));
  compare("moving_total", "all frames, new models included", ours.total(), theirs.total());
  compare("moving_raw_worst", "worst frame of a single round", ours.rawWorst(), theirs.rawWorst());
  const auto touching = [](const std::vector<bool>& verdicts) {
    return static_cast<double>(std::count(verdicts.begin(), verdicts.end(), true));
  };
  const auto worst = static_cast<std::size_t>(std::max_element(rest.begin(), rest.end()) - rest.begin()) + 1;
  report.set("moving", {{"worst_frame", worst}});
  report.note("moving: bocst's worst frame after the first is number " + std::to_string(worst));
  report.figure("moving_touching", "frames that touch", BenchRow::Unit::kFrames, touching(ours.verdicts()),
                touching(theirs.verdicts()));
}

}  // namespace bocst::program
