// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <iostream>
#include <limits>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "cli/arguments.h"
#include "cli/file.h"
#include "cli/printable.h"
#include "cli/words.h"
#include "pairs/beyond_limits.h"
#include "robot/packages.h"
#include "scene/ask_scene.h"
#include "scene/scene_file.h"
#include "scene/scene_page.h"

namespace bocst::program {
namespace {

using Names = std::pair<std::string, std::string>;

/// A cell of CSV with names, which may hold anything.
std::string csvCell(const std::string& names) {
  const std::string text = printable(names);
  if (text.find_first_of(",\"") == std::string::npos) return text;
  std::string result = "\"";
  for (const char c : text) result += c == '"' ? std::string("\"\"") : std::string(1, c);
  return result + "\"";
}

/// What was asked and what was answered, in the words of the scene.
class SceneReport {
 public:
  SceneReport(const SceneSetup& setup, const Bodies& bodies, const SceneAnswers& answers)
      : setup_(setup), bodies_(bodies), answers_(answers) {}

  std::size_t states() const { return answers_.hit.size(); }
  std::size_t collisions() const {
    return static_cast<std::size_t>(std::count(answers_.hit.begin(), answers_.hit.end(), 1));
  }

  std::size_t statesOutsideLimits() const {
    return static_cast<std::size_t>(
        std::count_if(setup_.states.begin(), setup_.states.end(),
                      [this](const State& state) { return !setup_.outsideLimits(state).empty(); }));
  }

  Names namesOf(const BodyPair& pair) const { return {nameOf(pair.first), nameOf(pair.second)}; }

  /// The pairs of parts that collide, each once.
  std::vector<Names> pairsOf(std::size_t state) const {
    std::vector<Names> names;
    std::set<Names> known;
    for (const BodyPair& pair : answers_.pairs[state]) {
      const Names found = namesOf(pair);
      if (known.insert(found).second) names.push_back(found);
    }
    return names;
  }

  /// "elbow 3.2 is not in -2.9 to 2.9".
  std::vector<std::string> outsideLimits(std::size_t state) const {
    std::vector<std::string> texts;
    for (const OutsideLimits& outside : setup_.outsideLimits(setup_.states[state])) {
      const Joint& joint = setup_.robot->joints()[outside.joint];
      const double lower = joint.limits->lower, upper = joint.limits->upper;
      const bool is_many_turns = joint.kind == Joint::Kind::kRevolute && std::abs(outside.value) > 7;
      const std::string value = formatPlain(outside.value);
      // Twelve digits are easier to read, but may not show what is outside.
      const bool all_digits = value == formatPlain(lower) || value == formatPlain(upper);
      if (lower > upper) {
        texts.push_back(joint.name + ": its lower limit " + formatPlain(lower) + " is above its upper limit " +
                        formatPlain(upper));
        continue;
      }
      const auto text = [all_digits](double number) { return all_digits ? formatExact(number) : formatPlain(number); };
      texts.push_back(joint.name + " " + text(outside.value) + " is not in " + text(lower) + " to " + text(upper) +
                      (is_many_turns ? " (radians; is it given in degrees?)" : ""));
    }
    return texts;
  }

  Json stateJson(std::size_t k) const {
    Json pairs = Json::array();
    for (const auto& [a, b] : pairsOf(k)) pairs.push_back({a, b});
    Json row = {{"index", k}, {"place", setup_.states[k].place}, {"collide", answers_.hit[k] != 0}, {"pairs", pairs}};
    if (!answers_.clearance.empty()) {
      const Clearance& clearance = answers_.clearance[k];
      row["clearance"] = clearance.nearest ? Json(clearance.distance) : Json();
      row["nearest"] =
          clearance.nearest ? Json{nameOf(clearance.nearest->first), nameOf(clearance.nearest->second)} : Json();
    }
    Json outside = Json::array();
    for (const OutsideLimits& o : setup_.outsideLimits(setup_.states[k])) {
      const Joint& joint = setup_.robot->joints()[o.joint];
      outside.push_back(
          {{"joint", joint.name}, {"value", o.value}, {"lower", joint.limits->lower}, {"upper", joint.limits->upper}});
    }
    row["outside_limits"] = outside;
    return row;
  }

