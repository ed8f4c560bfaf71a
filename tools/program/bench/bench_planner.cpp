// SPDX-License-Identifier: BSD-3-Clause
// What a planner asks: an arm of seven joints and a hand among shelves and scans, under FCL's broad phase.
#include <algorithm>
#include <array>
#include <chrono>
#include <tuple>

#include "bench/bench_scenarios.h"
#include "cli/report.h"
#include "planner/arm_world.h"
#include "planner/managed_arm.h"

namespace bocst::program {
namespace {

using Joints = ArmWorld::Joints;
using States = std::vector<ArmWorld::Poses>;

constexpr std::size_t kStatesInTurn = 500;  // states, or pairs, that one side is asked before the other is: a planner
                                            // uses one, and in short turns each evicts the other's data from the caches
constexpr std::size_t kMostPairs = 4000;    // that are timed one by one
constexpr double kNearGap = 0.02;           // metres: nearer misses are near ones
constexpr std::size_t kSettle = 4;          // times that states are asked before they are timed as settled
constexpr std::size_t kPayingPasses = 700;  // over all pairs: this many walks pay for a scan of 350 000 triangles
constexpr std::size_t kFlushed = 200;       // pairs that are asked with flushed caches
constexpr double kRest = 20;                // seconds, more than the default ttl
constexpr std::size_t kMarginTurns = 5;     // passes over all states
constexpr std::size_t kRests = 200;         // states that are each asked after a rest

enum class Kind { kFar, kNear, kHit };
constexpr std::array<const char*, 3> kKindNames{"far misses", "near misses", "hits"};
constexpr std::array<const char*, 3> kKindKeys{"far", "near", "hit"};

/// What the clock itself takes.
double clockOverhead() {
  std::vector<double> samples(1000);
  for (double& sample : samples) sample = Stopwatch().microseconds();
  return quantile(samples, 0.5);
}

struct Both {
  std::unique_ptr<ManagedArm> fcl;
  std::unique_ptr<BocstManagedArm> bocst;
};

struct StateTimes {
  double bocst = 0, fcl = 0;
  std::vector<bool> bocst_hits, fcl_hits;
};

/// Asks both sides each state in turns.
template <typename Ask>
StateTimes timeStates(Both& arms, const States& states, const Ask& ask) {
  StateTimes times;
  for (std::size_t begin = 0; begin < states.size(); begin += kStatesInTurn) {
    const std::size_t end = std::min(begin + kStatesInTurn, states.size());
    const auto turn = [&](ManagedArm& arm, double& microseconds, std::vector<bool>& hits) {
      const Stopwatch watch;
      for (std::size_t i = begin; i < end; ++i) hits.push_back(ask(arm, states[i]));
      microseconds += watch.microseconds();
    };
    turn(*arms.fcl, times.fcl, times.fcl_hits);
    turn(*arms.bocst, times.bocst, times.bocst_hits);
  }
  times.bocst /= static_cast<double>(states.size());
  times.fcl /= static_cast<double>(states.size());
  return times;
}

StateTimes timeStates(Both& arms, const States& states) {
  return timeStates(arms, states, [](ManagedArm& arm, const ArmWorld::Poses& X_WL) { return arm.collides(X_WL); });
}

States randomStates(const ArmWorld& world, Random& random, std::size_t count) {
  States states;
  for (std::size_t i = 0; i < count; ++i) states.push_back(world.posesAt(ArmWorld::randomJoints(random)));
  return states;
}

/// Edges from states that are free, one after the other, up to the first that collides, as a planner extends a tree.
States edgeStates(const ArmWorld& world, ManagedArm& arm, Random& random, std::size_t count) {
  States states;
  while (states.size() < count) {
    const Joints from = ArmWorld::randomJoints(random), to = ArmWorld::randomJoints(random);
    if (arm.collides(world.posesAt(from))) continue;
    for (const Joints& q : ArmWorld::edge(from, to)) {
      states.push_back(world.posesAt(q));
      if (states.size() == count || arm.collides(states.back())) break;
    }
  }
  return states;
}

/// The report's rows about one size of links.
class PlannerBench {
 public:
  PlannerBench(BenchReport& report, const ArmWorld& world, std::size_t triangles, Random& random,
               const BenchRequest& request)
      : report_(report),
        world_(world),
        prefix_("planner_" + std::to_string(triangles) + "_"),
        name_(std::to_string(triangles) + " triangles a link, "),
        random_states_(randomStates(world, random, request.poses)) {
    const Stopwatch fcl_watch;
    arms_.fcl = manageFclArm(world);
    const double fcl = fcl_watch.microseconds();
    const Stopwatch bocst_watch;
    Options options;
    options.build_ahead = request.build_ahead;
    arms_.bocst = manageBocstArm(world, options);
    set_up_ = {bocst_watch.microseconds(), fcl};
    fcl_set_up_ = fcl;
    row("set_up", "set-up", set_up_.first, set_up_.second);
    edge_states_ = edgeStates(world, *arms_.fcl, random, request.poses);
  }

