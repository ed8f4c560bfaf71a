// SPDX-License-Identifier: BSD-3-Clause
#include "pairs/beyond_limits.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <limits>

namespace bocst::program {
namespace {

/// True if exact answers take the triangle for a segment or a point (share/doc/guarantees.md, Limits).
bool isDegenerate(const Eigen::Vector3d& p, const Eigen::Vector3d& q, const Eigen::Vector3d& r, Scalar scalar) {
  const bool single = scalar == Scalar::kFloat;
  const double eps = single ? double{std::numeric_limits<float>::epsilon()} : std::numeric_limits<double>::epsilon();
  const double longest = std::max({(q - p).norm(), (r - p).norm(), (r - q).norm()});
  const double largest = std::max({p.cwiseAbs().maxCoeff(), q.cwiseAbs().maxCoeff(), r.cwiseAbs().maxCoeff()});
  const double least_height = std::max((single ? 45 * eps : 1e-14) * longest, 4 * eps * largest);
  return !((q - p).cross(r - p).norm() > least_height * longest);
}

}  // namespace

std::string beyondLimits(const std::vector<const Mesh*>& meshes, Scalar scalar) {
  constexpr double kMostInFloat = 1e9;
  const bool single = scalar == Scalar::kFloat;
  std::size_t degenerate = 0;
  bool too_large = false;
  for (const Mesh* mesh : meshes) {
    const auto vertex = [&](std::size_t i) -> Eigen::Vector3d {
      return single ? mesh->vertex(i).cast<float>().cast<double>() : mesh->vertex(i);
    };
    for (const Mesh::Indices& t : mesh->triangles()) {
      degenerate += isDegenerate(vertex(t[0]), vertex(t[1]), vertex(t[2]), scalar);
    }
    too_large |= single && std::max(mesh->bounds().max().maxCoeff(), -mesh->bounds().min().minCoeff()) > kMostInFloat;
  }
  std::string found;
  if (degenerate > 0) {
    found = std::to_string(degenerate) + " degenerate triangle" + (degenerate == 1 ? "" : "s") +
            (single ? " (in float)" : "");
  }
  if (too_large) found += (found.empty() ? "" : " and ") + std::string("coordinates above 1e9, the limit with float");
  if (found.empty()) return "";
  return "the meshes have " + found + "; share/doc/guarantees.md, Limits, describes how answers about them may differ";
}

}  // namespace bocst::program
