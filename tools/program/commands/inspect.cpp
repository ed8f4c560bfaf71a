// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/io.h>
#include <bocst/model.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <stdexcept>
#include <vector>

#include "cli/arguments.h"
#include "cli/file.h"
#include "cli/words.h"
#include "mesh/health.h"
#include "mesh/node_levels.h"
#include "mesh/sphere_error.h"
#include "mesh/sphere_fit.h"
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

/// @throws std::runtime_error if two trees of this depth would take more memory than the machine has.
void refuseTooLarge(const std::shared_ptr<const Mesh>& mesh, const Options& options) {
  constexpr int kTried = 9;  // tens of thousands of nodes for most meshes: enough to tell by how much a level grows
  if (options.depth <= kTried) return;
  Modeld tree(mesh, options);
  tree.expandAll(kTried);
  const Statistics statistics = tree.statistics();
  if (statistics.nodes_per_level.size() < kTried) return;  // --oracle sampled can miss the whole surface
  const auto nodes = static_cast<double>(statistics.resident_nodes);
  const double factor = static_cast<double>(statistics.nodes_per_level[kTried - 1]) /
                        static_cast<double>(statistics.nodes_per_level[kTried - 2]);
  const double growth = std::pow(factor, options.depth - kTried);
  const double bytes = growth * (2 * nodes * sizeof(NodeView) + static_cast<double>(statistics.resident_bytes));
  const double memory = static_cast<double>(sysconf(_SC_PHYS_PAGES)) * static_cast<double>(sysconf(_SC_PAGESIZE));
  if (bytes <= memory) return;
  throw std::runtime_error("--depth " + std::to_string(options.depth) + ": both trees would take about " +
                           formatBytes(bytes) + ", but this machine has " + formatBytes(memory) +
                           " of memory; each level takes about " + formatNumber(factor, 2) +
                           " times as much as the one above");
}

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
  for (const std::size_t nodes : nodesPerLevel(grown.nodes)) grown.levels.push_back({nodes});
  return grown;
}

std::string extentsText(const Mesh& mesh) { return formatVector(mesh.bounds().sizes(), 6, " x "); }

std::string watertightText(const Health& health) {
  if (!health.watertight()) return "no";
  if (!health.oriented()) return "yes, but triangles have different orientations";
  return health.volume < 0 ? "yes, inside out" : "yes";
}

std::string text(const Eigen::Vector3d& v) { return formatVector(v, 6, ", "); }

std::string text(const FaultyEdge& e) {
  return std::to_string(e.vertices[0]) + "-" + std::to_string(e.vertices[1]) + " of triangle " +
         std::to_string(e.triangles.front());
}
std::string text(std::uint32_t id) { return std::to_string(id); }

constexpr std::size_t kShownFaults = 3;  ///< Of each kind.

/// Rows that say where the faults are.
void addFaults(Table& table, const Health& health) {
  forEachFault(health, [&table](const std::string& name, std::size_t, const auto& all) {
    std::string few;
    for (std::size_t i = 0; i < std::min(all.size(), kShownFaults); ++i) few += (i > 0 ? ", " : "") + text(all[i]);
    if (!few.empty()) table.row({"  " + name, few + (all.size() > kShownFaults ? ", ..." : "")});
  });
}

/// What is wrong with a mesh, in words.
std::string faultsText(const Health& health) {
  std::string text;
  forEachFault(health, [&text](const std::string& name, std::size_t count, const auto&) {
    if (count > 0) text += (text.empty() ? "" : ", ") + name + " " + std::to_string(count);
  });
  return text.empty() ? "none" : text;
}

Json json(std::uint32_t id) { return id; }
Json json(const FaultyEdge& edge) { return {{"vertices", edge.vertices}, {"triangles", edge.triangles}}; }