  void run() {
    states("random", "random states", random_states_);
    states("edge", "states of edges", edge_states_);
    built();
    outside("random", "random states", random_states_);
    outside("edge", "states of edges", edge_states_);
    pairs();
    copied();
    atRest();
    withMargin();
    conservative();
  }

 private:
  void row(const std::string& key, const std::string& name, double bocst, double fcl) {
    report_.compare(prefix_ + key, name_ + name, BenchRow::Unit::kMicroseconds, bocst, fcl);
  }
  void share(const std::string& key, const std::string& name, double value) {
    report_.figure(prefix_ + key, name_ + name, BenchRow::Unit::kTimes, value);
  }

  void states(const std::string& key, const std::string& name, const States& states) {
    for (const char* when : {"fresh", "again"}) {
      const StateTimes times = timeStates(arms_, states);
      report_.verdicts(times.bocst_hits, times.fcl_hits);
      row(key + "_" + when, name + ", " + when, times.bocst, times.fcl);
      set_up_.first += times.bocst * static_cast<double>(states.size());
      set_up_.second += times.fcl * static_cast<double>(states.size());
    }
    row(key + "_total", "set-up and all states so far", set_up_.first, set_up_.second);
  }

  /// The same states of new models whose trees are built, and kept, by the set-up, as FCL's are.
  void built() {
    Options options;
    options.ttl = std::chrono::milliseconds(0);
    const Stopwatch watch;
    Both arms;
    arms.bocst = manageBocstArm(world_, options);
    arms.bocst->buildTrees();
    row("built_set_up", "trees built first, set-up", watch.microseconds(), fcl_set_up_);
    arms.fcl = std::move(arms_.fcl);
    const auto fresh = [&](const std::string& key, const std::string& name, const States& states) {
      const StateTimes times = timeStates(arms, states);
      report_.verdicts(times.bocst_hits, times.fcl_hits);
      row("built_" + key, "trees built first, " + name + ", fresh", times.bocst, times.fcl);
    };
    fresh("random", "random states", random_states_);
    fresh("edge", "states of edges", edge_states_);
    arms_.fcl = std::move(arms.fcl);
  }

  /// The part of FCL's time for a state that no narrow phase can take away.
  void outside(const std::string& key, const std::string& name, const States& states) {
    double narrow = 0;
    const Stopwatch watch;
    for (const ArmWorld::Poses& X_WL : states) arms_.fcl->collides(X_WL, nullptr, &narrow);
    share("outside_" + key, "share of FCL's time outside the narrow phase, " + name, 1 - narrow / watch.microseconds());
  }

  Kind kindOf(const AskedPair& pair) const {
    if (arms_.fcl->touch(pair)) return Kind::kHit;
    return arms_.fcl->distance(pair) < kNearGap ? Kind::kNear : Kind::kFar;
  }

  static void settle(const BocstManagedArm& arm, const std::vector<AskedPair>& asked) {
    const auto askAll = [&] {
      for (const AskedPair& pair : asked) arm.touch(pair);
    };
    // A tree that seems to grow no more is built as a whole once enough walks have paid for it.
    for (std::size_t i = 0; i < kPayingPasses; ++i) askAll();
    warmUp([&arm] { return arm.growth(); }, askAll);
  }

