// SPDX-License-Identifier: BSD-3-Clause
#include "robot/mesh_store.h"

#include <bocst/io.h>

#include <filesystem>
#include <stdexcept>
#include <system_error>
#include <vector>

namespace bocst::program {
namespace {

namespace fs = std::filesystem;

std::shared_ptr<const Mesh> scaled(const std::shared_ptr<const Mesh>& mesh, const Eigen::Vector3d& scale) {
  if (scale == Eigen::Vector3d::Ones()) return mesh;
  std::vector<Eigen::Vector3d> vertices = mesh->vertices();
  for (Eigen::Vector3d& v : vertices) v = v.cwiseProduct(scale);
  return mesh->withVertices(std::move(vertices));
}

}  // namespace

std::shared_ptr<const Mesh> MeshStore::get(const std::string& file, const Eigen::Vector3d& scale) {
  if (!scale.allFinite() || (scale.array() == 0).any()) throw std::runtime_error("the scale must be finite and not 0");
  std::error_code error;
  const fs::path canonical = fs::weakly_canonical(file, error);
  const std::string name = error ? file : canonical.string();
  const std::array<double, 3> one{1, 1, 1};
  std::shared_ptr<const Mesh>& plain = meshes_[{name, one}];
  if (plain == nullptr) plain = loadMesh(file);
  const std::shared_ptr<const Mesh> read = plain;
  std::shared_ptr<const Mesh>& mesh = meshes_[{name, {scale.x(), scale.y(), scale.z()}}];
  if (mesh == nullptr) mesh = scaled(read, scale);
  return mesh;
}

}  // namespace bocst::program
