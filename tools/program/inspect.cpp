// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/io.h>
#include <bocst/model.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <vector>

#include "arguments.h"
#include "sphere_error.h"

namespace bocst::program {
namespace {

struct Inspect {
  std::string file;
  ModelArguments model;
  bool no_error = false;
  Output output;

  int run() const {
    output.check();
    const std::shared_ptr<const Mesh> mesh = loadMesh(file);
    Options options = model.options();
    options.ttl = std::chrono::milliseconds(0);
    const Stopwatch growing;
    Modeld tree(mesh, options);
    tree.expandAll(model.depth);
    const double grow_time = growing.microseconds();
    std::vector<NodeView> nodes;
    tree.visit([&nodes](const NodeView& node) { nodes.push_back(node); });
    const Statistics statistics = tree.statistics();

    std::vector<LevelError> levels;
    if (no_error) {
      for (const NodeView& node : nodes) {
        levels.resize(std::max(levels.size(), static_cast<std::size_t>(node.level)));
        ++levels[static_cast<std::size_t>(node.level) - 1].nodes;
      }
    } else {
      levels = errorByLevel(*mesh, nodes);
    }

    const Eigen::Vector3d extent = mesh->bounds().sizes();
    if (output.wantsJson()) {
      Json report = {{"mesh", file},
                     {"vertices", mesh->vertexCount()},
                     {"triangles", mesh->triangleCount()},
                     {"extents", {extent.x(), extent.y(), extent.z()}},
                     {"subdivision", model.subdivision},
                     {"dimension", model.dimension},
                     {"depth", model.depth},
                     {"oracle", tree.oracleName()},
                     {"nodes", statistics.resident_nodes},
                     {"tree_bytes", statistics.resident_bytes},
                     {"grow_us", grow_time},
                     {"root_radius", nodes.front().radius}};
      report["levels"] = Json::array();
      for (std::size_t i = 0; i < levels.size(); ++i) {
        Json level = {{"level", i + 1}, {"nodes", levels[i].nodes}};
        level["error_min"] = no_error ? Json() : Json(levels[i].min);
        level["error_avg"] = no_error ? Json() : Json(levels[i].average);
        level["error_max"] = no_error ? Json() : Json(levels[i].max);
        report["levels"].push_back(level);
      }
      output.write(report);
      return 0;
    }

    Table summary(Table::Others::kLeft);
    summary.row({"mesh", file});
    summary.row({"vertices", std::to_string(mesh->vertexCount())});
    summary.row({"triangles", std::to_string(mesh->triangleCount())});
    summary.row({"extents", formatNumber(extent.x(), 6) + " x " + formatNumber(extent.y(), 6) + " x " +
                                formatNumber(extent.z(), 6)});
    summary.row(
        {"tree", model.subdivision + ", depth " + std::to_string(model.depth) + ", oracle " + tree.oracleName()});
    summary.row({"grown in", formatTime(grow_time)});
    summary.row({"bytes", formatBytes(static_cast<double>(statistics.resident_bytes))});
    summary.print();
    std::cout << '\n';
    Table table;
    if (no_error) {
      table.row({"level", "nodes"});
    } else {
      table.row({"level", "nodes", "error min", "average", "max"});
    }
    for (std::size_t i = 0; i < levels.size(); ++i) {
      std::vector<std::string> row = {std::to_string(i + 1), std::to_string(levels[i].nodes)};
      if (!no_error) {
        row.push_back(formatNumber(levels[i].min));
        row.push_back(formatNumber(levels[i].average));
        row.push_back(formatNumber(levels[i].max));
      }
      table.row(row);
    }
    table.print();
    return 0;
  }
};

}  // namespace

void addInspect(CLI::App& program, Job& job) {
  auto inspect = std::make_shared<Inspect>();
  CLI::App* command = program.add_subcommand("inspect", "grow the whole tree of a mesh and measure it");
  command->footer(
      "The error of a node (paper, 5.2) is the greatest distance from a point of its sphere to the surface inside "
      "that\n"
      "sphere, divided by the diameter of the root's sphere. Each level is shown as if the tree ended there.");
  command->add_option("mesh", inspect->file, "OBJ, PLY, STL, OFF or DAE file")->required();
  inspect->model.addDepth(*command);
  inspect->model.addShape(*command);
  inspect->model.addOracle(*command);
  command->add_flag("--no-error", inspect->no_error, "count nodes only");
  addJson(*command, inspect->output);
  command->callback([inspect, &job] { job = [inspect] { return inspect->run(); }; });
}

}  // namespace bocst::program
