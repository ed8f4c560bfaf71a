// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/io.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <clocale>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "io/file.h"
#include "mesh_files.h"
#include "temporary_folder.h"

namespace bocst {
namespace {

namespace fs = std::filesystem;
using namespace test;

class LoadMesh : public ::testing::Test, protected TemporaryFolder {
 protected:
  std::shared_ptr<const Mesh> load(const std::string& name, const std::string& content) const {
    return loadMesh(write(name, content));
  }

  /// What loading says; it must name the file.
  std::string complaint(const std::string& file) const {
    try {
      const auto mesh = loadMesh(file);
      ADD_FAILURE() << file << " was read: " << mesh->triangleCount() << " triangles";
    } catch (const std::runtime_error& e) {
      EXPECT_EQ(std::string(e.what()).rfind(file + ": ", 0), 0u) << e.what();
      EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos) << e.what();
      return e.what();
    }
    return {};
  }

  void expectComplaint(const std::string& name, const std::string& content, const std::string& about) const {
    const std::string what = complaint(write(name, content));
    EXPECT_NE(what.find(about), std::string::npos) << what;
  }
};

void expectSquare(const Mesh& mesh) {
  ASSERT_EQ(mesh.vertexCount(), 4u);
  ASSERT_EQ(mesh.triangleCount(), 2u);
  EXPECT_EQ(mesh.bounds().min(), Eigen::Vector3d(0, 0, 0));
  EXPECT_EQ(mesh.bounds().max(), Eigen::Vector3d(1, 1, 0));
}

double areaOf(const Mesh& mesh) {
  double area = 0;
  for (const Mesh::Indices& t : mesh.triangles()) {
    area += (mesh.vertex(t[1]) - mesh.vertex(t[0])).cross(mesh.vertex(t[2]) - mesh.vertex(t[0])).norm() / 2;
  }
  return area;
}

const std::string kObj = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n";
const std::string kDae = R"(<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="1" name="meter"/><up_axis>Y_UP</up_axis></asset>
<library_geometries><geometry id="g" name="g"><mesh>
<source id="p"><float_array id="pa" count="12">0 0 0 1 0 0 1 1 0 0 1 0</float_array><technique_common>
<accessor source="#pa" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="2"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2 0 2 3</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n"><translate>10 0 0</translate><instance_geometry url="#g"/></node>
<node id="m"><translate>0 0 20</translate><instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>
)";

std::string binaryStl() {
  std::string stl(80, 's');
  append(stl, std::uint32_t{2});
  for (const auto& t :
       {std::array<float, 9>{0, 0, 0, 1, 0, 0, 1, 1, 0}, std::array<float, 9>{0, 0, 0, 1, 1, 0, 0, 1, 0}}) {
    for (const float n : {0.f, 0.f, 1.f}) append(stl, n);
    for (const float x : t) append(stl, x);
    append(stl, std::uint16_t{0});
  }
  return stl;
}

const std::string kPointer = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 123456\n";

std::string gltfBuffer() {
  std::string buffer;
  for (const float x : {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}) append(buffer, x);
  for (const std::uint16_t i : {0, 1, 2, 0, 2, 3}) append(buffer, i);
  return buffer;
}

/// A square whose buffer is in another file, or in the GLB if `uri` is empty.
std::string gltf(const std::string& uri) {
  return R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}],
"buffers":[{)" +
         (uri.empty() ? "" : "\"uri\":\"" + uri + "\",") +
         R"("byteLength":60}],"bufferViews":[{"buffer":0,"byteLength":48},
{"buffer":0,"byteOffset":48,"byteLength":12}],"accessors":[{"bufferView":0,"componentType":5126,"count":4,
"type":"VEC3","min":[0,0,0],"max":[1,1,0]},{"bufferView":1,"componentType":5123,"count":6,"type":"SCALAR"}]})";
}

std::string glb(std::string json) {
  const std::string buffer = gltfBuffer();
  json.resize((json.size() + 3) / 4 * 4, ' ');
  std::string glb = "glTF";
  for (const std::size_t n : {std::size_t{2}, 12 + 8 + json.size() + 8 + buffer.size(), json.size()}) {
    append(glb, static_cast<std::uint32_t>(n));
  }
  glb += "JSON" + json;
  append(glb, static_cast<std::uint32_t>(buffer.size()));
  return glb + std::string("BIN\0", 4) + buffer;
}

