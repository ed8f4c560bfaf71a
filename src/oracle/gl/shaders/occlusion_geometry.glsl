// The conservative form: one point for each triangle that may meet the octant, by the separating-axis test with the rounding margins
// of octantMasks() (oracle/cpu/kernels.h); corners carry two roundings here, 9.5 u M in all of the 16 u M.

layout(triangles) in;
layout(points, max_vertices = 1) out;

in vec3 corner[];

const float kUlp = 1.0 / 16777216.0;  // 2^-24

bool overlaps(vec3 v[3]) {
  vec3 size3 = max(max(abs(v[0]), abs(v[1])), abs(v[2]));
  float h = 1.0 + 16.0 * kUlp * max(1.0, max(max(size3.x, size3.y), size3.z));
  vec3 lo = min(min(v[0], v[1]), v[2]), hi = max(max(v[0], v[1]), v[2]);
  if (any(greaterThan(lo, vec3(h))) || any(lessThan(hi, vec3(-h)))) return false;
  vec3 e[3] = vec3[3](v[1] - v[0], v[2] - v[1], v[0] - v[2]);
  vec3 a = e[0].yzx * e[1].zxy, b = e[0].zxy * e[1].yzx;
  vec3 n = a - b;
  float tolerance = 24.0 * kUlp * dot(abs(a) + abs(b), abs(v[0]) + 1.0);
  if (abs(dot(n, v[0])) > h * (abs(n.x) + abs(n.y) + abs(n.z)) + tolerance) return false;
  for (int i = 0; i < 3; ++i) {
    vec3 at = v[i], across = v[(i + 2) % 3];
    for (int k = 0; k < 3; ++k) {
      int p = (k + 1) % 3, q = (k + 2) % 3;
      float ep = e[i][p], eq = e[i][q];
      float s = ep * at[q] - eq * at[p], t = ep * across[q] - eq * across[p];
      float r = h * (abs(ep) + abs(eq));
      if (min(s, t) > r || max(s, t) < -r) return false;
    }
  }
  return true;
}

void main() {
  vec3 v[3] = vec3[3](corner[0], corner[1], corner[2]);
  if (!overlaps(v)) return;
  gl_Position = vec4(0.0, 0.0, 0.0, 1.0);
  gl_PointSize = 1.0;
  EmitVertex();
  EndPrimitive();
}
