// SPDX-License-Identifier: BSD-3-Clause
#include "query/body.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

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

  bool has(const Vector3d& w) const {
    for (int i = 0; i < n_; ++i) {
      if (w_[i] == w) return true;
    }
    return false;
  }

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
        if (tetrahedron(best)) {
          weighOrigin();
          return false;
        }
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

  // The weights of the origin inside a tetrahedron: its volumes with the faces.
  void weighOrigin() {
    const auto volume = [this](int a, int b, int c) { return w_[a].dot(w_[b].cross(w_[c])); };
    weight_[0] = volume(1, 2, 3);
    weight_[1] = -volume(0, 2, 3);
    weight_[2] = volume(0, 1, 3);
    weight_[3] = -volume(0, 1, 2);
    const double total = weight_[0] + weight_[1] + weight_[2] + weight_[3];
    for (double& weight : weight_) weight /= total;
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

  // True when the origin is inside, else the nearest face.
  bool tetrahedron(Face& best) const {
    static constexpr int kFaces[4][4] = {{0, 1, 2, 3}, {0, 3, 1, 2}, {0, 2, 3, 1}, {1, 3, 2, 0}};
    double size = 0;
    for (const Vector3d& w : w_) size = std::max(size, w.lpNorm<1>());
    bool inside = true;
    for (const auto& f : kFaces) {
      const Vector3d e = w_[f[1]] - w_[f[0]], d = w_[f[2]] - w_[f[0]], n = e.cross(d);
      const double origin = -n.dot(w_[f[0]]), other = n.dot(w_[f[3]] - w_[f[0]]);
      // On the same side as the fourth corner, and both surely off the plane?
      const double least = kRounding * size * e.norm() * d.norm();
      const bool within = (origin > least && other > least) || (origin < -least && other < -least);
      if (within) continue;
      inside = false;
      best = nearer(best, triangle(f[0], f[1], f[2]));
    }
    return inside;
  }

  Vector3d w_[4], body_[4], points_[4], nearest_;
  double weight_[4] = {1, 0, 0, 0};
  int n_ = 0;
};

}  // namespace

Hull hullOf(const OrientedVolume& box) {
  Hull hull;
  cornersOf(box, Placement(), hull.corners);
  hull.count = 8;
  return hull;
}

ConvexBody::ConvexBody(const Vector3d& center, const Vector3d& half_of_core, double radius) : radius_(radius) {
  box_.center = center;
  box_.half = half_of_core + Vector3d::Constant(radius);
}

