// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/io.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
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
  double settled_us = 0;
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

/// Medians of the first hundred and of the last hundred of a thousand queries, or fewer where these take long: in
/// between, bocst builds whole trees.
void measureWarm(const QueryPair& pair, const Eigen::Isometry3d& X_AB, Run& run) {
  constexpr std::size_t kQueries = 1000, kSome = 100;
  std::vector<double> times;
  const Stopwatch total;
  while (times.size() < kQueries && (times.size() < 3 || total.microseconds() < 2e5)) {
    const Stopwatch watch;
    pair.touch(X_AB);
    times.push_back(watch.microseconds());
  }
  const auto some = static_cast<std::ptrdiff_t>(std::min(kSome, times.size()));
  run.warm_us = quantile({times.begin(), times.begin() + some}, 0.5);
  run.settled_us = quantile({times.end() - some, times.end()}, 0.5);
}

std::string tuple(const Eigen::Vector3d& v) {
  return "(" + formatNumber(v.x(), 6) + ", " + formatNumber(v.y(), 6) + ", " + formatNumber(v.z(), 6) + ")";
}

Json extentsJson(const Mesh& mesh) {
  const Eigen::AlignedBox3d& box = mesh.bounds();
  return {{"min", list(box.min())}, {"max", list(box.max())}, {"size", list(box.sizes())}};
}

/// What is probably a mistake, though it can be answered.
std::vector<std::string> warningsAbout(const Mesh& a, const Mesh& b) {
  constexpr double kRatio = 100;
  const double size_a = a.bounds().sizes().maxCoeff(), size_b = b.bounds().sizes().maxCoeff();
  if (!(size_a > 0 && size_b > 0) || std::max(size_a, size_b) < kRatio * std::min(size_a, size_b)) return {};
  const bool larger_b = size_b > size_a;
  return {std::string(larger_b ? "B" : "A") + " is " + formatNumber(larger_b ? size_b / size_a : size_a / size_b, 3) +
          " times as large as " + (larger_b ? "A" : "B") + "; are both in the same length unit?"};
}

/// The numbers of a line of CSV, with all digits.
std::string csv(const std::vector<double>& numbers) {
  std::string text;
  for (const double number : numbers) {
    char buffer[64];
    std::snprintf(buffer, sizeof(buffer), ",%.17g", number);
    text += buffer;
  }
  return text;
}

std::string csvIds(const QueryPair::Contact& ids) {
  return std::to_string(ids.first) + "," + std::to_string(ids.second);
}

struct Collide {
  std::string file_a;
  std::string file_b;
  std::string pose_text;
  std::string poses_file;
  bool rpy = false;
  bool xyzw = false;
  bool distances = false;
  Pose pose;
  std::size_t max_contacts = QueryPair::kAll;
  ModelArguments model;
  std::string csv_file;
  std::string html_file;
  ImageArguments image;
  Output output;

  RotationFormat format() const {
    return rpy ? RotationFormat::kRpy : xyzw ? RotationFormat::kXyzw : RotationFormat::kWxyz;
  }

  int run() const {
    output.check({file_a, file_b, poses_file}, {csv_file, html_file, image.file});
    return poses_file.empty() ? runOne() : runList();
  }

 private:
  /// What the ids of a contact are.
  std::string idName() const { return model.exact() ? "triangle" : "cell"; }

  std::string verdict(bool touching) const {
    return !touching ? "They do not collide." : model.exact() ? "They collide." : "They may touch.";
  }

  static void warn(const std::vector<std::string>& warnings) {
    for (const std::string& warning : warnings) std::cerr << "bocst: " << warning << '\n';
  }

  Json nearestJson(const NearestPoints& nearest) const {
    return {{idName() + "_a", nearest.triangles.first},
            {idName() + "_b", nearest.triangles.second},
            {"on_a", list(nearest.on_a)},
            {"on_b", list(nearest.on_b)}};
  }

  Json contactsJson(const std::vector<TouchingPoint>& points) const {
    Json contacts = Json::array();
    for (const TouchingPoint& point : points) {
      contacts.push_back({{idName() + "_a", point.triangles.first},
                          {idName() + "_b", point.triangles.second},
                          {"position", list(point.position)},
                          {"normal", list(point.normal)},
                          {"depth", point.depth}});
    }
    return contacts;
  }

  std::string contactsCsv(const std::vector<TouchingPoint>& points) const {
    std::string text = idName() + "_a," + idName() + "_b,x,y,z,normal_x,normal_y,normal_z,depth\n";
    for (const TouchingPoint& p : points) {
      text += csvIds(p.triangles) +
              csv({p.position.x(), p.position.y(), p.position.z(), p.normal.x(), p.normal.y(), p.normal.z(), p.depth}) +
              "\n";
    }
    return text;
  }

