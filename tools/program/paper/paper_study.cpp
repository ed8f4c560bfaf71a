// SPDX-License-Identifier: BSD-3-Clause
#include "paper/paper_study.h"

#include <bocst/model.h>

#include <algorithm>
#include <stdexcept>

#include "mesh/node_levels.h"

namespace bocst::program {
namespace {

constexpr int kTableDepth = 7;
constexpr int kFigureDepth = 6;
constexpr double kFigureDimensions[] = {576, 640, 704, 832, 960};  // between those of the tables

std::vector<NodeView> wholeTree(const std::shared_ptr<const Mesh>& mesh, double dimension, int depth,
                                OracleKind oracle) {
  Options options;
  options.subdivision = dimension == 0 ? Subdivision::kOctree : Subdivision::kBono;
  options.dimension = dimension;
  options.answer = Answer::kConservative;
  options.depth = depth;
  options.oracle = oracle;
  Modeld model(mesh, options);
  model.expandAll(depth);
  std::vector<NodeView> nodes;
  model.visit([&nodes](const NodeView& node) { nodes.push_back(node); });
  return nodes;
}

Json jsonOf(const Animation::Part& part) {
  return {{"frames", part.frames},
          {"hits", part.hits},
          {"queries", part.octants},
          {"queries_at_rest", part.still_octants},
          {"gl_queries", part.gl_queries},
          {"time_us", part.microseconds},
          {"quiet_time_us", part.quiet_microseconds}};
}

}  // namespace

std::string methodName(Subdivision subdivision) { return subdivision == Subdivision::kOctree ? "O" : "B"; }

std::string methodOf(const TreeStudy::Tree& tree) {
  return methodName(tree.dimension == 0 ? Subdivision::kOctree : Subdivision::kBono);
}

const TreeStudy::Tree& TreeStudy::at(double dimension) const {
  const auto tree =
      std::find_if(trees.begin(), trees.end(), [dimension](const Tree& t) { return t.dimension == dimension; });
  if (tree == trees.end()) throw std::logic_error("no tree of this dimension was grown");
  return *tree;
}

TreeStudy studyTrees(const PaperMesh& paper, const StudyMesh& mesh, bool sampled) {
  TreeStudy study{&paper, mesh, {}};
  for (const PaperTree& row : paper.trees) study.trees.push_back({row.dimension, {}, {}, &row});
  for (const double dimension : kFigureDimensions) study.trees.push_back({dimension, {}, {}, nullptr});
  std::sort(study.trees.begin(), study.trees.end(),
            [](const TreeStudy::Tree& a, const TreeStudy::Tree& b) { return a.dimension < b.dimension; });
  Progress progress("tree", study.trees.size());
  for (TreeStudy::Tree& tree : study.trees) {
    const int depth = tree.paper != nullptr ? kTableDepth : kFigureDepth;
    tree.levels = errorByLevel(*mesh.mesh, wholeTree(mesh.mesh, tree.dimension, depth, OracleKind::kCpu));
    if (sampled && tree.paper != nullptr) {
      tree.sampled = nodesPerLevel(wholeTree(mesh.mesh, tree.dimension, depth, OracleKind::kSampled));
    }
    progress.step();
  }
  return study;
}

std::size_t AnimationStudy::touchingFrames(double dimension) const {
  const auto at = std::find(Animation::kDimensions.begin(), Animation::kDimensions.end(), dimension);
  const auto& frames_of = touching.at(static_cast<std::size_t>(at - Animation::kDimensions.begin()));
  return static_cast<std::size_t>(std::count(frames_of.begin(), frames_of.end(), true));
}

AnimationStudy studyAnimation(const std::vector<StudyMesh>& meshes, const std::vector<OracleInfo>& oracles,
                              std::size_t frames) {
  AnimationStudy study;
  study.object = meshes.front();
  study.frames = frames;
  std::array<std::shared_ptr<const Mesh>, Animation::kObstacles> obstacles;
  for (std::size_t i = 0; i < obstacles.size(); ++i) {
    study.obstacles.push_back(meshes.size() == 1 ? meshes[0] : meshes[1 + i % (meshes.size() - 1)]);
    obstacles[i] = study.obstacles.back().mesh;
  }
  const Animation animation(study.object.mesh, obstacles, frames);
  for (const double dimension : Animation::kDimensions) study.touching.push_back(animation.touching(dimension));

  Progress progress("animation", oracles.size() * paperRuns().size());
  for (const OracleInfo& oracle : oracles) {
    study.oracles.push_back({oracle, {}});
    for (const PaperRun& paper : paperRuns()) {
      progress.step();
      if (!oracle.why_not.empty()) continue;
      AnimationStudy::Column column{&paper, {}, 0};
      column.run = animation.run({paper.subdivision, paper.depth, paper.dimension, oracle.kind});
      const auto at = std::find(Animation::kDimensions.begin(), Animation::kDimensions.end(), paper.dimension);
      const auto& touches = study.touching.at(static_cast<std::size_t>(at - Animation::kDimensions.begin()));
      for (std::size_t f = 0; f < frames; ++f) column.missed += touches[f] && !column.run.hit[f];
      study.oracles.back().columns.push_back(std::move(column));
    }
  }
  return study;
}

Json json(const TreeStudy& study) {
  Json report = {{"table", study.paper->table},
                 {"figure", study.paper->figure},
                 {"mesh", study.mesh.file},
                 {"triangles_of_file", study.mesh.triangles_of_file},
                 {"triangles", study.mesh.mesh->triangleCount()},
                 {"trees", Json::array()}};
  for (const TreeStudy::Tree& tree : study.trees) {
    Json levels = Json::array();
    for (std::size_t i = 0; i < tree.levels.size(); ++i) {
      const LevelError& level = tree.levels[i];
      Json entry = {{"level", i + 1},
                    {"nodes", level.nodes},
                    {"error_min", level.min},
                    {"error_avg", level.average},
                    {"error_max", level.max}};
      if (i < tree.sampled.size()) entry["nodes_sampled"] = tree.sampled[i];
      if (tree.paper != nullptr && i < tree.paper->nodes.size()) entry["nodes_paper"] = tree.paper->nodes[i];
      levels.push_back(entry);
    }
    report["trees"].push_back({{"method", methodOf(tree)},
                               {"dimension", tree.dimension == 0 ? Json() : Json(tree.dimension)},
                               {"levels", levels}});
  }
  return report;
}

Json json(const AnimationStudy& study) {
  Json report = {{"object", study.object.file},
                 {"obstacles", Json::array()},
                 {"frames", study.frames},
                 {"seconds", Animation::kSeconds},
                 {"max_time_ms", Animation::kMaxTime.count()},
                 {"touching", Json::array()},
                 {"oracles", Json::array()}};
  for (const StudyMesh& obstacle : study.obstacles) report["obstacles"].push_back(obstacle.file);
  for (const double dimension : Animation::kDimensions) {
    report["touching"].push_back({{"dimension", dimension}, {"frames", study.touchingFrames(dimension)}});
  }
  for (const AnimationStudy::OfOracle& of : study.oracles) {
    Json runs = Json::array();
    for (const AnimationStudy::Column& column : of.columns) {
      const PaperRun& paper = *column.paper;
      Json run = {{"table", paper.table},
                  {"dimension", paper.dimension},
                  {"method", methodName(paper.subdivision)},
                  {"depth", paper.depth},
                  {"missed", column.missed},
                  {"peak_nodes", column.run.peak_nodes},
                  {"last_nodes", column.run.last_nodes},
                  {"pruned_nodes", column.run.pruned_nodes},
                  {"all", jsonOf(column.run.all)},
                  {"by_second", Json::array()},
                  {"paper", {{"time_us", 1e6 * paper.seconds}, {"queries", paper.queries()}}}};
      for (const Animation::Part& second : column.run.seconds) run["by_second"].push_back(jsonOf(second));
      runs.push_back(run);
    }
    report["oracles"].push_back({{"name", of.oracle.name},
                                 {"device", of.oracle.device},
                                 {"hardware", of.oracle.hardware},
                                 {"why_not", of.oracle.why_not},
                                 {"runs", runs}});
  }
  return report;
}

}  // namespace bocst::program