Gap ConvexBody::coreGap(const Points& points, double enough) const {
  constexpr int kMostSteps = 200, kPatience = 12;
  Gap gap;
  gap.atLeast = -std::numeric_limits<double>::infinity();
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
    if (beyond > gap.atLeast) {
      gap.atLeast = beyond;
      gap.normal = -v / v.norm();
      improved = step;
    }
    if (gap.atLeast > enough) return gap;
    const double tolerance = 1e-13 * gap.distance + 2 * kRounding * size;
    if (step > 0 && (gap.distance - gap.atLeast <= tolerance || simplex.has(w))) return gap;
    simplex.add(p, q);
    const bool inside = !simplex.reduce();
    v = simplex.nearest();
    if (inside || v.norm() <= kRounding * size) {
      gap.atLeast = gap.distance = 0;
      gap.on_body = gap.on_points = simplex.onPoints();
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

double ConvexBody::boxGap(const Points& points) const {
  Vector3d lo = points.x[0], hi = points.x[0];
  for (int i = 1; i < points.count; ++i) {
    lo = lo.cwiseMin(points.x[i]);
    hi = hi.cwiseMax(points.x[i]);
  }
  const Vector3d apart = (lo - box_.center).cwiseMax(box_.center - hi) - box_.half;
  const double size = std::max(lo.lpNorm<Eigen::Infinity>(), hi.lpNorm<Eigen::Infinity>()) + box_.half.maxCoeff();
  return apart.cwiseMax(0).norm() - kRounding * size;
}

Gap ConvexBody::gap(const Points& points, double enough) const {
  Gap gap;
  // For most triangles of a leaf this is enough.
  gap.atLeast = boxGap(points);
  if (gap.atLeast > enough) return gap;
  gap = coreGap(points, enough + radius_);
  const double core = gap.distance;
  gap.atLeast -= radius_;
  if (gap.touches()) {
    gap.distance = 0;
    gap.on_body = gap.on_points;
  } else if (std::isfinite(core)) {
    gap.distance = std::max(core - radius_, 0.0);
    if (core > 0) gap.on_body += (gap.on_points - gap.on_body) * std::min(radius_ / core, 1.0);
  }
  return gap;
}

Touch ConvexBody::part(const Points& points) const {
  Touch touch;
  const Gap core = coreGap(points, std::numeric_limits<double>::infinity());
  if (radius_ > 0 && !core.touches()) {
    // Straight on from the core, for nothing of the points is nearer along this line.
    touch.normal = (core.on_points - core.on_body).normalized();
    touch.depth = std::max(radius_ - core.distance, 0.0);
    touch.point = core.on_points + touch.normal * (touch.depth / 2);
    return touch;
  }
  // The best of many directions, and of curved bodies downhill from there.
  constexpr std::size_t kStarts = 4;
  std::array<Touch, kStarts> starts;
  for (Touch& start : starts) start.depth = std::numeric_limits<double>::infinity();
  const auto consider = [&](const Vector3d& axis) {
    const double length = axis.norm();
    if (!(length > 0)) return;
    for (const double sign : {1.0, -1.0}) {
      const Touch way = along(axis * (sign / length), points);
      std::size_t i = kStarts;
      for (; i > 0 && way.depth < starts[i - 1].depth; --i) {
        if (i < kStarts) starts[i] = starts[i - 1];
      }
      if (i < kStarts) starts[i] = way;
    }
  };
  const Vector3d middle = points.middle(), &center = box_.center;
  consider(middle - center);
  for (int k = 0; k < 3; ++k) consider(box_.axes.col(k));
  for (int i = 0; i < points.count && points.count <= 3; ++i) {
    const Vector3d& corner = points.x[i];
    const Vector3d e = points.x[(i + 1) % points.count] - corner, f = points.x[(i + 2) % points.count] - corner;
    const Vector3d n = e.cross(f);
    if (i == 0) consider(n);
    if (!isBox()) {
      consider(e.cross(n));
      consider(corner - center);
      const double ee = e.squaredNorm();
      if (ee > 0) consider(corner - center + e * std::clamp(e.dot(center - corner) / ee, 0.0, 1.0));
    }
    for (int k = 0; k < 3; ++k) {
      const Vector3d c = e.cross(box_.axes.col(k));
      // Nearly parallel edges: their cross product is rounding.
      if (c.norm() > 1e-10 * e.norm()) consider(c);
    }
  }
  touch = starts[0];
  for (const Touch& start : starts) {
    if (isBox() || !std::isfinite(start.depth)) break;
    const Touch way = descend(start.normal, points);
    if (way.depth < touch.depth) touch = way;
  }
  touch.depth = std::max(touch.depth, 0.0);
  touch.point = core.on_points;
  return touch;
}

Touch ConvexBody::descend(const Vector3d& normal, const Points& points) const {
  Touch touch = along(normal, points);
  double step = 0.3;
  for (int i = 0; i < 16; ++i) {
    // The depth along a normal grows as the support of the difference does.
    const Vector3d w = support(touch.normal) - points.support(-touch.normal);
    const Vector3d slope = w - touch.normal * touch.normal.dot(w);
    const double length = slope.norm();
    if (!(length > 1e-12 * w.norm())) break;
    const Touch way = along((touch.normal - slope * (step / length)).normalized(), points);
    const bool better = way.depth < touch.depth;
    if (better) touch = way;
    step *= better ? 1.5 : 0.4;
  }
  return touch;
}

Touch ConvexBody::along(const Vector3d& normal, const Points& points) const {
  Touch touch;
  touch.normal = normal;
  touch.depth = normal.dot(support(normal) - points.support(-normal)) + radius_;
  return touch;
}

BoxBody::BoxBody(const Vector3d& half) : ConvexBody(Vector3d::Zero(), half, 0), half_(half) {}

Vector3d BoxBody::support(const Vector3d& d) const {
  return Vector3d(d[0] < 0 ? -half_[0] : half_[0], d[1] < 0 ? -half_[1] : half_[1], d[2] < 0 ? -half_[2] : half_[2]);
}

CapsuleBody::CapsuleBody(double radius, double length)
    : ConvexBody(Vector3d::Zero(), Vector3d(0, 0, length / 2), radius), half_length_(length / 2) {}

Vector3d CapsuleBody::support(const Vector3d& d) const {
  return Vector3d(0, 0, d[2] < 0 ? -half_length_ : half_length_);
}

Hull CapsuleBody::hull() const {
  Hull hull;
  hull.count = half_length_ > 0 ? 2 : 1;
  hull.corners[0] = Vector3d(0, 0, half_length_);
  hull.corners[1] = Vector3d(0, 0, -half_length_);
  hull.radius = radius_;
  return hull;
}

EllipsoidBody::EllipsoidBody(const Vector3d& radii) : ConvexBody(Vector3d::Zero(), radii, 0), radii_(radii) {}

Vector3d EllipsoidBody::support(const Vector3d& d) const {
  const Vector3d scaled = d.cwiseProduct(radii_);
  const double length = scaled.norm();
  return length > 0 ? Vector3d(scaled.cwiseProduct(radii_) / length) : Vector3d(Vector3d::Zero());
}

RoundBody::RoundBody(double bottom, double top, double length)
    : ConvexBody(Vector3d::Zero(), Vector3d(std::max(bottom, top), std::max(bottom, top), length / 2), 0),
      bottom_(bottom),
      top_(top),
      half_length_(length / 2) {}

Vector3d RoundBody::support(const Vector3d& d) const {
  const double out = std::hypot(d[0], d[1]);
  const bool up = d[2] * half_length_ + out * top_ > -d[2] * half_length_ + out * bottom_;
  const double radius = out > 0 ? (up ? top_ : bottom_) / out : 0;
  return Vector3d(d[0] * radius, d[1] * radius, up ? half_length_ : -half_length_);
}

namespace {

Eigen::AlignedBox3d boxOf(const Corners& corners) {
  Eigen::AlignedBox3d box;
  for (const Vector3d& corner : corners) box.extend(corner);
  return box;
}

}  // namespace

TriangleBody::TriangleBody(const Corners& corners)
    : ConvexBody(boxOf(corners).center(), boxOf(corners).sizes() / 2, 0) {
  for (int k = 0; k < 3; ++k) corners_[k] = corners[k];
}

Vector3d TriangleBody::support(const Vector3d& d) const { return Points{corners_, 3}.support(d); }

namespace {

// A point, a segment or a triangle as a triangle.
void asTriangle(const Points& points, Corners& corners) {
  for (int k = 0; k < 3; ++k) corners[k] = points.x[std::min(k, points.count - 1)];
}

}  // namespace

Gap TriangleBody::gap(const Points& points, double enough) const {
  if (points.count > 3) return ConvexBody::gap(points, enough);
  Gap gap;
  Corners other;
  asTriangle(points, other);
  gap.distance = nearestPoints(corners_, other, gap.on_body, gap.on_points);
  if (gap.distance > 0) gap.normal = (gap.on_points - gap.on_body) / gap.distance;
  double size = 0;
  for (int k = 0; k < 3; ++k) size = std::max({size, corners_[k].lpNorm<1>(), other[k].lpNorm<1>()});
  gap.atLeast = gap.distance - kRounding * size;
  if (gap.touches()) gap.distance = 0;
  return gap;
}

Hull TriangleBody::hull() const {
  Hull hull;
  hull.count = 3;
  std::copy(corners_, corners_ + 3, hull.corners);
  return hull;
}

Touch TriangleBody::part(const Points& points) const {
  if (points.count > 3) return ConvexBody::part(points);
  Corners other;
  asTriangle(points, other);
  return partTriangles(corners_, other);
}

namespace {

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

// The lowest point along n.
const Vector3d& lowest(const Points& points, const Vector3d& n) { return points.support(-n); }

}  // namespace

HalfspaceBody::HalfspaceBody(const Vector3d& normal, double height, const Sphere& region)
    : normal_(normal), height_(height) {
  const double floor = std::min(height, normal.dot(region.center)) - 2 * region.radius;
  box_ = layer(normal, floor, height, region);
}

Gap HalfspaceBody::gap(const Points& points, double) const {
  Gap gap;
  gap.on_points = lowest(points, normal_);
  gap.normal = normal_;
  const double above = normal_.dot(gap.on_points) - height_;
  gap.atLeast = above - kRounding * (gap.on_points.lpNorm<1>() + std::abs(height_));
  gap.distance = gap.touches() ? 0 : above;
  gap.on_body = gap.touches() ? gap.on_points : Vector3d(gap.on_points - normal_ * above);
  return gap;
}

Touch HalfspaceBody::part(const Points& points) const {
  Touch touch;
  const Vector3d& p = lowest(points, normal_);
  touch.normal = normal_;
  touch.depth = std::max(height_ - normal_.dot(p), 0.0);
  touch.point = p + normal_ * (touch.depth / 2);
  return touch;
}

PlaneBody::PlaneBody(const Vector3d& normal, double height, const Sphere& region) : normal_(normal), height_(height) {
  box_ = layer(normal, height, height, region);
}

Gap PlaneBody::gap(const Points& points, double) const {
  Gap gap;
  const Vector3d &low = lowest(points, normal_), &high = points.support(normal_);
  const double above = normal_.dot(low) - height_, below = height_ - normal_.dot(high);
  gap.on_points = above > below ? low : high;
  gap.normal = above > below ? normal_ : Vector3d(-normal_);
  const double apart = std::max(above, below);
  gap.atLeast = apart - kRounding * (gap.on_points.lpNorm<1>() + std::abs(height_));
  gap.distance = gap.touches() ? 0 : apart;
  if (gap.touches() && above + below < 0) {
    gap.on_body = gap.on_points = low + (high - low) * (above / (above + below));
  } else {
    gap.on_body = gap.on_points - normal_ * (normal_.dot(gap.on_points) - height_);
  }
  return gap;
}

Touch PlaneBody::part(const Points& points) const {
  const Vector3d &low = lowest(points, normal_), &high = points.support(normal_);
  const double up = height_ - normal_.dot(low), down = normal_.dot(high) - height_;
  Touch touch;
  touch.normal = up <= down ? normal_ : Vector3d(-normal_);
  touch.depth = std::max(std::min(up, down), 0.0);
  touch.point = (up <= down ? low : high) + touch.normal * (touch.depth / 2);
  return touch;
}

}  // namespace bocst::query
