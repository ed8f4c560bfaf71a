// SPDX-License-Identifier: BSD-3-Clause
#include "io/read_scene.h"

#include <assimp/BaseImporter.h>
#include <assimp/MemoryIOWrapper.h>
#include <assimp/scene.h>
#include <locale.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <assimp/IOSystem.hpp>
#include <assimp/Importer.hpp>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "io/file.h"
#include "io/read_mesh.h"
#include "io/text.h"
#include "io/vertex_pool.h"

namespace bocst::io {
namespace {

namespace fs = std::filesystem;

/// What assimp may open, to read: the file itself, whose content is there already, and regular files in or below its
/// folder (the .bin of a glTF).
class Folder final : public Assimp::IOSystem {
 public:
  Folder(const std::string& file, std::string_view content)
      : file_(file), content_(content), folder_(fs::canonical(file).parent_path()) {}

  bool Exists(const char* path) const override {
    std::error_code error;
    const std::string place = placeOf(path);
    return isInside(place) && fs::is_regular_file(place, error);
  }

  Assimp::IOStream* Open(const char* path, const char* mode) override try {
    if (std::string_view(mode).find_first_of("wa+") != std::string_view::npos) return nullptr;
    if (path == file_) {
      return new Assimp::MemoryIOStream(reinterpret_cast<const std::uint8_t*>(content_.data()), content_.size());
    }
    const std::string place = placeOf(path);
    if (!isInside(place)) throw std::runtime_error("is outside the folder of the mesh file");
    const std::string content = readFile(place);
    auto bytes = std::make_unique<std::uint8_t[]>(content.size());
    std::copy(content.begin(), content.end(), bytes.get());
    return new Assimp::MemoryIOStream(bytes.release(), content.size(), true);
  } catch (const std::exception& e) {
    refused_ = inQuotes(std::string_view(path).substr(isBeside(path) ? folderSize() : 0)) + " " + e.what();
    return nullptr;
  }

  /// The last file that could not be opened, and why; empty if there is none.
  const std::string& refused() const { return refused_; }

  char getOsSeparator() const override { return '/'; }
  void Close(Assimp::IOStream* stream) override { delete stream; }
  bool CreateDirectory(const std::string&) override { return false; }
  bool ChangeDirectory(const std::string&) override { return false; }
  bool DeleteFile(const std::string&) override { return false; }

 private:
  std::size_t folderSize() const { return file_.rfind('/') + 1; }
  bool isBeside(std::string_view path) const { return path.substr(0, folderSize()) == file_.substr(0, folderSize()); }

  /// References in a glTF are URIs: a blank is "%20" there.
  std::string placeOf(const std::string& path) const {
    std::error_code error;
    if (fs::exists(path, error) || !isBeside(path)) return path;
    return path.substr(0, folderSize()) + percentDecoded(path.substr(folderSize()));
  }

  bool isInside(const std::string& path) const {
    std::error_code error;
    const fs::path whole = fs::weakly_canonical(fs::absolute(path), error);
    return !error && std::mismatch(folder_.begin(), folder_.end(), whole.begin(), whole.end()).first == folder_.end();
  }

  std::string file_;
  std::string_view content_;
  fs::path folder_;
  std::string refused_;
};

/// Numbers with a point in this thread, whatever the program's locale.
class CLocale {
 public:
  CLocale() : before_(uselocale(locale())) {}
  ~CLocale() { uselocale(before_); }
  CLocale(const CLocale&) = delete;
  CLocale& operator=(const CLocale&) = delete;

 private:
  static locale_t locale() {
    static const locale_t c = newlocale(LC_ALL_MASK, "C", nullptr);
    return c;
  }
  locale_t before_;
};

/// assimp must not read the formats that this project's own readers handle, as it would accept what they refuse.
void leaveOut(Assimp::Importer& importer) {
  for (const auto& [name, format] : kFormats) {
    while (const std::unique_ptr<Assimp::BaseImporter> reader{importer.GetImporter(name)}) {
      importer.UnregisterLoader(reader.get());  // it is ours from here on
    }
  }
}

}  // namespace

Polygons readScene(const std::string& file, std::string_view content) {
  const CLocale c_locale;
  Assimp::Importer importer;
  auto* const folder = new Folder(file, content);
  importer.SetIOHandler(folder);  // the importer's own from here on
  leaveOut(importer);
  const aiScene* scene = importer.ReadFile(file, 0);
  if (scene == nullptr) {
    if (!importer.IsExtensionSupported(fs::path(file).extension().string())) {
      throw std::runtime_error("no known format has this ending; see meshFormats() and `bocst --help`");
    }
    const std::string& refused = folder->refused();
    throw std::runtime_error(importer.GetErrorString() + (refused.empty() ? "" : " (" + refused + ")"));
  }
  if (scene->mRootNode == nullptr || scene->mNumMeshes == 0) throw std::runtime_error("no mesh in this file");

  Polygons polygons;
  VertexPool pool(polygons.vertices);
  std::vector<std::pair<const aiNode*, Eigen::Matrix4d>> todo{{scene->mRootNode, Eigen::Matrix4d::Identity()}};
  while (!todo.empty()) {
    const auto [node, X_SP] = todo.back();
    todo.pop_back();
    const aiMatrix4x4& m = node->mTransformation;
    Eigen::Matrix4d X_PN;
    X_PN << m.a1, m.a2, m.a3, m.a4, m.b1, m.b2, m.b3, m.b4, m.c1, m.c2, m.c3, m.c4, m.d1, m.d2, m.d3, m.d4;
    const Eigen::Matrix4d X_SN = X_SP * X_PN;
    const bool identity = X_SN.isIdentity(0);
    for (unsigned i = node->mNumChildren; i-- > 0;) todo.emplace_back(node->mChildren[i], X_SN);
    for (unsigned i = 0; i < node->mNumMeshes; ++i) {
      const aiMesh& mesh = *scene->mMeshes[node->mMeshes[i]];
      for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
        const aiFace& face = mesh.mFaces[f];
        if (face.mNumIndices < 3) continue;  // a point or a line
        for (unsigned k = 0; k < face.mNumIndices; ++k) {
          if (face.mIndices[k] >= mesh.mNumVertices) {
            throw std::runtime_error("face " + std::to_string(f) + ": vertex index out of range");
          }
          const aiVector3D& v = mesh.mVertices[face.mIndices[k]];
          Eigen::Vector3d p(v.x, v.y, v.z);
          if (!identity) p = X_SN.topLeftCorner<3, 3>() * p + X_SN.topRightCorner<3, 1>();
          polygons.corners.push_back(pool.indexOf(p));
        }
        polygons.ends.push_back(polygons.corners.size());
      }
    }
  }
  return polygons;
}

std::vector<std::string> sceneEndings() {
  Assimp::Importer importer;
  leaveOut(importer);
  std::string list;  // "*.3ds;*.glb;..."
  importer.GetExtensionList(list);
  std::vector<std::string> endings;
  std::istringstream stream(list);
  for (std::string pattern; std::getline(stream, pattern, ';');) {
    if (pattern.rfind("*.", 0) == 0) endings.push_back(pattern.substr(2));
  }
  std::sort(endings.begin(), endings.end());
  return endings;
}

}  // namespace bocst::io