  std::string csv() const {
    std::string text = "index,place,collide,pairs";
    if (!answers_.clearance.empty()) text += ",clearance,nearest_a,nearest_b";
    text += ",outside_limits\n";
    for (std::size_t k = 0; k < states(); ++k) {
      text += std::to_string(k) + "," + csvCell(setup_.states[k].place) + (answers_.hit[k] != 0 ? ",1," : ",0,") +
              csvCell(pairsText(k));
      if (!answers_.clearance.empty()) {
        const Clearance& clearance = answers_.clearance[k];
        text += "," + (clearance.nearest
                           ? Json(clearance.distance).dump() + "," + csvCell(nameOf(clearance.nearest->first)) + "," +
                                 csvCell(nameOf(clearance.nearest->second))
                           : std::string(",,"));
      }
      text += "," + csvCell(joined(outsideLimits(k), "; ")) + "\n";
    }
    return text;
  }

  /// "hand - table; wrist - table; 3 more".
  std::string pairsText(std::size_t state, std::size_t most = std::numeric_limits<std::size_t>::max()) const {
    const std::vector<Names> pairs = pairsOf(state);
    std::vector<std::string> texts;
    for (std::size_t i = 0; i < std::min(most, pairs.size()); ++i) {
      texts.push_back(pairs[i].first + " - " + pairs[i].second);
    }
    if (texts.size() < pairs.size()) texts.push_back(std::to_string(pairs.size() - texts.size()) + " more");
    return joined(texts, "; ");
  }

  void printStates() const {
    constexpr std::size_t kShown = 20, kShownPairs = 10;
    const bool room = !answers_.clearance.empty();
    Table table(Table::Others::kLeft);
    std::vector<std::string> head = {"state", "collides", "pairs"};
    if (room) head.insert(head.begin() + 2, "clearance");
    head.push_back("outside limits");
    table.row(head);
    std::size_t listed = 0;
    for (std::size_t k = 0; k < states(); ++k) {
      const std::vector<std::string> outside = outsideLimits(k);
      if (answers_.hit[k] == 0 && outside.empty() && !room) continue;
      if (++listed > kShown) continue;
      std::vector<std::string> row = {setup_.states[k].place, answers_.hit[k] != 0 ? "yes" : "no",
                                      pairsText(k, kShownPairs)};
      if (room) row.insert(row.begin() + 2, clearanceText(answers_.clearance[k]));
      row.push_back(joined(outside, "; "));
      table.row(row);
    }
    if (listed > 0) table.print();
    if (listed > kShown) std::cout << listed - kShown << " more; --csv FILE or --json FILE writes all states.\n";
    if (listed > 0) std::cout << '\n';
  }

  /// How the answers differ from FCL's where that is explained.
  std::string explainedDifferences(const ModelArguments& model) const {
    const auto explained = std::count_if(answers_.differences.begin(), answers_.differences.end(),
                                         [](const SceneDifference& d) { return !d.fault; });
    if (explained == 0) return "";
    return counted(static_cast<std::size_t>(explained), "expected difference") +
           " from FCL's answers for the pairs of all states: " +
           (model.exact()
                ? "FCL's solvers for shapes are approximate, FCL has no margins, and its tests in float differ"
                : "conservative answers may report a collision where the surfaces are near") +
           "; --json lists them";
  }

  Json differencesJson() const {
    Json list = Json::array();
    for (const SceneDifference& d : answers_.differences) {
      const Names names = namesOf(d.pair);
      list.push_back({{"index", d.state},
                      {"a", names.first},
                      {"b", names.second},
                      {"bocst", d.bocst},
                      {"fcl", !d.bocst},
                      {"fault", d.fault}});
    }
    return list;
  }

  void throwIfWrong(Scalar scalar) const {
    for (const SceneDifference& d : answers_.differences) {
      if (!d.fault) continue;
      const Names names = namesOf(d.pair);
      const auto mesh = [this](std::size_t body) { return bodies_.shapes[bodies_.bodies[body].shape].mesh.get(); };
      const std::string beyond = beyondLimits({mesh(d.pair.first), mesh(d.pair.second)}, scalar);
      throw std::runtime_error(setup_.states[d.state].place + ": " + printable(names.first) + " and " +
                               printable(names.second) +
                               (d.bocst ? " collide according to bocst, but not according to FCL"
                                        : " collide according to FCL, but not according to bocst") +
                               "; " + (beyond.empty() ? "please report the scene" : beyond));
    }
  }

