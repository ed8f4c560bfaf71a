// SPDX-License-Identifier: BSD-3-Clause
#include "scene/scene_file.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>
#include <stdexcept>
#include <vector>

#include "cli/file.h"
#include "cli/report.h"
#include "cli/suggest.h"
#include "cli/words.h"
#include "robot/mesh_store.h"
#include "robot/packages.h"
#include "robot/srdf.h"
#include "robot/urdf.h"
#include "scene/json_element.h"

namespace bocst::program {
namespace {

namespace fs = std::filesystem;

/// By its ending, or by its first character.
bool isUrdf(const std::string& file, const std::string& text) {
  const std::string ending = endingOf(file);
  if (ending == ".json") return false;
  if (ending == ".urdf" || ending == ".xml" || ending == ".xacro") return true;
  const std::size_t first = text.find_first_not_of(" \t\r\n\xEF\xBB\xBF");
  return first != std::string::npos && text[first] == '<';
}

Json parseJson(const std::string& file, const std::string& text) {
  std::vector<std::set<std::string>> keys;  // Of the objects that are open.
  const auto refuseRepeatedKeys = [&](int, Json::parse_event_t event, Json& parsed) {
    if (event == Json::parse_event_t::object_start) keys.emplace_back();
    if (event == Json::parse_event_t::object_end) keys.pop_back();
    if (event == Json::parse_event_t::key && !keys.back().insert(parsed.get<std::string>()).second) {
      throw std::runtime_error(file + ": \"" + parsed.get<std::string>() + "\" is given twice in one object");
    }
    return true;
  };
  try {
    return Json::parse(text, refuseRepeatedKeys, true, true);
  } catch (const Json::exception& e) {
    std::string what = e.what();
    what.erase(0, what.find("] ") + 2);
    const std::string at = "parse error at ";
    if (what.rfind(at, 0) == 0) what.erase(0, at.size());
    if (text.find_first_of("{[") == std::string::npos) what += "; a scene file (JSON) or a URDF is expected";
    throw std::runtime_error(file + ": " + what);
  }
}

class Reader {
 public:
  explicit Reader(const SceneArguments& arguments) : arguments_(arguments), packages_(arguments.packages) {}

  SceneSetup read() {
    setup_.file = arguments_.file;
    const std::string text = readFile(arguments_.file);  // once: it may be a pipe
    if (isUrdf(arguments_.file, text)) {
      addRobot(XmlFile(arguments_.file, text), "");
      readStates(nullptr);
    } else {
      const Json json = parseJson(arguments_.file, text);
      const JsonElement root(json, arguments_.file, norms_);
      readScene(root);
      readStates(&root);
    }
    checkSomethingIsAsked();
    noteSizes();
    warnOfNorms();
    return std::move(setup_);
  }

 private:
  std::string path(const JsonElement& element) const {
    const std::string uri = element.text();
    try {
      return packages_.resolve(uri, fs::path(arguments_.file).parent_path().string());
    } catch (const std::runtime_error& e) {
      element.complain(e.what());
    }
  }

  void readScene(const JsonElement& root) {
    root.allowKeys({"robot", "objects", "groups", "allowed", "states"});
    if (root.has("robot")) readRobot(root.at("robot"));
    if (!setup_.robot && !arguments_.srdf.empty()) root.complain("an SRDF is given, but no robot");
    if (root.has("objects")) {
      for (const JsonElement& object : root.at("objects").items()) readObject(object);
    }
    for (const std::size_t link : unchecked_) {
      for (std::size_t part = setup_.linkCount(); part < setup_.partCount(); ++part) setup_.allowed.emplace(link, part);
    }
    nameParts(root);
    if (root.has("groups")) readGroups(root.at("groups"));
    if (root.has("allowed")) readAllowed(root.at("allowed"));
  }

  void readRobot(const JsonElement& robot) {
    if (robot.isText()) return addRobot(XmlFile(path(robot)), "");
    if (!robot.isObject()) robot.complain("the name of a URDF (\"...\") or an object {\"urdf\": \"...\"} expected");
    robot.allowKeys({"urdf", "srdf", "pose", "packages"});
    if (robot.has("packages")) {
      for (const auto& [name, folder] : robot.at("packages").members()) packages_.add(name, path(folder));
    }
    if (robot.has("pose")) setup_.X_WR = robot.at("pose").pose();
    addRobot(XmlFile(path(robot.at("urdf"))), robot.has("srdf") ? path(robot.at("srdf")) : "");
  }

