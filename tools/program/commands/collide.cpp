// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/io.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cli/arguments.h"
#include "cli/file.h"
#include "pairs/poses.h"
#include "pairs/query_pair.h"
#include "picture/pair_page.h"
#include "picture/pair_picture.h"

namespace bocst::program {
namespace {

/// One side's way through the command: fresh geometries and a first answer, then the same question again and again.
struct Run {
  bool touching = false;
  double first_us = 0;
  double warm_us = 0;
  std::size_t contacts = 0;
};

/// Median of up to three, of one where one takes long.
template <typename Make>
auto measureFirst(const Make& make, const Eigen::Isometry3d& X_AB, Run& run) {
  std::vector<double> times;
  while (true) {
    const Stopwatch watch;
    auto pair = make();
    run.touching = pair->touch(X_AB);
    times.push_back(watch.microseconds());
    if (times.size() < 3 && times.front() < 1e6) continue;
    run.first_us = quantile(times, 0.5);
    return pair;
  }
}

void measureWarm(const QueryPair& pair, const Eigen::Isometry3d& X_AB, Run& run) {
  std::vector<double> times;
  const Stopwatch total;
  while (times.size() < 101 && (times.size() < 3 || total.microseconds() < 2e5)) {
    const Stopwatch watch;
    pair.touch(X_AB);
    times.push_back(watch.microseconds());
  }
  run.warm_us = quantile(times, 0.5);
}

struct Collide {
  std::string file_a;
  std::string file_b;
  Pose pose;
  std::size_t max_contacts = QueryPair::kAll;
  ModelArguments model;
  std::string html_file;
  ImageArguments image;
  Output output;

