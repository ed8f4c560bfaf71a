// SPDX-License-Identifier: BSD-3-Clause
#include "cli/arguments.h"

#include <bocst/io.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>

#include "cli/words.h"

namespace bocst::program {
namespace {

std::string wrongDimension(const std::string& text) {
  double d = 0;
  std::from_chars(text.data(), text.data() + text.size(), d);
  return d == 0 || (d >= 1 && d <= 65536) ? "" : text + " is not 0 or 1 to 65536";
}

// The whole text is a number for which `holds` is true; `what` says which numbers these are.
template <typename Number, typename F>
CLI::Validator number(const char* name, const std::string& what, const F& holds) {
  CLI::Validator validator(name);
  validator.operation([what, holds](std::string& text) {
    Number value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    const bool is_one = error == std::errc() && end == text.data() + text.size() && holds(value);
    return is_one ? std::string() : text + " is not " + what;
  });
  return validator;
}

}  // namespace

void ModelArguments::addShape(CLI::App& command) {
  command
      .add_option("--subdivision", subdivision,
                  "subdivision of cells: octree (O-BOCST) or bono (B-BOCST, branch on need)")
      ->check(CLI::IsMember({"octree", "bono"}))
      ->capture_default_str();
  command
      .add_option("--dimension", dimension,
                  "the paper's d_t: the mesh's largest extent in lattice units; 0: 65536, the finest lattice")
      ->check(CLI::Validator(&wrongDimension, "0 or 1 to 65536"))
      ->capture_default_str();
}

void ModelArguments::addDepth(CLI::App& command) {
  command
      .add_option("--depth", depth,
                  "collision depth: the level of the spheres that conservative answers test; the root is level 1")
      ->check(CLI::Range(1, 17))
      ->capture_default_str();
}

void ModelArguments::addOracle(CLI::App& command) {
  command
      .add_option(
          "--oracle", oracle,
          "backend that finds the octants of a cell that the surface meets; see `bocst oracles`; sampled is the "
          "paper's, which can miss contacts")
      ->check(CLI::IsMember({"auto", "cpu", "occlusion", "compute", "sampled"}))
      ->capture_default_str();
  command.add_option("--viewport", viewport, "width and height in pixels of the views that --oracle sampled draws")
      ->check(CLI::Range(1, 4096))
      ->capture_default_str();
}

void ModelArguments::addAnswer(CLI::App& command) {
  command
      .add_option("--answer", answer,
                  "exact: triangle tests; conservative: tests of the spheres at --depth, as in the paper")
      ->check(CLI::IsMember({"exact", "conservative"}))
      ->capture_default_str();
  command.add_option("--scalar", scalar, "the scalar type of models and queries")
      ->check(CLI::IsMember({"double", "float"}))
      ->capture_default_str();
}

void ModelArguments::addAll(CLI::App& command) {
  addAnswer(command);
  addDepth(command);
  addShape(command);
  addOracle(command);
}

void ModelArguments::refuseIdle(const CLI::App& command) const {
  refuseUnless(oracle == "sampled", command, "--viewport", "has an effect only with --oracle sampled");
  refuseUnless(!exact(), command, "--depth", "has an effect only with --answer conservative");
}

Options ModelArguments::options() const {
  Options options;
  options.subdivision = subdivision == "octree" ? Subdivision::kOctree : Subdivision::kBono;
  options.dimension = dimension;
  options.answer = exact() ? Answer::kExact : Answer::kConservative;
  options.depth = depth;
  options.paper.viewport = viewport;
  options.oracle = oracle == "cpu"         ? OracleKind::kCpu
                   : oracle == "occlusion" ? OracleKind::kOcclusion
                   : oracle == "compute"   ? OracleKind::kCompute
                   : oracle == "sampled"   ? OracleKind::kSampled
                                           : OracleKind::kAuto;
  return options;
}

Json ModelArguments::json() const {
  return {{"answer", answer},       {"depth", depth},   {"subdivision", subdivision},
          {"dimension", dimension}, {"oracle", oracle}, {"scalar", scalar}};
}

void ImageArguments::add(CLI::App& command) {
  CLI::Option* image = command.add_option("--image", file, "write a picture of the result (PNG); no display is needed")
                           ->type_name("FILE")
                           ->check(outputFile(".png"));
  command.add_option("--image-nodes", nodes, "shape of the nodes in the picture")
      ->check(CLI::IsMember({"spheres", "boxes"}))
      ->capture_default_str()
      ->needs(image);
  command.add_option("--image-up", up, "the axis that points upwards in the picture")
      ->check(CLI::IsMember({"y", "z"}))
      ->capture_default_str()
      ->needs(image);
  command.add_option("--image-width", width, "width in pixels; the height is computed from it")
      ->check(CLI::Range(200, 8000))
      ->capture_default_str()
      ->needs(image);
}

std::string meshFormats() {
  std::string own, others;
  for (const MeshFormat& format : bocst::meshFormats()) {
    std::string& list = format.by_assimp ? others : own;
    list += (list.empty() ? "" : ", ") + format.ending;
  }
  return "Mesh files: " + own + ". Read by assimp, with float coordinates: " + others + ".";
}

CLI::Validator positive() {
  return number<double>("POSITIVE", "a number above 0", [](double x) { return x > 0; });
}

CLI::Validator notNegative() {
  return number<double>("NONNEGATIVE", "a finite number of at least 0",
                        [](double x) { return x >= 0 && std::isfinite(x); });
}

CLI::Validator wholeNumber(std::uint64_t least) {
  return number<std::uint64_t>("WHOLE", "a whole number from " + std::to_string(least) + " to 10^15",
                               [least](std::uint64_t n) { return n >= least && n <= 1000000000000000; });
}

CLI::Validator outputFile(const std::string& ending, bool stdout_too) {
  CLI::Validator validator("");
  validator.operation([ending, stdout_too](std::string& file) {
    if (file == "-" && !stdout_too) return std::string("stdout (-) is not supported here; use the file /dev/stdout");
    const std::string found = endingOf(file);
    const bool fits = found.empty() || found == ending;
    return fits ? std::string() : file + ": this option writes a " + ending + " file, not a " + found + " file";
  });
  return validator;
}

void addJson(CLI::App& command, Output& output) {
  command
      .add_option("--json", output.json_file,
                  "write the report as JSON to this file, instead of the table; - is stdout")
      ->type_name("FILE|-")
      ->check(outputFile(".json", true));
}

void checkStdout(const std::string& csv_file, const Output& output) {
  if (csv_file != "-" || output.json_file != "-") return;
  throw CLI::ValidationError("--csv", "--json already writes to stdout; give a file");
}

void refuseUnless(bool has_effect, const CLI::App& command, const char* option, const char* why) {
  if (!has_effect && command.get_option(option)->count() != 0) throw CLI::ValidationError(option, why);
}

void read(const char* option, const std::function<void()>& f) {
  try {
    f();
  } catch (const std::invalid_argument& e) {
    throw CLI::ValidationError(option, e.what());
  }
}

void addHtml(CLI::App& command, std::string& file) {
  command
      .add_option("--html", file,
                  "write a page that shows the result in 3D; it needs a browser with WebGL 2, but no network")
      ->type_name("FILE")
      ->check(outputFile(".html"));
}

}  // namespace bocst::program
