// Pass 7, a lane an octant: the answer as bytes, as CellAnswer (oracle/gl/layout.h) has them.

const uint kCells = GROUP / 8u;  // of a group

shared uint s_rows[kCells * kBoundsWords];
shared uint s_own[kCells * 6u];  // lo and hi of the cell's own box, in steps of the octants' boxes

uint g_cell;  // within the group

void put(uint at, uint byte) { atomicOr(s_rows[g_cell * kBoundsWords + at / 4u], (byte & 0xffu) << (at % 4u * 8u)); }

void putOctant(uint cell, int o) {
  for (uint k = 0u; k < 3u; ++k) {
    uint lo = kBoxSteps - min(states[octantState(cell, o, kBox + k)], kBoxSteps);
    uint hi = states[octantState(cell, o, kBox + 3u + k)];
    put(kLoBytes + k * 8u + uint(o), lo);
    put(kHiBytes + k * 8u + uint(o), hi);
    uint shift = (uint(o) >> k & 1u) != 0u ? kBoxSteps : 0u;
    atomicMin(s_own[g_cell * 6u + k], shift + lo);
    atomicMax(s_own[g_cell * 6u + 3u + k], shift + hi);
  }
  uint normal = states[octantState(cell, o, kNormal)];
  uint slab_half = kMostSlabHalf;
  if ((states[state(cell, kBoxOnly)] >> o & 1u) == 0u && normal != 0u) {
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

// By one lane, once the octants are there.
void putOwn(uint grey) {
  for (uint k = 0u; k < 3u; ++k) {
    put(kOwnLoBytes + k, grey != 0u ? s_own[g_cell * 6u + k] / 2u : 0u);
    put(kOwnHiBytes + k, grey != 0u ? (s_own[g_cell * 6u + 3u + k] + 1u) / 2u : kBoxSteps);
  }
  put(kOwnSlabHalfBytes, kMostSlabHalf);  // the slab of the cell itself follows from those of its octants
  put(kGreyBytes, grey);
}

void checkLists(uint cell) {
  uint end = answers[kHeader + cell * kRow + kRowList];
  for (int o = 0; o < 8; ++o) {
    end += sizeOf(cell, o);
    if (states[state(cell, kNext + uint(o))] != end) atomicOr(answers[kFailed], kListsFailed);
  }
}

void main() {
  countGroup();
  bool is_overflown = isOverflown();
  uint cell = item(), lane = laneOfItem();
  g_cell = gl_LocalInvocationIndex / 8u;
  bool works = cell < u_items.y && !is_overflown;
  for (uint i = lane; i < kBoundsWords; i += 8u) s_rows[g_cell * kBoundsWords + i] = 0u;
  if (lane < 6u) s_own[g_cell * 6u + lane] = lane < 3u ? 0xffffffffu : 0u;
  barrier();
  uint grey = works ? states[state(cell, kGrey)] : 0u;
  if ((grey >> lane & 1u) != 0u) putOctant(cell, int(lane));
  barrier();
  if (works && lane == 0u) putOwn(grey);
  barrier();
  if (!works) return;
  uint at = kHeader + cell * kRow;
  for (uint i = lane; i < kBoundsWords; i += 8u) answers[at + i] = s_rows[g_cell * kBoundsWords + i];
  if (lane == 0u) checkLists(cell);
  if (lane == 1u) {
    answers[at + kRowSum] = states[state(cell, kIds)];
    answers[at + kRowCheck] = checkOf(cell);
  }
  if (cell == 0u && lane == 2u) answers[kHeader + u_cell_count * kRow + answers[kIdWords]] = u_batch;
}
