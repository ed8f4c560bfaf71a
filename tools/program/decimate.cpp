// SPDX-License-Identifier: BSD-3-Clause
#include "decimate.h"

#include <meshoptimizer.h>

#include <Eigen/Core>
#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

namespace bocst::program {

std::shared_ptr<const Mesh> decimated(const std::shared_ptr<const Mesh>& mesh, std::size_t triangles) {
  if (mesh->triangleCount() <= triangles) return mesh;
  // In floats relative to the bounds: far from the origin the coordinates themselves would lose too much.
  const Eigen::Vector3d middle = mesh->bounds().center();
  const double size = std::max(mesh->bounds().sizes().maxCoeff(), std::numeric_limits<double>::min());
  std::vector<float> positions;
  positions.reserve(3 * mesh->vertexCount());
  for (const Eigen::Vector3d& v : mesh->vertices()) {
    const Eigen::Vector3f p = ((v - middle) / size).cast<float>();
    positions.insert(positions.end(), p.data(), p.data() + 3);
  }
  std::vector<unsigned> indices;
  indices.reserve(3 * mesh->triangleCount());
  for (const Mesh::Indices& t : mesh->triangles()) indices.insert(indices.end(), t.begin(), t.end());
  const std::size_t stride = 3 * sizeof(float), count = mesh->vertexCount();
  // Vertices at the same place are one, or every edge between them would be a border that stays.
  std::vector<unsigned> joined(indices.size());
  meshopt_generateShadowIndexBuffer(joined.data(), indices.data(), indices.size(), positions.data(), count, stride,
                                    stride);
  std::vector<unsigned> kept(joined.size());
  kept.resize(meshopt_simplify(kept.data(), joined.data(), joined.size(), positions.data(), count, stride,
                               3 * triangles, std::numeric_limits<float>::max(), 0, nullptr));
  if (kept.empty()) return mesh;

  constexpr unsigned kUnused = std::numeric_limits<unsigned>::max();
  std::vector<unsigned> place(count, kUnused);
  std::vector<Eigen::Vector3d> vertices;
  std::vector<Mesh::Indices> result;
  for (std::size_t i = 0; i < kept.size(); i += 3) {
    Mesh::Indices t;
    for (std::size_t k = 0; k < 3; ++k) {
      unsigned& at = place[kept[i + k]];
      if (at == kUnused) {
        at = static_cast<unsigned>(vertices.size());
        vertices.push_back(mesh->vertex(kept[i + k]));
      }
      t[k] = at;
    }
    result.push_back(t);
  }
  return Mesh::fromIndices(std::move(vertices), std::move(result));
}

}  // namespace bocst::program
