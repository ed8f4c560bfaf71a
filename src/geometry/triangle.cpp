// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/triangle.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

namespace bocst::query {
namespace {

using Eigen::Vector3d;

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

// The middle of what two parallel triangles share, which are `distance` apart: p, clipped by planes through the edges
// of q (Sutherland and Hodgman 1974). Nothing if they are not parallel there. q has an area.
std::optional<Vector3d> middleOfSharedPolygon(const Corners& p, const Corners& q, double distance) {
  const Vector3d normal = (q[1] - q[0]).cross(q[2] - q[0]).stableNormalized();
  double size = 0;
  for (int k = 0; k < 3; ++k) size = std::max({size, (p[k] - q[0]).lpNorm<1>(), (q[k] - q[0]).lpNorm<1>()});
  constexpr std::size_t kMost = 24;  // each clip at most doubles the corners
  Vector3d polygon[kMost], kept[kMost];
  std::size_t count = 3;
  std::copy(p.begin(), p.end(), polygon);
  for (std::size_t i = 0; i < 3; ++i) {
    const Vector3d inwards = normal.cross(q[(i + 1) % 3] - q[i]).stableNormalized();
    const double doubt = 1e-12 * size;
    std::size_t left = 0;
    for (std::size_t j = 0; j < count; ++j) {
      const Vector3d &u = polygon[j], &v = polygon[(j + 1) % count];
      const double in_u = inwards.dot(u - q[i]), in_v = inwards.dot(v - q[i]);
      if (in_u >= -doubt) kept[left++] = u;
      if (std::min(in_u, in_v) < -doubt && std::max(in_u, in_v) > doubt)
        kept[left++] = u + in_u / (in_u - in_v) * (v - u);
    }
    count = left;
    std::copy(kept, kept + count, polygon);
  }
  if (count == 0) return {};
  Vector3d sum = Vector3d::Zero();
  for (std::size_t j = 0; j < count; ++j) {
    if (std::abs(normal.dot(polygon[j] - q[0])) > distance + 1e-9 * size) return {};
    sum += polygon[j] - q[0];
  }
  const Vector3d middle = sum / static_cast<double>(count);
  return q[0] + middle - normal.dot(middle) / 2 * normal;
}

Vector3d middleOfOverlap(const Corners& p, const Corners& q) {
  const Vector3d n = (p[1] - p[0]).cross(p[2] - p[0]), m = (q[1] - q[0]).cross(q[2] - q[0]);
  const Vector3d line = n.cross(m);
  Vector3d a, b, c, d;
  if (isDegenerate(p) || isDegenerate(q)) {
    double largest = 0;
    for (int k = 0; k < 3; ++k) largest = std::max({largest, p[k].cwiseAbs().maxCoeff(), q[k].cwiseAbs().maxCoeff()});
    if (!edgesTouch(p, q, std::numeric_limits<double>::epsilon() * largest, a, b)) nearestPoints(p, q, a, b);
    return (a + b) / 2;
  }
  if (line.squaredNorm() > kLeastSineOfPlanes * kLeastSineOfPlanes * n.squaredNorm() * m.squaredNorm() &&
      cutByPlane(p, q[0], m, a, b) && cutByPlane(q, p[0], n, c, d)) {
    // Both segments lie on the line of the two planes: the middle of what they share.
    const Vector3d origin = a, dir = line.normalized();
    const double pa = 0, pb = dir.dot(b - origin), qc = dir.dot(c - origin), qd = dir.dot(d - origin);
    const double lo = std::max(std::min(pa, pb), std::min(qc, qd)), hi = std::min(std::max(pa, pb), std::max(qc, qd));
    if (lo <= hi) return origin + (lo + hi) / 2 * dir;
    nearestPoints(p, q, a, b);
    return (a + b) / 2;
  }
  // They may be said to touch, in S, and be just apart.
  const double distance = nearestPoints(p, q, a, b);
  return middleOfSharedPolygon(p, q, distance).value_or((a + b) / 2);
}

// The sum of two doubles, the second no more than half a unit of the first: 106 bits (Dekker 1971, Knuth 1969).
struct Twice {
  double high = 0, low = 0;

