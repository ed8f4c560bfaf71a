// SPDX-License-Identifier: BSD-3-Clause
// What `bocst scene` reads, the kinematics of robots against closed forms, and what it answers where that is known.
#include "scene/scene_file.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <random>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "robot/packages.h"
#include "robot/urdf.h"
#include "scene/ask_scene.h"
#include "scene/scene_page.h"
#include "scene/shape_mesh.h"
#include "temporary_folder.h"

namespace bocst {
namespace {

namespace fs = std::filesystem;
using namespace program;
using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;

/// The rotation about a unit vector by its closed form.
Matrix3d turned(const Vector3d& axis, double angle) {
  const double c = std::cos(angle), s = std::sin(angle), x = axis.x(), y = axis.y(), z = axis.z();
  Matrix3d R;
  R << c + x * x * (1 - c), x * y * (1 - c) - z * s, x * z * (1 - c) + y * s,  //
      y * x * (1 - c) + z * s, c + y * y * (1 - c), y * z * (1 - c) - x * s,   //
      z * x * (1 - c) - y * s, z * y * (1 - c) + x * s, c + z * z * (1 - c);
  return R;
}

Matrix3d rpy(double roll, double pitch, double yaw) {
  return turned(Vector3d::UnitZ(), yaw) * turned(Vector3d::UnitY(), pitch) * turned(Vector3d::UnitX(), roll);
}

Isometry3d pose(const Matrix3d& R, const Vector3d& p) {
  Isometry3d X = Isometry3d::Identity();
  X.linear() = R;
  X.translation() = p;
  return X;
}

void expectNear(const Isometry3d& X, const Isometry3d& wanted, const std::string& what, double tolerance = 1e-14) {
  EXPECT_LT((X.matrix() - wanted.matrix()).cwiseAbs().maxCoeff(), tolerance) << what << '\n'
                                                                             << X.matrix() << "\nwanted\n"
                                                                             << wanted.matrix();
}

class SceneFile : public ::testing::Test, protected test::TemporaryFolder {
 protected:
  SceneFile() {
    for (const char* name : {"ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"}) unsetenv(name);
    write("tetra.off", "OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n");
  }
  std::string robot(const std::string& text) const {
    return write("robot.urdf", "<robot name='r'>\n" + text + "</robot>\n");
  }

  static Robot read(const std::string& file, const Packages& packages = Packages()) {
    MeshStore meshes;
    return readUrdf(XmlFile(file), packages, meshes);
  }

  SceneSetup scene(const std::string& json,
                   SceneArguments::Adjacent adjacent = SceneArguments::Adjacent::kAsSrdf) const {
    SceneArguments arguments;
    arguments.adjacent = adjacent;
    arguments.file = write("scene.json", json);
    return readScene(arguments);
  }