  /// Pairs as the broad phase gives them, asked one by one until nothing grows, then timed.
  void pairs() {
    std::vector<AskedPair> asked;
    for (std::size_t i = 0; i < random_states_.size() && asked.size() < kMostPairs; ++i) {
      arms_.fcl->collides(random_states_[i], &asked);
      arms_.fcl->collides(edge_states_[i], &asked);
    }
    std::vector<double> ours(asked.size()), theirs(asked.size());
    settle(*arms_.bocst, asked);
    const double overhead = clockOverhead();
    for (std::size_t begin = 0; begin < asked.size(); begin += kStatesInTurn) {
      const std::size_t end = std::min(begin + kStatesInTurn, asked.size());
      const auto turn = [&](const ManagedArm& arm, std::vector<double>& times) {
        for (std::size_t i = begin; i < end; ++i) {
          const Stopwatch watch;
          arm.touch(asked[i]);
          times[i] = std::max(watch.microseconds() - overhead, 0.001);
        }
      };
      turn(*arms_.fcl, theirs);
      turn(*arms_.bocst, ours);
    }
    std::array<std::vector<double>, 3> our_kinds, their_kinds;
    for (std::size_t i = 0; i < asked.size(); ++i) {
      const auto kind = static_cast<std::size_t>(kindOf(asked[i]));
      our_kinds[kind].push_back(ours[i]);
      their_kinds[kind].push_back(theirs[i]);
    }
    for (std::size_t k = 0; k < 3; ++k) {
      if (our_kinds[k].empty()) continue;
      pairRows(kKindKeys[k], kKindNames[k], our_kinds[k], their_kinds[k]);
      share(std::string("share_") + kKindKeys[k], std::string("share of pairs that are ") + kKindNames[k],
            static_cast<double>(our_kinds[k].size()) / static_cast<double>(asked.size()));
    }
    pairRows("pairs", "all pairs", ours, theirs);
    flushed(asked);
  }

  void pairRows(const std::string& key, const std::string& name, const std::vector<double>& ours,
                const std::vector<double>& theirs) {
    report_.compareTimes(prefix_ + key, name_ + name, ours, theirs);
    row(key + "_p99", name + ", p99", quantile(ours, 0.99), quantile(theirs, 0.99));
    row(key + "_worst", name + ", worst", *std::max_element(ours.begin(), ours.end()),
        *std::max_element(theirs.begin(), theirs.end()));
    std::size_t slower = 0, tails = 0;
    for (std::size_t i = 0; i < ours.size(); ++i) {
      slower += ours[i] > theirs[i];
      tails += ours[i] > 2 * theirs[i] + 1;
    }
    const auto count = static_cast<double>(ours.size());
    share(key + "_slower", name + ", share slower than FCL", static_cast<double>(slower) / count);
    share(key + "_tails", name + ", share slower than twice FCL's time + 1 us", static_cast<double>(tails) / count);
  }

  /// The same pairs where between two questions something else has taken all caches. The models' clock stands still:
  /// nothing decays while memory is written.
  void flushed(const std::vector<AskedPair>& asked) {
    Options options;
    options.clock = [now = Clock::now()] { return now; };
    const auto bocst = manageBocstArm(world_, options);
    settle(*bocst, asked);
    std::vector<char> memory(std::size_t{1} << 28);
    double ours = 0, theirs = 0;
    const std::size_t count = std::min(kFlushed, asked.size());
    for (std::size_t i = 0; i < count; ++i) {
      for (const bool is_bocst : {false, true}) {
        for (std::size_t k = 0; k < memory.size(); k += 64) ++memory[k];
        const AskedPair& pair = asked[i * (asked.size() / count)];
        const Stopwatch watch;
        (is_bocst ? static_cast<const ManagedArm&>(*bocst) : *arms_.fcl).touch(pair);
        (is_bocst ? ours : theirs) += watch.microseconds();
      }
    }
    row("flushed", "pairs with flushed caches, mean", ours / static_cast<double>(count),
        theirs / static_cast<double>(count));
  }

  void copied() {
    const StateTimes times = timeStates(arms_, random_states_, [](ManagedArm& arm, const ArmWorld::Poses& X_WL) {
      return arm.collidesWithNewObjects(X_WL);
    });
    report_.verdicts(times.bocst_hits, times.fcl_hits);
    row("copied", "random states, new objects for each state", times.bocst, times.fcl);
  }

