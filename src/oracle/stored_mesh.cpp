// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/stored_mesh.h"

#include <cstring>
#include <utility>
#include <vector>

namespace bocst::oracle {
namespace {

constexpr std::size_t kVertexWords = sizeof(Eigen::Vector3d) / sizeof(std::uint32_t), kTriangleWords = 3;

// FNV-1a over words: any change of one word changes it.
std::uint64_t checkOf(const std::vector<std::uint32_t>& words) {
  std::uint64_t check = 0xcbf29ce484222325u;
  for (const std::uint32_t word : words) check = (check ^ word) * 0x100000001b3u;
  return check;
}

}  // namespace

StoredMesh::StoredMesh(Oracle& oracle, const Mesh& mesh)
    : oracle_(oracle), vertices_(mesh.vertexCount()), triangles_(mesh.triangleCount()) {
  static_assert(sizeof(Mesh::Indices) == kTriangleWords * sizeof(std::uint32_t), "indices lie side by side");
  std::vector<std::uint32_t> words(kVertexWords * vertices_ + kTriangleWords * triangles_);
  std::memcpy(words.data(), mesh.vertices().data(), vertices_ * sizeof(Eigen::Vector3d));
  std::memcpy(words.data() + kVertexWords * vertices_, mesh.triangles().data(), triangles_ * sizeof(Mesh::Indices));
  check_ = checkOf(words);
  stored_ = oracle.store(words);
  if (stored_ == nullptr) throw OracleError("the oracle " + oracle.name() + " needs the mesh on the host");
}

std::shared_ptr<const Mesh> StoredMesh::recall() const {
  std::vector<std::uint32_t> words(kVertexWords * vertices_ + kTriangleWords * triangles_);
  oracle_.recall(*stored_, words);
  if (checkOf(words) != check_) throw OracleError("the GPU that had the only copy of a mesh returned another one");
  std::vector<Eigen::Vector3d> vertices(vertices_);
  std::vector<Mesh::Indices> triangles(triangles_);
  std::memcpy(vertices.front().data(), words.data(), vertices_ * sizeof(Eigen::Vector3d));
  std::memcpy(triangles.data(), words.data() + kVertexWords * vertices_, triangles_ * sizeof(Mesh::Indices));
  return Mesh::fromIndices(std::move(vertices), std::move(triangles));
}

}  // namespace bocst::oracle
