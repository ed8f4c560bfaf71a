// SPDX-License-Identifier: BSD-3-Clause
// Runs the program as a user would. BOCST_PROGRAM is its path, BOCST_MODELS that of share/models.
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "temporary_folder.h"

namespace bocst {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr int kFailed = 1;
constexpr int kUsage = 2;

class Program : public ::testing::Test, protected test::TemporaryFolder {
 protected:
  struct Result {
    int code;
    std::string out;
    std::string err;
  };

  static std::string program() { return std::string("'") + BOCST_PROGRAM + "'"; }

  Result run(const std::string& arguments) const { return shell(program() + " " + arguments); }
  Result runTo(const std::string& out, const std::string& arguments) const {
    return shell("exec >" + out + "; " + program() + " " + arguments);
  }

  /// A line for the shell.
  Result shell(const std::string& line) const {
    const std::string out = (folder_ / "out").string();
    const std::string err = (folder_ / "err").string();
    const int status = std::system(("exec >" + out + " 2>" + err + "; " + line).c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, read(out), read(err)};
  }

  std::set<std::string> files() const {
    std::set<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder_)) names.insert(entry.path().filename().string());
    return names;
  }

  /// Runs with --json - and expects the exit code 0.
  Json json(const std::string& arguments, int code = 0) const {
    const Result result = run(arguments + " --json -");
    EXPECT_EQ(result.code, code) << arguments << '\n' << result.err;
    return Json::parse(result.out, nullptr, false);
  }

  void expectComplaint(const std::string& arguments, int code, const std::string& about = "") const {
    const Result result = run(arguments);
    EXPECT_EQ(result.code, code) << arguments << '\n' << result.err;
    EXPECT_EQ(result.err.rfind("bocst: ", 0), 0u) << result.err;
    EXPECT_EQ(result.err.find('\n'), result.err.size() - 1) << "more than one line: " << result.err;
    EXPECT_NE(result.err.find(about), std::string::npos) << result.err;
  }

  static std::string read(const fs::path& file) {
    std::ifstream stream(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  }

  static std::string model(const std::string& name) { return std::string("'") + BOCST_MODELS + "/" + name + ".obj'"; }

  /// The unit cube about the origin.
  std::string cube() const {
    return write(
        "cube.off",
        "OFF\n8 6 0\n-.5 -.5 -.5\n.5 -.5 -.5\n.5 .5 -.5\n-.5 .5 -.5\n-.5 -.5 .5\n.5 -.5 .5\n.5 .5 .5\n-.5 .5 .5\n"
        "4 0 3 2 1\n4 4 5 6 7\n4 0 1 5 4\n4 1 2 6 5\n4 2 3 7 6\n4 3 0 4 7\n");
  }
};

TEST_F(Program, CollidesTheModelsItComesWith) {
  const Json report = json("collide " + model("link") + " " + model("gripper"));
  EXPECT_EQ(report.at("collide"), true);
  EXPECT_GT(report.at("contacts"), 0);
  EXPECT_EQ(report.at("contacts"), report.at("fcl").at("contacts"));
  EXPECT_EQ(report.at("agree"), true);
  EXPECT_GT(report.at("nodes"), 2);
  for (const char* key : {"first_answer_us", "warm_query_us", "settled_query_us", "bytes"}) {
    EXPECT_GT(report.at(key).at("bocst"), 0) << key;
    EXPECT_GT(report.at(key).at("fcl"), 0) << key;
  }
  for (const char* key : {"first_answer", "warm_query", "settled_query", "memory"})
    EXPECT_GT(report.at("ratio").at(key), 0) << key;
  const Result table = run("collide " + model("link") + " " + model("gripper"));
  EXPECT_EQ(table.code, 0);
  EXPECT_NE(table.out.find("They collide."), std::string::npos) << table.out;
  EXPECT_TRUE(table.err.empty()) << table.err;
}

TEST_F(Program, PlacesBWhereThePoseSays) {
  const std::string pair = "collide " + cube() + " " + cube() + " --pose ";
  EXPECT_EQ(json(pair + "0.9,0,0,1,0,0,0").at("collide"), true);
  EXPECT_EQ(json(pair + "1.1,0,0,1,0,0,0").at("collide"), false);
  // Turned by 45 degrees about z, not normalised: the corner reaches to 1.1 - 0.707.
  EXPECT_EQ(json(pair + "1.1,0,0,2.414213562373095,0,0,1").at("collide"), true);
  EXPECT_EQ(json(pair + "-1.1,0,0,1,0,0,0").at("contacts"), 0);
  EXPECT_EQ(json(pair + "0.9,0.1,0,1,0,0,0 --max-contacts 2").at("contacts"), 2);
  for (const char* scalar : {"float", "double"}) {
    EXPECT_EQ(json(pair + "0.9,0,0,1,0,0,0 --scalar " + scalar).at("agree"), true) << scalar;
  }
}

TEST_F(Program, SaysThatAQuaternionIsNormalised) {
  const std::string pair = "collide " + cube() + " " + cube() + " --pose ";
  for (const char* pose : {"0,0,0,1.002,0,0,0", "0,0,0,0,0,0,-7"}) {
    const Result result = run(pair + pose);
    EXPECT_EQ(result.code, 0);
    EXPECT_NE(result.err.find("--pose"), std::string::npos) << pose << result.err;
    EXPECT_NE(result.err.find("norm"), std::string::npos) << pose << result.err;
  }
  EXPECT_EQ(run(pair + "0,0,0,1.0005,0,0,0").err, "");
}

TEST_F(Program, SaysWhereTheyTouch) {
  const std::string pair = "collide " + cube() + " " + cube() + " --pose 0.9,0.2,0.1,1,0,0,0";
  const Json report = json(pair);
  ASSERT_EQ(report.at("contact_points").size(), report.at("contacts"));
  std::set<std::pair<int, int>> ids;
  for (const Json& point : report.at("contact_points")) {
    ids.emplace(point.at("triangle_a"), point.at("triangle_b"));
    double square = 0;
    for (const double x : point.at("normal")) square += x * x;
    EXPECT_NEAR(square, 1, 1e-12);
    EXPECT_GE(point.at("depth"), 0);
    // In the box that both share.
    EXPECT_GE(point.at("position")[0], 0.4 - 1e-9);
    EXPECT_LE(point.at("position")[0], 0.5 + 1e-9);
  }
  EXPECT_EQ(ids.size(), report.at("contacts"));
  EXPECT_TRUE(report.at("distance").is_null());
  EXPECT_EQ(report.at("extents").at("b").at("max"), Json({0.5, 0.5, 0.5}));

  const std::string file = (folder_ / "contacts.csv").string();
  const Result table = run(pair + " --csv " + file);
  EXPECT_NE(table.out.find("triangle of A"), std::string::npos) << table.out;
  std::istringstream csv(read(file));
  std::string line;
  std::getline(csv, line);
  EXPECT_EQ(line, "triangle_a,triangle_b,x,y,z,normal_x,normal_y,normal_z,depth");
  std::size_t rows = 0;
  while (std::getline(csv, line)) {
    EXPECT_EQ(std::count(line.begin(), line.end(), ','), 8) << line;
    ++rows;
  }
  EXPECT_EQ(rows, report.at("contacts"));
  // The first ten are for people.
  EXPECT_NE(run("collide " + model("link") + " " + model("gripper")).out.find("82 more"), std::string::npos);
}

TEST_F(Program, SaysHowFarApartTheyAre) {
  const Json report = json("collide " + cube() + " " + cube() + " --pose 3,0,0,1,0,0,0");
  EXPECT_NEAR(report.at("distance"), 2, 1e-12);
  EXPECT_NEAR(report.at("nearest").at("on_a")[0], 0.5, 1e-12);
  EXPECT_NEAR(report.at("nearest").at("on_b")[0], 2.5, 1e-12);
  EXPECT_TRUE(report.at("contact_points").empty());
  const Result table = run("collide " + cube() + " " + cube() + " --pose 3,0,0,1,0,0,0");
  EXPECT_NE(table.out.find("nearest point of B  (2.50000"), std::string::npos) << table.out;
}

TEST_F(Program, TakesRotationsAsTheyComeInRos) {
  const std::string pair = "collide " + cube() + " " + cube() + " --pose ";
  // An eighth of a turn about z: the corner of B reaches to 1.1 - 0.707.
  for (const std::string pose :
       {"1.1,0,0,0.92387953251128674,0,0,0.38268343236508978",
        "1.1,0,0,0,0,0.38268343236508978,0.92387953251128674 --xyzw", "1.1,0,0,0,0,0.78539816339744828 --rpy"}) {
    const Json report = json(pair + pose);
    EXPECT_EQ(report.at("collide"), true) << pose;
    EXPECT_EQ(report.at("rotation"), "turned by 45 degrees about (0, 0, 1)") << pose;
    EXPECT_NEAR(report.at("pose")[3], std::cos(0.125 * M_PI), 1e-15) << pose;
  }
  // Fixed axes x, y, z in turn: a quarter about x brings y to z, then a quarter about z leaves it there.
  const Json turned = json(pair + "0,0,0,1.5707963267948966,0,1.5707963267948966 --rpy");
  for (const std::size_t k : {3, 4, 5, 6}) EXPECT_NEAR(turned.at("pose")[k], 0.5, 1e-15);
  expectComplaint(pair + "1,0,0,1,0,0,0 --rpy", kUsage, "x,y,z,roll,pitch,yaw");
  expectComplaint(pair + "1,0,0,1,0,0 --xyzw", kUsage, "x,y,z,qx,qy,qz,qw");
  expectComplaint(pair + "1,0,0,1,0,0 --xyzw --rpy", kUsage);
}