  int run() const {
    output.check({file_a, file_b}, {html_file, image.file});
    std::optional<render::Renderer> renderer;
    if (image.wanted()) renderer.emplace(model.options().oracle);
    const std::shared_ptr<const Mesh> mesh_a = loadMesh(file_a);
    const std::shared_ptr<const Mesh> mesh_b = loadMesh(file_b);
    const MeshArrays a(*mesh_a, model.scalarKind());
    const MeshArrays b(*mesh_b, model.scalarKind());
    const Eigen::Isometry3d X_AB = pose.transform();
    const Options options = model.options();

    Run ours;
    const auto bocst_pair = measureFirst([&] { return makeBocstPair(model.scalarKind(), a, b, options); }, X_AB, ours);
    const std::size_t nodes = bocst_pair->nodes();
    const std::size_t bytes = bocst_pair->bytes();
    measureWarm(*bocst_pair, X_AB, ours);
    const std::vector<QueryPair::Contact> our_contacts = bocst_pair->contacts(X_AB, max_contacts);
    ours.contacts = our_contacts.size();
    const std::size_t nodes_in_the_end = bocst_pair->nodes();
    const std::size_t bytes_in_the_end = bocst_pair->bytes();

    Run theirs;
    const auto fcl_pair =
        measureFirst([&] { return buildFclPair(FclTree::kObbRss, model.scalarKind(), a, b); }, X_AB, theirs);
    measureWarm(*fcl_pair, X_AB, theirs);
    const std::vector<QueryPair::Contact> fcl_contacts = fcl_pair->contacts(X_AB, max_contacts);
    theirs.contacts = fcl_contacts.size();
    const std::size_t fcl_bytes =
        fclTreeBytes(model.scalarKind(), a.triangles.size()) + fclTreeBytes(model.scalarKind(), b.triangles.size());

    // Conservative may say more. Exact must be equal; contacts too, unless a limit leaves the choice open. FCL's float
    // trees may lose contacts to rounding, so with float it is enough that we have all that FCL has.
    bool agree = ours.touching || !theirs.touching;
    if (model.exact() && model.scalarKind() == Scalar::kDouble) agree = ours.touching == theirs.touching;
    if (model.exact() && max_contacts == QueryPair::kAll) {
      agree &= model.scalarKind() == Scalar::kDouble
                   ? our_contacts == fcl_contacts
                   : std::includes(our_contacts.begin(), our_contacts.end(), fcl_contacts.begin(), fcl_contacts.end());
    }
    if (!html_file.empty() || renderer) {
      const GrownPair grown(file_a, *mesh_a, file_b, *mesh_b, model, pose, max_contacts);
      if (!html_file.empty()) writeFile(html_file, pairPage(grown).html());
      if (renderer) writePng(image.file, pairPicture(*renderer, grown, image));
    }
    if (output.wantsJson()) {
      const auto compare = [](double bocst, double fcl) { return Json{{"bocst", bocst}, {"fcl", fcl}}; };
      const auto count = [](std::size_t bocst, std::size_t fcl) { return Json{{"bocst", bocst}, {"fcl", fcl}}; };
      Json report = {{"a", file_a},
                     {"b", file_b},
                     {"pose", pose.numbers},
                     {"options", model.json()},
                     {"oracle", bocst_pair->oracleName()},
                     {"collide", ours.touching},
                     {"contacts", ours.contacts},
                     {"fcl", {{"collide", theirs.touching}, {"contacts", theirs.contacts}}},
                     {"agree", agree},
                     {"nodes", nodes},
                     {"nodes_after_contacts", nodes_in_the_end},
                     {"bytes", count(bytes, fcl_bytes)},
                     {"bytes_after_contacts", bytes_in_the_end},
                     {"first_answer_us", compare(ours.first_us, theirs.first_us)},
                     {"warm_query_us", compare(ours.warm_us, theirs.warm_us)},
                     {"ratio",
                      {{"first_answer", theirs.first_us / ours.first_us},
                       {"warm_query", theirs.warm_us / ours.warm_us},
                       {"memory", static_cast<double>(fcl_bytes) / static_cast<double>(bytes)}}}};
      output.write(report);
    } else {
      Table head(Table::Others::kLeft);
      head.row({"A", file_a + ", " + std::to_string(a.triangles.size()) + " triangles"});
      head.row({"B", file_b + ", " + std::to_string(b.triangles.size()) + " triangles"});
      head.row({"B in A", pose.text()});
      head.row({"answer", model.answerText()});
      head.print();
      std::cout << '\n' << (ours.touching ? "They collide." : "They do not collide.") << "\n\n";
      Table table;
      table.row({"", "bocst", "FCL OBBRSS", "ratio"});
      table.row({"collide", ours.touching ? "yes" : "no", theirs.touching ? "yes" : "no"});
      const auto limited = [this](std::size_t n) { return std::to_string(n) + (n == max_contacts ? " (limit)" : ""); };
      table.row({"contacts", limited(ours.contacts), limited(theirs.contacts)});
      table.row({"first answer from arrays", formatTime(ours.first_us), formatTime(theirs.first_us),
                 formatRatio(theirs.first_us / ours.first_us)});
      table.row({"the same question again", formatTime(ours.warm_us), formatTime(theirs.warm_us),
                 formatRatio(theirs.warm_us / ours.warm_us)});
      const std::size_t fcl_nodes = 2 * (a.triangles.size() + b.triangles.size()) - 2;
      table.row({"tree nodes after first answer", std::to_string(nodes), std::to_string(fcl_nodes)});
      table.row({"tree bytes after first answer", formatBytes(static_cast<double>(bytes)),
                 formatBytes(static_cast<double>(fcl_bytes)),
                 formatRatio(static_cast<double>(fcl_bytes) / static_cast<double>(bytes))});
      table.row({"tree nodes after all contacts", std::to_string(nodes_in_the_end), std::to_string(fcl_nodes)});
      table.print();
    }
    if (!agree)
      throw std::runtime_error("the answer is not FCL's; please report both meshes and --pose " + pose.text());
    return 0;
  }
};

}  // namespace

void addCollide(CLI::App& program, Job& job) {
  auto collide = std::make_shared<Collide>();
  CLI::App* command = program.add_subcommand("collide", "check two meshes for collision and compare with FCL");
  command->add_option("a", collide->file_a, "mesh A: OBJ, PLY, STL, OFF or DAE file")->required();
  command->add_option("b", collide->file_b, "mesh B")->required();
  command
      ->add_option_function<std::string>(
          "--pose",
          [collide](const std::string& text) {
            try {
              collide->pose = Pose::parse(text);
              const double norm = collide->pose.quaternionNorm();
              if (std::abs(norm - 1) > 1e-3) {
                std::cerr << "bocst: --pose: the quaternion has the norm " << norm << "; it is divided by it\n";
              }
            } catch (const std::invalid_argument& e) {
              throw CLI::ValidationError("--pose", e.what());
            }
          },
          "pose of B in A's frame, identity if not given")
      ->type_name("x,y,z,qw,qx,qy,qz");
  command->add_option("--max-contacts", collide->max_contacts, "stop after so many contacts; all if not given")
      ->check(CLI::PositiveNumber);
  collide->model.addAll(*command);
  addHtml(*command, collide->html_file);
  collide->image.add(*command);
  addJson(*command, collide->output);
  command->callback([collide, &job] { job = [collide] { return collide->run(); }; });
}

}  // namespace bocst::program
