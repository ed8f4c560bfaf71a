// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// Closed triangles, segments and points in exact arithmetic: no rounding, no tolerance, no normal. Corners are the
// doubles as given, so they are whole numbers times a power of two. Small ones are computed in 128 bits, others in
// integers of any length.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <boost/multiprecision/cpp_int.hpp>
#include <cmath>
#include <cstdint>
#include <limits>

namespace bocst::exact {

using Corners = std::array<Eigen::Vector3d, 3>;

namespace detail {

using Big = boost::multiprecision::cpp_int;
__extension__ using Small = __int128;

template <typename Int>
using Vec = std::array<Int, 3>;

template <typename Int>
Vec<Int> operator-(const Vec<Int>& a, const Vec<Int>& b) {
  return {Int(a[0] - b[0]), Int(a[1] - b[1]), Int(a[2] - b[2])};
}
template <typename Int>
Int dot(const Vec<Int>& a, const Vec<Int>& b) {
  return Int(a[0] * b[0] + a[1] * b[1] + a[2] * b[2]);
}
template <typename Int>
Vec<Int> cross(const Vec<Int>& a, const Vec<Int>& b) {
  return {Int(a[1] * b[2] - a[2] * b[1]), Int(a[2] * b[0] - a[0] * b[2]), Int(a[0] * b[1] - a[1] * b[0])};
}

inline long double quotient(const Small& a, const Small& b) {
  return static_cast<long double>(a) / static_cast<long double>(b);
}
// Numbers of any length keep their leading 128 bits.
inline long double quotient(const Big& a, const Big& b) {
  if (a == 0) return 0;
  const auto leading = [](const Big& x, int& exponent) {
    const int bits = static_cast<int>(boost::multiprecision::msb(x)) + 1;
    exponent = std::max(bits - 128, 0);
    return static_cast<Big>(x >> static_cast<unsigned>(exponent)).convert_to<long double>();
  };
  int ea = 0, eb = 0;
  const long double x = leading(a, ea), y = leading(b, eb);
  return std::ldexp(x / y, ea - eb);
}

/// The least squared distance so far; 0 is exact, other values are rounded.
template <typename Int>
struct Least {
  long double value = std::numeric_limits<long double>::infinity();
  void consider(const Int& numerator, const Int& denominator) {
    value = std::min(value, quotient(numerator, denominator));
  }
};

// The nearest points of two convex sets lie inside of two of their faces: corners, edges or the triangles themselves.
// For each two faces that have just one pair of points whose way is at right angles to both, that pair is looked at;
// where they have more, others have the same distance and lie on smaller faces.
template <typename Int>
long double squaredDistance(const Vec<Int> (&p)[3], const Vec<Int> (&q)[3]) {
  Least<Int> least;
  for (const auto& a : p) {
    for (const auto& b : q) {
      const Vec<Int> w = a - b;
      least.consider(dot(w, w), Int(1));
    }
  }
  const auto cornerAndFaces = [&](const Vec<Int>& x, const Vec<Int>(&t)[3]) {
    for (int i = 0; i < 3; ++i) {
      const Vec<Int> e = t[(i + 1) % 3] - t[i], w = x - t[i];
      const Int ee = dot(e, e), along = dot(e, w);
      if (!(along > 0 && along < ee)) continue;
      const Vec<Int> n = cross(e, w);
      least.consider(dot(n, n), ee);
    }
    const Vec<Int> n = cross<Int>(t[1] - t[0], t[2] - t[0]);
    const Int nn = dot(n, n);
    if (nn == 0) return;
    for (int i = 0; i < 3; ++i) {
      if (dot(n, cross<Int>(t[(i + 1) % 3] - t[i], x - t[i])) < 0) return;
    }
    const Int above = dot<Int>(n, x - t[0]);
    least.consider(Int(above * above), nn);
  };
  for (int i = 0; i < 3; ++i) {
    cornerAndFaces(p[i], q);
    cornerAndFaces(q[i], p);
  }
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const Vec<Int> e = p[(i + 1) % 3] - p[i], f = q[(j + 1) % 3] - q[j], w = q[j] - p[i], n = cross(e, f);
      const Int nn = dot(n, n);
      if (nn == 0) continue;
      // p + s e and q + t f, s = (w x f).n / nn, t = (w x e).n / nn.
      const Int s = dot(cross(w, f), n), t = dot(cross(w, e), n);
      if (!(s > 0 && s < nn && t > 0 && t < nn)) continue;
      const Int apart = dot(w, n);
      least.consider(Int(apart * apart), nn);
    }
  }
  const auto edgesThrough = [&](const Vec<Int>(&t)[3], const Vec<Int>(&edges)[3]) {
    const Vec<Int> n = cross<Int>(t[1] - t[0], t[2] - t[0]);
    if (dot(n, n) == 0) return;
    for (int i = 0; i < 3; ++i) {
      const Vec<Int>&a = edges[i], &b = edges[(i + 1) % 3];
      const Int above_a = dot<Int>(n, a - t[0]), above_b = dot<Int>(n, b - t[0]);
      if (!((above_a > 0 && above_b < 0) || (above_a < 0 && above_b > 0))) continue;
      int sides[2] = {0, 0};
      for (int k = 0; k < 3; ++k) {
        const Int volume = dot<Int>(b - a, cross<Int>(t[k] - a, t[(k + 1) % 3] - a));
        sides[0] += volume < 0;
        sides[1] += volume > 0;
      }
      if (sides[0] == 0 || sides[1] == 0) least.value = 0;
    }
  };
  edgesThrough(p, q);
  edgesThrough(q, p);
  return least.value;
}

