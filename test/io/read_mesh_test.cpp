// SPDX-License-Identifier: BSD-3-Clause
#include "io/read_mesh.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "mesh_files.h"

namespace bocst::io {
namespace {

using namespace test;

std::string complaint(const std::string& bytes, Format format) {
  try {
    readMesh(bytes, format);
    ADD_FAILURE() << "was read: " << bytes.substr(0, 100);
  } catch (const std::runtime_error& e) {
    return e.what();
  }
  return {};
}

void expectComplaint(Format format, const std::string& bytes, const std::string& about) {
  const std::string what = complaint(bytes, format);
  EXPECT_NE(what.find(about), std::string::npos) << what << "\n instead of " << about << " for:\n"
                                                 << bytes.substr(0, 100);
}

const std::string kObj =
    "mtllib none.mtl\no a\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1\nf 1 3 4\n";
std::string binaryStl() {
  std::string stl(80, 's');
  append(stl, std::uint32_t{1});
  for (const float x : {0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 1, 0}) append(stl, x);
  append(stl, std::uint16_t{0});
  return stl;
}

/// A COLLADA file; its mesh has five vertices: a unit square and (0.5 0.5 1).
std::string dae(const std::string& primitives, const std::string& nodes, const std::string& asset = "",
                const std::string& libraries = "") {
  return R"(<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset>)" +
         asset + R"(</asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="15">0 0 0 1 0 0 1 1 0
 0 1 0 .5 .5 1</float_array><technique_common><accessor source="#pa" count="5" stride="3">
<param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
)" + primitives +
         R"(</mesh></geometry></library_geometries>
)" + libraries +
         R"(<library_visual_scenes><visual_scene id="s">)" + nodes + R"(</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>
)";
}

const std::string kInput = R"(<input semantic="VERTEX" source="#v" offset="0"/>)";
const std::string kTriangles = "<triangles count=\"2\">" + kInput + "<p>0 1 2 0 2 3</p></triangles>\n";
const std::string kNode = R"(<node id="n"><instance_geometry url="#g"/></node>)";
const std::string kDae = dae(kTriangles, kNode);

Polygons readDaeWith(const std::string& primitives) { return readDae(dae(primitives, kNode)); }

std::vector<std::size_t> sizes(const Polygons& polygons) {
  std::vector<std::size_t> result;
  std::size_t begin = 0;
  for (const std::size_t end : polygons.ends) {
    result.push_back(end - begin);
    begin = end;
  }
  return result;
}

using Corners = std::vector<std::uint32_t>;
using Sizes = std::vector<std::size_t>;

// COLLADA

TEST(ReadDae, KeepsTheAxesOfTheFile) {
  for (const char* axis : {"X_UP", "Y_UP", "Z_UP"}) {
    const Polygons p = readDae(dae(kTriangles, kNode, "<up_axis>" + std::string(axis) + "</up_axis>"));
    EXPECT_EQ(p.vertices[4], Eigen::Vector3d(0.5, 0.5, 1)) << axis;
  }
}

TEST(ReadDae, AppliesItsUnit) {
  const Polygons p =
      readDae(dae(kTriangles, R"(<node><translate>2 0 0</translate><instance_geometry url="#g"/></node>)",
                  R"(<unit name="inch" meter="0.0254"/><up_axis>Z_UP</up_axis>)"));
  EXPECT_TRUE(p.vertices[2].isApprox(Eigen::Vector3d(3 * 0.0254, 0.0254, 0), 1e-15));
  for (const std::string bad : {"0", "-1", "nan", "inf", "1,5", "", "1 m"}) {
    expectComplaint(Format::kDae, dae(kTriangles, kNode, "<unit meter=\"" + bad + "\"/>"), "line 2: <unit>: meter=");
  }
}

TEST(ReadDae, AppliesTransformsInTheirOrder) {
  const auto placed = [](const std::string& transforms) {
    return readDae(dae(kTriangles, "<node>" + transforms + "<instance_geometry url=\"#g\"/></node>")).vertices;
  };
  const auto expect = [](const Eigen::Vector3d& p, double x, double y, double z) {
    EXPECT_TRUE(p.isApprox(Eigen::Vector3d(x, y, z), 1e-14)) << p.transpose() << " and " << x << " " << y << " " << z;
  };
  // Vertex 4 is (0.5 0.5 1).
  expect(placed("<translate>1 2 3</translate><scale>2 3 4</scale>")[4], 2, 3.5, 7);
  expect(placed("<scale>2 3 4</scale><translate>1 2 3</translate>")[4], 3, 7.5, 16);
  expect(placed("<matrix>0 -1 0 10 1 0 0 20 0 0 1 30 0 0 0 1</matrix>")[4], 9.5, 20.5, 31);
  EXPECT_EQ(placed("<rotate>0 0 2 90</rotate>")[1], Eigen::Vector3d(0, 1, 0)) << "a quarter turn is exact";
  expect(placed("<rotate>1 1 1 120</rotate>")[4], 1, 0.5, 0.5);
  const double s = std::sqrt(0.5);
  expect(placed("<rotate>0 0 1 405</rotate>")[1], s, s, 0);
  // From (1 2 3) along +x, up is +z: the node's -z is +x, its y is +z.
  expect(placed("<lookat>1 2 3 5 2 3 0 0 1</lookat>")[4], 1 - 1, 2 - 0.5, 3 + 0.5);
  // y is turned by 45 degrees towards x; x stays.
  expect(placed("<skew>45 0 1 0 1 0 0</skew>")[3], 1, 1, 0);
  expect(placed("<skew>45 0 1 0 1 0 0</skew>")[1], 1, 0, 0);
  for (const std::string bad :
       {"<translate>1 2</translate>", "<scale>1 2 3 4</scale>", "<rotate>0 0 0 1</rotate>", "<matrix>1 2</matrix>",
        "<matrix>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 2</matrix>", "<lookat>0 0 0 0 0 0 0 1 0</lookat>",
        "<skew>1 1 0 0 1 0 0</skew>", "<translate>1 2 x</translate>", "<translate>1 2 <b/></translate>",
        "<translate>1,5 0 0</translate>", "<translate>1e400 0 0</translate>"}) {
    expectComplaint(Format::kDae, dae(kTriangles, "<node>" + bad + "<instance_geometry url=\"#g\"/></node>"),
                    "line 10: <");
  }
}

