// The part of a triangle in one octant, as a polygon. Float positions are off by a few roundings of the triangle's size
// M at each of the six cuts, which `margin` = 64 u M covers: planes and bounds are moved out by it.

float marginOf(vec3 v[3]) {
  vec3 size = max(max(abs(v[0]), abs(v[1])), abs(v[2]));
  return 64.0 * kUlp * max(1.0, max(max(size.x, size.y), size.z));
}

struct Polygon {
  vec3 corners[9];
  int count;
};

void cut(inout Polygon p, int axis, float bound, float sign) {
  Polygon q;
  q.count = 0;
  for (int i = 0; i < p.count; ++i) {
    vec3 a = p.corners[i], b = p.corners[i + 1 == p.count ? 0 : i + 1];
    float da = sign * (a[axis] - bound), db = sign * (b[axis] - bound);
    if (da <= 0.0 && q.count < 9) q.corners[q.count++] = a;
    if (((da < 0.0 && db > 0.0) || (da > 0.0 && db < 0.0)) && q.count < 9) {
      vec3 x = a + (da / (da - db)) * (b - a);
      q.corners[q.count++] = mix(x, vec3(bound), equal(ivec3(0, 1, 2), ivec3(axis)));
    }
  }
  p = q;
}

Polygon clipToOctant(vec3 v[3], int octant, float margin) {
  Polygon p;
  p.corners[0] = v[0];
  p.corners[1] = v[1];
  p.corners[2] = v[2];
  p.count = 3;
  vec3 center = octantCenter(octant), lo = min(min(v[0], v[1]), v[2]), hi = max(max(v[0], v[1]), v[2]);
  float reach = 0.5 + margin;
  // Most triangles cross few of the planes; a loop over those is short, where branches would cost what they skip.
  uint planes = 0u;
  for (int axis = 0; axis < 3; ++axis) {
    if (hi[axis] > center[axis] + reach) planes |= 1u << (2 * axis);
    if (lo[axis] < center[axis] - reach) planes |= 2u << (2 * axis);
  }
  for (; planes != 0u; planes &= planes - 1u) {
    int plane = findLSB(planes), axis = plane / 2;
    float sign = plane % 2 == 0 ? 1.0 : -1.0;
    cut(p, axis, center[axis] + sign * reach, sign);
  }
  return p;
}
