// Pass 6: how far the surface in each octant reaches along its slab's normal.

void main() {
  countGroup();
  if (isOverflown()) return;
  uint pair = item();
  if (pair >= u_items.y) return;
  uint mask = maskOf(pair) & octantsOfLane();
  if (mask == 0u) return;
  uint cell = cellOf(pair);
  mask &= states[state(cell, kGrey)] & ~states[state(cell, kBoxOnly)];
  if (mask == 0u) return;
  vec3 v[3];
  cornersOf(cell, triangleOf(cell, pair), v);
  float margin = marginOf(v);
  for (; mask != 0u; mask &= mask - 1u) {
    int o = findLSB(mask);
    uint bytes = states[octantState(cell, o, kNormal)];
    if (bytes == 0u) continue;
    vec3 n = vec3(bitfieldExtract(int(bytes), 0, 8), bitfieldExtract(int(bytes), 8, 8), bitfieldExtract(int(bytes), 16, 8));
    Polygon p = clipToOctant(v, o, margin);
    if (p.count == 0) continue;
    vec3 center = octantCenter(o);
    float lo = 1e30, hi = -1e30;
    for (int i = 0; i < p.count; ++i) {
      float t = dot(n, p.corners[i] - center);
      lo = min(lo, t);
      hi = max(hi, t);
    }
    float tolerance = float(kMostNormalNorm1) * margin;
    const float shift = float(kSlabShift), scale = float(kSlabScale), most = 2.0 * shift * scale;
    uint below = uint(clamp(ceil((shift - lo + tolerance) * scale) + 1.0, 0.0, most));
    uint above = uint(clamp(ceil((shift + hi + tolerance) * scale) + 1.0, 0.0, most));
    atomicMax(states[octantState(cell, o, kSlab)], below);
    atomicMax(states[octantState(cell, o, kSlab + 1u)], above);
  }
}
