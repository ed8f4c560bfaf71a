// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <assimp/scene.h>

#include <Eigen/Geometry>
#include <array>
#include <assimp/Importer.hpp>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "polygons.h"

namespace bocst::io {

/// Vertices by position: assimp gives every corner of STL, OBJ and DAE a vertex of its own. Its own joining is not
/// used: it also joins vertices that are merely near each other.
class VertexPool {
 public:
  explicit VertexPool(std::vector<Eigen::Vector3d>& vertices) : vertices_(vertices) {}

  std::uint32_t indexOf(const Eigen::Vector3d& p) {
    Key key;
    const Eigen::Vector3d q = p.array() + 0.0;  // -0 and 0 are the same place
    std::memcpy(key.data(), q.data(), sizeof(key));
    const auto [entry, is_new] = index_.emplace(key, static_cast<std::uint32_t>(vertices_.size()));
    if (is_new) vertices_.push_back(p);
    return entry->second;
  }

 private:
  using Key = std::array<std::uint64_t, 3>;
  struct Hash {
    std::size_t operator()(const Key& key) const {
      std::uint64_t h = 0;
      for (const std::uint64_t k : key) {
        h = (h ^ k) * 0x9e3779b97f4a7c15u;
        h ^= h >> 29;
      }
      return h;
    }
  };

  std::vector<Eigen::Vector3d>& vertices_;
  std::unordered_map<Key, std::uint32_t, Hash> index_;
};

/// Reads whatever assimp can read: all meshes of the scene, each where its nodes put it; equal vertices are joined.
/// @throws std::runtime_error with assimp's reason.
inline Polygons readScene(const std::string& file) {
  Assimp::Importer importer;
  const aiScene* scene = importer.ReadFile(file, 0);
  if (scene == nullptr) throw std::runtime_error(importer.GetErrorString());
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

}  // namespace bocst::io
