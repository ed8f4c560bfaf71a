// SPDX-License-Identifier: BSD-3-Clause
#include "bench/bench_setting.h"

#include <bocst/io.h>

#include <algorithm>

#include "bench/heap.h"
#include "cli/report.h"
#include "mesh/subdivide.h"

namespace bocst::program {

BenchSetting::BenchSetting(const BenchRequest& request)
    : request_(request),
      mesh_a_(subdivided(loadMesh(request.file_a), request.subdivide)),
      mesh_b_(request.file_b.empty() ? mesh_a_ : subdivided(loadMesh(request.file_b), request.subdivide)) {}

const MeshArrays& BenchSetting::arraysA() {
  if (!a_) a_ = std::make_unique<MeshArrays>(*mesh_a_, Scalar::kDouble);
  return *a_;
}

const MeshArrays& BenchSetting::arraysB() {
  if (!b_) b_ = std::make_unique<MeshArrays>(*mesh_b_, Scalar::kDouble);
  return *b_;
}

std::unique_ptr<FclPair> BenchSetting::makeFcl() {
  const MeshArrays& a = arraysA();
  const MeshArrays& b = arraysB();
  const Stopwatch watch;
  std::unique_ptr<FclPair> pair = buildFclPair(FclTree::kObbRss, Scalar::kDouble, a, b);
  fcl_build_times_.push_back(watch.microseconds());
  return pair;
}

std::unique_ptr<BocstPair> BenchSetting::makeBocst(const Options& options) const {
  return makeBocstPair(HandedOver(*mesh_a_), HandedOver(*mesh_b_), options);
}

void BenchSetting::buildFcl() {
  if (fcl_) return;
  arraysA();
  arraysB();
  const std::optional<std::size_t> before = heapBytes();
  fcl_ = makeFcl();
  if (before) fcl_heap_bytes_ = *heapBytes() - *before;
}

const FclPair& BenchSetting::fcl() {
  buildFcl();
  return *fcl_;
}

double BenchSetting::fclBuildTime() {
  buildFcl();
  return quantile(fcl_build_times_, 0.5);
}

std::optional<std::size_t> BenchSetting::fclHeapBytes() {
  buildFcl();
  return fcl_heap_bytes_;
}

void BenchSetting::drawPoses() {
  if (!query_poses_.empty()) return;
  PoseSampler sampler(*mesh_a_, *mesh_b_, fcl(), request_.seed);
  Progress progress("pose", request_.poses);
  for (std::size_t i = 0; i < request_.rounds; ++i) first_poses_.push_back(sampler.nextAnywhere().transform());
  for (std::size_t i = 0; i < request_.poses; ++i) {
    query_poses_.push_back(sampler.nextAnywhere());
    query_transforms_.push_back(query_poses_.back().transform());
    query_verdicts_.push_back(fcl().touch(query_transforms_.back()));
    progress.step();
  }
  for (std::size_t i = 0; i < 16 * request_.rounds && apart_poses_.size() < request_.rounds; ++i) {
    const Eigen::Isometry3d X_AB = sampler.nextAnywhere().transform();
    if (!fcl().touch(X_AB)) apart_poses_.push_back(X_AB);
  }
}

const std::vector<Eigen::Isometry3d>& BenchSetting::firstPoses() {
  drawPoses();
  return first_poses_;
}

const std::vector<Eigen::Isometry3d>& BenchSetting::apartPoses() {
  drawPoses();
  return apart_poses_;
}

const std::vector<Pose>& BenchSetting::queryPoses() {
  drawPoses();
  return query_poses_;
}

const std::vector<Eigen::Isometry3d>& BenchSetting::queryTransforms() {
  drawPoses();
  return query_transforms_;
}

const std::vector<bool>& BenchSetting::queryVerdicts() {
  drawPoses();
  return query_verdicts_;
}

std::optional<std::size_t> BenchSetting::hits() const {
  if (query_verdicts_.empty()) return std::nullopt;
  return std::count(query_verdicts_.begin(), query_verdicts_.end(), true);
}

std::string BenchSetting::oracleName() const { return makeBocst()->oracleName(); }

void warmUp(const std::function<std::vector<std::uint64_t>()>& growth, const std::function<void()>& ask) {
  // Pools grow in steps, so a few rounds without a change say little; and ttl may take from the largest what was grown.
  constexpr int kMostRounds = 60, kQuietRounds = 8;
  std::vector<std::uint64_t> before = growth();
  for (int round = 0, quiet = 0; round < kMostRounds && quiet < kQuietRounds; ++round) {
    ask();
    const std::vector<std::uint64_t> after = growth();
    quiet = after == before ? quiet + 1 : 0;
    before = after;
  }
}

void warmUp(const BocstPair& pair, const std::vector<Eigen::Isometry3d>& X_ABs,
            const std::function<void(const Eigen::Isometry3d&)>& ask) {
  const auto growth = [&pair] {
    const Statistics a = pair.statisticsA(), b = pair.statisticsB();
    return std::vector<std::uint64_t>{a.expansions, b.expansions, pair.bytes()};
  };
  warmUp(growth, [&] {
    for (const Eigen::Isometry3d& X_AB : X_ABs) ask(X_AB);
  });
}

void warmUp(const BocstPair& pair, const std::vector<Eigen::Isometry3d>& X_ABs) {
  warmUp(pair, X_ABs, [&pair](const Eigen::Isometry3d& X_AB) { pair.touch(X_AB); });
}

}  // namespace bocst::program
