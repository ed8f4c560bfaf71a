// SPDX-License-Identifier: BSD-3-Clause
#include "robot/urdf.h"

#include <console_bridge/console.h>
#include <urdf_model/model.h>
#include <urdf_parser/urdf_parser.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>
#include <sstream>
#include <stdexcept>
#include <utility>
#include <vector>

#include "cli/suggest.h"

namespace bocst::program {
namespace {

/// What urdfdom says, which it otherwise writes to stderr.
class Listener final : public console_bridge::OutputHandler {
 public:
  Listener() { console_bridge::useOutputHandler(this); }
  ~Listener() override { console_bridge::restorePreviousOutputHandler(); }
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

  void log(const std::string& text, console_bridge::LogLevel level, const char*, int) override {
    if (level >= console_bridge::CONSOLE_BRIDGE_LOG_ERROR) complaints_ += (complaints_.empty() ? "" : "; ") + text;
  }

  /// All errors, the one nearest to the cause first; also of what urdfdom leaves out and goes on.
  const std::string& complaints() const { return complaints_; }

 private:
  std::string complaints_;
};

/// Joints between a link and the root; parsers go down the tree by recursion.
constexpr std::size_t kMostDepth = 1000;

/// Letters of a name that may be wrong: <plugin>, of which a joint may have one, differs from <origin> in three, and
/// <init> from <limit> in two.
std::size_t mostWrongIn(const std::string& name) { return std::clamp<std::size_t>((name.size() + 1) / 3, 1, 2); }

/// What an element of a URDF may have, as far as it matters here.
struct Known {
  bool is_once;  ///< urdfdom takes the first child of each name.
  std::vector<std::string> children;
  std::vector<std::string> attributes;  ///< Empty if urdfdom needs all of them.
  bool is_strict = false;               ///< Has no others.
};

const std::map<std::string, Known> kKnown = {
    {"robot", {false, {"link", "joint"}, {}}},
    {"link", {false, {"collision"}, {}}},
    {"collision", {true, {"origin", "geometry"}, {}}},
    {"geometry", {false, {"box", "sphere", "cylinder", "mesh"}, {}}},
    {"joint", {true, {"parent", "child", "origin", "axis", "limit", "mimic"}, {}}},
    {"origin", {true, {}, {"xyz", "rpy"}, true}},
    {"axis", {true, {}, {"xyz"}}},
    {"limit", {true, {}, {"lower", "upper", "effort", "velocity"}}},
    {"mimic", {true, {}, {"joint", "multiplier", "offset"}}},
    {"mesh", {true, {}, {"filename", "scale"}}},
};

class UrdfReader {
 public:
  UrdfReader(const XmlFile& file, const Packages& packages, MeshStore& meshes)
      : xml_(file), packages_(packages), meshes_(meshes) {
    xml_.expectRoot("robot");
    xml_.refuseXacro("robot.urdf");
  }

  Robot read() {
    checkElement(xml_.root(), "");
    checkNames("link");
    checkNames("joint");
    checkTree();
    const urdf::ModelInterfaceSharedPtr model = parse();
    add(*model->root_link_);
    try {
      return Robot(model->name_, std::move(links_), std::move(joints_));
    } catch (const JointError& e) {
      throw std::runtime_error(placeOf("joint", e.joint) + ": " + e.what());
    } catch (const std::runtime_error& e) {
      throw std::runtime_error(xml_.name() + ": " + e.what());
    }
  }

 private:
  /// Each needs a name of its own. (Of two that have the same, urdfdom does not say which is the second.)
  void checkNames(const char* kind) const {
    std::set<std::string> names;
    for (const pugi::xml_node& element : xml_.root().children(kind)) {
      const std::string name = xml_.attribute(element, "name");
      if (!names.insert(name).second) {
        throw std::runtime_error(xml_.place(element) + ": a second " + kind + " named " + name);
      }
    }
  }

  /// urdfdom only looks that one link is nobody's child, and never frees links in a circle.
  void checkTree() const {
    std::map<std::string, pugi::xml_node> joint_of;
    for (const pugi::xml_node& joint : xml_.root().children("joint")) {
      const std::string child = joint.child("child").attribute("link").value();
      if (child.empty()) continue;  // urdfdom complains of that
      const auto [other, is_first] = joint_of.emplace(child, joint);
      if (!is_first) {
        complain("joint", joint.attribute("name").value(),
                 "link " + child + " is the child of joint " + other->second.attribute("name").value() +
                     ", too; a robot is a tree of links");
      }
    }
    std::map<std::string, std::size_t> depth_of;  // joints between a link and the root
    for (const auto& [link, joint] : joint_of) {
      std::set<std::string> path;
      std::string at = link;
      for (auto up = joint_of.find(at); up != joint_of.end() && depth_of.count(at) == 0; up = joint_of.find(at)) {
        if (!path.insert(at).second) {
          complain("joint", joint.attribute("name").value(),
                   "links are connected in a circle; a robot is a tree of links");
        }
        at = up->second.child("parent").attribute("link").value();
        const auto above = depth_of.find(at);
        if (path.size() + (above == depth_of.end() ? 0 : above->second) > kMostDepth) {
          complain("joint", joint.attribute("name").value(),
                   "more than " + std::to_string(kMostDepth) + " joints are between link " + link + " and the root");
        }
      }
      const auto above = depth_of.find(at);
      depth_of[link] = path.size() + (above == depth_of.end() ? 0 : above->second);
    }
  }

