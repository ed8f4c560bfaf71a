// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/io.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "arguments.h"
#include "bench_oracles.h"
#include "poses.h"
#include "query_pair.h"

namespace bocst::program {
namespace {

/// What one side needed, in microseconds, and what it said.
struct Side {
  std::vector<double> first_answers;
  std::vector<double> first_distance_times;
  std::vector<double> builds;               // before a first answer
  std::vector<std::vector<double>> rounds;  // by pose
  std::vector<bool> first_verdicts;
  std::vector<bool> verdicts;
  std::vector<std::vector<double>> distance_rounds;  // by pose that does not touch
  std::vector<double> distances;

  static std::vector<double> medians(const std::vector<std::vector<double>>& by_pose) {
    std::vector<double> result;
    result.reserve(by_pose.size());
    for (const std::vector<double>& times : by_pose) result.push_back(quantile(times, 0.5));
    return result;
  }

  /// FNV-1a over the verdicts in order.
  std::string hash() const {
    std::uint64_t h = 0xcbf29ce484222325u;
    for (const std::vector<bool>& list : {first_verdicts, verdicts}) {
      for (const bool verdict : list) h = (h ^ (verdict ? 1u : 0u)) * 0x100000001b3u;
    }
    char text[17];
    std::snprintf(text, sizeof(text), "%016llx", static_cast<unsigned long long>(h));
    return text;
  }
};

/// Makes two models from arrays of its own, once.
struct FreshModels {
  HandedOver a;
  HandedOver b;

  FreshModels(const Mesh& mesh_a, const Mesh& mesh_b) : a(mesh_a), b(mesh_b) {}
  std::unique_ptr<BocstPair> operator()() { return makeBocstPair(std::move(a), std::move(b), Options{}); }
};

struct Bench {
  std::string file_a;
  std::string file_b;
  std::size_t poses = 1000;
  std::uint64_t seed = 1;
  std::size_t rounds = 5;
  Output output;
  bool of_oracles = false;
  OracleBench oracles;

  template <typename Make>
  static auto timeFirst(Make&& make, const Eigen::Isometry3d& X_AB, Side& side) {
    const Stopwatch watch;
    auto pair = make();
    side.builds.push_back(watch.microseconds());
    side.first_verdicts.push_back(pair->touch(X_AB));
    side.first_answers.push_back(watch.microseconds());
    return pair;
  }

  /// A first distance of both sides, where the meshes are apart. FCL's trees are the same whatever is asked, so they
  /// are not built once more: `built` is how long it took.
  template <typename Make>
  static void timeFirstDistance(const FclPair& fcl, double built, Make&& make, const Eigen::Isometry3d& X_AB,
                                Side& theirs, Side& ours) {
    const Stopwatch fcl_watch;
    const double expected = fcl.distance(X_AB);
    theirs.first_distance_times.push_back(built + fcl_watch.microseconds());
    const Stopwatch watch;
    const double distance = make()->distance(X_AB);
    ours.first_distance_times.push_back(watch.microseconds());
    checkDistance(expected, distance);
  }

  static void checkDistance(double fcl, double bocst) {
    if (!(std::abs(fcl - bocst) <= 1e-9 * fcl)) throw std::runtime_error("the distances are not FCL's");
  }

  static void timeRound(const QueryPair& pair, const std::vector<Eigen::Isometry3d>& X_ABs, Side& side) {
    for (std::size_t i = 0; i < X_ABs.size(); ++i) {
      const Stopwatch watch;
      const bool verdict = pair.touch(X_ABs[i]);
      side.rounds[i].push_back(watch.microseconds());
      if (side.verdicts[i] != verdict) throw std::runtime_error("the same query was answered differently later");
    }
  }

  static void timeDistances(const QueryPair& pair, const std::vector<Eigen::Isometry3d>& X_ABs, Side& side) {
    for (std::size_t i = 0; i < X_ABs.size(); ++i) {
      const Stopwatch watch;
      const double distance = pair.distance(X_ABs[i]);
      side.distance_rounds[i].push_back(watch.microseconds());
      if (side.distances[i] != distance) throw std::runtime_error("the same distance was different later");
    }
  }

  /// Distances where the poses do not touch, both sides in turn. Does nothing when all touch.
  void benchDistances(const FclPair& fcl, const BocstPair& bocst, const std::vector<Eigen::Isometry3d>& X_ABs,
                      Side& theirs, Side& ours) const {
    std::vector<Eigen::Isometry3d> apart;
    for (std::size_t i = 0; i < X_ABs.size(); ++i) {
      if (!theirs.verdicts[i]) apart.push_back(X_ABs[i]);
    }
    theirs.distance_rounds.resize(apart.size());
    ours.distance_rounds.resize(apart.size());
    for (const Eigen::Isometry3d& X_AB : apart) {
      theirs.distances.push_back(fcl.distance(X_AB));
      ours.distances.push_back(bocst.distance(X_AB));
      checkDistance(theirs.distances.back(), ours.distances.back());
    }
    for (std::size_t round = 0; round < rounds; ++round) {
      timeDistances(fcl, apart, theirs);
      timeDistances(bocst, apart, ours);
    }
  }