/// A double, or a sum or a product of some: mantissa * 2^exponent.
struct Number {
  Big mantissa = 0;
  int exponent = 0;

  Number() = default;
  explicit Number(double x) {
    int e = 0;
    mantissa = static_cast<std::int64_t>(std::ldexp(std::frexp(x, &e), 53));
    if (mantissa == 0) return;
    exponent = e - 53;
    const unsigned zeros = boost::multiprecision::lsb(Big(abs(mantissa)));
    mantissa /= Big(1) << zeros;
    exponent += static_cast<int>(zeros);
  }
  Big at(int least) const {
    return mantissa == 0 ? mantissa : Big(mantissa << static_cast<unsigned>(exponent - least));
  }
  friend Number operator+(const Number& a, const Number& b) {
    if (a.mantissa == 0) return b;
    if (b.mantissa == 0) return a;
    Number sum;
    sum.exponent = std::min(a.exponent, b.exponent);
    sum.mantissa = a.at(sum.exponent) + b.at(sum.exponent);
    return sum;
  }
  friend Number operator*(const Number& a, const Number& b) {
    Number product;
    product.mantissa = a.mantissa * b.mantissa;
    product.exponent = a.exponent + b.exponent;
    return product;
  }
};

using Numbers = std::array<std::array<Number, 3>, 3>;

inline Numbers numbersOf(const Corners& t) {
  Numbers n;
  for (int k = 0; k < 9; ++k) n[k / 3][k % 3] = Number(t[k / 3][k % 3]);
  return n;
}

inline Numbers placed(const Eigen::Isometry3d& X, const Corners& t) {
  Numbers n;
  for (int k = 0; k < 3; ++k) {
    for (int r = 0; r < 3; ++r) {
      n[k][r] = Number(X.translation()[r]);
      for (int c = 0; c < 3; ++c) n[k][r] = n[k][r] + Number(X.linear()(r, c)) * Number(t[k][c]);
    }
  }
  return n;
}

inline long double squaredDistance(const Numbers& p, const Numbers& q) {
  int least = std::numeric_limits<int>::max();
  for (const Numbers* t : {&p, &q}) {
    for (const auto& v : *t) {
      for (const Number& x : v) {
        if (x.mantissa != 0) least = std::min(least, x.exponent);
      }
    }
  }
  if (least == std::numeric_limits<int>::max()) return 0;
  Vec<Big> whole[2][3];
  for (int k = 0; k < 9; ++k) {
    whole[0][k / 3][k % 3] = p[k / 3][k % 3].at(least);
    whole[1][k / 3][k % 3] = q[k / 3][k % 3].at(least);
  }
  return std::ldexp(squaredDistance(whole[0], whole[1]), 2 * least);
}

/// Corners as whole numbers times a power of two, where these are below 2^18: then ways between corners are below 2^19,
/// cross products 2^39, triple products 2^60 and the squares of these 2^120.
inline bool small(const Corners& p, const Corners& q, Vec<Small> (&whole)[2][3], double& unit) {
  double most = 0, least = std::numeric_limits<double>::infinity();
  for (const Corners* t : {&p, &q}) {
    for (const Eigen::Vector3d& v : *t) {
      for (int c = 0; c < 3; ++c) {
        most = std::max(most, std::abs(v[c]));
        if (v[c] != 0) least = std::min(least, std::abs(v[c]));
      }
    }
  }
  if (!(most > 1e-200 && most < 1e200)) return false;
  unit = std::ldexp(1.0, std::ilogb(most) + 1 - 18);
  if (least < unit) return false;
  for (int k = 0; k < 9; ++k) {
    for (int side = 0; side < 2; ++side) {
      const double x = (side == 0 ? p : q)[k / 3][k % 3] / unit;
      if (x != std::trunc(x)) return false;
      whole[side][k / 3][k % 3] = static_cast<std::int64_t>(x);
    }
  }
  return true;
}

}  // namespace detail

/// The square of the distance of two closed triangles, segments or points: 0 exactly where they meet, else with a
/// relative error of a few units of long double.
inline long double squaredDistance(const Corners& p, const Corners& q) {
  detail::Vec<detail::Small> whole[2][3];
  double unit = 0;
  if (!detail::small(p, q, whole, unit)) return detail::squaredDistance(detail::numbersOf(p), detail::numbersOf(q));
  return detail::squaredDistance(whole[0], whole[1]) * static_cast<long double>(unit) * static_cast<long double>(unit);
}

/// The same with q placed by X, whose entries are taken as they are: no rounding there either.
inline long double squaredDistance(const Corners& p, const Eigen::Isometry3d& X, const Corners& q) {
  return detail::squaredDistance(detail::numbersOf(p), detail::placed(X, q));
}

/// Do the closed sets share a point?
inline bool intersect(const Corners& p, const Corners& q) { return squaredDistance(p, q) == 0; }
inline bool intersect(const Corners& p, const Eigen::Isometry3d& X, const Corners& q) {
  return squaredDistance(p, X, q) == 0;
}

}  // namespace bocst::exact
