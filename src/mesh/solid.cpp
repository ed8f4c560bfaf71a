// SPDX-License-Identifier: BSD-3-Clause
#include "mesh/solid.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <string>

#include "log/number_text.h"
#include "mesh/weld.h"

namespace bocst {
namespace {

using Eigen::Vector3d;

void checkWatertight(const Mesh& mesh) {
  const std::vector<std::uint32_t> first = weld(mesh.vertices());
  // Edges by the direction in which they are run through, as the smaller and the larger end.
  std::vector<std::uint64_t> up, down;
  for (const Mesh::Indices& t : mesh.triangles()) {
    const std::uint32_t v[3] = {first[t[0]], first[t[1]], first[t[2]]};
    if (!isTriangle(v[0], v[1], v[2])) continue;
    for (int k = 0; k < 3; ++k) {
      const std::uint64_t a = v[k], b = v[(k + 1) % 3];
      (a < b ? up : down).push_back(std::min(a, b) << 32 | std::max(a, b));
    }
  }
  std::sort(up.begin(), up.end());
  std::sort(down.begin(), down.end());
  if (up == down) return;
  std::size_t i = 0;
  while (i < std::min(up.size(), down.size()) && up[i] == down[i]) ++i;
  const std::uint64_t edge = i == up.size() ? down[i] : i == down.size() ? up[i] : std::min(up[i], down[i]);
  const auto count = [edge](const std::vector<std::uint64_t>& edges) {
    const auto range = std::equal_range(edges.begin(), edges.end(), edge);
    return range.second - range.first;
  };
  const auto there = count(up), back = count(down);
  const std::size_t a = edge >> 32, b = edge & 0xffffffffu;
  throw std::invalid_argument(
      "bocst::Options: solid needs a watertight mesh with triangles of one orientation, but the edge between "
      "vertices " +
      std::to_string(a) + " " + pointText(mesh.vertex(a)) + " and " + std::to_string(b) + " " +
      pointText(mesh.vertex(b)) +
      (there + back == 1 ? " has only one triangle"
                         : " is used " + std::to_string(there) + " times in one direction and " + std::to_string(back) +
                               " times in the other: triangles are missing or turned over"));
}

}  // namespace

std::vector<Vector3d> pointOfEachComponent(const std::vector<Vector3d>& vertices,
                                           const std::vector<Mesh::Indices>& triangles) {
  const std::vector<std::uint32_t> component = componentOfEachVertex(weld(vertices), triangles);
  std::vector<std::uint8_t> seen(vertices.size(), 0);
  std::vector<Vector3d> points;
  for (const Mesh::Indices& t : triangles) {
    const std::uint32_t r = component[t[0]];
    if (!seen[r]) points.push_back(vertices[t[0]]);
    seen[r] = 1;
  }
  return points;
}

Solid::Solid(std::shared_ptr<const Mesh> mesh) : mesh_(std::move(mesh)) {
  checkWatertight(*mesh_);
  const Eigen::AlignedBox3d& b = mesh_->bounds();
  rounding_ = 1e-14 * std::max(b.min().cwiseAbs().maxCoeff(), b.max().cwiseAbs().maxCoeff());
  fillColumns();
}

std::uint32_t Solid::column(double position, int axis) const {
  const double low = mesh_->bounds().min()[axis], side = mesh_->bounds().sizes()[axis];
  const std::uint32_t count = count_[static_cast<std::size_t>(axis)];
  const double at = side > 0 ? (position - low) / side * count : 0;
  return at > 0 ? std::min(static_cast<std::uint32_t>(std::min(at, 1e9)), count - 1) : 0;
}

// The least and the largest column along x, then y. Computed alike for a point, and monotonous, so a triangle over a
// point is in its column; beyond that, one rounding more.
std::array<std::uint32_t, 4> Solid::columnsOf(const Mesh::Indices& triangle) const {
  const Vector3d &a = mesh_->vertex(triangle[0]), &b = mesh_->vertex(triangle[1]), &c = mesh_->vertex(triangle[2]);
  const Vector3d lo = a.cwiseMin(b).cwiseMin(c), hi = a.cwiseMax(b).cwiseMax(c);
  return {column(lo.x() - rounding_, 0), column(hi.x() + rounding_, 0), column(lo.y() - rounding_, 1),
          column(hi.y() + rounding_, 1)};
}

void Solid::fillColumns() {
  const std::vector<Mesh::Indices>& triangles = mesh_->triangles();
  const auto side = static_cast<std::uint32_t>(std::sqrt(static_cast<double>(triangles.size()) / 4));
  count_[0] = count_[1] = std::clamp(side, 1u, 512u);
  // Large triangles lie over many columns: fewer of these until the lists are no longer than a few times the mesh.
  for (;; count_[0] = count_[1] = count_[0] / 2) {
    first_.assign(std::size_t{count_[0]} * count_[1] + 1, 0);
    std::size_t total = 0;
    const std::size_t enough = 8 * triangles.size() + 64;
    for (const Mesh::Indices& t : triangles) {
      const auto c = columnsOf(t);
      total += std::size_t{c[1] - c[0] + 1} * (c[3] - c[2] + 1);
      if (total > enough) break;
    }
    if (total <= enough || count_[0] == 1) break;
  }
  const auto each = [&](auto&& f) {
    for (std::uint32_t t = 0; t < triangles.size(); ++t) {
      const auto c = columnsOf(triangles[t]);
      for (std::uint32_t y = c[2]; y <= c[3]; ++y) {
        for (std::uint32_t x = c[0]; x <= c[1]; ++x) f(std::size_t{y} * count_[0] + x, t);
      }
    }
  };
  each([&](std::size_t c, std::uint32_t) { ++first_[c + 1]; });
  std::partial_sum(first_.begin(), first_.end(), first_.begin());
  ids_.resize(first_.back());
  std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
  each([&](std::size_t c, std::uint32_t t) { ids_[next[c]++] = t; });
}

// The plane through the point across y cuts the surface in closed polygons; their corners are where edges pass it, and
// each triangle that does gives one side, from where it goes up through the plane to where it comes down. An edge's
// corner is computed alike for all its triangles, so rounding moves corners but opens no polygon: the number of times
// that they wind about the point is right unless the point is within rounding of them.
bool Solid::windsAbout(const Vector3d& point) const {
  const std::size_t c = std::size_t{column(point.y(), 1)} * count_[0] + column(point.x(), 0);
  int winding = 0;
  for (std::uint32_t i = first_[c]; i < first_[c + 1]; ++i) {
    const Mesh::Indices& t = mesh_->indices(ids_[i]);
    Eigen::Vector2d up, down;  // x and z of the corners, from the point
    bool passes = false;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vector3d &a = mesh_->vertex(t[k]), &b = mesh_->vertex(t[(k + 1) % 3]);
      const bool goes_up = b.y() > point.y();
      if ((a.y() > point.y()) == goes_up) continue;
      passes = true;
      const Vector3d &lo = goes_up ? a : b, &hi = goes_up ? b : a;
      const double s = (point.y() - lo.y()) / (hi.y() - lo.y());
      (goes_up ? up : down) =
          Eigen::Vector2d(lo.x() + s * (hi.x() - lo.x()) - point.x(), lo.z() + s * (hi.z() - lo.z()) - point.z());
    }
    if (!passes) continue;
    const Eigen::Vector2d side = down - up;
    const double length = side.squaredNorm();
    const double along = length > 0 ? std::clamp(-up.dot(side) / length, 0.0, 1.0) : 0;
    if ((up + along * side).norm() <= rounding_) return true;
    const int turns = int{up.x() > 0} - int{down.x() > 0};
    if (turns == 0) continue;
    // True if the side passes above the point. It is not near it, so this has a sign.
    const bool above = std::min(up.y(), down.y()) > 0 ||
                       (std::max(up.y(), down.y()) > 0 && (side.x() * up.y() > side.y() * up.x()) == (side.x() > 0));
    if (above) winding += turns;
  }
  return winding != 0;
}

bool Solid::mayContain(const Vector3d& point, double tolerance) const {
  const double off = 2 * (tolerance + rounding_);
  const Eigen::AlignedBox3d& bounds = mesh_->bounds();
  if (((bounds.min() - point).array() > off).any() || ((point - bounds.max()).array() > off).any()) return false;
  if (windsAbout(point)) return true;
  // Of the six ways along the axes, one leads into the surface by more than half, if the point is just outside.
  for (int k = 0; k < 3; ++k) {
    const Vector3d displacement = off * Vector3d::Unit(k);
    if (windsAbout(point + displacement) || windsAbout(point - displacement)) return true;
  }
  return false;
}

std::size_t Solid::bytes() const {
  return (first_.capacity() + ids_.capacity()) * sizeof(std::uint32_t) + sizeof(*this);
}

}  // namespace bocst