  /// The first ten: ids, position, normal, depth.
  void printContacts(const std::vector<TouchingPoint>& points) const {
    constexpr std::size_t kShown = 10;
    std::cout << "Positions and normals (from A to B) in A's frame, in the meshes' length unit:\n";
    Table table(Table::Others::kLeft);
    table.row({"contact", idName() + " of A", idName() + " of B", "position", "normal", "depth"});
    for (std::size_t i = 0; i < std::min(points.size(), kShown); ++i) {
      const TouchingPoint& p = points[i];
      table.row({std::to_string(i + 1), std::to_string(p.triangles.first), std::to_string(p.triangles.second),
                 tuple(p.position), tuple(p.normal), formatNumber(p.depth, 4)});
    }
    table.print();
    if (points.size() > kShown) {
      std::cout << points.size() - kShown << " more; --csv FILE or --json FILE writes all contacts.\n";
    }
    std::cout << '\n';
  }

  void printNearest(const NearestPoints& nearest) const {
    Table table(Table::Others::kLeft);
    table.row({model.exact() ? "distance" : "distance of the spheres", formatNumber(nearest.distance, 6)});
    table.row({"nearest point of A", tuple(nearest.on_a), idName() + " " + std::to_string(nearest.triangles.first)});
    table.row({"nearest point of B", tuple(nearest.on_b),
               idName() + " " + std::to_string(nearest.triangles.second) + ", in A's frame"});
    table.print();
    std::cout << '\n';
  }

  void printHead(const MeshArrays& a, const Mesh& mesh_a, const MeshArrays& b, const Mesh& mesh_b) const {
    Table head(Table::Others::kLeft);
    const auto described = [](const std::string& file, const MeshArrays& mesh, const Mesh& shape) {
      const Eigen::Vector3d size = shape.bounds().sizes();
      return file + ", " + std::to_string(mesh.triangles.size()) + " triangles, " + formatNumber(size.x(), 4) + " x " +
             formatNumber(size.y(), 4) + " x " + formatNumber(size.z(), 4);
    };
    head.row({"A", described(file_a, a, mesh_a)});
    head.row({"B", described(file_b, b, mesh_b)});
    if (poses_file.empty()) head.row({"B in A", pose.text() + ", " + pose.rotationText()});
    head.row({"answer", model.answerText()});
    head.print();
  }

  /// All poses of a file, asked of one pair of models; FCL is not asked.
  int runList() const {
    const std::vector<ListedPose> poses = parsePoses(readFile(poses_file), format(), poses_file);
    for (const ListedPose& listed : poses)
      warnOfNorm(listed.pose, poses_file + ": line " + std::to_string(listed.line));
    const std::shared_ptr<const Mesh> mesh_a = loadMesh(file_a);
    const std::shared_ptr<const Mesh> mesh_b = loadMesh(file_b);
    const std::vector<std::string> warnings = warningsAbout(*mesh_a, *mesh_b);
    warn(warnings);
    const MeshArrays a(*mesh_a, model.scalarKind());
    const MeshArrays b(*mesh_b, model.scalarKind());
    const auto pair = makeBocstPair(model.scalarKind(), a, b, model.options());

    Json rows = Json::array();
    std::string text = "line,x,y,z,qw,qx,qy,qz,collide";
    if (distances) text += ",distance," + idName() + "_a," + idName() + "_b,ax,ay,az,bx,by,bz";
    text += "\n";
    Table table(Table::Others::kLeft);
    table.row({"line", model.exact() ? "they collide" : "they may touch", distances ? "distance" : ""});
    std::size_t touching = 0;
    double microseconds = 0;
    {
      Progress progress("pose", poses.size());
      for (const auto& [line, X] : poses) {
        const Stopwatch watch;
        const bool hit = pair->touch(X.transform());
        std::optional<NearestPoints> nearest;
        if (distances && !hit) nearest = pair->nearest(X.transform());
        microseconds += watch.microseconds();
        touching += hit;
        Json row = {{"line", line}, {"pose", X.numbers}, {"collide", hit}};
        text += std::to_string(line) + csv({X.numbers.begin(), X.numbers.end()}) + (hit ? ",1" : ",0");
        if (distances) {
          row["distance"] = nearest ? Json(nearest->distance) : Json();
          row["nearest"] = nearest ? nearestJson(*nearest) : Json();
          text += nearest ? csv({nearest->distance}) + "," + csvIds(nearest->triangles) +
                                csv({nearest->on_a.x(), nearest->on_a.y(), nearest->on_a.z(), nearest->on_b.x(),
                                     nearest->on_b.y(), nearest->on_b.z()})
                          : std::string(9, ',');
        }
        text += '\n';
        table.row({std::to_string(line), hit ? "yes" : "no", nearest ? formatNumber(nearest->distance, 6) : ""});
        rows.push_back(std::move(row));
        progress.step();
      }
    }
    if (!csv_file.empty()) writeText(csv_file, text);
    if (output.wantsJson()) {
      output.write({{"a", file_a},
                    {"b", file_b},
                    {"extents", {{"a", extentsJson(*mesh_a)}, {"b", extentsJson(*mesh_b)}}},
                    {"warnings", warnings},
                    {"options", model.json()},
                    {"oracle", pair->oracleName()},
                    {"asked", poses.size()},
                    {"collisions", touching},
                    {"total_us", microseconds},
                    {"poses", rows}});
    } else if (csv_file.empty()) {
      printHead(a, *mesh_a, b, *mesh_b);
      std::cout << '\n';
      table.print();
      std::cout << '\n'
                << touching << " of " << poses.size() << " poses " << (model.exact() ? "collide" : "may touch") << ", "
                << formatTime(microseconds / static_cast<double>(poses.size())) << " a pose.\n";
    }
    return 0;
  }

