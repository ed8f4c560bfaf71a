// SPDX-License-Identifier: BSD-3-Clause
#include "picture/display_mesh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_map>

namespace bocst::program {
namespace {

constexpr int kBits = 16;

using Position = std::array<std::uint16_t, 3>;

std::vector<Position> quantise(const Mesh& mesh) {
  const Eigen::Vector3d low = mesh.bounds().center() - Eigen::Vector3d::Constant(displaySize(mesh) / 2);
  const double steps = ((1 << kBits) - 1) / displaySize(mesh);
  std::vector<Position> positions(mesh.vertexCount());
  for (std::size_t i = 0; i < positions.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      const double at = std::round((mesh.vertex(i)[k] - low[k]) * steps);
      positions[i][static_cast<std::size_t>(k)] =
          static_cast<std::uint16_t>(std::clamp(at, 0.0, static_cast<double>((1 << kBits) - 1)));
    }
  }
  return positions;
}

/// With vertices joined that agree in their upper `bits`; the first of them stands for all.
DisplayMesh joined(const Mesh& mesh, const std::vector<Position>& positions, int bits) {
  std::unordered_map<std::uint64_t, std::uint32_t> at;
  DisplayMesh result;
  const auto idOf = [&](std::uint32_t i) {
    std::uint64_t key = 0;
    for (const std::uint16_t x : positions[i]) key = key << kBits | static_cast<std::uint64_t>(x >> (kBits - bits));
    const auto [found, fresh] = at.emplace(key, static_cast<std::uint32_t>(at.size()));
    if (fresh) result.positions.insert(result.positions.end(), positions[i].begin(), positions[i].end());
    return found->second;
  };
  for (const Mesh::Indices& t : mesh.triangles()) {
    const std::array<std::uint32_t, 3> c = {idOf(t[0]), idOf(t[1]), idOf(t[2])};
    if (c[0] == c[1] || c[1] == c[2] || c[2] == c[0]) continue;
    result.indices.insert(result.indices.end(), c.begin(), c.end());
  }
  return result;
}

}  // namespace

double displaySize(const Mesh& mesh) {
  const double size = mesh.bounds().sizes().maxCoeff();
  return size > 0 ? size : 1;
}

DisplayMesh displayMesh(const Mesh& mesh, std::size_t limit) {
  const std::vector<Position> positions = quantise(mesh);
  DisplayMesh result = joined(mesh, positions, kBits);
  for (int bits = 11; bits > 0 && result.triangles() > limit; --bits) result = joined(mesh, positions, bits);
  return result;
}

}  // namespace bocst::program
