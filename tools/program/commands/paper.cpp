// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/io.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <utility>

#include "cli/arguments.h"
#include "cli/file.h"
#include "mesh/decimate.h"
#include "paper/paper_report.h"

namespace bocst::program {
namespace {

namespace fs = std::filesystem;

const std::vector<std::string> kOracles = {"cpu", "occlusion", "compute", "sampled"};

/// A folder that is there or can be made. @throws std::runtime_error
void checkFolder(const fs::path& folder) {
  fs::path at = folder;
  std::error_code error;
  while (!at.empty() && !fs::exists(at, error)) at = at.parent_path();
  if (at.empty()) at = ".";
  if (!fs::is_directory(at, error)) throw std::runtime_error(at.string() + ": is not a folder");
  if (::access(at.c_str(), W_OK | X_OK) != 0)
    throw std::runtime_error(at.string() + ": is a folder that cannot be written to");
}

/// A word as the shell takes it.
std::string quoted(const std::string& word) {
  const std::string plain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_./+-,=:@";
  if (!word.empty() && word.find_first_not_of(plain) == std::string::npos) return word;
  std::string result = "'";
  for (const char c : word) result += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return result + "'";
}

struct Paper {
  std::vector<std::string> files;
  std::string folder;
  std::size_t triangles = 5110;
  std::size_t frames = Animation::kPaperFrames;
  std::vector<std::string> oracles;
  Output output;

  int run() const {
    const bool writes_report = !folder.empty() || !output.wantsJson();
    const fs::path into = folder.empty() ? fs::path("paper") : fs::path(folder);
    if (writes_report) checkFolder(into / "pictures");
    output.check(files, writes_report && fs::exists(into) ? std::vector<std::string>{reportFile(into)}
                                                          : std::vector<std::string>{});
    const std::vector<OracleInfo> wanted = wantedOracles();

    std::vector<StudyMesh> meshes;
    for (const std::string& file : files) {
      StudyMesh mesh{file, 0, loadMesh(file)};
      mesh.triangles_of_file = mesh.mesh->triangleCount();
      if (triangles > 0) mesh.mesh = decimated(mesh.mesh, triangles);
      meshes.push_back(std::move(mesh));
    }
    const bool sampled = std::any_of(wanted.begin(), wanted.end(), [](const OracleInfo& o) {
      return o.kind == OracleKind::kSampled && o.why_not.empty();
    });
    PaperStudy study;
    for (std::size_t i = 0; i < std::min(meshes.size(), paperMeshes().size()); ++i) {
      study.trees.push_back(studyTrees(paperMeshes()[i], meshes[i], sampled));
    }
    study.animation = studyAnimation(meshes, wanted, frames);

    if (writes_report) write(paperReport(study, command()), into);
    if (output.wantsJson()) {
      Json report = {{"trees", Json::array()}, {"animation", json(study.animation)}};
      for (const TreeStudy& trees : study.trees) report["trees"].push_back(json(trees));
      output.write(report);
    } else {
      std::cout << "report: " << reportFile(into) << std::endl;
    }
    return 0;
  }

 private:
  static std::string reportFile(const fs::path& into) { return (into / "paper.md").string(); }

  /// One of each kind: that which a model gets that asks for it. @throws OracleError for one that was named.
  std::vector<OracleInfo> wantedOracles() const {
    std::vector<OracleInfo> wanted;
    const std::vector<OracleInfo> all = availableOracles();
    for (const std::string& name : oracles.empty() ? kOracles : oracles) {
      const OracleInfo* best = nullptr;
      for (const OracleInfo& info : all) {
        if (info.name != name) continue;
        if (best == nullptr || (!best->why_not.empty() && info.why_not.empty())) best = &info;
      }
      OracleInfo info = best != nullptr ? *best : OracleInfo{OracleKind::kAuto, name, "", false, "no device", ""};
      if (!info.why_not.empty() && !oracles.empty()) throw OracleError("oracle " + name + ": " + info.why_not);
      wanted.push_back(std::move(info));
    }
    return wanted;
  }

  /// As the reader would type it.
  std::string command() const {
    std::string line = "bocst paper";
    for (const std::string& file : files) line += " " + quoted(file);
    if (triangles != Paper{}.triangles) line += " --triangles " + std::to_string(triangles);
    if (frames != Paper{}.frames) line += " --frames " + std::to_string(frames);
    for (std::size_t i = 0; i < oracles.size(); ++i) line += (i == 0 ? " --oracle " : ",") + oracles[i];
    if (!folder.empty()) line += " --out " + quoted(folder);
    return line;
  }

  /// The text last: where it is, its pictures are.
  static void write(const PaperReport& report, const fs::path& into) {
    std::error_code error;
    fs::create_directories(into / "pictures", error);
    if (error) throw std::runtime_error(into.string() + ": cannot be created: " + error.message());
    for (const PaperReport::Named& picture : report.pictures) {
      writePng((into / picture.name).string(), drawPlots(picture.plots, PaperReport::kWidth, picture.height));
    }
    writeFile(reportFile(into), report.text);
  }
};

}  // namespace

void addPaper(CLI::App& program, Job& job) {
  auto paper = std::make_shared<Paper>();
  CLI::App* command =
      program.add_subcommand("paper", "write a report that compares the paper's tables and figures with bocst's");
  command->footer(
      "Tables 1 and 2 and figures 3 and 4 use the first two meshes, which should be the paper's bunny and dragon.\n"
      "In tables 4 to 6 the first mesh moves over three objects: the other meshes in turn, or itself if it is the\n"
      "only one.\n"
      "The report is DIR/paper.md, with its pictures in DIR/pictures.");
  command->add_option("mesh", paper->files, std::string("one to four files, each a ") + kMeshFile)
      ->required()
      ->expected(1, 4);
  command
      ->add_option("--out", paper->folder,
                   "folder of the report, created if it does not exist; default: paper; with --json alone, no report")
      ->type_name("DIR");
  command
      ->add_option("--triangles", paper->triangles,
                   "decimate meshes with more triangles to about this number (the paper's have about 5100); 0: never")
      ->check(CLI::Range(0, 1000000000))
      ->capture_default_str();
  command->add_option("--frames", paper->frames, "number of frames of the animation, which takes 7 s on its own clock")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  command
      ->add_option("--oracle", paper->oracles,
                   "use only these oracles, separated by commas; default: all; the report says why some cannot be used")
      ->delimiter(',')
      ->check(CLI::IsMember(kOracles));
  addJson(*command, paper->output);
  command->callback([paper, &job] { job = [paper] { return paper->run(); }; });
}

}  // namespace bocst::program
