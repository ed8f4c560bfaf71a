// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/io.h>
#include <bocst/model.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "cli/arguments.h"
#include "cli/file.h"
#include "mesh/health.h"
#include "mesh/sphere_error.h"
#include "mesh/spheres.h"
#include "picture/inspect_picture.h"
#include "picture/page.h"

namespace bocst::program {
namespace {

/// A whole tree, down to the collision depth.
struct Grown {
  std::vector<NodeView> nodes;
  std::vector<LevelError> levels;  ///< Only nodes are counted where errors were not wanted.
  std::vector<std::size_t> bytes;  ///< Of the tree as it ended at each level.
  std::string oracle;
  double microseconds = 0;
};

Grown grow(const std::shared_ptr<const Mesh>& mesh, Options options, bool errors) {
  options.ttl = std::chrono::milliseconds(0);
  Grown grown;
  const Stopwatch watch;
  Modeld tree(mesh, options);
  tree.expandAll(options.depth);
  grown.microseconds = watch.microseconds();
  tree.visit([&grown](const NodeView& node) { grown.nodes.push_back(node); });
  grown.oracle = tree.oracleName();
  for (int level = 1; level <= options.depth; ++level) {
    tree.expandAll(level);
    grown.bytes.push_back(tree.statistics().resident_bytes);
  }
  if (errors) {
    grown.levels = errorByLevel(*mesh, grown.nodes);
    return grown;
  }
  for (const NodeView& node : grown.nodes) {
    grown.levels.resize(std::max(grown.levels.size(), static_cast<std::size_t>(node.level)));
    ++grown.levels[static_cast<std::size_t>(node.level) - 1].nodes;
  }
  return grown;
}

std::string extentsText(const Mesh& mesh) {
  const Eigen::Vector3d extent = mesh.bounds().sizes();
  return formatNumber(extent.x(), 6) + " x " + formatNumber(extent.y(), 6) + " x " + formatNumber(extent.z(), 6);
}

std::string watertightText(const Health& health) {
  if (!health.watertight()) return "no";
  if (!health.oriented()) return "yes, but triangles face both ways";
  return health.volume < 0 ? "yes, inside out" : "yes";
}

/// What is wrong with a mesh, in words.
std::string faultsText(const Health& health) {
  std::string text;
  const auto add = [&text](std::size_t count, const char* what) {
    if (count > 0) text += std::string(text.empty() ? "" : ", ") + what + " " + std::to_string(count);
  };
  add(health.open_edges, "open edges");
  add(health.non_manifold_edges, "non-manifold edges");
  add(health.flipped_edges, "flipped edges");
  add(health.degenerate_triangles, "degenerate triangles");
  add(health.duplicate_triangles, "duplicate triangles");
  add(health.repeated_vertices, "repeated vertices");
  add(health.unused_vertices, "unused vertices");
  return text.empty() ? "none" : text;
}

Json json(const Health& health) {
  const bool has_volume = health.watertight() && health.oriented();
  return {{"watertight", health.watertight()},
          {"oriented", health.oriented()},
          {"components", health.components},
          {"open_edges", health.open_edges},
          {"non_manifold_edges", health.non_manifold_edges},
          {"flipped_edges", health.flipped_edges},
          {"degenerate_triangles", health.degenerate_triangles},
          {"duplicate_triangles", health.duplicate_triangles},
          {"repeated_vertices", health.repeated_vertices},
          {"unused_vertices", health.unused_vertices},
          {"area", health.area},
          {"volume", has_volume ? Json(health.volume) : Json()}};
}

struct Inspect {
  std::string file;
  ModelArguments model;
  bool no_error = false;
  std::string spheres_file;
  std::string link;
  std::string html_file;
  ImageArguments image;
  Output output;

  int run() const {
    output.check({file}, {spheres_file, html_file, image.file});
    std::optional<render::Renderer> renderer;
    if (image.wanted()) renderer.emplace(model.options().oracle);
    const std::shared_ptr<const Mesh> mesh = loadMesh(file);
    const Health health = healthOf(*mesh);
    const Grown grown = grow(mesh, model.options(), !no_error), other = grow(mesh, otherOptions(), !no_error);
    if (!spheres_file.empty()) {
      const std::string name = link.empty() ? std::filesystem::path(file).stem().string() : link;
      writeFile(spheres_file, sphereFile(spheres_file, leavesAt(grown.nodes, model.depth), name));
    }
    if (!html_file.empty()) writeFile(html_file, page(*mesh, health, grown, other).html());
    if (renderer) writePng(image.file, inspectPicture(*renderer, file, *mesh, grown.nodes, model.options(), image));
    if (output.wantsJson()) {
      output.write(report(*mesh, health, grown, other));
    } else {
      print(*mesh, health, grown, other);
    }
    return 0;
  }

 private:
  /// The same with the other subdivision, for comparison.
  Options otherOptions() const {
    Options options = model.options();
    options.subdivision = options.subdivision == Subdivision::kOctree ? Subdivision::kBono : Subdivision::kOctree;
    return options;
  }

  Json levels(const Grown& grown) const {
    Json levels = Json::array();
    for (std::size_t i = 0; i < grown.levels.size(); ++i) {
      const LevelError& error = grown.levels[i];
      Json level = {{"level", i + 1}, {"nodes", error.nodes}, {"bytes", grown.bytes[i]}};
      level["error_min"] = no_error ? Json() : Json(error.min);
      level["error_avg"] = no_error ? Json() : Json(error.average);
      level["error_max"] = no_error ? Json() : Json(error.max);
      levels.push_back(level);
    }
    return levels;
  }