TEST(ReadDae, FollowsNodes) {
  const std::string library =
      R"(<library_nodes><node id="twice"><node><translate>0 0 1</translate><instance_geometry url="#g"/></node>
<node><translate>0 0 2</translate><instance_geometry url="#g"/></node></node></library_nodes>)";
  const Polygons p = readDae(dae(kTriangles,
                                 R"(<node><translate>10 0 0</translate><instance_node url="#twice"/></node>
<node><translate>20 0 0</translate><instance_node url="#twice"/></node>)",
                                 "", library));
  ASSERT_EQ(p.vertices.size(), 20u);
  ASSERT_EQ(p.ends.size(), 8u);
  const double x[] = {10, 10, 20, 20};
  const double z[] = {1, 2, 1, 2};
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(p.vertices[5 * i], Eigen::Vector3d(x[i], 0, z[i]));
    EXPECT_EQ(p.corners[6 * i], 5 * i);
  }
}

TEST(ReadDae, ReadsEachPrimitive) {
  EXPECT_EQ(readDaeWith(kTriangles).corners, (Corners{0, 1, 2, 0, 2, 3}));
  Polygons p =
      readDaeWith("<polylist count=\"3\">" + kInput + "<vcount>4 3 2</vcount><p>0 1 2 3 0 1 4 2 3</p></polylist>");
  EXPECT_EQ(p.corners, (Corners{0, 1, 2, 3, 0, 1, 4, 2, 3}));
  EXPECT_EQ(sizes(p), (Sizes{4, 3, 2}));
  p = readDaeWith("<polygons count=\"2\">" + kInput + "<p>0 1 2 3</p><p>0 1 4</p></polygons>");
  EXPECT_EQ(p.corners, (Corners{0, 1, 2, 3, 0, 1, 4}));
  EXPECT_EQ(sizes(p), (Sizes{4, 3}));
  p = readDaeWith("<trifans count=\"1\">" + kInput + "<p>4 0 1 2</p></trifans>");
  EXPECT_EQ(p.corners, (Corners{4, 0, 1, 4, 1, 2}));
  p = readDaeWith("<tristrips count=\"2\">" + kInput + "<p>0 1 3 2 4</p><p>0 1 4</p></tristrips>");
  EXPECT_EQ(p.corners, (Corners{0, 1, 3, 3, 1, 2, 3, 2, 4, 0, 1, 4}));
  // Several, lines among them, and an input beside the vertices; a comment among the numbers.
  p = readDaeWith(
      kTriangles + "<lines count=\"1\">" + kInput + "<p>0 1</p></lines><triangles count=\"1\">" +
      R"(<input semantic="NORMAL" source="#x" offset="0"/><input semantic="VERTEX" source="#v" offset="1"/>)" +
      "<p>7 0 7 1 <!-- half of it --> 7 4</p></triangles>");
  EXPECT_EQ(p.corners, (Corners{0, 1, 2, 0, 2, 3, 0, 1, 4}));
  EXPECT_TRUE(readDaeWith("<lines count=\"1\">" + kInput + "<p>0 1</p></lines>").ends.empty());
  // Exporters write primitives of nothing.
  EXPECT_EQ(readDaeWith("<triangles count=\"0\"/>" + kTriangles).ends.size(), 2u);
}

TEST(ReadDae, ReadsParametersByName) {
  const std::string file = replaced(
      replaced(replaced(kDae, "0 2 3<", "0 2 1<"), R"(<param name="X" type="float"/><param name="Y" type="float"/>)",
               R"(<param type="float"/><param name="Y" type="float"/><param name="X" type="float"/>)"),
      R"(count="5" stride="3")", R"(count="3" stride="4" offset="1")");
  // From number 1 on: (_ y x z) = (0 0 1 0) (0 1 1 0) (0 1 0 .5)
  const Polygons p = readDae(file);
  ASSERT_EQ(p.vertices.size(), 3u);
  EXPECT_EQ(p.vertices[0], Eigen::Vector3d(1, 0, 0));
  EXPECT_EQ(p.vertices[2], Eigen::Vector3d(0, 1, 0.5));
}