TEST_F(Program, WarnsOfOtherUnits) {
  std::string large = "OFF\n4 4 0\n";
  for (const char* p : {"0 0 0", "100 0 0", "0 100 0", "0 0 100"}) large += std::string(p) + "\n";
  large += "3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n";
  const std::string file = write("large.off", large);
  EXPECT_NE(run("collide " + cube() + " " + file).err.find("B is 100 times as large as A"), std::string::npos);
  EXPECT_EQ(json("collide " + file + " " + cube()).at("warnings").size(), 1u);
  EXPECT_TRUE(json("collide " + cube() + " " + cube()).at("warnings").empty());
}

TEST_F(Program, AsksForEachPoseOfAFile) {
  const std::string list = write("poses.csv",
                                 "x,y,z,qw,qx,qy,qz\r\n0.9,0,0,1,0,0,0\r\n\n# far\n3 0 0 1 0 0 0 # blanks\n"
                                 "\"1.1\";+0;\t0\t0.92387953251128674;0;1e-400;0.38268343236508978\n");
  const std::string command = "collide " + cube() + " " + cube() + " --poses " + list;
  const Json report = json(command + " --distance");
  EXPECT_EQ(report.at("asked"), 3);
  EXPECT_EQ(report.at("collisions"), 2);
  const Json& poses = report.at("poses");
  ASSERT_EQ(poses.size(), 3u);
  const std::array<int, 3> lines = {2, 5, 6};
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(poses[i].at("line"), lines[i]);
    EXPECT_EQ(poses[i].at("collide"), i != 1);
  }
  EXPECT_NEAR(poses[1].at("distance"), 2, 1e-12);
  EXPECT_EQ(run(command + " --csv -").out,
            "line,x,y,z,qw,qx,qy,qz,collide\n2,0.90000000000000002,0,0,1,0,0,0,1\n5,3,0,0,1,0,0,0,0\n"
            "6,1.1000000000000001,0,0,0.92387953251128674,0,0,0.38268343236508978,1\n");
  EXPECT_NE(run(command).out.find("2 of 3 poses collide"), std::string::npos);
  expectComplaint("collide " + cube() + " " + cube() + " --poses " + write("bad.csv", "0,0,0,1,0,0,0\n0,0,0,1,0,0\n"),
                  kFailed, "bad.csv: line 2: 7 numbers");
  expectComplaint("collide " + cube() + " " + cube() + " --poses " + write("none.csv", "# none\n"), kFailed,
                  "no poses");
  const Json near = json(command + " --margin 2.001");
  EXPECT_EQ(near.at("collisions"), 3);
  EXPECT_EQ(near.at("options").at("margin"), 2.001);
  EXPECT_EQ(json(command + " --margin 1.999").at("collisions"), 2);
  expectComplaint("collide " + cube() + " " + cube() + " --margin 1", kUsage, "--margin: needs --poses");
  expectComplaint(command + " --margin -1", kUsage, "--margin");
  expectComplaint(command + " --pose 0,0,0,1,0,0,0", kUsage, "--pose");
  expectComplaint(command + " --csv - --json -", kUsage, "--csv");
  // Names of columns count: in another order the numbers are other poses.
  const auto complain = [this](const std::string& text, const std::string& about) {
    expectComplaint("collide " + cube() + " " + cube() + " --poses " + write("names.csv", text), kFailed, about);
  };
  const std::string numbers = "\n0.9,0,0,0,0,0,1\n";
  complain("x,y,z,qx,qy,qz,qw" + numbers, "line 1: the columns are x,y,z,qx,qy,qz,qw; add --xyzw");
  complain("z,y,x,qw,qx,qy,qz" + numbers, "line 1: the columns must be named x,y,z,qw,qx,qy,qz");
  complain("NaN,0,0,1,0,0,0" + numbers, "line 1: a pose must have finite numbers");
  complain("Inf,0,0,1,0,0,0" + numbers, "line 1: a pose must have finite numbers");
  const std::string ros = write("ros.csv", "\"X\", Y, Z, qx, qy, qz, qw" + numbers);
  EXPECT_EQ(json("collide " + cube() + " " + cube() + " --xyzw --poses " + ros).at("collisions"), 1);
  expectComplaint(command + " --html p.html", kUsage, "--poses");
}

TEST_F(Program, SaysThatConservativeAnswersMayBeWrong) {
  const std::string pair =
      "collide " + cube() + " " + cube() + " --answer conservative --depth 2 --pose 1.05,0,0,1,0,0,0";
  const Result table = run(pair);
  EXPECT_NE(table.out.find("They may touch. FCL's triangles do not."), std::string::npos) << table.out;
  EXPECT_NE(table.out.find("cell of A"), std::string::npos) << table.out;
}

TEST_F(Program, AnswersConservatively) {
  const std::string pair =
      "collide " + cube() + " " + cube() + " --answer conservative --pose 1.05,0,0,1,0,0,0 --depth ";
  EXPECT_EQ(json(pair + "2").at("collide"), true);
  EXPECT_EQ(json(pair + "9").at("collide"), false);
}

TEST_F(Program, InspectsTheTreeByLevel) {
  for (const std::string subdivision : {"octree", "bono"}) {
    const Json report = json("inspect " + model("link") + " --depth 5 --subdivision " + subdivision);
    EXPECT_EQ(report.at("triangles"), 5120);
    const Json& levels = report.at("levels");
    ASSERT_EQ(levels.size(), 5u);
    EXPECT_EQ(levels[0].at("nodes"), 1);
    std::size_t nodes = 0;
    double last = 1;
    for (std::size_t i = 0; i < levels.size(); ++i) {
      EXPECT_EQ(levels[i].at("level"), i + 1);
      nodes += levels[i].at("nodes").get<std::size_t>();
      EXPECT_LE(levels[i].at("error_min"), levels[i].at("error_avg"));
      EXPECT_LE(levels[i].at("error_avg"), levels[i].at("error_max"));
      EXPECT_GT(levels[i].at("error_min"), 0);
      EXPECT_LE(levels[i].at("error_max"), 1);
      EXPECT_LT(levels[i].at("error_avg"), last);
      last = levels[i].at("error_avg");
    }
    EXPECT_EQ(report.at("nodes"), nodes);
    EXPECT_EQ(levels.back().at("bytes"), report.at("tree_bytes"));
    EXPECT_LT(levels[0].at("bytes"), levels.back().at("bytes"));
    // The other subdivision stands beside it.
    const Json& other = report.at("other");
    const std::string name = subdivision == "octree" ? "bono" : "octree";
    EXPECT_EQ(other.at("subdivision"), name);
    const Json asked = json("inspect " + model("link") + " --depth 5 --subdivision " + name);
    EXPECT_EQ(other.at("levels"), asked.at("levels"));
    EXPECT_EQ(other.at("nodes"), asked.at("nodes"));
  }
}

TEST_F(Program, MeasuresTheErrorThatThePaperDefines) {
  // The root sphere about the unit cube has the radius sqrt(3)/2, and the point farthest from the cube's surface is
  // above the middle of a face, sqrt(3)/2 - 1/2 away.
  const Json report = json("inspect " + cube() + " --depth 1");
  const double radius = report.at("root_radius");
  EXPECT_NEAR(radius, std::sqrt(0.75), 1e-6);
  EXPECT_NEAR(report.at("levels")[0].at("error_max").get<double>(), (radius - 0.5) / (2 * radius), 1e-3);
}

TEST_F(Program, InspectsTheHealthOfAMesh) {
  const Json sound = json("inspect " + cube() + " --depth 1").at("health");
  EXPECT_EQ(sound.at("watertight"), true);
  EXPECT_EQ(sound.at("components"), 1);
  EXPECT_NEAR(sound.at("volume"), 1, 1e-12);
  EXPECT_NEAR(sound.at("area"), 6, 1e-12);
  EXPECT_NE(run("inspect " + cube() + " --depth 1").out.find("faults      none"), std::string::npos);

  const std::string open = write("open.off", "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n");
  const Json faulty = json("inspect " + open + " --depth 1").at("health");
  EXPECT_EQ(faulty.at("watertight"), false);
  EXPECT_EQ(faulty.at("open_edges"), 4);
  EXPECT_TRUE(faulty.at("volume").is_null());
  EXPECT_EQ(faulty.at("faults").at("open_edges").size(), 4u);
  EXPECT_EQ(faulty.at("faults").at("open_edges")[0], Json({{"vertices", {0, 1}}, {"triangles", {0}}}));
  const std::string table = run("inspect " + open + " --depth 1").out;
  EXPECT_NE(table.find("open edges 4"), std::string::npos) << table;
  EXPECT_NE(table.find("0-1 of triangle 0, 0-3 of triangle 1, 1-2 of triangle 0, ..."), std::string::npos) << table;

  const Json report = json("inspect " + cube() + " --depth 3");
  EXPECT_EQ(report.at("minimum"), Json({-0.5, -0.5, -0.5}));
  EXPECT_EQ(report.at("maximum"), Json({0.5, 0.5, 0.5}));
  EXPECT_EQ(report.at("center"), Json({0.0, 0.0, 0.0}));
  for (const Json& level : report.at("levels")) {
    EXPECT_NEAR(level.at("error_max_length").get<double>(),
                2 * report.at("root_radius").get<double>() * level.at("error_max").get<double>(), 1e-12);
  }
}

