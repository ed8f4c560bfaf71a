// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/io.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <exception>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "polygons.h"
#include "read_off.h"
#include "read_ply.h"
#include "read_scene.h"
#include "text.h"

namespace bocst {
namespace {

std::string readFile(const std::string& file) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(file, error);
  if (!std::filesystem::exists(status)) throw std::runtime_error("no such file");
  if (std::filesystem::is_directory(status)) throw std::runtime_error("is a directory");
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw std::runtime_error("cannot be opened: " + std::generic_category().message(errno));
  std::string content((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
  if (stream.bad()) throw std::runtime_error("cannot be read");
  if (content.empty()) throw std::runtime_error("is empty");
  return content;
}

std::string extensionOf(const std::string& file) {
  std::string extension = std::filesystem::path(file).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

/// Assimp takes a text STL that ends after any complete facet; binary ones it checks by their size.
void checkStlEnd(std::string_view content) {
  std::uint32_t count = 0;
  if (content.size() >= 84) std::memcpy(&count, content.data() + 80, sizeof(count));
  const bool binary = content.size() >= 84 && content.size() == 84 + 50 * std::size_t{count};
  if (binary || content.substr(0, 5) != "solid") return;
  const std::size_t last = content.rfind("endsolid");
  if (last == std::string_view::npos || content.find("facet", last) != std::string_view::npos) {
    throw std::runtime_error("truncated: no 'endsolid' at the end");
  }
}

/// Assimp takes an OBJ face of one or two corners for points and lines, which is what a cut-off face looks like.
void checkObjFaces(std::string_view content) {
  for (std::size_t number = 1; !content.empty(); ++number) {
    std::string_view line = io::takeLine(content);
    if (line.size() < 2 || line[0] != 'f' || io::kBlanks.find(line[1]) == std::string_view::npos) continue;
    if (line.back() == '\\') continue;  // goes on in the next line
    io::takeWord(line);
    for (int corner = 0; corner < 3; ++corner) {
      if (!io::takeWord(line).empty()) continue;
      throw std::runtime_error("line " + std::to_string(number) + ": a face has at least three corners");
    }
  }
}

io::Polygons readPolygons(const std::string& file) {
  const std::string content = readFile(file);
  const std::string extension = extensionOf(file);
  if (extension == ".off") return io::readOff(content);
  if (extension == ".ply") return io::PlyReader(content).read();
  if (extension == ".obj") checkObjFaces(content);
  if (extension == ".stl") checkStlEnd(content);
  return io::readScene(file);
}

}  // namespace

std::shared_ptr<const Mesh> loadMesh(const std::string& file) {
  try {
    io::Polygons polygons = readPolygons(file);
    std::vector<Mesh::Indices> triangles = io::triangulate(polygons);
    if (triangles.empty()) throw std::runtime_error("no triangles in this file");
    return Mesh::fromIndices(std::move(polygons.vertices), std::move(triangles));
  } catch (const std::exception& e) {
    std::string what = e.what();
    std::replace(what.begin(), what.end(), '\n', ' ');
    throw std::runtime_error(file + ": " + what);
  }
}

}  // namespace bocst
