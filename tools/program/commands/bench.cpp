// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <algorithm>
#include <iterator>
#include <memory>
#include <stdexcept>
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
                 {"scenarios", names}};
    head["hits"] = setting.hits() ? Json(*setting.hits()) : Json(nullptr);
    head["oracle"] = setting.oracleName();
    return head;
  }
};

void addSizes(CLI::App& command, Bench& bench) {
  command.add_option("--subdivide", bench.request.subdivide, "first divide each triangle into four so many times")
      ->check(CLI::Range(0, 6))
      ->capture_default_str();
  command
      .add_option(
          "--triangles", bench.sizes,
          "the sizes that growth and --oracles come near to; without it 10k, 100k, 1 M and 10 M, with --oracles "
          "5k, 75k, 1 M and 10 M")
      ->check(positive())
      ->delimiter(',')
      ->allow_extra_args(false);
}

void addOracleBench(CLI::App& command, Bench& bench) {
  command.add_flag("--oracles", bench.of_oracles,
                   "instead: each oracle of this machine on mesh A, subdivided to several sizes");
  command
      .add_option("--limit", bench.oracles.limit_seconds,
                  "with --oracles: seconds; an oracle that needs more to grow a tree is left out from there on")
      ->check(positive())
      ->capture_default_str();
}

}  // namespace

void addBench(CLI::App& program, Job& job) {
  auto bench = std::make_shared<Bench>();
  CLI::App* command =
      program.add_subcommand("bench", "time and memory, compared with FCL's BVHModel<OBBRSS> in one run");
  command->footer(
      "Ratios are FCL's figure over bocst's: above 1 bocst is better. About two poses of three touch.\n"
      "first: two new models and one query, from vertex and index arrays, which FCL copies and bocst takes over; the "
      "streaming pass adds up all vertices through the index arrays.\n"
      "fresh: each pose is asked once, 50 at a time on each side in turn; FCL's trees are built before, and count in "
      "the totals. Ask for 20000 poses to see all windows.\n"
      "cliffs: rods, needles, equal triangles, fans and specks, whatever the files are.\n"
      "warm, contacts, distance: the poses were asked until nothing grew any more, and once more before each turn; in "
      "contacts and distance, where FCL's turn is longer than ttl, the models' clock stands still.\n"
      "memory: heap is what the allocator says that both models hold, mesh copies included.\n"
      "moving: one mesh slides over the other at 60 frames a second of the models' clock; of each frame the least of "
      "all rounds counts.\n"
      "deforming: all vertices of A move, then 10 queries.\n"
      "threads: two on one pair of models, the best of all rounds; the last ratio is one thread's time over that of "
      "two.\n"
      "planner: an arm of seven joints and a hand, with links of 200 and of 20000 triangles, among shelves and three "
      "of "
      "each mesh, in FCL's DynamicAABBTreeCollisionManager; --poses random states and as many of edges. fresh: asked "
      "for the first time; again: once more. Pairs are those that the broad phase lets through, one by one and "
      "settled.\n"
      "growth: A with itself, without FCL; ratios are the growth of the triangles (first answer) or of their logarithm "
      "(warm query) over that of the time, since the first size.");
  command->add_option("a", bench->request.file_a, std::string("A: ") + kMeshFile)->required();
  command->add_option("b", bench->request.file_b, "mesh B; A again if not given");
  command->add_option("--scenarios", bench->scenarios, "what is measured")
      ->check(CLI::IsMember(choices()))
      ->delimiter(',')
      ->allow_extra_args(false)
      ->capture_default_str();
  command->add_option("--poses", bench->request.poses, "number of random poses")
      ->check(positive())
      ->capture_default_str();
  command->add_option("--seed", bench->request.seed, "the same seed gives the same poses")->capture_default_str();
  command->add_option("--rounds", bench->request.rounds, "first answers, and rounds over all poses and frames")
      ->check(positive())
      ->capture_default_str();
  command->add_option("--frames", bench->request.frames, "of the path of moving")
      ->check(CLI::Range(2, 10000000))
      ->capture_default_str();
  addSizes(*command, *bench);
  addOracleBench(*command, *bench);
  addJson(*command, bench->output);
  command->add_option("--csv", bench->csv_file, "write the rows as CSV into this file, or to stdout with -")
      ->type_name("FILE|-");
  command->callback([bench, &job] {
    if (bench->csv_file == "-" && bench->output.json_file == "-") {
      throw CLI::ValidationError("--csv", "stdout is taken by --json");
    }
    if (bench->of_oracles && !bench->csv_file.empty()) {
      throw CLI::ValidationError("--csv", "--oracles has none");
    }
    job = [bench] { return bench->run(); };
  });
}

}  // namespace bocst::program