 private:
  const std::string& nameOf(std::size_t body) const { return setup_.part(bodies_.bodies[body].part).name; }

  std::string clearanceText(const Clearance& clearance) const {
    if (!clearance.nearest) return "";
    return (clearance.distance > 0 ? formatNumber(clearance.distance, 4) : "0") + " " +
           nameOf(clearance.nearest->first) + " - " + nameOf(clearance.nearest->second);
  }

  const SceneSetup& setup_;
  const Bodies& bodies_;
  const SceneAnswers& answers_;
};

struct SceneCommand {
  SceneArguments scene;
  std::string adjacent = "srdf";
  double margin = 0;
  bool clearance = false;
  bool no_fcl = false;
  bool adjacent_given = false;
  std::string of_meshes;  ///< The first option that was given of those that only meshes obey.
  ModelArguments model;
  std::string csv_file;
  std::string html_file;
  Output output;

  int run() const {
    output.check({scene.file, scene.states, scene.srdf}, {csv_file, html_file});
    const SceneSetup setup = readScene(scene);
    output.check({}, {csv_file, html_file});  // the scene names more files
    if (!setup.robot && adjacent_given) throw std::runtime_error("--adjacent: " + scene.file + " has no robot");
    for (const std::string& warning : setup.warnings) std::cerr << "bocst: " << printable(warning) << '\n';
    const Bodies bodies(setup);
    if (bodies.triangles() == 0 && !of_meshes.empty()) {
      throw std::runtime_error(of_meshes + ": has no effect, because " + scene.file + " has no mesh");
    }
    SceneQuestions questions;
    questions.scalar = model.scalarKind();
    questions.options = model.options();
    questions.options.margin = margin;
    questions.clearance = clearance;
    questions.fcl = !no_fcl;
    const SceneAnswers answers = askScene(setup, bodies, questions);
    const SceneReport report(setup, bodies, answers);

    if (!html_file.empty()) writeFile(html_file, scenePage(scene.file, setup, bodies, answers).html());
    if (!csv_file.empty()) writeText(csv_file, report.csv());
    if (output.wantsJson()) {
      output.write(json(setup, bodies, answers, report));
    } else if (csv_file != "-") {
      print(setup, bodies, answers, report);
    }
    report.throwIfWrong(model.scalarKind());
    return 0;
  }

 private:
  static std::string robotText(const Robot& robot) {
    std::vector<std::string> joints;
    for (const std::size_t i : robot.freeJoints()) joints.push_back(robot.joints()[i].name);
    return robot.name() + ", " + counted(robot.links().size(), "link") + "; joints: " + joined(joints, ", ");
  }

  static std::string objectsText(const SceneSetup& setup) {
    std::size_t moving = 0, attached = 0;
    for (const SceneObject& object : setup.objects) {
      moving += object.moving;
      attached += object.link.has_value();
    }
    return std::to_string(setup.objects.size() - moving - attached) + " fixed, " + std::to_string(moving) + " moving" +
           (attached > 0 ? ", " + std::to_string(attached) + " attached" : "");
  }

  static std::string shapesText(const Bodies& bodies) {
    std::size_t meshes = 0;
    for (std::size_t i = 0; i < bodies.bodies.size(); ++i) meshes += bodies.isMesh(i);
    return std::to_string(meshes) + " of " + counted(bodies.triangles(), "triangle") + ", and " +
           counted(bodies.bodies.size() - meshes, "shape");
  }

