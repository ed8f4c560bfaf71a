// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// Distances of convex sets, by a way of its own: nothing of the library, and nothing of FCL's solvers, is in here.

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <functional>
#include <limits>
#include <vector>

namespace bocst::test {

/// A convex set: what is within `round` of a core, of which `support(d)` is the point farthest along d != 0. All of it
/// is within `reach` of `center`.
struct Solid {
  std::function<Eigen::Vector3d(const Eigen::Vector3d& d)> support;
  double round = 0;
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  double reach = 0;
  std::intptr_t id = 0;
};

/// The hull of some points.
inline Solid sweptHullOf(std::vector<Eigen::Vector3d> points) {
  Solid s;
  for (const auto& p : points) s.center += p / static_cast<double>(points.size());
  for (const auto& p : points) s.reach = std::max(s.reach, (p - s.center).norm());
  s.support = [points = std::move(points)](const Eigen::Vector3d& d) {
    return *std::max_element(points.begin(), points.end(),
                             [&](const auto& p, const auto& q) { return p.dot(d) < q.dot(d); });
  };
  return s;
}

/// The distance of two sets is no less than `low`, for a plane is that far from both, and no more than `high`, for two
/// of their points are that far from each other. Sets that meet have high == 0.
struct Interval {
  double low = 0, high = std::numeric_limits<double>::infinity();

  bool meets() const { return high == 0; }
};

/// The simplex of up to four points that is left when those are taken away which the point nearest to the origin does
/// not need; returns that point.
inline Eigen::Vector3d nearestOf(std::array<Eigen::Vector3d, 4>& w, int& count) {
  double least = std::numeric_limits<double>::infinity();
  Eigen::Vector3d best = w[0];
  int best_mask = 1;
  for (int mask = 1; mask < 1 << count; ++mask) {
    std::array<Eigen::Vector3d, 4> p;
    p.fill(Eigen::Vector3d::Zero());
    int n = 0;
    for (int k = 0; k < count; ++k) {
      if (mask & 1 << k) p[static_cast<std::size_t>(n++)] = w[static_cast<std::size_t>(k)];
    }
    // Weights of the nearest point of the flat through the points; all positive when it is between them.
    Eigen::Vector4d weight(1, 0, 0, 0);
    const Eigen::Vector3d u = p[1] - p[0], v = p[2] - p[0], t = p[3] - p[0];
    if (n == 2) {
      weight = Eigen::Vector4d(u.dot(p[1]), -u.dot(p[0]), 0, 0);
    } else if (n == 3) {
      const Eigen::Vector3d normal = u.cross(v);
      weight =
          Eigen::Vector4d(normal.dot(p[1].cross(p[2])), normal.dot(p[2].cross(p[0])), normal.dot(p[0].cross(p[1])), 0);
    } else if (n == 4) {
      weight = Eigen::Vector4d(p[1].dot(p[2].cross(p[3])), -p[0].dot(p[2].cross(p[3])), p[0].dot(p[1].cross(p[3])),
                               -p[0].dot(p[1].cross(p[2])));
      if (u.dot(v.cross(t)) < 0) weight = -weight;
    }
    if (!std::all_of(weight.data(), weight.data() + n, [](double x) { return x > 0; })) continue;
    weight /= weight.sum();
    Eigen::Vector3d x = Eigen::Vector3d::Zero();
    if (n < 4) {
      for (int k = 0; k < n; ++k) x += weight[k] * p[static_cast<std::size_t>(k)];
    }
    if (x.squaredNorm() < least) least = x.squaredNorm(), best = x, best_mask = mask;
  }
  int n = 0;
  for (int k = 0; k < count; ++k) {
    if (best_mask & 1 << k) w[static_cast<std::size_t>(n++)] = w[static_cast<std::size_t>(k)];
  }
  count = n;
  return best;
}

/// The distance of a, which is at X_BA, from b.
inline Interval distanceOf(const Solid& a, const Eigen::Isometry3d& X_BA, const Solid& b) {
  const double round = a.round + b.round;
  Eigen::Vector3d x = X_BA * a.center - b.center;
  if (x.squaredNorm() == 0) x = Eigen::Vector3d::UnitX();
  std::array<Eigen::Vector3d, 4> simplex;
  simplex.fill(Eigen::Vector3d::Zero());
  int count = 0;
  Interval core;
  for (int i = 0; i < 300; ++i) {
    const Eigen::Vector3d w = X_BA * a.support(X_BA.linear().transpose() * -x) - b.support(x);
    core.low = std::max(core.low, w.dot(x) / x.norm());
    if (i > 0 && core.high - core.low <= 1e-14 * (1 + core.high)) break;
    if (std::find(simplex.begin(), simplex.begin() + count, w) != simplex.begin() + count) break;
    simplex[static_cast<std::size_t>(count++)] = w;
    x = nearestOf(simplex, count);
    if (count == 4 || x.norm() < 1e-15 * (a.reach + b.reach)) {
      core.high = 0;
      break;
    }
    if (i > 100 && x.norm() >= core.high) break;
    core.high = std::min(core.high, x.norm());
  }
  return {std::max(core.low - round, 0.0), std::max(core.high - round, 0.0)};
}

/// A geometry as a union of convex sets, in its own frame.
using Solids = std::vector<Solid>;

/// A member of each of two unions.
struct Couple {
  std::size_t a, b;
  double at_least;
};

/// All couples whose balls are within `reach`, the nearest balls first.
inline std::vector<Couple> couples(const Solids& a, const Eigen::Isometry3d& X_BA, const Solids& b, double reach) {
  std::vector<Couple> all;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const Eigen::Vector3d center = X_BA * a[i].center;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const double d = (center - b[j].center).norm() - a[i].reach - b[j].reach;
      if (d <= reach) all.push_back({i, j, d});
    }
  }
  std::sort(all.begin(), all.end(), [](const Couple& p, const Couple& q) { return p.at_least < q.at_least; });
  return all;
}

inline bool meet(const Solids& a, const Eigen::Isometry3d& X_BA, const Solids& b) {
  for (const Couple& c : couples(a, X_BA, b, 0)) {
    if (distanceOf(a[c.a], X_BA, b[c.b]).meets()) return true;
  }
  return false;
}

inline Interval distanceOf(const Solids& a, const Eigen::Isometry3d& X_BA, const Solids& b) {
  Interval least;
  least.low = std::numeric_limits<double>::infinity();
  for (const Couple& c : couples(a, X_BA, b, std::numeric_limits<double>::infinity())) {
    if (c.at_least > least.high || least.high == 0) break;
    const Interval d = distanceOf(a[c.a], X_BA, b[c.b]);
    least.low = std::min(least.low, d.low);
    least.high = std::min(least.high, d.high);
  }
  least.low = std::min(least.low, least.high);
  return least;
}

}  // namespace bocst::test