  static void warnOfNorm(const Pose& pose, const std::string& where) {
    const double norm = pose.quaternionNorm();
    if (std::abs(norm - 1) > 1e-3) {
      std::cerr << "bocst: " << where << ": the quaternion has the norm " << norm << " and is normalised\n";
    }
  }

  int runOne() const {
    warnOfNorm(pose, "--pose");
    std::optional<render::Renderer> renderer;
    if (image.wanted()) renderer.emplace(model.options().oracle);
    const std::shared_ptr<const Mesh> mesh_a = loadMesh(file_a);
    const std::shared_ptr<const Mesh> mesh_b = loadMesh(file_b);
    const std::vector<std::string> warnings = warningsAbout(*mesh_a, *mesh_b);
    warn(warnings);
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
    const std::vector<TouchingPoint> points = bocst_pair->touchingPoints(X_AB, max_contacts);
    std::optional<NearestPoints> nearest;
    if (!ours.touching) nearest = bocst_pair->nearest(X_AB);

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
    if (!csv_file.empty()) writeText(csv_file, contactsCsv(points));
    if (output.wantsJson()) {
      const auto compare = [](double bocst, double fcl) { return Json{{"bocst", bocst}, {"fcl", fcl}}; };
      const auto count = [](std::size_t bocst, std::size_t fcl) { return Json{{"bocst", bocst}, {"fcl", fcl}}; };
      Json report = {{"a", file_a},
                     {"b", file_b},
                     {"pose", pose.numbers},
                     {"rotation", pose.rotationText()},
                     {"extents", {{"a", extentsJson(*mesh_a)}, {"b", extentsJson(*mesh_b)}}},
                     {"warnings", warnings},
                     {"options", model.json()},
                     {"oracle", bocst_pair->oracleName()},
                     {"collide", ours.touching},
                     {"contacts", ours.contacts},
                     {"contact_points", contactsJson(points)},
                     {"distance", nearest ? Json(nearest->distance) : Json()},
                     {"nearest", nearest ? nearestJson(*nearest) : Json()},
                     {"fcl", {{"collide", theirs.touching}, {"contacts", theirs.contacts}}},
                     {"agree", agree},
                     {"nodes", nodes},
                     {"nodes_after_contacts", nodes_in_the_end},
                     {"bytes", count(bytes, fcl_bytes)},
                     {"bytes_after_contacts", bytes_in_the_end},
                     {"first_answer_us", compare(ours.first_us, theirs.first_us)},
                     {"warm_query_us", compare(ours.warm_us, theirs.warm_us)},
                     {"settled_query_us", compare(ours.settled_us, theirs.settled_us)},
                     {"ratio",
                      {{"first_answer", theirs.first_us / ours.first_us},
                       {"warm_query", theirs.warm_us / ours.warm_us},
                       {"settled_query", theirs.settled_us / ours.settled_us},
                       {"memory", static_cast<double>(fcl_bytes) / static_cast<double>(bytes)}}}};
      output.write(report);
    } else if (csv_file != "-") {
      printHead(a, *mesh_a, b, *mesh_b);
      std::cout << '\n' << verdict(ours.touching);
      if (!model.exact() && ours.touching != theirs.touching) std::cout << " FCL's triangles do not.";
      std::cout << "\n\n";
      if (!points.empty()) printContacts(points);
      if (nearest) printNearest(*nearest);
      Table table;
      table.row({"", "bocst", "FCL OBBRSS", "ratio"});
      table.row({model.exact() ? "collide" : "may touch, collide", ours.touching ? "yes" : "no",
                 theirs.touching ? "yes" : "no"});
      const auto limited = [this](std::size_t n) { return std::to_string(n) + (n == max_contacts ? " (limit)" : ""); };
      table.row({"contacts", limited(ours.contacts), limited(theirs.contacts)});
      table.row({"first answer from arrays", formatTime(ours.first_us), formatTime(theirs.first_us),
                 formatRatio(theirs.first_us / ours.first_us)});
      table.row({"the same query again", formatTime(ours.warm_us), formatTime(theirs.warm_us),
                 formatRatio(theirs.warm_us / ours.warm_us)});
      table.row({"after 1000 queries", formatTime(ours.settled_us), formatTime(theirs.settled_us),
                 formatRatio(theirs.settled_us / ours.settled_us)});
      const std::size_t fcl_nodes = 2 * (a.triangles.size() + b.triangles.size()) - 2;
      table.row({"tree nodes after first answer", std::to_string(nodes), std::to_string(fcl_nodes)});
      table.row({"tree bytes after first answer", formatBytes(static_cast<double>(bytes)),
                 formatBytes(static_cast<double>(fcl_bytes)),
                 formatRatio(static_cast<double>(fcl_bytes) / static_cast<double>(bytes))});
      table.row({"tree nodes after all contacts", std::to_string(nodes_in_the_end), std::to_string(fcl_nodes)});
      table.print();
    }
    if (!agree)
      throw std::runtime_error("the answers of bocst and FCL differ; please report both meshes and --pose " +
                               pose.text());
    return 0;
  }
};

}  // namespace

