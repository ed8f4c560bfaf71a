// Pass 7, one invocation a cell: the answer as bytes, as CellAnswer (oracle/gl/layout.h) has them.

uint row[kBoundsWords];

void put(uint at, uint byte) { row[at / 4u] |= (byte & 0xffu) << (at % 4u * 8u); }

void main() {
  countGroup();
  if (isOverflown()) return;
  uint cell = invocation();
  if (cell >= u_cell_count) return;
  for (uint i = 0u; i < kBoundsWords; ++i) row[i] = 0u;
  uint grey = states[state(cell, kGrey)];
  uint own_lo[3] = uint[3](2u * kBoxSteps + 1u, 2u * kBoxSteps + 1u, 2u * kBoxSteps + 1u);
  uint own_hi[3] = uint[3](0u, 0u, 0u);
  for (int o = 0; o < 8; ++o) {
    if ((grey >> o & 1u) == 0u) continue;
    for (int k = 0; k < 3; ++k) {
      uint lo = kBoxSteps - min(states[octantState(cell, o, kBox + uint(k))], kBoxSteps);
      uint hi = states[octantState(cell, o, kBox + 3u + uint(k))];
      put(kLoBytes + uint(k * 8 + o), lo);
      put(kHiBytes + uint(k * 8 + o), hi);
      uint shift = (o >> k & 1) != 0 ? kBoxSteps : 0u;
      own_lo[k] = min(own_lo[k], shift + lo);
      own_hi[k] = max(own_hi[k], shift + hi);
    }
    uint normal = states[octantState(cell, o, kNormal)];
    uint slab_half = kMostSlabHalf;
    if ((states[state(cell, kLoose)] >> o & 1u) == 0u && normal != 0u) {
      const float shift = float(kSlabShift), scale = float(kSlabScale);
      float below = shift - float(states[octantState(cell, o, kSlab)]) / scale;
      float above = float(states[octantState(cell, o, kSlab + 1u)]) / scale - shift;
      float middle = round((below + above) / 2.0);
      float thickness = ceil(2.0 * max(above - middle, middle - below));
      if (thickness <= float(kMostSlabHalf) && abs(middle) <= float(kMostSlabCenter)) {
        slab_half = uint(max(thickness, 0.0));
        for (uint k = 0u; k < 3u; ++k) put(kNormalBytes + k * 8u + uint(o), normal >> (8u * k));
        put(kSlabCenterBytes + uint(o), uint(int(middle)));
      }
    }
    put(kSlabHalfBytes + uint(o), slab_half);
  }
  if (grey != 0u) {
    for (int k = 0; k < 3; ++k) {
      put(kOwnLoBytes + uint(k), own_lo[k] / 2u);
      put(kOwnHiBytes + uint(k), (own_hi[k] + 1u) / 2u);
    }
  } else {
    for (int k = 0; k < 3; ++k) put(kOwnHiBytes + uint(k), kBoxSteps);
  }
  put(kOwnSlabHalfBytes, kMostSlabHalf);  // the slab of the cell itself follows from those of its octants
  put(kGreyBytes, grey);
  uint at = kHeader + cell * kRow, end = answers[at + kRowList];
  for (uint i = 0u; i < kBoundsWords; ++i) answers[at + i] = row[i];
  for (int o = 0; o < 8; ++o) {
    end += sizeOf(cell, o);
    if (states[state(cell, kNext + uint(o))] != end) atomicOr(answers[kFailed], kListsFailed);
  }
  answers[at + kRowSum] = states[state(cell, kIds)];
  answers[at + kRowCheck] = checkOf(cell);
  if (cell == 0u) answers[kHeader + u_cell_count * kRow + answers[kIdWords]] = u_batch;
}
