// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/mesh.h>

#include <algorithm>
#include <cmath>

#include "bench/bench_scenarios.h"
#include "mesh/decimate.h"
#include "mesh/subdivide.h"
#include "pairs/poses.h"

namespace bocst::program {
namespace {

/// A mesh of about this many triangles: decimated; if it has fewer, to a number that subdivisions bring there.
std::shared_ptr<const Mesh> resized(const std::shared_ptr<const Mesh>& mesh, std::size_t triangles) {
  std::size_t times = 0;
  while (mesh->triangleCount() < triangles >> 2 * times) ++times;
  return subdivided(decimated(mesh, triangles >> 2 * times), times);
}

/// The mesh with itself, new models.
std::unique_ptr<BocstPair> pairOf(const Mesh& mesh) {
  return makeBocstPair(HandedOver(mesh), HandedOver(mesh), Options{});
}

struct Size {
  double triangles = 0;
  double first = 0, query = 0;  ///< Microseconds, median.
};

/// The median of some poses, of each the least of all rounds.
double firstAnswer(const Mesh& mesh, const std::vector<Eigen::Isometry3d>& X_ABs, std::size_t rounds) {
  std::vector<double> least(std::min<std::size_t>(5, X_ABs.size()), HUGE_VAL);
  for (std::size_t round = 0; round < rounds; ++round) {
    for (std::size_t i = 0; i < least.size(); ++i) {
      HandedOver a(mesh), b(mesh);
      const Stopwatch watch;
      const std::unique_ptr<BocstPair> pair = makeBocstPair(std::move(a), std::move(b), Options{});
      pair->touch(X_ABs[i]);
      least[i] = std::min(least[i], watch.microseconds());
    }
  }
  return quantile(least, 0.5);
}

/// The same of all poses, asked until nothing grew any more.
double warmQuery(const Mesh& mesh, const std::vector<Eigen::Isometry3d>& X_ABs, std::size_t rounds) {
  const std::unique_ptr<BocstPair> pair = pairOf(mesh);
  warmUp(*pair, X_ABs);
  std::vector<double> least(X_ABs.size(), HUGE_VAL);
  for (std::size_t round = 0; round < rounds; ++round) {
    for (std::size_t i = 0; i < X_ABs.size(); ++i) {
      const Stopwatch watch;
      pair->touch(X_ABs[i]);
      least[i] = std::min(least[i], watch.microseconds());
    }
  }
  return quantile(least, 0.5);
}

void addRows(BenchReport& report, const Size& size, const Size& smallest) {
  const std::string triangles = std::to_string(static_cast<std::size_t>(size.triangles));
  const double n = size.triangles / smallest.triangles;
  const double log_n = std::log(size.triangles) / std::log(smallest.triangles);
  report.figure("growth_first_" + triangles, "first answer, " + triangles + " triangles", BenchRow::Unit::kMicroseconds,
                size.first, {}, n / (size.first / smallest.first));
  report.figure("growth_query_" + triangles, "warm query, median, " + triangles, BenchRow::Unit::kMicroseconds,
                size.query, {}, log_n / (size.query / smallest.query));
}

/// The same for all sizes, which differ by little but their triangles.
std::vector<Eigen::Isometry3d> posesOf(const Mesh& mesh, const BenchRequest& request) {
  const std::unique_ptr<BocstPair> pair = pairOf(mesh);
  PoseSampler sampler(mesh, mesh, *pair, request.seed);
  std::vector<Eigen::Isometry3d> poses;
  for (std::size_t i = 0; i < request.poses; ++i) poses.push_back(sampler.nextAnywhere().transform());
  return poses;
}

}  // namespace

void benchGrowth(BenchSetting& setting, BenchReport& report) {
  const BenchRequest& request = setting.request();
  std::vector<std::size_t> wanted = request.sizes;
  std::sort(wanted.begin(), wanted.end());
  std::vector<Eigen::Isometry3d> X_ABs;
  std::vector<Size> sizes;
  Progress progress("growth: size", wanted.size());
  for (const std::size_t triangles : wanted) {
    const std::shared_ptr<const Mesh> mesh = resized(setting.meshA(), triangles);
    const auto count = static_cast<double>(mesh->triangleCount());
    if (!sizes.empty() && sizes.back().triangles == count) continue;
    if (X_ABs.empty()) X_ABs = posesOf(*mesh, request);
    sizes.push_back({count, firstAnswer(*mesh, X_ABs, request.rounds), warmQuery(*mesh, X_ABs, request.rounds)});
    addRows(report, sizes.back(), sizes.front());
    progress.step();
  }
}

}  // namespace bocst::program