  template <typename Action>
  static void expectComplaint(const Action& action, const std::vector<std::string>& pieces) {
    try {
      action();
      ADD_FAILURE() << "no complaint: " << pieces.front();
    } catch (const std::exception& e) {
      for (const std::string& piece : pieces) {
        EXPECT_NE(std::string(e.what()).find(piece), std::string::npos) << e.what() << "\nlacks: " << piece;
      }
    }
  }
};

std::string link(const std::string& name, const std::string& geometry = "") {
  return "<link name='" + name + "'>" +
         (geometry.empty() ? "" : "<collision><geometry>" + geometry + "</geometry></collision>") + "</link>\n";
}

std::string joint(const std::string& name, const std::string& type, const std::string& parent, const std::string& child,
                  const std::string& more = "") {
  return "<joint name='" + name + "' type='" + type + "'><parent link='" + parent + "'/><child link='" + child + "'/>" +
         more + "</joint>\n";
}

const std::string kLimit = "<limit lower='-1' upper='2' effort='1' velocity='1'/>";
const std::string kSphere = "<sphere radius='0.1'/>";

TEST_F(SceneFile, NamesTheSecondOfTwo) {
  const auto complains = [this](const std::string& text, const std::string& what) {
    expectComplaint([&] { read(robot(text)); }, {what});
  };
  complains(link("a") + link("b") + link("a"), "line 4: a second link named a");
  const std::string links = link("a") + link("b") + link("c");
  complains(links + joint("j", "fixed", "a", "b") + joint("j", "fixed", "a", "c"), "a second joint named j");
  complains(link("a") + "<link/>\n", "line 3: <link> without name");
}

TEST_F(SceneFile, GivesNoLinesOfUtf16) {
  const std::string text = "<?xml version='1.0' encoding='UTF-16'?>\n<robot name='r'>\n<link nme='a'/>\n</robot>\n";
  std::string wide = "\xff\xfe";
  for (const char c : text) wide += {c, '\0'};
  const std::string file = write("wide.urdf", wide);
  try {
    read(file);
    ADD_FAILURE();
  } catch (const std::exception& e) {
    EXPECT_EQ(std::string(e.what()).rfind(file + ": ", 0), 0u) << e.what();
    EXPECT_EQ(std::string(e.what()).find("line"), std::string::npos) << e.what();
  }
}

TEST_F(SceneFile, AllowsElementsOfOthers) {
  const Robot r =
      read(robot(link("a") + link("b") + joint("j", "continuous", "a", "b", "<init value='0'/><plugin/>") + "<pin/>"));
  EXPECT_EQ(r.joints().size(), 1u);
}

TEST_F(SceneFile, APlanarArmIsWhereTrigonometrySays) {
  const double a = 0.7, b = 0.4;
  const Robot arm =
      read(robot(link("base") + link("upper") + link("lower") + link("hand") +
                 joint("q1", "continuous", "base", "upper", "<axis xyz='0 0 1'/>") +
                 joint("q2", "revolute", "upper", "lower", "<origin xyz='0.7 0 0'/><axis xyz='0 0 1'/>" + kLimit) +
                 joint("grip", "fixed", "lower", "hand", "<origin xyz='0.4 0 0'/>")));
  ASSERT_EQ(arm.links().size(), 4u);
  ASSERT_EQ(arm.freeJoints().size(), 2u);
  for (const auto& [q1, q2] : {std::pair(0.0, 0.0), {0.3, -0.9}, {-2.5, 1.7}, {1e4, 0.1}}) {
    const std::vector<Isometry3d> X = arm.linkPoses({q1, q2});
    EXPECT_NEAR(X[3].translation().x(), a * std::cos(q1) + b * std::cos(q1 + q2), 1e-12);
    EXPECT_NEAR(X[3].translation().y(), a * std::sin(q1) + b * std::sin(q1 + q2), 1e-12);
    EXPECT_NEAR(std::remainder(std::atan2(X[3](1, 0), X[3](0, 0)) - q1 - q2, 2 * M_PI), 0, 1e-11);
  }
}

TEST_F(SceneFile, EachKindOfJointMovesAsUrdfSays) {
  // Axes need not be unit vectors, and are in the joint's own frame.
  const Robot r = read(robot(
      link("l0") + link("l1") + link("l2") + link("l3") + link("l4") +
      joint("turn", "revolute", "l0", "l1", "<origin xyz='1 2 3' rpy='0.1 0.2 0.3'/><axis xyz='2 0 0'/>" + kLimit) +
      joint("slide", "prismatic", "l1", "l2", "<origin xyz='0 0.5 0' rpy='0 0 1.2'/><axis xyz='0 3 4'/>" + kLimit) +
      joint("bolt", "fixed", "l2", "l3", "<origin xyz='0.1 0 0' rpy='-0.4 0.5 0'/>") +
      joint("spin", "continuous", "l3", "l4", "<axis xyz='1 1 1'/>")));
  EXPECT_EQ(r.joints()[0].limits->lower, -1);
  EXPECT_EQ(r.joints()[0].limits->upper, 2);
  EXPECT_FALSE(r.joints()[3].limits.has_value());
  const std::vector<double> q{0.8, -0.25, 5.0};
  const std::vector<Isometry3d> X = r.linkPoses(q);
  const Isometry3d X1 = pose(rpy(0.1, 0.2, 0.3), {1, 2, 3}) * pose(turned(Vector3d::UnitX(), q[0]), Vector3d::Zero());
  const Isometry3d X2 =
      X1 * pose(rpy(0, 0, 1.2), {0, 0.5, 0}) * pose(Matrix3d::Identity(), q[1] * Vector3d(0, 0.6, 0.8));
  const Isometry3d X3 = X2 * pose(rpy(-0.4, 0.5, 0), {0.1, 0, 0});
  const Isometry3d X4 = X3 * pose(turned(Vector3d(1, 1, 1).normalized(), q[2]), Vector3d::Zero());
  expectNear(X[0], Isometry3d::Identity(), "l0");
  expectNear(X[1], X1, "l1");
  expectNear(X[2], X2, "l2");
  expectNear(X[3], X3, "l3");
  expectNear(X[4], X4, "l4");
}

/// A seven-joint arm by the Denavit-Hartenberg parameters of Franka's documentation, and where it says that the flange
/// is.
TEST_F(SceneFile, AKnownArmIsWhereItsMakerSays) {
  const char* origins[] = {"xyz='0 0 0.333'",
                           "rpy='-1.5707963267948966 0 0'",
                           "xyz='0 -0.316 0' rpy='1.5707963267948966 0 0'",
                           "xyz='0.0825 0 0' rpy='1.5707963267948966 0 0'",
                           "xyz='-0.0825 0.384 0' rpy='-1.5707963267948966 0 0'",
                           "rpy='1.5707963267948966 0 0'",
                           "xyz='0.088 0 0' rpy='1.5707963267948966 0 0'"};
  std::string text = link("l0");
  for (int i = 1; i <= 7; ++i) {
    const std::string n = std::to_string(i);
    text += link("l" + n) + joint("j" + n, "continuous", "l" + std::to_string(i - 1), "l" + n,
                                  std::string("<origin ") + origins[i - 1] + "/><axis xyz='0 0 1'/>");
  }
  // As xacro writes fixed joints, with an axis that means nothing.
  text += link("flange") + joint("j8", "fixed", "l7", "flange", "<origin xyz='0 0 0.107'/><axis xyz='0 0 0'/>");
  const Robot arm = read(robot(text));
  Matrix3d down;
  down << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  expectNear(arm.linkPoses({0, 0, 0, 0, 0, 0, 0}).back(), pose(down, {0.088, 0, 0.926}), "upright", 1e-12);
  const double quarter = M_PI / 4;
  const Isometry3d ready = arm.linkPoses({0, -quarter, 0, -3 * quarter, 0, 2 * quarter, quarter}).back();
  EXPECT_LT((ready.translation() - Vector3d(0.3069, 0, 0.5903)).norm(), 1e-4) << ready.translation().transpose();
}

TEST_F(SceneFile, MimicJointsFollowAlsoByWayOfOthers) {
  const std::string axis = "<axis xyz='0 0 1'/>";
  const Robot r = read(robot(
      link("base") + link("a") + link("b") + link("c") +
      joint("third", "prismatic", "base", "c", axis + "<mimic joint='second' multiplier='-3' offset='0.5'/>" + kLimit) +
      joint("second", "prismatic", "base", "b", axis + "<mimic joint='first' multiplier='2' offset='0.1'/>" + kLimit) +
      joint("first", "prismatic", "base", "a", axis + kLimit)));
  ASSERT_EQ(r.freeJoints().size(), 1u);
  EXPECT_EQ(r.joints()[r.freeJoints()[0]].name, "first");
  const double q = 0.7;
  const std::vector<Isometry3d> X = r.linkPoses({q});
  for (std::size_t i = 0; i < r.joints().size(); ++i) {
    const std::string& name = r.joints()[i].name;
    const double wanted = name == "first" ? q : name == "second" ? 2 * q + 0.1 : -3 * (2 * q + 0.1) + 0.5;
    EXPECT_NEAR(X[i + 1].translation().z(), wanted, 1e-15) << name;
    EXPECT_NEAR(r.jointValues({q})[i], wanted, 1e-15) << name;
  }
}

TEST_F(SceneFile, ReadsTheCollisionGeometriesOfALink) {
  const Robot r =
      read(robot("<link name='l'>"
                 "<visual><geometry><mesh filename='nowhere.stl'/></geometry></visual>"
                 "<collision><origin xyz='1 0 0' rpy='0 0 0.5'/><geometry><box size='1 2 3'/></geometry></collision>"
                 "<collision><geometry><cylinder radius='0.2' length='0.6'/></geometry></collision>"
                 "<collision><geometry><sphere radius='0.3'/></geometry></collision>"
                 "<collision><geometry><mesh filename='tetra.off' scale='2 3 -4'/></geometry></collision>"
                 "<collision><geometry><mesh filename='file://" +
                 (folder_ / "tetra.off").string() +
                 "'/></geometry></collision>"
                 "</link>"));
  ASSERT_EQ(r.links().at(0).shapes.size(), 5u);
  const std::vector<PlacedShape>& shapes = r.links()[0].shapes;
  EXPECT_EQ(shapes[0].shape.kind, Shape::Kind::kBox);
  EXPECT_EQ(shapes[0].shape.size, Vector3d(1, 2, 3));
  expectNear(shapes[0].X_PS, pose(rpy(0, 0, 0.5), {1, 0, 0}), "box");
  EXPECT_EQ(shapes[1].shape.kind, Shape::Kind::kCylinder);
  EXPECT_EQ(shapes[1].shape.size.head<2>(), Eigen::Vector2d(0.2, 0.6));
  EXPECT_EQ(shapes[2].shape.kind, Shape::Kind::kSphere);
  EXPECT_EQ(shapes[2].shape.size[0], 0.3);
  EXPECT_EQ(shapes[3].shape.mesh->bounds().min(), Vector3d(0, 0, -4));
  EXPECT_EQ(shapes[3].shape.mesh->bounds().max(), Vector3d(2, 3, 0));
  EXPECT_EQ(shapes[4].shape.mesh->bounds().max(), Vector3d(1, 1, 1));
}

TEST_F(SceneFile, OneFileAndScaleIsOneMesh) {
  MeshStore meshes;
  const std::string file = (folder_ / "tetra.off").string();
  const auto plain = meshes.get(file, Vector3d::Ones()), twice = meshes.get(file, {2, 2, 2});
  EXPECT_EQ(plain, meshes.get((folder_ / "." / "tetra.off").string(), Vector3d::Ones()));
  EXPECT_EQ(twice, meshes.get(file, {2, 2, 2}));
  EXPECT_NE(plain, twice);
  EXPECT_THROW(meshes.get(file, {1, 0, 1}), std::runtime_error);
  EXPECT_THROW(meshes.get(file, {1, NAN, 1}), std::runtime_error);
}

TEST_F(SceneFile, SaysWhereAUrdfIsWrong) {
  const std::string two = link("a", kSphere) + link("b", kSphere);
  const auto complains = [&](const std::string& text, const std::vector<std::string>& pieces) {
    const std::string file = robot(text);
    std::vector<std::string> all = pieces;
    all.push_back(file);
    expectComplaint([&] { read(file); }, all);
  };
  complains(two + joint("j", "revolute", "a", "b"), {"line 4", "[j]", "limits"});
  complains(two + joint("j", "floating", "a", "b"), {"line 4", "joint j", "fixed, revolute, continuous or prismatic"});
  complains(two + joint("j", "screw", "a", "b"), {"line 4", "[j]"});
  complains(two + joint("j", "continuous", "a", "nobody"), {"nobody"});
  complains(two, {"root"});
  // A robot is a tree: two parents, circles below the root and beside it, a joint from a link to itself.
  const std::string three = two + link("c", kSphere), ab = joint("ab", "fixed", "a", "b");
  complains(three + ab + joint("ac", "fixed", "a", "c") + joint("cb", "fixed", "c", "b"),
            {"line 7: joint cb: link b is the child of joint ab, too", "a tree"});
  complains(two + ab + joint("bb", "fixed", "b", "b"), {"joint bb: link b is the child of joint ab, too"});
  complains(three + ab + joint("bc", "fixed", "b", "c") + joint("cb", "fixed", "c", "b"),
            {"link b is the child of joint ab, too"});
  complains(three + joint("bc", "fixed", "b", "c") + joint("cb", "fixed", "c", "b"),
            {"line 6: joint cb: links are connected in a circle"});
  complains(two + joint("bb", "fixed", "b", "b"), {"joint bb: links are connected in a circle"});
  complains(two + "<joint name='j' type='fixed'/>", {"line 4", "[j]"});
  complains(two + joint("j", "continuous", "a", "b", "<axis xyz='0 0 0'/>"), {"line 4", "joint j", "axis"});
  complains(two + joint("j", "continuous", "a", "b", "<mimic joint='k'/>"),
            {"line 4: joint j mimics k, which is no joint"});
  complains(two + joint("j", "continuous", "a", "b", "<mimic joint='j'/>"), {"joint j mimics itself"});
  complains(two + link("c") + joint("k", "fixed", "a", "c") + joint("j", "continuous", "a", "b", "<mimic joint='k'/>"),
            {"joint j mimics k, which is fixed"});
  complains(link("a") + link("b", "<mesh filename='none.stl'/>") + joint("j", "fixed", "a", "b"),
            {"line 3", "link b", "mesh none.stl", "no such file"});
  complains(link("b", "<mesh filename='package://robots/none.stl'/>"),
            {"line 2", "link b", "package robots is not found", "--package robots="});
  complains(link("b", "<mesh filename='http://host/none.stl'/>"), {"line 2", "link b", "package://"});
  complains(link("b", "<mesh filename='tetra.off' scale='1 0 1'/>"), {"line 2", "link b", "scale"});
  complains(link("b", "<sphere radius='-1'/>"), {"line 2", "link b", "above 0"});
  complains(link("b", "<sphere radius='1e76'/>"), {"line 2", "link b", "at most 1e75"});
  complains(link("b", kSphere + "<!-- and --><box size='1 1 1'/>"), {"line 2", "link b", "one shape"});
  complains("<link name='b'><collision><geometry>" + kSphere + "</geometry><geometry>" + kSphere +
                "</geometry></collision></link>",
            {"line 2: link b: a second <geometry> in one <collision>"});
  // Parsers that go down the tree by recursion need a limit. Links in the order of their names, and not.
  for (const int first : {10000, 0}) {
    const auto chain = [&](int joints) {
      std::string text = link(std::to_string(first), kSphere);
      for (int i = first + 1; i <= first + joints; ++i) {
        const std::string name = std::to_string(i);
        text += link(name) + joint("j" + name, "fixed", std::to_string(i - 1), name);
      }
      return text;
    };
    complains(chain(1001), {"more than 1000 joints are between link"});
    EXPECT_EQ(read(robot(chain(1000))).links().size(), 1001u);
  }
  complains(link("b", "<capsule radius='1' length='1'/>"), {"line 2", "capsule", "[b]"});
  complains("<link name='b'><collision/></link>", {"line 2", "[b]"});
  complains("<link name='b'><collision><origin xyz='1 x 0'/><geometry>" + kSphere + "</geometry></collision></link>",
            {"line 2", "[x]", "[b]"});
  complains(link("b", "<box size='1 2'/>"), {"line 2", "[1 2]", "[b]"});
  complains("<xacro:property name='x' value='1'/>\n" + link("a"), {"line 2", "xacro"});
  complains(link("a") + "<link name='b'><visual><xacro:look/></visual></link>", {"line 3: <xacro:look> is a xacro"});
  complains("<link name='a'>\n</robot>", {"line 3", "no XML"});
  // What is not asked about may be wrong.
  EXPECT_EQ(read(robot("<material name='m'><color rgba='red'/></material><material name='m'/>"
                       "<link name='a'><inertial><mass value='x'/></inertial><visual><geometry><capsule/></geometry>"
                       "<material name='none'/></visual></link>"))
                .links()
                .size(),
            1u);
  const std::string other = write("other.urdf", "<sdf></sdf>");
  expectComplaint([&] { read(other); }, {other + ": line 1", "<sdf>", "<robot>"});
  expectComplaint([&] { read("/nowhere/r.urdf"); }, {"/nowhere/r.urdf", "No such file"});
}

TEST_F(SceneFile, RefusesWhatUrdfdomLeavesOut) {
  const auto complains = [&](const std::string& text, const std::string& what) {
    const std::string file = robot(link("a", kSphere) + link("b", kSphere) + text);
    expectComplaint([&] { read(file); }, {file + ": line 4: " + what});
  };
  const std::vector<std::string> once = {
      "<parent link='a'/>", "<child link='b'/>", "<origin xyz='1 0 0'/>", "<axis xyz='0 0 1'/>", kLimit,
      "<mimic joint='k'/>"};
  for (const std::string& element : once) {
    const std::string name = element.substr(1, element.find(' ') - 1);
    const bool twice = name != "parent" && name != "child";
    complains(joint("j", "revolute", "a", "b", element + (twice ? element : "")),
              "joint j: a second <" + name + "> in one <joint>");
  }
  const auto collision = [](const std::string& more, const std::string& shape) {
    return "<link name='c'><collision>" + more + "<geometry>" + shape + "</geometry></collision></link>";
  };
  complains(collision("<origin/><origin xyz='1 0 0'/>", kSphere), "link c: a second <origin> in one <collision>");
  for (const auto& [element, name] : std::vector<std::pair<std::string, std::string>>{
           {"<linc name='c'/>", "link"},
           {"<link name='c'><colision/></link>", "collision"},
           {"<link name='c'><Collision/></link>", "collision"},
           {collision("<orgin/>", kSphere), "origin"},
           {collision("", "<spere radius='1'/>"), "sphere"},
           {collision("", "<shpre radius='1'/>"), "sphere"},
           {collision("", "<meshh filename='tetra.off'/>"), "mesh"},
           {joint("j", "continuous", "a", "b", "<miimc joint='k'/>"), "mimic"},
           {collision("", "<mesh filename='tetra.off' scal='2 2 2'/>"), "scale"},
           {joint("j", "fixed", "a", "b", "<orgin/>"), "origin"},
           {joint("j", "fixed", "a", "b", "<origin xzy='1 0 0'/>"), "xyz"},
           {joint("j", "continuous", "a", "b", "<axis xzy='0 0 1'/>"), "xyz"},
           {joint("j", "revolute", "a", "b", "<limit lowr='-1' upper='1' effort='1' velocity='1'/>"), "lower"},
           {joint("j", "continuous", "a", "b", "<mimic joint='k' multipler='2'/>"), "multiplier"}}) {
    const std::string file = robot("\n\n" + element);
    expectComplaint([&] { read(file); }, {file + ": line 4: ", " has no ", "Did you mean " + name + "?"});
  }
  complains(joint("j", "fixed", "a", "b", "<origin quat_xyzw='0 0 0 1'/>"),
            "joint j: <origin> has no attribute quat_xyzw.");
  const std::string two = write("two.urdf", "<robot name='r'><link name='a'/></robot>\n<!-- --><robot name='q'/>");
  expectComplaint([&] { read(two); }, {two + ": line 2: <robot> is a second root element"});

  const std::string other =
      "<gazebo reference='a'><origin x='1'/></gazebo><transmission name='t'><joint name='j'/></transmission>"
      "<sensor name='s'/><plugin/><ros2_control/><group/><light/><loop_joint/><material name='m'><color rgba='1 1 1 "
      "1'/></material><drake:joint name='d'/>"
      "<link name='a'><contact/><sensor/><self_collision_checking/><collision name='n' group='g'><verbose value='1'/>"
      "<drake:origin/><surface/><material/><contact_coefficients/><pose/><max_contacts/><geometry>" +
      kSphere + "</geometry></collision></link>" + link("b") +
      joint("j", "revolute", "a", "b",
            "<plugin/><mechanicalReduction/><sensor/><actuator/><dynamics "
            "damping='1'/><calibration/><safety_controller k_velocity='1'/><hardwareInterface/><friction/>"
            "<origin xyz='0 0 0' drake:frame='f'/><axis xyz='0 0 1' rpy='0 0 0'/>"
            "<limit lower='0' upper='1' effort='1' velocity='1' acceleration='1' jerk='1' soft_lower='1'/>");
  EXPECT_EQ(read(robot(other)).links().size(), 2u);
}

TEST_F(SceneFile, FindsPackages) {
  for (const char* place : {"given", "ros/robots", "prefix/share/robots", "up/robots/urdf/deep"})
    fs::create_directories(folder_ / place);
  const std::string uri = "package://robots/meshes/a.stl";
  // As ROS decodes a URI; a file that has the name as it stands comes first.
  const std::string spaced = write("spaced/my part.stl", ""), here = fs::path(spaced).parent_path().string();
  const Packages with({"spaced=" + here});
  EXPECT_EQ(with.resolve("package://spaced/my%20part.stl", "/"), spaced);
  const std::string literal = write("spaced/my%20part.stl", "");
  EXPECT_EQ(with.resolve("package://spaced/my%20part.stl", "/"), literal);
  const auto at = [&](const std::string& place) { return (folder_ / place / "meshes/a.stl").string(); };
  const std::string deep = (folder_ / "up/robots/urdf/deep").string();
  EXPECT_EQ(Packages().resolve(uri, deep), at("up/robots"));
  EXPECT_EQ(Packages().resolve(uri, (folder_ / "up").string()), at("up/robots"));
  expectComplaint([&] { Packages().resolve(uri, (folder_ / "given").string()); },
                  {"package robots is not found", "--package robots="});
  setenv("AMENT_PREFIX_PATH", ("/nowhere:" + (folder_ / "prefix").string()).c_str(), 1);
  EXPECT_EQ(Packages().resolve(uri, deep), at("prefix/share/robots"));
  for (const char* path : {"ros", "ros/robots", "ros/robots/"}) {
    setenv("ROS_PACKAGE_PATH", ("/nowhere::" + (folder_ / path).string()).c_str(), 1);
    EXPECT_EQ(Packages().resolve(uri, deep), at("ros/robots")) << path;
  }
  // Below the folders of ROS_PACKAGE_PATH, by the names in package.xml; a folder without one is only its own.
  for (const char* place : {"ws/repo/husky/husky", "ws/repo/deep", "ws/repo/.git/deep", "ws/ignored/deep"}) {
    fs::create_directories(folder_ / place);
  }
  fs::create_directory_symlink(folder_ / "ws", folder_ / "ws/repo/loop");
  const auto package = [](const std::string& name) { return "<package><name> " + name + "\n</name></package>"; };
  write("ws/repo/husky/husky/package.xml", package("husky"));
  write("ws/repo/husky/husky/inner/package.xml", package("inner"));
  write("ws/repo/deep/package.xml", package("another"));
  write("ws/repo/old/manifest.xml", "<package/>");
  write("ws/ignored/package.xml.disabled", "");
  write("ws/ignored/CATKIN_IGNORE", "");
  write("ws/ignored/deep/package.xml", package("off"));
  setenv("ROS_PACKAGE_PATH", (folder_ / "ws").string().c_str(), 1);
  const auto inPackage = [&](const std::string& name) { return Packages().resolve("package://" + name + "/a", "/"); };
  const std::string repo = (folder_ / "ws/repo").string();
  EXPECT_EQ(inPackage("husky"), repo + "/husky/husky/a");
  EXPECT_EQ(inPackage("another"), repo + "/deep/a");
  EXPECT_EQ(inPackage("old"), repo + "/old/a");
  for (const char* name : {"deep", "inner", "off"}) EXPECT_THROW(inPackage(name), std::runtime_error) << name;
  EXPECT_EQ(Packages().resolve("package://husky/a", repo + "/husky/husky/urdf"), repo + "/husky/husky/a");
  unsetenv("ROS_PACKAGE_PATH");
  EXPECT_EQ(Packages().resolve("package://husky/a", repo + "/old"), repo + "/husky/husky/a");

  const std::string other = (folder_ / "ros").string();
  const Packages given({"other=" + other, "robots=" + (folder_ / "given").string()});
  EXPECT_EQ(given.resolve(uri, deep), at("given"));
  EXPECT_EQ(given.resolve("package://other//m//a.stl", deep), other + "//m//a.stl");
  EXPECT_EQ(given.resolve("file:///a/b.stl", deep), "/a/b.stl");
  EXPECT_EQ(given.resolve("file://localhost/a/b%20c%2d50%.stl", deep), "/a/b c-50%.stl");
  EXPECT_EQ(given.resolve("file:///a%zz%4", deep), "/a%zz%4");
  for (const char* wrong : {"file://a/b.stl", "file://b.stl"}) {
    expectComplaint([&] { given.resolve(wrong, deep); }, {"an absolute path"});
  }
  EXPECT_EQ(given.resolve("/a/b.stl", deep), "/a/b.stl");
  EXPECT_EQ(given.resolve("b.stl", "/c"), "/c/b.stl");
  EXPECT_THROW(given.resolve("package://robots", deep), std::runtime_error);
  for (const std::vector<std::string>& wrong : std::vector<std::vector<std::string>>{
           {"robots"}, {"robots=/nowhere"}, {"robots=" + other, "a=" + other, "robots=" + other}}) {
    EXPECT_THROW(Packages{wrong}, std::invalid_argument) << wrong.back();
  }
  // A file that is named without a folder is in the working one.
  unsetenv("ROS_PACKAGE_PATH");
  unsetenv("AMENT_PREFIX_PATH");
  const fs::path working = fs::current_path();
  fs::current_path(deep);
  EXPECT_TRUE(fs::equivalent(fs::path(Packages().resolve(uri, "")).parent_path().parent_path(), folder_ / "up/robots"));
  fs::current_path(working);
  for (const char* wrong : {"robots", "=x", "robots="}) EXPECT_THROW(Packages({wrong}), std::invalid_argument) << wrong;
}

TEST_F(SceneFile, LinksAreAdjacentAcrossLinksWithoutShapes) {
  const Robot r =
      read(robot(link("a", kSphere) + link("frame") + link("b", kSphere) + link("c", kSphere) + link("d", kSphere) +
                 joint("j1", "fixed", "a", "frame") + joint("j2", "continuous", "frame", "b") +
                 joint("j3", "continuous", "frame", "c") + joint("j4", "continuous", "c", "d")));
  std::set<std::set<std::string>> names;
  for (const auto& [a, b] : r.adjacentLinks()) names.insert({r.links()[a].name, r.links()[b].name});
  EXPECT_EQ(names, (std::set<std::set<std::string>>{{"a", "b"}, {"a", "c"}, {"b", "c"}, {"c", "d"}}));
}

// Against the shortest path between two links.
TEST_F(SceneFile, AdjacentLinksAreThoseWithoutALinkWithShapesBetween) {
  for (unsigned seed = 0; seed < 30; ++seed) {
    std::mt19937 random(seed);
    const std::size_t count = 2 + random() % 20;
    std::vector<Part> links(count);
    std::vector<Joint> joints(count - 1);
    for (std::size_t i = 0; i < count; ++i) {
      if (random() % 2 == 0) links[i].shapes.emplace_back();
      if (i > 0) joints[i - 1].parent = random() % i;
    }
    const Robot r("r", links, joints);
    // reached[a][b]: from a to b by way of links without shapes.
    std::vector<std::set<std::size_t>> reached(count);
    for (std::size_t a = 0; a < count; ++a) {
      std::vector<std::size_t> open{a};
      for (std::size_t k = 0; k < open.size(); ++k) {
        for (std::size_t b = 0; b < count; ++b) {
          const bool joined =
              (b > 0 && joints[b - 1].parent == open[k]) || (open[k] > 0 && joints[open[k] - 1].parent == b);
          if (!joined || b == a || !reached[a].insert(b).second) continue;
          if (links[b].shapes.empty()) open.push_back(b);
        }
      }
    }
    std::vector<std::pair<std::size_t, std::size_t>> wanted;
    for (std::size_t a = 0; a < count; ++a) {
      std::vector<std::size_t> around;
      for (const std::size_t b : reached[a]) {
        if (links[b].shapes.empty()) continue;
        if (links[a].shapes.empty()) around.push_back(b);
        if (!links[a].shapes.empty() && a < b) wanted.emplace_back(a, b);
      }
      EXPECT_EQ(r.linksAround(a), around) << seed << ' ' << a;
    }
    EXPECT_EQ(r.adjacentLinks(), wanted) << seed;
  }
}

TEST_F(SceneFile, AnSrdfDecidesWhichLinksAreChecked) {
  SceneArguments arguments;
  arguments.file = robot(link("a", kSphere) + link("b", kSphere) + link("c", kSphere) +
                         joint("j1", "continuous", "a", "b") + joint("j2", "continuous", "b", "c"));
  using Pairs = std::set<std::pair<std::size_t, std::size_t>>;
  const SceneSetup without = readScene(arguments);
  EXPECT_EQ(without.allowed, (Pairs{{0, 1}, {1, 2}}));
  ASSERT_EQ(without.notes.size(), 1u);
  EXPECT_NE(without.notes[0].find("--adjacent check"), std::string::npos);
  arguments.adjacent = SceneArguments::Adjacent::kCheck;
  EXPECT_EQ(readScene(arguments).allowed, Pairs{});
  EXPECT_TRUE(readScene(arguments).notes.empty());

  arguments.srdf = write("r.srdf",
                         "<robot name='r'>\n<disable_collisions link1='c' link2='a' reason='Never'/>\n"
                         "<disable_collisions link1='a' link2='ghost'/>\n</robot>");
  arguments.adjacent = SceneArguments::Adjacent::kAsSrdf;
  const SceneSetup with = readScene(arguments);
  EXPECT_EQ(with.allowed, (Pairs{{0, 2}}));
  ASSERT_EQ(with.warnings.size(), 1u);
  EXPECT_NE(with.warnings[0].find("line 3: the robot has no link ghost"), std::string::npos) << with.warnings[0];
  arguments.adjacent = SceneArguments::Adjacent::kIgnore;
  EXPECT_EQ(readScene(arguments).allowed, (Pairs{{0, 1}, {0, 2}, {1, 2}}));

  arguments.adjacent = SceneArguments::Adjacent::kAsSrdf;
  write("r.srdf",
        "<robot name='r'><disable_default_collisions link='b'/><enable_collisions link1='b' link2='a'/></robot>");
  EXPECT_EQ(readScene(arguments).allowed, (Pairs{{1, 2}}));
  write("r.srdf", "<robot name='r'>\n\n<disable_collisions link1='c'/></robot>");
  expectComplaint([&] { readScene(arguments); }, {"r.srdf: line 3", "link2"});
  write("r.srdf",
        "<robot name='r'><group name='g'/><tool_center_points/>\n<disable_colisions link1='c' link2='a'/></robot>");
  expectComplaint([&] { readScene(arguments); },
                  {"r.srdf: line 2: <robot> has no element <disable_colisions>. Did you mean disable_collisions?"});
  write("r.srdf", "<robot name='r'>\n<xacro:arm/></robot>");
  expectComplaint([&] { readScene(arguments); }, {"r.srdf: line 2", "run `xacro FILE > robot.srdf` first"});
  write("r.srdf", "<robot name='r'><group name='g'>\n<xacro:arm/></group></robot>");
  expectComplaint([&] { readScene(arguments); }, {"r.srdf: line 2", "<xacro:arm> is a xacro element"});
  write("r.srdf", "<robot name='r'/>\n<robot name='r'/>");
  expectComplaint([&] { readScene(arguments); }, {"r.srdf: line 2: <robot> is a second root element"});
  arguments.srdf = arguments.file;
  expectComplaint([&] { readScene(arguments); }, {"robot.urdf: line 2", "<link> belongs to a URDF"});
  arguments.srdf = write("r.srdf", "<robot name='s'><disable_collisions link1=' a' link2='b\n'/></robot>");
  const SceneSetup other = readScene(arguments);
  EXPECT_EQ(other.allowed, (Pairs{{0, 1}}));
  ASSERT_EQ(other.warnings.size(), 1u);
  EXPECT_NE(other.warnings[0].find("the SRDF is of robot \"s\", the URDF of \"r\""), std::string::npos);
}

// As in MoveIt's AllowedCollisionMatrix, where a link's default entry is for all others, objects of the world included.
TEST_F(SceneFile, DefaultsOfAnSrdfAreAboutObjectsToo) {
  robot(link("a", kSphere) + link("b", kSphere) + joint("j1", "continuous", "a", "b"));
  write("r.srdf",
        "<robot name='r'><disable_default_collisions link='b'/><enable_collisions link1='b' link2='a'/></robot>");
  const std::string objects = R"({"name": "floor", "box": [1, 1, 1]}, {"name": "tool", "sphere": 1, "attached": "a"})";
  const auto allowed = [&](const std::string& more) {
    return scene(R"({"robot": {"urdf": "robot.urdf", "srdf": "r.srdf"}, "objects": [)" + objects + "]" + more + "}")
        .allowed;
  };
  using Pairs = std::set<std::pair<std::size_t, std::size_t>>;
  EXPECT_EQ(allowed(""), (Pairs{{1, 2}, {1, 3}, {0, 3}}));
}

TEST_F(SceneFile, AllPathsMayBeInPackages) {
  write("p/urdf/r.urdf", "<robot name='r'>" + link("a", kSphere) + "</robot>");
  write("p/r.srdf", "<robot name='r'/>");
  write("p/states.csv", "box.x,box.y,box.z\n1,2,3\n");
  const SceneSetup setup = scene(R"({"robot": {"urdf": "package://p/urdf/r.urdf", "srdf": "package://p/r.srdf"},
    "objects": [{"name": "box", "box": [1, 1, 1], "moving": true}], "states": "package://p/states.csv"})");
  EXPECT_EQ(setup.robot->name(), "r");
  EXPECT_EQ(setup.states.size(), 1u);
  expectComplaint([&] { scene(R"({"robot": "package://q/r.urdf"})"); }, {"scene.json: robot: package q is not found"});
}

TEST_F(SceneFile, NamesOfGroupsAreNoNamesOfParts) {
  for (const std::string name : {"robot", "*"}) {
    expectComplaint([&] { scene("{\"objects\": [{\"name\": \"" + name + "\", \"sphere\": 1}]}"); },
                    {"objects[0]: the name " + name + " is that of a group"});
  }
  robot(link("robot", kSphere) + link("b", kSphere) + joint("j", "continuous", "robot", "b"));
  const std::string with = R"({"robot": "robot.urdf", "objects": [{"name": "floor", "box": [1, 1, 1]}])";
  EXPECT_EQ(scene(with + R"(, "allowed": [["b", "floor"]]})").allowed.count({1, 2}), 1u);
  expectComplaint([&] { scene(with + R"(, "allowed": [["robot", "floor"]]})"); },
                  {"allowed[0][0]: it may be the link of this name or all links"});
}

/// Tables without warnings.
std::vector<State> table(const std::string& text, const StateNames& names) {
  std::vector<std::string> warnings;
  std::vector<State> states = statesOfTable(text, names, "path.csv", warnings);
  EXPECT_TRUE(warnings.empty()) << warnings.front();
  return states;
}

StateNames twoJointsAndABox() {
  StateNames names;
  names.joints = {"q1", "elbow"};
  names.others = {{"f2", "mimics f1"}, {"weld", "is fixed"}};
  names.objects = {"box"};
  names.X_WO = {pose(Matrix3d::Identity(), {7, 8, 9})};
  return names;
}

TEST(States, AreATableWithNames) {
  const StateNames names = twoJointsAndABox();
  const std::vector<State> some = table("# a path\n\nelbow, \"q1\" # names\r\n0.5,-1e-3\n+1;2\n", names);
  ASSERT_EQ(some.size(), 2u);
  EXPECT_EQ(some[0].joints, (std::vector<double>{-1e-3, 0.5}));
  EXPECT_EQ(some[1].joints, (std::vector<double>{2, 1}));
  EXPECT_EQ(some[0].place, "line 4");
  expectNear(some[0].objects.at(0), *names.X_WO[0], "where the scene has it");
  EXPECT_EQ(table("\xEF\xBB\xBFq1,elbow\r\n1,2\r\n", names).at(0).joints, (std::vector<double>{1, 2}));
  const State placed =
      table("q1\telbow\tbox.yaw\tbox.x\tbox.y\tbox.z\tbox.roll\tbox.pitch\n0\t0\t0.3\t1\t2\t3\t0.1\t0.2", names).at(0);
  expectNear(placed.objects.at(0), pose(rpy(0.1, 0.2, 0.3), {1, 2, 3}), "roll, pitch, yaw");
  std::vector<std::string> warnings;
  const State turn =
      statesOfTable("q1,elbow,box.x,box.y,box.z,box.qw,box.qx,box.qy,box.qz\n0,0,1,2,3,1,0,0,1", names, "f", warnings)
          .at(0);
  expectNear(turn.objects.at(0), pose(rpy(0, 0, M_PI / 2), {1, 2, 3}), "a quaternion, not normalised");
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0], "f: line 2: box: the quaternion has the norm 1.41421 and is normalised");
  for (const char* blanks : {"q1 elbow\n1 2", " elbow  q1 # names \r\n 2   +1 \r\n", "\"q1\" elbow\n1 \"2\" # end",
                             "q1 elbow\n1, 2", "q1 elbow\n1 ;2 ", "q1 elbow\n1\t2"}) {
    EXPECT_EQ(table(blanks, names).at(0).joints, (std::vector<double>{1, 2})) << blanks;
  }
  StateNames blank;
  blank.joints = {"joint 1"};
  EXPECT_EQ(table("joint 1\n3", blank).at(0).joints, (std::vector<double>{3}));
  StateNames odd;
  odd.joints = {"a,b", "say \"c\"", "d#e;f"};
  EXPECT_EQ(table("\"say \"\"c\"\"\", \"a,b\" ,\"d#e;f\"# g\n1,\"2\",3\n", odd).at(0).joints,
            (std::vector<double>{2, 1, 3}));
  expectNear(table("q1,elbow,box.x,box.y,box.z\n0,0,1,2,3", names).at(0).objects.at(0),
             pose(Matrix3d::Identity(), {1, 2, 3}), "not turned");
}

TEST(States, SayWhatIsWrongAndWhere) {
  const StateNames names = twoJointsAndABox();
  const auto complaint = [&](const std::string& text) -> std::string {
    try {
      table(text, names);
    } catch (const std::runtime_error& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_EQ(complaint("q1\n1"), "path.csv: line 1: columns are missing: elbow");
  EXPECT_EQ(complaint("q1,elbo,elbow\n1,2,3"),
            "path.csv: line 1: no moving joint or object is called 'elbo'. Did you mean elbow?");
  EXPECT_EQ(complaint("q1,elbow,f2\n1,2,3"), "path.csv: line 1: joint f2 mimics f1, so it must not be given");
  EXPECT_EQ(complaint("q1,elbow,weld\n1,2,3"), "path.csv: line 1: joint weld is fixed, so it must not be given");
  EXPECT_EQ(complaint("q1,elbow,q1\n1,2,3"), "path.csv: line 1: column q1 occurs twice");
  EXPECT_EQ(complaint("q1,elbow\n1,2\n\n3,x"), "path.csv: line 4: column elbow: 'x' is no finite number");
  EXPECT_EQ(complaint("q1,elbow\n1,+-2"), "path.csv: line 2: column elbow: '+-2' is no finite number");
  EXPECT_EQ(complaint("q1,elbow\n+1,+"), "path.csv: line 2: column elbow: '+' is no finite number");
  EXPECT_EQ(complaint("q1,elbow,\n1,2,"), "path.csv: line 1: a column has no name");
  EXPECT_EQ(complaint("q1,elbow\n1,nan"), "path.csv: line 2: column elbow: 'nan' is no finite number");
  EXPECT_EQ(complaint("q1,elbow\n1,"), "path.csv: line 2: column elbow: '' is no finite number");
  EXPECT_EQ(complaint("q1 elbow\n1 2 3"), "path.csv: line 2: 2 numbers expected, 3 found");
  EXPECT_EQ(complaint("q1 elbow\n1 , , 2"), "path.csv: line 2: 2 numbers expected, 3 found");
  EXPECT_EQ(complaint("q1,elbow\n1 2"), "path.csv: line 2: 2 numbers expected, 1 found");
  EXPECT_EQ(complaint("1 2\n"), "path.csv: line 1: the first line must have the names of the columns");
  EXPECT_EQ(complaint("q1,elbow\n1,2,3"), "path.csv: line 2: 2 numbers expected, 3 found");
  EXPECT_EQ(complaint("q1,elbow\n1,\x1b[31m2\xff"), "path.csv: line 2: column elbow: '?[31m2?' is no finite number");
  EXPECT_EQ(complaint("q1,\x1b[0m\n1,2"), "path.csv: line 1: no moving joint or object is called '?[0m'.");
  EXPECT_EQ(complaint("q1,Gelenk\u00e4\n1,2"), "path.csv: line 1: no moving joint or object is called 'Gelenk\u00e4'.");
  EXPECT_EQ(complaint("q1,elbow\n1," + std::string(1000, 'x')),
            "path.csv: line 2: column elbow: '" + std::string(60, 'x') + "...' is no finite number");
  EXPECT_EQ(complaint("q1,\"elbow\n1,2"), "path.csv: line 1: a quote is not closed");
  EXPECT_EQ(complaint("1,2\n"), "path.csv: line 1: the first line must have the names of the columns");
  EXPECT_EQ(complaint("q1,elbow\n"), "path.csv: no states");
  EXPECT_NE(complaint("q1,elbow,box.x\n1,2,3").find("object box needs the columns"), std::string::npos);
  EXPECT_EQ(complaint("q1,elbow,box\n1,2,3"),
            "path.csv: line 1: object box needs the columns box.x, box.y, box.z, and for a rotation box.qw, box.qx, "
            "box.qy, box.qz or box.roll, box.pitch, box.yaw");
  EXPECT_NE(complaint("q1,elbow,box.x,box.y,box.z,box.qw\n1,2,3,4,5,6").find("object box needs"), std::string::npos);
  EXPECT_NE(complaint("q1,elbow,box.x,box.y,box.z,box.qw,box.qx,box.qy,box.qz\n1,2,3,4,5,0,0,0,0")
                .find("line 2: the quaternion"),
            std::string::npos);
  EXPECT_NE(complaint("q1,elbow,box.w\n1,2,3").find("no moving joint or object is called 'box.w'"), std::string::npos);
}

TEST_F(SceneFile, ReadsObjectsOfAllKinds) {
  const SceneSetup setup = scene(R"({
    // Comments may be there.
    "objects": [
      {"name": "mesh", "mesh": "tetra.off", "scale": 0.5, "pose": [1, 2, 3]},
      {"name": "stretched", "mesh": "tetra.off", "scale": [1, 2, 3]},
      {"name": "box", "box": [1, 2, 3], "pose": [0, 0, 0, 1, 0, 0, 1]},
      {"name": "ball", "sphere": 0.5, "pose": {"xyz": [1, 0, 0], "rpy": [0.1, 0.2, 0.3]}},
      {"name": "post", "cylinder": [0.1, 2], "pose": {"xyzw": [0, 0, 1, 1]}},
      {"name": "pill", "capsule": [0.1, 2], "pose": {"wxyz": [1, 0, 0, 1]}},
      {"name": "table", "moving": true, "pose": [0, 0, 1],
       "shapes": [{"box": [1, 1, 0.1], "pose": [0, 0, 1]}, {"sphere": 0.1}]}
    ],
    "groups": {"round": ["ball", "post"], "more": ["round", "pill"]},
    "allowed": [["more", "table"], ["box", "table"]],
    "states": [{}, {"table": [0, 0, 2]}]
  })");
  ASSERT_EQ(setup.partCount(), 7u);
  EXPECT_EQ(setup.part(0).shapes.at(0).shape.mesh->bounds().max(), Vector3d(0.5, 0.5, 0.5));
  EXPECT_EQ(setup.part(1).shapes.at(0).shape.mesh->bounds().max(), Vector3d(1, 2, 3));
  EXPECT_EQ(setup.part(5).shapes.at(0).shape.kind, Shape::Kind::kCapsule);
  const std::vector<Isometry3d> X = setup.partPoses(setup.states.at(1));
  expectNear(X[0], pose(Matrix3d::Identity(), {1, 2, 3}), "mesh");
  expectNear(X[3], pose(rpy(0.1, 0.2, 0.3), {1, 0, 0}), "ball");
  for (const std::size_t quarter : {2, 4, 5})
    expectNear(X[quarter], pose(rpy(0, 0, M_PI / 2), {0, 0, 0}), "a quarter turn");
  expectNear(X[6], pose(Matrix3d::Identity(), {0, 0, 2}), "table");
  expectNear(setup.partPoses(setup.states[0])[6], pose(Matrix3d::Identity(), {0, 0, 1}), "table at the start");
  EXPECT_EQ(setup.allowed, (std::set<std::pair<std::size_t, std::size_t>>{{2, 6}, {3, 6}, {4, 6}, {5, 6}}));
  EXPECT_EQ(setup.states[1].place, "states[1]");
  const Bodies bodies(setup);
  EXPECT_EQ(bodies.moving, 2u);            // the table's shapes
  EXPECT_EQ(bodies.pairCount(), 2u * 2u);  // with both meshes
}

TEST_F(SceneFile, AnAttachedObjectMovesWithItsLink) {
  robot(link("base", kSphere) + link("hand", kSphere) +
        joint("q", "continuous", "base", "hand", "<origin xyz='1 0 0'/><axis xyz='0 0 1'/>"));
  const auto with = [&](const std::string& object) {
    return scene(R"({"robot": {"urdf": "robot.urdf", "pose": [0, 0, 3]}, "objects": [{"name": "wall", "sphere": 1}, )" +
                 object + R"(], "states": [{"q": 0.7}]})");
  };
  const SceneSetup s = with(R"({"name": "tool", "sphere": 0.1, "attached": "hand", "pose": [0.5, 0, 0]})");
  EXPECT_TRUE(s.moves(3));
  EXPECT_TRUE(s.names().objects.empty());
  EXPECT_EQ(s.allowed.count({1, 3}), 1u);
  EXPECT_EQ(s.allowed.count({0, 3}), 0u);
  expectNear(s.partPoses(s.states[0])[3], pose(rpy(0, 0, 0.7), {1 + 0.5 * std::cos(0.7), 0.5 * std::sin(0.7), 3}),
             "tool");
  const Bodies bodies(s);
  EXPECT_EQ(bodies.moving, 3u);
  EXPECT_EQ(bodies.pairCount(), 4u);  // tool and base, and all three with the wall
  expectComplaint([&] { with(R"({"name": "tool", "sphere": 0.1, "attached": "hant"})"); },
                  {"objects[1].attached: the robot has no link hant. Did you mean hand?"});
  expectComplaint([&] { with(R"({"name": "tool", "sphere": 0.1, "attached": "hand", "moving": true})"); },
                  {"objects[1]", "not both"});
}

TEST_F(SceneFile, ObjectsAttachedToOneLinkMayTouch) {
  robot(link("base", kSphere) + link("hand", kSphere) + joint("q", "continuous", "base", "hand"));
  const SceneSetup s = scene(R"({"robot": "robot.urdf", "objects": [
      {"name": "x", "sphere": 1, "attached": "hand"}, {"name": "y", "sphere": 1, "attached": "hand"},
      {"name": "z", "sphere": 1, "attached": "base"}, {"name": "wall", "sphere": 1}]})");
  EXPECT_EQ(s.allowed.count({2, 3}), 1u);
  EXPECT_EQ(s.allowed.count({2, 4}) + s.allowed.count({3, 4}) + s.allowed.count({2, 5}), 0u);
}

TEST_F(SceneFile, LinksThatAreOnlySeenAreNoted) {
  robot(link("base", kSphere) + "<link name='arm'><visual><geometry><box size='1 1 1'/></geometry></visual></link>" +
        link("frame") + joint("q", "continuous", "base", "arm") + joint("f", "fixed", "arm", "frame"));
  const SceneSetup s = scene(R"({"robot": "robot.urdf"})", SceneArguments::Adjacent::kCheck);
  EXPECT_EQ(s.notes, std::vector<std::string>{"links with a <visual> and no <collision> are not checked: arm"});
}

TEST_F(SceneFile, PartsInAnotherLengthUnitAreNoted) {
  const auto notesOf = [this](const std::string& scale) {
    write("cube.off", "OFF 8 2 0 0 0 0 1 0 0 0 1 0 0 0 1 1 1 1 1 1 0 0 1 1 1 0 1 3 0 1 2 3 0 1 3");
    return scene(R"({"objects": [{"name": "a", "sphere": 0.5, "moving": true, "pose": [0, 0, 0]},
        {"name": "b", "box": [1, 0.1, 0.1]}, {"name": "cup", "mesh": "cube.off", "scale": )" +
                 scale + "}]}")
        .notes;
  };
  EXPECT_TRUE(notesOf("290").empty());
  const std::vector<std::string> notes = notesOf("1000");
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_EQ(notes[0],
            "cup has the size 1000, most parts have 1.00; is it in another length unit (\"scale\" converts it)?");
}

TEST_F(SceneFile, AnAttachedObjectMayTouchTheLinksAroundItsFrame) {
  robot(link("arm", kSphere) + link("wrist", kSphere) + link("flange") + link("tool0") + link("finger", kSphere) +
        joint("q", "continuous", "arm", "wrist") + joint("f1", "fixed", "wrist", "flange") +
        joint("f2", "fixed", "flange", "tool0") + joint("f3", "fixed", "flange", "finger"));
  const SceneSetup s =
      scene(R"({"robot": "robot.urdf", "objects": [{"name": "tool", "sphere": 1, "attached": "tool0"}]})",
            SceneArguments::Adjacent::kCheck);
  std::set<std::string> touched;
  for (const auto& [link, object] : s.allowed) {
    EXPECT_EQ(object, 5u);
    touched.insert(s.part(link).name);
  }
  EXPECT_EQ(touched, (std::set<std::string>{"wrist", "tool0", "finger"}));
}

TEST_F(SceneFile, WarnsOfQuaternionsThatAreNotNormalised) {
  const auto warnings = [&](const std::string& pose, const std::string& states) {
    return scene(R"({"objects": [{"name": "p", "box": [1, 1, 1], "moving": true, "pose": )" + pose +
                 R"(}], "states": )" + states + "}")
        .warnings;
  };
  EXPECT_TRUE(warnings("[0, 0, 0, 1.0001, 0, 0, 0]", R"([{"p": {"rpy": [1, 2, 3]}}])").empty());
  const std::vector<std::string> two =
      warnings(R"({"xyzw": [0, 0, 0, 0.5]})", R"([{}, {"p": [0, 0, 0, 0.1, 0.2, 0, 0]}])");
  ASSERT_EQ(two.size(), 2u);
  const std::string file = (folder_ / "scene.json").string();
  EXPECT_EQ(two[0], file + ": objects[0].pose: the quaternion has the norm 0.5 and is normalised");
  EXPECT_EQ(two[1], file + ": states[1].p: the quaternion has the norm 0.223607 and is normalised");
  std::string table = "p.x,p.y,p.z,p.qw,p.qx,p.qy,p.qz\n";
  for (int i = 0; i < 100; ++i) table += "0,0,0,2,0,0,0\n";
  write("many.csv", table);
  const std::vector<std::string> many = warnings("[0, 0, 0]", "\"many.csv\"");
  ASSERT_EQ(many.size(), 11u);
  EXPECT_NE(many[0].find("many.csv: line 2: p: the quaternion has the norm 2 "), std::string::npos) << many[0];
  EXPECT_EQ(many[10], "90 more quaternions are normalised");
}

TEST_F(SceneFile, AJointAndAMovingObjectHaveTwoNames) {
  robot(link("a", kSphere) + link("b", kSphere) + joint("q", "continuous", "a", "b"));
  const auto with = [&](const std::string& object) {
    return scene(R"({"robot": "robot.urdf", "objects": [{"name": "q", "sphere": 1, "pose": [9, 0, 0])" + object +
                 "}]}");
  };
  EXPECT_EQ(with("").partCount(), 3u);
  expectComplaint([&] { with(", \"moving\": true"); }, {"scene.json: a joint and a moving object are called q"});
}

TEST_F(SceneFile, SaysWhereASceneIsWrong) {
  const std::string ball = R"({"name": "ball", "sphere": 1, "moving": true, "pose": [0, 0, 0]})";
  const auto complains = [&](const std::string& json, const std::string& what) {
    expectComplaint([&] { scene(json); }, {"scene.json: ", what});
  };
  const auto objects = [&](const std::string& list, const std::string& more = "") {
    return "{\"objects\": [" + list + "]" + more + "}";
  };
  complains("{\n\"objects\": [\n}", "line 3, column 1");
  complains("{\"objects\": [{\"name\": \"a\", \"sphere\": 1e999}]}", "1e999");
  complains(R"({"objects": [], "objects": []})", "\"objects\" is given twice in one object");
  complains(objects(R"({"name": "a", "sphere": 1, "pose": {"xyz": [0, 0, 0], "xyz": [1, 0, 0]}})"), "\"xyz\" is given");
  complains("[]", "an object {...} expected");
  complains(R"({"object": []})", "there is no key \"object\" here. Did you mean objects?");
  complains(objects(R"({"sphere": 1})"), "objects[0]: \"name\" is missing");
  complains(objects(ball + R"(, {"name": "a"})"), "objects[1]: one of mesh, box");
  complains(objects(R"({"name": "a", "sphere": 1, "box": [1, 1, 1]})"),
            "objects[0]: only one shape is allowed, not box and sphere");
  complains(objects(R"({"name": "a", "sphere": 0})"), "objects[0].sphere: sizes must be above 0");
  complains(objects(R"({"name": "a", "box": [1, 1e76, 1]})"), "objects[0].box: sizes must be above 0 and at most 1e75");
  complains(objects(R"({"name": "a", "box": [1, 2]})"), "objects[0].box: a list of 3 numbers expected");
  complains(objects(R"({"name": "a", "box": [1, 2, "3"]})"), "objects[0].box[2]: a number expected");
  complains(objects(R"({"name": "a", "mesh": "none.stl"})"), "objects[0].mesh: ");
  complains(objects(R"({"name": "a", "mesh": "none.stl"})"), "no such file");
  complains(objects(R"({"name": "a", "mesh": "tetra.off", "scale": 1e100})"), "objects[0].mesh: ");
  complains(objects(R"({"name": "a", "mesh": "tetra.off", "scale": [1, 0, 1]})"),
            "objects[0].scale: the scale must not be 0");
  complains(objects(R"({"name": "a", "sphere": 1, "scale": 2})"), "\"scale\" is for meshes");
  complains(objects(R"({"name": "a", "sphere": 1, "pose": [1, 2, 3, 4]})"),
            "objects[0].pose: a list of 3 or 7 numbers or {\"xyz\": [x, y, z], \"rpy\": [roll, pitch, yaw]} expected");
  complains(objects(R"({"name": "a", "sphere": 1, "pose": 3})"), "objects[0].pose: a list of 3 or 7 numbers or");
  complains(objects(R"({"name": "a", "mesh": "tetra.off", "scale": "2"})"),
            "objects[0].scale: a number or a list of 3 numbers expected");
  complains(objects(R"({"name": "a", "mesh": "tetra.off", "scale": [2]})"),
            "objects[0].scale: a number or a list of 3 numbers expected");
  complains(objects(R"({"name": "a", "mesh": ""})"), "objects[0].mesh: the name is empty");
  complains(R"({"robot": 3})", "robot: the name of a URDF (\"...\") or an object");
  complains(objects(ball, R"(, "states": 3)"), "states: the name of a table (\"...\") or a list expected");
  complains(objects(R"({"name": "a", "sphere": 1, "pose": [1, 2, 3, 0, 0, 0, 0]})"), "objects[0].pose: the quaternion");
  complains(objects(R"({"name": "a", "sphere": 1, "pose": {"rpy": [0, 0, 0], "wxyz": [1, 0, 0, 0]}})"), "one rotation");
  complains(objects(R"({"name": "a", "sphere": 1, "moving": 1})"), "objects[0].moving: true or false");
  complains(objects(ball + "," + ball), "two parts are called ball");
  complains(objects(R"({"name": "a", "sphere": 1})"), "nothing moves");
  complains(objects(R"({"name": "a", "sphere": 1, "moving": true})"), "object a has no pose");
  complains(objects(ball, R"(, "allowed": [["ball", "bal"]])"),
            "allowed[0][1]: there is no link, object or group bal. Did you mean ball?");
  complains(objects(ball, R"(, "allowed": [["ball"]])"), "allowed[0]: two names expected");
  complains(objects(ball, R"(, "groups": {"a": ["b"], "b": ["ball"]})"),
            "groups.a[0]: a group can only use groups that");
  complains(objects(ball, R"(, "groups": {"ball": []})"), "groups.ball: the name is already used");
  complains(objects(ball, R"(, "states": [])"), "states: the list is empty");
  complains(objects(ball, R"(, "states": [{"bal": [1, 2, 3]}])"),
            "states[0]: no moving joint or object is called 'bal'. Did you mean ball?");
  complains(objects(ball, R"(, "states": [{"ball.x": 1}])"),
            "states[0]: no moving joint or object is called 'ball.x'. Write \"ball\": [x, y, z].");
  complains(objects(R"({"name": "a", "sphere": 1, "moving": true})", R"(, "states": [{}])"),
            "states[0]: missing: the pose of object a");
  const auto whole = [&](const std::string& json, const std::string& what) {
    try {
      scene(json);
      ADD_FAILURE() << "no complaint: " << what;
    } catch (const std::runtime_error& e) {
      EXPECT_EQ(e.what(), (folder_ / "scene.json").string() + ": " + what);
    }
  };
  whole(objects(R"({"name": "a", "mesh": 3})"), "objects[0].mesh: a text (\"...\") expected");
  whole(R"({"robot": {"urdf": "r.urdf", "packages": {"p": 3}}})", "robot.packages.p: a text (\"...\") expected");
  whole(objects(ball, R"(, "allowed": [["ball", "x"]])"), "allowed[0][1]: there is no link, object or group x.");
  expectComplaint([&] { scene(R"({"robot": {"urdf": "none.urdf"}})"); }, {"none.urdf", "No such file"});
  expectComplaint([&] { scene(objects(ball, R"(, "states": "none.csv")")); }, {"none.csv", "No such file"});
}

TEST_F(SceneFile, RefusesPositionsBeyondAllSizes) {
  const auto place = [&](const std::string& moving, const std::string& fixed) {
    const SceneSetup s = scene(R"({"objects": [{"name": "ball", "sphere": 1, "moving": true, "pose": [)" + moving +
                               R"(, 0, 0]}, {"name": "post", "sphere": 1, "pose": [)" + fixed + ", 0, 0]}]}");
    posesOf(s, Bodies(s));
  };
  place("1e75", "-1e75");
  expectComplaint([&] { place("1e76", "0"); }, {"scene.json: the start: ball: ", "beyond 1e75"});
  expectComplaint([&] { place("0", "-1e308"); }, {"scene.json: post: ", "beyond 1e75"});
  const std::string states = write("path.csv", "ball.x,ball.y,ball.z\n0,0,0\n0,0,1e76\n");
  const SceneSetup s = scene(R"({"objects": [{"name": "ball", "sphere": 1, "moving": true}], "states": "path.csv"})");
  expectComplaint([&] { posesOf(s, Bodies(s)); }, {states + ": line 3: ball: ", "beyond 1e75"});
}

TEST_F(SceneFile, TakesAUrdfByItsContent) {
  SceneArguments arguments;
  arguments.file = write("description", "<robot name='r'>" + link("a", kSphere) + "</robot>");
  EXPECT_EQ(readScene(arguments).robot->name(), "r");
  arguments.file =
      write("other", "{\"objects\": [{\"name\": \"a\", \"sphere\": 1, \"moving\": true, \"pose\": [0,0,0]}]}");
  EXPECT_FALSE(readScene(arguments).robot.has_value());
}

/// A ball of radius 0.1 on a slide along x, whose twin mimics it along y, among a fixed ball and a box.
class Slides : public SceneFile {
 protected:
  SceneSetup setup(const std::string& states) const {
    robot(link("rail") + link("ball", kSphere) + link("twin", kSphere) +
          joint("x", "prismatic", "rail", "ball", "<axis xyz='1 0 0'/>" + kLimit) +
          joint("y", "prismatic", "rail", "twin",
                "<axis xyz='0 1 0'/><mimic joint='x' multiplier='0.5' offset='0.3'/>" + kLimit));
    return scene(R"({"robot": {"urdf": "robot.urdf", "pose": [0, 0, 1]},
      "objects": [{"name": "fixed", "sphere": 0.2, "pose": [1, 0, 1]}, {"name": "wall", "box": [0.1, 0.1, 0.1], "pose": [0, 1, 1]}],
      "allowed": [["twin", "fixed"]], "states": )" +
                     states + "}",
                 SceneArguments::Adjacent::kCheck);
  }
};