Json json(const Health& health) {
  Json result = {
      {"watertight", health.watertight()}, {"oriented", health.oriented()}, {"components", health.components}};
  Json faults;
  forEachFault(health, [&](std::string name, std::size_t count, const auto& all) {
    std::replace_if(
        name.begin(), name.end(), [](char c) { return c == ' ' || c == '-'; }, '_');
    result[name] = count;
    faults[name] = Json::array();
    for (const auto& fault : all) faults[name].push_back(json(fault));
  });
  const bool has_volume = health.watertight() && health.oriented();
  result["area"] = health.area;
  result["volume"] = has_volume ? Json(health.volume) : Json();
  result["faults"] = faults;
  return result;
}

struct Inspect {
  std::string file;
  ModelArguments model;
  bool no_error = false;
  std::string spheres_file;
  std::string link;
  std::size_t sphere_count = 0;
  double tolerance = 0;
  std::string html_file;
  ImageArguments image;
  Output output;

  int run() const {
    output.check({file}, {spheres_file, html_file, image.file});
    std::optional<render::Renderer> renderer;
    if (image.wanted()) renderer.emplace(model.options().oracle);
    const std::shared_ptr<const Mesh> mesh = loadMesh(file);
    refuseTooLarge(mesh, model.options());
    const Health health = healthOf(*mesh);
    const Grown grown = grow(mesh, model.options(), !no_error), other = grow(mesh, otherOptions(), !no_error);
    std::optional<SphereFit> fit;
    if (fitted()) fit = fitSpheres(*mesh, sphere_count, tolerance);
    if (!spheres_file.empty()) {
      const std::string name = link.empty() ? std::filesystem::path(file).stem().string() : link;
      const std::vector<Sphere> spheres = fit ? fit->spheres : spheresOf(leavesAt(grown.nodes, model.depth));
      writeFile(spheres_file, sphereFile(spheres_file, spheres, name));
    }
    if (!html_file.empty()) writeFile(html_file, page(*mesh, health, grown, other).html());
    if (renderer)
      writePng(image.file, inspectPicture(*renderer, file, *mesh, grown.nodes, health.faults, model.options(), image));
    if (output.wantsJson()) {
      output.write(report(*mesh, health, grown, other, fit));
    } else {
      print(*mesh, health, grown, other, fit);
    }
    return 0;
  }