TEST_F(Program, WritesTheSpheresOfALevel) {
  const auto file = [this](const std::string& ending) { return (folder_ / ("spheres" + ending)).string(); };
  const std::string inspect = "inspect " + model("gripper") + " --depth 4 --no-error ";
  const std::size_t count = json(inspect + "--spheres " + file(".json")).at("levels")[3].at("nodes");
  const Json spheres = Json::parse(read(file(".json")));
  ASSERT_EQ(spheres.size(), count);

  ASSERT_EQ(run(inspect + "--spheres " + file(".ply")).code, 0);
  std::istringstream ply(read(file(".ply")));
  std::string line, header;
  while (std::getline(ply, line) && line != "end_header") header += line + '\n';
  EXPECT_EQ(header, "ply\nformat ascii 1.0\nelement vertex " + std::to_string(count) +
                        "\nproperty double x\nproperty double y\nproperty double z\nproperty double radius\n");

  ASSERT_EQ(run(inspect + "--link hand --spheres " + file(".yaml")).code, 0);
  std::istringstream yaml(read(file(".yaml")));
  std::getline(yaml, line);
  EXPECT_EQ(line, "collision_spheres:");
  std::getline(yaml, line);
  EXPECT_EQ(line, "  \"hand\":");

  // The same numbers in all; those of YAML in the form that its readers take for numbers.
  const std::string number = "([-+]?[0-9]+|[-+]?[0-9]+\\.[0-9]*(?:[eE][-+][0-9]+)?)";
  const std::regex center("    - \"center\": \\[" + number + ", " + number + ", " + number + "\\]");
  const std::regex radius("      \"radius\": " + number);
  for (const Json& sphere : spheres) {
    std::array<double, 4> expected{}, other{};
    for (std::size_t k = 0; k < 3; ++k) expected[k] = sphere.at("center")[k];
    expected[3] = sphere.at("radius");
    for (double& x : other) ply >> x;
    EXPECT_EQ(other, expected);
    std::smatch match;
    std::getline(yaml, line);
    ASSERT_TRUE(std::regex_match(line, match, center)) << line;
    for (std::size_t k = 0; k < 3; ++k) other[k] = std::stod(match[k + 1]);
    std::getline(yaml, line);
    ASSERT_TRUE(std::regex_match(line, match, radius)) << line;
    other[3] = std::stod(match[1]);
    EXPECT_EQ(other, expected);
  }
  EXPECT_TRUE(ply >> std::ws && ply.eof());
  EXPECT_FALSE(std::getline(yaml, line));
  expectComplaint(inspect + "--spheres " + file(".txt"), kUsage, "--spheres");
}

TEST_F(Program, FitsAsManySpheresAsAreAskedFor) {
  const std::string file = (folder_ / "fit.json").string();
  const std::string inspect = "inspect " + model("gripper") + " --depth 2 --no-error --spheres " + file;
  const Json fit = json(inspect + " --count 40").at("spheres");
  EXPECT_EQ(fit.at("count"), 40);
  EXPECT_EQ(Json::parse(read(file)).size(), 40u);
  EXPECT_EQ(fit.at("coverage"), 1);
  const Json finer = json(inspect + " --tolerance 0.01").at("spheres");
  EXPECT_LE(finer.at("protrusion_max"), 0.01);
  EXPECT_GT(fit.at("protrusion_max"), 0.01);
  EXPECT_GT(finer.at("count"), 40);
  EXPECT_NE(run(inspect + " --count 5").out.find("5, they contain 100.0 % of the surface"), std::string::npos);
  expectComplaint(inspect + " --count 0", kUsage, "--count");
  expectComplaint(inspect + " --tolerance -1", kUsage, "--tolerance");
  expectComplaint(inspect + " --dimension 0.5", kUsage, "--dimension");
  expectComplaint(inspect + " --dimension 65537", kUsage, "--dimension");
}

TEST_F(Program, RefusesTreesThatNoMachineHolds) {
  const std::string inspect = "inspect " + model("gripper") + " --no-error ";
  expectComplaint(inspect + "--depth 17", kFailed, "--depth 17: both trees would take about ");
  EXPECT_EQ(run(inspect + "--depth 10").code, 0);
  // A segment has few cells on each level.
  const std::string segment = write("segment.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n2 0 0\n3 0 1 2\n");
  EXPECT_EQ(run("inspect " + segment + " --depth 15 --no-error").code, 0);
}

TEST_F(Program, ValidatesAgainstFcl) {
  const std::string pair = "validate " + model("link") + " " + model("gripper") + " --poses 64 --seed 7";
  const Json exact = json(pair + " --contacts --reference obbrss,obb");
  EXPECT_EQ(exact.at("poses"), 64);
  EXPECT_GT(exact.at("reference_hits"), 16);
  EXPECT_LT(exact.at("reference_hits"), 56);
  EXPECT_EQ(exact.at("hits"), exact.at("reference_hits"));
  for (const char* key : {"false_negatives", "false_positives", "mismatches"}) EXPECT_EQ(exact.at(key), 0) << key;
  EXPECT_EQ(json(pair + " --contacts --reference obbrss,obb"), exact) << "the same seed gives the same report";

  const Json conservative = json(pair + " --answer conservative --depth 4 --subdivision octree");
  EXPECT_EQ(conservative.at("false_negatives"), 0);
  EXPECT_GT(conservative.at("false_positives"), 0);
  EXPECT_EQ(json(pair + " --scalar float").at("mismatches"), 0);
}

TEST_F(Program, SaysThatAnswersAboutDegenerateTrianglesMayDiffer) {
  const std::string pair = " " + write("one.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n") + " " +
                           write("point.off", "OFF\n1 1 0\n5 5 5\n3 0 0 0\n");
  const std::string beyond = "the meshes have 1 degenerate triangle; share/doc/guarantees.md, Limits, describes";
  const std::string validate = "validate" + pair + " --poses 200";
  const Json report = json(validate, kFailed);
  EXPECT_GT(report.at("mismatches"), 0);
  EXPECT_EQ(report.at("beyond_limits").get<std::string>().rfind(beyond, 0), 0u);
  expectComplaint(validate, kFailed, " of 200 poses answered differently from FCL, the first (false positive) at");
  expectComplaint(validate, kFailed, beyond);
  std::string pose;
  for (const Json& number : report.at("failures").at(0).at("pose")) pose += (pose.empty() ? "" : ",") + number.dump();
  expectComplaint("collide" + pair + " --pose " + pose, kFailed, "answers of bocst and FCL differ, but " + beyond);
  EXPECT_EQ(run("collide" + pair + " --pose " + pose).err.find("report"), std::string::npos);
  EXPECT_FALSE(json("validate " + cube() + " " + cube() + " --poses 16").contains("beyond_limits"));
}

TEST_F(Program, DividesAValidation) {
  const std::string whole = "validate " + model("link") + " " + model("gripper") + " --poses 100 --seed 5";
  for (const std::string options : {" --contacts", " --answer conservative --depth 5 --histogram"}) {
    std::string shards;
    for (const char* i : {"3", "1", "2"}) {
      const std::string file = (folder_ / ("shard" + std::string(i) + ".json")).string();
      ASSERT_EQ(run(whole + options + " --shard " + i + "/3 --json " + file).code, 0);
      EXPECT_LT(Json::parse(read(file)).at("poses"), 60);
      shards += " " + file;
    }
    EXPECT_EQ(json("merge" + shards), json(whole + options));
    EXPECT_EQ(run("merge" + shards).out, run(whole + options).out);
    expectComplaint("merge " + (folder_ / "shard1.json").string(), kFailed, "shard 2/3 is missing");
    // A mismatch in one shard is one of the whole.
    Json bad = Json::parse(read(folder_ / "shard2.json"));
    bad["mismatches"] = 1;
    bad["failures"] = {{{"at", 9}, {"pose", {1, 2, 3, 1, 0, 0, 0}}, {"what", "false negative"}}};
    write("shard2.json", bad.dump());
    EXPECT_EQ(run("merge" + shards + " --json -").code, kFailed);
    expectComplaint("merge" + shards, kFailed, "1 of 100 poses answered wrongly, the first (false negative)");
  }
  expectComplaint("merge " + cube(), kFailed, "cube.off: not JSON");
  expectComplaint("merge " + write("list.json", "[1, 2]"), kFailed, "list.json: not a report");
  expectComplaint("merge " + write("empty.json", "{}"), kFailed, "empty.json: not a report of `bocst validate`");
  expectComplaint(whole + " --shard 4/3", kUsage, "--shard");
  expectComplaint(whole + " --histogram", kUsage, "--histogram");
}

TEST_F(Program, SaysHowMuchConservativeAnswersOverestimate) {
  const Json report = json("validate " + model("link") + " " + model("gripper") +
                           " --poses 200 --seed 5 --answer conservative --depth 6 --histogram");
  const Json& depths = report.at("overestimates");
  ASSERT_EQ(depths.size(), 6u);
  EXPECT_EQ(depths[5].at("false_positives"), report.at("false_positives"));
  double last = 1e9;
  std::size_t last_count = 200;
  for (const Json& depth : depths) {
    std::size_t sum = 0;
    for (const Json& bin : depth.at("bins")) sum += bin.get<std::size_t>();
    EXPECT_EQ(sum, depth.at("false_positives"));
    EXPECT_LE(sum, last_count) << "depth " << depth.at("depth");
    EXPECT_LE(depth.at("largest"), last);
    last = depth.at("largest");
    last_count = sum;
    // At the worst pose the surfaces are apart, and the conservative answer of that depth is a hit.
    std::string pose;
    for (const Json& x : depth.at("pose")) pose += (pose.empty() ? "" : ",") + x.dump();
    const std::string pair = "collide " + model("link") + " " + model("gripper") + " --pose=" + pose;
    EXPECT_EQ(json(pair).at("collide"), false);
    EXPECT_EQ(json(pair + " --answer conservative --depth " + depth.at("depth").dump()).at("collide"), true);
  }
  EXPECT_GT(last_count, 0u);
}

