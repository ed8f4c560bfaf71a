// SPDX-License-Identifier: BSD-3-Clause
#include "bench/bench_oracles.h"

#include <bocst/bocst.h>
#include <bocst/collide_poses.h>
#include <bocst/io.h>

#include <algorithm>
#include <chrono>
#include <iostream>
#include <memory>
#include <random>
#include <set>
#include <utility>

#include "lattice/limits.h"
#include "mesh/subdivide.h"
#include "oracle/auto_oracle.h"
#include "oracle/oracle.h"

namespace bocst::program {
namespace {

using oracle::ExpansionRequest;

/// What one oracle needed for one mesh; times in microseconds.
struct Figures {
  std::size_t cells = 0, pairs = 0;  ///< Of the batch: cells to expand, and triangles times octants.
  double hold = 0, batch = 0, first_answer = 0;
  double host_bytes = 0, device_bytes = 0;
  oracle::Oracle::Cost cost;
};

/// The grey cells of the last level with at most this many.
constexpr std::size_t kMostCells = 10000;
constexpr std::size_t kLeaf = kMaxLeafTriangles;

/// Lists that a level's questions refer to.
struct Level {
  std::vector<ExpansionRequest> requests;
  std::vector<std::vector<std::uint32_t>> ids;
};

Level childrenOf(std::vector<ExpansionRequest>& answers) {
  Level next;
  for (const ExpansionRequest& e : answers) {
    for (int o = 0; o < 8; ++o) {
      if ((e.grey >> o & 1) == 0) continue;
      ExpansionRequest child;
      child.surface = e.surface;
      child.cell = e.cell.octant(o);
      child.ids_up_to = kLeaf;
      child.count = e.listSize(o);
      next.ids.emplace_back();
      if (e.isOnDevice(o)) {
        child.resource = e.deviceLists();
        child.resource_begin = e.deviceList(o).begin;
      } else {
        next.ids.back().assign(e.listBegin(o), e.listEnd(o));
      }
      next.requests.push_back(std::move(child));
    }
  }
  for (std::size_t i = 0; i < next.requests.size(); ++i) {
    if (next.requests[i].resource == nullptr) next.requests[i].ids = next.ids[i].data();
  }
  return next;
}

std::vector<ExpansionRequest> answersTo(oracle::Oracle& oracle, std::vector<ExpansionRequest> requests) {
  oracle.submit(requests);
  oracle.wait(requests);
  return requests;
}

/// @return false when growing took longer than the limit.
bool measureBatch(oracle::Oracle& oracle, const std::shared_ptr<const Mesh>& mesh, double limit_seconds, Figures& f) {
  oracle::Surface surface{mesh, lattice::Lattice(mesh->bounds(), Subdivision::kBono, 0)};
  {
    const Stopwatch watch;
    surface.device = oracle.makeResident(surface);
    f.hold = surface.device != nullptr ? watch.microseconds() : 0;
  }
  const Stopwatch all;
  Level level;
  level.requests.resize(1);
  level.requests[0].surface = &surface;
  level.requests[0].count = surface.triangle_count;
  level.requests[0].ids_up_to = kLeaf;
  for (;;) {
    std::vector<ExpansionRequest> answers = answersTo(oracle, level.requests);
    if (1e-6 * all.microseconds() > limit_seconds) return false;
    Level next = childrenOf(answers);
    if (next.requests.size() > kMostCells || next.requests.empty()) break;
    const bool deepest = next.requests[0].cell.level == lattice::kMaxLevel;
    level = std::move(next);
    if (deepest) break;
  }
  f.cells = level.requests.size();
  for (const ExpansionRequest& e : level.requests) f.pairs += 8 * e.count;
  struct Sample {
    double time;
    oracle::Oracle::Cost cost;
  };
  std::vector<Sample> samples;
  oracle.lastCost();  // batches are timed from here on
  for (int i = 0; i < 7; ++i) {
    std::vector<ExpansionRequest> batch = level.requests;
    const Stopwatch watch;
    oracle.submit(batch);
    oracle.wait(batch);
    samples.push_back({watch.microseconds(), oracle.lastCost()});
  }
  std::sort(samples.begin(), samples.end(), [](const Sample& a, const Sample& b) { return a.time < b.time; });
  f.batch = samples[samples.size() / 2].time;
  f.cost = samples[samples.size() / 2].cost;
  return true;
}

/// Two new models, the meshes already where the oracle works, and one exact query.
void measureFirstAnswer(OracleKind kind, const std::shared_ptr<const Mesh>& mesh, Figures& f) {
  Options options;
  options.oracle = kind;
  const Eigen::Vector3d size = mesh->bounds().sizes();
  fcl::Transform3d X = fcl::Transform3d::Identity();
  X.linear() = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  X.translation() = Eigen::Vector3d(0.6 * size.x(), 0.1 * size.y(), 0.1 * size.z());
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  const fcl::CollisionRequest<double> request;
  const Modeld holds(mesh, options);  // keeps the mesh on the device
  std::vector<double> times;
  for (int i = 0; i < 6; ++i) {
    fcl::CollisionResult<double> result;
    const Stopwatch watch;
    const Modeld a(mesh, options), b(mesh, options);
    fcl::collide(&a, I, &b, X, request, result);
    if (i > 0) times.push_back(watch.microseconds());  // the first brings the mesh there
    if (i == 0) fcl::collide(&holds, I, &a, X, request, result);
    f.host_bytes = static_cast<double>(a.statistics().resident_bytes + b.statistics().resident_bytes);
    f.device_bytes = static_cast<double>(a.statistics().device_bytes);
  }
  f.first_answer = quantile(times, 0.5);
}

/// What kAuto chooses from, and what batches of conservative growth take: along a path (1 to 8 cells), large ones, or
/// both in turns.
class PlacementBench {
 public:
  PlacementBench(const std::shared_ptr<const Mesh>& mesh, const std::shared_ptr<oracle::Oracle>& device)
      : host_(oracle::makeOracle(OracleKind::kCpu)),
        device_(device),
        surface_{mesh, lattice::Lattice(mesh->bounds(), Subdivision::kBono, 0)} {
    Level level;
    level.requests.resize(1);
    level.requests[0].surface = &surface_;
    level.requests[0].count = surface_.triangle_count;
    while (!level.requests.empty() && level.requests[0].cell.level < lattice::kMaxLevel) {
      std::vector<ExpansionRequest> answers = answersTo(*host_, level.requests);
      levels_.push_back(std::move(level));
      if (levels_.back().requests.size() >= kLarge) break;
      level = childrenOf(answers);
    }
    resident_ = surface_;
    resident_.device = device_->makeResident(surface_);
  }

