// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/penetration_kernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "geometry/penetration_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "simd/vectors-inl.h"

HWY_BEFORE_NAMESPACE();
namespace bocst::query::HWY_NAMESPACE {

using Dd = hn::CappedTag<double, 8>;
using Vd = hn::Vec<Dd>;
using Md = hn::Mask<Dd>;
using Vec3d = Vec3Of<Vd>;

// A cross product of edges so short, squared and as a share of the edges' squares, is their rounding.
constexpr double kShortest = 1e-20;

struct LeastOverlap {
  Vd depth;
  Vec3d normal;
};

// Two triangles from a corner of the first on, which is at the origin.
struct BothTriangles {
  Vec3d p[3], q[3];
};

// Takes the overlap along an axis if it is the least. An axis no longer than the root of `shortest` is all rounding.
HWY_INLINE void consider(const BothTriangles& t, const Vec3d& axis, Vd shortest, LeastOverlap& least) {
  const Dd d;
  const Vd zero = hn::Zero(d), length = dot(axis, axis);
  const Vd p1 = dot(axis, t.p[1]), p2 = dot(axis, t.p[2]);
  const Vd q0 = dot(axis, t.q[0]), q1 = dot(axis, t.q[1]), q2 = dot(axis, t.q[2]);
  const Vd inverse = hn::Div(hn::Set(d, 1.0), hn::Sqrt(length));
  // Two translations end the overlap: q beyond the upper end of p, or below its lower end.
  const Vd up = hn::Sub(max3(zero, p1, p2), min3(q0, q1, q2)), down = hn::Sub(max3(q0, q1, q2), min3(zero, p1, p2));
  const Vd depth = hn::Mul(hn::Min(up, down), inverse);
  const Md better = hn::And(hn::Gt(length, shortest), hn::Lt(depth, least.depth));
  const Vd scale = hn::IfThenElse(hn::Lt(down, up), hn::Neg(inverse), inverse);
  least.depth = hn::IfThenElse(better, depth, least.depth);
  least.normal = choose(better, scaled(axis, scale), least.normal);
}

// Where a triangle whose corners are above[k] over a plane cuts it. False where a corner is on the plane, or all are on
// one side.
HWY_INLINE Md cut(const Vec3d (&t)[3], const Vd (&above)[3], Vec3d& a, Vec3d& b) {
  const Dd d;
  const Vd zero = hn::Zero(d);
  const Md below = hn::Lt(above[0], zero);
  const Md other1 = hn::Xor(below, hn::Lt(above[1], zero)), other2 = hn::Xor(below, hn::Lt(above[2], zero));
  // The corner that is alone on its side, and the others.
  const Md alone0 = hn::And(other1, other2), alone2 = hn::AndNot(other1, other2);
  const Md alone1 = hn::AndNot(other2, other1);
  const Vec3d alone = choose(alone1, t[1], choose(alone2, t[2], t[0]));
  const Vec3d u = choose(alone0, t[1], t[0]), v = choose(alone2, t[1], t[2]);
  const Vd x = hn::IfThenElse(alone1, above[1], hn::IfThenElse(alone2, above[2], above[0]));
  const Vd y = hn::IfThenElse(alone0, above[1], above[0]), z = hn::IfThenElse(alone2, above[1], above[2]);
  a = along(alone, hn::Div(x, hn::Sub(x, y)), sub(u, alone));
  b = along(alone, hn::Div(x, hn::Sub(x, z)), sub(v, alone));
  const Md none = hn::Or(hn::Eq(above[0], zero), hn::Or(hn::Eq(above[1], zero), hn::Eq(above[2], zero)));
  return hn::AndNot(none, hn::Or(other1, other2));
}

// Edges, normal and squared lengths of a vector of triangles.
struct Edges {
  Vec3d edge[3], normal;
  Vd squared[3], normal_squared;
  Vd shortest;  ///< A squared normal of edges so short is their rounding.
};

HWY_INLINE Edges edgesOf(const Vec3d (&t)[3]) {
  Edges e;
  e.edge[0] = sub(t[1], t[0]), e.edge[1] = sub(t[2], t[1]), e.edge[2] = sub(t[0], t[2]);
  BOCST_UNROLL
  for (int k = 0; k < 3; ++k) e.squared[k] = dot(e.edge[k], e.edge[k]);
  e.normal = cross(e.edge[0], e.edge[1]);
  e.normal_squared = dot(e.normal, e.normal);
  e.shortest = hn::Mul(hn::Set(Dd(), kShortest), hn::Mul(e.squared[0], e.squared[1]));
  return e;
}

// The axis of least overlap among the normals and the cross products of edges. `areas`: both triangles have one.
HWY_INLINE LeastOverlap leastOverlap(const BothTriangles& t, const Edges& e, const Edges& f, Md areas) {
  const Dd d;
  const Vd zero = hn::Zero(d), tiny = hn::Set(d, kShortest);
  LeastOverlap least;
  least.depth = hn::Set(d, 1e300);
  least.normal = {hn::Set(d, 1.0), zero, zero};
  consider(t, e.normal, e.shortest, least);
  consider(t, f.normal, f.shortest, least);
  for (int a = 0; a < 3; ++a) {
    BOCST_UNROLL
    for (int b = 0; b < 3; ++b) {
      consider(t, cross(e.edge[a], f.edge[b]), hn::Mul(tiny, hn::Mul(e.squared[a], f.squared[b])), least);
    }
  }
  // Between triangles with an area and no common plane, the difference of the two has no other faces; in a common
  // plane the overlap along its normal is 0.
  if (hn::AllTrue(d, areas)) return least;
  // What a pair gets must not depend on its neighbours: to others these axes are all rounding.
  const auto shortest = [&](Vd edge, Vd normal) HWY_ATTR {
    return hn::IfThenElse(areas, hn::Inf(d), hn::Mul(tiny, hn::Mul(edge, normal)));
  };
  for (int a = 0; a < 3; ++a) {
    consider(t, cross(e.edge[a], e.normal), shortest(e.squared[a], e.normal_squared), least);
    consider(t, cross(f.edge[a], f.normal), shortest(f.squared[a], f.normal_squared), least);
  }
  return least;
}

// Each triangle cuts the other's plane in a segment of the line of the two planes: the middle of what they share, and
// whether there is one.
struct CutMiddle {
  Vec3d point;
  Md exists;
};

HWY_INLINE CutMiddle cutMiddle(const BothTriangles& t, const Edges& e, const Edges& f, Md areas) {
  const Dd d;
  const Vd zero = hn::Zero(d);
  const Vec3d &n = e.normal, &m = f.normal;
  const Vd above_q[3] = {dot(m, sub(t.p[0], t.q[0])), dot(m, sub(t.p[1], t.q[0])), dot(m, sub(t.p[2], t.q[0]))};
  const Vd above_p[3] = {dot(n, t.q[0]), dot(n, t.q[1]), dot(n, t.q[2])};
  Vec3d a, b, c, g;
  const Md cuts = hn::And(cut(t.p, above_q, a, b), cut(t.q, above_p, c, g));
  const Vec3d line = cross(n, m);
  const Vd squared = dot(line, line);
  const Vec3d direction = scaled(line, hn::Div(hn::Set(d, 1.0), hn::Sqrt(squared)));
  const Vd pb = dot(direction, sub(b, a)), qc = dot(direction, sub(c, a)), qd = dot(direction, sub(g, a));
  const Vd lo = hn::Max(hn::Min(pb, zero), hn::Min(qc, qd)), hi = hn::Min(hn::Max(pb, zero), hn::Max(qc, qd));
  const Vd least =
      hn::Mul(hn::Set(d, kLeastSineOfPlanes * kLeastSineOfPlanes), hn::Mul(e.normal_squared, f.normal_squared));
  const Md slanted = hn::And(areas, hn::Gt(squared, least));
  return {along(a, hn::Mul(hn::Add(lo, hi), hn::Set(d, 0.5)), direction),
          hn::And(hn::And(cuts, slanted), hn::Le(lo, hi))};
}

void PenetrationsOfPairs(const TrianglePairs& pairs, double tolerance, PairPenetrations& contacts) {
  const Dd d;
  const Vd zero = hn::Zero(d);
  contacts.no_point = contacts.meet = contacts.apart = 0;
  for (std::size_t i = 0; i < pairs.count; i += hn::Lanes(d)) {
    const auto at = [&](std::size_t k) HWY_ATTR {
      return Vec3d{hn::Load(d, pairs.xyz[3 * k] + i), hn::Load(d, pairs.xyz[3 * k + 1] + i),
                   hn::Load(d, pairs.xyz[3 * k + 2] + i)};
    };
    const Vec3d origin = at(0);
    BothTriangles t;
    t.p[0] = {zero, zero, zero};
    BOCST_UNROLL
    for (std::size_t k = 0; k < 3; ++k) {
      if (k > 0) t.p[k] = sub(at(k), origin);
      t.q[k] = sub(at(3 + k), origin);
    }
    const Edges e = edgesOf(t.p), f = edgesOf(t.q);
    // The plane of a triangle without area is rounding.
    const Md areas = hn::And(hn::Gt(e.normal_squared, e.shortest), hn::Gt(f.normal_squared, f.shortest));

    const LeastOverlap least = leastOverlap(t, e, f, areas);
    const Vd depth = hn::IfThenElse(hn::Lt(least.depth, hn::Set(d, 1e300)), least.depth, zero);
    hn::Store(depth, d, contacts.depth + i);
    const Vd longest = hn::Sqrt(
        hn::Max(max3(e.squared[0], e.squared[1], e.squared[2]), max3(f.squared[0], f.squared[1], f.squared[2])));
    const Vd cutoff = hn::MulAdd(hn::Set(d, 1e-4), longest, hn::Set(d, tolerance));
    contacts.meet |= bitsOf(Dd(), hn::Gt(depth, cutoff)) << i;
    contacts.apart |= bitsOf(Dd(), hn::Gt(hn::Neg(depth), cutoff)) << i;
    hn::Store(least.normal.x, d, contacts.normal[0] + i);
    hn::Store(least.normal.y, d, contacts.normal[1] + i);
    hn::Store(least.normal.z, d, contacts.normal[2] + i);

    const CutMiddle middle = cutMiddle(t, e, f, areas);
    const Vec3d point = along(origin, hn::Set(d, 1.0), middle.point);
    hn::Store(point.x, d, contacts.point[0] + i);
    hn::Store(point.y, d, contacts.point[1] + i);
    hn::Store(point.z, d, contacts.point[2] + i);
    contacts.no_point |= bitsOf(Dd(), hn::Not(middle.exists)) << i;
  }
  if (pairs.count < 32) {
    const std::uint32_t all = (1u << pairs.count) - 1;
    contacts.no_point &= all;
    contacts.meet &= all;
    contacts.apart &= all;
  }
}

}  // namespace bocst::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bocst::query {

HWY_EXPORT(PenetrationsOfPairs);

void penetrationsOfPairs(const TrianglePairs& pairs, double tolerance, PairPenetrations& contacts) {
  HWY_DYNAMIC_DISPATCH(PenetrationsOfPairs)(pairs, tolerance, contacts);
}

}  // namespace bocst::query
#endif