TEST_F(Program, ComparesWithFcl) {
  const Json report = json("bench " + model("link") + " " + model("gripper") + " --poses 20 --rounds 2");
  for (const char* key : {"first_answer", "query_median", "query_mean", "query_p95", "memory"}) {
    EXPECT_GT(report.at("ratio").at(key), 0) << key;
  }
  EXPECT_GT(report.at("ratio").at("distance_median").get<double>(), 0);
  EXPECT_GT(report.at("ratio").at("first_distance").get<double>(), 0);
  EXPECT_EQ(report.at("scenarios"), Json({"first", "fresh", "warm", "distance", "memory"}));
  EXPECT_EQ(report.at("verdicts").at("equal"), true);
  EXPECT_EQ(report.at("verdicts").at("bocst"), report.at("verdicts").at("fcl"));
  EXPECT_GT(report.at("hits"), 0);
  EXPECT_GT(report.at("bytes").at("bocst_all"), report.at("bytes").at("bocst_first"));
  EXPECT_EQ(json("bench " + model("link") + " --poses 5 --rounds 1").at("triangles"), Json({5120, 5120}));
}

TEST_F(Program, HasARowForEachGoal) {
  const std::string csv = (folder_ / "rows.csv").string();
  const Json report = json("bench " + model("link") + " " + model("gripper") +
                           " --scenarios all --poses 12 --rounds 2 --frames 60 --triangles 2000,9000 --csv " + csv);
  std::vector<std::string> lines{"scenario,row,unit,bocst,fcl,ratio"};
  std::map<std::string, Json> rows;
  for (const Json& row : report.at("rows")) {
    const auto number = [&row](const char* key) { return row.at(key).is_null() ? "" : "[-+0-9.e]+"; };
    lines.push_back(row.at("scenario").get<std::string>() + "," + row.at("row").get<std::string>() + "," +
                    row.at("unit").get<std::string>() + "," + number("bocst") + "," + number("fcl") + "," +
                    number("ratio"));
    EXPECT_TRUE(rows.emplace(row.at("row"), row).second) << row;
    for (const char* key : {"bocst", "fcl", "ratio"}) EXPECT_TRUE(row.at(key).is_null() || row.at(key) >= 0) << row;
  }
  std::istringstream written(read(csv));
  std::string line;
  for (const std::string& expected : lines) {
    ASSERT_TRUE(std::getline(written, line)) << expected;
    EXPECT_TRUE(std::regex_match(line, std::regex(expected))) << line << " is not " << expected;
  }
  EXPECT_FALSE(std::getline(written, line)) << line;

  for (const std::string row : {"first_answer",
                                "first_distance",
                                "query_median",
                                "query_mean",
                                "query_p95",
                                "query_miss_median",
                                "query_miss_mean",
                                "query_miss_p95",
                                "query_hit_median",
                                "query_hit_mean",
                                "query_hit_p95",
                                "contacts_median",
                                "contacts_mean",
                                "contacts_p95",
                                "distance_median",
                                "memory",
                                "memory_all",
                                "memory_settled",
                                "heap",
                                "moving_first",
                                "moving_worst",
                                "moving_p999",
                                "moving_total",
                                "moving_raw_worst",
                                "deforming_rebuild",
                                "deforming_refit",
                                "deforming_refit_replace"}) {
    ASSERT_EQ(rows.count(row), 1u) << row;
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    if (std::string(row) == "heap") continue;  // a sanitizer's allocator does not tell mallinfo2()
#endif
    EXPECT_GT(rows[row].at("ratio"), 0) << row;
  }
  for (const std::string row : {"first_over_streaming", "streaming_pass", "growth_first_2000", "growth_query_2000"}) {
    ASSERT_EQ(rows.count(row), 1u) << row;
    EXPECT_GT(rows[row].at("bocst"), 0) << row;
  }
  EXPECT_EQ(rows["growth_first_2000"].at("ratio"), 1);
  // Its own copies of the vertices and of the indices are among what a model holds, where the allocator tells.
  ASSERT_EQ(rows.count("heap"), 1u);
  if (report.at("skipped").empty() || report.at("skipped").at(0).at("row") != "heap") {
    EXPECT_GT(rows["heap"].at("bocst"), rows["memory_all"].at("bocst").get<double>() + 12);
    EXPECT_GT(rows["heap"].at("fcl"), rows["memory_all"].at("fcl").get<double>() + 24);
  }
  EXPECT_GT(rows["moving_touching"].at("fcl"), 0);
  EXPECT_EQ(rows["moving_touching"].at("bocst"), rows["moving_touching"].at("fcl"));
  EXPECT_GT(report.at("moving").at("worst_frame"), 0);
  EXPECT_LT(report.at("moving").at("worst_frame"), 60);
  EXPECT_EQ(report.at("contacts").at("poses"), 12);
  EXPECT_GT(report.at("contacts").at("pairs"), 0);
  EXPECT_EQ(report.at("verdicts").at("equal"), true);
  EXPECT_EQ(report.at("verdicts").at("bocst"), report.at("verdicts").at("fcl"));
  cpu_set_t processors;
  ASSERT_EQ(sched_getaffinity(0, sizeof(processors), &processors), 0);
  if (CPU_COUNT(&processors) == 1) {
    EXPECT_EQ(report.at("skipped").back().at("scenario"), "threads");
    return;
  }
  for (const char* row : {"threads_one", "threads_two", "threads_gain", "threads_cold_two"}) {
    ASSERT_EQ(rows.count(row), 1u) << row;
    EXPECT_GT(rows[row].at("ratio"), 0) << row;
  }
}

TEST_F(Program, MeasuresTheScenariosThatAreNamed) {
  const std::string bench = "bench " + model("link") + " --poses 6 --rounds 1";
  const Json report = json(bench + " --scenarios memory,warm --subdivide 1");
  EXPECT_EQ(report.at("scenarios"), Json({"warm", "memory"}));
  EXPECT_EQ(report.at("triangles"), Json({20480, 20480}));
  for (const Json& row : report.at("rows")) {
    EXPECT_TRUE(row.at("scenario") == "warm" || row.at("scenario") == "memory") << row;
  }
  EXPECT_TRUE(report.at("ratio").at("first_answer").is_null());
  EXPECT_GT(report.at("ratio").at("memory"), 0);

  const Result csv = run(bench + " --scenarios memory --csv -");
  EXPECT_EQ(csv.code, 0) << csv.err;
  EXPECT_EQ(csv.out.rfind("scenario,row,unit,bocst,fcl,ratio\nmemory,memory,bytes/triangle,", 0), 0u) << csv.out;
  const Result table = run("bench --scenarios threads,memory " + model("link") + " --poses 6 --rounds 1");
  EXPECT_EQ(table.code, 0) << table.err;
  EXPECT_NE(table.out.find("threads"), std::string::npos) << table.out;
  const Result alone = shell("taskset -c $(taskset -cp $$ | sed 's/.*: //; s/[-,].*//') " + program() + " " + bench +
                             " --scenarios threads --json -");
  EXPECT_EQ(alone.code, 0) << alone.err;
  EXPECT_EQ(Json::parse(alone.out).at("skipped").at(0).at("scenario"), "threads");

  // FCL's distances of triangles as small as these are too large or 0, which is no fault of bocst's.
  const std::string specks = write("specks.off",
                                   "OFF\n4 4 0\n0 0 0\n1e-9 0 0\n0 1e-9 0\n0 0 1e-9\n"
                                   "3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n");
  const Result small = run("bench " + specks + " --scenarios distance --poses 100 --rounds 1");
  EXPECT_EQ(small.code, 0) << small.err;
  EXPECT_NE(small.out.find("distances: FCL's are wrong at "), std::string::npos) << small.out;

  expectComplaint(bench + " --scenarios first,nosuch", kUsage, "--scenarios");
  expectComplaint(bench + " --json - --csv -", kUsage, "--csv");
  expectComplaint(bench + " --oracles --csv -", kUsage, "--csv");
  expectComplaint(bench + " --csv " + (folder_ / "none" / "f.csv").string(), kFailed, "none/f.csv");
}

class SceneProgram : public Program {
 protected:
  static std::string example(const std::string& name) {
    return std::string("'") + BOCST_MODELS + "/../examples/scene/" + name + "'";
  }
  static std::string package() { return std::string(" --package 'bocst_models=") + BOCST_MODELS + "'"; }

  static std::set<std::string> pairsOf(const Json& state) {
    std::set<std::string> names;
    for (const Json& pair : state.at("pairs")) {
      names.insert(pair.at(0).get<std::string>() + " " + pair.at(1).get<std::string>());
    }
    return names;
  }
};

