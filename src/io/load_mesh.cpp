// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/io.h>

#include <algorithm>
#include <cctype>
#include <exception>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "io/check_scene.h"
#include "io/file.h"
#include "io/read_mesh.h"
#include "io/read_scene.h"

namespace bocst {
namespace {

std::string extensionOf(const std::string& file) {
  std::string extension = std::filesystem::path(file).extension().string();
  if (!extension.empty()) extension.erase(0, 1);  // the dot
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

io::Polygons readPolygons(const std::string& file) {
  const std::string content = io::readFile(file);
  const std::string extension = extensionOf(file);
  for (const auto& [name, format] : io::kFormats) {
    if (extension == name) return io::readMesh(content, format);
  }
  io::refuseMisread(content, extension);
  return io::readScene(file, content);
}

}  // namespace

std::shared_ptr<const Mesh> loadMesh(const std::string& file) {
  if (file.find('\0') != std::string::npos) throw std::runtime_error("a file name that contains a null character");
  try {
    io::Polygons polygons = readPolygons(file);
    std::vector<Mesh::Indices> triangles = io::triangulate(polygons);
    if (triangles.empty()) throw std::runtime_error("no triangles in this file");
    polygons.vertices.shrink_to_fit();  // the mesh keeps them
    triangles.shrink_to_fit();
    return Mesh::fromIndices(std::move(polygons.vertices), std::move(triangles));
  } catch (const std::exception& e) {
    std::string what = e.what();
    std::replace(what.begin(), what.end(), '\n', ' ');
    throw std::runtime_error(file + ": " + what);
  }
}

std::vector<MeshFormat> meshFormats() {
  std::vector<MeshFormat> formats;
  for (const auto& [name, format] : io::kFormats) formats.push_back({name, false});
  for (std::string& ending : io::sceneEndings()) formats.push_back({std::move(ending), true});
  return formats;
}

}  // namespace bocst
