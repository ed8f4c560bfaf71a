// SPDX-License-Identifier: BSD-3-Clause
// Meshes that cubes divide badly: what the worst inputs cost beside FCL's build and queries.
#include <cmath>
#include <functional>

#include "bench/bench_scenarios.h"
#include "pairs/poses.h"

namespace bocst::program {
namespace {

using Eigen::Vector3d;

struct Triangles {
  std::vector<Vector3d> vertices;
  std::vector<fcl::Triangle> triangles;

  std::shared_ptr<const Mesh> mesh() const { return std::make_shared<const Mesh>(vertices, triangles); }

  void add(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
    const std::size_t first = vertices.size();
    for (const Vector3d& v : {a, b, c}) vertices.push_back(v);
    triangles.emplace_back(first, first + 1, first + 2);
  }
};

/// A grid of `rows` times `columns` quads; at(u, v) with u and v from 0 to 1.
Triangles sheet(std::size_t rows, std::size_t columns, const std::function<Vector3d(double, double)>& at) {
  Triangles t;
  for (std::size_t i = 0; i <= rows; ++i) {
    for (std::size_t j = 0; j <= columns; ++j) {
      t.vertices.push_back(at(static_cast<double>(i) / static_cast<double>(rows),
                              static_cast<double>(j) / static_cast<double>(columns)));
    }
  }
  for (std::size_t i = 0; i < rows; ++i) {
    for (std::size_t j = 0; j < columns; ++j) {
      const std::size_t v = i * (columns + 1) + j, w = v + columns + 1;
      t.triangles.emplace_back(v, w, v + 1);
      t.triangles.emplace_back(v + 1, w, w + 1);
    }
  }
  return t;
}

/// The side of a cylinder of length 1 along x whose triangles run from end to end.
Triangles rod(double aspect, std::size_t sides) {
  const double r = 0.5 / aspect;
  return sheet(1, sides, [r](double u, double v) {
    return Vector3d(u - 0.5, r * std::cos(2 * kPi * v), r * std::sin(2 * kPi * v));
  });
}

Triangles ellipsoid(double aspect) {
  return sheet(10, 16, [aspect](double u, double v) {
    const double r = std::sin(kPi * u) / aspect;
    return Vector3d(std::cos(kPi * u), r * std::cos(2 * kPi * v), r * std::sin(2 * kPi * v));
  });
}

Triangles copies(std::size_t count, const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  Triangles t;
  for (std::size_t i = 0; i < count; ++i) t.add(a, b, c);
  return t;
}

/// Triangles round one vertex, up and down.
Triangles fan(std::size_t count) {
  Triangles t;
  t.vertices.emplace_back(0, 0, 0);
  for (std::size_t i = 0; i < count; ++i) {
    const double angle = 2 * kPi * static_cast<double>(i) / static_cast<double>(count);
    t.vertices.emplace_back(std::cos(angle), std::sin(angle), i % 2 == 0 ? 0.1 : -0.1);
  }
  for (std::size_t i = 0; i < count; ++i) t.triangles.emplace_back(0, 1 + i, 1 + (i + 1) % count);
  return t;
}

/// A fine sheet of side `size` on a square of side 1 of two triangles.
Triangles speck(std::size_t rows, double size) {
  Triangles t = sheet(rows, rows, [size](double u, double v) {
    return Vector3d(size * u, size * v, size * (0.1 * std::sin(20 * u) + 0.1 * std::cos(20 * v)));
  });
  t.add({-0.5, -0.5, -0.1}, {0.5, -0.5, -0.1}, {0.5, 0.5, -0.1});
  t.add({-0.5, -0.5, -0.1}, {0.5, 0.5, -0.1}, {-0.5, 0.5, -0.1});
  return t;
}

struct Cliff {
  std::string key, name;
  Triangles a, b;
  Vector3d shift;        ///< Of B.
  double turn = 0;       ///< Of B, about z.
  bool contacts = true;  ///< All of them are asked for, too.
};

std::vector<Cliff> cliffs() {
  std::vector<Cliff> all;
  for (const int aspect : {10, 1000, 100000}) {
    for (const std::size_t sides : {64, 512}) {
      const std::string name = std::to_string(aspect) + ":1, " + std::to_string(2 * sides) + " triangles";
      const std::string key = std::to_string(aspect) + "_" + std::to_string(2 * sides);
      const Triangles t = rod(aspect, sides);
      const double r = 0.5 / aspect;
      all.push_back({"rods_apart_" + key, "rods side by side, " + name, t, t, {0, 2.1 * r, 0}, 0, true});
      all.push_back({"rods_touch_" + key, "rods that overlap, " + name, t, t, {0.1, 1.5 * r, 0}, 0, true});
      all.push_back({"rods_crossed_" + key, "rods crossed, " + name, t, t, {0, 0, 2.1 * r}, kPi / 2, true});
    }
  }
  const Triangles needle = ellipsoid(1e9), pebble = ellipsoid(2);
  all.push_back({"needle", "ellipsoids 1e9:1", needle, needle, {0.3, 0, 0}, 0.1, true});
  all.push_back({"coincident",
                 "75 equal triangles on 75 equal segments",
                 copies(75, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}),
                 copies(75, {0, 0, 0}, {1, 1, 0}, {0.5, 0.5, 0}),
                 {0, 0, 0},
                 0,
                 true});
  all.push_back({"equal",
                 "10 000 equal triangles on a pebble",
                 copies(10000, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}),
                 pebble,
                 {0.3, 0.3, 0.2},
                 0,
                 false});
  all.push_back(
      {"fan", "fans of 10 000 triangles round one vertex", fan(10000), fan(10000), {0.01, 0.02, 0.1}, 0.5, false});
  all.push_back(
      {"speck", "500 000 triangles in 1e-5 of a large mesh", speck(500, 1e-5), pebble, {1.00001, 0, 0}, 0, false});
  return all;
}