  /// Each state is the first after a rest.
  void atRest() {
    std::vector<double> ours, theirs;
    for (std::size_t i = 0; i < std::min(kRests, random_states_.size()); ++i) {
      const ArmWorld::Poses& X_WL = random_states_[i];
      arms_.bocst->rest(kRest);
      const Stopwatch watch;
      arms_.bocst->collides(X_WL);
      ours.push_back(watch.microseconds());
      const Stopwatch fcl_watch;
      arms_.fcl->collides(X_WL);
      theirs.push_back(fcl_watch.microseconds());
    }
    const std::string what = "first state after " + formatPlain(kRest) + " s at rest, ";
    row("rest_mean", what + "mean", mean(ours), mean(theirs));
    for (const auto& [key, name, q] :
         {std::make_tuple("rest_p95", "95th percentile", 0.95), std::make_tuple("rest_worst", "worst", 1.0)}) {
      row(key, what + name, quantile(ours, q), quantile(theirs, q));
    }
  }

  /// Beside the time that the same models take without a margin.
  void withMargin() {
    Options options;
    options.margin = 0.005;
    const auto with = manageBocstArm(world_, options);
    const auto once = [this](ManagedArm& arm) {
      const Stopwatch watch;
      for (const ArmWorld::Poses& X_WL : random_states_) arm.collides(X_WL);
      return watch.microseconds() / static_cast<double>(random_states_.size());
    };
    for (BocstManagedArm* arm : {with.get(), arms_.bocst.get()}) {
      warmUp([arm] { return arm->growth(); }, [&] { once(*arm); });
    }
    // In turns: what one took out of the caches costs the other as much.
    std::vector<double> margins, others;
    for (std::size_t i = 0; i < kMarginTurns; ++i) {
      margins.push_back(once(*with));
      others.push_back(once(*arms_.bocst));
    }
    const double with_margin = quantile(margins, 0.5), without = quantile(others, 0.5);
    report_.figure(prefix_ + "margin", name_ + "random states, margin 10 mm between two models",
                   BenchRow::Unit::kMicroseconds, with_margin, {}, without / with_margin);
  }

  /// Must miss nothing; how often it says "may touch" where exact answers say no.
  void conservative() {
    for (int depth = 4; depth <= 8; ++depth) {
      Options options;
      options.answer = Answer::kConservative;
      options.depth = depth;
      Both arms;
      arms.fcl = std::move(arms_.fcl);
      arms.bocst = manageBocstArm(world_, options);
      for (std::size_t i = 0; i < kSettle; ++i) timeStates(arms, random_states_);
      const StateTimes times = timeStates(arms, random_states_);
      arms_.fcl = std::move(arms.fcl);
      const std::string key = "depth_" + std::to_string(depth), name = "conservative, depth " + std::to_string(depth);
      row(key, name + ", random states, settled", times.bocst, times.fcl);
      std::size_t missed = 0, alarms = 0, free = 0;
      for (std::size_t i = 0; i < times.fcl_hits.size(); ++i) {
        missed += times.fcl_hits[i] && !times.bocst_hits[i];
        alarms += !times.fcl_hits[i] && times.bocst_hits[i];
        free += !times.fcl_hits[i];
      }
      report_.mustBeEqual(missed == 0, name + ": states that collide but were reported free");
      share(key + "_alarms", name + ", free states that may touch",
            free > 0 ? static_cast<double>(alarms) / static_cast<double>(free) : 0);
    }
  }

  BenchReport& report_;
  const ArmWorld& world_;
  const std::string prefix_, name_;
  Both arms_;
  States random_states_, edge_states_;
  std::pair<double, double> set_up_;  // and the states that were asked since, microseconds
  double fcl_set_up_ = 0;             // microseconds
};

}  // namespace

void benchPlanner(BenchSetting& setting, BenchReport& report) {
  for (const std::size_t triangles : {std::size_t{200}, std::size_t{20000}}) {
    Random random(setting.request().seed);
    const ArmWorld world(triangles, {setting.meshA(), setting.meshB()}, setting.request().seed);
    PlannerBench(report, world, triangles, random, setting.request()).run();
  }
}

}  // namespace bocst::program