TEST_F(SceneProgram, ChecksARobotAmongObstacles) {
  const Json report = json("scene " + example("cell.json") + " --clearance");
  EXPECT_EQ(report.at("robot"), "arm");
  EXPECT_EQ(report.at("joints"), Json({"shoulder_pan", "shoulder_lift", "elbow", "finger_left_joint"}));
  EXPECT_EQ(report.at("asked"), 10);
  EXPECT_EQ(report.at("collisions"), 4);
  EXPECT_EQ(report.at("outside_limits"), 1);
  EXPECT_EQ(report.at("agree"), true);
  EXPECT_EQ(report.at("differences"), Json::array());
  for (const char* key : {"set_up", "first", "again"}) {
    for (const char* side : {"bocst", "bocst_built", "fcl"})
      EXPECT_GT(report.at("times_us").at(side).at(key), 0) << key;
    EXPECT_GT(report.at("ratio").at(key), 0) << key;
  }
  const Json& states = report.at("states");
  EXPECT_EQ(states.at(0).at("place"), "line 4");
  for (const Json& state : states) EXPECT_EQ(state.at("clearance") == 0, state.at("collide")) << state;
  EXPECT_EQ(pairsOf(states.at(4)), (std::set<std::string>{"forearm table", "palm table", "finger_right table"}));
  EXPECT_EQ(pairsOf(states.at(7)), std::set<std::string>{"parcel wall"});
  EXPECT_EQ(pairsOf(states.at(9)), std::set<std::string>{"column palm"});
  // What mimics is outside, too.
  const Json& outside = states.at(4).at("outside_limits");
  ASSERT_EQ(outside.size(), 2u);
  EXPECT_EQ(outside.at(0).at("joint"), "finger_left_joint");
  EXPECT_EQ(outside.at(1).at("value"), -0.06);
  EXPECT_EQ(outside.at(1).at("lower"), -0.05);

  const Result people = run("scene " + example("cell.json"));
  EXPECT_EQ(people.code, 0);
  EXPECT_EQ(people.err, "");
  for (const char* words : {"4 of 10 states collide.", "parcel - wall", "finger_left_joint 0.06 is not in 0 to 0.05",
                            "FCL's managers", "line 8   yes"}) {
    EXPECT_NE(people.out.find(words), std::string::npos) << words << '\n' << people.out;
  }
  const Result alone = run("scene " + example("cell.json") + " --no-fcl");
  EXPECT_EQ(alone.out.find("FCL"), std::string::npos) << alone.out;
}

TEST_F(SceneProgram, WritesALineForEachState) {
  const Result result = run("scene " + example("cell.json") + " --clearance --csv -");
  EXPECT_EQ(result.code, 0) << result.err;
  std::istringstream stream(result.out);
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  ASSERT_EQ(lines.size(), 11u);
  EXPECT_EQ(lines[0], "index,place,collide,pairs,clearance,nearest_a,nearest_b,outside_limits");
  EXPECT_EQ(lines[8], "7,line 11,1,parcel - wall,0.0,parcel,wall,");
  EXPECT_EQ(lines[1].rfind("0,line 4,0,,0.0", 0), 0u) << lines[1];
  EXPECT_NE(lines[5].find("; finger_right_joint -0.06 is not in -0.05 to 0"), std::string::npos) << lines[5];
}

TEST_F(SceneProgram, TakesAUrdfWithATableOfStates) {
  const std::string table =
      write("states.csv", "elbow,shoulder_lift,shoulder_pan,finger_left_joint\n0,0,0,0.02\n-0.34,1.45,0.14,0.02\n");
  const std::string arm = "scene " + example("arm.urdf") + package();
  const Json report = json(arm + " --states " + table);
  EXPECT_EQ(report.at("collisions"), 1);
  EXPECT_EQ(pairsOf(report.at("states").at(1)), std::set<std::string>{"column palm"});
  EXPECT_EQ(report.at("notes").size(), 1u);
  EXPECT_NE(report.at("notes").at(0).get<std::string>().find("without an SRDF"), std::string::npos);
  EXPECT_EQ(json(arm + " --states " + table + " --srdf " + example("arm.srdf")).at("notes").size(), 0u);
  // Joined links touch each other.
  const Json adjacent = json(arm + " --adjacent check");
  EXPECT_EQ(adjacent.at("asked"), 1);
  EXPECT_EQ(pairsOf(adjacent.at("states").at(0)).count("column shoulder"), 1u);
  const std::string srdf = write("all.srdf",
                                 "<robot name='arm'><disable_collisions link1='column' link2='palm'/>"
                                 "<disable_collisions link1='column' link2='gone'/></robot>");
  const Result result = run(arm + " --adjacent ignore --states " + table + " --srdf " + srdf);
  EXPECT_NE(result.out.find("0 of 2 states collide"), std::string::npos) << result.out;
  EXPECT_NE(result.err.find("no link gone"), std::string::npos) << result.err;
}

TEST_F(SceneProgram, PrintsNoControlCharacters) {
  const std::string scene = "scene " + write("names.json", R"({"objects": [
      {"name": "a\u001b[31m\u0007\nb\u0000\u00e4", "box": [1, 1, 1], "moving": true, "pose": [0, 0, 0]},
      {"name": "b", "sphere": 0.5}]})");
  const std::string shown = "a?[31m??b?\u00e4 - b";
  for (const char* options : {"", " --csv -"}) {
    const Result result = run(scene + options);
    EXPECT_EQ(result.code, 0) << result.err;
    EXPECT_NE(result.out.find(shown), std::string::npos) << result.out;
    EXPECT_EQ(result.out.find('\x1b'), std::string::npos);
  }
  // Other programs read JSON: names stay as they are there.
  EXPECT_EQ(json(scene).at("parts").at(0).at("name"), std::string("a\x1b[31m\a\nb\0\u00e4", 12));
}

TEST_F(SceneProgram, ShowsTheDigitsThatAreOutsideOfALimit) {
  const std::string urdf =
      write("pi.urdf",
            "<robot name='r'><link name='a'/><link name='b'><collision><geometry><sphere radius='1'/>"
            "</geometry></collision></link><joint name='j' type='revolute'>"
            "<parent link='a'/><child link='b'/><axis xyz='0 0 1'/>"
            "<limit lower='-3.14159265358979' upper='3.14159265358979' effort='1' velocity='1'/>"
            "</joint></robot>");
  const std::string states = write("pi.csv", "j\n3.141592653589793\n4\n");
  const Result result = run("scene " + urdf + " --states " + states + " --no-fcl");
  for (const char* words : {"j 3.141592653589793 is not in -3.14159265358979 to 3.14159265358979\n",
                            "j 4 is not in -3.14159265359 to 3.14159265359\n"}) {
    EXPECT_NE(result.out.find(words), std::string::npos) << words << '\n' << result.out;
  }
}

TEST_F(SceneProgram, DoubtsDegreesAndSwappedLimits) {
  const auto outOf = [this](const char* limits) {
    const std::string urdf =
        write("one.urdf", std::string("<robot name='r'><link name='a'/><link name='b'><collision><geometry><sphere "
                                      "radius='1'/></geometry></collision></link><joint name='j' type='revolute'>"
                                      "<parent link='a'/><child link='b'/><axis xyz='0 0 1'/><limit ") +
                              limits + " effort='1' velocity='1'/></joint></robot>");
    return run("scene " + urdf + " --states " + write("one.csv", "j\n45\n") + " --no-fcl").out;
  };
  const std::string degrees = outOf("lower='-2' upper='2'"), swapped = outOf("lower='2' upper='-2'");
  EXPECT_NE(degrees.find("j 45 is not in -2 to 2 (radians; is it given in degrees?)"), std::string::npos) << degrees;
  EXPECT_NE(swapped.find("j: its lower limit 2 is above its upper limit -2"), std::string::npos) << swapped;
}

TEST_F(SceneProgram, TakesTheOptionsOfAModel) {
  const std::string cell = "scene " + example("cell.json");
  const Json exact = json(cell);
  for (const std::string options : {"--scalar float", "--answer conservative --depth 4", "--margin 0.02"}) {
    const Json report = json(cell + " " + options);
    EXPECT_EQ(report.at("agree"), true) << options;
    for (std::size_t k = 0; k < 10; ++k) {
      EXPECT_GE(report.at("states").at(k).at("collide"), exact.at("states").at(k).at("collide")) << options << k;
    }
  }
  EXPECT_GT(json(cell + " --margin 0.02").at("collisions"), 4);
  // Two cubes 0.1 apart, each with a margin.
  const std::string cubes = write("cubes.json", "{\"objects\": [{\"name\": \"a\", \"mesh\": \"" + cube() +
                                                    "\"}, {\"name\": \"b\", \"mesh\": \"" + cube() +
                                                    "\", \"moving\": true, \"pose\": [1.1, 0, 0]}]}");
  for (const char* margin : {"nan", "-1", "inf", "x"}) {
    expectComplaint("scene " + cubes + " --margin " + margin, kUsage, "--margin");
  }
  EXPECT_EQ(json("scene " + cubes + " --margin 0.049").at("collisions"), 0);
  const Json margin = json("scene " + cubes + " --margin 0.051");
  EXPECT_EQ(margin.at("collisions"), 1);
  EXPECT_EQ(margin.at("differences").at(0).at("fault"), false);
  EXPECT_NEAR(json("scene " + cubes + " --clearance").at("states").at(0).at("clearance"), 0.1, 1e-12);
}

