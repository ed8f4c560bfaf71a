// SPDX-License-Identifier: BSD-3-Clause
// The parts of `bocst paper`: the animation against an independent reference, the trees against counts made by hand,
// the report against the study, plots by their pixels.
#include <bocst/model.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <string>
#include <vector>

#include "mesh/decimate.h"
#include "mesh/health.h"
#include "meshes.h"
#include "paper/animation.h"
#include "paper/paper_report.h"
#include "paper/plot.h"

namespace bocst {
namespace {

using program::Animation;

constexpr std::size_t kFrames = 140;  // twenty a second

Animation animationOf(const test::Raw& raw) { return {raw.mesh(), {raw.mesh(), raw.mesh(), raw.mesh()}, kFrames}; }

bool usable(OracleKind kind) {
  for (const OracleInfo& oracle : availableOracles()) {
    if (oracle.kind == kind && oracle.why_not.empty()) return true;
  }
  return false;
}

TEST(PaperAnimation, StandsStillInSomeSecondsOnly) {
  const Animation animation = animationOf(test::torus(20));
  for (std::size_t f = 0; f < kFrames; ++f) {
    const double time = animation.timeOf(f);
    const auto second = static_cast<std::size_t>(time) + 1;
    const bool still = animation.poseAt(time).isApprox(animation.poseAt(static_cast<double>(second) - 1e-9), 0);
    EXPECT_EQ(still, Animation::rests(second)) << "at " << time;
  }
  EXPECT_TRUE(animation.poseAt(-1).isApprox(animation.poseAt(0), 0));
  EXPECT_TRUE(animation.poseAt(99).isApprox(animation.poseAt(7), 0));
}

TEST(PaperAnimation, SinksIntoTheFirstAndIsJustClearOfTheOthers) {
  const std::vector<bool> touching = animationOf(test::torus(20)).touching(514);
  for (const std::size_t second : {1u, 3u, 5u, 7u}) {
    for (std::size_t f = 20 * (second - 1); f < 20 * second; ++f) EXPECT_EQ(touching[f], second == 3) << f;
  }
}

TEST(PaperAnimation, NeverMissesAndAsksTheSameWithEveryOracle) {
  // Fewer triangles than the root grid takes, so that the CPU asks as the others do.
  const Animation animation = animationOf(test::torus(30));
  for (const double dimension : Animation::kDimensions) {
    const std::vector<bool> touching = animation.touching(dimension);
    for (const auto& [subdivision, depth] : {std::pair(Subdivision::kOctree, 5), {Subdivision::kBono, 6}}) {
      const Animation::Run cpu = animation.run({subdivision, depth, dimension, OracleKind::kCpu});
      EXPECT_EQ(cpu.all.frames, kFrames);
      EXPECT_GT(cpu.all.octants, 0u);
      EXPECT_EQ(cpu.all.gl_queries, 0u);
      std::size_t frames = 0, hits = 0;
      std::uint64_t octants = 0;
      for (std::size_t s = 0; s < Animation::kSeconds; ++s) {
        const Animation::Part& part = cpu.seconds.at(s);
        frames += part.frames;
        hits += part.hits;
        octants += part.octants;
        EXPECT_GT(part.microseconds, 0);
        EXPECT_EQ(part.still_octants, 0u) << "second " << s + 1;
        EXPECT_LE(part.quiet_microseconds, part.microseconds);
      }
      EXPECT_EQ(frames, kFrames);
      EXPECT_EQ(octants, cpu.all.octants);
      EXPECT_EQ(hits, cpu.all.hits);
      EXPECT_EQ(hits, static_cast<std::size_t>(std::count(cpu.hit.begin(), cpu.hit.end(), true)));
      for (std::size_t f = 0; f < kFrames; ++f) EXPECT_TRUE(cpu.hit[f] || !touching[f]) << "missed frame " << f;
      EXPECT_GT(cpu.pruned_nodes, 0u) << "what was left behind in second 3 is dropped by second 7";
      EXPECT_LT(cpu.last_nodes, cpu.peak_nodes);

      for (const OracleKind kind : {OracleKind::kOcclusion, OracleKind::kCompute, OracleKind::kSampled}) {
        if (!usable(kind)) continue;
        const Animation::Run other = animation.run({subdivision, depth, dimension, kind});
        if (kind == OracleKind::kSampled) {
          EXPECT_GE(other.all.gl_queries, other.all.octants);
          EXPECT_LE(other.all.gl_queries, 3 * other.all.octants);
          continue;
        }
        EXPECT_EQ(other.hit, cpu.hit);
        EXPECT_EQ(other.peak_nodes, cpu.peak_nodes);
        for (std::size_t s = 0; s < Animation::kSeconds; ++s) {
          EXPECT_EQ(other.seconds[s].octants, cpu.seconds[s].octants) << "second " << s + 1;
        }
        // One occlusion query an octant, counted where OpenGL is called.
        EXPECT_EQ(other.all.gl_queries, kind == OracleKind::kOcclusion ? other.all.octants : 0);
      }
    }
  }
}

program::StudyMesh studyMesh(const test::Raw& raw) { return {"some mesh.off", raw.triangles.size(), raw.mesh()}; }

TEST(PaperTrees, CountTheCellsOfACubeAsOneWouldByHand) {
  const program::TreeStudy study =
      program::studyTrees(program::paperMeshes()[0], studyMesh(test::box({0, 0, 0}, {1, 1, 1})), false);
  const auto& levels = study.at(0).levels;
  ASSERT_EQ(levels.size(), 7u);
  for (std::size_t l = 1; l <= levels.size(); ++l) {
    const std::size_t side = std::size_t{1} << (l - 1), inner = side > 2 ? side - 2 : 0;
    EXPECT_EQ(levels[l - 1].nodes, side * side * side - inner * inner * inner) << "level " << l;
  }
  EXPECT_THROW(study.at(515), std::logic_error);
  // At 514 the first cut of B leaves a slab of 2 units: its upper cells are one layer.
  const auto& narrow = study.at(514).levels;
  EXPECT_EQ(narrow[1].nodes, 8u);
  EXPECT_GT(narrow[4].average, 1.2 * levels[4].average);
}

TEST(PaperTrees, TheSampledFormFindsNoMoreThanThereIs) {
  ASSERT_TRUE(usable(OracleKind::kSampled)) << "tests need an EGL device, llvmpipe at least";
  const program::TreeStudy study = program::studyTrees(program::paperMeshes()[1], studyMesh(test::torus(12)), true);
  for (const auto& tree : study.trees) {
    if (tree.paper == nullptr) continue;
    ASSERT_FALSE(tree.sampled.empty());
    for (std::size_t l = 0; l < tree.sampled.size(); ++l) EXPECT_LE(tree.sampled[l], tree.levels[l].nodes);
  }
}

TEST(PaperReport, NamesOraclesThatCannotBeHad) {
  const program::StudyMesh mesh = studyMesh(test::torus(8));
  const std::vector<OracleInfo> oracles = {{OracleKind::kCpu, "cpu", "here", false, ""},
                                           {OracleKind::kOcclusion, "occlusion", "", false, "no driver at all"}};
  program::PaperStudy study;
  study.animation = program::studyAnimation({mesh}, oracles, 30);
  ASSERT_EQ(study.animation.oracles.size(), 2u);
  EXPECT_EQ(study.animation.oracles[0].columns.size(), program::paperRuns().size());
  EXPECT_TRUE(study.animation.oracles[1].columns.empty());
  const program::PaperReport report = program::paperReport(study, "bocst paper");
  EXPECT_NE(report.text.find("| occlusion | not to be had: no driver at all |"), std::string::npos) << report.text;
  // Each picture is shown once.
  EXPECT_EQ(report.pictures.size(), 3u);
  for (const auto& picture : report.pictures) {
    EXPECT_NE(report.text.find("](" + picture.name + ")"), std::string::npos) << picture.name;
  }
  // Without any oracle there is still a report.
  study.animation.oracles[0].columns.clear();
  EXPECT_TRUE(program::paperReport(study, "bocst paper").pictures.empty());
}

TEST(PaperValues, AddUpAsThePaperSays) {
  // The totals of tables 1 and 2, of 6 levels.
  const std::vector<std::vector<std::size_t>> totals = {{4457, 1068, 2406, 3324, 4404}, {2216, 546, 1219, 1716, 2232}};
  for (std::size_t m = 0; m < totals.size(); ++m) {
    for (std::size_t i = 0; i < totals[m].size(); ++i) {
      const std::vector<std::size_t>& nodes = program::paperMeshes()[m].trees[i].nodes;
      EXPECT_EQ(std::accumulate(nodes.begin(), nodes.begin() + 6, std::size_t{0}), totals[m][i]) << m << i;
    }
  }
  const std::vector<std::size_t> queries = {944, 460, 896, 3128, 1612, 4206, 3628, 3142, 7194};
  for (std::size_t i = 0; i < queries.size(); ++i) EXPECT_EQ(program::paperRuns()[i].queries(), queries[i]);
}

TEST(Decimation, KeepsTheShape) {
  const test::Raw raw = test::torus(60);
  const auto mesh = raw.mesh();
  const auto small = program::decimated(mesh, 1000);
  EXPECT_LE(small->triangleCount(), 1000u);
  EXPECT_GT(small->triangleCount(), 900u);
  EXPECT_TRUE(program::healthOf(*small).watertight());
  const double volume = program::healthOf(*mesh).volume;
  EXPECT_NEAR(program::healthOf(*small).volume / volume, 1, 0.05);
  for (const Eigen::Vector3d& v : small->vertices()) {
    EXPECT_NE(std::find(raw.vertices.begin(), raw.vertices.end(), v), raw.vertices.end());
  }
  EXPECT_EQ(program::decimated(mesh, mesh->triangleCount()), mesh) << "small enough already";
}

TEST(Decimation, TakesWhatIsHardToReduce) {
  // Every triangle with corners of its own, far from the origin.
  test::Raw raw = test::torus(40);
  test::Raw exploded;
  for (const fcl::Triangle& t : raw.triangles) {
    for (std::size_t k = 0; k < 3; ++k) exploded.vertices.push_back(raw.vertices[t[k]]);
    exploded.triangles.emplace_back(exploded.vertices.size() - 3, exploded.vertices.size() - 2,
                                    exploded.vertices.size() - 1);
  }
  const auto far = program::decimated(exploded.move({1e6, -1e6, 0}).mesh(), 500);
  EXPECT_LE(far->triangleCount(), 500u);
  EXPECT_TRUE(program::healthOf(*far).watertight());
  // Points and needles: whatever is left is a mesh.
  test::Raw needles;
  for (int i = 0; i < 50; ++i) {
    needles.vertices.push_back({i * 1.0, 0, 0});
    needles.triangles.emplace_back(i, i, i / 2);
  }
  EXPECT_GE(program::decimated(needles.mesh(), 10)->triangleCount(), 1u);
}

TEST(PlotTicks, AreRoundAndEnough) {
  EXPECT_EQ(program::roundTicks(0, 702, 5), (std::vector<double>{0, 200, 400, 600, 800}));
  EXPECT_EQ(program::roundTicks(0, 0, 5).front(), 0);
  EXPECT_EQ(program::roundTicks(0, 1000, 5).back(), 1000);
  EXPECT_EQ(program::logarithmicTicks(0.03, 0.4), (std::vector<double>{0.02, 0.05, 0.1, 0.2, 0.5}));
  for (const auto& [low, high] : {std::pair(3.0, 3.0), {1e-7, 1e9}, {1.0, 10.0}, {0.999, 1.001}}) {
    const std::vector<double> ticks = program::logarithmicTicks(low, high);
    EXPECT_GE(ticks.size(), 2u);
    EXPECT_LE(ticks.front(), low);
    EXPECT_GE(ticks.back(), high);
    EXPECT_LE(ticks.size(), 24u);
  }
}

/// Pixels that are saturated enough to belong to a line.
std::size_t colouredPixels(const program::Picture& picture) {
  cairo_surface_flush(picture.get());
  const unsigned char* data = cairo_image_surface_get_data(picture.get());
  std::size_t count = 0;
  for (int y = 0; y < cairo_image_surface_get_height(picture.get()); ++y) {
    for (int x = 0; x < cairo_image_surface_get_width(picture.get()); ++x) {
      const unsigned char* p = data + y * cairo_image_surface_get_stride(picture.get()) + 4 * x;
      count += std::max({p[0], p[1], p[2]}) - std::min({p[0], p[1], p[2]}) > 100;
    }
  }
  return count;
}

TEST(Plots, ShowTheirLines) {
  program::Plot plot{"Title", "x", "y", {1, 2, 3}, false, {}};
  const std::size_t empty = colouredPixels(program::drawPlots({plot}, 600, 400));
  EXPECT_EQ(empty, 0u);
  program::PlotLine line;
  line.points = {{1, 5}, {2, 50}, {3, 20}};
  plot.lines = {line};
  const std::size_t solid = colouredPixels(program::drawPlots({plot}, 600, 400));
  EXPECT_GT(solid, 2u * 500) << "two pixels wide, over most of the picture";
  plot.lines[0].style = program::PlotLine::Style::kDashed;
  const std::size_t dashed = colouredPixels(program::drawPlots({plot}, 600, 400));
  EXPECT_LT(dashed, solid * 3 / 4);
  EXPECT_GT(dashed, solid / 3);
  // Two plots are two pictures, one below the other.
  EXPECT_EQ(colouredPixels(program::drawPlots({plot, plot}, 600, 400)), 2 * dashed);
}

TEST(Plots, TakeWhatCannotBeDrawn) {
  program::Plot plot{"", "", "", {}, true, {}};
  program::PlotLine line;
  line.points = {{1, 0}, {2, -1}, {3, std::nan("")}, {4, INFINITY}};
  plot.lines = {line};
  EXPECT_EQ(colouredPixels(program::drawPlots({plot}, 300, 200)), 0u);
  plot.lines[0].points.push_back({4, 1});
  EXPECT_GT(colouredPixels(program::drawPlots({plot}, 300, 200)), 0u);
}

}  // namespace
}  // namespace bocst
