// SPDX-License-Identifier: BSD-3-Clause
// What is asked of models that have grown already.
#include <cmath>

#include "bench/bench_scenarios.h"
#include "bench/bench_turns.h"
#include "cli/words.h"

namespace bocst::program {
namespace {

std::vector<double> where(const std::vector<bool>& verdicts, bool wanted, const std::vector<double>& values) {
  std::vector<double> result;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (verdicts[i] == wanted) result.push_back(values[i]);
  }
  return result;
}

/// The same figures of those poses only that touch, or that do not.
void comparePenetration(BenchReport& report, const std::string& key, const std::string& name,
                        const std::vector<double>& ours, const std::vector<double>& theirs) {
  if (ours.empty()) return report.skip(key, "there is no such pose");
  report.compareTimes(key, name, ours, theirs);
}

void noteWorst(BenchSetting& setting, BenchReport& report, const std::vector<double>& ours,
               const std::vector<double>& theirs) {
  std::size_t worst = 0;
  for (std::size_t i = 0; i < ours.size(); ++i) {
    if (ours[i] * theirs[worst] > ours[worst] * theirs[i]) worst = i;
  }
  report.note("worst warm query: " + formatTime(ours[worst]) + " against " + formatTime(theirs[worst]) + " at --pose " +
              setting.queryPoses()[worst].text());
}

/// FCL's turn may take longer than ttl, after which all would grow anew: the models' clock stands still.
std::unique_ptr<BocstPair> makeAgeless(const BenchSetting& setting) {
  Options options;
  options.clock = [] { return Clock::time_point(); };
  return setting.makeBocst(options);
}

/// As many of the poses, from the first on, as FCL can be asked about in ten seconds or so: it takes some 4 us a pair.
std::vector<Eigen::Isometry3d> posesForContacts(BenchSetting& setting) {
  constexpr std::size_t kMostContacts = 2000000;
  const std::size_t most = kMostContacts / (2 * setting.request().rounds + 1);
  std::vector<Eigen::Isometry3d> poses;
  std::size_t pairs = 0;
  for (const Eigen::Isometry3d& X_AB : setting.queryTransforms()) {
    poses.push_back(X_AB);
    pairs += setting.fcl().countContacts(X_AB);
    if (pairs > most) break;
  }
  return poses;
}

/// FCL's distance of two triangles does not try the face of one whose normal, the product of two sides, is this short:
/// it is too large, or 0.
bool hasFacelessTriangles(const Mesh& mesh) {
  for (std::size_t t = 0; t < mesh.triangleCount(); ++t) {
    const fcl::Triangle i = mesh.triangle(t);
    const Eigen::Vector3d& p = mesh.vertex(i[0]);
    if ((mesh.vertex(i[1]) - p).cross(mesh.vertex(i[2]) - p).squaredNorm() <= 1e-15) return true;
  }
  return false;
}

void compareDistances(const BenchSetting& setting, BenchReport& report, const std::string& what,
                      const std::vector<Eigen::Isometry3d>& X_ABs, const std::vector<double>& ours,
                      const std::vector<double>& theirs) {
  const bool may_be_wrong = hasFacelessTriangles(*setting.meshA()) || hasFacelessTriangles(*setting.meshB());
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < ours.size(); ++i) {
    if (std::abs(theirs[i] - ours[i]) <= 1e-9 * theirs[i]) continue;
    if (may_be_wrong && (theirs[i] > ours[i] || theirs[i] == 0)) {
      ++wrong;
      continue;
    }
    report.mustBeEqual(false, what,
                       " (bocst " + formatPlain(ours[i]) + ", FCL " + formatPlain(theirs[i]) + " at --pose " +
                           Pose::fromTransform(X_ABs[i]).text() + ")");
    break;
  }
  if (wrong == 0) return;
  report.note(what + ": FCL's are wrong at " + std::to_string(wrong) + " of " + counted(ours.size(), "pose") +
              ", because it skips the faces of triangles with areas below 1.6e-8; scale the meshes to compare");
}

