// SPDX-License-Identifier: BSD-3-Clause
#include "mesh/sphere_error.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <unordered_map>
#include <utility>

#include "cli/report.h"
#include "mesh/closest_point.h"

namespace bocst::program {
namespace {

using Eigen::Vector3d;

using Triangle = BoundedTriangle;

/// The part of the surface that lies inside one sphere.
class Inside {
 public:
  void reset(const Vector3d& center, double radius) {
    center_ = center;
    radius_ = radius;
    parts_.clear();
  }

  bool empty() const { return parts_.empty(); }

  void add(const Triangle& t) {
    const double slack = radius_ * (1 + 1e-9);
    const Vector3d nearest = closestOnTriangle(center_, t);
    if ((nearest - center_).norm() > slack) return;
    Part part{&t, nearest, {}, 0, true};
    for (int i = 0; i < 3; ++i) {
      const Vector3d& p = t.corner[i];
      part.whole &= (p - center_).norm() <= slack;
      // Where the edge crosses the sphere: |p + s e - center| = radius.
      const Vector3d e = t.corner[(i + 1) % 3] - p;
      const double a = e.squaredNorm();
      const double b = e.dot(p - center_);
      const double c = (p - center_).squaredNorm() - radius_ * radius_;
      const double root = b * b - a * c;
      if (!(a > 0) || root < 0) continue;
      for (const double sign : {-1.0, 1.0}) {
        const double s = (-b + sign * std::sqrt(root)) / a;
        if (s >= 0 && s <= 1) part.crossing[part.crossings++] = p + s * e;
      }
    }
    parts_.push_back(part);
  }

  /// The greatest distance from a point of the sphere to the surface inside.
  double error() {
    Vector3d best_direction = directions()[0];
    double best = 0;
    const auto try_direction = [&](const Vector3d& u) {
      const double d = distanceFrom(center_ + radius_ * u);
      if (d <= best) return false;
      best = d;
      best_direction = u;
      return true;
    };
    for (const Vector3d& u : directions()) try_direction(u);
    for (double angle = 0.25; angle > 0.01;) {
      const Vector3d u = best_direction;
      const Vector3d v = u.unitOrthogonal();
      const Vector3d w = u.cross(v);
      bool better = false;
      for (int i = 0; i < 6; ++i) {
        const Vector3d side = std::cos(i * M_PI / 3) * v + std::sin(i * M_PI / 3) * w;
        better |= try_direction(std::cos(angle) * u + std::sin(angle) * side);
      }
      if (!better) angle /= 2;
    }
    return best;
  }

 private:
  struct Part {
    const Triangle* triangle;
    Vector3d nearest;  // to the centre, so certainly inside
    std::array<Vector3d, 6> crossing;
    std::size_t crossings;
    bool whole;  // the sphere contains the triangle
  };

  /// From a point of the sphere to the nearest point of the surface inside.
  double distanceFrom(const Vector3d& s) {
    // Bounds by the triangles' own spheres first: most need no more.
    distances_.resize(parts_.size());
    std::size_t nearest = 0;
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      distances_[i] = (parts_[i].triangle->center - s).norm() - parts_[i].triangle->radius;
      if (distances_[i] < distances_[nearest]) nearest = i;
    }
    double best = distanceTo(parts_[nearest], s);
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      if (distances_[i] < best) best = std::min(best, distanceTo(parts_[i], s));
    }
    return best;
  }