TEST_F(Slides, CollideWhereTheirDistancesSay) {
  std::string states;
  std::vector<double> values;
  for (int i = -40; i <= 80; ++i) {
    values.push_back(0.025 * i + 0.0013);
    states += (states.empty() ? "[" : ",") + std::string("{\"x\": ") + std::to_string(values.back()) + "}";
  }
  const SceneSetup s = setup(states + "]");
  const Bodies bodies(s);
  SceneQuestions questions;
  questions.clearance = true;
  for (const Scalar scalar : {Scalar::kDouble, Scalar::kFloat}) {
    questions.scalar = scalar;
    const SceneAnswers answers = askScene(s, bodies, questions);
    EXPECT_TRUE(answers.differences.empty());
    std::size_t hits = 0;
    for (std::size_t k = 0; k < values.size(); ++k) {
      const double x = s.states[k].joints[0], y = 0.5 * x + 0.3;
      // Distances of ball and twin, ball and fixed, ball and wall, twin and wall.
      const auto toBox = [](double px, double py) {
        return std::hypot(std::max(std::abs(px) - 0.05, 0.0), std::max(std::abs(py - 1) - 0.05, 0.0)) - 0.1;
      };
      const std::vector<std::pair<std::string, double>> distances = {{"ball twin", std::hypot(x, y) - 0.2},
                                                                     {"ball fixed", std::abs(x - 1) - 0.3},
                                                                     {"ball wall", toBox(x, 0)},
                                                                     {"twin wall", toBox(0, y)}};
      std::set<std::string> wanted, found;
      double least = 1e9;
      for (const auto& [name, distance] : distances) {
        ASSERT_GT(std::abs(distance), 1e-4) << "too near to tell";
        if (distance < 0) wanted.insert(name);
        least = std::min(least, std::max(distance, 0.0));
      }
      const auto nameOf = [&](std::size_t body) { return s.part(bodies.bodies[body].part).name; };
      for (const auto& [a, b] : answers.pairs[k]) found.insert(nameOf(a) + " " + nameOf(b));
      EXPECT_EQ(found, wanted) << "x = " << x;
      EXPECT_EQ(answers.hit[k] != 0, !wanted.empty()) << "x = " << x;
      EXPECT_NEAR(answers.clearance[k].distance, least, 1e-3 * (least + 1e-3)) << "x = " << x;
      hits += answers.hit[k];
    }
    EXPECT_GT(hits, 10u);
    EXPECT_LT(hits, values.size() - 10);
  }
}

