// Pass 1: which octants each triangle may meet, and which it surely meets. The separating-axis test of octantMasks()
// (oracle/cpu/kernels.h) with its rounding margins: 16 u M on the half side, 24 u on the products of the plane equation. Here
// corners carry two roundings rather than one, 9.5 u M in all. With the rounding margins taken away instead of added, what still
// overlaps on every axis surely touches.

shared uint s_cells[2];
shared uint s_counts[8];
shared uint s_grey;
shared uint s_ids;

const uint kUpper[3] = uint[3](0xaau, 0xccu, 0xf0u);

uint sideMask(int axis, bool upper) { return upper ? kUpper[axis] : ~kUpper[axis] & 0xffu; }

void edgeAxis(float ep, float eq, float ap, float aq, float bp, float bq, float rounding_margin, int p, int q, inout uint maybe,
              inout uint surely) {
  float fa = ep * aq - eq * ap, fb = ep * bq - eq * bp;
  float lo = min(fa, fb), hi = max(fa, fb);
  float size = abs(ep) + abs(eq);
  float r = (0.5 + rounding_margin) * size, rs = (0.5 - rounding_margin) * size;
  for (int s = 0; s < 4; ++s) {
    bool sp = (s & 1) != 0, sq = (s & 2) != 0;
    float c = (sq ? 0.5 * ep : -0.5 * ep) + (sp ? -0.5 * eq : 0.5 * eq);
    uint octants = sideMask(p, sp) & sideMask(q, sq);
    if (lo - r > c || hi + r < c) maybe &= ~octants;
    if (!(lo - rs <= c && hi + rs >= c)) surely &= ~octants;
  }
}

void overlaps(vec3 v[3], out uint maybe, out uint surely) {
  vec3 size3 = max(max(abs(v[0]), abs(v[1])), abs(v[2]));
  float rounding_margin = 16.0 * kUlp * max(1.0, max(max(size3.x, size3.y), size3.z));
  maybe = surely = 0xffu;
  vec3 lo = min(min(v[0], v[1]), v[2]), hi = max(max(v[0], v[1]), v[2]);
  for (int c = 0; c < 3; ++c) {
    if (lo[c] > rounding_margin || hi[c] < -1.0 - rounding_margin) maybe &= kUpper[c];
    if (hi[c] < -rounding_margin || lo[c] > 1.0 + rounding_margin) maybe &= ~kUpper[c];
    if (!(lo[c] <= -rounding_margin && hi[c] >= rounding_margin - 1.0)) surely &= kUpper[c];
    if (!(hi[c] >= rounding_margin && lo[c] <= 1.0 - rounding_margin)) surely &= ~kUpper[c];
  }
  if (maybe == 0u) {
    surely = 0u;
    return;
  }

  vec3 e[3] = vec3[3](v[1] - v[0], v[2] - v[1], v[0] - v[2]);
  vec3 a = e[0].yzx * e[1].zxy, b = e[0].zxy * e[1].yzx;
  vec3 n = a - b;
  float along = dot(n, v[0]), width = abs(n.x) + abs(n.y) + abs(n.z);
  float tolerance = 24.0 * kUlp * dot(abs(a) + abs(b), abs(v[0]) + 1.0);
  float reach = (0.5 + rounding_margin) * width + tolerance, reach_surely = (0.5 - rounding_margin) * width - tolerance;
  for (int o = 0; o < 8; ++o) {
    float d = abs(along - dot(n, octantCenter(o)));
    if (d > reach) maybe &= ~(1u << o);
    if (!(d <= reach_surely)) surely &= ~(1u << o);
  }
  for (int k = 0; k < 3; ++k) {
    vec3 at = v[k], across = v[(k + 2) % 3];
    edgeAxis(e[k].y, e[k].z, at.y, at.z, across.y, across.z, rounding_margin, 1, 2, maybe, surely);
    edgeAxis(e[k].z, e[k].x, at.z, at.x, across.z, across.x, rounding_margin, 2, 0, maybe, surely);
    edgeAxis(e[k].x, e[k].y, at.x, at.y, across.x, across.y, rounding_margin, 0, 1, maybe, surely);
  }
  surely &= maybe;
}

void main() {
  countGroup();
  uint pair = item();
  bool has_pair = pair < u_items.y;
  uint lane = gl_LocalInvocationIndex;
  if (lane < 8u) s_counts[lane] = 0u;
  if (lane == 0u) s_grey = s_ids = 0u;
  uint cell = cellOf(min(pair, u_items.y - 1u));
  if (lane == 0u) s_cells[0] = cell;
  if (lane == GROUP - 1u) s_cells[1] = cell;
  barrier();
  bool together = s_cells[0] == s_cells[1];  // long lists: one atomic a group rather than one a triangle

  uint maybe = 0u, surely = 0u;
  if (has_pair) {
    uint triangle = triangleOf(cell, pair);
    if (together) atomicAdd(s_ids, triangle + 1u);
    else atomicAdd(states[state(cell, kIds)], triangle + 1u);
    vec3 v[3];
    cornersOf(cell, triangle, v);
    overlaps(v, maybe, surely);
    maybe &= cells[cell].exists;
    surely &= cells[cell].exists;
    masks[pair] = maybe | u_batch << 8;
  }
  if (together) {
    for (uint left = maybe; left != 0u; left &= left - 1u) atomicAdd(s_counts[findLSB(left)], 1u);
    if (surely != 0u) atomicOr(s_grey, surely);
  } else if (has_pair) {
    for (uint left = maybe; left != 0u; left &= left - 1u) {
      atomicAdd(states[state(cell, kCounts + uint(findLSB(left)))], 1u);
    }
    if (surely != 0u) atomicOr(states[state(cell, kGrey)], surely);
  }
  barrier();
  if (!together) return;
  if (lane < 8u && s_counts[lane] != 0u) atomicAdd(states[state(cell, kCounts + lane)], s_counts[lane]);
  if (lane == 8u && s_grey != 0u) atomicOr(states[state(cell, kGrey)], s_grey);
  if (lane == 9u) atomicAdd(states[state(cell, kIds)], s_ids);
}
