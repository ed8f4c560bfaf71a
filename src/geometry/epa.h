// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <limits>

namespace bocst::query {

/// Finds the direction along which a convex set that contains the origin extends least: if the set is a difference of
/// two, the shortest translation that ends their overlap. It expands a polytope of the set's points at the face nearest
/// to the origin (van den Bergen's EPA). No allocation; 2 KB on the stack.
class Epa {
 public:
  /// `size`: no coordinate of the set is much larger.
  explicit Epa(double size) : tiny_(1e-12 * size) {}

  /// A point of the set; at most four, and the origin must lie in their hull.
  void add(const Eigen::Vector3d& point) { points_[count_++] = point; }

  /// support(n) is the point of the set that is farthest along the unit direction n. The extent along the direction
  /// that is returned exceeds the least one by at most the part `tolerance` of itself, unless rounding ends the search:
  /// then it is the least of those that were tried. Zero if none was.
  template <typename Support>
  Eigen::Vector3d run(const Support& support, double tolerance) {
    if (!fill(support)) return direction_;
    for (int step = 0; step < kMostSteps; ++step) {
      const Face& nearest = *std::min_element(faces_, faces_ + face_count_,
                                              [](const Face& f, const Face& g) { return f.distance < g.distance; });
      const Eigen::Vector3d normal = nearest.normal;
      const double lowest = nearest.distance;
      const Eigen::Vector3d w = support(normal);
      consider(normal, w);
      // The polytope is inside the set, so the set extends at least as far as the nearest face.
      settled_ = extent_ - lowest <= tolerance * extent_ + tiny_;
      if (settled_ || !expand(w)) break;
    }
    return direction_;
  }

  /// The last run() reached its tolerance: neither rounding nor the number of steps ended it.
  bool settled() const { return settled_; }

 private:
  static constexpr int kMostSteps = 32, kMostFaces = 2 * (kMostSteps + 4);

  struct Face {
    int corner[3];
    Eigen::Vector3d normal;
    double distance;
  };
  struct Edge {
    int from, to;
  };

  void consider(const Eigen::Vector3d& normal, const Eigen::Vector3d& w) {
    const double extent = normal.dot(w);
    if (extent < extent_) {
      extent_ = extent;
      direction_ = normal;
    }
  }

  // Adds the farther of the set's ends along an axis, unless the set is flat there: then there is the shortest way.
  template <typename Support>
  bool addAlong(const Eigen::Vector3d& axis, double height, const Support& support) {
    const Eigen::Vector3d up = support(axis), down = support(-axis);
    consider(axis, up);
    consider(-axis, down);
    const double above = axis.dot(up) - height, below = height - axis.dot(down);
    if (!(std::max(above, below) > tiny_)) return false;
    add(above > below ? up : down);
    return true;
  }

  // Adds points up to a tetrahedron, and its faces.
  template <typename Support>
  bool fill(const Support& support) {
    const auto& p = points_;
    if (count_ == 1 && !addAlong(Eigen::Vector3d::UnitX(), p[0].x(), support)) return false;
    if (count_ == 2) {
      const Eigen::Vector3d axis = (p[1] - p[0]).unitOrthogonal();
      if (!addAlong(axis, axis.dot(p[0]), support)) return false;
    }
    if (count_ == 3) {
      const Eigen::Vector3d across = (p[1] - p[0]).cross(p[2] - p[0]);
      const double length = across.norm();
      if (!(length > 0)) return false;
      const Eigen::Vector3d axis = across / length;
      if (!addAlong(axis, axis.dot(p[0]), support)) return false;
    }
    const bool turned = (p[1] - p[0]).cross(p[2] - p[0]).dot(p[3] - p[0]) > 0;
    static constexpr int kFaces[4][3] = {{0, 1, 2}, {0, 3, 1}, {0, 2, 3}, {1, 3, 2}};
    for (const auto& f : kFaces) {
      if (!addFace(f[0], turned ? f[2] : f[1], turned ? f[1] : f[2])) return false;
    }
    return true;
  }

  bool addFace(int a, int b, int c) {
    Face& f = faces_[face_count_];
    f = {{a, b, c}, (points_[b] - points_[a]).cross(points_[c] - points_[a]), 0};
    const double length = f.normal.norm();
    if (!(length > tiny_ * tiny_)) return false;
    f.normal /= length;
    f.distance = f.normal.dot(points_[a]);
    ++face_count_;
    return true;
  }

  // Removes the faces that the new point sees and closes the hole with faces to it. False if the
  // point adds nothing, or if there is no room for more faces.
  bool expand(const Eigen::Vector3d& w) {
    const int point = static_cast<int>(count_);
    points_[count_++] = w;
    Edge rim[kMostFaces];
    int rim_count = 0;
    const auto pass = [&](int from, int to) {
      // An edge between two faces that go is met in both directions.
      for (int i = 0; i < rim_count; ++i) {
        if (rim[i].from == to && rim[i].to == from) {
          rim[i] = rim[--rim_count];
          return true;
        }
      }
      if (rim_count == kMostFaces) return false;
      rim[rim_count++] = {from, to};
      return true;
    };
    for (int i = 0; i < face_count_;) {
      const Face& f = faces_[i];
      if (f.normal.dot(w) - f.distance <= tiny_) {
        ++i;
        continue;
      }
      for (int k = 0; k < 3; ++k) {
        if (!pass(f.corner[k], f.corner[(k + 1) % 3])) return false;
      }
      faces_[i] = faces_[--face_count_];
    }
    if (rim_count < 3 || face_count_ + rim_count > kMostFaces) return false;
    for (int i = 0; i < rim_count; ++i) {
      if (!addFace(rim[i].from, rim[i].to, point)) return false;
    }
    return true;
  }

  const double tiny_;
  Eigen::Vector3d points_[kMostSteps + 4];
  std::size_t count_ = 0;
  Face faces_[kMostFaces];
  bool settled_ = false;
  int face_count_ = 0;
  Eigen::Vector3d direction_ = Eigen::Vector3d::Zero();
  double extent_ = std::numeric_limits<double>::infinity();
};

}  // namespace bocst::query