 private:
  bool fitted() const { return sphere_count > 0 || tolerance > 0; }

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
      level["error_max_length"] = no_error ? Json() : Json(error.max * 2 * grown.nodes.front().radius);
      levels.push_back(level);
    }
    return levels;
  }

  Json report(const Mesh& mesh, const Health& health, const Grown& grown, const Grown& other,
              const std::optional<SphereFit>& fit) const {
    const Eigen::Vector3d extent = mesh.bounds().sizes();
    Json report = {{"mesh", file},
                   {"vertices", mesh.vertexCount()},
                   {"triangles", mesh.triangleCount()},
                   {"extents", list(extent)},
                   {"minimum", list(mesh.bounds().min())},
                   {"maximum", list(mesh.bounds().max())},
                   {"center", list(mesh.bounds().center())},
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
    if (fit) {
      report["spheres"] = {{"count", fit->spheres.size()},
                           {"coverage", fit->coverage},
                           {"protrusion_max", fit->protrusion},
                           {"protrusion_avg", fit->average_protrusion}};
    }
    return report;
  }

  void print(const Mesh& mesh, const Health& health, const Grown& grown, const Grown& other,
             const std::optional<SphereFit>& fit) const {
    Table summary(Table::Others::kLeft);
    summary.row({"mesh", file});
    summary.row({"vertices", std::to_string(mesh.vertexCount())});
    summary.row({"triangles", std::to_string(mesh.triangleCount())});
    summary.row({"extents", extentsText(mesh)});
    summary.row({"minimum", text(mesh.bounds().min())});
    summary.row({"maximum", text(mesh.bounds().max())});
    summary.row({"centre", text(mesh.bounds().center())});
    summary.row({"components", std::to_string(health.components)});
    summary.row({"watertight", watertightText(health)});
    summary.row({"faults", faultsText(health)});
    addFaults(summary, health);
    summary.row({"area", formatNumber(health.area, 6)});
    if (health.watertight() && health.oriented()) summary.row({"volume", formatNumber(health.volume, 6)});
    summary.row({"tree", model.subdivision + ", depth " + std::to_string(model.depth) + ", oracle " + grown.oracle});
    summary.row({"grown in", formatTime(grown.microseconds)});
    if (fit) {
      summary.row({"spheres", std::to_string(fit->spheres.size()) + ", they contain " +
                                  formatNumber(100 * fit->coverage, 4) + " % of the surface and protrude by " +
                                  formatNumber(fit->protrusion, 4) + " at most, by " +
                                  formatNumber(fit->average_protrusion, 4) + " on average"});
    }
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
      table.row({"level", "nodes", "bytes", "error min", "average", "max", "max as a length"});
    }
    for (std::size_t i = 0; i < grown.levels.size(); ++i) {
      const LevelError& error = grown.levels[i];
      std::vector<std::string> row = {std::to_string(i + 1), std::to_string(error.nodes),
                                      formatBytes(static_cast<double>(grown.bytes[i]))};
      if (!no_error) {
        row.push_back(formatNumber(error.min));
        row.push_back(formatNumber(error.average));
        row.push_back(formatNumber(error.max));
        row.push_back(formatNumber(error.max * 2 * grown.nodes.front().radius));
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
    page.faults(mesh, health.faults);
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
  CLI::App* command = program.add_subcommand(
      "inspect", "check a mesh for faults; expand its whole sphere-tree, measure, export and show it");
  command->footer(
      "Lengths are in the mesh's length unit. The first faults of each kind are listed by id; the JSON report lists\n"
      "up to " +
      std::to_string(Faults::kMost) +
      " of each kind; the page and the picture mark them in red.\n"
      "--count and --tolerance fit spheres to the surface itself, which is divided where spheres protrude most. The\n"
      "spheres contain the whole surface, but not the inside of a solid.\n"
      "The error of a node (paper, 5.2) is the greatest distance from a point of its sphere to the surface inside\n"
      "that sphere, divided by the diameter of the root's sphere. Each level is shown as if the tree ended there.\n"
      "Bytes are the size of the tree when it is expanded to that level. The other subdivision is measured for\n"
      "comparison.\n"
      "Vertices with equal coordinates count as one for components, edges and duplicates.\n"
      "The page shows at most " +
      std::to_string(Page::kMaxTriangles) + " triangles (a larger mesh is simplified) and " +
      std::to_string(Page::kMaxNodes) + " nodes of a tree.");
  command->add_option("mesh", inspect->file, kMeshFile)->required();
  inspect->model.addDepth(*command);
  inspect->model.addShape(*command);
  inspect->model.addOracle(*command);
  command->add_flag("--no-error", inspect->no_error, "count the nodes, do not measure errors");
  command
      ->add_option("--spheres", inspect->spheres_file,
                   "write the spheres at the collision depth to a .ply, .json or .yaml file (cuRobo's sphere list)")
      ->type_name("FILE");
  command->add_option("--link", inspect->link, "name of the link in the .yaml file; default: the name of the mesh")
      ->type_name("NAME");
  CLI::Option* count = command->add_option("--count", inspect->sphere_count,
                                           "fit at most N spheres, instead of those at the collision depth");
  count->check(CLI::Range(std::size_t{1}, kMostSpheres))->type_name("N");
  command
      ->add_option("--tolerance", inspect->tolerance,
                   "fit as many spheres as needed, so that none protrudes from the surface by more than this length")
      ->check(positive())
      ->type_name("L")
      ->excludes(count);
  addHtml(*command, inspect->html_file);
  inspect->image.add(*command);
  addJson(*command, inspect->output);
  command->callback([inspect, command, &job] {
    refuseUnless(inspect->model.oracle == "sampled", *command, "--viewport",
                 "has an effect only with --oracle sampled");
    refuseUnless(endingOf(inspect->spheres_file) == ".yaml", *command, "--link", "needs --spheres FILE.yaml");
    read("--spheres", [&] {
      if (!inspect->spheres_file.empty()) checkSphereFile(inspect->spheres_file);
    });
    job = [inspect] { return inspect->run(); };
  });
}

}  // namespace bocst::program
