// SPDX-License-Identifier: BSD-3-Clause
#include <stdexcept>

#include "bench/bench_scenarios.h"

namespace bocst::program {
namespace {

/// Adds up all vertices through the index arrays: no answer can take less than looking at everything once.
Eigen::Vector3d sumOf(const HandedOver& mesh) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Mesh::Indices& t : mesh.triangles) {
    sum += mesh.vertices[t[0]] + mesh.vertices[t[1]] + mesh.vertices[t[2]];
  }
  return sum;
}

/// Over arrays as fresh as those that a new model takes over.
double timeStreamingPass(const BenchSetting& setting) {
  const HandedOver a(*setting.meshA()), b(*setting.meshB());
  const Stopwatch watch;
  const bool finite = (sumOf(a) + sumOf(b)).allFinite();
  const double time = watch.microseconds();
  if (!finite) throw std::runtime_error("the sum of the vertices is not finite: coordinates are too large");
  return time;
}

}  // namespace

void benchFirst(BenchSetting& setting, BenchReport& report) {
  std::vector<double> ours, theirs, passes;
  std::vector<bool> our_verdicts, fcl_verdicts;
  Progress progress("first: round", setting.firstPoses().size());
  for (const Eigen::Isometry3d& X_AB : setting.firstPoses()) {
    {
      const Stopwatch watch;
      const std::unique_ptr<FclPair> fcl = setting.makeFcl();
      fcl_verdicts.push_back(fcl->touch(X_AB));
      theirs.push_back(watch.microseconds());
    }
    passes.push_back(timeStreamingPass(setting));
    HandedOver a(*setting.meshA()), b(*setting.meshB());
    const Stopwatch watch;
    const std::unique_ptr<BocstPair> bocst = makeBocstPair(std::move(a), std::move(b), Options{});
    our_verdicts.push_back(bocst->touch(X_AB));
    ours.push_back(watch.microseconds());
    progress.step();
  }
  report.verdicts(our_verdicts, fcl_verdicts, setting.firstPoses());

  const double first = quantile(ours, 0.5), fcl_first = quantile(theirs, 0.5), pass = quantile(passes, 0.5);
  report.compare("first_answer", "first answer, median", BenchRow::Unit::kMicroseconds, first, fcl_first);
  report.figure("streaming_pass", "one streaming pass over both meshes", BenchRow::Unit::kMicroseconds, pass);
  report.figure("first_over_streaming", "first answer over the streaming pass", BenchRow::Unit::kTimes, first / pass,
                fcl_first / pass);
}

}  // namespace bocst::program