TEST_F(SceneProgram, SaysWhatIsWrong) {
  const std::string arm = "scene " + example("arm.urdf");
  expectComplaint(arm, kFailed, "line 31: link upper_arm: mesh package://bocst_models/link.obj: package bocst_models");
  expectComplaint(arm + " --package bocst_models", kUsage, "--package: bocst_models: name=folder expected");
  expectComplaint(arm + " --package bocst_models=/nowhere", kUsage, "--package: bocst_models=/nowhere: no such folder");
  expectComplaint(arm + package() + package(), kUsage, "the package is given twice");
  expectComplaint(arm + " --package bocst_models=" + folder_.string(), kFailed, "/link.obj: no such file");
  expectComplaint(arm + package() + " --adjacent maybe", kUsage, "--adjacent");
  expectComplaint(arm + package() + " --margin -1", kUsage, "--margin");
  expectComplaint(arm + package() + " --states " + write("states.csv", "elbow\n1\n"), kFailed,
                  "states.csv: line 1: columns are missing: shoulder_pan, shoulder_lift, finger_left_joint");
  expectComplaint(arm + package() + " --states " + (folder_ / "none.csv").string(), kFailed,
                  "none.csv: cannot be read");
  expectComplaint(arm + package() + " --srdf " + write("wrong.srdf", "<robot>"), kFailed, "wrong.srdf: line 1: no XML");
  expectComplaint("scene " + (folder_ / "none.json").string(), kFailed, "none.json: cannot be read");
  const std::string scene = write("scene.json", "{\"objects\": []}");
  expectComplaint("scene " + scene, kFailed, "scene.json: nothing moves");
  expectComplaint("scene " + scene + " --json " + scene, kFailed, "would be overwritten");
  const std::string shapes = write("shapes.json",
                                   "{\"objects\": [{\"name\": \"a\", \"sphere\": 1},"
                                   " {\"name\": \"b\", \"sphere\": 1, \"moving\": true, \"pose\": [3, 0, 0]}]}");
  EXPECT_EQ(run("scene " + shapes + " --scalar float").code, 0);
  for (const std::string option :
       {"--margin 0.1", "--answer conservative", "--subdivision octree", "--dimension 64", "--oracle cpu"}) {
    expectComplaint("scene " + shapes + " " + option, kFailed,
                    option.substr(0, option.find(' ')) + ": has no effect, because " + shapes + " has no mesh");
  }
}

TEST_F(Program, ListsOracles) {
  const Json report = json("oracles");
  bool cpu = false;
  for (const Json& oracle : report.at("oracles")) {
    if (oracle.at("name") == "cpu") cpu = oracle.at("usable");
    EXPECT_EQ(oracle.at("usable").get<bool>(), oracle.at("why_not") == "");
  }
  EXPECT_TRUE(cpu);
}

TEST_F(Program, SetsThePaperBesideIt) {
  const std::string folder = (folder_ / "deep" / "er").string();
  const Result result = run("paper " + cube() + " " + cube() + " --frames 70 --oracle cpu --out " + folder +
                            " --json " + (folder_ / "paper.json").string());
  ASSERT_EQ(result.code, 0) << result.err;
  EXPECT_EQ(result.out + result.err, "");
  const Json report = Json::parse(read(folder_ / "paper.json"));
  // Each tree is that of `inspect`.
  const Json& tables = report.at("trees");
  ASSERT_EQ(tables.size(), 2u);
  EXPECT_EQ(tables[0].at("table"), 1);
  EXPECT_EQ(tables[1].at("table"), 2);
  for (const Json& tree : tables[1].at("trees")) {
    const bool octree = tree.at("method") == "O";
    const std::size_t depth = tree.at("levels").size();
    const Json inspected =
        json("inspect " + cube() + " --oracle cpu --depth " + std::to_string(depth) +
             (octree ? " --subdivision octree" : " --subdivision bono --dimension " + tree.at("dimension").dump()));
    for (std::size_t l = 0; l < depth; ++l) {
      for (const char* key : {"level", "nodes", "error_min", "error_avg", "error_max"}) {
        EXPECT_EQ(tree.at("levels")[l].at(key), inspected.at("levels")[l].at(key)) << tree.at("dimension") << key;
      }
    }
  }
  const Json& animation = report.at("animation");
  EXPECT_EQ(animation.at("frames"), 70);
  ASSERT_EQ(animation.at("oracles").size(), 1u);
  ASSERT_EQ(animation.at("oracles")[0].at("runs").size(), 9u);
  for (const Json& run : animation.at("oracles")[0].at("runs")) {
    EXPECT_EQ(run.at("missed"), 0);
    std::size_t queries = 0, frames = 0;
    for (const Json& second : run.at("by_second")) {
      queries += second.at("queries").get<std::size_t>();
      frames += second.at("frames").get<std::size_t>();
    }
    EXPECT_EQ(run.at("all").at("queries"), queries);
    EXPECT_EQ(frames, 70u);
  }
  // The report shows each picture, and each is there.
  const std::string text = read(fs::path(folder) / "paper.md");
  std::set<std::string> shown, there;
  const std::regex picture("\\]\\(pictures/([^)]+)\\)");
  for (std::sregex_iterator it(text.begin(), text.end(), picture), end; it != end; ++it) shown.insert((*it)[1]);
  for (const auto& entry : fs::directory_iterator(fs::path(folder) / "pictures")) {
    there.insert(entry.path().filename().string());
    EXPECT_EQ(read(entry.path()).rfind("\x89PNG", 0), 0u);
  }
  EXPECT_EQ(shown.size(), 5u);
  EXPECT_EQ(shown, there);
  EXPECT_NE(text.find("--frames 70 --oracle cpu"), std::string::npos) << "how it was made";
  // Table 3: what the runs were made with.
  const std::size_t parameters = text.find("## Table 3");
  ASSERT_NE(parameters, std::string::npos);
  for (const char* row : {"| Coll. depth | 5 | 5 | 5, 6 | 5, 6 |", "| Max. time | 2.0 | 2 | 2.0 | 2 |",
                          "| Anim. frames | 2200 | 70 | 2200 | 70 |",
                          "| d_t | 514, 832, 1024 | 514, 832, 1024 | 514, 832, 1024 | 514, 832, 1024 |"}) {
    EXPECT_NE(text.find(row, parameters), std::string::npos) << row;
  }
}

TEST_F(Program, ExplainsWhyThereIsNoPaper) {
  const std::string paper = "paper " + cube() + " --frames 7 --oracle cpu";
  const std::string into = " --out " + (folder_ / "none").string();
  expectComplaint("paper", kUsage, "mesh");
  expectComplaint("paper " + cube() + " " + cube() + " " + cube() + " " + cube() + " " + cube(), kUsage);
  expectComplaint(paper + ",gpu" + into, kUsage, "--oracle");
  expectComplaint(paper + into + " --frames 0", kUsage, "--frames");
  expectComplaint(paper + into + " --triangles -3", kUsage, "--triangles");
  expectComplaint("paper " + (folder_ / "missing.obj").string() + into, kFailed, "missing.obj: no such file");
  expectComplaint(paper + " --out " + cube(), kFailed, "cube.off: is not a folder");
  expectComplaint(paper + " --out " + cube() + "/below", kFailed, "cube.off: is not a folder");
  expectComplaint(paper + " --out /dev/full", kFailed, "/dev/full: is not a folder");
  expectComplaint(paper + " --json /dev/full", kFailed, "/dev/full");
  const Result full = runTo("/dev/full", paper + " --json -");
  EXPECT_EQ(full.code, kFailed);
  EXPECT_EQ(full.err, "bocst: stdout: cannot be written\n");
  EXPECT_EQ(files(), (std::set<std::string>{"cube.off", "out", "err"}));
  // A report of before is not touched by a run that fails or ends early.
  fs::create_directory(folder_ / "report");
  const std::string before = write("report/paper.md", "as before");
  fs::create_symlink(before, folder_ / "paper.json");
  expectComplaint(paper + " --out " + (folder_ / "report").string() + " --json " + (folder_ / "paper.json").string(),
                  kFailed, "another file");
  const Result stopped = shell("timeout --preserve-status -s INT 1 " + program() + " paper " + model("gripper") +
                               " --frames 1000000 --oracle cpu --out " + (folder_ / "report").string());
  EXPECT_GT(stopped.code, 128);
  EXPECT_EQ(stopped.err, "bocst: interrupted\n");
  EXPECT_EQ(read(before), "as before");
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_ / "report"), fs::directory_iterator()), 1);
}

TEST_F(Program, WritesJsonFilesWhole) {
  const std::string file = (folder_ / "report.json").string();
  EXPECT_EQ(run("inspect " + cube() + " --depth 2 --json " + file).out, "");
  EXPECT_EQ(Json::parse(read(file)).at("levels").size(), 2u);
  EXPECT_EQ(files(), (std::set<std::string>{"report.json", "cube.off", "out", "err"}));
  expectComplaint("inspect " + cube() + " --json " + (folder_ / "none" / "r.json").string(), kFailed, "r.json");
  expectComplaint("inspect " + cube() + " --json " + folder_.string(), kFailed, "cannot be written");
  expectComplaint("inspect " + cube() + " --json /dev/full", kFailed, "/dev/full");
}

TEST_F(Program, ExplainsWrongCommandLines) {
  EXPECT_EQ(run("--help").code, 0);
  EXPECT_EQ(run("validate --help").code, 0);
  expectComplaint("", kUsage);
  expectComplaint("fly", kUsage);
  expectComplaint("collide " + cube(), kUsage);
  expectComplaint("collide " + cube() + " " + cube() + " --no-such-option", kUsage);
  for (const std::string pose :
       {"1,2,3", "0,0,0,0,0,0,0", "0,0,0,1,0,0,0,0", "0,0,0,1,0,0,x", "nan,0,0,1,0,0,0", "1e999,0,0,1,0,0,0"}) {
    expectComplaint("collide " + cube() + " " + cube() + " --pose=" + pose, kUsage, "--pose");
  }
  for (const std::string option :
       {"--depth 0", "--depth 99", "--depth x", "--subdivision kd", "--dimension -1", "--oracle delphi"}) {
    expectComplaint("inspect " + cube() + " " + option, kUsage, option.substr(0, option.find(' ')));
  }
  expectComplaint("validate " + cube() + " " + cube() + " --poses 0", kUsage, "--poses");
  expectComplaint("validate " + cube() + " " + cube() + " --answer conservative --contacts", kUsage, "--contacts");
  expectComplaint("validate " + cube() + " " + cube() + " --reference kdop", kUsage, "--reference");
}

