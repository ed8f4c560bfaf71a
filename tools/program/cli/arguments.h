// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/options.h>

#include <cstdint>
#include <functional>
#include <string>

#include "cli/report.h"
#include "pairs/query_pair.h"
#include "render/renderer.h"

namespace CLI {
class App;
class Validator;
}  // namespace CLI

namespace bocst::program {

/// What the command line asked for; returns the exit code.
using Job = std::function<int()>;

/// Each adds its subcommand to the program; choosing it sets `job`.
void addCollide(CLI::App& program, Job& job);
void addInspect(CLI::App& program, Job& job);
void addValidate(CLI::App& program, Job& job);
void addMerge(CLI::App& program, Job& job);
void addScene(CLI::App& program, Job& job);
void addBench(CLI::App& program, Job& job);
void addPaper(CLI::App& program, Job& job);
void addOracles(CLI::App& program, Job& job);
void addManual(CLI::App& program, Job& job);  ///< After all others.

/// The options of a model as the command line spells them.
struct ModelArguments {
  std::string subdivision = "bono";
  double dimension = 0;
  std::string answer = "exact";
  int depth = Options{}.depth;
  std::string oracle = "auto";
  int viewport = PaperOptions{}.viewport;
  std::string scalar = "double";

  void addShape(CLI::App& command);   ///< --subdivision --dimension
  void addDepth(CLI::App& command);   ///< --depth
  void addOracle(CLI::App& command);  ///< --oracle --viewport
  void addAnswer(CLI::App& command);  ///< --answer --scalar
  void addAll(CLI::App& command);

  /// @throws CLI::ValidationError for an option of addAll() that has no effect beside the others.
  void refuseIdle(const CLI::App& command) const;

  Options options() const;
  Scalar scalarKind() const { return scalar == "float" ? Scalar::kFloat : Scalar::kDouble; }
  bool exact() const { return answer == "exact"; }
  std::string answerText() const { return exact() ? "exact" : "conservative, depth " + std::to_string(depth); }
  Json json() const;
};

/// A picture of what a command looks at.
struct ImageArguments {
  std::string file;
  std::string nodes = "spheres";
  std::string up = "z";
  int width = 1600;

  void add(CLI::App& command);  ///< --image --image-nodes --image-up --image-width
  bool wanted() const { return !file.empty(); }
  render::Volumes::Shape shape() const {
    return nodes == "boxes" ? render::Volumes::Shape::kBoxes : render::Volumes::Shape::kSpheres;
  }
  render::Up upAxis() const { return up == "y" ? render::Up::kY : render::Up::kZ; }
};

/// Help of an argument that is a mesh file. All formats: meshFormats().
inline constexpr const char* kMeshFile = "mesh file: OBJ, PLY, STL, OFF, DAE or another format (see `bocst --help`)";

/// The endings of mesh files that can be read, in sentences.
std::string meshFormats();

/// A number above 0; CLI11's own complaint has 309 digits.
CLI::Validator positive();

/// A finite number that is not negative. (CLI::Range takes NaN.)
CLI::Validator notNegative();

/// A whole number from `least` to 10^15. CLI11 reads larger ones as 2^64 - 1, and negative ones as 2^64 less.
CLI::Validator wholeNumber(std::uint64_t least = 1);

/// A file that is written and has this ending (".png"), or none. "-", which is stdout, only where `stdout_too`.
CLI::Validator outputFile(const std::string& ending, bool stdout_too = false);

void addJson(CLI::App& command, Output& output);  ///< --json
/// @throws CLI::ValidationError if CSV and JSON both go to stdout.
void checkStdout(const std::string& csv_file, const Output& output);
void addHtml(CLI::App& command, std::string& file);  ///< --html

/// @throws CLI::ValidationError if the option was given although it has no effect.
void refuseUnless(bool has_effect, const CLI::App& command, const char* option, const char* why);

/// Calls f, which reads what the command line gave as `option`.
/// @throws CLI::ValidationError if f throws std::invalid_argument.
void read(const char* option, const std::function<void()>& f);

}  // namespace bocst::program