  /// urdfdom leaves out, without a word, what it does not know, and a second element where it takes one.
  void checkElement(const pugi::xml_node& element, const std::string& owner) const {
    const auto found = kKnown.find(element.name());
    if (found == kKnown.end()) return;
    const Known& known = found->second;
    const auto isIn = [](const std::vector<std::string>& names, const std::string& name) {
      return std::find(names.begin(), names.end(), name) != names.end();
    };
    const std::string in = "<" + found->first + ">";
    const auto refuse = [&](const pugi::xml_node& where, const std::string& what) {
      throw std::runtime_error(xml_.place(where) + ": " + owner + what);
    };
    for (const pugi::xml_attribute& attribute : element.attributes()) {
      const std::string name = attribute.name();
      if (isIn(known.attributes, name) || name.find(':') != std::string::npos) continue;
      const std::string near = suggestion(name, known.attributes, mostWrongIn(name));
      if (known.is_strict || !near.empty()) refuse(element, in + " has no attribute " + name + "." + near);
    }
    std::set<std::string> seen;
    for (const pugi::xml_node& child : element.children()) {
      const std::string name = child.name();
      if (child.type() != pugi::node_element || name.find(':') != std::string::npos) continue;
      if (isIn(known.children, name)) {
        const bool is_first = seen.insert(name).second;
        if (known.is_once && !is_first) refuse(child, "a second <" + name + "> in one " + in);
        const bool is_named = name == "link" || name == "joint";
        checkElement(child, is_named ? name + " " + child.attribute("name").value() + ": " : owner);
      } else {
        const std::string near = suggestion(name, known.children, mostWrongIn(name));
        if (!near.empty()) refuse(child, in + " has no element <" + name + ">." + near);
      }
    }
    const auto shapes = element.children();
    const auto isElement = [](const pugi::xml_node& shape) { return shape.type() == pugi::node_element; };
    if (found->first == "geometry" && std::count_if(shapes.begin(), shapes.end(), isElement) > 1) {
      refuse(element, "a <collision> has one shape; write a <collision> for each");
    }
  }

  /// The robot without what nobody asks about here, so that faults of that do not matter.
  std::string withoutLooks() const {
    pugi::xml_document robot;
    robot.append_copy(xml_.root());
    while (robot.document_element().remove_child("material")) {
    }
    for (pugi::xml_node link : robot.document_element().children("link")) {
      for (const char* name : {"visual", "inertial"}) {
        while (link.remove_child(name)) {
        }
      }
    }
    std::ostringstream text;
    robot.save(text);
    return text.str();
  }

  urdf::ModelInterfaceSharedPtr parse() const {
    const Listener listener;
    urdf::ModelInterfaceSharedPtr model;
    std::string complaint;
    try {
      model = urdf::parseURDF(withoutLooks());
    } catch (const std::exception& e) {
      complaint = e.what();
    }
    if (!listener.complaints().empty()) complaint = listener.complaints();
    if (complaint.empty() && (model == nullptr || model->root_link_ == nullptr)) complaint = "urdfdom cannot read it";
    if (!complaint.empty()) throw std::runtime_error(placeOfNamed(complaint) + ": " + complaint);
    return model;
  }

  /// Of the first link or joint whose name stands in brackets or quotes in the text.
  std::string placeOfNamed(const std::string& text) const {
    for (const pugi::xml_node& element : xml_.root().children()) {
      const std::string name = element.attribute("name").value();
      if (name.empty()) continue;
      for (const std::string& quoted : {"[" + name + "]", "'" + name + "'", "\"" + name + "\""}) {
        if (text.find(quoted) != std::string::npos) return xml_.place(element);
      }
    }
    return xml_.name();
  }

  std::string placeOf(const char* kind, const std::string& name) const {
    const pugi::xml_node element = xml_.root().find_child_by_attribute(kind, "name", name.c_str());
    return element ? xml_.place(element) : xml_.name();
  }

  [[noreturn]] void complain(const char* kind, const std::string& name, const std::string& what) const {
    throw std::runtime_error(placeOf(kind, name) + ": " + kind + " " + name + ": " + what);
  }

