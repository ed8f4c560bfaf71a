// SPDX-License-Identifier: BSD-3-Clause
#include "mesh/sphere_fit.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "cli/report.h"
#include "mesh/closest_point.h"
#include "mesh/protrusion.h"

namespace bocst::program {
namespace {

using Eigen::Vector3d;

/// What is left of a triangle within a part: a convex polygon.
struct Piece {
  std::uint32_t triangle;
  std::vector<Vector3d> corners;
};

struct Part {
  std::vector<Piece> pieces;
  Eigen::AlignedBox3d box;
  Sphere sphere;
  double protrusion = 0;

  bool operator<(const Part& other) const { return protrusion < other.protrusion; }
};

/// The side of the plane x[axis] = at that is below it (sign 1) or above it (-1), both with the plane itself.
std::vector<Vector3d> clip(const std::vector<Vector3d>& corners, int axis, double at, double sign) {
  std::vector<Vector3d> kept;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Vector3d& p = corners[i];
    const Vector3d& q = corners[(i + 1) % corners.size()];
    const double beyond_p = sign * (p[axis] - at), beyond_q = sign * (q[axis] - at);
    if (beyond_p <= 0) kept.push_back(p);
    if (beyond_p * beyond_q < 0) {
      Vector3d crossing = p + beyond_p / (beyond_p - beyond_q) * (q - p);
      crossing[axis] = at;
      kept.push_back(crossing);
    }
  }
  return kept;
}

/// A ball about all corners, a few percent larger than the smallest: its centre moves towards the farthest corner, by
/// less each time (Badoiu and Clarkson).
Sphere ballAbout(const Part& part) {
  constexpr int kSteps = 64;
  Sphere best{part.box.center(), std::numeric_limits<double>::max()};
  Vector3d center = best.center;
  for (int step = 1; step <= kSteps; ++step) {
    const Vector3d* farthest = nullptr;
    double square = -1;
    for (const Piece& piece : part.pieces) {
      for (const Vector3d& p : piece.corners) {
        const double s = (p - center).squaredNorm();
        if (s > square) {
          square = s;
          farthest = &p;
        }
      }
    }
    if (std::sqrt(square) < best.radius) best = {center, std::sqrt(square)};
    center += (*farthest - center) / (step + 1);
  }
  best.radius *= 1 + 1e-12;  // for the rounding of distances
  return best;
}

class Fit {
 public:
  Fit(const Mesh& mesh, std::size_t count, double tolerance)
      : triangles_(boundedTriangles(mesh)),
        most_(count > 0 ? count : kMostSpheres),
        tolerance_(tolerance),
        enough_(count > 0 ? std::numeric_limits<double>::infinity() : tolerance) {
    Part all;
    all.pieces.reserve(triangles_.size());
    for (std::size_t t = 0; t < triangles_.size(); ++t) {
      const auto& c = triangles_[t].corner;
      all.pieces.push_back({static_cast<std::uint32_t>(t), {c.begin(), c.end()}});
    }
    add(std::move(all));
    const std::string what = count > 0 ? "sphere" : "sphere, at most";
    Progress progress(what, most_);
    while (parts_.size() + done_.size() < most_ && !parts_.empty()) {
      if (parts_.front().protrusion <= tolerance_) break;
      std::pop_heap(parts_.begin(), parts_.end());
      Part worst = std::move(parts_.back());
      parts_.pop_back();
      split(std::move(worst));
      progress.step();
    }
    const bool too_few = count == 0 && !parts_.empty() && parts_.front().protrusion > tolerance_;
    if (too_few) {
      throw std::runtime_error("more than " + std::to_string(kMostSpheres) + " spheres are needed for this tolerance");
    }
    for (const Part& part : parts_) done_.push_back({part.sphere, part.protrusion});
  }

  SphereFit result() const {
    SphereFit fit;
    for (const auto& [sphere, protrusion] : done_) {
      fit.spheres.push_back(sphere);
      fit.protrusion = std::max(fit.protrusion, protrusion);
      fit.average_protrusion += protrusion / static_cast<double>(done_.size());
    }
    fit.coverage = coverage(fit.spheres);
    return fit;
  }

