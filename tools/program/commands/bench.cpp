// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "bench/bench_oracles.h"
#include "bench/bench_scenarios.h"
#include "cli/arguments.h"

namespace bocst::program {
namespace {

struct Scenario {
  const char* name;
  void (*run)(BenchSetting&, BenchReport&);
  bool by_default;
};

/// In the order in which they run.
constexpr Scenario kScenarios[] = {
    {"first", benchFirst, true},      {"fresh", benchFresh, true},        {"cliffs", benchCliffs, false},
    {"warm", benchWarm, true},        {"contacts", benchContacts, false}, {"distance", benchDistance, true},
    {"memory", benchMemory, true},    {"moving", benchMoving, false},     {"deforming", benchDeforming, false},
    {"threads", benchThreads, false}, {"growth", benchGrowth, false},     {"planner", benchPlanner, false},
};
constexpr const char* kAll = "all";

std::vector<std::string> namesOf(bool by_default) {
  std::vector<std::string> names;
  for (const Scenario& scenario : kScenarios) {
    if (!by_default || scenario.by_default) names.emplace_back(scenario.name);
  }
  return names;
}

std::vector<std::string> choices() {
  std::vector<std::string> names = namesOf(false);
  names.emplace_back(kAll);
  return names;
}

struct Bench {
  BenchRequest request;
  std::vector<std::string> scenarios = namesOf(true);
  std::vector<std::size_t> sizes;  ///< Empty: as each command has them.
  std::string csv_file;
  Output output;
  bool of_oracles = false;
  OracleBench oracles;

  bool asksFor(const std::string& name) const {
    const auto has = [this](const std::string& wanted) {
      return std::find(scenarios.begin(), scenarios.end(), wanted) != scenarios.end();
    };
    return has(name) || has(kAll);
  }

  int run() const {
    output.check({request.file_a, request.file_b}, {csv_file});
    return of_oracles ? runOracles() : runScenarios();
  }

  int runOracles() const {
    OracleBench bench = oracles;
    bench.file = request.file_a;
    if (!sizes.empty()) bench.sizes = sizes;
    bench.pose_count = request.poses;
    return bench.run(output);
  }

  int runScenarios() const {
    BenchRequest full = request;
    if (!sizes.empty()) full.sizes = sizes;
    BenchSetting setting(full);
    BenchReport report;
    Json names = Json::array();
    for (const Scenario& scenario : kScenarios) {
      if (!asksFor(scenario.name)) continue;
      names.push_back(scenario.name);
      report.begin(scenario.name);
      scenario.run(setting, report);
    }
    write(setting, report, names);
    report.check();
    return 0;
  }

  void write(const BenchSetting& setting, const BenchReport& report, const Json& names) const {
    if (output.wantsJson()) output.write(report.json(head(setting, names)));
    if (!csv_file.empty()) writeText(csv_file, report.csv());
    if (!output.wantsJson() && csv_file.empty()) report.print();
  }