  void noteUncheckedLinks() {
    std::vector<std::string> names;
    for (const Part& link : setup_.robot->links()) {
      if (link.has_visual && link.shapes.empty()) names.push_back(link.name);
    }
    if (names.empty()) return;
    setup_.notes.push_back("links with a <visual> and no <collision> are not checked: " + joined(names, ", "));
  }

  /// A mesh in millimetres among parts in metres is 1000 times as large.
  void noteSizes() {
    constexpr double kRatio = 300;
    std::vector<double> sizes;
    for (std::size_t i = 0; i < setup_.partCount(); ++i) {
      if (!setup_.part(i).shapes.empty()) sizes.push_back(sizeOf(setup_.part(i)));
    }
    if (sizes.size() < 3) return;
    std::nth_element(sizes.begin(), sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2), sizes.end());
    const double usual = sizes[sizes.size() / 2];
    for (std::size_t i = 0; i < setup_.partCount(); ++i) {
      const double size = sizeOf(setup_.part(i));
      if (!(size > kRatio * usual)) continue;
      setup_.notes.push_back(setup_.part(i).name + " has the size " + formatNumber(size, 3) + ", most parts have " +
                             formatNumber(usual, 3) + "; is it in another length unit (\"scale\" converts it)?");
    }
  }

  /// The longest edge of a part's meshes and bodies, each about its own frame.
  static double sizeOf(const Part& part) {
    double size = 0;
    for (const PlacedShape& placed : part.shapes) {
      const Shape& shape = placed.shape;
      size = std::max(size, shape.mesh != nullptr ? shape.mesh->bounds().sizes().maxCoeff() : shape.size.maxCoeff());
    }
    return size;
  }

  void addRobot(const XmlFile& urdf, const std::string& own_srdf) {
    setup_.robot = readUrdf(urdf, packages_, meshes_);
    noteUncheckedLinks();
    const std::string& srdf = arguments_.srdf.empty() ? own_srdf : arguments_.srdf;
    if (!srdf.empty()) {
      Srdf read = readSrdf(srdf, *setup_.robot);
      setup_.allowed = std::move(read.disabled);
      unchecked_ = std::move(read.unchecked);
      setup_.warnings = std::move(read.warnings);
    }
    using Adjacent = SceneArguments::Adjacent;
    if (arguments_.adjacent == Adjacent::kCheck || (arguments_.adjacent == Adjacent::kAsSrdf && !srdf.empty())) return;
    const auto adjacent = setup_.robot->adjacentLinks();
    setup_.allowed.insert(adjacent.begin(), adjacent.end());
    if (arguments_.adjacent == Adjacent::kAsSrdf && !adjacent.empty()) {
      setup_.notes.push_back("without an SRDF, links that a joint connects are not checked with each other (" +
                             counted(adjacent.size(), "pair") + "); --adjacent check checks them");
    }
  }

  void readObject(const JsonElement& element) {
    std::vector<std::string> keys = kShapes;
    keys.insert(keys.end(), {"name", "shapes", "scale", "pose", "moving", "attached"});
    element.allowKeys(keys);
    SceneObject object;
    object.part.name = element.at("name").text();
    if (object.part.name.empty()) element.complain("the name is empty");
    if (object.part.name == kAllLinks || object.part.name == kAllParts) {
      element.complain("the name " + object.part.name + " is that of a group");
    }
    object.moving = element.has("moving") && element.at("moving").boolean();
    if (element.has("pose")) object.X_WO = element.at("pose").pose();
    if (element.has("attached")) {
      if (object.moving) element.complain("an object can be moving or attached, not both");
      object.link = linkOf(element.at("attached"));
      setup_.allowed.emplace(*object.link, setup_.partCount());
      // Two objects on one link never move to each other.
      for (std::size_t i = 0; i < setup_.objects.size(); ++i) {
        if (setup_.objects[i].link == object.link) setup_.allowed.emplace(setup_.linkCount() + i, setup_.partCount());
      }
      for (const std::size_t link : setup_.robot->linksAround(*object.link)) {
        setup_.allowed.emplace(link, setup_.partCount());
      }
    }
    if (!object.moving && !object.X_WO) object.X_WO = Eigen::Isometry3d::Identity();
    if (element.has("shapes")) {
      if (!kindsOf(element).empty()) element.complain("either \"shapes\" or one shape is expected");
      for (const JsonElement& shape : element.at("shapes").items()) {
        std::vector<std::string> shape_keys = kShapes;
        shape_keys.insert(shape_keys.end(), {"scale", "pose"});
        shape.allowKeys(shape_keys);
        object.part.shapes.push_back({readShape(shape), Eigen::Isometry3d::Identity()});
        if (shape.has("pose")) object.part.shapes.back().X_PS = shape.at("pose").pose();
      }
      if (object.part.shapes.empty()) element.complain("\"shapes\" is empty");
    } else {
      object.part.shapes.push_back({readShape(element), Eigen::Isometry3d::Identity()});
    }
    setup_.objects.push_back(std::move(object));
  }