/// A tessellated square of side 1.
Triangles plate(std::size_t rows) {
  return sheet(rows, rows, [](double u, double v) { return Vector3d(u - 0.5, v - 0.5, 0); });
}

/// With its tip at the origin; height 1, along z upwards or downwards.
Triangles cone(std::size_t sectors, double height) {
  Triangles t;
  t.vertices.emplace_back(0, 0, 0);
  for (std::size_t i = 0; i < sectors; ++i) {
    const double angle = 2 * kPi * static_cast<double>(i) / static_cast<double>(sectors);
    t.vertices.emplace_back(0.3 * std::cos(angle), 0.3 * std::sin(angle), height);
    t.triangles.emplace_back(0, 1 + i, 1 + (i + 1) % sectors);
  }
  return t;
}

/// Pairs of which many triangles are about as near as the nearest, asked kTieQueries times.
struct Tie {
  std::string key, name;
  Triangles a, b;
  double gap, turn;  ///< Along z, and about it.
};
constexpr std::size_t kTieQueries = 20;

std::vector<Tie> ties() {
  std::vector<Tie> all;
  for (const double gap : {1e-6, 1e-5, 1e-3, 0.1}) {
    const std::string name = "plates of 7200 triangles, gap " + formatPlain(gap);
    all.push_back({"plates_" + formatPlain(gap), name, plate(60), plate(60), gap, 0.3});
  }
  all.push_back({"tips", "cones of 128 triangles, tip to tip", cone(128, -1), cone(128, 1), 0.01, 0.1});
  return all;
}

