// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <functional>

#include "bench/bench_scenarios.h"

namespace bocst::program {
namespace {

constexpr std::size_t kQueries = 10;  ///< A frame.
constexpr std::size_t kFramesOfRound = 4;

/// A wave that runs along x and moves every vertex, up to 2 % of the mesh's radius along z and y.
std::vector<Eigen::Vector3d> waved(const Mesh& mesh, std::size_t frame) {
  const double radius = mesh.bounds().sizes().norm() / 2;
  const double phase = 0.3 * static_cast<double>(frame + 1);
  std::vector<Eigen::Vector3d> vertices = mesh.vertices();
  for (Eigen::Vector3d& v : vertices) {
    const double along = 4 * (v.x() - mesh.bounds().center().x()) / radius - phase;
    v += 0.02 * radius * Eigen::Vector3d(0, 0.5 * std::cos(along), std::sin(along));
  }
  return vertices;
}

/// One way to bring the moved vertices to a pair, by frame.
struct Way {
  const QueryPair& pair;
  std::function<void()> move;
  std::vector<double> times{};
  std::vector<bool> verdicts{};

  void frame(const std::vector<Eigen::Isometry3d>& X_ABs) {
    const Stopwatch watch;
    move();
    for (const Eigen::Isometry3d& X_AB : X_ABs) verdicts.push_back(pair.touch(X_AB));
    times.push_back(watch.microseconds());
  }

  double median() const { return quantile(times, 0.5); }
};

std::vector<Eigen::Isometry3d> posesOfFrame(BenchSetting& setting) {
  const std::vector<Eigen::Isometry3d>& all = setting.queryTransforms();
  std::vector<Eigen::Isometry3d> poses;
  for (std::size_t i = 0; i < kQueries; ++i) poses.push_back(all[i % all.size()]);
  return poses;
}

}  // namespace

void benchDeforming(BenchSetting& setting, BenchReport& report) {
  const std::vector<Eigen::Isometry3d> X_ABs = posesOfFrame(setting);
  MeshArrays moved(*setting.meshA(), Scalar::kDouble);
  std::vector<Eigen::Vector3d> handed_over;
  const std::unique_ptr<BocstPair> pair = setting.makeBocst();
  const std::unique_ptr<FclPair> rebuilt = setting.makeFcl(), refitted = setting.makeFcl(), swept = setting.makeFcl();
  Way ours{*pair, [&] { pair->updateA(std::move(handed_over)); }};
  Way rebuild{*rebuilt, [&] { rebuilt->rebuildA(moved); }};
  Way refit{*refitted, [&] { refitted->refitA(moved.vertices, FclPair::Refit::kNewPositions); }};
  Way sweep{*swept, [&] { swept->refitA(moved.vertices, FclPair::Refit::kBothPositions); }};
  const std::size_t frames = kFramesOfRound * setting.request().rounds;
  Progress progress("deforming: frame", frames);
  for (std::size_t i = 0; i < frames; ++i) {
    moved.vertices = waved(*setting.meshA(), i);
    handed_over = moved.vertices;
    for (Way* way : {&rebuild, &ours, &refit, &sweep}) way->frame(X_ABs);
    progress.step();
  }
  report.verdicts(ours.verdicts, rebuild.verdicts);
  report.mustBeEqual(refit.verdicts == rebuild.verdicts, "verdicts after endReplaceModel");
  report.mustBeEqual(sweep.verdicts == rebuild.verdicts, "verdicts after endUpdateModel");

  const auto compare = [&](const std::string& key, const std::string& name, const Way& way) {
    report.compare(key, name, BenchRow::Unit::kMicroseconds, ours.median(), way.median());
  };
  compare("deforming_rebuild", "frame, median; FCL rebuilds", rebuild);
  compare("deforming_refit", "the same; FCL refits (endUpdateModel)", sweep);
  compare("deforming_refit_replace", "the same; FCL refits (endReplaceModel)", refit);
}

}  // namespace bocst::program
