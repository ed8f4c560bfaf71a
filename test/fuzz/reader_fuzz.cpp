// SPDX-License-Identifier: BSD-3-Clause
//
// Any bytes as a mesh file of each format: loadMesh() gives a sound mesh, the same one twice, or says what is wrong.
#include <bocst/io.h>

#include <sstream>

#include "fuzz/fuzz.h"
#include "temporary_folder.h"

namespace bocst::fuzz {
namespace {

const char* const kFormats[] = {"obj", "ply", "stl", "off", "dae"};

struct Counts {
  std::uint64_t inputs = 0, meshes = 0;
} counts;

std::shared_ptr<const Mesh> load(const std::string& file) {
  try {
    return loadMesh(file);
  } catch (const std::runtime_error& e) {
    if (std::string(e.what()).find(file) == std::string::npos) {
      throw Failure(std::string("a complaint that does not name the file: ") + e.what());
    }
    return nullptr;
  }  // Nothing else is promised, so whatever else is thrown is a failure.
}

}  // namespace

const char* const kTokens[] = {"nan",
                               "-inf",
                               "1e300",
                               "1e-300",
                               "-1",
                               "0",
                               "4294967296",
                               "99999999999999999999",
                               "0.5",
                               "1,5",
                               "\n",
                               " ",
                               "\r\n",
                               "\\\n",
                               "\t",
                               "#",
                               "/",
                               "//",
                               "v ",
                               "vn ",
                               "f 1 2 3\n",
                               "f -1 -2 -3\n",
                               "f 1/1/1 2//2 3\n",
                               "mtllib x\n",
                               "usemtl x\n",
                               "o x\n",
                               "OFF\n",
                               "COFF\n",
                               "NOFF BINARY\n",
                               "3 0 1 2\n",
                               "ply\n",
                               "format ascii 1.0\n",
                               "format binary_little_endian 1.0\n",
                               "format binary_big_endian 1.0\n",
                               "element vertex 3\n",
                               "element face 1\n",
                               "element tristrips 1\n",
                               "property float x\n",
                               "property double y\n",
                               "property uchar z\n",
                               "property list uchar int vertex_indices\n",
                               "property list int float vertex_index\n",
                               "end_header\n",
                               "comment x\n",
                               "solid x\n",
                               "facet normal 0 0 1\n",
                               "outer loop\n",
                               "vertex 0 0 0\n",
                               "endloop\n",
                               "endfacet\n",
                               "endsolid x\n",
                               "<float_array id=\"p\" count=\"9\">",
                               "</float_array>",
                               "<triangles count=\"1\">",
                               "<p>0 1 2</p>",
                               "<matrix>",
                               "<up_axis>Z_UP</up_axis>",
                               "<unit meter=\"0.01\"/>",
                               "&#x0;",
                               "<![CDATA[",
                               "<!--",
                               nullptr};

void testOneInput(const std::uint8_t* data, std::size_t size) {
  static const test::TemporaryFolder folder;
  Bytes in(data, size);
  const std::string format = kFormats[in.below(static_cast<int>(std::size(kFormats)))];
  const std::string file =
      folder.write("input." + format, std::string(reinterpret_cast<const char*>(in.rest()), in.left()));
  ++counts.inputs;
  const std::shared_ptr<const Mesh> mesh = load(file);
  if (mesh == nullptr) return;
  ++counts.meshes;
  if (mesh->triangleCount() == 0) throw Failure("a mesh without triangles");
  for (std::size_t v = 0; v < mesh->vertexCount(); ++v) {
    if (!mesh->vertex(v).allFinite()) throw Failure("a vertex that is not finite");
  }
  for (std::size_t t = 0; t < mesh->triangleCount(); ++t) {
    const fcl::Triangle triangle = mesh->triangle(t);
    for (std::size_t k = 0; k < 3; ++k) {
      if (triangle[k] >= mesh->vertexCount()) throw Failure("an index out of range");
    }
  }
  const std::shared_ptr<const Mesh> again = load(file);
  if (again == nullptr || again->vertexCount() != mesh->vertexCount() ||
      again->triangleCount() != mesh->triangleCount()) {
    throw Failure("another mesh the second time");
  }
}

std::string summary() {
  std::ostringstream out;
  out << counts.inputs << " files read, " << counts.meshes << " of them meshes";
  return out.str();
}

}  // namespace bocst::fuzz
