// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/triangle.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace bocst::query {
namespace {

using Eigen::Vector3d;

Vector3d closestOnSegment(const Vector3d& x, const Vector3d& a, const Vector3d& b) {
  const Vector3d d = b - a;
  const double dd = d.squaredNorm();
  return dd > 0 ? Vector3d(a + std::clamp(d.dot(x - a) / dd, 0.0, 1.0) * d) : a;
}

// Where the closed triangle t cuts the plane through o with normal n; false when it does not cross it.
bool cutByPlane(const Corners& t, const Vector3d& o, const Vector3d& n, Vector3d& a, Vector3d& b) {
  int found = 0;
  Vector3d ends[6];
  for (int i = 0; i < 3; ++i) {
    const Vector3d &u = t[i], &v = t[(i + 1) % 3];
    const double du = n.dot(u - o), dv = n.dot(v - o);
    if (du == 0) ends[found++] = u;
    if ((du < 0 && dv > 0) || (du > 0 && dv < 0)) ends[found++] = u + du / (du - dv) * (v - u);
  }
  if (found == 0) return false;
  a = b = ends[0];
  for (int i = 1; i < found; ++i) {
    if ((ends[i] - a).squaredNorm() > (b - a).squaredNorm()) b = ends[i];
  }
  return true;
}

Vector3d middleOfOverlap(const Corners& p, const Corners& q) {
  const Vector3d n = (p[1] - p[0]).cross(p[2] - p[0]), m = (q[1] - q[0]).cross(q[2] - q[0]);
  const Vector3d line = n.cross(m);
  Vector3d a, b, c, d;
  if (line.squaredNorm() > 1e-24 * n.squaredNorm() * m.squaredNorm() && cutByPlane(p, q[0], m, a, b) &&
      cutByPlane(q, p[0], n, c, d)) {
    // Both segments lie on the line of the two planes: the middle of what they share.
    const Vector3d origin = a, dir = line.normalized();
    const double pa = 0, pb = dir.dot(b - origin), qc = dir.dot(c - origin), qd = dir.dot(d - origin);
    const double lo = std::max(std::min(pa, pb), std::min(qc, qd)), hi = std::min(std::max(pa, pb), std::max(qc, qd));
    if (lo <= hi) return origin + (lo + hi) / 2 * dir;
    nearestPoints(p, q, a, b);
    return (a + b) / 2;
  }
  // They may be said to touch, in S, and be just apart.
  if (nearestPoints(p, q, a, b) > 0) return (a + b) / 2;
  const Vector3d lo = p[0].cwiseMin(p[1]).cwiseMin(p[2]).cwiseMax(q[0].cwiseMin(q[1]).cwiseMin(q[2]));
  const Vector3d hi = p[0].cwiseMax(p[1]).cwiseMax(p[2]).cwiseMin(q[0].cwiseMax(q[1]).cwiseMax(q[2]));
  return (lo + hi) / 2;
}

bool segmentCutsTriangle(const Vector3d& a, const Vector3d& b, const Corners& t, Vector3d& at) {
  const Vector3d n = (t[1] - t[0]).cross(t[2] - t[0]);
  const double da = n.dot(a - t[0]), db = n.dot(b - t[0]);
  if ((da > 0 && db > 0) || (da < 0 && db < 0) || da == db) return false;
  at = a + da / (da - db) * (b - a);
  for (int i = 0; i < 3; ++i) {
    if (n.dot((t[(i + 1) % 3] - t[i]).cross(at - t[i])) < 0) return false;
  }
  return true;
}

double clampToUnit(double x) { return std::clamp(x, 0.0, 1.0); }

// The foot of a point, `above` = n.(x - t[0]) over the plane of a triangle with edges e and normal n, if it is inside.
// That of a sliver is left to its edges: its normal is mostly rounding.
bool footInside(const Vector3d& x, const Corners& t, const Vector3d (&e)[3], const Vector3d& n, double nn, double above,
                Vector3d& foot) {
  if (!(nn > 1e-16 * e[0].squaredNorm() * e[1].squaredNorm())) return false;
  foot = x - n * (above / nn);
  for (int i = 0; i < 3; ++i) {
    if (n.dot(e[i].cross(foot - t[i])) < 0) return false;
  }
  return true;
}

}  // namespace

ContactPoint trianglePenetrations(const Corners& p, const Corners& q) {
  TrianglePairs pair;
  pair.put(0, p, q);
  pair.count = 1;
  ContactPoint contact;
  trianglePenetrations(pair, 0, &contact);
  return contact;
}