/// A ZIP archive of files that are stored as they are.
std::string zip(const std::vector<std::pair<std::string, std::string>>& files) {
  std::string archive;
  std::string directory;
  for (const auto& [name, content] : files) {
    std::uint32_t crc = ~0u;
    for (const char c : content) {
      crc ^= static_cast<unsigned char>(c);
      for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ (crc & 1u ? 0xedb88320u : 0);
    }
    std::string head;  // what the file's own header and the directory have in common
    for (const int field : {20, 0, 0, 0, 33}) append(head, static_cast<std::uint16_t>(field));
    append(head, ~crc);
    for (int i = 0; i < 2; ++i) append(head, static_cast<std::uint32_t>(content.size()));
    append(head, static_cast<std::uint16_t>(name.size()));
    append(head, std::uint16_t{0});
    directory += std::string("PK\1\2\24\0", 6) + head + std::string(10, '\0');
    append(directory, static_cast<std::uint32_t>(archive.size()));
    directory += name;
    archive += "PK\3\4" + head + name + content;
  }
  std::string end = std::string("PK\5\6\0\0\0\0", 8);
  for (int i = 0; i < 2; ++i) append(end, static_cast<std::uint16_t>(files.size()));
  append(end, static_cast<std::uint32_t>(directory.size()));
  append(end, static_cast<std::uint32_t>(archive.size()));
  return archive + directory + end + std::string(2, '\0');
}

TEST_F(LoadMesh, ReadsEachFormat) {
  expectSquare(*load("square.off", kOff));
  expectSquare(
      *load("square.OFF", "# a comment\nOFF 4 2 0\n\n0 0 0\n1 0 0 # and more\n1 1 0\n0 1 0\n3 0 1 2 255 0 0\n3 0 2 3"));
  expectSquare(*load("square.obj", kObj));
  expectSquare(*load("relative.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf -4 -3 -2\nf 1 3 4\n"));
  expectSquare(*load("square.ply", kPly));
  expectSquare(*load("little.ply", binaryPly()));
  expectSquare(*load("big.ply", binaryPly(true)));
  expectSquare(*load("text.stl", kStl));
  expectSquare(*load("binary.stl", binaryStl()));
}

TEST_F(LoadMesh, PutsMeshesWhereTheirNodesAre) {
  const auto mesh = load("two.dae", kDae);
  EXPECT_EQ(mesh->vertexCount(), 8u);
  EXPECT_EQ(mesh->triangleCount(), 4u);
  EXPECT_EQ(mesh->bounds().min(), Eigen::Vector3d(0, 0, 0));
  EXPECT_EQ(mesh->bounds().max(), Eigen::Vector3d(11, 1, 20));
}

TEST_F(LoadMesh, KeepsVerticesAndTheirOrder) {
  // Vertices that coincide, or that no face uses, stay: ids in contacts are those of the file.
  const auto off = load("m.off", "OFF\n6 2 0\n9 9 9\n0 0 0\n1 0 0\n1 1 0\n0 0 0\n0 1 0\n3 1 2 3\n3 4 3 5\n");
  ASSERT_EQ(off->vertexCount(), 6u);
  EXPECT_EQ(off->indices(1), (Mesh::Indices{4, 3, 5}));
  EXPECT_EQ(off->bounds().max(), Eigen::Vector3d(1, 1, 0));
}

TEST_F(LoadMesh, TakesNoMoreMemoryThanTheMeshNeeds) {
  std::string obj, stl = "solid\n";
  for (int i = 0; i < 100; ++i) {
    const std::string x = std::to_string(i) + " 0 0\n", y = std::to_string(i) + " 1 0\n", z = "0 0 " + x;
    obj += "v " + x + "v " + y + "v 0 1 " + std::to_string(i) + "\nf -1 -2 -3\n";
    stl += "facet normal 0 0 1\nouter loop\nvertex " + x + "vertex " + y + "vertex 0 1 " + std::to_string(i) +
           "\nendloop\nendfacet\n";
  }
  for (const auto& mesh : {load("m.obj", obj), load("m.stl", stl + "endsolid\n")}) {
    EXPECT_EQ(mesh->bytes(), 24 * mesh->vertexCount() + 12 * mesh->triangleCount());
  }
}