/// A first distance of both sides, where the meshes are apart. FCL's trees are the same whatever is asked, so they are
/// not built once more.
void benchFirstDistance(BenchSetting& setting, BenchReport& report) {
  std::vector<double> ours, theirs, our_distances, fcl_distances;
  for (const Eigen::Isometry3d& X_AB : setting.apartPoses()) {
    const Stopwatch fcl_watch;
    fcl_distances.push_back(setting.fcl().distance(X_AB));
    theirs.push_back(setting.fclBuildTime() + fcl_watch.microseconds());
    HandedOver a(*setting.meshA()), b(*setting.meshB());
    const Stopwatch watch;
    const std::unique_ptr<BocstPair> bocst = makeBocstPair(std::move(a), std::move(b), Options{});
    our_distances.push_back(bocst->distance(X_AB));
    ours.push_back(watch.microseconds());
  }
  if (ours.empty()) return report.skip("first_distance", "all poses touch");
  compareDistances(setting, report, "first distances", setting.apartPoses(), our_distances, fcl_distances);
  report.compare("first_distance", "first distance, median", BenchRow::Unit::kMicroseconds, quantile(ours, 0.5),
                 quantile(theirs, 0.5));
}

}  // namespace

void benchWarm(BenchSetting& setting, BenchReport& report) {
  const std::unique_ptr<BocstPair> pair = setting.makeBocst();
  const std::vector<Eigen::Isometry3d>& X_ABs = setting.queryTransforms();
  warmUp(*pair, X_ABs);
  Side<bool> bocst(X_ABs, [&](const Eigen::Isometry3d& X_AB) { return pair->touch(X_AB); });
  Side<bool> fcl(X_ABs, [&](const Eigen::Isometry3d& X_AB) { return setting.fcl().touch(X_AB); });
  takeTurns(bocst, fcl, setting.request().rounds, "warm");
  report.verdicts(bocst.answers(), fcl.answers(), X_ABs);

  const std::vector<double> ours = bocst.medians(), theirs = fcl.medians();
  const std::vector<bool>& hits = fcl.answers();
  report.compareTimes("query", "query", ours, theirs);
  comparePenetration(report, "query_miss", "query without contact", where(hits, false, ours),
                     where(hits, false, theirs));
  comparePenetration(report, "query_hit", "query with contact", where(hits, true, ours), where(hits, true, theirs));
  noteWorst(setting, report, ours, theirs);
}

void benchContacts(BenchSetting& setting, BenchReport& report) {
  const std::vector<Eigen::Isometry3d> X_ABs = posesForContacts(setting);
  const std::unique_ptr<BocstPair> pair = makeAgeless(setting);
  bool same = true;
  std::size_t count = 0;
  for (const Eigen::Isometry3d& X_AB : X_ABs) {
    const std::vector<QueryPair::Contact> contacts = pair->contacts(X_AB);
    count += contacts.size();
    same &= contacts == setting.fcl().contacts(X_AB);
  }
  report.mustBeEqual(same, "pairs of triangles");

  warmUp(*pair, X_ABs, [&pair](const Eigen::Isometry3d& X_AB) { pair->countContacts(X_AB); });
  Side<std::size_t> bocst(X_ABs, [&](const Eigen::Isometry3d& X_AB) { return pair->countContacts(X_AB); });
  Side<std::size_t> fcl(X_ABs, [&](const Eigen::Isometry3d& X_AB) { return setting.fcl().countContacts(X_AB); });
  takeTurns(bocst, fcl, setting.request().rounds, "contacts");
  report.compareTimes("contacts", "all contacts", bocst.medians(), fcl.medians());
  report.set("contacts", {{"poses", X_ABs.size()}, {"pairs", count}});
  report.note("contacts: " + std::to_string(X_ABs.size()) + " poses, " + std::to_string(count) + " pairs of triangles");
}

void benchDistance(BenchSetting& setting, BenchReport& report) {
  benchFirstDistance(setting, report);
  std::vector<Eigen::Isometry3d> apart;
  for (std::size_t i = 0; i < setting.queryTransforms().size(); ++i) {
    if (!setting.queryVerdicts()[i]) apart.push_back(setting.queryTransforms()[i]);
  }
  if (apart.empty()) return report.skip("distance", "all poses touch");
  const std::unique_ptr<BocstPair> pair = makeAgeless(setting);
  warmUp(*pair, apart, [&pair](const Eigen::Isometry3d& X_AB) { pair->distance(X_AB); });
  Side<double> bocst(apart, [&](const Eigen::Isometry3d& X_AB) { return pair->distance(X_AB); });
  Side<double> fcl(apart, [&](const Eigen::Isometry3d& X_AB) { return setting.fcl().distance(X_AB); });
  takeTurns(bocst, fcl, setting.request().rounds, "distance");
  compareDistances(setting, report, "distances", apart, bocst.answers(), fcl.answers());
  report.compareTimes("distance", "distance", bocst.medians(), fcl.medians());
}

}  // namespace bocst::program