  void print(const SceneSetup& setup, const Bodies& bodies, const SceneAnswers& answers,
             const SceneReport& report) const {
    Table head(Table::Others::kLeft);
    head.row({"scene", scene.file});
    if (setup.robot) head.row({"robot", robotText(*setup.robot)});
    if (!setup.objects.empty()) head.row({"objects", objectsText(setup)});
    head.row({"meshes", shapesText(bodies)});
    head.row({"pairs", counted(bodies.pairCount(), "pair") + " of shapes" + (bodies.pairCount() == 1 ? " is" : " are") +
                           " checked"});
    head.row({"states", std::to_string(report.states()) + ", " + setup.states_from});
    head.row({"answer", model.answerText()});
    head.print();
    for (const std::string& note : setup.notes) std::cout << "Note: " << printable(note) << ".\n";
    std::cout << '\n';
    report.printStates();
    std::cout << report.collisions() << " of " << counted(report.states(), "state")
              << (model.exact() ? " collide.\n" : " may collide.\n");
    if (report.statesOutsideLimits() > 0) {
      std::cout << "In " << report.statesOutsideLimits() << " of " << report.states()
                << " states a joint is outside its limits.\n";
    }
    if (bodies.pairCount() == 0) std::cout << "No pair of shapes was checked: none moves, or all may touch.\n";
    const std::string differences = report.explainedDifferences(model);
    if (!differences.empty()) std::cout << differences << ".\n";
    std::cout << '\n';
    printTimes(answers);
  }

  static void printTimes(const SceneAnswers& answers) {
    Table table;
    const auto row = [&](const std::string& what, double ours, double theirs, std::string (*format)(double)) {
      if (!answers.fcl) return table.row({what, format(ours)});
      table.row({what, format(ours), format(theirs), ours > 0 && theirs > 0 ? formatRatio(theirs / ours) : ""});
    };
    const SceneTimes ours = answers.bocst, theirs = answers.fcl.value_or(SceneTimes{});
    const auto states = static_cast<double>(answers.hit.size());
    table.row(answers.fcl ? std::vector<std::string>{"", "bocst", "FCL's managers", "ratio"}
                          : std::vector<std::string>{"", "bocst"});
    row("set-up, from the arrays", ours.set_up, theirs.set_up, formatTime);
    row("all states, first query", ours.first, theirs.first, formatTime);
    row("all states, second query", ours.again, theirs.again, formatTime);
    row("set-up and first query", ours.set_up + ours.first, theirs.set_up + theirs.first, formatTime);
    row("one state, second query", ours.again / states, theirs.again / states, formatTime);
    if (answers.built) {
      row("set-up, trees built (Scene::buildTrees)", answers.built->set_up, theirs.set_up, formatTime);
      row("all states, first query, trees built", answers.built->first, theirs.first, formatTime);
    }
    row("tree bytes", static_cast<double>(answers.bytes), static_cast<double>(answers.fcl_bytes), formatBytes);
    table.print();
  }

  Json json(const SceneSetup& setup, const Bodies& bodies, const SceneAnswers& answers,
            const SceneReport& report) const {
    Json options = model.json();
    options["margin"] = margin;
    Json parts = Json::array();
    for (std::size_t i = 0; i < setup.partCount(); ++i) {
      parts.push_back({{"name", setup.part(i).name},
                       {"link", i < setup.linkCount()},
                       {"moving", setup.moves(i)},
                       {"shapes", setup.part(i).shapes.size()}});
    }
    Json rows = Json::array();
    for (std::size_t k = 0; k < report.states(); ++k) rows.push_back(report.stateJson(k));
    const bool agree = std::none_of(answers.differences.begin(), answers.differences.end(),
                                    [](const SceneDifference& d) { return d.fault; });
    Json result = {{"scene", scene.file},
                   {"robot", setup.robot ? Json(setup.robot->name()) : Json()},
                   {"joints", setup.names().joints},
                   {"parts", parts},
                   {"pairs_asked", bodies.pairCount()},
                   {"triangles", bodies.triangles()},
                   {"states_from", setup.states_from},
                   {"notes", setup.notes},
                   {"warnings", setup.warnings},
                   {"options", options},
                   {"oracle", answers.oracle},
                   {"asked", report.states()},
                   {"collisions", report.collisions()},
                   {"outside_limits", report.statesOutsideLimits()}};
    result["bytes"] = {{"bocst", answers.bytes}};
    result["times_us"] = {{"bocst", timesJson(answers.bocst)}};
    if (answers.built) result["times_us"]["bocst_built"] = timesJson(*answers.built);
    if (answers.fcl) {
      const SceneTimes& fcl = *answers.fcl;
      result["agree"] = agree;
      result["differences"] = report.differencesJson();
      result["bytes"]["fcl"] = answers.fcl_bytes;
      result["times_us"]["fcl"] = timesJson(fcl);
      result["ratio"] = {{"set_up", fcl.set_up / answers.bocst.set_up},
                         {"first", fcl.first / answers.bocst.first},
                         {"again", fcl.again / answers.bocst.again}};
    }
    result["states"] = rows;
    return result;
  }