TEST_F(LoadMesh, KeepsNeighboursApart) {
  const auto mesh = load("tiny.obj", "v 0 0 0\nv 1e-7 0 0\nv 0 1e-7 0\nv 1e-7 1e-7 0\nf 1 2 3\nf 2 4 3\n");
  EXPECT_EQ(mesh->vertexCount(), 4u);
}

TEST_F(LoadMesh, ReadsOffAndPlyInDoublePrecision) {
  const std::string numbers = "0.1234567890123456 1e-300 123456789.123\n1 0 0\n+1 1 0\n";
  for (const auto& mesh :
       {load("p.off", "OFF\n3 1 0\n" + numbers + "3 0 1 2\n"),
        load("p.ply",
             "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty double y\nproperty double z\n"
             "element face 1\nproperty list uchar int vertex_index\nend_header\n" +
                 numbers + "3 0 1 2\n")}) {
    EXPECT_EQ(mesh->vertex(0), Eigen::Vector3d(0.1234567890123456, 1e-300, 123456789.123));
  }
}

TEST_F(LoadMesh, CutsPolygonsAlongTheirOutline) {
  // An arrow head (concave), an L of six corners, and a polygon of twelve.
  EXPECT_DOUBLE_EQ(areaOf(*load("arrow.off", "OFF\n4 1 0\n0 0 1\n2 -2 1\n0 2 1\n-2 -2 1\n4 0 1 2 3\n")), 4);
  EXPECT_DOUBLE_EQ(areaOf(*load("l.off", "OFF\n6 1 0\n0 0 0\n0 0 2\n0 1 2\n0 1 1\n0 2 1\n0 2 0\n6 0 1 2 3 4 5\n")), 3);
  EXPECT_DOUBLE_EQ(areaOf(*load("quad.obj", "v 0 0 1\nv 2 -2 1\nv 0 2 1\nv -2 -2 1\nf 1 2 3 4\n")), 4);
  std::string corners;
  std::string face = "12";
  for (int i = 0; i < 12; ++i) {
    corners += std::to_string(std::cos(i * M_PI / 6)) + " " + std::to_string(std::sin(i * M_PI / 6)) + " 0\n";
    face += " " + std::to_string(i);
  }
  const auto mesh = load("twelve.off", "OFF\n12 1 0\n" + corners + face + "\n");
  EXPECT_EQ(mesh->triangleCount(), 10u);
  EXPECT_NEAR(areaOf(*mesh), 3, 1e-5);
}

TEST_F(LoadMesh, KeepsDegenerateTrianglesAndSkipsPointsAndLines) {
  EXPECT_EQ(load("d.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 1 1\nf 1 2 2\nf 1 2 3\np 1\nl 1 2\n")->triangleCount(), 3u);
  EXPECT_EQ(load("d.off", "OFF\n3 4 0\n0 0 0\n1 0 0\n1 1 0\n1 0\n2 0 1\n3 0 0 1\n3 0 1 2\n")->triangleCount(), 2u);
  EXPECT_EQ(load("flat.off", "OFF\n4 1 0\n0 0 0\n1 0 0\n2 0 0\n3 0 0\n4 0 1 2 3\n")->triangleCount(), 2u);
}

TEST_F(LoadMesh, RefusesWhatIsNoFile) {
  EXPECT_NE(complaint((folder_ / "missing.obj").string()).find("no such file"), std::string::npos);
  for (const char* name : {"folder.off", "folder.obj"}) {
    fs::create_directory(folder_ / name);
    EXPECT_NE(complaint((folder_ / name).string()).find("directory"), std::string::npos);
  }
}

TEST_F(LoadMesh, ReadsFilesOfUnknownSize) {
  for (const char* ending : {"obj", "stl"}) expectComplaint(std::string("empty.") + ending, "", "is empty");
  EXPECT_GT(io::readFile("/proc/self/status").size(), 100u) << "the system says that it has no bytes";
}

