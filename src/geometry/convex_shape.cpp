// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/convex_shape.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "geometry/epa.h"

namespace bocst::query {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Rounding of a few sums of products, relative to the coordinates.
constexpr double kRounding = 4e-15;

/// Up to four points of a difference of convex sets, and the point of their hull that is nearest to the origin, as
/// weights (Gilbert, Johnson and Keerthi; sub-simplices by signed volumes after Montanari, Petrinic and Barbieri).
class Simplex {
 public:
  int size() const { return n_; }

  void add(const Vector3d& body, const Vector3d& points) {
    body_[n_] = body;
    points_[n_] = points;
    w_[n_] = body - points;
    ++n_;
  }

  bool has(const Vector3d& w) const { return std::find(w_, w_ + n_, w) != w_ + n_; }

  /// Leaves only the points that the nearest point needs. False when the origin is inside, which then is that point.
  bool reduce() {
    Face best;
    switch (n_) {
      case 1:
        best = point(0);
        break;
      case 2:
        best = segment(0, 1);
        break;
      case 3:
        best = triangle(0, 1, 2);
        break;
      default:
        if (tetrahedron(best)) return false;
    }
    Simplex kept;
    for (int i = 0; i < best.n; ++i) {
      kept.body_[i] = body_[best.index[i]];
      kept.points_[i] = points_[best.index[i]];
      kept.w_[i] = w_[best.index[i]];
      kept.weight_[i] = best.weight[i];
    }
    kept.n_ = best.n;
    kept.nearest_ = best.nearest;
    *this = kept;
    return true;
  }

  const Vector3d& nearest() const { return nearest_; }
  const Vector3d& at(int i) const { return w_[i]; }
  Vector3d onBody() const { return sum(body_); }
  Vector3d onPoints() const { return sum(points_); }

 private:
  struct Face {
    int index[3] = {0, 0, 0};
    double weight[3] = {0, 0, 0};
    int n = 0;
    // Of the hull, to the origin. Its direction is right even where it is much shorter than the corners are far.
    Vector3d nearest = Vector3d::Constant(std::numeric_limits<double>::infinity());
  };

  Vector3d sum(const Vector3d (&x)[4]) const {
    Vector3d s = weight_[0] * x[0];
    for (int i = 1; i < n_; ++i) s += weight_[i] * x[i];
    return s;
  }

  Face point(int a) const {
    Face f;
    f.n = 1;
    f.index[0] = a;
    f.weight[0] = 1;
    f.nearest = w_[a];
    return f;
  }

  Face segment(int a, int b) const {
    const Vector3d d = w_[b] - w_[a];
    const double dd = d.squaredNorm(), t = -d.dot(w_[a]);
    if (!(t > 0)) return point(a);
    if (!(t < dd)) return point(b);
    Face f;
    f.n = 2;
    f.index[0] = a;
    f.index[1] = b;
    f.weight[1] = t / dd;
    f.weight[0] = 1 - f.weight[1];
    f.nearest = w_[a] + f.weight[1] * d;
    f.nearest -= d * (d.dot(f.nearest) / dd);
    return f;
  }

  static const Face& nearer(const Face& f, const Face& g) {
    return g.nearest.squaredNorm() < f.nearest.squaredNorm() ? g : f;
  }

  Face triangle(int a, int b, int c) const {
    const Vector3d e = w_[b] - w_[a], d = w_[c] - w_[a], n = e.cross(d);
    const double nn = n.squaredNorm();
    // Of a sliver, the normal is rounding.
    if (nn > 1e-24 * e.squaredNorm() * d.squaredNorm()) {
      int k = 0;
      n.cwiseAbs().maxCoeff(&k);
      // Areas in the plane of two axes in which the triangle is largest.
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      const Vector3d foot = n * (n.dot(w_[a]) / nn);
      const auto area = [&](const Vector3d& u, const Vector3d& v) {
        return (u[i] - foot[i]) * (v[j] - foot[j]) - (u[j] - foot[j]) * (v[i] - foot[i]);
      };
      const double all = n[k];
      const double l[3] = {area(w_[b], w_[c]) / all, area(w_[c], w_[a]) / all, area(w_[a], w_[b]) / all};
      if (l[0] > 0 && l[1] > 0 && l[2] > 0) {
        Face f;
        const double total = l[0] + l[1] + l[2];
        const int index[3] = {a, b, c};
        f.n = 3;
        for (int m = 0; m < 3; ++m) {
          f.index[m] = index[m];
          f.weight[m] = l[m] / total;
        }
        f.nearest = foot;
        return f;
      }
    }
    return nearer(segment(a, b), nearer(segment(b, c), segment(c, a)));
  }