  std::size_t linkOf(const JsonElement& name) const {
    std::vector<std::string> links;
    for (std::size_t i = 0; i < setup_.linkCount(); ++i) links.push_back(setup_.part(i).name);
    const auto found = std::find(links.begin(), links.end(), name.text());
    if (found != links.end()) return static_cast<std::size_t>(found - links.begin());
    name.complain("the robot has no link " + name.text() + "." + suggestion(name.text(), links));
  }

  static std::vector<std::string> kindsOf(const JsonElement& element) {
    std::vector<std::string> kinds;
    for (const std::string& kind : kShapes) {
      if (element.has(kind.c_str())) kinds.push_back(kind);
    }
    return kinds;
  }

  Shape readShape(const JsonElement& element) {
    const std::vector<std::string> kinds = kindsOf(element);
    if (kinds.empty()) element.complain("one of " + joined(kShapes, ", ") + " is expected");
    if (kinds.size() > 1) element.complain("only one shape is allowed, not " + joined(kinds, " and "));
    const std::string& kind = kinds.front();
    const JsonElement value = element.at(kind);
    if (kind != "mesh" && element.has("scale")) element.complain("\"scale\" is for meshes");
    Shape shape;
    if (kind == "mesh") {
      shape.kind = Shape::Kind::kMesh;
      shape.mesh = readMesh(element, value);
      return shape;
    }
    if (kind == "sphere") {
      shape.kind = Shape::Kind::kSphere;
      shape.size.setConstant(value.number());
    } else if (kind == "box") {
      const std::vector<double> edges = value.numbers(3);
      shape.size = {edges[0], edges[1], edges[2]};
    } else {
      shape.kind = kind == "cylinder" ? Shape::Kind::kCylinder : Shape::Kind::kCapsule;
      const std::vector<double> sizes = value.numbers(2);  // radius, length
      shape.size = {sizes[0], sizes[1], sizes[1]};
    }
    if (!(shape.size.minCoeff() > 0) || !(shape.size.maxCoeff() <= kMostLength)) {
      value.complain("sizes must be above 0 and at most 1e75");
    }
    return shape;
  }

  std::shared_ptr<const Mesh> readMesh(const JsonElement& element, const JsonElement& file) {
    Eigen::Vector3d scale = Eigen::Vector3d::Ones();
    if (element.has("scale")) {
      const JsonElement given = element.at("scale");
      if (given.isNumber()) {
        scale.setConstant(given.number());
      } else {
        if (!given.isList() || given.items().size() != 3) given.complain("a number or a list of 3 numbers expected");
        const std::vector<double> numbers = given.numbers(3);
        scale = {numbers[0], numbers[1], numbers[2]};
      }
      if ((scale.array() == 0).any()) given.complain("the scale must not be 0");
    }
    const std::string at = path(file);
    try {
      return meshes_.get(at, scale);
    } catch (const std::exception& e) {
      file.complain(e.what());
    }
  }

  /// Names of parts, each of which is a group of one, "robot" for all links, and "*" for all.
  void nameParts(const JsonElement& root) {
    for (std::size_t i = 0; i < setup_.partCount(); ++i) {
      if (!groups_.emplace(setup_.part(i).name, std::vector<std::size_t>{i}).second) {
        root.complain("two parts are called " + setup_.part(i).name);
      }
      groups_[kAllParts].push_back(i);
    }
    std::vector<std::size_t> links(setup_.linkCount());
    for (std::size_t i = 0; i < links.size(); ++i) links[i] = i;
    if (!links.empty()) has_link_robot_ = !groups_.emplace(kAllLinks, std::move(links)).second;
  }

