// SPDX-License-Identifier: BSD-3-Clause
#include "mesh/decimate.h"

#include <meshoptimizer.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <limits>
#include <utility>
#include <vector>

namespace bocst::program {

std::shared_ptr<const Mesh> decimated(const std::shared_ptr<const Mesh>& mesh, std::size_t triangles) {
  if (mesh->triangleCount() <= triangles) return mesh;
  // In floats relative to the bounds: far from the origin the coordinates themselves would lose too much.
  const Eigen::Vector3d middle = mesh->bounds().center();
  const double size = std::max(mesh->bounds().sizes().maxCoeff(), std::numeric_limits<double>::min());
  using Position = std::array<float, 3>;
  std::vector<Position> positions;
  positions.reserve(mesh->vertexCount());
  for (const Eigen::Vector3d& v : mesh->vertices()) {
    const Eigen::Vector3f p = ((v - middle) / size).cast<float>();
    positions.push_back({p.x() + 0.0f, p.y() + 0.0f, p.z() + 0.0f});  // -0 is 0
  }
  std::vector<unsigned> indices;
  indices.reserve(3 * mesh->triangleCount());
  for (const Mesh::Indices& t : mesh->triangles()) indices.insert(indices.end(), t.begin(), t.end());
  // Vertices at the same place are one, or every edge between them would be a border that stays.
  std::vector<unsigned> place(positions.size());
  const std::size_t places = meshopt_generateVertexRemap(place.data(), indices.data(), indices.size(), positions.data(),
                                                         positions.size(), sizeof(Position));
  std::vector<Position> joined(places);
  std::vector<Eigen::Vector3d> vertices(places);
  for (std::size_t i = 0; i < place.size(); ++i) {
    if (place[i] >= places) continue;  // no triangle's
    joined[place[i]] = positions[i];
    vertices[place[i]] = mesh->vertex(i);
  }
  for (unsigned& i : indices) i = place[i];
  std::vector<unsigned> kept(indices.size());
  kept.resize(meshopt_simplify(kept.data(), indices.data(), indices.size(), joined.front().data(), places,
                               sizeof(Position), 3 * triangles, std::numeric_limits<float>::max(), 0, nullptr));
  if (kept.empty()) return mesh;

  // Only vertices that are still used.
  constexpr unsigned kUnused = std::numeric_limits<unsigned>::max();
  std::fill(place.begin(), place.end(), kUnused);
  std::vector<Eigen::Vector3d> used;
  std::vector<Mesh::Indices> result;
  for (std::size_t i = 0; i < kept.size(); i += 3) {
    Mesh::Indices t;
    for (std::size_t k = 0; k < 3; ++k) {
      unsigned& at = place[kept[i + k]];
      if (at == kUnused) {
        at = static_cast<unsigned>(used.size());
        used.push_back(vertices[kept[i + k]]);
      }
      t[k] = at;
    }
    result.push_back(t);
  }
  return Mesh::fromIndices(std::move(used), std::move(result));
}

}  // namespace bocst::program