  // True when the origin is inside, with its weights; else the nearest face.
  bool tetrahedron(Face& best) {
    static constexpr int kFaces[4][4] = {{0, 1, 2, 3}, {0, 3, 1, 2}, {0, 2, 3, 1}, {1, 3, 2, 0}};
    double size = 0, volume[4], sum = 0;
    for (const Vector3d& w : w_) size = std::max(size, w.lpNorm<1>());
    bool is_within[4], is_inside = true;
    for (int i = 0; i < 4; ++i) {
      const auto& f = kFaces[i];
      const Vector3d e = w_[f[1]] - w_[f[0]], d = w_[f[2]] - w_[f[0]], n = e.cross(d);
      const double origin = -n.dot(w_[f[0]]), other = n.dot(w_[f[3]] - w_[f[0]]);
      // True if the origin is on the same side as the fourth corner, and both are surely off the plane.
      const double least = kRounding * size * e.norm() * d.norm();
      is_within[i] = (origin > least && other > least) || (origin < -least && other < -least);
      is_inside = is_inside && is_within[i];
      volume[f[3]] = std::abs(origin);
      sum += volume[f[3]];
    }
    if (is_inside) {
      for (int i = 0; i < 4; ++i) weight_[i] = volume[i] / sum;
      return true;
    }
    for (int i = 0; i < 4; ++i) {
      if (!is_within[i]) best = nearer(best, triangle(kFaces[i][0], kFaces[i][1], kFaces[i][2]));
    }
    return false;
  }

  Vector3d w_[4], body_[4], points_[4], nearest_;
  double weight_[4] = {1, 0, 0, 0};
  int n_ = 0;
};

}  // namespace

SweptHull sweptHullOf(const OrientedVolume& box) {
  SweptHull hull;
  cornersOf(box, SimilarityTransform(), hull.corners);
  hull.count = 8;
  return hull;
}

SupportShape::SupportShape(const Vector3d& center, const Vector3d& half_of_core, double radius) : radius_(radius) {
  box_.center = center;
  box_.half = half_of_core + Vector3d::Constant(radius);
}

DifferenceShape::DifferenceShape(const SupportShape& a, const SupportShape& b, const Eigen::Isometry3d& X_AB)
    : SupportShape(a.box().center - X_AB * b.box().center,
                   a.box().half + X_AB.linear().cwiseAbs() * b.box().half - Vector3d::Constant(a.radius()),
                   a.radius() + b.radius()),
      a_(a),
      b_(b),
      X_AB_(X_AB) {}

SeparationResult SupportShape::coreGap(const PointSet& points, double cutoff) const {
  constexpr int kMostSteps = 200, kPatience = 12;
  SeparationResult gap;
  gap.at_least = -std::numeric_limits<double>::infinity();
  Simplex simplex;
  Vector3d v = box_.center - points.middle();
  if (!(v.squaredNorm() > 0)) v = Vector3d::UnitX();
  double size = 0;
  int improved = 0;
  for (int step = 0; step < kMostSteps && step - improved < kPatience; ++step) {
    const Vector3d p = support(-v), &q = points.support(v);
    const Vector3d w = p - q;
    size = std::max(size, p.lpNorm<1>() + q.lpNorm<1>());
    // All of the difference lies beyond this plane.
    const double beyond = v.dot(w) / v.norm() - kRounding * size;
    if (beyond > gap.at_least) {
      gap.at_least = beyond;
      gap.normal = -v / v.norm();
      improved = step;
    }
    if (gap.at_least > cutoff) return gap;
    const double tolerance = 1e-13 * gap.distance + 2 * kRounding * size;
    if (step > 0 && (gap.distance - gap.at_least <= tolerance || simplex.has(w))) return gap;
    simplex.add(p, q);
    const bool inside = !simplex.reduce();
    v = simplex.nearest();
    if (inside || v.norm() <= kRounding * size) {
      gap.at_least = gap.distance = 0;
      gap.on_body = gap.on_points = simplex.onPoints();
      gap.around_count = simplex.size();
      for (int i = 0; i < simplex.size(); ++i) gap.around[i] = simplex.at(i);
      return gap;
    }
    const double distance = (simplex.onBody() - simplex.onPoints()).norm();
    if (distance < gap.distance) {
      gap.distance = distance;
      gap.on_body = simplex.onBody();
      gap.on_points = simplex.onPoints();
      improved = step;
    }
  }
  return gap;
}