  const std::vector<std::size_t>& groupOf(const JsonElement& name) const {
    if (name.text() == kAllLinks && has_link_robot_) {
      name.complain("it may be the link of this name or all links: name the links one by one");
    }
    const auto found = groups_.find(name.text());
    if (found != groups_.end()) return found->second;
    std::vector<std::string> known;
    for (const auto& [group, parts] : groups_) {
      if (group != kAllParts) known.push_back(group);
    }
    name.complain("there is no link, object or group " + name.text() + "." + suggestion(name.text(), known));
  }

  void readGroups(const JsonElement& groups) {
    for (const auto& [name, members] : groups.members()) {
      std::vector<std::size_t> parts;
      for (const JsonElement& member : members.items()) {
        if (groups_.count(member.text()) == 0 && groups.has(member.text().c_str())) {
          member.complain("a group can only use groups that are above it");
        }
        const std::vector<std::size_t>& more = groupOf(member);
        parts.insert(parts.end(), more.begin(), more.end());
      }
      if (!groups_.emplace(name, std::move(parts)).second) members.complain("the name is already used");
    }
  }

  void readAllowed(const JsonElement& allowed) {
    for (const JsonElement& pair : allowed.items()) {
      const std::vector<JsonElement> sides = pair.items();
      if (sides.size() != 2) pair.complain("two names expected");
      for (const std::size_t a : groupOf(sides[0])) {
        for (const std::size_t b : groupOf(sides[1])) {
          if (a != b) setup_.allowed.insert(std::minmax(a, b));
        }
      }
    }
  }

  void readStates(const JsonElement* root) {
    const StateNames names = setup_.names();
    for (const std::string& object : names.objects) {
      if (std::find(names.joints.begin(), names.joints.end(), object) == names.joints.end()) continue;
      root->complain("a joint and a moving object are called " + object + "; a state could mean either");
    }
    const bool own = root != nullptr && root->has("states");
    setup_.states_file = arguments_.file;
    const std::string table = !arguments_.states.empty()           ? arguments_.states
                              : own && root->at("states").isText() ? path(root->at("states"))
                                                                   : "";
    if (!table.empty()) {
      setup_.states = statesOfTable(readFile(table), names, table, norms_);
      setup_.states_from = setup_.states_file = table;
    } else if (own) {
      if (!root->at("states").isList()) root->at("states").complain("the name of a table (\"...\") or a list expected");
      for (const JsonElement& element : root->at("states").items()) {
        setup_.states.push_back(stateOfJson(element, names));
        setup_.states.back().place = "states[" + std::to_string(setup_.states.size() - 1) + "]";
      }
      if (setup_.states.empty()) root->at("states").complain("the list is empty");
      setup_.states_from = arguments_.file;
    } else {
      try {
        setup_.states.push_back(startState(names));
      } catch (const std::runtime_error& e) {
        throw std::runtime_error(arguments_.file + ": " + e.what());
      }
      setup_.states_from =
          setup_.robot ? "no states given: all joints at 0" : "no states given: objects at their poses";
    }
  }

  /// A table may have one in each line.
  void warnOfNorms() {
    constexpr std::size_t kShown = 10;
    for (std::size_t i = 0; i < std::min(norms_.size(), kShown); ++i) setup_.warnings.push_back(norms_[i]);
    if (norms_.size() > kShown) {
      setup_.warnings.push_back(std::to_string(norms_.size() - kShown) + " more quaternions are normalised");
    }
  }

  void checkSomethingIsAsked() const {
    bool moving = false;
    for (std::size_t i = 0; i < setup_.partCount(); ++i) moving |= setup_.moves(i) && !setup_.part(i).shapes.empty();
    if (!moving) {
      throw std::runtime_error(arguments_.file +
                               ": nothing moves: no link has a <collision>, and no object has \"moving\": true");
    }
  }

  static const std::vector<std::string> kShapes;
  static constexpr const char *kAllLinks = "robot", *kAllParts = "*";

  const SceneArguments& arguments_;
  Packages packages_;
  MeshStore meshes_;
  SceneSetup setup_;
  std::map<std::string, std::vector<std::size_t>> groups_;
  std::vector<std::size_t> unchecked_;  ///< Links that the SRDF leaves out.
  std::vector<std::string> norms_;      ///< Warnings of quaternions.
  bool has_link_robot_ = false;
};

const std::vector<std::string> Reader::kShapes = {"mesh", "box", "sphere", "cylinder", "capsule"};

}  // namespace

SceneSetup readScene(const SceneArguments& arguments) { return Reader(arguments).read(); }

}  // namespace bocst::program
