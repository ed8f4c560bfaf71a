// SPDX-License-Identifier: BSD-3-Clause
#include "mesh/protrusion.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <utility>

namespace bocst::program {
namespace {

using Eigen::Vector3d;
using Ids = std::vector<std::uint32_t>;

/// Branch and bound over the directions from the centre, which spherical triangles divide.
class Search {
 public:
  Search(const Vector3d& center, double radius, const std::vector<BoundedTriangle>& triangles)
      : center_(center), radius_(radius), triangles_(triangles) {}

  double bound(const Ids& some, double enough) {
    const auto all = std::make_shared<const Ids>(some);
    for (const double x : {-1.0, 1.0}) {
      for (const double y : {-1.0, 1.0}) {
        for (const double z : {-1.0, 1.0}) add({Vector3d(x, 0, 0), Vector3d(0, y, 0), Vector3d(0, 0, z)}, all, some[0]);
      }
    }
    constexpr std::size_t kMostCells = 50000;  // reached only where numbers are too small or too large to tell
    while (true) {
      const double above = cells_.front().above;
      const bool is_tight = !(above > greatest_ + std::max(0.005 * greatest_, 0.001 * radius_));
      if (is_tight || greatest_ > enough || added_ > kMostCells) return above;
      std::pop_heap(cells_.begin(), cells_.end());
      const Cell cell = std::move(cells_.back());
      cells_.pop_back();
      std::array<Vector3d, 3> middle;
      for (std::size_t i = 0; i < 3; ++i) middle[i] = (cell.corner[i] + cell.corner[(i + 1) % 3]).normalized();
      for (std::size_t i = 0; i < 3; ++i)
        add({cell.corner[i], middle[i], middle[(i + 2) % 3]}, cell.near, cell.nearest);
      add(middle, cell.near, cell.nearest);
    }
  }

 private:
  struct Cell {
    std::array<Vector3d, 3> corner;   // unit vectors
    std::shared_ptr<const Ids> near;  // what can be nearest to a point of the cell
    std::uint32_t nearest;            // to its middle
    double above;                     // no point of the cell is farther from the triangles

    bool operator<(const Cell& other) const { return above < other.above; }
  };

  double distance(const Vector3d& s, std::uint32_t t) const { return (closestOnTriangle(s, triangles_[t]) - s).norm(); }
  double leastDistance(const Vector3d& s, std::uint32_t t) const {
    return (triangles_[t].center - s).norm() - triangles_[t].radius;
  }

  void add(const std::array<Vector3d, 3>& corner, const std::shared_ptr<const Ids>& near, std::uint32_t guess) {
    ++added_;
    const Vector3d u = (corner[0] + corner[1] + corner[2]).normalized();
    const Vector3d s = center_ + radius_ * u;
    std::uint32_t nearest = guess;
    double least = distance(s, guess);
    for (const std::uint32_t t : *near) {
      if (leastDistance(s, t) >= least) continue;
      const double d = distance(s, t);
      if (d >= least) continue;
      least = d;
      nearest = t;
    }
    greatest_ = std::max(greatest_, least);

    // Distances change by no more than the points move.
    double chord = 0;
    for (const Vector3d& c : corner) chord = std::max(chord, radius_ * (c - u).norm());
    double above = least + chord;
    // The distance to one triangle is convex: in the flat triangle of the corners it is greatest in a corner. The
    // sphere is above that triangle by no more than above its middle.
    const double height = (corner[1] - corner[0]).cross(corner[2] - corner[0]).normalized().dot(corner[0]);
    double flat = 0;
    for (const Vector3d& c : corner) flat = std::max(flat, distance(center_ + radius_ * c, nearest));
    above = std::min(above, flat + radius_ * (1 - std::abs(height)));

    // What is far from the middle is not nearest anywhere in the cell.
    std::shared_ptr<const Ids> left = near;
    if (near->size() > kFew) {
      Ids ids;
      for (const std::uint32_t t : *near) {
        if (leastDistance(s, t) - chord <= above) ids.push_back(t);
      }
      if (ids.size() < near->size() / 2) left = std::make_shared<const Ids>(std::move(ids));
    }
    cells_.push_back({corner, std::move(left), nearest, above});
    std::push_heap(cells_.begin(), cells_.end());
  }

  static constexpr std::size_t kFew = 16;

  const Vector3d center_;
  const double radius_;
  const std::vector<BoundedTriangle>& triangles_;
  std::vector<Cell> cells_;  // a heap: the first has the greatest bound
  double greatest_ = 0;      // that was found
  std::size_t added_ = 0;
};

}  // namespace

double protrusionOf(const Vector3d& center, double radius, const std::vector<BoundedTriangle>& triangles,
                    const std::vector<std::uint32_t>& some, double enough) {
  return Search(center, radius, triangles).bound(some, enough);
}

}  // namespace bocst::program