  Json head(const BenchSetting& setting, const Json& names) const {
    Json head = {{"a", request.file_a},
                 {"b", request.file_b.empty() ? request.file_a : request.file_b},
                 {"triangles", {setting.meshA()->triangleCount(), setting.meshB()->triangleCount()}},
                 {"poses", request.poses},
                 {"seed", request.seed},
                 {"rounds", request.rounds},
                 {"build_ahead", request.build_ahead},
                 {"scenarios", names}};
    head["hits"] = setting.hits() ? Json(*setting.hits()) : Json(nullptr);
    head["oracle"] = setting.oracleName();
    return head;
  }
};

void addSizes(CLI::App& command, Bench& bench) {
  command
      .add_option("--subdivide", bench.request.subdivide,
                  "divide each triangle into four, this number of times, before the measurements")
      ->check(CLI::Range(0, 6))
      ->capture_default_str();
  command
      .add_option("--triangles", bench.sizes,
                  "approximate triangle counts for growth and --oracles; default: 10000,100000,1000000,10000000; with "
                  "--oracles: 5000,75000,1000000,10000000")
      ->check(wholeNumber())
      ->delimiter(',')
      ->allow_extra_args(false);
}

void addOracleBench(CLI::App& command, Bench& bench) {
  command.add_flag("--oracles", bench.of_oracles,
                   "measure instead each oracle of this machine on mesh A, subdivided to several sizes");
  command
      .add_option(
          "--limit", bench.oracles.limit_seconds,
          "with --oracles: an oracle that takes longer than this (seconds) to grow a tree is left out at larger "
          "sizes")
      ->check(positive())
      ->capture_default_str();
}

// What a reader must know of each scenario.
const char* const kOfScenarios =
    "A ratio above 1 means that bocst is better. For times and memory it is FCL's value divided by bocst's. The\n"
    "meshes touch in about two of three poses.\n"
    "first: two new models and one query, from vertex and index arrays; FCL copies the arrays, bocst moves them\n"
    "in. The streaming pass reads both meshes once, which is the least that any method must do: it adds up all\n"
    "vertices through the index arrays.\n"
    "fresh: each pose is queried once, in turns of 50 poses with bocst and with FCL. FCL's trees are built\n"
    "before; the totals include their build time. 20000 poses fill four of the five windows. trees built first:\n"
    "the same poses after Model::buildTree(), with ttl 0.\n"
    "cliffs: difficult meshes that the program makes itself: flat plates close to each other, cones tip to tip,\n"
    "rods, needles, equal triangles, fans and specks. The files do not matter.\n"
    "warm, contacts, distance: the poses are queried until the trees grow no more, and once more before each\n"
    "turn. In contacts and distance the models' clock stands still, because FCL's turn can take longer than\n"
    "ttl.\n"
    "memory: heap is the memory of both models as the allocator reports it, including mesh copies.\n"
    "moving: one mesh slides over the other, with 60 frames per second on the models' clock. The time of a frame\n"
    "is the minimum of all rounds.\n"
    "deforming: all vertices of A move, then 10 queries follow.\n"
    "threads: two threads query one pair of models; the best of all rounds counts. The last ratio is the time\n"
    "with one thread divided by the time with two threads.\n"
    "planner: an arm with seven joints and a hand, with links of 200 and of 20000 triangles, among shelves and\n"
    "three copies of each mesh, in FCL's DynamicAABBTreeCollisionManager. As many random states as poses are\n"
    "checked, and as many states of edges. fresh: first query of a state; again: second query of the same.\n"
    "trees built first: the same states, for models whose trees are built in the set-up, as FCL's are. Pairs\n"
    "are those that pass the broad phase; they are measured one by one after the trees have settled.\n"
    "growth: A against itself, without FCL. Ratios compare with the first size: growth of the triangle count\n"
    "(first answer) or of its logarithm (warm query), divided by the growth of the time; above 1, the time\n"
    "grows more slowly.";

}  // namespace

void addBench(CLI::App& program, Job& job) {
  auto bench = std::make_shared<Bench>();
  CLI::App* command =
      program.add_subcommand("bench", "measure time and memory, compared with FCL's BVHModel<OBBRSS> in one run");
  command->footer(kOfScenarios);
  command->add_option("a", bench->request.file_a, std::string("A: ") + kMeshFile)->required();
  command->add_option("b", bench->request.file_b, "B: mesh file; default: A");
  command->add_option("--scenarios", bench->scenarios, "scenarios to measure, separated by commas")
      ->check(CLI::IsMember(choices()))
      ->delimiter(',')
      ->allow_extra_args(false)
      ->capture_default_str();
  command
      ->add_option("--poses", bench->request.poses,
                   "number of random poses; with --oracles: of one call of collidePoses")
      ->check(wholeNumber())
      ->capture_default_str();
  command->add_option("--seed", bench->request.seed, "the same seed gives the same poses")
      ->check(wholeNumber(0))
      ->capture_default_str();
  command
      ->add_option("--rounds", bench->request.rounds,
                   "repetitions: number of first answers, and number of passes over all poses and frames")
      ->check(wholeNumber())
      ->capture_default_str();
  command->add_option("--frames", bench->request.frames, "number of frames of the path in the scenario moving")
      ->check(CLI::Range(2, 10000000))
      ->capture_default_str();
  command->add_flag("--build-ahead", bench->request.build_ahead,
                    "fresh, planner: a thread builds the trees while the first queries run; it needs a free core");
  addSizes(*command, *bench);
  addOracleBench(*command, *bench);
  addJson(*command, bench->output);
  command->add_option("--csv", bench->csv_file, "write the rows as CSV to this file; - is stdout")
      ->type_name("FILE|-")
      ->check(outputFile(".csv", true));
  command->callback([bench, command, &job] {
    checkStdout(bench->csv_file, bench->output);
    const auto measures = [&](const char* name) { return !bench->of_oracles && bench->asksFor(name); };
    for (const char* option : {"--csv", "--scenarios", "b"}) {
      refuseUnless(!bench->of_oracles, *command, option, "not available with --oracles");
    }
    refuseUnless(bench->of_oracles, *command, "--limit", "needs --oracles");
    refuseUnless(measures("moving"), *command, "--frames", "needs --scenarios moving");
    refuseUnless(measures("fresh") || measures("planner"), *command, "--build-ahead",
                 "needs --scenarios fresh or planner");
    refuseUnless(bench->of_oracles || measures("growth"), *command, "--triangles",
                 "needs --scenarios growth or --oracles");
    job = [bench] { return bench->run(); };
  });
}

}  // namespace bocst::program
