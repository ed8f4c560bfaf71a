// Pass 3, one invocation a cell: room for the lists of its grey octants, and for the ids of those that the host wants.

void main() {
  countGroup();
  uint cell = item();
  if (cell >= u_cell_count) return;
  uint grey = states[state(cell, kGrey)];
  uint words = 0u, ids = 0u;
  for (int o = 0; o < 8; ++o) {
    uint count = state(cell, kCounts + uint(o));
    if ((grey >> o & 1u) == 0u) states[count] = 0u;
    words += states[count];
    if (states[count] <= cells[cell].ids_up_to) ids += states[count];
  }
  uint row = kHeader + cell * kRow;
  uint begin = u_list_capacity.x + atomicAdd(answers[kListWords], words);
  answers[row + kRowList] = begin;
  answers[row + kRowIds] = atomicAdd(answers[kIdWords], ids);
  for (int o = 0; o < 8; ++o) {
    answers[row + kRowSizes + uint(o)] = sizeOf(cell, o);
    states[state(cell, kNext + uint(o))] = begin;
    begin += sizeOf(cell, o);
  }
}