PenetrationVerdicts trianglePenetrations(const TrianglePairs& pairs, double tolerance, ContactPoint* contacts) {
  PairPenetrations found;
  penetrationsOfPairs(pairs, tolerance, found);
  for (std::size_t i = 0; i < pairs.count; ++i) {
    ContactPoint& contact = contacts[i];
    contact.normal = Vector3d(found.normal[0][i], found.normal[1][i], found.normal[2][i]);
    contact.depth = std::max(found.depth[i], 0.0);
    contact.point = Vector3d(found.point[0][i], found.point[1][i], found.point[2][i]);
    if (((found.no_point & ~found.apart) >> i & 1) == 0) continue;
    Corners p, q;
    pairs.get(i, p, q);
    contact.point = middleOfOverlap(p, q);
  }
  return {found.meet, found.apart};
}

Vector3d closestPoint(const Vector3d& x, const Corners& t) {
  const Vector3d e[3] = {t[1] - t[0], t[2] - t[1], t[0] - t[2]}, n = e[0].cross(e[1]);
  Vector3d foot;
  if (footInside(x, t, e, n, n.squaredNorm(), n.dot(x - t[0]), foot)) return foot;
  Vector3d best = closestOnSegment(x, t[0], t[1]);
  for (int i = 1; i < 3; ++i) {
    const Vector3d c = closestOnSegment(x, t[i], t[(i + 1) % 3]);
    if ((c - x).squaredNorm() < (best - x).squaredNorm()) best = c;
  }
  return best;
}

bool isDegenerate(const Corners& t) {
  const Vector3d e = t[1] - t[0], f = t[2] - t[0];
  return e.cross(f).norm() <= 1e-14 * e.norm() * f.norm();
}

double nearestPoints(const Corners& p, const Corners& q, Vector3d& on_p, Vector3d& on_q) {
  double best = std::numeric_limits<double>::infinity();  // squared
  const auto consider = [&](const Vector3d& a, const Vector3d& b) {
    const double d = (a - b).squaredNorm();
    if (!(d < best)) return;
    best = d;
    on_p = a;
    on_q = b;
  };
  const Vector3d e[3] = {p[1] - p[0], p[2] - p[1], p[0] - p[2]}, f[3] = {q[1] - q[0], q[2] - q[1], q[0] - q[2]};
  const Vector3d n = e[0].cross(e[1]), m = f[0].cross(f[1]);
  const Vector3d above_p(n.dot(q[0] - p[0]), n.dot(q[1] - p[0]), n.dot(q[2] - p[0]));
  const Vector3d above_q(m.dot(p[0] - q[0]), m.dot(p[1] - q[0]), m.dot(p[2] - q[0]));
  // On one side of the other's plane, neither cuts the other.
  if (above_p.minCoeff() <= 0 && above_p.maxCoeff() >= 0 && above_q.minCoeff() <= 0 && above_q.maxCoeff() >= 0) {
    for (int i = 0; i < 3; ++i) {
      Vector3d at;
      if (segmentCutsTriangle(p[i], p[(i + 1) % 3], q, at) || segmentCutsTriangle(q[i], q[(i + 1) % 3], p, at)) {
        on_p = on_q = at;
        return 0;
      }
    }
  }
  // A corner over the inside of the other, or a point of an edge and one of the other's.
  const double nn = n.squaredNorm(), mm = m.squaredNorm();
  for (int i = 0; i < 3; ++i) {
    Vector3d foot;
    if (footInside(q[i], p, e, n, nn, above_p[i], foot)) consider(foot, q[i]);
    if (footInside(p[i], q, f, m, mm, above_q[i], foot)) consider(p[i], foot);
  }
  const double ee[3] = {e[0].squaredNorm(), e[1].squaredNorm(), e[2].squaredNorm()};
  const double ff[3] = {f[0].squaredNorm(), f[1].squaredNorm(), f[2].squaredNorm()};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const Vector3d w = p[i] - q[j];
      const double ew = e[i].dot(w), fw = f[j].dot(w), ef = e[i].dot(f[j]), det = ee[i] * ff[j] - ef * ef;
      double s = det > 0 ? clampToUnit((ef * fw - ff[j] * ew) / det) : 0;
      const double t = ff[j] > 0 ? clampToUnit((ef * s + fw) / ff[j]) : 0;
      s = ee[i] > 0 ? clampToUnit((ef * t - ew) / ee[i]) : 0;
      consider(p[i] + s * e[i], q[j] + t * f[j]);
      if (det > 1e-6 * ee[i] * ff[j]) continue;
      // All but parallel, the quotient is inaccurate; so may the nearest points be, unless the ends are looked at too.
      consider(p[i], closestOnSegment(p[i], q[j], q[(j + 1) % 3]));
      consider(p[(i + 1) % 3], closestOnSegment(p[(i + 1) % 3], q[j], q[(j + 1) % 3]));
      consider(closestOnSegment(q[j], p[i], p[(i + 1) % 3]), q[j]);
      consider(closestOnSegment(q[(j + 1) % 3], p[i], p[(i + 1) % 3]), q[(j + 1) % 3]);
    }
  }
  return std::sqrt(best);
}

}  // namespace bocst::query
