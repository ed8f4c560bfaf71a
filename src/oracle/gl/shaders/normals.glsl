// Pass 5, eight lanes an octant: the ids that the host wants, short lists in order, and the normal of its slab.

const uint kSorted = 32u;

void copyIds(uint cell, int octant, uint lane) {
  uint row = kHeader + cell * kRow;
  uint from = answers[row + kRowList], to = kHeader + u_cell_count * kRow + answers[row + kRowIds];
  for (int o = 0; o < octant; ++o) {
    from += sizeOf(cell, o);
    if (sizeOf(cell, o) <= cells[cell].ids_up_to) to += sizeOf(cell, o);
  }
  uint size = sizeOf(cell, octant);
  if (size > cells[cell].ids_up_to) return;
  for (uint i = lane; i < size; i += 8u) {
    uint id = lists[from + i], place = i;
    if (size <= kSorted) {
      place = 0u;
      for (uint k = 0u; k < size; ++k) place += uint(lists[from + k] < id);
    }
    answers[to + place] = id;
  }
}

void main() {
  countGroup();
  if (isOverflown()) return;
  uint cell = item(), lane = laneOfItem();
  int o = int(lane / 8u);
  if (cell >= u_items.y || (states[state(cell, kGrey)] >> o & 1u) == 0u) return;
  copyIds(cell, o, lane % 8u);
  if (lane % 8u != 0u) return;
  if ((states[state(cell, kBoxOnly)] >> o & 1u) != 0u || sizeOf(cell, o) > kSlabTriangles) return;

  float t[6];
  for (uint k = 0u; k < 6u; ++k) t[k] = float(int(states[octantState(cell, o, kTensor + k)]));
  mat3 m = mat3(t[0], t[3], t[5], t[3], t[1], t[4], t[5], t[4], t[2]);
  float trace = t[0] + t[1] + t[2];
  if (!(trace > 0.0)) return;
  m /= trace;
  // Powers of a symmetric matrix turn its columns towards the largest eigenvector.
  for (int i = 0; i < 4; ++i) {
    m = m * m;
    m /= max(m[0][0] + m[1][1] + m[2][2], 1e-30);
  }
  vec3 n = m[0];
  if (dot(m[1], m[1]) > dot(n, n)) n = m[1];
  if (dot(m[2], m[2]) > dot(n, n)) n = m[2];
  float size = length(n);
  if (!(size > 0.0)) return;
  ivec3 bytes = ivec3(round(n / size * float(kNormalLength)));
  states[octantState(cell, o, kNormal)] =
      uint(bytes.x & 0xff) | uint(bytes.y & 0xff) << 8 | uint(bytes.z & 0xff) << 16;
}