  /// At most so many rounds over all poses until a tree has what they need.
  static constexpr int kWarmUps = 10;

  static void warmUp(const FclPair& fcl, const BocstPair& bocst, const std::vector<Eigen::Isometry3d>& X_ABs,
                     Side& theirs, Side& ours) {
    for (Side* side : {&theirs, &ours}) side->rounds.resize(X_ABs.size());
    for (const Eigen::Isometry3d& X_AB : X_ABs) {
      theirs.verdicts.push_back(fcl.touch(X_AB));
      ours.verdicts.push_back(bocst.touch(X_AB));
    }
    std::size_t before = 0;
    for (int i = 1; i < kWarmUps && before != bocst.bytes(); ++i) {
      before = bocst.bytes();
      for (const Eigen::Isometry3d& X_AB : X_ABs) bocst.touch(X_AB);
    }
  }

  int run() const {
    output.check();
    if (of_oracles) {
      OracleBench bench = oracles;
      bench.file = file_a;
      return bench.run(output);
    }
    const std::shared_ptr<const Mesh> mesh_a = loadMesh(file_a);
    const std::shared_ptr<const Mesh> mesh_b = file_b.empty() ? mesh_a : loadMesh(file_b);
    const MeshArrays a(*mesh_a, Scalar::kDouble);
    const MeshArrays b(*mesh_b, Scalar::kDouble);
    const auto make_fcl = [&] { return buildFclPair(FclTree::kObbRss, Scalar::kDouble, a, b); };

    // Both sides take turns, so that a slow moment of the machine meets both.
    Progress progress("step", 2 * rounds + 4);
    const std::unique_ptr<FclPair> fcl_pair = make_fcl();
    progress.step();
    PoseSampler sampler(*mesh_a, *mesh_b, *fcl_pair, seed);
    std::vector<Eigen::Isometry3d> first_poses;
    std::vector<Pose> query_poses;
    std::vector<Eigen::Isometry3d> X_ABs;
    for (std::size_t i = 0; i < rounds; ++i) first_poses.push_back(sampler.nextAnywhere().transform());
    for (std::size_t i = 0; i < poses; ++i) {
      query_poses.push_back(sampler.nextAnywhere());
      X_ABs.push_back(query_poses.back().transform());
    }
    std::vector<Eigen::Isometry3d> apart_poses;
    for (std::size_t i = 0; i < 16 * rounds && apart_poses.size() < rounds; ++i) {
      const Eigen::Isometry3d X_AB = sampler.nextAnywhere().transform();
      if (!fcl_pair->touch(X_AB)) apart_poses.push_back(X_AB);
    }
    progress.step();

    Side ours;
    Side theirs;
    std::vector<double> bytes_first;
    std::string oracle;
    for (const Eigen::Isometry3d& X_AB : first_poses) {
      timeFirst(make_fcl, X_AB, theirs);
      const std::unique_ptr<BocstPair> pair = timeFirst(FreshModels(*mesh_a, *mesh_b), X_AB, ours);
      bytes_first.push_back(static_cast<double>(pair->bytes()));
      oracle = pair->oracleName();
      progress.step();
    }
    for (const Eigen::Isometry3d& X_AB : apart_poses) {
      timeFirstDistance(*fcl_pair, quantile(theirs.builds, 0.5), FreshModels(*mesh_a, *mesh_b), X_AB, theirs, ours);
    }
    const std::unique_ptr<BocstPair> bocst_pair = makeBocstPair(Scalar::kDouble, a, b, Options{});
    warmUp(*fcl_pair, *bocst_pair, X_ABs, theirs, ours);
    progress.step();
    for (std::size_t round = 0; round < rounds; ++round) {
      if (round % 2 == 0) timeRound(*fcl_pair, X_ABs, theirs);
      timeRound(*bocst_pair, X_ABs, ours);
      if (round % 2 == 1) timeRound(*fcl_pair, X_ABs, theirs);
      progress.step();
    }

    const std::size_t bytes_all = bocst_pair->bytes();
    benchDistances(*fcl_pair, *bocst_pair, X_ABs, theirs, ours);
    progress.step();

    const bool equal = ours.verdicts == theirs.verdicts && ours.first_verdicts == theirs.first_verdicts;
    const std::vector<double> our_medians = Side::medians(ours.rounds);
    const std::vector<double> fcl_medians = Side::medians(theirs.rounds);
    const auto fcl_bytes = static_cast<double>(fclTreeBytes(Scalar::kDouble, a.triangles.size()) +
                                               fclTreeBytes(Scalar::kDouble, b.triangles.size()));
    struct Row {
      const char* key;
      const char* name;
      double bocst;
      double fcl;
    };
    std::vector<Row> times = {
        {"first_answer", "first answer, median", quantile(ours.first_answers, 0.5),
         quantile(theirs.first_answers, 0.5)},
        {"query_median", "warm query, median", quantile(our_medians, 0.5), quantile(fcl_medians, 0.5)},
        {"query_mean", "warm query, mean", mean(our_medians), mean(fcl_medians)},
        {"query_p95", "warm query, 95th percentile", quantile(our_medians, 0.95), quantile(fcl_medians, 0.95)}};
    if (!ours.distances.empty()) {
      times.push_back({"distance_median", "warm distance, median", quantile(Side::medians(ours.distance_rounds), 0.5),
                       quantile(Side::medians(theirs.distance_rounds), 0.5)});
    }
    if (!ours.first_distance_times.empty()) {
      times.push_back({"first_distance", "first distance, median", quantile(ours.first_distance_times, 0.5),
                       quantile(theirs.first_distance_times, 0.5)});
    }
    const double memory = fcl_bytes / quantile(bytes_first, 0.5);
    std::size_t worst = 0;
    for (std::size_t i = 0; i < poses; ++i) {
      if (our_medians[i] * fcl_medians[worst] > our_medians[worst] * fcl_medians[i]) worst = i;
    }
    std::size_t hits = 0;
    for (const bool verdict : theirs.verdicts) hits += verdict;

    if (output.wantsJson()) {
      Json ratio;
      Json microseconds;
      for (const Row& row : times) {
        ratio[row.key] = row.fcl / row.bocst;
        microseconds[row.key] = {{"bocst", row.bocst}, {"fcl", row.fcl}};
      }
      ratio["memory"] = memory;
      if (ours.distances.empty()) ratio["distance_median"] = nullptr;
      if (ours.first_distance_times.empty()) ratio["first_distance"] = nullptr;
      output.write(
          {{"a", file_a},
           {"b", file_b.empty() ? file_a : file_b},
           {"triangles", {a.triangles.size(), b.triangles.size()}},
           {"poses", poses},
           {"seed", seed},
           {"rounds", rounds},
           {"hits", hits},
           {"oracle", oracle},
           {"ratio", ratio},
           {"microseconds", microseconds},
           {"bytes", {{"bocst_first", quantile(bytes_first, 0.5)}, {"bocst_all", bytes_all}, {"fcl", fcl_bytes}}},
           {"verdicts", {{"bocst", ours.hash()}, {"fcl", theirs.hash()}, {"equal", equal}}}});
    } else {
      Table table;
      table.row({"", "bocst", "FCL OBBRSS", "ratio"});
      for (const Row& row : times) {
        table.row({row.name, formatTime(row.bocst), formatTime(row.fcl), formatRatio(row.fcl / row.bocst)});
      }
      const double first = quantile(bytes_first, 0.5);
      const auto all = static_cast<double>(bytes_all);
      table.row({"tree bytes after one query", formatBytes(first), formatBytes(fcl_bytes), formatRatio(memory)});
      table.row(
          {"tree bytes after all queries", formatBytes(all), formatBytes(fcl_bytes), formatRatio(fcl_bytes / all)});
      table.print();
      std::cout << '\n'
                << poses << " poses, " << hits << " touch; verdicts " << (equal ? "equal" : "DIFFER") << ", hash "
                << ours.hash() << "\nworst query: " << formatTime(our_medians[worst]) << " against "
                << formatTime(fcl_medians[worst]) << " at --pose " << query_poses[worst].text() << '\n';
    }
    if (!equal) throw std::runtime_error("the verdicts are not FCL's");
    return 0;
  }
};

}  // namespace

void addBench(CLI::App& program, Job& job) {
  auto bench = std::make_shared<Bench>();
  CLI::App* command = program.add_subcommand("bench", "time and memory beside FCL's BVHModel<OBBRSS>, in one run");
  command->footer(
      "Ratios are FCL's figure over bocst's: above 1 bocst is better. About two poses of three touch.\n"
      "First answers start from vertex and index arrays, which FCL copies and bocst takes over.\n"
      "Warm: the poses were asked until the trees stopped growing.");
  command->add_option("a", bench->file_a, "mesh A: OBJ, PLY, STL, OFF or DAE file")->required();
  command->add_option("b", bench->file_b, "mesh B; A again if not given");
  command->add_option("--poses", bench->poses, "number of random poses")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command->add_option("--seed", bench->seed, "the same seed gives the same poses")->capture_default_str();
  command->add_option("--rounds", bench->rounds, "first answers, and rounds over all poses")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command->add_flag("--oracles", bench->of_oracles,
                    "instead: each oracle of this machine on mesh A, subdivided to several sizes");
  command->add_option("--triangles", bench->oracles.sizes, "with --oracles: the sizes to come near to")
      ->delimiter(',')
      ->capture_default_str();
  command
      ->add_option("--limit", bench->oracles.limit_seconds,
                   "with --oracles: seconds; an oracle that needs more to grow a tree is left out from there on")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  addJson(*command, bench->output);
  command->callback([bench, &job] { job = [bench] { return bench->run(); }; });
}

}  // namespace bocst::program