  Eigen::Isometry3d poseOf(const urdf::Pose& pose, const char* kind, const std::string& name) const {
    Eigen::Quaterniond q;
    pose.rotation.getQuaternion(q.x(), q.y(), q.z(), q.w());
    Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
    X.linear() = q.normalized().toRotationMatrix();
    X.translation() = Eigen::Vector3d(pose.position.x, pose.position.y, pose.position.z);
    if (!X.matrix().allFinite()) complain(kind, name, "the origin has a number that is not finite");
    return X;
  }

  /// The link and what hangs on it, parents before children.
  void add(const urdf::Link& link) {
    const std::size_t index = links_.size();
    Part part;
    part.name = link.name;
    part.has_visual = xml_.root().find_child_by_attribute("link", "name", link.name.c_str()).child("visual") != nullptr;
    for (const urdf::CollisionSharedPtr& collision : link.collision_array) {
      part.shapes.push_back({shapeOf(*collision->geometry, link.name), poseOf(collision->origin, "link", link.name)});
    }
    links_.push_back(std::move(part));
    for (const urdf::JointSharedPtr& joint : link.child_joints) {
      joints_.push_back(jointOf(*joint, index));
      const auto child = std::find_if(link.child_links.begin(), link.child_links.end(),
                                      [&](const auto& other) { return other->name == joint->child_link_name; });
      add(**child);
    }
  }

  Shape shapeOf(const urdf::Geometry& geometry, const std::string& link) {
    Shape shape;
    switch (geometry.type) {
      case urdf::Geometry::BOX: {
        const urdf::Vector3& dim = static_cast<const urdf::Box&>(geometry).dim;
        shape.size = {dim.x, dim.y, dim.z};
        break;
      }
      case urdf::Geometry::SPHERE:
        shape.kind = Shape::Kind::kSphere;
        shape.size.setConstant(static_cast<const urdf::Sphere&>(geometry).radius);
        break;
      case urdf::Geometry::CYLINDER: {
        const auto& cylinder = static_cast<const urdf::Cylinder&>(geometry);
        shape.kind = Shape::Kind::kCylinder;
        shape.size = {cylinder.radius, cylinder.length, cylinder.length};
        break;
      }
      case urdf::Geometry::MESH:
        shape.kind = Shape::Kind::kMesh;
        shape.mesh = meshOf(static_cast<const urdf::Mesh&>(geometry), link);
        return shape;
      default:
        complain("link", link, "a geometry of unknown type");
    }
    if (!(shape.size.minCoeff() > 0) || !(shape.size.maxCoeff() <= kMostLength)) {
      complain("link", link, "the sizes of a geometry must be above 0 and at most 1e75");
    }
    return shape;
  }

  std::shared_ptr<const Mesh> meshOf(const urdf::Mesh& mesh, const std::string& link) {
    try {
      const std::string file =
          packages_.resolve(mesh.filename, std::filesystem::path(xml_.name()).parent_path().string());
      return meshes_.get(file, {mesh.scale.x, mesh.scale.y, mesh.scale.z});
    } catch (const std::exception& e) {
      complain("link", link, "mesh " + mesh.filename + ": " + e.what());
    }
  }

  Joint jointOf(const urdf::Joint& given, std::size_t parent) const {
    Joint joint;
    joint.name = given.name;
    joint.parent = parent;
    joint.X_PJ = poseOf(given.parent_to_joint_origin_transform, "joint", given.name);
    joint.kind = kindOf(given);
    if (joint.kind == Joint::Kind::kFixed) return joint;
    joint.axis = {given.axis.x, given.axis.y, given.axis.z};
    const double norm = joint.axis.norm();
    if (!std::isfinite(norm) || !(norm > 1e-9)) complain("joint", given.name, "the axis has no direction");
    joint.axis /= norm;
    if (given.limits != nullptr && joint.kind != Joint::Kind::kContinuous) {
      joint.limits = Joint::Limits{given.limits->lower, given.limits->upper};
    }
    if (given.mimic != nullptr) {
      joint.mimic = Joint::Mimic{given.mimic->joint_name, given.mimic->multiplier, given.mimic->offset};
    }
    return joint;
  }

  Joint::Kind kindOf(const urdf::Joint& joint) const {
    switch (joint.type) {
      case urdf::Joint::FIXED:
        return Joint::Kind::kFixed;
      case urdf::Joint::REVOLUTE:
        return Joint::Kind::kRevolute;
      case urdf::Joint::CONTINUOUS:
        return Joint::Kind::kContinuous;
      case urdf::Joint::PRISMATIC:
        return Joint::Kind::kPrismatic;
      default:
        complain(
            "joint", joint.name,
            "the joint type must be fixed, revolute, continuous or prismatic; replace a floating or planar joint by "
            "prismatic and revolute joints");
    }
  }

  const XmlFile& xml_;
  const Packages& packages_;
  MeshStore& meshes_;
  std::vector<Part> links_;
  std::vector<Joint> joints_;
};

}  // namespace

Robot readUrdf(const XmlFile& file, const Packages& packages, MeshStore& meshes) {
  return UrdfReader(file, packages, meshes).read();
}

}  // namespace bocst::program