  Twice() = default;
  Twice(double x) : high(x) {}  // NOLINT: a double is one of these
  Twice(double h, double l) : high(h), low(l) {}
  explicit operator double() const { return high; }

  static Twice quickSum(double a, double b) {  // |a| >= |b|
    const double s = a + b;
    return {s, b - (s - a)};
  }
  static Twice sum(double a, double b) {
    const double s = a + b, t = s - a;
    return {s, (a - (s - t)) + (b - t)};
  }
  static Twice product(double a, double b) {
    const auto halves = [](double x, double& h, double& l) {
      const double c = 134217729.0 * x;  // 2^27 + 1
      h = c - (c - x);
      l = x - h;
    };
    double ah, al, bh, bl;
    halves(a, ah, al);
    halves(b, bh, bl);
    const double p = a * b;
    return {p, ((ah * bh - p) + ah * bl + al * bh) + al * bl};
  }
};
Twice operator-(const Twice& a) { return {-a.high, -a.low}; }
Twice operator+(const Twice& a, const Twice& b) {
  const Twice s = Twice::sum(a.high, b.high), t = Twice::sum(a.low, b.low);
  const Twice u = Twice::quickSum(s.high, s.low + t.high);
  return Twice::quickSum(u.high, u.low + t.low);
}
Twice operator-(const Twice& a, const Twice& b) { return a + -b; }
Twice operator*(const Twice& a, const Twice& b) {
  const Twice p = Twice::product(a.high, b.high);
  return Twice::quickSum(p.high, p.low + (a.high * b.low + a.low * b.high));
}
Twice operator/(const Twice& a, const Twice& b) {
  const double x = a.high / b.high;
  const Twice rest = a - b * Twice(x);
  const double y = rest.high / b.high;
  return Twice::quickSum(x, y) + Twice((rest - b * Twice(y)).high / b.high);
}
bool operator<(const Twice& a, const Twice& b) { return a.high < b.high || (a.high == b.high && a.low < b.low); }
bool operator>(const Twice& a, const Twice& b) { return b < a; }

template <typename T>
struct Vec {
  T x[3] = {T(0), T(0), T(0)};
  Vec() = default;
  Vec(const T& a, const T& b, const T& c) : x{a, b, c} {}
  explicit Vec(const Vector3d& v) : x{v[0], v[1], v[2]} {}
  friend Vec operator+(const Vec& a, const Vec& b) { return {a.x[0] + b.x[0], a.x[1] + b.x[1], a.x[2] + b.x[2]}; }
  friend Vec operator-(const Vec& a, const Vec& b) { return {a.x[0] - b.x[0], a.x[1] - b.x[1], a.x[2] - b.x[2]}; }
  friend Vec operator*(const T& s, const Vec& a) { return {s * a.x[0], s * a.x[1], s * a.x[2]}; }
};
template <typename T>
T dot(const Vec<T>& a, const Vec<T>& b) {
  return a.x[0] * b.x[0] + a.x[1] * b.x[1] + a.x[2] * b.x[2];
}
template <typename T>
Vec<T> cross(const Vec<T>& a, const Vec<T>& b) {
  return {a.x[1] * b.x[2] - a.x[2] * b.x[1], a.x[2] * b.x[0] - a.x[0] * b.x[2], a.x[0] * b.x[1] - a.x[1] * b.x[0]};
}
template <typename T>
T clampToUnit(const T& x) {
  return x < T(0) ? T(0) : x > T(1) ? T(1) : x;
}

// Corners, edges and their squares.
template <typename T>
struct Edges {
  Vec<T> v[3], e[3];
  T ee[3];

  Edges(const Vec<T>& a, const Vec<T>& b, const Vec<T>& c) : v{a, b, c}, e{b - a, c - b, a - c} {
    for (int i = 0; i < 3; ++i) ee[i] = dot(e[i], e[i]);
  }
};

// A triangle with what is computed from it once. The normal is that of the two shorter edges: its direction is off by
// 4 roundings over the sine of their angle, and that sine says what the three corners are.
template <typename T>
struct Face : Edges<T> {
  using Edges<T>::v, Edges<T>::e, Edges<T>::ee;
  Vec<T> n;
  T nn;
  double sine2 = 0;  // of the angle between the two shorter edges, squared; 0 for a segment or a point