void addCollide(CLI::App& program, Job& job) {
  auto collide = std::make_shared<Collide>();
  CLI::App* command = program.add_subcommand("collide", "check two meshes for collision and compare with FCL");
  command->footer(
      "Both meshes must have the same length unit; all lengths are in this unit. With conservative answers,\n"
      "contacts are pairs of spheres: the spheres can touch although the surfaces do not, and the ids are those of\n"
      "cells.\n"
      "--poses queries only bocst, with one pair of models; `bocst validate` compares many poses with FCL.");
  command->add_option("a", collide->file_a, std::string("A: ") + kMeshFile)->required();
  command->add_option("b", collide->file_b, "B: mesh file")->required();
  CLI::Option* pose = command->add_option("--pose", collide->pose_text, "pose of B in A's frame; default: identity")
                          ->type_name("x,y,z,qw,qx,qy,qz");
  command
      ->add_option(
          "--poses", collide->poses_file,
          "check each pose of a file, one per line (CSV, or separated by blanks; the first line may name the columns)")
      ->type_name("FILE")
      ->excludes(pose);
  CLI::Option* rpy = command->add_flag(
      "--rpy", collide->rpy,
      "poses are x,y,z,roll,pitch,yaw: radians about the fixed axes x, y, z in this order, as in URDF");
  command->add_flag("--xyzw", collide->xyzw, "poses are x,y,z,qx,qy,qz,qw, as in ROS")->excludes(rpy);
  command->add_flag("--distance", collide->distances,
                    "with --poses: report also the distance and the nearest points of poses without contact");
  command->add_option("--max-contacts", collide->max_contacts, "maximum number of contacts; default: all")
      ->check(wholeNumber());
  command
      ->add_option("--csv", collide->csv_file,
                   "write the contacts (with --poses: one line per pose) to this file; - is stdout")
      ->type_name("FILE|-")
      ->check(outputFile(".csv", true));
  collide->model.addAll(*command);
  addHtml(*command, collide->html_file);
  collide->image.add(*command);
  addJson(*command, collide->output);
  command->callback([collide, &job] {
    try {
      if (!collide->pose_text.empty()) collide->pose = Pose::parse(collide->pose_text, collide->format());
    } catch (const std::invalid_argument& e) {
      throw CLI::ValidationError("--pose", e.what());
    }
    const bool shown =
        !collide->html_file.empty() || collide->image.wanted() || collide->max_contacts != QueryPair::kAll;
    if (!collide->poses_file.empty() && shown) {
      throw CLI::ValidationError("--poses", "cannot be combined with --html, --image or --max-contacts; use --pose");
    }
    if (collide->poses_file.empty() && collide->distances) {
      throw CLI::ValidationError("--distance", "needs --poses; for a single pose the distance is always reported");
    }
    job = [collide] { return collide->run(); };
  });
}

}  // namespace bocst::program