// A script's variable that is not set must not count as an option that is not given.
TEST_F(Program, RefusesEmptyValuesAndOptionsWithoutEffect) {
  const std::string collide = "collide " + cube() + " " + cube(), inspect = "inspect " + cube();
  const std::string bench = "bench " + cube();
  const std::string scene =
      "scene " + write("scene.json", R"({"objects": [{"name": "p", "box": [1, 1, 1], "moving": true}],
                                                  "states": [{"p": [0, 0, 0]}]})");
  for (const std::string& command : {collide + " --poses ''", collide + " --pose ''", collide + " --csv ''",
                                     collide + " --json ''", inspect + " --html ''", inspect + " --image ''",
                                     scene + " --states ''", scene + " --srdf ''", std::string("inspect ''")}) {
    expectComplaint(command, kUsage, "empty");
  }
  expectComplaint(collide + " --rpy", kUsage, "--rpy: needs --pose");
  expectComplaint(collide + " --xyzw", kUsage, "--xyzw: needs --pose");
  expectComplaint(collide + " --depth 5", kUsage, "--depth: has an effect only with --answer conservative");
  expectComplaint(collide + " --viewport 64", kUsage, "--viewport: has an effect only with --oracle sampled");
  expectComplaint(inspect + " --viewport 64", kUsage, "--viewport: has an effect only with --oracle sampled");
  expectComplaint(inspect + " --link hand --spheres x.ply", kUsage, "--link: needs --spheres FILE.yaml");
  expectComplaint(inspect + " --tolerance 0.1 --count 9", kUsage, "--tolerance");
  expectComplaint(scene + " --depth 5", kUsage, "--depth");
  expectComplaint(scene + " --adjacent check", kFailed, "--adjacent: ");
  expectComplaint(bench + " " + cube() + " --oracles", kUsage, "b: not available with --oracles");
  expectComplaint(bench + " --oracles --scenarios warm", kUsage, "--scenarios: not available with --oracles");
  expectComplaint(bench + " --frames 3", kUsage, "--frames: needs --scenarios moving");
  expectComplaint(bench + " --scenarios warm --build-ahead", kUsage,
                  "--build-ahead: needs --scenarios fresh or planner");
  expectComplaint(bench + " --limit 3", kUsage, "--limit: needs --oracles");
  expectComplaint(bench + " --triangles 100", kUsage, "--triangles: needs --scenarios growth or --oracles");
  expectComplaint("help fly", kUsage, "there is no command fly");
}

TEST_F(Program, KeepsWhatASceneNames) {
  const std::string states = write("states.csv", "p.x,p.y,p.z\n1,0,0\n");
  const std::string scene = write("scene.json", R"({"objects": [{"name": "p", "box": [1, 1, 1], "moving": true},
                                                  {"name": "q", "box": [1, 1, 1]}], "states": "states.csv"})");
  expectComplaint("scene " + scene + " --csv " + states, kFailed, "would be overwritten");
  EXPECT_EQ(read(states), "p.x,p.y,p.z\n1,0,0\n");
  EXPECT_EQ(run("scene " + scene + " --csv " + (folder_ / "report.csv").string()).code, 0);
}

TEST_F(Program, ReadsPosesWithAByteOrderMark) {
  const std::string poses = write("poses.csv", "\xEF\xBB\xBFx,y,z,qw,qx,qy,qz\n0,0,0,1,0,0,0\n");
  EXPECT_EQ(json("collide " + cube() + " " + cube() + " --poses " + poses).at("collisions"), 1);
}

// An existing file keeps its permissions.
TEST_F(Program, KeepsPermissionsOfOutputs) {
  const std::string report = write("report.json", "");
  fs::permissions(report, fs::perms::owner_read | fs::perms::owner_write);
  EXPECT_EQ(run("inspect " + cube() + " --depth 1 --json " + report).code, 0);
  EXPECT_EQ(fs::status(report).permissions(), fs::perms::owner_read | fs::perms::owner_write);
}

TEST_F(Program, SuggestsWhatWasMeant) {
  expectComplaint("colide a b", kUsage, "Did you mean collide?");
  expectComplaint("inspec a", kUsage, "Did you mean inspect?");
  expectComplaint("fly", kUsage, "there is no command fly. See");
  expectComplaint("", kUsage, "one of: collide, inspect");
  expectComplaint("--versoin", kUsage, "--versoin");
  expectComplaint("collide " + cube() + " " + cube() + " --pos 1", kUsage, "Did you mean --pose?");
  expectComplaint("collide " + cube() + " " + cube() + " more", kUsage, "more: unexpected");
  expectComplaint("validate " + cube() + " " + cube() + " --poses 0", kUsage, "0 is not a whole number from 1");
  // What does not fit in 64 bits, or is negative, is not taken for another number.
  for (const char* count : {"18446744073709551615", "18446744073709551616", "99999999999999999999", "-1", "1.5"}) {
    expectComplaint("validate " + cube() + " " + cube() + " --poses " + count, kUsage, "--poses");
    expectComplaint("validate " + cube() + " " + cube() + " --seed " + count, kUsage, "--seed");
    expectComplaint("bench " + cube() + " --rounds " + count, kUsage, "--rounds");
  }
  EXPECT_EQ(run("help").out, run("--help").out);
  EXPECT_EQ(run("help collide").out, run("collide --help").out);
  EXPECT_NE(run("help").out.find("glb"), std::string::npos) << "all formats are named";
  for (const std::string command : {"collide", "inspect", "validate", "scene", "bench", "paper"}) {
    const std::string help = run(command + " --help").out;
    EXPECT_FALSE(std::regex_search(help, std::regex("[0-9]{20}"))) << help;
  }
}

TEST_F(Program, RefusesOutputsOfAnotherKind) {
  const std::string inspect = "inspect " + cube() + " --depth 1 ";
  expectComplaint(inspect + "--image x.jpg", kUsage, "--image");
  expectComplaint(inspect + "--image -", kUsage, "--image");
  expectComplaint(inspect + "--html -", kUsage, "--html");
  expectComplaint(inspect + "--html x.png", kUsage, "--html");
  expectComplaint(inspect + "--json x.csv", kUsage, "--json");
  expectComplaint("collide " + cube() + " " + cube() + " --csv x.json", kUsage, "--csv");
  expectComplaint("bench " + cube() + " " + cube() + " --csv x.json", kUsage, "--csv");
  expectComplaint("collide " + cube() + " " + cube() + " --pose ''", kUsage, "--pose");
}

TEST_F(Program, ExplainsWhatFails) {
  for (const std::string command : {"inspect", "bench"}) {
    expectComplaint(command + " " + (folder_ / "missing.obj").string(), kFailed, "missing.obj: no such file");
    expectComplaint(command + " " + write("bad.off", "OFF\n3 1 0\n0 0 0\n1 nan 0\n1 1 0\n3 0 1 2\n"), kFailed,
                    "bad.off");
  }
  expectComplaint("collide " + cube() + " " + write("empty.stl", ""), kFailed, "empty.stl: is empty");
  expectComplaint("validate " + write("cut.ply", "ply\nformat ascii 1.0\n") + " " + cube(), kFailed,
                  "cut.ply: truncated");
}

TEST_F(Program, ReadsASceneFileFromAPipe) {
  const auto piped = [this](const std::string& text) {
    return shell("cat '" + write("scene", text) + "' | " + program() + " scene /dev/stdin");
  };
  EXPECT_EQ(piped("<robot name='r'>\n<link/></robot>").err, "bocst: /dev/stdin: line 2: <link> without name=\"...\"\n");
  const Result json = piped("{\"objects\": 1}");
  EXPECT_EQ(json.code, kFailed);
  EXPECT_EQ(json.err.rfind("bocst: /dev/stdin: objects", 0), 0u) << json.err;
}

