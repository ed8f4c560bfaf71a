// Pass 2: octants that no triangle surely meets, but that some may: the reference test (oracle/reference.h), operation
// by operation in double, so that grey is the same for all oracles. Without `precise`: with it, NVIDIA's driver 580
// computes arrays of doubles in float. So products that are added come from product().

uniform double u_zero;  // 0, as all uniforms at first; the compiler does not know

// A product that is rounded by itself, whatever is done with it.
double product(double a, double b) { return fma(a, b, u_zero); }

const double kBoxRoundingMargin = 16.0lf * 65536.0lf / 9007199254740992.0lf;  // 16 * 2^16 * 2^-53
const double kPlaneRoundingMargin = 32.0lf / 9007199254740992.0lf;

bool triangleMeetsCube(dvec3 corners[3], dvec3 center, double side) {
  double h = side + kBoxRoundingMargin;
  dvec3 v[3], e[3];
  for (int k = 0; k < 3; ++k) v[k] = corners[k] - center;
  for (int k = 0; k < 3; ++k) {
    if (min(min(v[0][k], v[1][k]), v[2][k]) > h || max(max(v[0][k], v[1][k]), v[2][k]) < -h) return false;
  }
  for (int k = 0; k < 3; ++k) e[k] = corners[(k + 1) % 3] - corners[k];

  double n[3], size[3];
  for (int k = 0; k < 3; ++k) {
    int i = (k + 1) % 3, j = (k + 2) % 3;
    double a = product(e[0][i], e[1][j]), b = product(e[0][j], e[1][i]);
    n[k] = a - b;
    size[k] = abs(a) + abs(b);
  }
  double width = (abs(n[0]) + abs(n[1])) + abs(n[2]);
  double s0 = product(size[0], abs(v[0][0]) + h), s1 = product(size[1], abs(v[0][1]) + h),
         s2 = product(size[2], abs(v[0][2]) + h);
  double products = (s0 + s1) + s2;
  double reach_n = product(h, width), reach_p = product(kPlaneRoundingMargin, products);
  double reach = reach_n + reach_p;
  double d0 = product(n[0], v[0][0]), d1 = product(n[1], v[0][1]), d2 = product(n[2], v[0][2]);
  double along = (d0 + d1) + d2;
  if (abs(along) > reach) return false;

  for (int i = 0; i < 3; ++i) {
    dvec3 a = v[i], b = v[(i + 2) % 3];
    for (int k = 0; k < 3; ++k) {
      int p = (k + 1) % 3, q = (k + 2) % 3;
      double ep = e[i][p], eq = e[i][q];
      double sa = product(ep, a[q]), sb = product(eq, a[p]), ta = product(ep, b[q]), tb = product(eq, b[p]);
      double s = sa - sb, t = ta - tb;
      double sum = abs(ep) + abs(eq);
      double r = h * sum;
      if (min(s, t) > r || max(s, t) < -r) return false;
    }
  }
  return true;
}

double doubleAt(uint at) { return packDouble2x32(uvec2(meshes[at], meshes[at + 1u])); }

void main() {
  countGroup();
  uint pair = item();
  if (pair >= u_items.y) return;
  uint maybe = maskOf(pair);
  if (maybe == 0u) return;
  uint cell = cellOf(pair);
  uint open = maybe & ~states[state(cell, kGrey)];
  if (open == 0u) return;
  uint triangle = triangleOf(cell, pair);
  dvec3 corners[3];
  for (int k = 0; k < 3; ++k) {
    uint at = cells[cell].exact + 6u * meshes[cells[cell].indices + 3u * triangle + uint(k)];
    corners[k] = dvec3(doubleAt(at), doubleAt(at + 2u), doubleAt(at + 4u));
  }
  double side = double(cells[cell].half_side) / 2.0lf;
  dvec3 center = dvec3(cells[cell].center);
  for (; open != 0u; open &= open - 1u) {
    int o = findLSB(open);
    dvec3 displacement = dvec3(octantCenter(o)) * (2.0lf * side);
    if (triangleMeetsCube(corners, center + displacement, side)) atomicOr(states[state(cell, kGrey)], 1u << o);
  }
}