  Face(const Vec<T>& a, const Vec<T>& b, const Vec<T>& c) : Edges<T>(a, b, c) {
    const int longest = ee[1] > ee[0] ? (ee[2] > ee[1] ? 2 : 1) : (ee[2] > ee[0] ? 2 : 0);
    const int i = (longest + 1) % 3, j = (longest + 2) % 3;
    n = cross(e[i], e[j]);
    nn = dot(n, n);
    const double sizes = static_cast<double>(ee[i]) * static_cast<double>(ee[j]);
    if (sizes > 1e-280 && sizes < 1e280) sine2 = static_cast<double>(nn) / sizes;
  }

  T above(const Vec<T>& x) const { return dot(n, x - v[0]); }
};

// A face whose normal is good to the last digits but three. In double, others are looked at in twice the digits, which
// takes twenty times as long.
constexpr double kWellShaped = 1e-5;
// Farther apart, squared, products of lengths may overflow.
constexpr double kFarthest = 1e150;

// In twice the digits a face is less than this only if its width is less than a rounding of its length in double: then
// the edges are all of it.
constexpr double kHasFace = 1e-32;

template <typename T>
bool hasFace(const Face<T>& f) {
  return f.sine2 > (std::is_same<T, double>::value ? kWellShaped : kHasFace);
}

// True if a point of the plane is in the triangle.
template <typename T>
bool isInside(const Face<T>& t, const Vec<T>& at) {
  for (int i = 0; i < 3; ++i) {
    if (dot(t.n, cross(t.e[i], at - t.v[i])) < T(0)) return false;
  }
  return true;
}

// Where an edge whose ends are `from` and `to` over the plane of t cuts it.
template <typename T>
bool cuts(const Vec<T>& a, const Vec<T>& b, const T& from, const T& to, const Face<T>& t, Vec<T>& at) {
  const T zero(0);
  if ((from > zero && to > zero) || (from < zero && to < zero) || !(from < to || to < from)) return false;
  at = a + (from / (from - to)) * (b - a);
  return isInside(t, at);
}

template <typename T>
Vec<T> onSegment(const Vec<T>& x, const Vec<T>& a, const Vec<T>& e, const T& ee) {
  return ee > T(0) ? a + clampToUnit<T>(dot(e, x - a) / ee) * e : a;
}

/// The least distance so far, squared, and its points.
template <typename T>
struct Closest {
  T squared = std::numeric_limits<double>::infinity();
  Vec<T> p, q;
  void consider(const Vec<T>& a, const Vec<T>& b) {
    const Vec<T> displacement = a - b;
    const T d = dot(displacement, displacement);
    if (!(d < squared)) return;
    squared = d;
    p = a;
    q = b;
  }
};

template <typename T>
void considerEdges(const Edges<T>& p, int i, const Edges<T>& q, int j, Closest<T>& closest) {
  const T zero(0);
  const Vec<T>&a = p.v[i], &b = q.v[j], &e = p.e[i], &f = q.e[j];
  const T &ee = p.ee[i], &ff = q.ee[j];
  const Vec<T> w = a - b;
  const T ew = dot(e, w), fw = dot(f, w), ef = dot(e, f);
  // Not ee * ff - ef * ef, which cancels where the edges are almost parallel.
  const Vec<T> n = cross(e, f);
  const T det = dot(n, n);
  T s = det > zero ? clampToUnit<T>(dot(cross(f, w), n) / det) : zero;
  const T t = ff > zero ? clampToUnit<T>((ef * s + fw) / ff) : zero;
  s = ee > zero ? clampToUnit<T>((ef * t - ew) / ee) : zero;
  closest.consider(a + s * e, b + t * f);
  if (det > T(1e-6) * ee * ff) return;
  // Almost parallel, n is not accurate, or 0; then an end is about as near as any point.
  const Vec<T>&a2 = p.v[(i + 1) % 3], &b2 = q.v[(j + 1) % 3];
  closest.consider(a, onSegment(a, b, f, ff));
  closest.consider(a2, onSegment(a2, b, f, ff));
  closest.consider(onSegment(b, a, e, ee), b);
  closest.consider(onSegment(b2, a, e, ee), b2);
}

template <typename T>
Closest<T> closestOf(const Face<T>& p, const Face<T>& q) {
  Closest<T> closest;
  const bool p_has = hasFace(p), q_has = hasFace(q);
  const T zero(0);
  T above_p[3], above_q[3];
  const auto measure = [zero](const Face<T>& face, const Face<T>& other, T(&above)[3]) {
    bool up = false, down = false;
    for (int i = 0; i < 3; ++i) {
      above[i] = face.above(other.v[i]);
      up |= !(above[i] < zero);
      down |= !(above[i] > zero);
    }
    return up && down;
  };
  const bool straddles_p = !p_has || measure(p, q, above_p), straddles_q = !q_has || measure(q, p, above_q);
  // An edge through the other's inside. On one side of the other's plane, neither cuts the other.
  if (straddles_p && straddles_q) {
    for (int i = 0; i < 3; ++i) {
      const int k = (i + 1) % 3;
      Vec<T> at;
      if ((q_has && cuts(p.v[i], p.v[k], above_q[i], above_q[k], q, at)) ||
          (p_has && cuts(q.v[i], q.v[k], above_p[i], above_p[k], p, at))) {
        closest.squared = zero;
        closest.p = closest.q = at;
        return closest;
      }
    }
  }
  // A corner over the inside of the other, or a point of an edge and one of the other's.
  for (int i = 0; i < 3; ++i) {
    if (p_has) {
      const Vec<T> foot = q.v[i] - (above_p[i] / p.nn) * p.n;
      if (isInside(p, foot)) closest.consider(foot, q.v[i]);
    }
    if (q_has) {
      const Vec<T> foot = p.v[i] - (above_q[i] / q.nn) * q.n;
      if (isInside(q, foot)) closest.consider(p.v[i], foot);
    }
  }
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) considerEdges<T>(p, i, q, j, closest);
  }
  return closest;
}

