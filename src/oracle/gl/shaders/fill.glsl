// Pass 4: each triangle into the lists of its grey octants, its part there into their boxes and mean normals.

shared uint s_cells[2];
shared uint s_first[8];  // where this group's triangles begin in each list
shared uint s_counts[8];
shared uint s_boxes[48];
shared int s_tensors[48];

void addBox(bool together, uint cell, int o, uint k, uint value) {
  if (together) atomicMax(s_boxes[uint(o) * 6u + k], value);
  else atomicMax(states[octantState(cell, o, kBox + k)], value);
}

void addTensor(bool together, uint cell, int o, uint k, float value) {
  int fixed_point = int(value * 1048576.0);
  if (fixed_point == 0) return;
  if (together) atomicAdd(s_tensors[uint(o) * 6u + k], fixed_point);
  else atomicAdd(states[octantState(cell, o, kTensor + k)], uint(fixed_point));
}

void addPart(bool together, uint cell, int o, vec3 v[3]) {
  float margin = marginOf(v);
  Polygon p = clipToOctant(v, o, margin);
  vec3 center = octantCenter(o), lo, hi;
  if (p.count > 0) {
    lo = hi = p.corners[0];
    for (int i = 1; i < p.count; ++i) {
      lo = min(lo, p.corners[i]);
      hi = max(hi, p.corners[i]);
    }
  } else {
    // The test's rounding margin is wider than the clipper's: what only the test sees is bounded by the triangle's box.
    lo = clamp(min(min(v[0], v[1]), v[2]), center - 0.5, center + 0.5);
    hi = clamp(max(max(v[0], v[1]), v[2]), center - 0.5, center + 0.5);
    atomicOr(states[state(cell, kBoxOnly)], 1u << o);
  }
  const float kSteps = float(kBoxSteps);
  // 1e-3 of a byte covers the rounding of the product.
  vec3 first = clamp(floor((lo - margin - (center - 0.5)) * kSteps - 1e-3), 0.0, kSteps);
  vec3 last = clamp(ceil((hi + margin - (center - 0.5)) * kSteps + 1e-3), 0.0, kSteps);
  for (uint k = 0u; k < 3u; ++k) {
    addBox(together, cell, o, k, uint(kSteps - first[k]));
    addBox(together, cell, o, 3u + k, uint(last[k]));
  }
  if (sizeOf(cell, o) > kSlabTriangles) return;
  vec3 area = vec3(0.0);
  for (int i = 2; i < p.count; ++i) {
    area += cross(p.corners[i - 1] - p.corners[0], p.corners[i] - p.corners[0]);
  }
  float size = length(area);
  if (!(size > 0.0)) return;
  vec3 n = area / size;
  addTensor(together, cell, o, 0u, area.x * n.x);
  addTensor(together, cell, o, 1u, area.y * n.y);
  addTensor(together, cell, o, 2u, area.z * n.z);
  addTensor(together, cell, o, 3u, area.x * n.y);
  addTensor(together, cell, o, 4u, area.y * n.z);
  addTensor(together, cell, o, 5u, area.z * n.x);
}

void main() {
  countGroup();
  if (isOverflown()) return;
  uint pair = item();
  bool has_pair = pair < u_items.y;
  uint lane = gl_LocalInvocationIndex;
  if (lane < 8u) s_counts[lane] = 0u;
  if (lane < 48u) {
    s_boxes[lane] = 0u;
    s_tensors[lane] = 0;
  }
  uint cell = cellOf(min(pair, u_items.y - 1u));
  if (lane == 0u) s_cells[0] = cell;
  if (lane == GROUP - 1u) s_cells[1] = cell;
  barrier();
  bool together = s_cells[0] == s_cells[1];

  uint mask = has_pair ? maskOf(pair) & octantsOfLane() & states[state(cell, kGrey)] : 0u;
  uint triangle = has_pair ? triangleOf(cell, pair) : 0u;
  uint place[8];
  for (uint left = mask; left != 0u; left &= left - 1u) {
    int o = findLSB(left);
    place[o] = together ? atomicAdd(s_counts[o], 1u) : atomicAdd(states[state(cell, kNext + uint(o))], 1u);
  }
  if (mask != 0u) {
    vec3 v[3];
    cornersOf(cell, triangle, v);
    for (uint left = mask; left != 0u; left &= left - 1u) addPart(together, cell, findLSB(left), v);
  }
  barrier();
  if (together && lane < 8u && s_counts[lane] != 0u) {
    s_first[lane] = atomicAdd(states[state(cell, kNext + lane)], s_counts[lane]);
  }
  if (together && lane < 48u) {
    int o = int(lane / 6u);
    uint k = lane % 6u;
    if (s_boxes[lane] != 0u) atomicMax(states[octantState(cell, o, kBox + k)], s_boxes[lane]);
    if (s_tensors[lane] != 0) atomicAdd(states[octantState(cell, o, kTensor + k)], uint(s_tensors[lane]));
  }
  barrier();
  for (uint left = mask; left != 0u; left &= left - 1u) {
    int o = findLSB(left);
    lists[(together ? s_first[o] : 0u) + place[o]] = triangle;
  }
}