void benchTie(const Tie& tie, BenchReport& report) {
  const std::shared_ptr<const Mesh> a = tie.a.mesh(), b = tie.b.mesh();
  Eigen::Isometry3d X_AB = Eigen::Isometry3d::Identity();
  X_AB.rotate(Eigen::AngleAxisd(tie.turn, Vector3d::UnitZ())).pretranslate(Vector3d(0.01, 0.02, tie.gap));
  const MeshArrays arrays_a(*a, Scalar::kDouble), arrays_b(*b, Scalar::kDouble);
  for (const bool distance : {false, true}) {
    const auto ask = [&](const QueryPair& pair) { return distance ? pair.distance(X_AB) : double(pair.touch(X_AB)); };
    // The time of all queries and of the set-up before them, and that of one more.
    const auto measure = [&](auto&& make, double& all, double& again) {
      const Stopwatch watch;
      const auto pair = make();
      for (std::size_t i = 0; i < kTieQueries; ++i) ask(*pair);
      all = watch.microseconds();
      const Stopwatch later;
      const double answer = ask(*pair);
      again = later.microseconds();
      return answer;
    };
    double ours, ours_again, theirs, theirs_again;
    const double expected = measure([&] { return buildFclPair(FclTree::kObbRss, Scalar::kDouble, arrays_a, arrays_b); },
                                    theirs, theirs_again);
    HandedOver handed_a(*a), handed_b(*b);
    const double answer =
        measure([&] { return makeBocstPair(std::move(handed_a), std::move(handed_b), Options{}); }, ours, ours_again);
    report.mustBeEqual(std::abs(answer - expected) < 1e-9, "answers of " + tie.name);
    const std::string key = tie.key + (distance ? "_distance" : "_touch");
    const std::string name = tie.name + (distance ? ", distance: " : ", yes or no: ");
    report.compare(key, name + "build and " + std::to_string(kTieQueries) + " queries", BenchRow::Unit::kMicroseconds,
                   ours, theirs);
    report.compare(key + "_again", name + "asked again", BenchRow::Unit::kMicroseconds, ours_again, theirs_again);
  }
}

}  // namespace

void benchCliffs(BenchSetting& setting, BenchReport& report) {
  for (const Tie& tie : ties()) benchTie(tie, report);
  const std::vector<Cliff> all = cliffs();
  Progress progress("cliffs: pair", all.size());
  for (const Cliff& cliff : all) {
    const std::shared_ptr<const Mesh> a = cliff.a.mesh(), b = cliff.b.mesh();
    Eigen::Isometry3d X_AB = Eigen::Isometry3d::Identity();
    X_AB.rotate(Eigen::AngleAxisd(cliff.turn, Vector3d::UnitZ())).pretranslate(cliff.shift);
    const MeshArrays arrays_a(*a, Scalar::kDouble), arrays_b(*b, Scalar::kDouble);
    std::vector<double> ours, theirs, ours_again, theirs_again;
    bool same = true;
    for (std::size_t round = 0; round < setting.request().rounds; ++round) {
      const auto ask = [&](const QueryPair& pair) {
        const bool touch = pair.touch(X_AB);
        return std::make_pair(touch, cliff.contacts ? pair.countContacts(X_AB) : 0);
      };
      const Stopwatch fcl_watch;
      const std::unique_ptr<FclPair> fcl = buildFclPair(FclTree::kObbRss, Scalar::kDouble, arrays_a, arrays_b);
      const auto fcl_answer = ask(*fcl);
      theirs.push_back(fcl_watch.microseconds());
      HandedOver handed_a(*a), handed_b(*b);
      const Stopwatch watch;
      const std::unique_ptr<BocstPair> bocst = makeBocstPair(std::move(handed_a), std::move(handed_b), Options{});
      const auto answer = ask(*bocst);
      ours.push_back(watch.microseconds());
      same &= answer.first == fcl_answer.first;
      const Stopwatch fcl_later;
      fcl->touch(X_AB);
      theirs_again.push_back(fcl_later.microseconds());
      bocst->touch(X_AB);
      const Stopwatch later;
      bocst->touch(X_AB);
      ours_again.push_back(later.microseconds());
    }
    report.mustBeEqual(same, "verdicts of " + cliff.name);
    report.compare(cliff.key, cliff.name + ": build and queries", BenchRow::Unit::kMicroseconds, quantile(ours, 0.5),
                   quantile(theirs, 0.5));
    report.compare(cliff.key + "_again", cliff.name + ": asked again", BenchRow::Unit::kMicroseconds,
                   quantile(ours_again, 0.5), quantile(theirs_again, 0.5));
    progress.step();
  }
}

}  // namespace bocst::program