  /// Triangle and ball are convex: the nearest point of what they share is that of the triangle if it lies in the ball,
  /// else it lies on the sphere: on the plane's circle inside the triangle, or where an edge crosses.
  double distanceTo(const Part& part, const Vector3d& s) const {
    const Triangle& t = *part.triangle;
    const Vector3d q = closestOnTriangle(s, t);
    if (part.whole || (q - center_).norm() <= radius_) return (q - s).norm();
    double best = (part.nearest - s).norm();
    for (std::size_t i = 0; i < part.crossings; ++i) best = std::min(best, (part.crossing[i] - s).norm());
    const Vector3d normal = (t.corner[1] - t.corner[0]).cross(t.corner[2] - t.corner[0]);
    const double square = normal.squaredNorm();
    if (square > 0) {
      const Vector3d middle = center_ - (center_ - t.corner[0]).dot(normal) / square * normal;
      const Vector3d flat = s - (s - t.corner[0]).dot(normal) / square * normal;
      const double circle2 = radius_ * radius_ - (middle - center_).squaredNorm();
      const double length = (flat - middle).norm();
      if (circle2 > 0 && length > 0) {
        const Vector3d p = middle + std::sqrt(circle2) / length * (flat - middle);
        if (isInside(t, normal, p)) best = std::min(best, (p - s).norm());
      }
    }
    return best;
  }

  Vector3d center_ = Vector3d::Zero();
  double radius_ = 0;
  std::vector<Part> parts_;
  std::vector<double> distances_;
};

/// Walks the tree downwards, so that each node looks at the triangles near its parent only.
class Walk {
 public:
  Walk(const Mesh& mesh, const std::vector<NodeView>& nodes)
      : nodes_(nodes),
        triangles_(boundedTriangles(mesh)),
        children_(nodes.size()),
        reach_(nodes.size()),
        progress_("error of node", nodes.size()) {
    std::unordered_map<std::uint32_t, std::size_t> at;
    at.reserve(nodes.size());
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      at[nodes[i].id] = i;
      reach_[i] = nodes[i].radius;
      if (nodes[i].parent != NodeView::kNone) children_[at.at(nodes[i].parent)].push_back(i);
    }
    // Children's spheres may stick out of their parent's: reach is the radius about a centre that holds all below.
    for (std::size_t i = nodes.size(); i-- > 0;) {
      for (const std::size_t child : children_[i]) {
        reach_[i] = std::max(reach_[i], (nodes[child].center - nodes[i].center).norm() + reach_[child]);
      }
    }
  }

  std::vector<LevelError> run() {
    if (nodes_.empty()) return {};
    std::vector<std::uint32_t> all(triangles_.size());
    for (std::size_t t = 0; t < all.size(); ++t) all[t] = static_cast<std::uint32_t>(t);
    visit(0, all);
    for (LevelError& level : levels_) level.average /= static_cast<double>(std::max<std::size_t>(level.nodes, 1));
    return std::move(levels_);
  }

 private:
  void visit(std::size_t i, const std::vector<std::uint32_t>& candidates) {
    const NodeView& node = nodes_[i];
    std::vector<std::uint32_t> near;
    inside_.reset(node.center, node.radius);
    for (const std::uint32_t t : candidates) {
      const double gap = (triangles_[t].center - node.center).norm() - triangles_[t].radius;
      if (gap > reach_[i] * (1 + 1e-9)) continue;
      near.push_back(t);
      if (gap <= node.radius * (1 + 1e-9)) inside_.add(triangles_[t]);
    }
    // A grey cell holds surface; should rounding have put all of it outside, the whole diameter is the honest figure.
    const double error = (inside_.empty() ? 2 * node.radius : inside_.error()) / (2 * nodes_[0].radius);
    const auto level = static_cast<std::size_t>(node.level) - 1;
    if (levels_.size() <= level) levels_.resize(level + 1);
    LevelError& sum = levels_[level];
    sum.min = sum.nodes == 0 ? error : std::min(sum.min, error);
    sum.max = std::max(sum.max, error);
    sum.average += error;
    ++sum.nodes;
    progress_.step();
    for (const std::size_t child : children_[i]) visit(child, near);
  }

  const std::vector<NodeView>& nodes_;
  std::vector<Triangle> triangles_;
  std::vector<std::vector<std::size_t>> children_;
  std::vector<double> reach_;
  std::vector<LevelError> levels_;
  Inside inside_;
  Progress progress_;
};

}  // namespace

std::vector<LevelError> errorByLevel(const Mesh& mesh, const std::vector<NodeView>& nodes) {
  return Walk(mesh, nodes).run();
}

}  // namespace bocst::program