  /// A row for each job.
  void run(Table& table, Json& rows) {
    oracle::AutoOracle both(host_, device_);
    for (const auto& [name, every] : {std::pair("path", 0), std::pair("large", 1), std::pair("mixed", 8)}) {
      const std::vector<std::vector<ExpansionRequest>> batches = job(every);
      std::vector<double> host, device, each;
      for (int round = 0; round < 4; ++round) {
        const double times[] = {seconds(*host_, surface_, batches), seconds(*device_, resident_, batches),
                                seconds(both, surface_, batches)};
        if (round == 0) continue;  // kAuto brings the mesh to the device
        host.push_back(times[0]);
        device.push_back(times[1]);
        each.push_back(times[2]);
      }
      const double h = quantile(host, 0.5), d = quantile(device, 0.5), e = quantile(each, 0.5);
      rows.push_back({{"job", name}, {"batches", batches.size()}, {"cpu_us", h}, {"device_us", d}, {"auto_us", e}});
      table.row({name, std::to_string(batches.size()), formatTime(h), formatTime(d), formatTime(e),
                 formatNumber(std::min(h, d) / e, 3) + " x"});
    }
  }

 private:
  static constexpr std::size_t kLarge = 2000;

  std::vector<std::vector<ExpansionRequest>> job(int every) const {
    std::mt19937_64 g(3);
    std::vector<std::vector<ExpansionRequest>> batches;
    for (int i = 0; i < (every == 1 ? 8 : 64); ++i) {
      const bool is_large = every != 0 && i % every == 0;
      const std::size_t depth = is_large ? levels_.size() - 1 : std::min(levels_.size() - 1, 2 + g() % 3);
      const std::vector<ExpansionRequest>& all = levels_[depth].requests;
      std::size_t at = g() % all.size();
      batches.emplace_back();
      for (std::size_t n = is_large ? std::min(kLarge, all.size()) : 1 + g() % 8; n > 0; --n) {
        batches.back().push_back(all[at]);
        batches.back().back().ids_up_to = ExpansionRequest::kAll;
        at = (at + 1) % all.size();
      }
    }
    return batches;
  }