double SupportShape::boxGap(const PointSet& points) const {
  Vector3d lo = points.x[0], hi = points.x[0];
  for (int i = 1; i < points.count; ++i) {
    lo = lo.cwiseMin(points.x[i]);
    hi = hi.cwiseMax(points.x[i]);
  }
  const Vector3d apart = (lo - box_.center).cwiseMax(box_.center - hi) - box_.half;
  const double size = std::max(lo.lpNorm<Eigen::Infinity>(), hi.lpNorm<Eigen::Infinity>()) + box_.half.maxCoeff();
  return apart.cwiseMax(0).norm() - kRounding * size;
}

SeparationResult SupportShape::gap(const PointSet& points, double cutoff) const {
  SeparationResult gap;
  // For most triangles of a leaf this is enough.
  gap.at_least = boxGap(points);
  if (gap.at_least > cutoff) return gap;
  for (int i = 0; i < points.count; ++i) {
    if (!contains(points.x[i])) continue;
    gap.at_least = gap.distance = 0;
    gap.on_body = gap.on_points = points.x[i];
    gap.around[0].setZero();
    gap.around_count = 1;
    return gap;
  }
  gap = coreGap(points, cutoff + radius_);
  const double core = gap.distance;
  gap.at_least -= radius_;
  if (gap.isTouching()) {
    gap.distance = 0;
    gap.on_body = gap.on_points;
  } else if (std::isfinite(core)) {
    gap.distance = std::max(core - radius_, 0.0);
    if (core > 0) gap.on_body += (gap.on_points - gap.on_body) * std::min(radius_ / core, 1.0);
  }
  return gap;
}

double SupportShape::gapAlong(const Vector3d& direction, const PointSet& points) const {
  const Vector3d p = support(direction), &q = points.support(-direction);
  return direction.dot(q - p) - kRounding * (p.lpNorm<1>() + q.lpNorm<1>()) - radius_;
}

ContactPoint SupportShape::penetration(const PointSet& points, const SeparationResult& gap) const {
  constexpr double kTolerance = 0.1;
  ContactPoint contact;
  contact.point = gap.on_points;
  if (gap.around_count == 0) {
    // The cores are apart, or all but: along this direction by at_least.
    contact.normal = gap.normal;
    contact.depth = std::max(-gap.at_least, 0.0);
    contact.point += contact.normal * (contact.depth / 2);
    return contact;
  }
  Epa epa(box_.center.lpNorm<1>() + box_.half.lpNorm<1>() + points.x[0].lpNorm<1>());
  for (int i = 0; i < gap.around_count; ++i) epa.add(gap.around[i]);
  const Vector3d normal =
      epa.run([&](const Vector3d& d) { return Vector3d(support(d) - points.support(-d)); }, kTolerance);
  contact = along(normal.squaredNorm() > 0 ? normal : Vector3d(Vector3d::UnitX()), points);
  if (!epa.settled()) contact = shorten(contact, points);
  contact.depth = std::max(contact.depth, 0.0);
  contact.point = gap.on_points;
  return contact;
}

// Where points have been moved out of the body, the shortest way on to them is a better normal: along it they overlap
// by no more than they were moved, less the gap. What overlaps a curved body by little is soon there.
ContactPoint SupportShape::shorten(ContactPoint contact, const PointSet& points) const {
  constexpr int kMostPoints = 8, kMostSteps = 6;
  Vector3d moved[kMostPoints];
  if (points.count > kMostPoints) return contact;
  for (int step = 0; step < kMostSteps && contact.depth > 0; ++step) {
    for (int i = 0; i < points.count; ++i) moved[i] = points.x[i] + contact.normal * contact.depth;
    const SeparationResult gap = coreGap({moved, points.count}, std::numeric_limits<double>::infinity());
    const Vector3d displacement = gap.on_points - gap.on_body;
    if (gap.isTouching() || !(displacement.squaredNorm() > 0)) break;
    const ContactPoint better = along(displacement.normalized(), points);
    const bool settled = !(better.depth < 0.9 * contact.depth);
    if (better.depth < contact.depth) contact = better;
    if (settled) break;
  }
  return contact;
}

ContactPoint SupportShape::along(const Vector3d& normal, const PointSet& points) const {
  ContactPoint contact;
  contact.normal = normal;
  contact.depth = normal.dot(support(normal) - points.support(-normal)) + radius_;
  return contact;
}

BoxShape::BoxShape(const Vector3d& half) : SupportShape(Vector3d::Zero(), half, 0), half_(half) {}

bool BoxShape::contains(const Vector3d& x) const { return ((half_ - x.cwiseAbs()).array() > 0).all(); }