template <typename T>
Vec<T> closestTo(const Vec<T>& x, const Face<T>& t) {
  if (hasFace(t)) {
    const Vec<T> foot = x - (t.above(x) / t.nn) * t.n;
    if (isInside(t, foot)) return foot;
  }
  Closest<T> closest;
  for (int i = 0; i < 3; ++i) closest.consider(onSegment(x, t.v[i], t.e[i], t.ee[i]), x);
  return closest.p;
}

Vector3d toVector(const Vec<double>& v) { return {v.x[0], v.x[1], v.x[2]}; }

// In twice the digits, scaled by a power of two so that no square overflows, and none that matters vanishes.
class Scale {
 public:
  void take(const Vector3d& v) { largest_ = std::max(largest_, v.cwiseAbs().maxCoeff()); }
  void take(const Corners& t) {
    for (const Vector3d& v : t) take(v);
  }
  bool isZero() const { return !(largest_ > 0); }
  Vector3d down(const Vector3d& v) const {
    const int by = -std::ilogb(largest_);
    return {std::ldexp(v[0], by), std::ldexp(v[1], by), std::ldexp(v[2], by)};
  }
  Vec<Twice> operator()(const Vector3d& v) const { return Vec<Twice>(down(v)); }
  Face<Twice> operator()(const Corners& t) const { return {(*this)(t[0]), (*this)(t[1]), (*this)(t[2])}; }
  double back(double x) const { return std::ldexp(x, std::ilogb(largest_)); }
  Vector3d back(const Vec<Twice>& v) const { return {back(v.x[0].high), back(v.x[1].high), back(v.x[2].high)}; }

 private:
  double largest_ = 0;
};

Face<double> faceOf(const Corners& t) { return {Vec<double>(t[0]), Vec<double>(t[1]), Vec<double>(t[2])}; }

}  // namespace