TEST_F(Slides, LimitsAreReportedAndNotApplied) {
  const SceneSetup s = setup("[{\"x\": 0}, {\"x\": 3.5}, {\"x\": -1.5}]");
  EXPECT_TRUE(s.outsideLimits(s.states[0]).empty());
  const std::vector<OutsideLimits> above = s.outsideLimits(s.states[1]);  // y is at 2.05: it has the same limits
  ASSERT_EQ(above.size(), 2u);
  EXPECT_EQ(s.robot->joints()[above[0].joint].name, "x");
  EXPECT_EQ(above[0].value, 3.5);
  EXPECT_NEAR(above[1].value, 2.05, 1e-15);
  EXPECT_EQ(s.outsideLimits(s.states[2]).size(), 1u);
  EXPECT_NEAR(s.partPoses(s.states[1])[1].translation().x(), 3.5, 1e-15);
}

TEST_F(Slides, APageHasTheFirstStatesAndSaysHowManyThereAre) {
  const std::size_t count = Page::kMaxStates + 7;
  std::string states;
  for (std::size_t k = 0; k < count; ++k) states += (k == 0 ? "[" : ",") + std::string("{\"x\": 0.001}");
  const SceneSetup s = setup(states + "]");
  const Bodies bodies(s);
  const std::string html = scenePage("<b>.json", s, bodies, askScene(s, bodies, {})).html();
  std::size_t shown = 0;
  for (std::size_t at = 0; (at = html.find("\"poses\":", at)) != std::string::npos; ++at) ++shown;
  EXPECT_EQ(shown, Page::kMaxStates);
  EXPECT_NE(html.find("\"total\":" + std::to_string(count)), std::string::npos);
  EXPECT_EQ(html.find("<b>.json"), std::string::npos);
}