 private:
  void add(Part part) {
    if (part.pieces.empty()) return;
    for (const Piece& piece : part.pieces) {
      for (const Vector3d& p : piece.corners) part.box.extend(p);
    }
    part.sphere = ballAbout(part);
    std::vector<std::uint32_t> near;  // whole triangles, which are on the surface, too
    near.reserve(part.pieces.size());
    for (const Piece& piece : part.pieces) near.push_back(piece.triangle);
    // A part that protrudes by more than the tolerance is cut, by however much it is.
    part.protrusion = protrusionOf(part.sphere.center, part.sphere.radius, triangles_, near, enough_);
    parts_.push_back(std::move(part));
    std::push_heap(parts_.begin(), parts_.end());
  }

  /// In the middle of its longest side.
  void split(Part part) {
    int axis = 0;
    const double side = part.box.sizes().maxCoeff(&axis);
    const double at = part.box.center()[axis];
    if (!(side > 0) || at <= part.box.min()[axis] || at >= part.box.max()[axis]) {
      done_.push_back({part.sphere, part.protrusion});  // as small as numbers can be
      return;
    }
    Part below, above;
    for (Piece& piece : part.pieces) {
      const auto [low, high] = std::minmax_element(piece.corners.begin(), piece.corners.end(),
                                                   [axis](const auto& a, const auto& b) { return a[axis] < b[axis]; });
      if ((*high)[axis] <= at) {
        below.pieces.push_back(std::move(piece));
      } else if ((*low)[axis] >= at) {
        above.pieces.push_back(std::move(piece));
      } else {
        below.pieces.push_back({piece.triangle, clip(piece.corners, axis, at, 1)});
        above.pieces.push_back({piece.triangle, clip(piece.corners, axis, at, -1)});
      }
    }
    add(std::move(below));
    add(std::move(above));
  }

  /// Samples evenly over the area, the same in each run.
  double coverage(const std::vector<Sphere>& spheres) const {
    constexpr std::size_t kSamples = 20000;
    std::vector<double> sums;
    double area = 0;
    for (const BoundedTriangle& t : triangles_) {
      area += (t.corner[1] - t.corner[0]).cross(t.corner[2] - t.corner[0]).norm();
      sums.push_back(area);
    }
    std::size_t covered = 0;
    for (std::size_t i = 0; i < kSamples; ++i) {
      const double at = (static_cast<double>(i) + 0.5) / kSamples;
      const auto found = std::upper_bound(sums.begin(), sums.end() - 1, at * area);
      const auto& c = triangles_[static_cast<std::size_t>(found - sums.begin())].corner;
      // The additive sequence of the plastic number, folded into the triangle.
      double u = std::fmod(0.7548776662466927 * static_cast<double>(i + 1), 1.0);
      double v = std::fmod(0.5698402909980532 * static_cast<double>(i + 1), 1.0);
      if (u + v > 1) {
        u = 1 - u;
        v = 1 - v;
      }
      const Vector3d p = c[0] + u * (c[1] - c[0]) + v * (c[2] - c[0]);
      covered += std::any_of(spheres.begin(), spheres.end(),
                             [&p](const Sphere& s) { return (p - s.center).norm() <= s.radius * (1 + 1e-12); });
    }
    return static_cast<double>(covered) / kSamples;
  }

  std::vector<BoundedTriangle> triangles_;
  std::size_t most_;
  double tolerance_;
  double enough_;                                // protrusions above this need not be known better
  std::vector<Part> parts_;                      // a heap: the first protrudes most
  std::vector<std::pair<Sphere, double>> done_;  // with its protrusion
};

}  // namespace

SphereFit fitSpheres(const Mesh& mesh, std::size_t count, double tolerance) {
  return Fit(mesh, count, tolerance).result();
}

}  // namespace bocst::program