ContactPoint trianglePenetration(const Corners& p, const Corners& q) {
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
  if (contacts == nullptr) return {found.meet, found.apart};
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

namespace {

// The two points in which the edges of triangle t cross the plane of another, if they clearly do.
bool clearlyCutByPlane(const Corners& t, const Corners& other, const Vector3d& normal, double tolerance,
                       Vector3d (&ends)[2]) {
  const Vector3d way[3] = {t[0] - other[0], t[1] - other[0], t[2] - other[0]};
  const double height[3] = {normal.dot(way[0]), normal.dot(way[1]), normal.dot(way[2])};
  const double largest = std::max(t[0].lpNorm<1>(), other[0].lpNorm<1>());
  const double size = (other[1] - other[0]).lpNorm<1>() + (other[2] - other[0]).lpNorm<1>();
  const double reach = way[0].lpNorm<1>() + (t[1] - t[0]).lpNorm<1>() + (t[2] - t[0]).lpNorm<1>();
  // Corners are off by a rounding of the largest coordinate, the normal's entries by that times the other's size.
  const double doubt = 16 * std::numeric_limits<double>::epsilon() * size * (largest + size) * (reach + size);
  int above = 0;
  for (const double h : height) {
    if (!(std::abs(h) > doubt)) return false;
    above += h > 0;
  }
  if (above == 0 || above == 3) return false;
  int lone = 0;
  while ((height[lone] > 0) != (above == 1)) ++lone;
  for (int e = 0; e < 2; ++e) {
    const int k = (lone + 1 + e) % 3;
    const double drop = height[lone] - height[k];
    const Vector3d edge = t[k] - t[lone];
    if (2 * doubt * edge.norm() > tolerance * std::abs(drop)) return false;
    ends[e] = t[lone] + height[lone] / drop * edge;
  }
  return true;
}

}  // namespace

std::optional<double> nearEndOfCut(const Corners& p, const Corners& q, const Vector3d& direction, double tolerance) {
  const Vector3d normal_p = (p[1] - p[0]).cross(p[2] - p[0]), normal_q = (q[1] - q[0]).cross(q[2] - q[0]);
  const Vector3d line = normal_p.cross(normal_q);
  // The order of points along the line is that of their coordinates along its direction, which must be known.
  if (!(line.squaredNorm() > kLeastSineOfPlanes * kLeastSineOfPlanes * normal_p.squaredNorm() * normal_q.squaredNorm()))
    return {};
  Vector3d of_p[2], of_q[2];
  if (!clearlyCutByPlane(p, q, normal_q, tolerance, of_p) || !clearlyCutByPlane(q, p, normal_p, tolerance, of_q))
    return {};
  for (Vector3d(*ends)[2] : {&of_p, &of_q}) {
    if (line.dot((*ends)[0]) > line.dot((*ends)[1])) std::swap((*ends)[0], (*ends)[1]);
  }
  const Vector3d& from = line.dot(of_p[0]) > line.dot(of_q[0]) ? of_p[0] : of_q[0];
  const Vector3d& to = line.dot(of_p[1]) < line.dot(of_q[1]) ? of_p[1] : of_q[1];
  if (line.dot(from) > line.dot(to)) return {};
  return std::min(direction.dot(from), direction.dot(to));
}

Vector3d closestPoint(const Vector3d& x, const Corners& t) {
  const Face<double> face = faceOf(t);
  if (hasFace(face) && (x - t[0]).squaredNorm() < kFarthest) return toVector(closestTo(Vec<double>(x), face));
  Scale scale;
  scale.take(x);
  scale.take(t);
  return scale.isZero() ? t[0] : scale.back(closestTo(scale(x), scale(t)));
}

double relativeWidth(const Corners& t) {
  const Vector3d e[3] = {t[1] - t[0], t[2] - t[1], t[0] - t[2]};
  const double ee[3] = {e[0].squaredNorm(), e[1].squaredNorm(), e[2].squaredNorm()};
  const int longest = ee[1] > ee[0] ? (ee[2] > ee[1] ? 2 : 1) : (ee[2] > ee[0] ? 2 : 0);
  // The height is twice the area over the longest edge; that of the shorter edges rounds least.
  if (ee[longest] > 1e-140 && ee[longest] < 1e140) {
    return e[(longest + 1) % 3].cross(e[(longest + 2) % 3]).norm() / ee[longest];
  }
  // The edges alone, so that they are of size 1 afterwards.
  Scale scale;
  scale.take(e[0]);
  scale.take(e[2]);
  return scale.isZero() ? 0 : relativeWidth({Vector3d::Zero(), scale.down(e[0]), scale.down(-e[2])});
}

// With x the points from p[0] on, rounded, and s the largest of them, a product with an axis a is off by less than 4
// eps |a| s, and two of them by 8; 16 cover the sizes' own rounding. That holds for any axis, whatever it was computed
// from. An axis whose square is no good double says nothing.
bool areApart(const Corners& p, const Corners& q, double distance) {
  const Vector3d o = p[0], x[3] = {Vector3d::Zero(), p[1] - o, p[2] - o}, y[3] = {q[0] - o, q[1] - o, q[2] - o};
  const Vector3d e[3] = {x[1], x[2] - x[1], -x[2]}, f[3] = {y[1] - y[0], y[2] - y[1], y[0] - y[2]};
  double largest = 0;
  for (int k = 0; k < 3; ++k) largest = std::max({largest, x[k].squaredNorm(), y[k].squaredNorm()});
  const double least = distance + 16 * std::numeric_limits<double>::epsilon() * std::sqrt(largest);
  const auto parts = [&](const Vector3d& a) {
    const double px[3] = {0, a.dot(x[1]), a.dot(x[2])}, qx[3] = {a.dot(y[0]), a.dot(y[1]), a.dot(y[2])};
    const double gap = std::max(std::min({qx[0], qx[1], qx[2]}) - std::max({px[0], px[1], px[2]}),
                                std::min({px[0], px[1], px[2]}) - std::max({qx[0], qx[1], qx[2]}));
    const double squared = a.squaredNorm();
    return squared > 1e-280 && squared < 1e280 && gap > least * std::sqrt(squared);
  };
  if (parts(f[0].cross(f[1])) || parts(e[0].cross(e[1]))) return true;
  for (const Vector3d& u : e) {
    for (const Vector3d& v : f) {
      if (parts(u.cross(v))) return true;
    }
  }
  return false;
}

bool edgesTouch(const Corners& p, const Corners& q, double distance, Vector3d& on_p, Vector3d& on_q) {
  const double squared = distance * distance;
  if (!(squared > 1e-280 && squared < 1e280)) return false;  // smaller squares vanish, larger ones overflow
  const auto edges_of = [](const Corners& t) {
    return Edges<double>(Vec<double>(t[0]), Vec<double>(t[1]), Vec<double>(t[2]));
  };
  const Edges<double> edges_p = edges_of(p), edges_q = edges_of(q);
  Closest<double> closest;
  for (int i = 0; i < 9; ++i) {
    considerEdges(edges_p, i / 3, edges_q, i % 3, closest);
    if (!(closest.squared <= squared)) continue;
    on_p = toVector(closest.p);
    on_q = toVector(closest.q);
    return true;
  }
  return false;
}

double nearestPoints(const Corners& p, const Corners& q, Vector3d& on_p, Vector3d& on_q, double farthest) {
  const Face<double> face_p = faceOf(p), face_q = faceOf(q);
  if (hasFace(face_p) && hasFace(face_q) && (p[0] - q[0]).squaredNorm() < kFarthest) {
    const Closest<double> closest = closestOf(face_p, face_q);
    on_p = toVector(closest.p);
    on_q = toVector(closest.q);
    return std::sqrt(closest.squared);
  }
  on_p = p[0];
  on_q = q[0];
  if (std::isfinite(farthest) && areApart(p, q, farthest)) return std::numeric_limits<double>::infinity();
  Scale scale;
  scale.take(p);
  scale.take(q);
  if (scale.isZero()) return 0;
  const Closest<Twice> closest = closestOf(scale(p), scale(q));
  on_p = scale.back(closest.p);
  on_q = scale.back(closest.q);
  return scale.back(std::sqrt(closest.squared.high));
}

}  // namespace bocst::query
