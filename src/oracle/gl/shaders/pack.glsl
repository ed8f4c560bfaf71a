// Pass 7, one invocation a cell: the answer as bytes, in the order of OctantBounds, CellBounds and grey (oracle.h).

uint row[25];

void put(uint at, uint byte) { row[at / 4u] |= (byte & 0xffu) << (at % 4u * 8u); }

void main() {
  if (isOverflown()) return;
  uint cell = invocation();
  if (cell >= u_cell_count) return;
  for (int i = 0; i < 25; ++i) row[i] = 0u;
  uint grey = states[state(cell, kGrey)];
  uvec3 own_lo = uvec3(511u), own_hi = uvec3(0u);
  for (int o = 0; o < 8; ++o) {
    if ((grey >> o & 1u) == 0u) continue;
    for (int k = 0; k < 3; ++k) {
      uint lo = 255u - min(states[octantState(cell, o, kBox + uint(k))], 255u);
      uint hi = states[octantState(cell, o, kBox + 3u + uint(k))];
      put(uint(k * 8 + o), lo);
      put(uint(24 + k * 8 + o), hi);
      uint shift = (o >> k & 1) != 0 ? 255u : 0u;
      own_lo[k] = min(own_lo[k], shift + lo);
      own_hi[k] = max(own_hi[k], shift + hi);
    }
    uint normal = states[octantState(cell, o, kNormal)];
    uint slab_half = 255u;
    if ((states[state(cell, kLoose)] >> o & 1u) == 0u && normal != 0u) {
      float below = 512.0 - float(states[octantState(cell, o, kSlab)]) / 8192.0;
      float above = float(states[octantState(cell, o, kSlab + 1u)]) / 8192.0 - 512.0;
      float middle = round((below + above) / 2.0);
      float thickness = ceil(2.0 * max(above - middle, middle - below));
      if (thickness <= 255.0 && abs(middle) <= 127.0) {
        slab_half = uint(max(thickness, 0.0));
        for (uint k = 0u; k < 3u; ++k) put(48u + k * 8u + uint(o), normal >> (8u * k));
        put(72u + uint(o), uint(int(middle)));
      }
    }
    put(80u + uint(o), slab_half);
  }
  if (grey != 0u) {
    for (int k = 0; k < 3; ++k) {
      put(uint(88 + k), own_lo[k] / 2u);
      put(uint(91 + k), (own_hi[k] + 1u) / 2u);
    }
  } else {
    for (int k = 0; k < 3; ++k) put(uint(91 + k), 255u);
  }
  put(98u, 255u);  // the slab of the cell itself follows from those of its octants
  put(99u, grey);
  for (uint i = 0u; i < 25u; ++i) answers[kHeader + cell * kRow + kRowBounds + i] = row[i];
}