TEST_F(LoadMesh, NeverWaits) {
  for (const char* name : {"fifo.off", "fifo.obj", "fifo.dae", "fifo.glb"}) {
    ASSERT_EQ(mkfifo((folder_ / name).c_str(), 0600), 0);
    EXPECT_NE(complaint((folder_ / name).string()).find("is a FIFO"), std::string::npos);
  }
  fs::create_symlink("/dev/zero", folder_ / "zero.ply");
  EXPECT_NE(complaint((folder_ / "zero.ply").string()).find("is a device"), std::string::npos);
  const int s = socket(AF_UNIX, SOCK_STREAM, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string file = (folder_ / "socket.stl").string();
  ASSERT_LT(file.size(), sizeof(address.sun_path));
  std::copy(file.begin(), file.end(), address.sun_path);
  ASSERT_EQ(bind(s, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
  EXPECT_NE(complaint(file).find("is a socket"), std::string::npos);
  close(s);
}

TEST_F(LoadMesh, ReadsNoMaterials) {
  ASSERT_EQ(mkfifo((folder_ / "fifo.mtl").c_str(), 0600), 0);
  for (const char* library : {"fifo.mtl", "/dev/zero", ".", "missing.mtl"}) {
    expectSquare(*load("m.obj", "mtllib " + std::string(library) + "\nusemtl a\n" + kObj));
  }
}

TEST_F(LoadMesh, ReadsWhatAssimpReads) {
  write("square.bin", gltfBuffer());
  expectSquare(*load("square.gltf", gltf("square.bin")));
  expectSquare(*load("square.glb", glb(gltf(""))));
  expectSquare(*load(
      "square.3mf",
      zip({{"_rels/.rels",
            R"(<?xml version="1.0"?><Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">
<Relationship Target="/3D/3dmodel.model" Id="r" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>
</Relationships>)"},
           {"3D/3dmodel.model",
            R"(<?xml version="1.0"?><model unit="meter"><resources><object id="1" type="model"><mesh><vertices>
<vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/><vertex x="1" y="1" z="0"/><vertex x="0" y="1" z="0"/></vertices>
<triangles><triangle v1="0" v2="1" v3="2"/><triangle v1="0" v2="2" v3="3"/></triangles></mesh></object></resources>
<build><item objectid="1"/></build></model>)"}})));

  // No way past the readers here by another name.
  complaint(write("square.xyz", kObj));
  complaint(write("square", kDae));
}

TEST_F(LoadMesh, OpensBuffersInTheFolderOnly) {
  fs::create_directory(folder_ / "a%20b");
  write("a%20b/my part%.bin", gltfBuffer());
  expectSquare(*load("a%20b/blank.gltf", gltf("my%20part%25.bin")));
  expectSquare(*load("a%20b/literal.gltf", gltf("my part%.bin")));
  write("square.bin", gltfBuffer());
  for (const char* uri : {"../square.bin", "%2e%2E%2fsquare.bin", "../missing.bin"}) {
    expectComplaint("a%20b/out.gltf", gltf(uri), "is outside the folder");
  }
  complaint(write("a%20b/far.gltf", gltf((folder_ / "square.bin").string())));
  ASSERT_EQ(mkfifo((folder_ / "fifo.bin").c_str(), 0600), 0);
  expectComplaint("fifo.gltf", gltf("fifo.bin"), "'fifo.bin' is a FIFO");
  write("pointer.bin", kPointer);
  expectComplaint("pointer.gltf", gltf("pointer.bin"), "is a Git LFS pointer");
  expectComplaint("missing.gltf", gltf("%6dissing%0.bin"), "no such file");
  const fs::path before = fs::current_path();
  fs::current_path(folder_);
  EXPECT_NE(complaint("missing.gltf").find("no such file"), std::string::npos);
  fs::current_path(before);
}

TEST_F(LoadMesh, RefusesGltfThatAssimpMisreads) {
  const auto with = [](const std::string& members) {
    return glb(replaced(gltf(""), "{\"mesh\":0}", "{\"mesh\":0,\"skin\":0}, {}").insert(1, members + ","));
  };
  const auto extensions = [](const std::string& list, const std::string& name) {
    return gltf("square.bin").insert(1, "\"" + list + "\":[\"KHR_materials_unlit\",\"" + name + "\"],");
  };
  write("square.bin", gltfBuffer());
  for (const std::string name : {"KHR_mesh_quantization", "EXT_mesh_gpu_instancing"}) {
    expectComplaint("used.gltf", extensions("extensionsUsed", name), "extension '" + name + "' is not supported");
    expectComplaint("used.glb", glb(extensions("extensionsUsed", name)), name);
  }
  for (const std::string name : {"KHR_mesh_quantization", "EXT_meshopt_compression", "XYZ_unknown"}) {
    expectComplaint("required.gltf", extensions("extensionsRequired", name), name);
    // The content of a GLB tells, whatever the name.
    expectComplaint("required.bin", glb(extensions("extensionsRequired", name)), "'" + name + "' is not supported");
  }
  for (const std::string name : {"KHR_texture_transform", "EXT_texture_webp", "KHR_lights_punctual"}) {
    expectSquare(*load("harmless.gltf", extensions("extensionsRequired", name)));
  }
  expectSquare(*load("used.gltf", extensions("extensionsUsed", "EXT_meshopt_compression")));
  const std::string draco =
      replaced(gltf(""), "\"indices\"",
               R"("extensions":{"KHR_draco_mesh_compression":{"bufferView":0,"attributes":{"POSITION":0}}},"indices")");
  expectComplaint("draco.glb", glb(replaced(draco, "5123", "5125")), "Draco with indices of 32 bits is not supported");
  expectComplaint("skin.glb", with(R"("skins":[{"joints":[1]}])"), "skin without inverseBindMatrices");
  expectComplaint("skin.glb", with(R"("skins":[{"joints":[1],"inverseBindMatrices":"2"}])"), "inverseBindMatrices");
}

TEST_F(LoadMesh, RefusesMalformedGltf) {
  write("square.bin", gltfBuffer());
  const std::string json = gltf("square.bin");
  for (std::size_t size = 1; size < json.size(); size += 5) {
    expectComplaint("cut.gltf", json.substr(0, size), "no glTF file: malformed JSON");
    complaint(write("cut.glb", glb(json).substr(0, size)));
  }
  expectComplaint("bad.gltf", replaced(json, "\"meshes\"", "meshes"), "line 2: no glTF file: malformed JSON");
  expectComplaint("bad.gltf", replaced(json, "60", "1e999"), "a number that is too large");
  expectComplaint("bad.gltf", replaced(json, "square", "\xff"), "malformed JSON");
  expectComplaint("list.gltf", "[1, 2]", "its JSON is no object");
  for (const char* list : {"7", "{}"}) {
    complaint(write("list.gltf", std::string(json).insert(1, "\"extensionsRequired\":" + std::string(list) + ",")));
  }
  for (const std::string open : {"[", "{\"a\":"}) {
    std::string deep = "{\"extras\":";
    for (int i = 0; i < 200000; ++i) deep += open;
    expectComplaint("deep.gltf", deep, "JSON nested deeper than 256");
    expectComplaint("deep.glb", glb(deep), "JSON nested deeper than 256");
  }
}

TEST_F(LoadMesh, RefusesAmfThatPlacesItsObjects) {
  std::string amf = "<amf unit=\"millimeter\"><!-- <constellation --><object id=\"0\"><mesh><vertices>";
  for (const char* corner : {"<x>0</x><y>0</y>", "<x>1</x><y>0</y>", "<x>1</x><y>1</y>", "<x>0</x><y>1</y>"}) {
    amf += std::string("<vertex><coordinates>") + corner + "<z>0</z></coordinates></vertex>";
  }
  amf +=
      "</vertices><volume><triangle><v1>0</v1><v2>1</v2><v3>2</v3></triangle>"
      "<triangle><v1>0</v1><v2>2</v2><v3>3</v3></triangle></volume></mesh></object></amf>";
  expectSquare(*load("square.amf", amf));
  expectComplaint("placed.amf",
                  replaced(amf, "</amf>",
                           "<constellation id=\"1\"><instance objectid=\"0\"><deltax>9</deltax></instance>"
                           "</constellation></amf>"),
                  "<constellation> is not supported: export as 3MF");
}

TEST_F(LoadMesh, KnowsAGitLfsPointer) {
  for (const char* ending : {"obj", "ply", "stl", "off", "dae", "glb", "gltf", "3mf", "amf", "fbx"}) {
    expectComplaint(std::string("pointer.") + ending, kPointer, "is a Git LFS pointer");
  }
}

TEST_F(LoadMesh, ReadsAPointInEveryLocale) {
  // A locale whose decimals have a comma, made here.
  const std::string source =
      write("source", "LC_NUMERIC\ndecimal_point \",\"\nthousands_sep \".\"\ngrouping 3\nEND LC_NUMERIC\n");
  const std::string make =
      "localedef -c -i " + source + " -f ANSI_X3.4-1968 " + (folder_ / "comma").string() + " > " + source + ".log 2>&1";
  if (std::system(make.c_str()) == -1) FAIL() << make;  // it misses categories
  ASSERT_EQ(setenv("LOCPATH", folder_.c_str(), 1), 0);
  ASSERT_NE(std::setlocale(LC_NUMERIC, "comma"), nullptr) << make << " (Debian: locales)";
  ASSERT_EQ(std::string(std::localeconv()->decimal_point), ",");
  const auto half = [](std::string text) {
    for (std::size_t at = 0; (at = text.find("1 1 0", at)) != std::string::npos; at += 7) text.replace(at, 1, "0.5");
    return text;
  };
  for (const auto& [name, content] : {std::pair("h.off", kOff), std::pair("h.obj", kObj), std::pair("h.ply", kPly),
                                      std::pair("h.stl", kStl), std::pair("h.dae", kDae)}) {
    const double shift = content == kDae ? 10 : 0;
    EXPECT_EQ(load(name, half(content))->vertex(2), Eigen::Vector3d(0.5 + shift, 1, 0)) << name;
  }
  expectComplaint("large.off", "OFF\n3 1 0\n0 0 0\n1 1.5e999 0\n1 1 0\n3 0 1 2\n", "line 4: vertex 1");
  const auto gltf = R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
"nodes":[{"mesh":0,"translation":[0.5,0,0]}],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
"buffers":[{"uri":"h.bin","byteLength":36}],"bufferViews":[{"buffer":0,"byteLength":36}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}]})";
  std::string buffer;
  for (const float x : {0, 0, 0, 1, 0, 0, 1, 1, 0}) append(buffer, x);
  write("h.bin", buffer);
  EXPECT_EQ(load("h.gltf", gltf)->bounds().min(), Eigen::Vector3d(0.5, 0, 0));
  std::setlocale(LC_NUMERIC, "C");
  unsetenv("LOCPATH");
}

TEST_F(LoadMesh, RefusesWhatIsNoMesh) {
  for (const char* extension : {"off", "obj", "ply", "stl", "dae"}) {
    expectComplaint(std::string("empty.") + extension, "", "empty");
    expectComplaint(std::string("blank.") + extension, "\n\n \n", "");
    expectComplaint(std::string("text.") + extension, "this is a letter, not a mesh\n", "");
    expectComplaint(std::string("zeros.") + extension, std::string(1000, '\0'), "");
  }
  expectComplaint("mesh.xyz", "hello", "");
  expectComplaint("mesh", "hello", "");
  expectComplaint("points.obj", "v 0 0 0\nv 1 0 0\np 1\nl 1 2\n", "no triangles");
  expectComplaint("points.off", "OFF\n2 0 0\n0 0 0\n1 0 0\n", "no triangles");
  expectComplaint("nothing.off", "OFF\n0 0 0\n", "no triangles");
  expectComplaint("points.ply",
                  "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
                  "property float z\nend_header\n0 0 0\n",
                  "no faces");
  expectComplaint("flat.off", "4OFF\n1 1 0\n0 0 0 0\n3 0 0 0\n", "three-dimensional");
  expectComplaint("binary.off", "OFF BINARY\n....", "binary OFF");
}

TEST_F(LoadMesh, RefusesTruncatedFiles) {
  // Cut anywhere up to the last number (whose loss of digits nobody could see).
  const auto try_all = [this](const std::string& name, const std::string& whole, std::size_t needed) {
    for (std::size_t size = 0; size < needed; ++size) {
      SCOPED_TRACE(name + " cut to " + std::to_string(size));
      complaint(write(name, whole.substr(0, size)));
    }
  };
  try_all("cut.off", kOff, kOff.size() - 2);
  try_all("cut.ply", kPly, kPly.size() - 2);
  try_all("little.ply", binaryPly(), binaryPly().size());
  try_all("big.ply", binaryPly(true), binaryPly(true).size());
  try_all("cut.stl", kStl, kStl.rfind("endsolid"));
  try_all("binary.stl", binaryStl(), binaryStl().size());
  try_all("cut.dae", kDae, kDae.size() - 3);
  expectComplaint("cut.obj", kObj.substr(0, kObj.size() - 3), "corners");
  expectComplaint("huge.off", "OFF\n4000000000 4000000000 0\n0 0 0\n", "truncated");
  expectComplaint("huge.ply",
                  "ply\nformat ascii 1.0\nelement vertex 4000000000000\nproperty float x\nproperty float y\n"
                  "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n",
                  "truncated");
}

}  // namespace
}  // namespace bocst