  Json report(const Mesh& mesh, const Health& health, const Grown& grown, const Grown& other) const {
    const Eigen::Vector3d extent = mesh.bounds().sizes();
    Json report = {{"mesh", file},
                   {"vertices", mesh.vertexCount()},
                   {"triangles", mesh.triangleCount()},
                   {"extents", {extent.x(), extent.y(), extent.z()}},
                   {"health", json(health)},
                   {"subdivision", model.subdivision},
                   {"dimension", model.dimension},
                   {"depth", model.depth},
                   {"oracle", grown.oracle},
                   {"nodes", grown.nodes.size()},
                   {"tree_bytes", grown.bytes.back()},
                   {"grow_us", grown.microseconds},
                   {"root_radius", grown.nodes.front().radius}};
    report["levels"] = levels(grown);
    report["other"] = {{"subdivision", otherOptions().subdivision == Subdivision::kOctree ? "octree" : "bono"},
                       {"nodes", other.nodes.size()},
                       {"tree_bytes", other.bytes.back()},
                       {"levels", levels(other)}};
    return report;
  }

  void print(const Mesh& mesh, const Health& health, const Grown& grown, const Grown& other) const {
    Table summary(Table::Others::kLeft);
    summary.row({"mesh", file});
    summary.row({"vertices", std::to_string(mesh.vertexCount())});
    summary.row({"triangles", std::to_string(mesh.triangleCount())});
    summary.row({"extents", extentsText(mesh)});
    summary.row({"components", std::to_string(health.components)});
    summary.row({"watertight", watertightText(health)});
    summary.row({"faults", faultsText(health)});
    summary.row({"area", formatNumber(health.area, 6)});
    if (health.watertight() && health.oriented()) summary.row({"volume", formatNumber(health.volume, 6)});
    summary.row({"tree", model.subdivision + ", depth " + std::to_string(model.depth) + ", oracle " + grown.oracle});
    summary.row({"grown in", formatTime(grown.microseconds)});
    summary.print();
    print(model.options().subdivision, grown);
    print(otherOptions().subdivision, other);
  }

  void print(Subdivision subdivision, const Grown& grown) const {
    std::cout << '\n' << (subdivision == Subdivision::kOctree ? "O-BOCST, octree" : "B-BOCST, branch on need") << '\n';
    Table table;
    if (no_error) {
      table.row({"level", "nodes", "bytes"});
    } else {
      table.row({"level", "nodes", "bytes", "error min", "average", "max"});
    }
    for (std::size_t i = 0; i < grown.levels.size(); ++i) {
      const LevelError& error = grown.levels[i];
      std::vector<std::string> row = {std::to_string(i + 1), std::to_string(error.nodes),
                                      formatBytes(static_cast<double>(grown.bytes[i]))};
      if (!no_error) {
        row.push_back(formatNumber(error.min));
        row.push_back(formatNumber(error.average));
        row.push_back(formatNumber(error.max));
      }
      table.row(row);
    }
    table.print();
  }

  /// Both subdivisions, the asked for first.
  Page page(const Mesh& mesh, const Health& health, const Grown& grown, const Grown& other) const {
    Page page(std::filesystem::path(file).filename().string());
    page.fact("triangles", std::to_string(mesh.triangleCount()));
    page.fact("vertices", std::to_string(mesh.vertexCount()));
    page.fact("extents", extentsText(mesh));
    page.fact("components", std::to_string(health.components));
    page.fact("watertight", watertightText(health));
    page.fact("faults", faultsText(health));
    page.object(std::filesystem::path(file).filename().string(), mesh);
    const auto add = [&](const Grown& tree, Subdivision subdivision) {
      page.tree(mesh, tree.nodes, subdivision, model.dimension, no_error ? std::vector<LevelError>() : tree.levels);
    };
    add(grown, model.options().subdivision);
    add(other, otherOptions().subdivision);
    return page;
  }
};

}  // namespace

void addInspect(CLI::App& program, Job& job) {
  auto inspect = std::make_shared<Inspect>();
  CLI::App* command =
      program.add_subcommand("inspect", "the health of a mesh; grow its whole tree and measure, export and show it");
  command->footer(
      "The error of a node (paper, 5.2) is the greatest distance from a point of its sphere to the surface inside "
      "that\n"
      "sphere, divided by the diameter of the root's sphere. Each level is shown as if the tree ended there.\n"
      "Bytes are those of the tree when it had grown to that level. The other subdivision is measured for comparison.\n"
      "Vertices with equal coordinates count as one for components, edges and duplicates.\n"
      "The page shows at most " +
      std::to_string(Page::kMaxTriangles) + " triangles (a larger mesh is made coarser) and " +
      std::to_string(Page::kMaxNodes) + " nodes of a tree.");
  command->add_option("mesh", inspect->file, "OBJ, PLY, STL, OFF or DAE file")->required();
  inspect->model.addDepth(*command);
  inspect->model.addShape(*command);
  inspect->model.addOracle(*command);
  command->add_flag("--no-error", inspect->no_error, "count nodes only");
  command
      ->add_option("--spheres", inspect->spheres_file,
                   "write the spheres of the collision depth: .ply, .json or .yaml (cuRobo's sphere list)")
      ->type_name("FILE");
  command->add_option("--link", inspect->link, "the link's name in the .yaml file; the mesh's if not given")
      ->type_name("NAME");
  addHtml(*command, inspect->html_file);
  inspect->image.add(*command);
  addJson(*command, inspect->output);
  command->callback([inspect, &job] {
    try {
      if (!inspect->spheres_file.empty()) checkSphereFile(inspect->spheres_file);
    } catch (const std::invalid_argument& e) {
      throw CLI::ValidationError("--spheres", e.what());
    }
    job = [inspect] { return inspect->run(); };
  });
}

}  // namespace bocst::program