bool EllipsoidShape::contains(const Vector3d& x) const { return x.cwiseQuotient(radii_).squaredNorm() < 1; }

bool RoundShape::contains(const Vector3d& x) const {
  if (!(std::abs(x.z()) < half_length_)) return false;
  const double radius = bottom_ + (top_ - bottom_) * ((x.z() + half_length_) / (2 * half_length_));
  return x.x() * x.x() + x.y() * x.y() < radius * radius;
}

// All the directions in which a box and a triangle can be apart.
ContactPoint BoxShape::penetration(const PointSet& points, const SeparationResult& gap) const {
  if (points.count > 3) return SupportShape::penetration(points, gap);
  ContactPoint contact;
  contact.depth = std::numeric_limits<double>::infinity();
  const auto consider = [&](const Vector3d& axis, double least) {
    const double length = axis.norm();
    if (!(length > least)) return;
    double lo = axis.dot(points.x[0]), hi = lo;
    for (int i = 1; i < points.count; ++i) {
      const double h = axis.dot(points.x[i]);
      lo = std::min(lo, h);
      hi = std::max(hi, h);
    }
    const double depth = (axis.cwiseAbs().dot(half_) + std::min(-lo, hi)) / length;
    if (!(depth < contact.depth)) return;
    contact.depth = depth;
    contact.normal = axis / (-lo < hi ? length : -length);
  };
  for (int k = 0; k < 3; ++k) consider(Vector3d::Unit(k), 0);
  for (int i = 0; i < points.count; ++i) {
    const Vector3d e = points.x[(i + 1) % points.count] - points.x[i];
    // Nearly parallel edges: their cross product is rounding.
    const double least = 1e-10 * e.norm();
    if (i == 0 && points.count == 3) consider(e.cross(points.x[2] - points.x[0]), 0);
    consider(Vector3d(0, e.z(), -e.y()), least);
    consider(Vector3d(-e.z(), 0, e.x()), least);
    consider(Vector3d(e.y(), -e.x(), 0), least);
  }
  contact.depth = std::max(contact.depth, 0.0);
  contact.point = gap.on_points;
  return contact;
}

Vector3d BoxShape::support(const Vector3d& d) const {
  return Vector3d(d[0] < 0 ? -half_[0] : half_[0], d[1] < 0 ? -half_[1] : half_[1], d[2] < 0 ? -half_[2] : half_[2]);
}

CapsuleShape::CapsuleShape(double radius, double length)
    : SupportShape(Vector3d::Zero(), Vector3d(0, 0, length / 2), radius), half_length_(length / 2) {}

Vector3d CapsuleShape::support(const Vector3d& d) const {
  return Vector3d(0, 0, d[2] < 0 ? -half_length_ : half_length_);
}

SweptHull CapsuleShape::hull() const {
  SweptHull hull;
  hull.count = half_length_ > 0 ? 2 : 1;
  hull.corners[0] = Vector3d(0, 0, half_length_);
  hull.corners[1] = Vector3d(0, 0, -half_length_);
  hull.radius = radius_;
  return hull;
}

EllipsoidShape::EllipsoidShape(const Vector3d& radii) : SupportShape(Vector3d::Zero(), radii, 0), radii_(radii) {}

Vector3d EllipsoidShape::support(const Vector3d& d) const {
  const Vector3d scaled = d.cwiseProduct(radii_);
  const double length = scaled.norm();
  return length > 0 ? Vector3d(scaled.cwiseProduct(radii_) / length) : Vector3d(Vector3d::Zero());
}

RoundShape::RoundShape(double bottom, double top, double length)
    : SupportShape(Vector3d::Zero(), Vector3d(std::max(bottom, top), std::max(bottom, top), length / 2), 0),
      bottom_(bottom),
      top_(top),
      half_length_(length / 2) {}

Vector3d RoundShape::support(const Vector3d& d) const {
  const double out = std::sqrt(d[0] * d[0] + d[1] * d[1]);
  const bool up = d[2] * half_length_ + out * top_ > -d[2] * half_length_ + out * bottom_;
  const double radius = out > 0 ? (up ? top_ : bottom_) / out : 0;
  return Vector3d(d[0] * radius, d[1] * radius, up ? half_length_ : -half_length_);
}

TriangleShape::TriangleShape(const Corners& corners) : SupportShape(boxOf(corners), 0), corners_(corners) {}

Vector3d TriangleShape::support(const Vector3d& d) const { return PointSet{corners_.data(), 3}.support(d); }

namespace {

// A point, a segment or a triangle as a triangle.
Corners asTriangle(const PointSet& points) {
  const auto at = [&points](int k) { return points.x[std::min(k, points.count - 1)]; };
  return {at(0), at(1), at(2)};
}

}  // namespace

