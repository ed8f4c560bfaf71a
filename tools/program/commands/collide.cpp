// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/io.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cli/arguments.h"
#include "cli/file.h"
#include "cli/printable.h"
#include "pairs/beyond_limits.h"
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

std::string tuple(const Eigen::Vector3d& v) { return "(" + formatVector(v, 6, ", ") + ")"; }

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
  double margin = 0;
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
  struct Input {
    std::shared_ptr<const Mesh> mesh_a, mesh_b;
    MeshArrays a, b;
    std::vector<std::string> warnings;
  };

  /// What the ids of a contact are.
  std::string idName() const { return model.exact() ? "triangle" : "cell"; }

  std::string verdict(bool touching) const {
    return !touching ? "They do not collide." : model.exact() ? "They collide." : "They may touch.";
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

  void printHead(const Input& input) const {
    Table head(Table::Others::kLeft);
    const auto described = [](const std::string& file, const MeshArrays& mesh, const Mesh& shape) {
      return file + ", " + std::to_string(mesh.triangles.size()) + " triangles, " +
             formatVector(shape.bounds().sizes(), 4, " x ");
    };
    head.row({"A", described(file_a, input.a, *input.mesh_a)});
    head.row({"B", described(file_b, input.b, *input.mesh_b)});
    if (poses_file.empty()) head.row({"B in A", pose.text() + ", " + pose.rotationText()});
    head.row({"answer", model.answerText()});
    head.print();
  }

  Input load() const {
    const std::shared_ptr<const Mesh> mesh_a = loadMesh(file_a), mesh_b = loadMesh(file_b);
    Input input{mesh_a, mesh_b, MeshArrays(*mesh_a, model.scalarKind()), MeshArrays(*mesh_b, model.scalarKind()),
                warningsAbout(*mesh_a, *mesh_b)};
    for (const std::string& warning : input.warnings) std::cerr << "bocst: " << warning << '\n';
    return input;
  }

  Json inputJson(const Input& input) const {
    Json options = model.json();
    options["margin"] = margin;
    return {{"a", file_a},
            {"b", file_b},
            {"extents", {{"a", extentsJson(*input.mesh_a)}, {"b", extentsJson(*input.mesh_b)}}},
            {"warnings", input.warnings},
            {"options", options}};
  }

  static void warnOfNorm(const Pose& pose, const std::string& where) {
    const std::string warning = normWarning(pose);
    if (!warning.empty()) std::cerr << "bocst: " << printable(where) << ": " << warning << '\n';
  }

  /// What is said of one pose of a list, and of all.
  struct ListReport {
    Json rows = Json::array();
    std::string csv;
    Table table{Table::Others::kLeft};
    std::size_t touching = 0;
    double microseconds = 0;
  };

  void addPose(const ListedPose& listed, const BocstPair& pair, ListReport& report) const {
    const auto& [line, X] = listed;
    const Stopwatch watch;
    const bool hit = pair.touch(X.transform());
    std::optional<NearestPoints> nearest;
    if (distances && !hit) nearest = pair.nearest(X.transform());
    report.microseconds += watch.microseconds();
    report.touching += hit;
    Json row = {{"line", line}, {"pose", X.numbers}, {"collide", hit}};
    report.csv += std::to_string(line) + csv({X.numbers.begin(), X.numbers.end()}) + (hit ? ",1" : ",0");
    if (distances) {
      row["distance"] = nearest ? Json(nearest->distance) : Json();
      row["nearest"] = nearest ? nearestJson(*nearest) : Json();
      report.csv += nearest ? csv({nearest->distance}) + "," + csvIds(nearest->triangles) +
                                  csv({nearest->on_a.x(), nearest->on_a.y(), nearest->on_a.z(), nearest->on_b.x(),
                                       nearest->on_b.y(), nearest->on_b.z()})
                            : std::string(9, ',');
    }
    report.csv += '\n';
    report.table.row({std::to_string(line), hit ? "yes" : "no", nearest ? formatNumber(nearest->distance, 6) : ""});
    report.rows.push_back(std::move(row));
  }

  /// All poses of a file, asked of one pair of models; FCL is not asked.
  int runList() const {
    const std::vector<ListedPose> poses = parsePoses(readFile(poses_file), format(), poses_file);
    for (const ListedPose& listed : poses)
      warnOfNorm(listed.pose, poses_file + ": line " + std::to_string(listed.line));
    const Input input = load();
    Options options = model.options();
    options.margin = margin / 2;  // of each model; the sum counts
    const auto pair = makeBocstPair(model.scalarKind(), input.a, input.b, options);

    ListReport report;
    report.csv = "line,x,y,z,qw,qx,qy,qz,collide";
    if (distances) report.csv += ",distance," + idName() + "_a," + idName() + "_b,ax,ay,az,bx,by,bz";
    report.csv += "\n";
    report.table.row({"line", model.exact() ? "they collide" : "they may touch", distances ? "distance" : ""});
    {
      Progress progress("pose", poses.size());
      for (const ListedPose& listed : poses) {
        addPose(listed, *pair, report);
        progress.step();
      }
    }
    if (!csv_file.empty()) writeText(csv_file, report.csv);
    if (output.wantsJson()) {
      Json json = inputJson(input);
      json.update({{"oracle", pair->oracleName()},
                   {"asked", poses.size()},
                   {"collisions", report.touching},
                   {"total_us", report.microseconds},
                   {"poses", report.rows}});
      output.write(json);
    } else if (csv_file.empty()) {
      printHead(input);
      std::cout << '\n';
      report.table.print();
      std::cout << '\n'
                << report.touching << " of " << poses.size() << " poses " << (model.exact() ? "collide" : "may touch")
                << ", " << formatTime(report.microseconds / static_cast<double>(poses.size())) << " a pose.\n";
    }
    return 0;
  }

  /// One pose, asked of both.
  struct Compared {
    Run ours, theirs;
    std::size_t nodes = 0, nodes_in_the_end = 0;
    std::size_t bytes = 0, bytes_in_the_end = 0, fcl_bytes = 0;
    std::vector<TouchingPoint> points;
    std::optional<NearestPoints> nearest;
    std::string oracle;
    bool agree = false;
  };

  Compared compare(const Input& input) const {
    const Eigen::Isometry3d X_AB = pose.transform();
    const Scalar scalar = model.scalarKind();
    const Options options = model.options();
    Compared c;
    const auto bocst_pair =
        measureFirst([&] { return makeBocstPair(scalar, input.a, input.b, options); }, X_AB, c.ours);
    c.nodes = bocst_pair->nodes();
    c.bytes = bocst_pair->bytes();
    measureWarm(*bocst_pair, X_AB, c.ours);
    const std::vector<QueryPair::Contact> our_contacts = bocst_pair->contacts(X_AB, max_contacts);
    c.ours.contacts = our_contacts.size();
    c.nodes_in_the_end = bocst_pair->nodes();
    c.bytes_in_the_end = bocst_pair->bytes();
    c.points = bocst_pair->touchingPoints(X_AB, max_contacts);
    if (!c.ours.touching) c.nearest = bocst_pair->nearest(X_AB);
    c.oracle = bocst_pair->oracleName();

    const auto fcl_pair =
        measureFirst([&] { return buildFclPair(FclTree::kObbRss, scalar, input.a, input.b); }, X_AB, c.theirs);
    measureWarm(*fcl_pair, X_AB, c.theirs);
    const std::vector<QueryPair::Contact> fcl_contacts = fcl_pair->contacts(X_AB, max_contacts);
    c.theirs.contacts = fcl_contacts.size();
    c.fcl_bytes = fclTreeBytes(scalar, input.a.triangles.size()) + fclTreeBytes(scalar, input.b.triangles.size());

    // Conservative may say more. Exact must be equal; contacts too, unless a limit leaves the choice open. FCL's float
    // trees may lose contacts to rounding, so with float it is enough that we have all that FCL has.
    c.agree = c.ours.touching || !c.theirs.touching;
    if (model.exact() && scalar == Scalar::kDouble) c.agree = c.ours.touching == c.theirs.touching;
    if (model.exact() && max_contacts == QueryPair::kAll) {
      c.agree &= scalar == Scalar::kDouble ? our_contacts == fcl_contacts
                                           : std::includes(our_contacts.begin(), our_contacts.end(),
                                                           fcl_contacts.begin(), fcl_contacts.end());
    }
    return c;
  }

  Json comparedJson(const Input& input, const Compared& c) const {
    const auto both = [](auto bocst, auto fcl) { return Json{{"bocst", bocst}, {"fcl", fcl}}; };
    Json report = inputJson(input);
    report.update({{"pose", pose.numbers},
                   {"rotation", pose.rotationText()},
                   {"oracle", c.oracle},
                   {"collide", c.ours.touching},
                   {"contacts", c.ours.contacts},
                   {"contact_points", contactsJson(c.points)},
                   {"distance", c.nearest ? Json(c.nearest->distance) : Json()},
                   {"nearest", c.nearest ? nearestJson(*c.nearest) : Json()},
                   {"fcl", {{"collide", c.theirs.touching}, {"contacts", c.theirs.contacts}}},
                   {"agree", c.agree},
                   {"nodes", c.nodes},
                   {"nodes_after_contacts", c.nodes_in_the_end},
                   {"bytes", both(c.bytes, c.fcl_bytes)},
                   {"bytes_after_contacts", c.bytes_in_the_end},
                   {"first_answer_us", both(c.ours.first_us, c.theirs.first_us)},
                   {"warm_query_us", both(c.ours.warm_us, c.theirs.warm_us)},
                   {"settled_query_us", both(c.ours.settled_us, c.theirs.settled_us)},
                   {"ratio",
                    {{"first_answer", c.theirs.first_us / c.ours.first_us},
                     {"warm_query", c.theirs.warm_us / c.ours.warm_us},
                     {"settled_query", c.theirs.settled_us / c.ours.settled_us},
                     {"memory", static_cast<double>(c.fcl_bytes) / static_cast<double>(c.bytes)}}}});
    return report;
  }

  void printCompared(const Input& input, const Compared& c) const {
    printHead(input);
    std::cout << '\n' << verdict(c.ours.touching);
    if (!model.exact() && c.ours.touching != c.theirs.touching) std::cout << " FCL's triangles do not.";
    std::cout << "\n\n";
    if (!c.points.empty()) printContacts(c.points);
    if (c.nearest) printNearest(*c.nearest);
    Table table;
    table.row({"", "bocst", "FCL OBBRSS", "ratio"});
    table.row({model.exact() ? "collide" : "may touch, collide", c.ours.touching ? "yes" : "no",
               c.theirs.touching ? "yes" : "no"});
    const auto limited = [this](std::size_t n) { return std::to_string(n) + (n == max_contacts ? " (limit)" : ""); };
    table.row({"contacts", limited(c.ours.contacts), limited(c.theirs.contacts)});
    const auto times = [&table](const char* what, double bocst, double fcl) {
      table.row({what, formatTime(bocst), formatTime(fcl), formatRatio(fcl / bocst)});
    };
    times("first answer from arrays", c.ours.first_us, c.theirs.first_us);
    times("the same query again", c.ours.warm_us, c.theirs.warm_us);
    times("after 1000 queries", c.ours.settled_us, c.theirs.settled_us);
    const std::size_t fcl_nodes = 2 * (input.a.triangles.size() + input.b.triangles.size()) - 2;
    table.row({"tree nodes after first answer", std::to_string(c.nodes), std::to_string(fcl_nodes)});
    const auto bytes = static_cast<double>(c.bytes), fcl_bytes = static_cast<double>(c.fcl_bytes);
    table.row(
        {"tree bytes after first answer", formatBytes(bytes), formatBytes(fcl_bytes), formatRatio(fcl_bytes / bytes)});
    table.row({"tree nodes after all contacts", std::to_string(c.nodes_in_the_end), std::to_string(fcl_nodes)});
    table.print();
  }

  int runOne() const {
    warnOfNorm(pose, "--pose");
    std::optional<render::Renderer> renderer;
    if (image.wanted()) renderer.emplace(model.options().oracle);
    const Input input = load();
    const Compared compared = compare(input);
    if (!html_file.empty() || renderer) {
      const GrownPair grown(file_a, *input.mesh_a, file_b, *input.mesh_b, model, pose, max_contacts);
      if (!html_file.empty()) writeFile(html_file, pairPage(grown).html());
      if (renderer) writePng(image.file, pairPicture(*renderer, grown, image));
    }
    if (!csv_file.empty()) writeText(csv_file, contactsCsv(compared.points));
    if (output.wantsJson()) {
      output.write(comparedJson(input, compared));
    } else if (csv_file != "-") {
      printCompared(input, compared);
    }
    if (compared.agree) return 0;
    const std::string differ = "the answers of bocst and FCL differ";
    const std::string beyond = beyondLimits({input.mesh_a.get(), input.mesh_b.get()}, model.scalarKind());
    if (!beyond.empty()) throw std::runtime_error(differ + ", but " + beyond);
    throw std::runtime_error(differ + "; please report both meshes and --pose " + pose.text());
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
      "--poses queries only bocst, with one pair of models; `bocst validate` compares many poses with FCL.\n"
      "Exit code 1 if exact answers are not FCL's, also where a mesh is beyond the limits of share/doc/guarantees.md\n"
      "(Limits); the message says so.");
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
  command
      ->add_option("--margin", collide->margin,
                   "with --poses: surfaces that are at most this far apart collide, in the meshes' length unit")
      ->check(notNegative());
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
  command->callback([collide, command, pose, &job] {
    collide->model.refuseIdle(*command);
    const bool has_poses = pose->count() != 0 || !collide->poses_file.empty();
    refuseUnless(has_poses, *command, "--rpy", "needs --pose or --poses");
    refuseUnless(has_poses, *command, "--xyzw", "needs --pose or --poses");
    read("--pose", [&] {
      if (pose->count() != 0) collide->pose = Pose::parse(collide->pose_text, collide->format());
    });
    const bool shown =
        !collide->html_file.empty() || collide->image.wanted() || collide->max_contacts != QueryPair::kAll;
    if (!collide->poses_file.empty() && shown) {
      throw CLI::ValidationError("--poses", "cannot be combined with --html, --image or --max-contacts; use --pose");
    }
    checkStdout(collide->csv_file, collide->output);
    if (collide->poses_file.empty() && collide->distances) {
      throw CLI::ValidationError("--distance", "needs --poses; for a single pose the distance is always reported");
    }
    refuseUnless(!collide->poses_file.empty(), *command, "--margin", "needs --poses, since FCL has no margins");
    job = [collide] { return collide->run(); };
  });
}

}  // namespace bocst::program