  static double seconds(oracle::Oracle& oracle, const oracle::Surface& surface,
                        std::vector<std::vector<ExpansionRequest>> batches) {
    double sum = 0;
    for (std::vector<ExpansionRequest>& batch : batches) {
      for (ExpansionRequest& e : batch) e.surface = &surface;
      const Stopwatch watch;
      oracle.submit(batch);
      oracle.wait(batch);
      sum += watch.microseconds();
    }
    return sum;
  }

  std::shared_ptr<oracle::Oracle> host_, device_;
  oracle::Surface surface_, resident_{surface_};
  std::vector<Level> levels_;
};

/// Random poses of a mesh on itself.
std::vector<fcl::Transform3d> randomPoses(const Mesh& mesh, std::size_t count) {
  const Eigen::AlignedBox3d box = mesh.bounds();
  std::mt19937_64 g(5);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(-0.5, 0.5);
  std::vector<fcl::Transform3d> poses(count, fcl::Transform3d::Identity());
  for (fcl::Transform3d& X : poses) {
    Eigen::Vector4d q;
    Eigen::Vector3d t;
    for (int k = 0; k < 4; ++k) q[k] = normal(g);
    for (int k = 0; k < 3; ++k) t[k] = uniform(g);
    X.linear() = Eigen::Quaterniond(q.normalized()).toRotationMatrix();
    X.translation() = box.center() - X.linear() * box.center() + box.diagonal().norm() * t;
  }
  return poses;
}

/// Conservative answers to many poses by collidePoses: microseconds a pose.
struct ManyPoses {
  double first;  ///< Two new models.
  double again;  ///< The same poses, once both trees have all that these need.
  std::vector<std::uint8_t> hits;
};

/// threads: 0 is the default of collidePoses.
ManyPoses timeOfPoses(OracleKind kind, const std::shared_ptr<const Mesh>& mesh,
                      const std::vector<fcl::Transform3d>& poses, int depth, unsigned threads) {
  constexpr int kRounds = 8;
  Options options;
  options.oracle = kind;
  options.answer = Answer::kConservative;
  options.depth = depth;
  options.ttl = std::chrono::hours(1);
  const Modeld a(mesh, options), b(mesh, options);
  ManyPoses result{0, 0, std::vector<std::uint8_t>(poses.size())};
  std::vector<double> times;
  for (int round = 0; round < kRounds; ++round) {
    const Stopwatch watch;
    collidePoses(a, b, poses.data(), poses.size(), result.hits.data(), threads);
    const double time = watch.microseconds() / static_cast<double>(poses.size());
    if (round == 0) result.first = time;
    if (round > kRounds / 2) times.push_back(time);
  }
  result.again = quantile(times, 0.5);
  return result;
}

/// @return false when a verdict of the device differs from that of the host.
bool measurePoses(const std::shared_ptr<const Mesh>& mesh, std::size_t count, Table& table, Json& rows) {
  const std::vector<fcl::Transform3d> poses = randomPoses(*mesh, count);
  bool are_equal = true;
  for (const unsigned threads : {1u, 0u}) {
    for (const int depth : {5, 6, 7, 8}) {
      const auto time = [&](OracleKind kind) { return timeOfPoses(kind, mesh, poses, depth, threads); };
      const ManyPoses host = time(OracleKind::kCpu), device = time(OracleKind::kCompute),
                      both = time(OracleKind::kAuto);
      const bool is_equal = host.hits == device.hits && host.hits == both.hits;
      are_equal = are_equal && is_equal;
      rows.push_back({{"depth", depth},
                      {"poses", count},
                      {"threads", threads},
                      {"cpu_first_us", host.first},
                      {"compute_first_us", device.first},
                      {"auto_first_us", both.first},
                      {"cpu_us", host.again},
                      {"compute_us", device.again},
                      {"auto_us", both.again},
                      {"verdicts_equal", is_equal}});
      const auto gain = [](double a, double b, double c) { return formatNumber(std::min(a, b) / c, 3) + " x"; };
      table.row({std::to_string(depth), threads == 0 ? "default" : std::to_string(threads), formatTime(host.first),
                 formatTime(device.first), formatTime(both.first), gain(host.first, device.first, both.first),
                 formatTime(host.again), formatTime(device.again), formatTime(both.again),
                 gain(host.again, device.again, both.again), is_equal ? "equal" : "DIFFER"});
    }
  }
  return are_equal;
}

void addRow(std::size_t triangles, const OracleInfo& info, const Figures& f, Json& rows, Table& table) {
  const double cells_per_second = 1e6 * static_cast<double>(f.cells) / f.batch;
  const double pairs_per_second = 1e6 * static_cast<double>(f.pairs) / f.batch;
  rows.push_back(
      {{"triangles", triangles},
       {"oracle", info.name},
       {"device", info.device},
       {"hardware", info.hardware},
       {"upload_us", f.hold},
       {"first_answer_us", f.first_answer},
       {"batch", {{"cells", f.cells}, {"pairs", f.pairs}, {"time_us", f.batch}}},
       {"cells_per_second", cells_per_second},
       {"pairs_per_second", pairs_per_second},
       {"device_us",
        {{"upload", 1e6 * f.cost.upload}, {"kernels", 1e6 * f.cost.kernels}, {"read_back", 1e6 * f.cost.read_back}}},
       {"bytes", {{"host", f.host_bytes}, {"device", f.device_bytes}}}});
  const bool device = f.hold > 0;
  const auto part = [&](double seconds) { return f.cost.kernels > 0 ? formatTime(1e6 * seconds) : "-"; };
  table.row({std::to_string(triangles), info.name, device ? formatTime(f.hold) : "-", formatTime(f.first_answer),
             std::to_string(f.cells), std::to_string(f.pairs), formatTime(f.batch), formatNumber(cells_per_second),
             formatNumber(pairs_per_second), part(f.cost.upload), part(f.cost.kernels), part(f.cost.read_back),
             formatBytes(f.host_bytes), device ? formatBytes(f.device_bytes) : "-"});
}

}  // namespace

int OracleBench::run(const Output& output) const {
  std::shared_ptr<const Mesh> mesh = loadMesh(file);
  std::set<std::string> slow, seen;
  std::vector<OracleInfo> oracles;
  for (const OracleInfo& info : availableOracles()) {
    // The default device of each kind.
    if (info.why_not.empty() && info.kind != OracleKind::kSampled && seen.insert(info.name).second) {
      oracles.push_back(info);
    }
  }
  Json report = {{"mesh", file}, {"rows", Json::array()}};
  Table table;
  table.row({"triangles", "oracle", "upload", "first answer", "batch: cells", "pairs", "time", "cells/s", "pairs/s",
             "device: upload", "kernels", "read-back", "bytes host", "device"});
  Progress progress("row", sizes.size() * oracles.size());
  std::size_t last = 0;
  for (const std::size_t size : sizes) {
    // As near as whole subdivisions come.
    while (static_cast<double>(mesh->triangleCount()) * 2 < static_cast<double>(size)) mesh = subdivided(*mesh);
    if (std::exchange(last, mesh->triangleCount()) == mesh->triangleCount()) continue;
    for (const OracleInfo& info : oracles) {
      progress.step();
      if (slow.count(info.name) != 0) continue;
      const std::shared_ptr<oracle::Oracle> oracle = oracle::makeOracle(info.kind);
      Figures f;
      if (!measureBatch(*oracle, mesh, limit_seconds, f)) {
        slow.insert(info.name);
        continue;
      }
      measureFirstAnswer(info.kind, mesh, f);
      addRow(mesh->triangleCount(), info, f, report["rows"], table);
    }
  }
  Table placement;
  placement.row({"conservative growth", "batches", "cpu", "compute", "auto", "better of both / auto"});
  report["placement"] = Json::array();
  Table poses;
  poses.row({"many poses, depth", "threads", "first: cpu, a pose", "compute", "auto", "better of both / auto",
             "again: cpu, a pose", "compute", "auto", "better of both / auto", "verdicts"});
  report["poses"] = Json::array();
  bool are_equal = true;
  if (seen.count("compute") != 0) {
    PlacementBench(loadMesh(file), oracle::makeOracle(OracleKind::kCompute)).run(placement, report["placement"]);
    are_equal = measurePoses(loadMesh(file), pose_count, poses, report["poses"]);
  }
  if (output.wantsJson()) {
    output.write(report);
  } else {
    table.print();
    if (!report["placement"].empty()) {
      std::cout << '\n';
      placement.print();
      std::cout << '\n';
      poses.print();
    }
    for (const OracleInfo& info : oracles) std::cout << '\n' << info.name << ": " << info.device;
    std::cout << '\n';
    for (const std::string& name : slow)
      std::cout << name << ": left out from the size at which it took more than " << limit_seconds << " s\n";
  }
  return are_equal ? 0 : 1;
}

}  // namespace bocst::program