/// Meshes and shapes at random places: pairs of meshes are FCL's, those of shapes differ at most where it is explained.
TEST_F(SceneFile, AnswersAreThoseOfFcl) {
  std::string objects, states;
  for (int i = 0; i < 6; ++i) {
    objects += "{\"name\": \"f" + std::to_string(i) +
               "\", \"mesh\": \"tetra.off\", \"scale\": [1, 2, -1], \"pose\": {\"xyz\": [" + std::to_string(2 * i) +
               ", 0.3, 0.1], \"rpy\": [" + std::to_string(i) + ", 1, 2]}},";
  }
  objects +=
      "{\"name\": \"m0\", \"mesh\": \"tetra.off\", \"moving\": true}, {\"name\": \"m1\", \"mesh\": \"tetra.off\", "
      "\"moving\": true, \"scale\": 0.7},"
      "{\"name\": \"m2\", \"capsule\": [0.2, 0.5], \"moving\": true}";
  for (int k = 0; k < 150; ++k) {
    states += states.empty() ? "" : ",";
    for (const int m : {0, 1, 2}) {
      const double t = 0.1 * k + m;
      states += (m == 0 ? "{" : ",") + std::string("\"m") + std::to_string(m) + "\": {\"xyz\": [" +
                std::to_string(6 + 7 * std::sin(t * 1.3)) + "," + std::to_string(1.5 * std::cos(t * 2.1)) + "," +
                std::to_string(std::sin(t * 0.7)) + "], \"rpy\": [" + std::to_string(t) + ",0.3," +
                std::to_string(2 * t) + "]}";
    }
    states += "}";
  }
  const SceneSetup s = scene("{\"objects\": [" + objects + "], \"states\": [" + states + "]}");
  const Bodies bodies(s);
  EXPECT_EQ(bodies.shapes.size(), 4u);  // two scales, the plain mesh, and the capsule
  SceneQuestions questions;
  for (const Answer answer : {Answer::kExact, Answer::kConservative}) {
    questions.options.answer = answer;
    questions.options.depth = 3;
    const SceneAnswers answers = askScene(s, bodies, questions);
    std::size_t hits = 0, differences = 0;
    for (const std::uint8_t hit : answers.hit) hits += hit;
    for (const SceneDifference& d : answers.differences) {
      EXPECT_FALSE(d.fault) << d.state;
      differences += bodies.meshes(d.pair.first, d.pair.second);
    }
    EXPECT_GT(hits, 30u);
    EXPECT_LT(hits, 145u);
    EXPECT_EQ(differences > 0, answer == Answer::kConservative);
    EXPECT_EQ(answers.fcl_bytes > 0, true);
  }
  questions.fcl = false;
  EXPECT_FALSE(askScene(s, bodies, questions).fcl.has_value());
}