TEST(ReadDae, TakesTheShapeUnderAController) {
  const std::string controllers =
      R"(<library_controllers><controller id="c"><skin source="#m"/></controller>
<controller id="m"><morph source="#g"/></controller><controller id="loop"><skin source="#loop"/></controller>
</library_controllers>)";
  const auto file = [&](const std::string& id) {
    return dae(kTriangles, "<node><instance_controller url=\"#" + id + "\"/></node>", "", controllers);
  };
  EXPECT_EQ(readDae(file("c")).ends.size(), 2u);
  expectComplaint(Format::kDae, file("loop"), "no geometry");
  expectComplaint(Format::kDae, file("g"), "is a <geometry>");
}

TEST(ReadDae, RefusesWhatGoesInCircles) {
  const auto with = [](const std::string& library) {
    return dae(kTriangles, R"(<node><instance_node url="#a"/></node>)", "",
               "<library_nodes>" + library + "</library_nodes>");
  };
  expectComplaint(Format::kDae, with(R"(<node id="a"><instance_node url="#a"/></node>)"), "instantiate themselves");
  expectComplaint(
      Format::kDae,
      with(
          R"(<node id="a"><instance_node url="#b"/></node><node id="b"><node><instance_node url="#a"/></node></node>)"),
      "instantiate themselves");
  // 2^60 instances, of nothing and of something; a geometry too often.
  for (const std::string leaf : {"", "<instance_geometry url=\"#g\"/>"}) {
    std::string nodes = "<node id=\"a\"><instance_node url=\"#a0\"/></node>";
    for (int i = 0; i < 60; ++i) {
      const std::string next = "<instance_node url=\"#a" + std::to_string(i + 1) + "\"/>";
      nodes += "<node id=\"a" + std::to_string(i) + "\">" + next + next + "</node>";
    }
    expectComplaint(Format::kDae, with(nodes + "<node id=\"a60\">" + leaf + "</node>"), "millions of times");
  }
  std::string indices;
  for (int i = 0; i < 30000; ++i) indices += "0 1 2 ";
  std::string instances;
  for (int i = 0; i < 1000; ++i) instances += "<instance_geometry url=\"#g\"/>";
  expectComplaint(Format::kDae,
                  dae("<triangles count=\"30000\">" + kInput + "<p>" + indices + "</p></triangles>",
                      "<node>" + instances + "</node>"),
                  "corners with all instances");
  std::string deep;
  for (int i = 0; i < 200000; ++i) deep += "<node>";
  expectComplaint(Format::kDae, deep, "no XML");
  std::string close;
  for (int i = 0; i < 200000; ++i) close += "</node>";
  expectComplaint(Format::kDae, dae(kTriangles, deep + close), "nest too deep");
  EXPECT_EQ(readDae(dae(kTriangles, kNode, "", "<extra>" + deep + close + "</extra>")).ends.size(), 2u);
}

TEST(ReadDae, RefusesWhatIsWrong) {
  const auto refuse = [](const std::string& what, const std::string& by, const std::string& about) {
    expectComplaint(Format::kDae, replaced(kDae, what, by), about);
  };
  refuse("0 2 3<", "0 2 9<", "line 8: <p>: vertex index 9 out of range");
  refuse("0 2 3<", "0 2 -1<", "vertex index -1 out of range");
  refuse("0 2 3<", "0 2 4294967296<", "out of range");
  refuse("0 2 3<", "0 2 1e300<", "'1e300' is no index");
  refuse("0 2 3<", "0 2 1.5<", "line 8: <p>: '1.5' is no index");
  refuse("0 2 3<", "0 2<", "more indices than corners");
  refuse("triangles count=\"2\"", "triangles count=\"3\"", "there are 2 of them, not 3");
  refuse("triangles count=\"2\"", "triangles count=\"-2\"", "is no count");
  refuse(" 0 1 0 .5", " 0 nan 0 .5", "line 5: <float_array>: 'nan' is no finite number");
  refuse(" 0 1 0 .5", " 0 1,5 0 .5", "line 5: <float_array>: '1,5' is no finite number");
  refuse(" 0 1 0 .5", " 0 .5", "there are 13 numbers, not 15");
  refuse("count=\"5\"", "count=\"6\"", "do not fit");
  refuse("count=\"5\"", "count=\"18446744073709551615\"", "is no count");
  refuse("count=\"5\"", "count=\"9223372036854775807\"", "do not fit");
  refuse("stride=\"3\"", "stride=\"2\"", "less than three coordinates");
  refuse("stride=\"3\"", "stride=\"9223372036854775807\"", "do not fit");
  refuse("stride=\"3\"", "stride=\"3\" offset=\"9223372036854775807\"", "do not fit");
  refuse("offset=\"0\"", "offset=\"1\"", "there are 1 of them, not 2");
  refuse("offset=\"0\"", "offset=\"4000000000\"", "no multiple of");
  refuse("source=\"#p\"", "source=\"#q\"", "its mesh has no <source> '#q'");
  refuse("source=\"#v\"", "source=\"#p\"", "its mesh has no <vertices> '#p'");
  refuse("source=\"#pa\"", "source=\"other.dae#pa\"", "no <float_array>");
  refuse("url=\"#g\"", "url=\"other.dae#g\"", "is no place in this file");
  refuse("url=\"#g\"", "url=\"#h\"", "there is no '#h'");
  refuse("url=\"#s\"", "url=\"#g\"", "is a <geometry>");
  refuse("<node id=\"n\"", "<node id=\"g\"", "twice the id 'g'");
  refuse("</COLLADA>", "</COLLADA><COLLADA/>", "one root element");
  refuse("</COLLADA>", "</COLLADA> and more", "one root element");
  refuse("</COLLADA>", "</COLLADA>" + std::string(3, '\0'), "zero byte");
  refuse("</COLLADA>", "", "no XML");
  refuse("<scene>", "<scen>", "no XML");
  refuse("<scene><instance_visual_scene url=\"#s\"/></scene>", "", "no <scene>");
  refuse("<mesh>", "<brep/><mesh>", "<brep>: not supported");
  refuse(kTriangles, "<polygons count=\"1\">" + kInput + "<ph><p>0 1 2</p><h>0 1 4</h></ph></polygons>", "with holes");
  refuse(kTriangles, "<polylist count=\"1\">" + kInput + "<vcount>4</vcount><p>0 1 2</p></polylist>", "more corners");
  refuse(kTriangles, "<polylist count=\"1\">" + kInput + "<vcount>-1</vcount><p>0 1 2</p></polylist>", "more corners");
  refuse(kTriangles, "<polylist count=\"1\">" + kInput + "<vcount>2.5</vcount><p>0 1 2</p></polylist>", "is no index");
  expectComplaint(Format::kDae, "<html><body/></html>", "not COLLADA");
  // Entities are not expanded, so they cannot grow.
  expectComplaint(Format::kDae, "<!DOCTYPE x [<!ENTITY a \"1 1 1\">]>" + replaced(kDae, "0 2 3<", "&a;<"),
                  "'&a;' is no index");
}

// The others

TEST(ReadPly, ReadsTriangleStrips) {
  const std::string head = kPly.substr(0, kPly.find("element face"));
  const std::string strips =
      head + "element tristrips 1\nproperty list int int vertex_indices\nend_header\n" + "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";
  EXPECT_EQ(readPly(strips + "4 0 1 3 2\n").corners, (Corners{0, 1, 3, 3, 1, 2}));
  // -1 ends a strip and with it the turn; repeated corners only tie parts together.
  EXPECT_EQ(readPly(strips + "9 0 1 3 2 -1 1 2 3 -1\n").corners, (Corners{0, 1, 3, 3, 1, 2, 1, 2, 3}));
  EXPECT_EQ(readPly(strips + "6 0 1 1 3 3 2\n").corners, (Corners{}));
  EXPECT_EQ(readPly(strips + "7 0 1 2 2 3 3 1\n").corners, (Corners{0, 1, 2}));
  expectComplaint(Format::kPly, strips + "3 0 1 4\n", "line 14: tristrips 0: vertex index 4 out of range");
  expectComplaint(Format::kPly, strips + "3 0 1 -2\n", "vertex index -2 out of range");
  std::string binary = replaced(strips.substr(0, strips.find("end_header\n") + 11), "ascii", "binary_little_endian");
  for (const float x : {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}) append(binary, x);
  for (const std::int32_t i : {8, 0, 1, 3, 2, -1, 1, 2, 3}) append(binary, i);
  EXPECT_EQ(readPly(binary).corners, (Corners{0, 1, 3, 3, 1, 2, 1, 2, 3}));
}

TEST(ReadPly, RefusesWhatIsNoIndexAndNoCount) {
  const auto refuse = [](const std::string& what, const std::string& by, const std::string& about) {
    expectComplaint(Format::kPly, replaced(kPly, what, by), about);
  };
  for (const std::string bad : {"1.5", "1e300", "4294967296", "x", "0x1", "1,5", "99999999999999999999"}) {
    refuse("3 0 2 3", "3 0 2 " + bad, "line 15: face 1: ");
    refuse("3 0 2 3", bad + " 0 2 3", "line 15: face 1: ");
  }
  refuse("3 0 2 3", "-1", "line 15: face 1: ");
  refuse("3 0 2 3", "300 0 2 3", "line 15: face 1: '300' is no number of its property's type");
  refuse("3 0 2 3", "255 0 2 3", "line 15: face 1: a list longer than the file");
  refuse("3 0 2 3", "4 0 2 3", "truncated");
  refuse("3 0 2 3", "3 0 2 3 4", "line 15: there is more");
  refuse("3 0 2 3", "3 0 2 4", "line 15: face 1: vertex index 4 out of range");
  for (const std::string bad : {"nan", "inf", "-inf", "1e999"}) {
    refuse("1 1 0", "1 " + bad + " 0", "line 12: vertex 2: a coordinate is no finite number");
  }
  refuse("1 1 0", "1 1e300 0", "line 12: vertex 2: a coordinate is larger than 1e75 in magnitude");
  refuse("1 1 0", "1 1,5 0", "line 12: vertex 2: '1,5' is no number");
  refuse("property float y", "property float x", "line 5: PLY header: twice the property 'x'");
  refuse("property list uchar int vertex_indices",
         "property list uchar int vertex_indices\nproperty list uchar int vertex_index", "line 9: PLY header: twice");
  refuse("element face", "element vertex", "line 7: PLY header: twice the element 'vertex'");
  refuse("element face 2", "element face 2.5", "line 7: PLY header: number of elements");
  refuse("element face 2", "element face 4000000000000", "truncated");

  // Numbers of a type that could be anything.
  const std::string real = replaced(kPly, "list uchar int", "list float double");
  EXPECT_EQ(readPly(real).ends.size(), 2u);
  for (const std::string bad : {"2.5", "-1", "nan", "inf", "1e300"}) {
    expectComplaint(Format::kPly, replaced(real, "3 0 2 3", bad + " 0 2 3"), "line 15: face 1: a list ");
    expectComplaint(Format::kPly, replaced(real, "3 0 2 3", "3 0 2 " + bad), "line 15: face 1: vertex index");
  }
  std::string binary = replaced(real.substr(0, real.find("end_header\n") + 11), "ascii", "binary_little_endian");
  for (const float x : {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}) append(binary, x);
  const std::string at = "byte " + std::to_string(binary.size());
  for (const float n : {0.5f, -1.f, std::numeric_limits<float>::quiet_NaN(), 1e30f}) {
    std::string bad = binary;
    append(bad, n);
    bad += std::string(48, '\0');
    expectComplaint(Format::kPly, bad, at + ": face 0: a list ");
  }
  append(binary, 3.f);
  for (const double i : {1e300, 0.5, -1.0, 4.0, std::numeric_limits<double>::quiet_NaN()}) {
    std::string bad = binary;
    for (const double x : {0.0, 1.0, i}) append(bad, x);
    expectComplaint(Format::kPly, bad + std::string(28, '\0'), "face 0: vertex index");
  }
  std::string nan = binaryPly();
  const float no_number = std::numeric_limits<float>::quiet_NaN();
  std::memcpy(&nan[nan.find("end_header\n") + 11 + 12], &no_number, sizeof(no_number));
  expectComplaint(Format::kPly, nan, "vertex 1: a coordinate is no finite number");
  std::string far = binaryPly(true);
  far.back() = 77;
  expectComplaint(Format::kPly, far, "vertex index 77 out of range");
  expectComplaint(Format::kPly, binaryPly() + "\n", "byte " + std::to_string(binaryPly().size()) + ": there is more");
}

TEST(ReadOff, RefusesWhatIsNoIndexAndNoEnd) {
  const auto refuse = [](const std::string& what, const std::string& by, const std::string& about) {
    expectComplaint(Format::kOff, replaced(kOff, what, by), about);
  };
  refuse("3 0 2 3\n", "3 0 2 3\n3 0 1 2\n", "line 9: there is more");
  refuse("3 0 2 3\n", "3 0 2 3\nrubbish\n", "line 9: there is more");
  refuse("3 0 2 3\n", "3 0 2 3 rubbish\n", "line 8: 'rubbish' not expected");
  refuse("3 0 2 3\n", "3 0 2 3 1 2 3 4 5\n", "line 8: '5' not expected");
  refuse("1 1 0\n", "1 1 0 x\n", "line 5: 'x' not expected");
  refuse("1 1 0\n", "1 1,5 0\n", "line 5: vertex 2");
  for (const std::string bad : {"nan", "inf", "-inf", "1e999"}) {
    refuse("1 1 0\n", "1 " + bad + " 0\n", "line 5: vertex 2: '" + bad + "' is no finite number");
  }
  refuse("1 1 0\n", "1 -1e76 0\n", "line 5: vertex 2: '-1e76' is larger than 1e75 in magnitude");
  refuse("1 1 0\n", "1 1\n", "line 5: vertex 2: number missing");
  refuse("4 2 0\n", "4 2 0 7\n", "line 2: ");
  refuse("4 2 0\n", "4 2.5 0\n", "line 2: ");
  refuse("4 2 0\n", "4 1e300 0\n", "line 2: ");
  for (const std::string bad : {"1.5", "1e300", "-1", "4", "x", "4294967296", "99999999999999999999"})
    refuse("3 0 2 3\n", "3 0 2 " + bad + "\n", "line 8: face 1");
  for (const std::string bad : {"3.5", "1e300", "-1", "99999999999", "x"}) {
    refuse("3 0 2 3\n", bad + " 0 2 3\n", "line 8: face 1");
  }
  EXPECT_EQ(readOff(replaced(kOff, "3 0 2 3\n", "3 0 2 3 0.5 0.5 1 1 # red\n\n# the end\n")).ends.size(), 2u);
  EXPECT_EQ(readOff(replaced(kOff, "1 1 0\n", "1 1 0 1 2 3 4 5 6 7 8 9\n")).vertices.size(), 4u);
  refuse("1 1 0\n", "1 1 0 1 2 3 4 5 6 7 8 9 10\n", "line 5: '10' not expected");
  // A line for each is no free form, even where that could be read.
  refuse("1 1 0\n0 1 0\n", "1 1\n0 0 1 0\n", "line 5: vertex 2: number missing");
  expectComplaint(Format::kOff, "OFF\n3 1 0 0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "line 2: numbers of vertices");
  EXPECT_EQ(sizes(readOff(replaced(kOff, "3 0 2 3\n", "0\n"))), (Sizes{3, 0}));
}

TEST(ReadObj, ReadsGeometryOnly) {
  const Polygons p = readObj(
      "mtllib /dev/zero\r\nusemtl a\r\no name with blanks\r\n# a comment\r\nv 0 0 0 # and more\r\nv 1 0 0 2\n"
      "v 1 1 0 0.5 0.5 0.5\nv 0 1 0 1 1 0 0\nvt 0 0\n\n  f 1/1 2/1/1 3//1 \\\n 4\nf -4 -3 -2\nf 1 2 5\nv 7 8 9\nl 1 "
      "2\np 1\n");
  ASSERT_EQ(p.vertices.size(), 5u);
  EXPECT_EQ(p.vertices[1], Eigen::Vector3d(0.5, 0, 0)) << "w is 2";
  EXPECT_EQ(p.vertices[2], Eigen::Vector3d(1, 1, 0));
  EXPECT_EQ(p.corners, (Corners{0, 1, 2, 3, 0, 1, 2, 0, 1, 4}));
  EXPECT_EQ(sizes(p), (Sizes{4, 3, 3}));
  EXPECT_EQ(readObj("v 0.1234567890123456 1e-300 0\n").vertices[0], Eigen::Vector3d(0.1234567890123456, 1e-300, 0));
  EXPECT_EQ(sizes(readObj("v 0 0 0\nv 1 0 0\nv 0 1 0\nfo 1 2 3\nf 1/ 2// 3/1/\nf 1 2\\\r\n3 \\\r\n 1\nf 1 2 3 \\")),
            (Sizes{3, 3, 4, 3}));
  // A comment ends with its line, whatever its last character is.
  EXPECT_EQ(readObj("# C:\\meshes\\\nv 1 2 3\nv 4 5 6 # mm\\\nv 7 8 9\n").vertices.size(), 3u);
}

TEST(ReadObj, RefusesWhatIsNoNumberAndNoIndex) {
  const auto refuse = [](const std::string& what, const std::string& by, const std::string& about) {
    expectComplaint(Format::kObj, replaced(kObj, what, by), about);
  };
  for (const std::string bad : {"v 1,5 1 0", "v 1 1", "v 1 1 0,5", "v 1 1 x", "v 1 1 nan", "v 1 1 1e999", "v 1 1 0 0",
                                "v 1 1 0 1 1", "v 1 1 0 1 1 1 1 1"}) {
    refuse("v 1 1 0", bad, "line 5: vertex 2: ");
  }
  for (const std::string bad :
       {"0", "5", "-5", "1.5", "1e3", "3/x", "3/1/1/1", "3/1/", "/1", "1,2", "99999999999999999999"}) {
    if (bad != "3/1/") refuse("f 1 3 4", "f 1 3 " + bad, "line 9: ");
  }
  for (const std::string bad : {"+-1", "4294967296", "18446744073709551618"})
    refuse("f 1 3 4", "f 1 3 " + bad, "line 9: ");
  refuse("f 1 3 4", "f 1 3 77", "line 9: vertex index 77 out of range, there are 4 vertices");
  refuse("v 1 1 0", "v 1 +-1 0", "line 5: vertex 2: ");
  refuse("v 1 1 0", "v 1 1 0 0", "lies at infinity (w is 0)");
  refuse("v 1 1 0", "v 1e74 1 0 0.01", "a coordinate divided by w is larger than 1e75");
  EXPECT_EQ(readObj("v 1e75 -1e75 0\n").vertices.size(), 1u);
  refuse("f 1 3 4", "f 1 3", "line 9: a face has at least three corners");
  refuse("f 1 3 4", "f", "line 9: a face has at least three corners");
  refuse("f 1 3 4", "f 1 3 4\nrubbish", "line 10: no OBJ statement: 'rubbish'");
  refuse("f 1 3 4", "surf 0 1 0 1 1 2 3", "line 9: free-form surfaces");
}

TEST(ReadObj, TakesWeightsAndColours) {
  const auto second = [](const std::string& line) { return readObj(replaced(kObj, "v 1 0 0", line)).vertices.at(1); };
  EXPECT_EQ(second("v 1 0 0 0.5"), Eigen::Vector3d(2, 0, 0));
  EXPECT_EQ(second("v 1 0 0 0 0.5 0.5"), Eigen::Vector3d(1, 0, 0));
  EXPECT_EQ(second("v 1 0 0 0 0.5 0.5 1"), Eigen::Vector3d(1, 0, 0));  // as some write r g b a
  expectComplaint(Format::kObj, replaced(kObj, "v 1 0 0", "v 1 0 0 1 1"), "line 4: vertex 1: 3, 4, 6 or 7 numbers");
}

TEST(ReadMesh, SkipsAByteOrderMark) {
  const std::string mark = "\xEF\xBB\xBF";
  for (const auto& [format, text] : {std::pair{Format::kObj, kObj}, std::pair{Format::kOff, kOff},
                                     std::pair{Format::kPly, kPly}, std::pair{Format::kStl, kStl}}) {
    EXPECT_EQ(readMesh(mark + text, format).ends.size(), 2u);
  }
  EXPECT_EQ(readStl(mark + binaryStl().substr(3)).ends.size(), 1u);
}

TEST(ReadMesh, TakesCarriageReturnsAsEndsOfLines) {
  const auto cr = [](std::string text) {
    std::replace(text.begin(), text.end(), '\n', '\r');
    return text;
  };
  for (const auto& [format, text] :
       {std::pair{Format::kObj, "# a comment\n" + kObj}, std::pair{Format::kOff, replaced(kOff, "1 1", "1 1 0 # 1\n#")},
        std::pair{Format::kPly, kPly}, std::pair{Format::kStl, kStl + kStl}}) {
    const Polygons expected = readMesh(text, format);
    const Polygons polygons = readMesh(cr(text), format);
    EXPECT_EQ(polygons.vertices, expected.vertices);
    EXPECT_EQ(polygons.corners, expected.corners);
  }
  EXPECT_EQ(sizes(readObj(cr(replaced(kObj, "1 3 4", "1 3 \\\n4")))), (Sizes{3, 3}));
  expectComplaint(Format::kObj, cr(replaced(kObj, "1 3 4", "1 3")), "line 9: a face has at least three corners");
  expectComplaint(Format::kPly, cr(replaced(kPly, "3 0 2 3", "3 0 2 4")), "line 15: face 1: vertex index 4");

  // Binary data after a header of such lines may begin with a line feed.
  const std::string ply = binaryPly();
  const std::size_t head = ply.find("end_header\n") + 11;
  std::string line_feeds(48, '\n');
  line_feeds = cr(ply.substr(0, head)) + line_feeds + ply.substr(head + 48);
  EXPECT_EQ(readPly(line_feeds).ends.size(), 2u);
  EXPECT_EQ(readPly(cr(ply.substr(0, head)) + ply.substr(head)).vertices, readPly(ply).vertices);
}

TEST(ReadOff, ReadsFreeForm) {
  const Polygons expected = readOff(kOff);
  for (const std::string text : {"OFF 4 2 0 0 0 0 1 0 0 1 1 0 0 1 0 3 0 1 2 3 0 2 3",
                                 "OFF\n4 2 0\n0 0 0 1 0 0\n1 1 0 0 1 0 # a\n\n3 0 1 2\n3 0 2 3\n",
                                 "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 3 0 2 3\n",
                                 "4 2 0\n0 0\n0 1 0 0 1 1 0 0 1 0\n3\n0 1 2 3 0 2 3\n"}) {
    EXPECT_EQ(readOff(text).vertices, expected.vertices) << text;
    EXPECT_EQ(readOff(text).corners, expected.corners) << text;
    for (const std::string end : {"9", "x"}) {
      EXPECT_THROW(readOff(text + " " + end), std::runtime_error) << text;
    }
    EXPECT_THROW(readOff(text.substr(0, text.rfind('3'))), std::runtime_error) << text;
  }
  EXPECT_THROW(readOff("OFF 4 2 0 0 0 0 1 0 0 1 1 0 0 1 0 3 0 1 2 0"), std::runtime_error) << "a face of no corners";
  // Colours ask for a line each, and messages are about lines.
  expectComplaint(Format::kOff, "COFF\n4 2 0\n0 0 0 1 0 0\n1 1 0 0 1 0\n3 0 1 2\n3 0 2 3\n", "truncated: 0 of 2 faces");
  expectComplaint(Format::kOff, "OFF\n4 2 0\n0 0 0 1 0 0\n1 1 0 0 1 0\n3 0 1 2\n3 0 2 4\n", "truncated: 0 of 2 faces");
}

TEST(ReadStl, RefusesRubbish) {
  expectComplaint(Format::kStl, kStl + "rubbish\n", "line 17: 'solid' expected, not 'rubbish'");
  expectComplaint(Format::kStl, binaryStl() + "x", "byte 134: there is more");
  expectComplaint(Format::kStl, replaced(kStl, "vertex 1 0 0", "vertex 1,5 0 0"), "line 5: vertex 1: '1,5'");
  expectComplaint(Format::kStl, replaced(kStl, "vertex 1 0 0", "vertex nan 0 0"), "line 5: vertex 1: 'nan'");
  expectComplaint(Format::kStl, replaced(kStl, "vertex 1 0 0", "vertex 1 0"),
                  "line 6: vertex 1: 'vertex' is no finite");
  expectComplaint(Format::kStl, replaced(kStl, "endloop", "vertex 0 0 1\nendloop"), "line 7: 'endloop' expected");
  std::string nan = binaryStl();
  const float bad = std::numeric_limits<float>::quiet_NaN();
  std::memcpy(nan.data() + 84 + 24, &bad, sizeof(bad));
  expectComplaint(Format::kStl, nan, "byte 108: vertex 1 of triangle 0 is not finite");
  const std::string text = "# a mesh\n" + kStl;
  for (const std::string& rubbish : {text, text.substr(0, 50), "<!DOCTYPE html><title>\xd0\xaf</title>" + text}) {
    expectComplaint(Format::kStl, rubbish, "neither text that begins with 'solid' nor binary");
  }
  expectComplaint(Format::kStl, binaryStl().substr(0, 100), "truncated: 0 of 1 triangles");
  for (const std::string normal : {"-1.#IND -1.#IND 1.#QNAN", "nan nan nan", "-nan(ind) x 1e999"}) {
    EXPECT_EQ(readStl(replaced(kStl, "normal 0 0 1", "normal " + normal)).ends.size(), 2u);
  }
  expectComplaint(Format::kStl, replaced(kStl, "normal 0 0 1", "normal 0 1"), "line 3: a normal of three numbers");
  EXPECT_EQ(readStl(kStl + replaced(kStl, "solid s", "SOLID")).ends.size(), 4u);
  // Binary although it begins like a text: the number of triangles fits.
  const std::string named = "solid" + binaryStl().substr(5);
  EXPECT_EQ(readStl(named).ends.size(), 1u);
  expectComplaint(Format::kStl, named + "\r\n", "byte 134: there is more");
  expectComplaint(Format::kStl, "solid s" + binaryStl().substr(7) + "x", "byte 134: there is more");
  EXPECT_EQ(readStl(binaryStl()).vertices.size(), 3u);
}

// Whatever the bytes are: polygons with indices in range, or a std::runtime_error.
TEST(ReadMesh, SurvivesMutations) {
  const std::string full_dae = dae(
      kTriangles + "<polylist count=\"2\">" + kInput + "<vcount>4 3</vcount><p>0 1 2 3 0 1 4</p></polylist>" +
          "<tristrips count=\"1\">" + kInput + "<p>0 1 3 2 4</p></tristrips>",
      R"(<node><rotate>1 0 0 90</rotate><scale>1 2 3</scale><instance_node url="#l"/></node>)" + kNode,
      R"(<unit meter="0.01"/>)", R"(<library_nodes><node id="l"><instance_geometry url="#g"/></node></library_nodes>)");
  const std::vector<std::pair<Format, std::string>> seeds = {
      {Format::kOff, kOff}, {Format::kObj, kObj},        {Format::kPly, kPly},    {Format::kPly, binaryPly()},
      {Format::kStl, kStl}, {Format::kStl, binaryStl()}, {Format::kDae, full_dae}};
  const std::vector<std::string> splices = {"0",
                                            "-1",
                                            "1e300",
                                            "4294967296",
                                            "99999999999",
                                            "nan",
                                            ".5",
                                            "1,5",
                                            " ",
                                            "\n",
                                            "\\\n",
                                            "<",
                                            "</",
                                            "/>",
                                            "#",
                                            "\"",
                                            "&a;",
                                            std::string(4, '\xff'),
                                            std::string(3, '\0'),
                                            "<node>",
                                            "<p>",
                                            "tristrips",
                                            "list",
                                            "f 1 2 3\n"};
  std::mt19937 random(5);
  const auto below = [&random](std::size_t n) { return static_cast<std::size_t>(random() % n); };
  int read = 0;
  int refused = 0;
  for (int i = 0; i < 40000; ++i) {
    const auto& [format, seed] = seeds[below(seeds.size())];
    std::string bytes = seed;
    for (std::size_t k = 1 + below(3); k > 0 && !bytes.empty(); --k) {
      const std::size_t at = below(bytes.size());
      const std::size_t length = std::min(below(20), bytes.size() - at);
      switch (below(6)) {
        case 0:
          bytes[at] = static_cast<char>(bytes[at] ^ (1 << below(8)));
          break;
        case 1:
          bytes[at] = static_cast<char>(random());
          break;
        case 2:
          bytes.resize(at);
          break;
        case 3:
          bytes.erase(at, length);
          break;
        case 4:
          bytes.insert(below(bytes.size()), bytes.substr(at, length));
          break;
        default:
          bytes.insert(at, splices[below(splices.size())]);
      }
    }
    try {
      const Polygons polygons = readMesh(bytes, format);
      for (const std::uint32_t c : polygons.corners) ASSERT_LT(c, polygons.vertices.size());
      std::size_t begin = 0;
      for (const std::size_t end : polygons.ends) {
        ASSERT_LE(begin, end);
        begin = end;
      }
      ASSERT_EQ(begin, polygons.corners.size());
      triangulate(polygons);
      ++read;
    } catch (const std::runtime_error&) {
      ++refused;
    }
  }
  EXPECT_GT(read, 1000);
  EXPECT_GT(refused, 10000);
}

}  // namespace
}  // namespace bocst::io