  static Json timesJson(const SceneTimes& times) {
    return {{"set_up", times.set_up}, {"first", times.first}, {"again", times.again}};
  }
};

}  // namespace

void addScene(CLI::App& program, Job& job) {
  auto scene = std::make_shared<SceneCommand>();
  CLI::App* command = program.add_subcommand(
      "scene", "check states of a robot or of other moving objects for collision with obstacles");
  command->footer(
      "FILE is a scene file (JSON with objects, a robot, pairs that may touch and states; see "
      "share/doc/scene-program.md)\n"
      "or a URDF.\n"
      "States are the lines of a table (CSV, or separated by blanks). Its first line names the columns: each movable\n"
      "joint that does not mimic another, and for each moving object NAME.x, .y, .z with .qw, .qx, .qy, .qz or .roll,\n"
      ".pitch, .yaw.\n"
      "Without states, joints are at 0.\n"
      "All links and moving objects are checked with each other and with the fixed objects, except for pairs that\n"
      "may touch.");
  command->add_option("file", scene->scene.file, "scene file (JSON) or robot (URDF)")->type_name("FILE")->required();
  command->add_option("--states", scene->scene.states, "states to check, one per line (CSV)")->type_name("FILE");
  command
      ->add_option("--srdf", scene->scene.srdf, "SRDF file; its disable_collisions are pairs of links that may touch")
      ->type_name("FILE");
  command
      ->add_option(
          "--package", scene->scene.packages,
          "folder of package://name, used before ROS_PACKAGE_PATH and AMENT_PREFIX_PATH; can be given several times")
      ->type_name("name=FOLDER")
      ->allow_extra_args(false);
  command
      ->add_option(
          "--adjacent", scene->adjacent,
          "links that a joint connects: srdf = as the SRDF says (without one: ignore), ignore = they may touch, "
          "check = they are checked")
      ->check(CLI::IsMember({"srdf", "ignore", "check"}))
      ->capture_default_str();
  command->add_flag("--clearance", scene->clearance,
                    "report also the least distance in each state and the pair that has it");
  command
      ->add_option(
          "--margin", scene->margin,
          "margin of each mesh, in its unit: surfaces that are at most this far apart collide (two meshes: twice this)")
      ->check(notNegative())
      ->capture_default_str();
  command->add_flag("--no-fcl", scene->no_fcl, "do not compare with FCL");
  command->add_option("--csv", scene->csv_file, "write a line for each state to this file; - is stdout")
      ->type_name("FILE|-")
      ->check(outputFile(".csv", true));
  scene->model.addAll(*command);
  addHtml(*command, scene->html_file);
  addJson(*command, scene->output);
  command->callback([scene, command, &job] {
    scene->model.refuseIdle(*command);
    scene->adjacent_given = command->get_option("--adjacent")->count() != 0;
    for (const char* option : {"--margin", "--answer", "--depth", "--subdivision", "--dimension", "--oracle"}) {
      if (scene->of_meshes.empty() && command->get_option(option)->count() != 0) scene->of_meshes = option;
    }
    read("--package", [&] { Packages(scene->scene.packages); });
    checkStdout(scene->csv_file, scene->output);
    using Adjacent = SceneArguments::Adjacent;
    scene->scene.adjacent = scene->adjacent == "ignore"  ? Adjacent::kIgnore
                            : scene->adjacent == "check" ? Adjacent::kCheck
                                                         : Adjacent::kAsSrdf;
    job = [scene] { return scene->run(); };
  });
}

}  // namespace bocst::program