SeparationResult TriangleShape::gap(const PointSet& points, double cutoff) const {
  if (points.count > 3) return SupportShape::gap(points, cutoff);
  SeparationResult gap;
  const Corners other = asTriangle(points);
  gap.distance = nearestPoints(corners_, other, gap.on_body, gap.on_points);
  if (gap.distance > 0) gap.normal = (gap.on_points - gap.on_body) / gap.distance;
  double size = 0;
  for (int k = 0; k < 3; ++k) size = std::max({size, corners_[k].lpNorm<1>(), other[k].lpNorm<1>()});
  gap.at_least = gap.distance - kRounding * size;
  if (gap.isTouching()) gap.distance = 0;
  return gap;
}

SweptHull TriangleShape::hull() const {
  SweptHull hull;
  hull.count = 3;
  std::copy(corners_.begin(), corners_.end(), hull.corners);
  return hull;
}

ContactPoint TriangleShape::penetration(const PointSet& points, const SeparationResult& gap) const {
  if (points.count > 3) return SupportShape::penetration(points, gap);
  const Corners other = asTriangle(points);
  ContactPoint contact = trianglePenetration(corners_, other);
  // Triangles that are apart by no more than a query's rounding.
  if (!contact.point.allFinite()) contact.point = (gap.on_body + gap.on_points) / 2;
  return contact;
}

namespace {

constexpr double kFar = std::numeric_limits<double>::infinity();

// The box from `lo` to `hi` along n that covers the region sideways.
OrientedVolume layer(const Vector3d& n, double lo, double hi, const Sphere& region) {
  OrientedVolume box;
  box.axes.col(0) = n;
  box.axes.col(1) = n.unitOrthogonal();
  box.axes.col(2) = n.cross(box.axes.col(1));
  box.half = Vector3d((hi - lo) / 2, region.radius, region.radius);
  box.center = region.center + n * ((lo + hi) / 2 - n.dot(region.center));
  return box;
}

}  // namespace

PlaneShape::PlaneShape(const Vector3d& normal, double height, const Sphere& region)
    : normal_(normal), height_(height), is_half_space_(false) {
  box_ = layer(normal, height, height, region);
}

PlaneShape::PlaneShape(const Vector3d& normal, double height, const Sphere& region, double floor)
    : normal_(normal), height_(height), is_half_space_(true) {
  box_ = layer(normal, floor, height, region);
}

HalfspaceShape::HalfspaceShape(const Vector3d& normal, double height, const Sphere& region)
    : PlaneShape(normal, height, region, std::min(height, normal.dot(region.center)) - 2 * region.radius) {}

SeparationResult PlaneShape::gap(const PointSet& points, double) const {
  SeparationResult gap;
  // Points are never below a half-space.
  const Vector3d &low = points.support(-normal_), &high = is_half_space_ ? low : points.support(normal_);
  const double above = normal_.dot(low) - height_, below = is_half_space_ ? -kFar : height_ - normal_.dot(high);
  gap.on_points = above > below ? low : high;
  gap.normal = above > below ? normal_ : Vector3d(-normal_);
  const double apart = std::max(above, below);
  gap.at_least = apart - kRounding * (gap.on_points.lpNorm<1>() + std::abs(height_));
  gap.distance = gap.isTouching() ? 0 : apart;
  if (gap.isTouching() && above + below < 0) {
    // Rounding may put both on one side.
    gap.on_body = gap.on_points = low + (high - low) * std::clamp(above / (above + below), 0.0, 1.0);
  } else {
    gap.on_body = gap.on_points - normal_ * (normal_.dot(gap.on_points) - height_);
  }
  return gap;
}

double PlaneShape::gapAlong(const Vector3d& direction, const PointSet& points) const {
  const SeparationResult gap = PlaneShape::gap(points, 0);
  return direction == gap.normal ? gap.at_least : -kFar;
}

ContactPoint PlaneShape::penetration(const PointSet& points, const SeparationResult&) const {
  const Vector3d &low = points.support(-normal_), &high = is_half_space_ ? low : points.support(normal_);
  const double up = height_ - normal_.dot(low), down = is_half_space_ ? kFar : normal_.dot(high) - height_;
  ContactPoint contact;
  contact.normal = up <= down ? normal_ : Vector3d(-normal_);
  contact.depth = std::max(std::min(up, down), 0.0);
  contact.point = (up <= down ? low : high) + contact.normal * (contact.depth / 2);
  return contact;
}

}  // namespace bocst::query