TEST(SceneDifferences, AreFaultsWhereFclIsRight) {
  EXPECT_TRUE(isFault(true, true, true)) << "an invented contact of two meshes";
  EXPECT_TRUE(isFault(true, false, true)) << "a missed one";
  EXPECT_TRUE(isFault(true, false, false)) << "a missed one, with conservative answers";
  EXPECT_FALSE(isFault(true, true, false)) << "conservative answers find more";
  for (const bool bocst : {false, true}) EXPECT_FALSE(isFault(false, bocst, true)) << "FCL's solver for a shape";
}

TEST(ShapeMesh, IsAsLargeAsTheShape) {
  const auto sizesOf = [](Shape::Kind kind, const Vector3d& size) {
    Part part;
    part.shapes.push_back({{kind, size, nullptr}, pose(Matrix3d::Identity(), {5, 0, 0})});
    const auto mesh = program::meshOf(part);
    EXPECT_NEAR((mesh->bounds().center() - Vector3d(5, 0, 0)).norm(), 0, 1e-12);
    return mesh->bounds().sizes().eval();
  };
  EXPECT_LT((sizesOf(Shape::Kind::kBox, {1, 2, 3}) - Vector3d(1, 2, 3)).norm(), 1e-12);
  EXPECT_LT((sizesOf(Shape::Kind::kSphere, {1, 1, 1}) - Vector3d(2, 2, 2)).norm(), 1e-12);
  EXPECT_LT((sizesOf(Shape::Kind::kCylinder, {1, 3, 3}) - Vector3d(2, 2, 3)).norm(), 1e-12);
  EXPECT_LT((sizesOf(Shape::Kind::kCapsule, {1, 3, 3}) - Vector3d(2, 2, 5)).norm(), 1e-12);
}

}  // namespace
}  // namespace bocst