TEST_F(Program, ExplainsWhatCannotBeWritten) {
  const std::string inspect = "inspect " + cube() + " --depth 2";
  for (const std::string option : {"--json", "--html", "--image"}) {
    expectComplaint(inspect + " " + option + " /dev/full", kFailed, "/dev/full: cannot be written: No space left");
    expectComplaint(inspect + " " + option + " " + (folder_ / "none" / "f").string(), kFailed, "none/f");
    expectComplaint(inspect + " " + option + " " + folder_.string(), kFailed, "Is a directory");
    expectComplaint(inspect + " " + option + " " + folder_.string() + "/" + std::string(300, 'x'), kFailed, "too long");
  }
  expectComplaint(inspect + " --spheres " + (folder_ / "none" / "f.ply").string(), kFailed, "none/f.ply");
  EXPECT_EQ(runTo("/dev/full", inspect).err, "bocst: stdout: cannot be written\n");
  for (const std::string words : {"--help", "--version", "collide --help"}) {
    EXPECT_EQ(runTo("/dev/full", words).err, "bocst: stdout: cannot be written\n");
    EXPECT_EQ(runTo("/dev/full", words).code, kFailed);
  }
  // What a link points to is written, also where that is not there yet.
  const std::string target = (folder_ / "target.json").string();
  fs::create_symlink("target.json", folder_ / "new.json");
  ASSERT_EQ(run("inspect " + cube() + " --depth 2 --json " + (folder_ / "new.json").string()).code, 0);
  EXPECT_TRUE(fs::is_symlink(folder_ / "new.json"));
  EXPECT_EQ(Json::parse(read(target)).at("levels").size(), 2u);
  if (geteuid() != 0) {
    fs::permissions(target, fs::perms::owner_read);
    expectComplaint(inspect + " --json " + target, kFailed, "Permission denied");
  }
  EXPECT_EQ(runTo("/dev/full", inspect + " --json -").code, kFailed);
  // What goes in, or out elsewhere, is not written over.
  const std::string ply = (folder_ / "a.ply").string();
  ASSERT_EQ(run(inspect + " --spheres " + ply).code, 0);
  const std::string before = read(ply);
  fs::create_symlink(ply, folder_ / "b.ply");
  expectComplaint("inspect " + ply + " --spheres " + (folder_ / "b.ply").string(), kFailed, "another file");
  // Names without an ending, which any output may have.
  fs::create_symlink(ply, folder_ / "link");
  const std::string link = (folder_ / "link").string();
  expectComplaint(inspect + " --html " + link + " --json " + link, kFailed, "another file");
  expectComplaint(inspect + " --image " + link + " --html " + link, kFailed, "another file");
  EXPECT_EQ(read(ply), before);
  // A link stays one.
  ASSERT_EQ(run(inspect + " --json " + link).code, 0);
  EXPECT_TRUE(fs::is_symlink(link));
  EXPECT_EQ(Json::parse(read(ply)).at("triangles"), 12);
}

TEST_F(Program, LeavesTheOldFileWhenTheDiskIsFull) {
  for (const std::string option : {"--html", "--image"}) {
    const std::string file = write("file", "as before");
    const std::string command = "inspect " + model("link") + " --depth 5 --no-error " + option + " " + file;
    const std::string before = "trap '' XFSZ; ulimit -f 8; ";
    const Result result = shell(before + program() + " " + command);
    EXPECT_EQ(result.code, kFailed);
    EXPECT_EQ(result.err, "bocst: " + file + ": cannot be written: File too large\n");
    EXPECT_EQ(read(file), "as before");
    EXPECT_EQ(files(), (std::set<std::string>{"file", "out", "err"}));
  }
}

TEST_F(Program, LeavesNothingBehindWhenInterrupted) {
  const std::string report = (folder_ / "report.json").string();
  const std::string poses =
      " validate " + model("link") + " " + model("gripper") + " --poses 100000000 --json " + report;
  for (const std::string signal : {"INT", "TERM", "HUP"}) {
    const Result result = shell("timeout --preserve-status -s " + signal + " 2 " + program() + poses);
    EXPECT_GT(result.code, 128);
    EXPECT_EQ(result.err, "bocst: interrupted\n");
    EXPECT_EQ(files(), (std::set<std::string>{"out", "err"}));
  }
}

/// At any moment: the file is there whole, or not at all.
TEST_F(Program, WritesWholeFilesWhenInterrupted) {
  for (const std::string option : {"--html", "--image"}) {
    const std::string file = (folder_ / "file").string();
    const std::string inspect = " inspect " + model("link") + " --depth 6 --no-error " + option + " " + file;
    using Clock = std::chrono::steady_clock;
    const auto begin = Clock::now();
    ASSERT_EQ(shell(program() + inspect).code, 0);
    const double took = std::chrono::duration<double>(Clock::now() - begin).count();
    const std::string whole = read(file);
    std::set<bool> seen;
    // Through the whole run and, as no two take equally long, until it got to the end.
    for (int i = 0; i < 24 || (i < 400 && seen.count(true) == 0); ++i) {
      fs::remove(file);
      char seconds[16];
      std::snprintf(seconds, sizeof(seconds), "%.3f", 0.002 + took * i / 20);
      shell(std::string("timeout -s INT ") + seconds + " " + program() + inspect);
      std::set<std::string> left = files();
      seen.insert(left.erase("file") == 1);
      EXPECT_EQ(left, (std::set<std::string>{"out", "err"}));
      EXPECT_TRUE(!fs::exists(file) || read(file).size() == whole.size());
    }
    EXPECT_EQ(seen, (std::set<bool>{false, true})) << "interrupted in time, and not";
    fs::remove(file);
  }
}

/// Width and height of a PNG file; it must have its end, too.
std::pair<unsigned, unsigned> sizeOfPng(const std::string& bytes) {
  const auto number = [&bytes](std::size_t at) {
    unsigned value = 0;
    for (std::size_t i = at; i < at + 4; ++i) value = value << 8 | static_cast<unsigned char>(bytes.at(i));
    return value;
  };
  if (bytes.compare(0, 8, "\x89PNG\r\n\x1a\n") != 0 || bytes.compare(bytes.size() - 8, 4, "IEND") != 0) return {0, 0};
  return {number(16), number(20)};
}

TEST_F(Program, DrawsPictures) {
  const std::string image = (folder_ / "a.png").string();
  const auto drawn = [&](const std::string& arguments) {
    const Result result = run(arguments + " --image " + image);
    EXPECT_EQ(result.code, 0) << arguments << '\n' << result.err;
    EXPECT_EQ(result.err, "");
    const std::string bytes = read(image);
    fs::remove(image);
    return bytes;
  };
  const std::string pair = model("link") + " " + model("gripper");
  const std::string inspect = "inspect " + model("link") + " --no-error --depth ";
  const auto [width, height] = sizeOfPng(drawn(inspect + "4"));
  EXPECT_EQ(width, 1600u);
  EXPECT_EQ(sizeOfPng(drawn(inspect + "4 --image-width 500")).first, 500u);
  EXPECT_GT(sizeOfPng(drawn(inspect + "6")).second, height) << "two rows";
  // The same picture each time; another one of boxes, from another side, of another tree.
  const std::string link = inspect + "3 --image-width 300";
  std::set<std::string> different;
  for (const std::string option : {"", "", " --image-nodes boxes", " --image-up y", " --subdivision octree"}) {
    different.insert(drawn(link + option));
  }
  EXPECT_EQ(different.size(), 4u);

  different.clear();
  for (const std::string& command :
       {"collide " + pair, "collide " + pair + " --pose 9,0,0,1,0,0,0", "collide " + pair + " --image-nodes boxes",
        "collide " + pair + " --answer conservative --depth 4", "collide " + pair + " --max-contacts 1",
        "validate " + pair + " --poses 16",
        "validate " + pair + " --poses 16 --answer conservative --depth 4 --histogram"}) {
    const std::string bytes = drawn(command);
    EXPECT_EQ(sizeOfPng(bytes).first, 1600u) << command;
    different.insert(bytes);
  }
  EXPECT_EQ(different.size(), 7u);
}

TEST_F(Program, DrawsTheFirstMismatch) {
  // The paper's oracle at its coarsest misses what it should see.
  const std::string validate = "validate " + model("link") + " " + model("gripper") + " --poses 32 --image ";
  const std::string wrong = (folder_ / "wrong.png").string(), right = (folder_ / "right.png").string();
  const Result result = run(validate + wrong + " --oracle sampled --viewport 1");
  EXPECT_EQ(result.code, kFailed);
  EXPECT_NE(result.err.find("poses answered wrongly"), std::string::npos) << result.err;
  EXPECT_EQ(run(validate + right + " --oracle cpu").code, 0);
  EXPECT_EQ(sizeOfPng(read(wrong)).first, 1600u);
  EXPECT_EQ(sizeOfPng(read(right)).first, 1600u);
  EXPECT_NE(read(wrong), read(right));
}

TEST_F(Program, RefusesPicturesThatMakeNoSense) {
  const std::string inspect = "inspect " + cube() + " --depth 2";
  const std::string image = " --image " + (folder_ / "a.png").string();
  for (const std::string option : {"--image-nodes boxes", "--image-up y", "--image-width 500"}) {
    expectComplaint(inspect + " " + option, kUsage, "--image");
  }
  for (const std::string option : {"--image-nodes cones", "--image-up x", "--image-width 20", "--image-width 1e9"}) {
    expectComplaint(inspect + image + " " + option, kUsage, option.substr(0, option.find(' ')));
  }
  EXPECT_EQ(files(), (std::set<std::string>{"cube.off", "out", "err"}));
}

TEST_F(Program, ShowsProgressToPeopleOnly) {
  const std::string command = program() + " validate " + model("link") + " " + model("gripper") + " --poses 3000";
  EXPECT_EQ(shell(command).err, "");
  const Result terminal = shell("script -qec \"" + command + "\" /dev/null");
  EXPECT_EQ(terminal.code, 0);
  EXPECT_NE(terminal.out.find(" of 375"), std::string::npos) << terminal.out;
  EXPECT_NE(terminal.out.find("mismatches"), std::string::npos);
}

TEST_F(Program, ReportsNamesThatAreNoText) {
  const std::string odd = (folder_ / "odd\xff\".off").string();
  fs::copy_file(cube(), odd);
  const Json report = json("inspect '" + odd + "' --depth 1 --html " + (folder_ / "page.html").string());
  EXPECT_EQ(report.at("triangles"), 12);
  expectComplaint("inspect '" + odd + "x.off'", kFailed, "no such file");
}

}  // namespace
}  // namespace bocst
