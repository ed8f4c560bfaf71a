// What the passes of the compute oracle share: the tables they read and write, and how a pair finds its cell.
//
// A *pair* is a triangle and a cell to expand whose list it is on. Pairs are numbered through the whole batch, cell by
// cell; an invocation works on one pair, so lanes stay busy however short the lists are.
//
// The constants of the tables (States, Answers) and of the bytes of bounds stand before this text: see oracle/gl/layout.h.

layout(local_size_x = GROUP) in;

struct Cell {
  vec3 center;      // in lattice units
  float half_side;
  uint first_pair;
  uint list;        // where its list begins in `lists`, or kAll
  uint exists;      // octants that have an actual region
  uint ids_up_to;   // longer lists are not wanted by the host
  uint indices;     // words of `meshes` where its mesh has vertex numbers,
  uint vertices;    // vertices as three high and three low parts,
  uint exact;       // and as doubles
  uint batch;
};

const uint kSlabTriangles = 4096u;  // longer lists belong to cells whose slabs cull nothing

layout(std430, binding = 0) readonly buffer Meshes { uint meshes[]; };
layout(std430, binding = 1) buffer Lists { uint lists[]; };
layout(std430, binding = 2) readonly buffer Cells { Cell cells[]; };
layout(std430, binding = 3) buffer States { uint states[]; };
layout(std430, binding = 4) buffer Masks { uint masks[]; };
layout(std430, binding = 5) buffer Answers { uint answers[]; };

uniform uvec2 u_items;      // first and end of the pairs, or cells, of this dispatch
uniform uint u_lanes;       // invocations for each
uniform uint u_cell_count;  // of the batch
uniform uvec2 u_list_capacity;  // first word and number of words
uniform uint u_id_capacity;
uniform uint u_batch;           // its number

// The first line of each pass: see kGroups in layout.h.
void countGroup() {
  if (gl_LocalInvocationIndex == 0u) atomicAdd(answers[kGroups + kPass], 1u);
}

uint item() { return u_items.x + gl_GlobalInvocationID.x / u_lanes; }
uint laneOfItem() { return gl_GlobalInvocationID.x % u_lanes; }
// The octants that are this lane's.
uint octantsOfLane() { return u_lanes == 1u ? 0xffu : 1u << laneOfItem(); }

uint cellOf(uint pair) {
  uint lo = 0u, hi = u_cell_count;  // cells[lo].first_pair <= pair < cells[hi].first_pair
  while (hi - lo > 1u) {
    uint middle = (lo + hi) / 2u;
    if (cells[middle].first_pair <= pair) lo = middle; else hi = middle;
  }
  return lo;
}

uint triangleOf(uint cell, uint pair) {
  uint i = pair - cells[cell].first_pair;
  return cells[cell].list == kAll ? i : lists[cells[cell].list + i];
}

uint state(uint cell, uint word) { return cell * kStateWords + word; }
uint octantState(uint cell, int octant, uint word) {
  return state(cell, kOctants + uint(octant) * kOctantWords + word);
}

// True if a list or the ids found no room. Then the host makes room and starts over from the placing of the lists.
bool isOverflown() { return answers[kListWords] > u_list_capacity.y || answers[kIdWords] > u_id_capacity; }

// What pass 1 wrote of a pair: the octants that it may meet.
uint maskOf(uint pair) {
  uint word = masks[pair];
  if (word >> 8 != u_batch) atomicOr(answers[kFailed], kMasksFailed);
  return word & 0xffu;
}

uint checkOf(uint cell) {
  Cell c = cells[cell];
  uint sum = floatBitsToUint(c.center.x);
  sum = sum * kCheckFactor + floatBitsToUint(c.center.y);
  sum = sum * kCheckFactor + floatBitsToUint(c.center.z);
  sum = sum * kCheckFactor + floatBitsToUint(c.half_side);
  sum = sum * kCheckFactor + c.first_pair;
  sum = sum * kCheckFactor + c.list;
  sum = sum * kCheckFactor + c.exists;
  sum = sum * kCheckFactor + c.ids_up_to;
  sum = sum * kCheckFactor + c.indices;
  sum = sum * kCheckFactor + c.vertices;
  sum = sum * kCheckFactor + c.exact;
  return sum * kCheckFactor + c.batch;
}

uint sizeOf(uint cell, int octant) { return states[state(cell, kCounts + uint(octant))]; }

vec3 partOf(uint at) {
  return vec3(uintBitsToFloat(meshes[at]), uintBitsToFloat(meshes[at + 1u]), uintBitsToFloat(meshes[at + 2u]));
}

// Corners in the cell's own coordinates, centre 0 and half side 1: two roundings at most, as the rounding margins expect.
// `precise`, since in another order the sum is off by what the lattice's coordinates round, not the cell's.
void cornersOf(uint cell, uint triangle, out vec3 v[3]) {
  float inverse = 1.0 / cells[cell].half_side;  // a power of two
  for (int k = 0; k < 3; ++k) {
    uint at = cells[cell].vertices + 6u * meshes[cells[cell].indices + 3u * triangle + uint(k)];
    precise vec3 from = partOf(at) - cells[cell].center;
    precise vec3 corner = from + partOf(at + 3u);
    v[k] = corner * inverse;
  }
}

vec3 octantCenter(int o) { return vec3((o & 1) != 0, (o & 2) != 0, (o & 4) != 0) - 0.5; }

const float kUlp = 1.0 / 16777216.0;  // 2^-24
