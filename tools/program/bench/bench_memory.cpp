// SPDX-License-Identifier: BSD-3-Clause
#include "bench/bench_scenarios.h"
#include "bench/heap.h"

namespace bocst::program {
namespace {

/// Bytes of both trees after one query.
double bytesAfterOne(BenchSetting& setting) {
  std::vector<double> bytes;
  for (const Eigen::Isometry3d& X_AB : setting.firstPoses()) {
    const std::unique_ptr<BocstPair> pair = setting.makeBocst();
    pair->touch(X_AB);
    bytes.push_back(static_cast<double>(pair->bytes()));
  }
  return quantile(bytes, 0.5);
}

struct AfterAll {
  double tree_bytes = 0;
  std::optional<double> heap_bytes;
  double settled_tree_bytes = 0;
};

void askAll(const BocstPair& pair, const std::vector<Eigen::Isometry3d>& X_ABs) {
  for (const Eigen::Isometry3d& X_AB : X_ABs) pair.touch(X_AB);
}

/// Models with arrays of their own, after all poses, and when these, asked again, teach them nothing more.
AfterAll afterAll(BenchSetting& setting) {
  const std::vector<Eigen::Isometry3d>& X_ABs = setting.queryTransforms();
  askAll(*setting.makeBocst(), X_ABs);  // what a thread keeps between queries is no model's
  const std::optional<std::size_t> before = heapBytes();
  const std::unique_ptr<BocstPair> pair = setting.makeBocst();
  askAll(*pair, X_ABs);
  AfterAll result;
  if (before) result.heap_bytes = static_cast<double>(*heapBytes()) - static_cast<double>(*before);
  result.tree_bytes = static_cast<double>(pair->bytes());
  warmUp(*pair, X_ABs);
  result.settled_tree_bytes = static_cast<double>(pair->bytes());
  return result;
}

}  // namespace

void benchMemory(BenchSetting& setting, BenchReport& report) {
  const double triangles = setting.triangles();
  const auto fcl = static_cast<double>(fclTreeBytes(Scalar::kDouble, setting.meshA()->triangleCount()) +
                                       fclTreeBytes(Scalar::kDouble, setting.meshB()->triangleCount()));
  const double first = bytesAfterOne(setting);
  const AfterAll all = afterAll(setting);
  const auto compare = [&](const std::string& key, const std::string& name, double ours, double theirs) {
    report.compare(key, name, BenchRow::Unit::kBytesPerTriangle, ours / triangles, theirs / triangles);
  };
  compare("memory", "tree after one query", first, fcl);
  compare("memory_all", "tree after all queries", all.tree_bytes, fcl);
  compare("memory_settled", "tree when it has settled", all.settled_tree_bytes, fcl);
  if (all.heap_bytes) {
    compare("heap", "all heap of the models after all queries", *all.heap_bytes,
            static_cast<double>(*setting.fclHeapBytes()));
  } else {
    report.figure("heap", "all heap of the models after all queries", BenchRow::Unit::kBytesPerTriangle, {});
    report.skip("heap", "the allocator does not report it");
  }
  report.set("bytes", {{"bocst_first", first}, {"bocst_all", all.tree_bytes}, {"fcl", fcl}});
}

}  // namespace bocst::program
